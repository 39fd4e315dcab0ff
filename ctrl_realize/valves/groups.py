"""Steps of one size and direction together: means, scatter, dead time of a fit."""

from __future__ import annotations

import warnings
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from ..data import Record
from ..delayed import fit_of
from ..errors import CtrlRealizeError, DataWarning
from ..identification.methods import identify
from ..identification.output_error.result import OutputErrorFit
from ..numerics.constants import Z_95
from .steps import STEP_METRICS, StepMetrics

_SAME_SIZE = 0.15
"""Relative difference up to which steps have one size."""
_MOST_FITTED = 4
"""Steps of one size and direction that are fitted together."""
_MOST_SAMPLES = 1500
"""Samples of a step for the fit; more are averaged in blocks."""
STRUCTURES = ((1, 1), (2, 2), (3, 3))
STRUCTURES_OF_MORE_LAGS = ((4, 3), (4, 4), (5, 4), (5, 5))
"""Tried where the data rule out the others: a valve with a slow sensor behind it."""
"""Lags of the linear models that are fitted."""


@dataclass(frozen=True)
class Interval:
    """An estimate with its 95 % interval and the number of steps behind it.

    Attributes
    ----------
    value, low, high : float
        NaN if the records cannot tell it.
    count : int
        Steps, or reversals, that it comes from.

    Examples
    --------
    >>> from ctrl_realize.valves import Interval
    >>> Interval(0.25, 0.24, 0.26, 3).is_known, Interval().is_known
    (True, False)
    """

    value: float = float("nan")
    low: float = float("nan")
    high: float = float("nan")
    count: int = 0

    @property
    def is_known(self) -> bool:
        """Whether there is a value."""
        return bool(np.isfinite(self.value))


@dataclass(frozen=True)
class SizeAndDirection:
    """The steps of one size and direction.

    Attributes
    ----------
    size : float
        Mean height in % of the command's span, without sign.
    direction : {"opening", "closing"}
    stroke : bool
        Whether they are full strokes.
    count, moved, settled : int
        Steps; of them, those at which the output moved; of those, how many settled.
    estimates : mapping of str to Interval
        The metrics of `StepMetrics.values`, over the steps that moved; ``"gain"`` is over all
        steps, ``"gain_scatter"`` is its standard deviation between steps, ``"fitted_dead_time"``
        that of `identify` on these steps together.

    Examples
    --------
    >>> import ctrl_realize as cr
    >>> records = cr.bench.valve().step_campaign(1, amplitudes=(16.0, 4.0), repeats=3)
    >>> report = cr.valves.valve_report(records, command_range=(4, 20), fit=False)
    >>> [(round(one.size), one.direction, one.count) for one in report.groups]
    [(25, 'opening', 3), (100, 'opening', 3)]
    """

    size: float
    direction: str
    stroke: bool
    count: int
    moved: int
    settled: int
    estimates: dict[str, Interval]

    @property
    def fitted_dead_time(self) -> Interval:
        """Dead time in s by `identify` on these steps together; unknown without a fit."""
        return self.estimates["fitted_dead_time"]


def grouped(
    steps: Sequence[StepMetrics], records: Sequence[Record], *, fit: bool
) -> tuple[SizeAndDirection, ...]:
    """Collect steps by size and direction."""
    ordered = sorted(steps, key=lambda one: abs(one.size))
    clusters: list[list[StepMetrics]] = []
    for step in ordered:
        if clusters and abs(step.size) <= (1 + _SAME_SIZE) * abs(clusters[-1][0].size):
            clusters[-1].append(step)
        else:
            clusters.append([step])
    return tuple(
        _group(own, records, fit)
        for cluster in clusters
        for direction in ("opening", "closing")
        if (own := [step for step in cluster if step.direction == direction])
    )


def _group(steps: list[StepMetrics], records: Sequence[Record], fit: bool) -> SizeAndDirection:
    moved = [one for one in steps if one.moved]
    common = any(one.common for one in steps)

    def mean(name: str, own: Sequence[StepMetrics]) -> Interval:
        found = [(one.values[name], one.errors[name], *one.sampling[name]) for one in own]
        return mean_of(found, common)

    means = {name: mean(name, moved) for name in STEP_METRICS}
    estimates = {
        name: replace(one, low=max(one.low, 0.0)) if one.is_known else one
        for name, one in means.items()
    }
    estimates["gain"] = mean("gain", steps)
    estimates["gain_scatter"] = scatter_of([one.values["gain"] for one in steps])
    estimates["fitted_dead_time"] = _fitted_dead_time(moved, records) if fit else Interval()
    return SizeAndDirection(
        size=float(np.mean([abs(one.size) for one in steps])),
        direction=steps[0].direction,
        stroke=all(one.stroke for one in steps),
        count=len(steps),
        moved=len(moved),
        settled=sum(one.settled for one in moved),
        estimates=estimates,
    )


