"""Result of a stability analysis."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from ..._wording import in_time
from ...numerics.arrays import ComplexArray, FloatArray
from ...results import Flag, Result


@dataclass(frozen=True, eq=False, repr=False)
class Margins(Result):
    """Stability margins of a loop with negative feedback.

    With the open loop L: ``gain_margin = 1/|L|`` at a phase crossover, ``phase_margin = 180 deg +
    arg L`` at a gain crossover, ``modulus_margin = min |1 + L|``, and ``delay_margin`` is the
    smallest ``(phase margin in 0...360 deg) / omega`` over all gain crossovers. Of several gain or
    phase margins the one nearest to instability is given, as in python-control; the arrays contain
    all of them.

    Attributes
    ----------
    gain_margin : float
        Ratio; below 1 if the gain must not be *reduced* further. inf without a phase crossover.
    phase_margin : float
        Degrees, -180...180. inf without a gain crossover.
    modulus_margin : float
        Smallest distance of L to -1; its inverse is the peak of the sensitivity, `ms`.
    delay_margin : float
        Additional dead time in s at which the loop becomes unstable; nan if it already is.
    delay_margin_samples : float
        The same in samples; nan for a continuous loop.
    stable : bool
        Closed-loop stability, by a Nyquist count that includes all poles of the factors, also
        cancelled ones and those on the unit circle.
    unstable_poles : int
        Number of closed-loop poles outside the stability region or on its boundary.
    gain_crossovers, phase_crossovers : ndarray
        In rad/s, increasing.
    phase_margins, gain_margins : ndarray
        One for each gain crossover in degrees, one for each phase crossover.
    modulus_crossover : float
        Where ``|1 + L|`` is smallest, rad/s.
    dt : float
        Sample time in s, 0 if continuous.
    intervals : dict of str to (float, float)
        For measured responses with a standard deviation (which counts as known unless the response
        has `repeats`): 95 % intervals of the four margins. They remain valid if noise makes the
        response cross many times, and are then not centred: the smallest of many noisy distances is
        biased downwards. Otherwise empty.
    flags : tuple of Flag
    response : tuple of ndarray
        (omega, L) along the count, for plots.
    time_unit : str
        In which cards write the delay margin: min, h or day of the plant, otherwise s.

    Examples
    --------
    >>> import ctrl_realize as cr
    >>> plant = cr.design.ProcessModel(gain=1.0, lag=0.08, dead_time=0.029).system(0.001)
    >>> found = cr.design.margins(plant, cr.design.pid(plant))
    >>> print(f"gain {found.gain_margin:.2f}, phase {found.phase_margin:.1f} degrees")
    gain 3.14, phase 61.4 degrees
    >>> print(f"{1e3 * found.delay_margin:.1f} ms more dead time until it is unstable")
    63.2 ms more dead time until it is unstable
    """

    gain_margin: float
    phase_margin: float
    modulus_margin: float
    delay_margin: float
    stable: bool
    unstable_poles: int
    gain_crossovers: FloatArray
    phase_crossovers: FloatArray
    phase_margins: FloatArray
    gain_margins: FloatArray
    modulus_crossover: float
    dt: float
    response: tuple[FloatArray, ComplexArray]
    intervals: dict[str, tuple[float, float]] = field(default_factory=dict)
    flags: tuple[Flag, ...] = ()
    time_unit: str = "s"

    @property
    def delay_margin_samples(self) -> float:
        """Delay margin in samples."""
        return self.delay_margin / self.dt if self.dt else float("nan")

    @property
    def ms(self) -> float:
        """Peak of the sensitivity, 1 / modulus_margin."""
        return float(1 / self.modulus_margin) if self.modulus_margin else float("inf")

    @property
    def gain_crossover(self) -> float:
        """Gain crossover of the phase margin, rad/s; nan without one."""
        return _where_least(self.phase_margins, self.gain_crossovers)

    @property
    def phase_crossover(self) -> float:
        """Phase crossover of the gain margin, rad/s; nan without one."""
        return _where_least(np.log(self.gain_margins), self.phase_crossovers)

    _heading = "Stability margins"

    def _rows(self) -> list[tuple[str, str]]:
        verdict = "stable" if self.stable else f"UNSTABLE ({self.unstable_poles} poles)"
        delay = in_time(self.delay_margin, 4)
        if np.isnan(self.delay_margin):
            delay = "none: the closed loop is unstable"
        elif self.dt and np.isfinite(self.delay_margin):
            delay += f" = {self.delay_margin_samples:.4g} samples"
        modulus = f"{self.modulus_margin:.4g} at {self.modulus_crossover:.4g}"
        rows = [
            ("closed loop", verdict),
            ("gain margin", _gain_in_words(self.gain_margin, self.phase_crossover)),
            ("phase margin", _phase_in_words(self.phase_margin, self.gain_crossover)),
            ("modulus margin", f"{modulus} rad/s (Ms = {self.ms:.4g})"),
            ("delay margin", delay),
        ]
        for name, (low, high) in self.intervals.items():
            rows.append((f"95 % {name.replace('_', ' ')}", f"{low:.4g} ... {high:.4g}"))
        return rows

    def __repr__(self) -> str:
        state = "stable" if self.stable else "unstable"
        return (
            f"<Margins {state}: gain {self.gain_margin:.4g}, phase {self.phase_margin:.4g} deg, "
            f"modulus {self.modulus_margin:.4g}, delay {in_time(self.delay_margin, 4)}>"
        )


def _where_least(sizes: FloatArray, crossovers: FloatArray) -> float:
    """Crossover whose size is nearest to 0; nan without one."""
    return float(crossovers[np.argmin(np.abs(sizes))]) if sizes.size else float("nan")


def _gain_in_words(margin: float, crossover: float) -> str:
    if not np.isfinite(margin):
        return "infinite: the phase never crosses -180 deg"
    return f"{margin:.4g} ({20 * np.log10(margin):.3g} dB) at {crossover:.4g} rad/s"


def _phase_in_words(margin: float, crossover: float) -> str:
    if not np.isfinite(margin):
        return "infinite: the gain never crosses 1"
    return f"{margin:.4g} deg at {crossover:.4g} rad/s"
