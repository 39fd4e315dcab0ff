"""Output-error fit of records whose input is not a step: one, or several of one plant together."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from itertools import compress

import numpy as np

from ..._flags import Flag, flagged
from ..._wording import chosen, in_time, named
from ...data import Record
from ...errors import DataError
from ...numerics.arrays import FloatArray
from ...numerics.constants import SMALLEST
from ...numerics.output_error.any_input.data import MOST_SAMPLES, SOUGHT_THEN, SampledData
from ...numerics.output_error.any_input.fit import SampledFit, fit_sampled
from ...numerics.output_error.other_structures import Requested
from ...numerics.output_error.result import AT_BOUND, OutputErrorEstimate
from ...numerics.output_error.step_data import StepData, bare_data, step_data
from ...numerics.rules import Rule
from ...numerics.signals.counters import counter_period
from ...numerics.validation.own_response import OwnResponse
from .averaging import common_sample_time
from .flags import coarse_flag, sampled_flags
from .loop_flags import late_input, loop_choices, unstable_flags
from .repeat_flags import repeat_flags
from .repeatability import Repeatability, delay_outliers, fit_alike, gain_outliers, unlike_records
from .result import OutputErrorFit
from .sensor_flags import missing_code
from .summary import choices_of

_LEAST_REST = 20  # samples before the first move of the input, for a plant at rest
_ALL = 0.99  # of a record, from which on the rest is not reported


class UnrelatedError(DataError):
    """The output does not respond to the input, as far as linear models tell."""


def fit_any_input(
    records: tuple[Record, ...],
    requested: Requested,
    ratios: FloatArray | None = None,
    *,
    refuses: bool = True,
) -> OutputErrorFit:
    """Fit one model to all records; level, drift and initial state are estimated for each record.

    A record whose delay or gain is an outlier is left out, as among step records, until there are
    no more outliers. With `ratios`, the relative gains of the records, their inputs are multiplied
    by them. A model that hardly follows the output is refused, or not.
    """
    dt = common_sample_time(records)
    scales = np.ones(len(records)) if ratios is None else ratios
    signals = [(y, scale * u) for (y, u), scale in zip(map(_signals, records), scales, strict=True)]

    def fitted(used: tuple[int, ...]) -> tuple[SampledFit, OutputErrorEstimate, list[OwnResponse]]:
        some = [records[i] for i in used]
        found = _fit(some, [signals[i] for i in used], dt, requested, refuses)
        own = [found.own_delay(*pair) for pair in signals] if len(records) > 1 else []
        return found, found.fit, own

    def unlike(repeats: Repeatability) -> list[int]:
        if ratios is None:
            return delay_outliers(repeats) + gain_outliers(repeats)
        return unlike_records(repeats, dt)

    every = tuple(range(len(records)))
    if len(records) == 1:
        found, fit, _ = fitted(every)
        return _summary(found, fit, records, requested.latest, None)
    ranges = [float(np.ptp(record.input)) for record in records]
    found, fit, repeats = fit_alike(fitted, unlike, [r.name for r in records], ranges, every)
    return _summary(found, fit, records, requested.latest, repeats)


def _signals(record: Record) -> tuple[FloatArray, FloatArray]:
    return np.ravel(record.output), np.ravel(record.input)


def _fit(
    records: Sequence[Record],
    signals: list[tuple[FloatArray, FloatArray]],
    dt: float,
    requested: Requested,
    refuses: bool,
) -> SampledFit:
    for record in records:
        _check_moves(record)
    outputs, inputs = zip(*signals, strict=True)
    # A free response that begins with the record explains a slow one from rest as well.
    # Ablation: fits from rest.
    whole = max(y.size for y in outputs) <= MOST_SAMPLES and not requested.loop
    rested = whole and Rule.FROM_REST.on and all(map(begins_at_rest, records))
    found = _sought(outputs, inputs, dt, replace(requested, rested=rested))
    if refuses and not found.follows:
        latest = requested.latest or SOUGHT_THEN * found.data.longest
        codes = [str(code) for y in found.data.measured if (code := missing_code(y))]
        raise UnrelatedError(
            f"{_named(records)}: the output does not respond to the input, which explains nothing "
            f"beyond the noise (test value {found.explained:.3g}, needed {found.needed:g}), with "
            f"dead times up to {in_time(latest)}; "
            + (codes[0] if codes else _advice(records, found.data.measured))
        )
    return found


def _sought(
    outputs: Sequence[FloatArray], inputs: Sequence[FloatArray], dt: float, requested: Requested
) -> SampledFit:
    """Fit records with dead times up to a part of them, and with later ones where none explains."""
    found = fit_sampled(outputs, inputs, dt, requested)
    inside = found.follows and found.fit.high < AT_BOUND * found.data.sought
    if requested.latest is not None or found.data.rested or inside:
        return found
    latest = SOUGHT_THEN * found.data.longest
    wider = fit_sampled(outputs, inputs, dt, replace(requested, latest=latest, rested=False))
    # What explains little is no response for being sought for longer: it must lie inside.
    inside = found.follows or wider.fit.high < AT_BOUND * latest
    return wider if wider.follows and inside else found


def _advice(records: Sequence[Record], outputs: Sequence[FloatArray]) -> str:
    """Advice where the output does not follow the input, which may be late.

    An unstable plant is named, and a counter that starts again.
    """
    if all(not record.n_missing for record in records):
        found = late_input(records) or next(unstable_flags(tuple(records), 0.0), None)
        if found is not None:
            return str(found)
    for output in outputs:
        if (period := counter_period(output)) is not None:
            return (
                f"it jumps like a counter that starts again after {period:.6g}: wrap={period:.6g} "
                "when it is read joins its turns, as numpy.unwrap does"
            )
    return "check the columns, and whether the input excites the plant"


def begins_at_rest(record: Record) -> bool:
    """Whether a record begins with constant inputs and an output that does not move."""
    y, u = np.ravel(record.output), np.atleast_2d(record.input)
    first = int(np.argmax(np.any(u != u[:, :1], axis=0)))
    if np.count_nonzero(~np.isnan(y[:first])) < _LEAST_REST:
        return False
    rest = step_data(y, u[0], record.dt, [(first, 1)])
    return not (rest.drift or rest.relaxing or rest.bend)


def _check_moves(record: Record) -> None:
    for name, values in zip(("output", "input"), _signals(record), strict=True):
        moves = float(np.ptp(values[~np.isnan(values)]))
        if moves < SMALLEST:
            raise DataError(
                f"the {name} of {named('record', record.name)} is constant (range "
                f"{moves:.3g}): there is nothing to fit"
            )


def _named(records: Sequence[Record]) -> str:
    if len(records) > 1:
        return f"{len(records)} records"
    return named("record", records[0].name)


def _summary(
    found: SampledFit,
    fit: OutputErrorEstimate,
    records: tuple[Record, ...],
    latest: float | None,
    repeats: Repeatability | None,
) -> OutputErrorFit:
    """Concatenate what was fitted on one time axis."""
    data = found.data
    used = records if repeats is None else tuple(compress(records, repeats.kept))
    shown, time = joined(used, data, fit.residual.std)
    limit = data.sought if latest is None else latest
    flags = [*sampled_flags(fit, data.dt, data.longest, limit), *_cut(used, found)]
    if found.quantum:
        flags.append(coarse_flag(found.quantum, shown))
    if repeats is not None:
        flags += repeat_flags(repeats, fit.dead_time, data.dt)
    sums = found.condensed
    reasons = []
    if data.rested:
        reasons.append(chosen("samples.rested"))
    if data.every > 1:
        what = "means of" if data.width > 1 else "one of"
        reasons.append(chosen("samples.blocks", what=what, every=data.every))
    if sums is not None:
        count, order = sums.samples, sums.noise_lags
        size, lags = sums.drive.factor.shape
        reasons.append(
            chosen("samples.condensed", samples=count, sums=size, lags=lags, noise_lags=order)
        )
    if fit.averaged:
        reasons += loop_choices(records[0])
    first = [record.time[offset] for record, offset in zip(used, data.offsets, strict=True)]
    moved = ", ".join(
        f"{size:.3g} seen from {in_time(first[i] + data.step * row, 4)} on"
        for i, row, size in sorted(found.loads)
    )
    if moved and fit.averaged:
        reasons.append(chosen("loop.load", moved=moved))
    elif moved:
        flags.append(flagged("load_disturbance.at_input", moved=moved))
    choices = (*reasons, *choices_of(fit))
    return OutputErrorFit(fit, shown, time, records, repeats, choices=choices, flags=tuple(flags))


def joined(
    records: Sequence[Record], data: SampledData, noise: float
) -> tuple[StepData, FloatArray]:
    """What is fitted, record after record, and its times."""
    times: list[FloatArray] = []
    middle = data.dt * (data.width - 1) / 2
    for record, offset, rows in zip(records, data.offsets, data.rows, strict=True):
        time = record.time[offset + data.every * rows] + middle
        times.append(time if not times else time - time[0] + times[-1][-1] + data.step)
    signal = np.concatenate([u[rows] for u, rows in zip(data.held, data.rows, strict=True)])
    output, span = np.concatenate(data.measured), sum(data.lengths) * data.step
    seen = bare_data(output, signal, data.dt, noise, span, data.every, not data.rested)
    return seen, np.concatenate(times)


def _cut(records: Sequence[Record], found: SampledFit) -> Iterator[Flag]:
    """Report records of which only a part was used."""
    data = found.data
    sizes = [data.every * output.size for output in data.outputs]
    long = [
        (record.n_samples, size, offset)
        for record, size, offset in zip(records, sizes, data.offsets, strict=True)
        if size < _ALL * record.n_samples
    ]
    if long and found.condensed is None:
        fits, size, offset = max(long)
        others = f", and so of {len(long) - 1} more" if len(long) > 1 else ""
        yield flagged("cut", used=size, first=offset, samples=fits, others=others)