def mean_of(estimates: Sequence[tuple[float, float, float, float]], common: bool) -> Interval:
    """Mean of repeats with its 95 % interval, from the values, their standard errors and samplings.

    From three repeats on by their scatter and Student's distribution; before that, and never less,
    by their standard errors, which no mean reduces if the repeats have them in common. What the
    samples leave open is added; repeats are sampled alike.
    """
    from scipy.special import stdtrit

    known = np.array([one for one in estimates if np.isfinite(one[:2]).all()])
    if not known.size:
        return Interval()
    values, errors, *sampling = known.T
    count = values.size
    half = Z_95 * float(np.sqrt(np.mean(errors**2) / (1 if common else count)))
    if count >= 3:
        scatter = float(np.std(values, ddof=1)) / np.sqrt(count)
        half = max(half, float(stdtrit(count - 1, 0.975)) * scatter)
    elif count == 2:
        half = max(half, 0.5 * float(np.ptp(values)))
    value, below, above = (float(np.mean(one)) for one in (values, *sampling))
    return Interval(value, value - below - half, value + above + half, count)


def scatter_of(values: Sequence[float]) -> Interval:
    """Standard deviation of repeats with its 95 % interval, by chi-square; from three on."""
    from scipy.special import chdtri

    known = np.array([value for value in values if np.isfinite(value)])
    if known.size < 3:
        return Interval()
    deviation, freedom = float(np.std(known, ddof=1)), known.size - 1
    low, high = (deviation * float(np.sqrt(freedom / chdtri(freedom, tail)))
                 for tail in (0.025, 0.975))  # fmt: skip
    return Interval(deviation, low, high, known.size)


def _fitted_dead_time(steps: list[StepMetrics], records: Sequence[Record]) -> Interval:
    """Dead time of one model for all steps, by the output-error fit."""
    settled = [one for one in steps if one.settled][:_MOST_FITTED]
    if not settled:
        return Interval()
    cut = [cut_out(records[one.record], one) for one in settled]
    found = linear_fit(cut)
    better = found and found[0].better
    # zeros that fit better imitate a limited rate
    if better and (better.order, better.relative_degree) in STRUCTURES_OF_MORE_LAGS:
        found = linear_fit(cut, STRUCTURES_OF_MORE_LAGS)
    # no linear model fits a response at a limited rate: it has no dead time to report
    right = found is not None and found[0].at_noise_level and found[0].better is None
    return found[1] if found is not None and right else Interval()


def linear_fit(
    records: Sequence[Record], structures: Sequence[tuple[int, int]] = STRUCTURES
) -> tuple[OutputErrorFit, Interval] | None:
    """Linear model of records with gains of their own, and its dead time; None if there is none."""
    try:
        # What a fit warns of concerns records given by a user, and these are cut out of one.
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", DataWarning)
            if len(records) == 1:
                model = identify(records[0], structures=structures)
            else:
                model = identify(records, structures=structures, gains="own")
            fit = fit_of(model, OutputErrorFit)
    except CtrlRealizeError:
        return None
    return fit, Interval(fit.dead_time, *fit.interval, len(records))


def cut_out(record: Record, step: StepMetrics) -> Record:
    """The samples of one step with the hold before it."""
    edge = step.command_edge
    long = edge.stop - edge.index
    start = max(edge.start + (edge.index - edge.start) // 2, edge.index - long)
    block = max((edge.stop - start) // _MOST_SAMPLES, 1)
    # every block-th sample, counted from the step, so that it stays at its sample
    own = np.arange(start, edge.stop)[(edge.index - start) % block :: block]
    command = np.where(own < edge.index, step.before, step.after)
    return Record(
        record.time[own] - record.time[edge.index],
        command,
        np.ravel(record.output)[own],
        name=f"{step.size:+.3g} % at {step.time:.4g} s",
        input_labels=record.input_labels,
        output_labels=record.output_labels,
        units=dict(record.units),
    )
