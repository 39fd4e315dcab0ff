"""Result of a fit of a process model for every input."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

from .._flags import Flag, flagged
from .._wording import interval_in_time, time_within
from ..data import Record
from ..numerics.arrays import FloatArray
from ..results import ModelFit
from .output_error.result import OutputErrorFit


@dataclass(frozen=True, eq=False, repr=False)
class SeveralInputsFit(ModelFit):
    """One model with dead time for every input of one output.

    ``output == level + drift + responses.sum(axis=0) + residual``, where each response is that of
    ``fits[i]`` to input i.

    Attributes
    ----------
    fits : tuple of OutputErrorFit
        One for each input, of the output without the responses to the others. Intervals of dead
        time, gain, total delay and lags are wider than for these alone, by what the others leave
        open.
    records : tuple of Record
        The record.
    responses : ndarray, shape (inputs, N)
        Responses of the models to their inputs, from rest.
    cycles : int
        Iterations.
    converged : bool
        Whether they have ended before the last one that is allowed.

    Examples
    --------
    >>> import control as ct
    >>> import numpy as np
    >>> import ctrl_realize as cr
    >>> rng = np.random.default_rng(0)
    >>> u = np.repeat(rng.choice([-1.0, 1.0], (2, 25)), 20, axis=1)
    >>> heating = cr.delayed_ss(ct.tf([2.0], [20, 1]), dead_time=5.0, dt=1.0)
    >>> load = cr.delayed_ss(ct.tf([-1.0], [30, 1]), dead_time=9.0, dt=1.0)
    >>> y = heating.simulate(u[0]) + load.simulate(u[1]) + 0.05 * rng.standard_normal(u.shape[1])
    >>> record = cr.Record(np.arange(u.shape[1]) * 1.0, u, y, input_labels=["heating", "load"])
    >>> sys = cr.identify(record, structures="FOPDT")
    >>> [round(fit.dead_time) for fit in sys.fit.fits]
    [5, 9]
    """

    fits: tuple[OutputErrorFit, ...]
    records: tuple[Record, ...]
    responses: FloatArray
    cycles: int
    converged: bool

    _method = "process model for each input"
    dead_time = interval = delay = delay_interval = None

    @property
    def order(self) -> int:
        """Number of states of all models."""
        return sum(fit.order for fit in self.fits)

    @property
    def inputs(self) -> tuple[str, ...]:
        """Names of the inputs."""
        return tuple(self.records[0].input_labels)

    @property
    def residual_std(self) -> float:
        """Standard deviation of the residual, in the unit of the output."""
        return self.fits[-1].residual_std

    @property
    def choices(self) -> tuple[str, ...]:
        """What was chosen for each input, and why."""
        return tuple(
            f"{name}: {choice}"
            for name, fit in zip(self.inputs, self.fits, strict=True)
            for choice in fit.choices[:1]
        )

    @property
    def flags(self) -> tuple[Flag, ...]:
        """Whether the iterations have converged, and flags of all fits with the input's name."""
        own = () if self.converged else (flagged("not_converged", cycles=self.cycles),)
        return own + tuple(
            replace(flag, message=f"{name}: {flag.message}")
            for name, fit in zip(self.inputs, self.fits, strict=True)
            for flag in fit.flags
        )

    def table(self) -> Any:
        """One row for each input: gain, dead time, their intervals, and the transfer function.

        Returns
        -------
        pandas.DataFrame
            Index ``input``; columns ``gain``, ``gain_low``, ``gain_high``, ``dead_time``,
            ``dead_time_low``, ``dead_time_high`` [s] and ``formula``.
        """
        import pandas as pd

        rows = [
            (fit.gain, *fit.gain_interval, fit.dead_time, *fit.interval, fit.formula)
            for fit in self.fits
        ]
        ends = ("", "_low", "_high")
        columns = [f"{name}{end}" for name in ("gain", "dead_time") for end in ends]
        index = pd.Index(self.inputs, name="input")
        return pd.DataFrame(rows, columns=[*columns, "formula"], index=index)

    def parameter_table(self, *, time_unit: str | None = None) -> Any:
        """List the parameters of the models of all inputs, with errors and 95 % intervals.

        Parameters
        ----------
        time_unit : {"ms", "s", "min", "h", "day"}, optional
            Default: `time_unit` of the fits.

        Returns
        -------
        pandas.DataFrame
            Rows (input, parameter), as of each of `fits`.
        """
        import pandas as pd

        tables = [fit.parameter_table(time_unit=time_unit) for fit in self.fits]
        return pd.concat(tables, keys=self.inputs, names=["input"])

    def _title(self) -> str:
        return f"Process models of {len(self.fits)} inputs"

    def _rows(self) -> list[tuple[str, str]]:
        rows = []
        for name, fit in zip(self.inputs, self.fits, strict=True):
            told = time_within(fit.dead_time, *fit.interval)
            told += f" ({interval_in_time(*fit.interval)})"
            rows += [(name, fit.formula), ("  dead time", told)]
        state = "converged" if self.converged else "not converged"
        rows.append(("residual", f"{self.residual_std:.3g}"))
        return [*rows, ("iterations", f"{self.cycles}, {state}")]

    def __repr__(self) -> str:
        return f"<SeveralInputsFit of {', '.join(self.inputs)}>"
