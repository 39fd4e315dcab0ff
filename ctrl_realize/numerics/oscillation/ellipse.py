"""Ellipse of process value over controller output, and the apparent stiction.

Choudhury and others filter both signals to the oscillation and fit an ellipse; the apparent
stiction is its width through the centre in the direction of the output [1]_. Of two sines the
ellipse has this width in closed form, 2 a |sin(phase)|, with the amplitude a of the output: here
the fundamentals are fitted by least squares.

References
----------
.. [1] M. A. A. S. Choudhury, S. L. Shah, N. F. Thornhill and D. S. Shook, Automatic detection and
   quantification of stiction in control valves, Control Engineering Practice 14 (2006) 1395-1412.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..arrays import FloatArray

_CYCLES = 3.0
"""In a segment, over which amplitude and phase are taken as constant."""


@dataclass(frozen=True)
class Ellipse:
    """Amplitudes of output and value, the phase by which the value lags in rad, and the width."""

    output: float
    value: float
    phase: float
    width: float

    @property
    def sign(self) -> float:
        """Sign of the gain: a PI controller lags by 0 to 90 degrees behind minus the value."""
        return 1.0 if np.cos(self.phase - 0.75 * np.pi) > 0 else -1.0


def fit_ellipse(output: FloatArray, value: FloatArray, period: float) -> Ellipse:
    """Fit the ellipse to each segment of both signals (N,), and return the one of median width."""
    length = min(round(_CYCLES * period), output.size)
    starts = range(0, output.size - length + 1, max(length, 1))
    parts = [slice(start, start + length) for start in starts]
    found = [_fundamentals(output[part], value[part], period) for part in parts]
    return sorted(found, key=lambda one: one.width)[len(found) // 2]


def _fundamentals(output: FloatArray, value: FloatArray, period: float) -> Ellipse:
    angle = 2 * np.pi / period * np.arange(output.size)
    basis = np.stack([np.cos(angle), -np.sin(angle), np.ones_like(angle)], axis=1)
    both = np.linalg.lstsq(basis, np.stack([output, value], axis=1), rcond=None)[0]
    first, second = complex(*both[:2, 0]), complex(*both[:2, 1])
    phase = float(np.angle(first * np.conj(second)))
    return Ellipse(abs(first), abs(second), phase, 2 * abs(first) * abs(np.sin(phase)))
