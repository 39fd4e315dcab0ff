"""Response of an output to a step of a load at some time, and its derivatives.

A load is a change at the input of a process, or at its output, that nobody recorded. Its response
is a sum of modes, so that times and lags far from it cost no simulation. Our own form.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from ..arrays import ComplexArray, FloatArray


@dataclass(frozen=True, eq=False)
class LoadStep:
    """Step of a load: its time on the clock of the record, and the response of the output to it.

    The response to a unit step is the sum of ``residues / poles (exp(poles s) - 1)``, s the time
    since the step over `lag`; times in s. `size` is what the load adds to the last output. `early`:
    it cannot be told from the response to the input, mostly since it comes so soon after a step.
    `own_gain` is what it adds to the gain if it is no load but a late part of the response to a
    step, of a second path or a recycle; 0 where it would follow another step as well.
    """

    time: float
    lag: float
    poles: ComplexArray = field(default_factory=lambda: -np.ones(1, dtype=np.complex128))
    residues: ComplexArray = field(default_factory=lambda: np.ones(1, dtype=np.complex128))
    size: float = 0.0
    early: bool = False
    own_gain: float = 0.0

    @property
    def mean_lag(self) -> float:
        """Mean delay of the response behind the time of the load, in s."""
        parts = self.residues / self.poles
        return self.lag * float((np.sum(parts / self.poles) / -np.sum(parts)).real)

    def columns(self, clock: FloatArray) -> FloatArray:
        """Response to a unit step (N, 3), and its changes for a later step and a longer lag."""
        since = np.maximum(clock - self.time, 0.0) / self.lag
        slope = np.zeros(clock.size)
        for pole, residue in self._modes():
            slope += np.real(residue * np.exp(pole * since))
        slope[clock <= self.time] = 0.0
        return np.stack([self.response(since), slope, since * slope], axis=1)

    def response(self, since: FloatArray) -> FloatArray:
        """Response to a unit step at times in units of the lag."""
        found = np.zeros(since.shape)
        for pole, residue in self._modes():
            found += np.real(residue / pole * np.expm1(pole * since))
        return found

    def _modes(self) -> list[tuple[complex, complex]]:
        real = not np.any(self.poles.imag)
        poles, residues = (x.real if real else x for x in (self.poles, self.residues))
        return list(zip(poles.tolist(), residues.tolist(), strict=True))
