"""Result of a fit of time records and a frequency response together."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..._checks import numbers
from ..._wording import time_within
from ...frequency.frf_fit import FRFFit
from ...numerics.arrays import ComplexArray, FloatArray
from ...numerics.constants import Z_95
from ...numerics.joint.fit import Agreement
from ...results import IntervalKind
from ..output_error.result import OutputErrorFit


@dataclass(frozen=True, eq=False, repr=False, kw_only=True)
class JointFit(OutputErrorFit):
    """Dead time and model from time records and a frequency response of one plant.

    An `OutputErrorFit` whose likelihood also contains the points of a frequency response:
    ``interval[0] <= dead_time <= interval[1]``, `fitted` and `residual` are those of the records,
    and `response` is that of the model at any frequency. ``agreement.statistic ==
    agreement.record_rise + agreement.frf_rise`` (negative ones count as 0) compares the joint model
    with models of the same structure of each alone.

    Attributes
    ----------
    record_fit : OutputErrorFit
        The records alone, with their flags.
    frf_fit : FRFFit
        The frequency response alone, with its flags.
    agreement : Agreement
        Likelihood ratio of common against separate parameters, distances of the model from the
        measured points, and what differs between the two.

    Examples
    --------
    >>> import numpy as np
    >>> import ctrl_realize as cr
    >>> bench = cr.bench.valve()
    >>> record = bench.step_record(16, rng=5)
    >>> frf = bench.truth.frf(np.geomspace(0.1, 10.0, 20))
    >>> fit = cr.identify(record, frf=frf, order=3).fit
    >>> fit.agreement.contradicts
    False
    """

    record_fit: OutputErrorFit
    frf_fit: FRFFit
    agreement: Agreement

    @property
    def interval_kind(self) -> IntervalKind:
        """``"confidence"`` if the two agree, the records alone leave noise, and no order is given.

        ``"spanned"`` if they contradict each other: from the earliest to the latest dead time of
        both. Otherwise ``"conditional"``.
        """
        if self.agreement.contradicts:
            return "spanned"
        free = self.estimate.others is None
        return "confidence" if self.at_noise_level and free else "conditional"

    @property
    def gain_interval(self) -> tuple[float, float]:
        """95 % interval of the gain; if the two contradict each other, that of both and each."""
        low, high = super().gain_interval
        if not self.agreement.contradicts:
            return low, high
        other = self.frf_fit
        reach = Z_95 * other._gain_std if other.gain_resolved else np.inf
        first, last = self.record_fit.gain_interval
        return min(low, first, other.gain - reach), max(high, last, other.gain + reach)

    def response(self, omega: FloatArray) -> ComplexArray:
        """Evaluate model and dead time at `omega` in rad/s."""
        s = 1j * numbers(omega, "omega")
        core = np.polyval(self.estimate.numerator[::-1], s) / np.polyval(np.poly(self.poles), s)
        return np.asarray(core * np.exp(-s * self.dead_time), dtype=np.complex128)

    def _fit_in_words(self) -> str:
        differs = "free response, and with the common gain, dead time and lags"
        return super()._fit_in_words().replace("free response", differs)

    _name = "Joint fit"
    _method = "output-error fit of raw records and a frequency response"

    def _rows(self) -> list[tuple[str, str]]:
        agreed, points = self.agreement, self.frf_fit.frequency_hz
        rows = [
            (
                "agreement",
                f"likelihood ratio {agreed.statistic:.3g} for {agreed.parameters} common "
                f"parameters, p = {agreed.p_value:.2g}",
            ),
            (
                "frequency response",
                f"{points.size} points, {points[0]:.4g} to {points[-1]:.4g} Hz; the model is "
                f"outside of the 95 % circle of {int(agreed.outside.sum())}",
            ),
        ]
        for what, fit in (("records", self.record_fit), ("frequency response", self.frf_fit)):
            flags = ", ".join(flag.code for flag in fit.flags)
            found = f"dead time {time_within(fit.dead_time, *fit.interval)}, order {fit.order}"
            found += f", gain {fit.gain:.4g}" + (f"; flags: {flags}" if flags else "")
            rows.append((f"{what} alone", found))
        return super()._rows() + rows
