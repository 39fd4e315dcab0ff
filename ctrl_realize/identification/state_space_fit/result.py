"""Result of a state-space fit."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import control as ct
import numpy as np

from ..._flags import Flag, flagged
from ..._wording import in_percent, in_time, interval_in_time, rate_in_time, time_within
from ...data import Record
from ...delayed import DelayedStateSpace
from ...delayed.parts import signals_of
from ...numerics.arrays import FloatArray, read_only
from ...numerics.constants import SMALLEST
from ...numerics.state_space.balancing import balanced_truncation
from ...results import IntervalKind, ModelFit
from ..output_error.loop_flags import unstable_flags
from ..output_error.result import OutputErrorFit
from ..validation.residuals import analyse_residuals
from ..validation.residuals_result import ResidualAnalysis
from ..verdicts import Verdict
from .drift import without_drift
from .search import Candidate

COLOURED, WANDERING = 0.5, 0.97
"""Correlation of neighbouring residuals above which they are called coloured, with a drift like
integrated noise."""
INTEGRATES = 5.0
"""Record length in time constants below which the slowest pole may be an integrator."""
LAGS = 25
"""Confidence of the correlations in the residual checks."""


@dataclass(frozen=True, eq=False)
class StateSpaceFit(ModelFit):
    """Result of a state-space fit to records of one or several channels.

    Attributes
    ----------
    order : int
        States of the core.
    input_delays, output_delays : tuple of int
        In samples.
    feedthrough : bool
        Whether the core has a feedthrough.
    bic : dict of int to float
        Bayesian information criterion of every order tried; for the final order, with its final
        delays. Smaller is better; a difference of 6 is clear.
    noise_std : ndarray, shape (p,)
        Standard deviation of the residual of every output.
    iterations : int
        Gauss-Newton iterations of the last fit.
    fit_percent : ndarray, shape (p,)
        ``100 (1 - noise_std / std y)`` of every output, over all records.
    checks : tuple of ResidualAnalysis
        Of every record without gaps.
    dead_time : float or None
        In s; this and the next five are for one input and output in `identify`, otherwise None.
    interval : tuple of float, or None
        In s: dead times that the data do not rule out, for this model and for `lags` unless its
        residual is twice as large.
    total_delay : float or None
        Delay at zero frequency in s; None also for a plant with zero gain.
    gain : float or None
        At zero frequency.
    verdicts : tuple of Verdict
        On dead time, gain and tuning, none of them "good"; empty where the dead time is None.
    lags : OutputErrorFit or None
        The fit of lags with dead time that this one replaces.
    records : tuple of Record
        Records that were fitted.
    choices : tuple of str
        Automatic choices, with reasons.
    flags : tuple of Flag
        Those of the checks, and ``"highest_order"``, ``"no_response"``,
        ``"coloured_residual"``, ``"drift"``, ``"unstable"``.

    Examples
    --------
    >>> import control as ct
    >>> import numpy as np
    >>> import ctrl_realize as cr
    >>> plant = cr.delayed_ss(ct.ss([[0.8]], [[1.0]], [[0.2]], [[0.0]], 0.1), 5)
    >>> u, noise = np.random.default_rng(0).standard_normal((2, 500))
    >>> y = plant.simulate(u) + 0.05 * noise
    >>> fit = cr.fit_state_space(cr.Record(0.1 * np.arange(500), u, y), 1).fit
    >>> fit
    <StateSpaceFit: order 1, fit 85.7 %>
    >>> fit.input_delays, fit.noise_std.round(2), fit.checks[0].independent
    ((5,), array([0.05]), True)
    """

    order: int
    input_delays: tuple[int, ...]
    output_delays: tuple[int, ...]
    feedthrough: bool
    bic: dict[int, float]
    noise_std: FloatArray
    fit_percent: FloatArray
    iterations: int
    checks: tuple[ResidualAnalysis, ...]
    records: tuple[Record, ...]
    choices: tuple[str, ...] = ()
    flags: tuple[Flag, ...] = ()
    dead_time: float | None = None
    interval: tuple[float, float] | None = None
    total_delay: float | None = None
    gain: float | None = None
    verdicts: tuple[Verdict, ...] = ()
    lags: OutputErrorFit | None = None

    @property
    def dt(self) -> float:
        """Sample time in s, that of the records."""
        return self.records[0].dt

    @property
    def delay(self) -> int | None:
        """Dead time in samples; None unless `identify` has estimated it."""
        return None if self.dead_time is None else self.input_delays[0] + self.output_delays[0]

    @property
    def delay_interval(self) -> tuple[float, float] | None:
        """Interval of the dead time in samples."""
        ends = self.interval
        return None if ends is None else (ends[0] / self.dt, ends[1] / self.dt)

    @property
    def interval_kind(self) -> IntervalKind | None:
        """``"plausible"``: dead times that are not ruled out; None without an interval."""
        return None if self.interval is None else "plausible"

    @property
    def residual_std(self) -> float | None:
        """Standard deviation of the residual; None for several outputs."""
        return float(self.noise_std[0]) if self.noise_std.size == 1 else None

    _method = "state-space fit of all channels"

    def _title(self) -> str:
        outputs, inputs = len(self.output_delays), len(self.input_delays)
        return f"State-space fit: {outputs} outputs, {inputs} inputs"

    def _rows(self) -> list[tuple[str, str]]:
        return [
            *((f"verdict: {v.question}", f"{v.level}: {v.sentence}") for v in self.verdicts),
            ("order", f"{self.order}, {'with' if self.feedthrough else 'without'} feedthrough"),
            ("input delays", " ".join(map(str, self.input_delays)) + " samples"),
            ("output delays", " ".join(map(str, self.output_delays)) + " samples"),
            ("residual std", ", ".join(f"{s:.3g}" for s in self.noise_std)),
            ("fit", in_percent(self.fit_percent)),
            *self._rows_of_delay(),
        ]

    def _rows_of_delay(self) -> list[tuple[str, str]]:
        if self.dead_time is None or self.interval is None:
            return []
        rows = [
            ("dead time", f"{time_within(self.dead_time, *self.interval)} = {self.delay} samples"),
            (self.interval_label, interval_in_time(*self.interval)),
        ]
        if self.lags is not None:
            other = f"a transfer function of order {self.lags.order} with dead time "
            other += f"{in_time(self.lags.dead_time, 4)}, residual std {self.lags.residual:.3g}"
            rows.append(("instead of", other))
        return rows

    def __repr__(self) -> str:
        fit = ", ".join(f"{f:.1f}" for f in self.fit_percent)
        return f"<StateSpaceFit: order {self.order}, fit {fit} %>"


def fitted_system(
    best: Candidate,
    group: tuple[Record, ...],
    bic: dict[int, float],
    choices: tuple[str, ...],
    flags: tuple[Flag, ...],
) -> DelayedStateSpace:
    """Make the system, and measure how well it fits the records."""
    A, B, C, D = best.found.model.matrices()
    A, B, C, _ = balanced_truncation(A, B, C, best.order)
    core = ct.ss(A, B, C, D, group[0].dt)
    system = DelayedStateSpace(core, best.inputs, output_delay=best.outputs)
    complete, drift = _without_drifts(best, group)
    checks = tuple(
        analyse_residuals(system, r, lags=max(min(LAGS, r.n_samples // 3), 1)) for r in complete
    )
    seen = {flag.code: flag for check in checks for flag in check.flags}
    loop: tuple[Flag, ...] = ()
    neighbours = max((float(c.autocorrelation[:, 1].max()) for c in checks), default=0.0)
    longest = max(r.n_samples for r in group)
    largest = float(np.abs(core.poles()).max(initial=0.0))
    slow = longest * (1 - largest) < INTEGRATES
    # With their drifts, which the test has as well: beside slow poles those of a fit are huge.
    whole = tuple(r for r in group if not r.n_missing)
    if whole and (slow or neighbours > COLOURED):
        latest, imitated = max(best.inputs) + max(best.outputs), neighbours <= COLOURED
        loop = tuple(unstable_flags(whole, latest, imitated=imitated))
    if neighbours > COLOURED:
        advice = "compare with a lower order on other data"
        if slow:
            share = 100 * largest**longest
            seen["not_died_away"] = flagged(
                "not_died_away", largest=largest, share=share, samples=longest
            )
        if group[0].noutputs == 1 and group[0].ninputs > 1:
            advice = (
                "process models of several inputs and one output count the colour of the noise: "
                "identify(record, structures='FOPDT')"
            )
        elif slow and group[0].issiso():
            advice = (
                "the slowest time constant is longer than the record, as of an integrator: "
                "use fit_output_error (or identify), which fits integrators for one input "
                "and one output"
            )
        elif slow or neighbours > WANDERING:
            advice = (
                "the output drifts like an integrated disturbance: fit differences of input "
                "and output (np.diff of both), each channel by fit_output_error, or a "
                "frequency response (spectral_frf, fit_frf)"
            )
        seen["coloured_residual"] = flagged(
            "coloured_residual.state_space", correlation=neighbours, advice=advice
        )
    fit = StateSpaceFit(
        order=core.nstates,
        input_delays=best.inputs,
        output_delays=best.outputs,
        feedthrough=best.feedthrough,
        bic=bic,
        noise_std=read_only(np.sqrt(best.found.variance)),
        fit_percent=read_only(100 * (1 - np.sqrt(best.found.variance / best.found.spread))),
        iterations=best.found.steps,
        checks=checks,
        records=group,
        choices=choices,
        flags=(*flags, *drift, *seen.values(), *loop),
    )
    first = group[0]
    name = {"name": first.name} if first.name else {}
    return system.replace(fit=fit, **signals_of(first), **name)


def _without_drifts(best: Candidate, group: Sequence[Record]) -> tuple[list[Record], list[Flag]]:
    """Complete records from which the drifts of a fit are taken, and a flag for the largest."""
    late = max(best.inputs)
    known = [r for r in group if r.n_samples - late > 1]
    found, told, most = [], list[Flag](), 0.0
    for record, change in zip(known, best.found.drifts, strict=True):
        slope, count = change / (record.n_samples - late - 1), record.n_samples
        output = np.atleast_2d(record.output)
        size = np.nanmax(output, axis=1) - np.nanmin(output, axis=1)
        shares = count * np.abs(slope) / np.fmax(size, SMALLEST)
        a = int(np.argmax(shares))
        if shares[a] > most:
            share = f"{100 * shares[a]:.2g} % of the range of output {a}"
            rate = rate_in_time(float(slope[a]) / record.dt)
            told, most = [flagged("drift", rate=rate, share=share)], float(shares[a])
        if not record.n_missing:
            found.append(without_drift(record, slope))
    return found, told
