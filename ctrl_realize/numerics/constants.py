"""Numbers that many modules use, each under one name.

The percentage points are those of the standard distributions; the limits of size are our own: the
square of a quotient of two numbers inside of them is still a double.
"""

CHI2_95 = 3.841458820694124
"""95 % point of chi-square with one degree of freedom, ``scipy.special.chdtri(1, 0.05)``."""

Z_95 = CHI2_95**0.5
"""Two-sided 95 % point of the normal distribution, 1.96."""

HUBER = 1.345
"""Standard deviations from which Huber's loss is linear: 95 % efficient in Gaussian noise (Holland
and Welsch, Comm. Statist. A 6 (1977) 813-827, table 1)."""

STRONG, VERY_STRONG = 6.0, 10.0
"""Differences of twice the log of the likelihood, or of a criterion, that are strong and very
strong evidence (R. E. Kass and A. E. Raftery, Bayes factors, J. Amer. Statist. Assoc. 90 (1995)
773-795, section 3.2)."""

OUTLIER = 4.0
"""Standard deviations at which residuals are cut where explanations are compared: of 16 000 samples
of Gaussian noise one is larger."""

FAR_OUTLIER = 5.0
"""Standard deviations beyond which Gaussian noise has none of a million samples."""

LEAST_FREEDOM = 40
"""Degrees of freedom left by a regression that is tested: Student's point of 1e-4 is then within
11 % of the normal one, so that a residual that is not quite normal does little."""

PIECE = 2**16
"""Samples that are looked at together, which bounds the memory."""

LARGEST = 1e70
"""Numbers beyond this are no measurement: the square of a quotient of two inside is a double."""

SMALLEST = 1 / LARGEST
"""Signals, responses and steps of time below this count as nothing: their squares vanish."""
