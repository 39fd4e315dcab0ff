"""Gains of the records of one plant, and the schedule of the gain over the operating point."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Literal

import numpy as np

from ..._checks import real
from ..._wording import in_numbers
from ...data import Record
from ...numerics.arrays import BoolArray, FloatArray, locked
from ...results import Result
from ..step.steps import found_edges
from .repeat_flags import BY_CHANCE, SAME
from .words import gain_in_words

if TYPE_CHECKING:
    import pandas as pd

ScheduledOver = Literal["input level", "step height"]

ONE_POINT = 0.01
"""Operating points closer than that, as part of the range of all inputs, count as one."""
_LAST = 20  # part of the samples after a step, from the end, whose mean is the level then
_MOST_NAMED = 12
"""Largest number of records listed in a card; the table lists all."""


@dataclass(frozen=True, eq=False, repr=False)
class RecordGains(Result):
    """Gain of every record at its operating point, with the dynamics that are common to all.

    ``gains == reference * ratios``. The operating point of a step record is the middle between the
    input levels before and after the step: where the static characteristic is quadratic, its slope
    there is exactly the gain of the step. For any other input it is the mean of the input. If all
    records have the same operating point, the schedule is over the height of the step: friction or
    a limit makes the gain depend on it. The schedule is linear between operating points [1]_.

    Attributes
    ----------
    names : tuple of str
        Of the records.
    scheduled_over : {"input level", "step height"}
        What the gain is scheduled over.
    operating_points : ndarray, shape (R,)
        Operating points or step heights, in the unit of the input.
    input_levels, output_levels : ndarray, shape (R, 2)
        Levels before and after the step; smallest and largest value of other records.
    gains, errors : ndarray, shape (R,)
        Gain of each record and its standard error for the chosen structure.
    low, high : ndarray, shape (R,)
        95 % intervals of the gains, for all structures that the data do not rule out.
    reference : float
        Gain of the returned model: the median of the gains that are not outlying, of an even number
        one of the two in the middle.
    chi_square, p_value : float
        Test whether the gains are the same: sum of ((gain - weighted mean) / standard error)^2, and
        the probability of a larger value if they differ by noise alone.
    outlying : tuple of str
        Records whose dead time or time constants do not agree with those of the others, or that do
        not respond to the input. They are not in the fit.
    input_unit, gain_unit : str
        Of the operating points, and of the gains; empty if they are not known.

    References
    ----------
    .. [1] W. J. Rugh and J. S. Shamma, Research on gain scheduling, Automatica 36 (2000) 1401-1425,
       doi:10.1016/S0005-1098(00)00058-3, section 3.

    Examples
    --------
    A simulated plant whose gain falls with the level of its input:

    >>> import numpy as np
    >>> import ctrl_realize as cr
    >>> t, rng = 0.01 * np.arange(700), np.random.default_rng(1)
    >>> lag = np.where(t < 1.12, 0.0, -np.expm1(-(t - 1.12) / 0.4))
    >>> records = [
    ...     cr.Record(t, level + 2.0 * (t >= 1.0), 2 * gain * lag + 0.01 * rng.standard_normal(700))
    ...     for level, gain in ((0.0, 1.0), (2.0, 0.5), (4.0, 0.25))
    ... ]
    >>> sys = cr.fit_output_error(records, structures=[(1, 1)], gains="own")
    >>> print(sys.fit.gains.gains.round(2), sys.fit.gains.operating_points)
    [1.   0.5  0.25] [1. 3. 5.]
    >>> round(sys.fit.gains.at(2.0), 2), round(sys.fit.gain, 2)
    (0.75, 0.5)
    """

    names: tuple[str, ...]
    scheduled_over: ScheduledOver
    operating_points: FloatArray
    input_levels: FloatArray
    output_levels: FloatArray
    gains: FloatArray
    errors: FloatArray
    low: FloatArray
    high: FloatArray
    reference: float
    chi_square: float
    p_value: float
    outlying: tuple[str, ...] = ()
    input_unit: str = ""
    gain_unit: str = ""

    def __post_init__(self) -> None:
        for values in vars(self).values():
            if isinstance(values, np.ndarray):
                values.flags.writeable = False

    @property
    def ratios(self) -> FloatArray:
        """Gains over that of the model, shape (R,)."""
        return locked(self.gains / self.reference)

    @property
    def kept(self) -> BoolArray:
        """Whether each record is in the fit, shape (R,)."""
        return np.array([name not in self.outlying for name in self.names])

    @property
    def differ(self) -> bool:
        """Whether the gains differ by more than their noise explains, and by more than 3 %."""
        apart = float(np.max(np.abs(self.ratios[self.kept] - 1), initial=0.0))
        return self.p_value < BY_CHANCE and apart > SAME

    @property
    def breakpoints(self) -> tuple[FloatArray, FloatArray]:
        """Operating points and gains of the schedule, one each if the gains do not differ.

        Of records at one operating point (within 1 % of the range of all inputs) the median.
        """
        points, gains = self.operating_points[self.kept], self.gains[self.kept]
        if not self.differ:
            return np.array([float(np.median(points))]), np.array([self.reference])
        order = np.argsort(points, kind="stable")
        gaps = np.diff(points[order]) > ONE_POINT * float(np.ptp(self.input_levels))
        groups = np.split(order, np.flatnonzero(gaps) + 1)
        at = [float(np.median(points[group])) for group in groups]
        return np.array(at), np.array([float(np.median(gains[group])) for group in groups])

    def at(self, point: float | Record) -> float:
        """Gain at an operating point: interpolated between records, constant beyond them.

        Parameters
        ----------
        point : float or Record
            Value of `scheduled_over`, or a record that has it.

        Returns
        -------
        float
            In output units per input unit. Where the gains do not differ by more than their noise,
            that of the model.
        """
        if isinstance(point, Record):
            middle, levels, _ = operating_point(point)
            point = float(np.ptp(levels)) if self.scheduled_over == "step height" else middle
        return float(np.interp(real(point, "point", self.scheduled_over), *self.breakpoints))

    def ratio(self, point: float | Record) -> float:
        """Gain at an operating point over that of the model: ``ratio(point) * sys`` is its model.

        Parameters
        ----------
        point : float or Record
            As for `at`.
        """
        return self.at(point) / self.reference

    def table(self) -> pd.DataFrame:
        """One row for each record.

        Returns
        -------
        pandas.DataFrame
            Index ``record``; columns ``input_before``, ``input_after``, ``point`` (unit of the
            input, see `scheduled_over`), ``output_before``, ``output_after``, ``gain``,
            ``gain_std``, ``low``, ``high`` and ``outlying``.
        """
        import pandas as pd

        table = pd.DataFrame(
            {
                "input_before": self.input_levels[:, 0],
                "input_after": self.input_levels[:, 1],
                "point": self.operating_points,
                "output_before": self.output_levels[:, 0],
                "output_after": self.output_levels[:, 1],
                "gain": self.gains,
                "gain_std": self.errors,
                "low": self.low,
                "high": self.high,
                "outlying": ~self.kept,
            }
        )
        return table.set_index(pd.Index(self.names, name="record"))

    def __repr__(self) -> str:
        return (
            f"<RecordGains of {len(self.names)} records, {self.gains.min():.4g} to "
            f"{self.gains.max():.4g}, model {self.reference:.4g}>"
        )

    def _title(self) -> str:
        return f"Gains of {len(self.names)} records with common dynamics"

    def _rows(self) -> list[tuple[str, str]]:
        rows = [
            ("gain of the model", f"{self.reference:.4g}, the median of the records"),
            ("chi-square", f"{self.chi_square:.3g} (p = {self.p_value:.2g})"),
            ("schedule", self.in_words()),
        ]
        lines = zip(self.names, self.input_levels, self.gains, self.low, self.high, strict=True)
        return rows + [
            (
                f"record {name}" + ", outlying" * (name in self.outlying),
                f"input {before:.4g} to {after:.4g}: {gain_in_words(gain, (low, high))}",
            )
            for name, (before, after), gain, low, high in list(lines)[:_MOST_NAMED]
        ]

    def in_words(self) -> str:
        """Write the schedule in one line."""
        points, gains = self.breakpoints
        if points.size == 1:
            why = (
                f"the gains differ at one {self.scheduled_over}"
                if self.differ
                else "one gain for all"
            )
            return f"none: {why}"
        return f"gain {in_numbers(gains)} at {self.scheduled_over} {in_numbers(points)}"


def operating_point(record: Record) -> tuple[float, tuple[float, float], tuple[float, float]]:
    """Middle between the input levels of a step record, these levels, and those of the output.

    For any other input its mean, and the smallest and largest values of input and output.
    """
    u, y = np.ravel(record.input), np.ravel(record.output)
    edges = found_edges(record, most=1)
    if not edges:
        return float(np.mean(u)), (float(u.min()), float(u.max())), (float(y.min()), float(y.max()))
    edge = edges[0]
    inputs = edge.baseline, edge.baseline + edge.amplitude
    rest = y[edge.start : edge.index] if edge.index > edge.start else y[:1]
    last = max((edge.stop - edge.index) // _LAST, 1)
    outputs = float(np.mean(rest)), float(np.mean(y[edge.stop - last : edge.stop]))
    return edge.baseline + edge.amplitude / 2, inputs, outputs
