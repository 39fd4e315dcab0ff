"""Diagnosis of a loop."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np

from ..._wording import in_time
from ...errors import OptionError
from ...numerics.oscillation.cross_correlation import CrossCorrelation
from ...numerics.oscillation.cycles import Cycles
from ...numerics.oscillation.ellipse import Ellipse
from ...numerics.oscillation.half_cycles import HalfCycles
from ...numerics.oscillation.stiction_fit import StictionFit
from ...results import Flag, Result
from .data import LoopData
from .methods import LoopMethod, LoopProcess
from .verdict import LoopVerdict

if TYPE_CHECKING:
    import pandas as pd


@dataclass(frozen=True, eq=False)
class LoopDiagnosis(Result):
    """Whether the valve makes a loop oscillate, made by `diagnose_loop`.

    Attributes
    ----------
    verdict : str
        ``"stiction"``, ``"no stiction: tuning or external oscillation"``, ``"no oscillation"`` or
        ``"cannot tell"``.
    reason : str
        What led to the verdict.
    oscillates : bool or None
        None if this cannot be told.
    methods : tuple of LoopMethod
        What each of them says; `table` lists them.
    process : str
        As given.
    signals : LoopData
        ``op``, ``pv``, ``sp`` and ``dt`` as they were used.
    cycles : Cycles or None
        Period in samples and regularity of the process value.
    cross_correlation : CrossCorrelation or None
        Of controller output and process value, over lags in samples.
    op_shapes, pv_shapes : HalfCycles or None
        Half cycles, interpolated to the same length and turned to one side.
    ellipse : Ellipse or None
        Of the fundamentals of controller output and process value.
    stiction_fit : StictionFit or None
        Kano's model of stiction and a linear process fitted to the record: ``S`` and ``J`` with
        ``S_range`` and ``J_range``, in the unit of OP, and the errors with and without stiction.
        The ranges are confidence intervals of 95 % if ``independent``: if the residual is white, so
        that valve and process are those of the model; otherwise pairs with similar errors.
    flags : tuple of Flag
    choices : tuple of str

    Examples
    --------
    >>> import ctrl_realize as cr
    >>> loop = cr.bench.valve_loop(cr.actuators.Stiction(5, 2), noise=0.1).simulate(1200.0, rng=1)
    >>> cr.valves.diagnose_loop(loop.record)
    <LoopDiagnosis: stiction>
    """

    verdict: LoopVerdict
    reason: str
    oscillates: bool | None
    methods: tuple[LoopMethod, ...]
    process: LoopProcess
    signals: LoopData = field(repr=False)
    cycles: Cycles | None = field(repr=False)
    cross_correlation: CrossCorrelation | None = field(repr=False)
    op_shapes: HalfCycles | None = field(repr=False)
    pv_shapes: HalfCycles | None = field(repr=False)
    ellipse: Ellipse | None = field(repr=False)
    stiction_fit: StictionFit | None = field(repr=False)
    flags: tuple[Flag, ...] = ()
    choices: tuple[str, ...] = ()

    def __repr__(self) -> str:
        return f"<LoopDiagnosis: {self.verdict}>"

    @property
    def period(self) -> float:
        """Period of the oscillation in s; NaN if there is none."""
        if self.cycles is None or self.oscillates is False:
            return np.nan
        return self.cycles.period * self.signals.dt

    @property
    def apparent_stiction(self) -> float:
        """Width of the ellipse of PV over OP, in the unit of OP; NaN without an oscillation.

        As a rule less than S, because the fundamentals are smaller than the signals; without
        meaning if the valve does not stick.
        """
        return np.nan if self.ellipse is None else self.ellipse.width

    def method(self, key: str) -> LoopMethod:
        """Return what one method says.

        Parameters
        ----------
        key : str
            Such as ``"curve_fit"``.

        Raises
        ------
        OptionError
            There is no such method.
        """
        for one in self.methods:
            if one.key == key:
                return one
        known = ", ".join(one.key for one in self.methods)
        raise OptionError(f"method {key!r}; expected one of {known}")

    def table(self) -> pd.DataFrame:
        """List the methods.

        Returns
        -------
        pandas.DataFrame
            Index: key. Columns ``name``, ``signal``, ``index``, ``second_index``, ``limit``,
            ``verdict``, ``note``, ``source``.
        """
        import pandas as pd

        columns = ("name", "signal", "index", "second_index", "limit", "verdict", "note", "source")
        rows = [{name: getattr(one, name) for name in columns} for one in self.methods]
        return pd.DataFrame(rows, index=[one.key for one in self.methods])

    _heading = "Loop diagnosis"

    def _rows(self) -> list[tuple[str, str]]:
        rows = [("verdict", self.verdict), ("because", self.reason)]
        if np.isfinite(self.period) and self.cycles is not None:
            rows.append(("period", f"{in_time(self.period)}, {self.cycles.count:.1f} cycles"))
        if self.verdict == "stiction" and np.isfinite(self.apparent_stiction):
            rows.append(("apparent stiction (ellipse)", f"{self.apparent_stiction:.3g}"))
        if self.verdict == "stiction" and self.stiction_fit is not None:
            fit = self.stiction_fit
            word = "95 %:" if fit.independent else "similar errors:"
            for name, value, ends in (("S", fit.S, fit.S_range), ("J", fit.J, fit.J_range)):
                told = f"{value:.3g} ({word} {ends[0]:.3g} to {ends[1]:.3g})"
                rows.append((f"apparent {name} (fit)", told))
        for one in self.methods:
            indices = [f"{each:.3g}" for each in (one.index, one.second_index) if each == each]
            told = f"{one.verdict} ({', '.join(indices)}; {one.limit})" if indices else one.verdict
            rows.append((one.name, f"{told}: {one.note}" if one.note else told))
        return rows
