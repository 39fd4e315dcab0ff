"""Numbers that many modules use, each under one name.

The percentage points are those of the standard distributions; the limits of size are our own: the
square of a quotient of two numbers inside of them is still a double.
"""

CHI2_95 = 3.841458820694124
"""95 % point of chi-square with one degree of freedom, ``scipy.special.chdtri(1, 0.05)``."""

Z_95 = CHI2_95**0.5
"""Two-sided 95 % point of the normal distribution, 1.96."""

LARGEST = 1e70
"""Numbers beyond this are no measurement: the square of a quotient of two inside is a double."""

SMALLEST = 1 / LARGEST
"""Signals, responses and steps of time below this count as nothing: their squares vanish."""
