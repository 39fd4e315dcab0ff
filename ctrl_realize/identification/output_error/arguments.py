"""Arguments of an output-error fit: records, the steps in them, known dynamics."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import control as ct
import numpy as np

from ..._checks import check_type
from ..._wording import named
from ...data import Record, StepEdge
from ...data.given import as_records, check_input
from ...delayed.operands import Linear
from ...errors import DataError, NoStepError, UnsuitableSystemError
from ...numerics.arrays import FloatArray
from ...numerics.constants import SMALLEST
from ...numerics.engine.modal import separated
from ...numerics.engine.problem import KnownFactor
from ...numerics.output_error.step_data import StepData, step_data
from ...numerics.rules import Rule
from ...numerics.signals.edges import despike, difference_noise
from ...numerics.signals.noise import mad_sigma
from ...numerics.signals.step_sequence import MOST_MOVES
from ..step.steps import found_step

_APART = 1e-3  # relative distance by which coincident poles are separated
_LAST = 5  # a first step in the last samples of a record has no response to fit

FEWEST_SAMPLES = 20  # four for each of lag, gain, dead time, level and drift
_MOST_EDGES = 12  # an input with more of them is no step experiment
_HOLDS = 0.2  # part of the step by which an input may stray between its edges
_MOVES, _MEAN, _UNLIKELY = 0.05, 10, 5.0
"""Part of the step by which the mean of ten samples may, or standard deviations of such means."""
_STRAY = 0.01  # part of the first step by which a clean input may stray before it
_ONE_WAY = 0.9
"""Of the moves of a curve; noise turns at two of three. Ablation: curves are no steps."""
_SPIKE = 3  # samples of a spike of the input that do not move a plant
DWELL = 3  # times the visible onset: the onsets of faster steps overlap


def known_factor(known: Any) -> KnownFactor:
    """Convert a continuous, stable, proper system of one input and one output to a factor.

    Raises
    ------
    UnsuitableSystemError
        Anything else.
    """
    if known is None:
        return KnownFactor()
    expected = "a control.TransferFunction or StateSpace"
    check_type(known, Linear, "known", expected, UnsuitableSystemError)
    if not known.issiso() or not known.isctime():
        raise UnsuitableSystemError(
            f"known has {known.ninputs} inputs, {known.noutputs} outputs and dt={known.dt}; "
            "expected a continuous system with one of each (a sensor or a filter)"
        )
    try:
        system = known if isinstance(known, ct.TransferFunction) else ct.ss2tf(known)
        num, den = np.trim_zeros(system.num[0][0], "f"), system.den[0][0]
    except UnsuitableSystemError as error:
        raise UnsuitableSystemError(
            f"known is {known!r}; expected {expected} without dead time, which is estimated "
            "together with that of the plant"
        ) from error
    if num.size == 0:
        raise UnsuitableSystemError("known is zero")
    if num.size > den.size:
        raise UnsuitableSystemError("known has more zeros than poles; expected a proper system")
    poles = np.roots(den).astype(np.complex128)
    if poles.size and np.max(poles.real) >= 0:
        raise UnsuitableSystemError(
            f"known has a pole at {complex(poles[np.argmax(poles.real)]):.3g} rad/s; expected "
            "a stable system (count integrators to the plant)"
        )
    # Partial fractions need distinct poles.
    poles = separated(poles[None], _APART)[0]
    return KnownFactor(poles, np.asarray(num / den[0], dtype=np.float64))


def checked_records(records: Record | Sequence[Record]) -> tuple[Record, ...]:
    """Check what every record of a fit needs: one input, one output, both of which move."""
    several = as_records(records)
    for record in several:
        check_input(record, "fit_output_error")
        seen = int(np.count_nonzero(record.seen))
        if seen < FEWEST_SAMPLES:
            raise DataError(
                f"{named('record', record.name)} has {seen} samples; a fit of delay, "
                f"gain and lags needs at least {FEWEST_SAMPLES}"
            )
        moves = float(np.ptp(record.output[..., record.seen]))
        if moves < SMALLEST:
            raise DataError(
                f"the output of {named('record', record.name)} does not leave its baseline: "
                f"its range is {moves:.3g}"
            )
        if not record.issiso():
            raise DataError(
                f"{named('record', record.name)} has {record.ninputs} inputs and "
                f"{record.noutputs} outputs; select one of each when the record is made"
            )
    return several


def on_common_axis(records: tuple[Record, ...]) -> tuple[Record, ...]:
    """Place records on the finest of their time axes, if the stamps of some are irregular."""
    finest = min(one.dt for one in records)
    if not any(one.irregular for one in records):
        return records
    return tuple(
        one if np.isclose(one.dt, finest, rtol=1e-6, atol=0) else one.on_axis(finest)
        for one in records
    )


def step_data_of(record: Record, first: int = 0) -> StepData | None:
    """Data of a step record from output `first` on; None for any other input."""
    signal, output = np.ravel(record.input), np.ravel(record.output)
    output = np.where(np.arange(output.size) < first, np.nan, output)
    edges = edges_of(record)
    if not edges:
        return None
    if np.isnan(output[edges[0].index :]).all():
        raise DataError(
            f"expected samples of the output after the step at {edges[0].time:.6g} s, but all of "
            f"{named('record', record.name)} are missing there; use a longer record"
        )
    data = step_data(output, signal, record.dt, [(e.index, e.samples) for e in edges])
    if data.motion is None:
        raise DataError(
            f"the output of {named('record', record.name)} does not leave its baseline by 5 "
            f"standard deviations ({5 * data.sigma:.3g}) for long after the step at "
            f"{edges[0].time:.6g} s"
        )
    if len(edges) > 1 and edges[1].index - edges[0].index < DWELL * data.motion.crossing:
        return None
    return data


def edges_of(record: Record) -> tuple[StepEdge, ...]:
    """Edges of a step experiment; none for any other input."""
    signal = np.ravel(record.input)
    try:
        edges = found_step(record, most=_MOST_EDGES).edges
    except NoStepError:
        if np.ptp(signal[:-_LAST]) == 0:
            # It moves only at the very end: there is no response to fit.
            raise
        return ()
    if len(edges) > _MOST_EDGES or _moves_before(signal, edges):
        return ()
    bounds = [0, *(edge.index for edge in edges), signal.size]
    ramps = [0, *(edge.samples for edge in edges)]
    held = [
        signal[min(start + max(ramp - 1, 0), stop) : stop]
        for start, stop, ramp in zip(bounds[:-1], bounds[1:], ramps, strict=True)
    ]
    largest = max(abs(edge.amplitude) for edge in edges)
    return edges if _holds_between(held, largest) and not _curved(held) else ()


def _moves_before(signal: FloatArray, edges: Sequence[StepEdge]) -> bool:
    """Whether a clean input moves before its first edge, by less than counts as one.

    The output may then move before the edge, or respond to it from a motion of its own.
    """
    before = signal[: edges[0].index]
    if before.size <= 2 * _SPIKE or difference_noise(signal) > 0:
        return False
    return float(np.ptp(despike(before, _SPIKE))) > _STRAY * abs(edges[0].amplitude)


def _curved(held: list[FloatArray]) -> bool:
    """Whether a clean input follows a curve after its edges, as behind a filter.

    No few steps describe it: poles and zeros would make up for them, up to five lags for one.
    """
    way = np.concatenate([np.sign(np.diff(part)) for part in held])
    way = way[way != 0]
    curved = way.size > MOST_MOVES and np.mean(way[1:] == way[:-1]) > _ONE_WAY
    return bool(curved) and Rule.CURVES.on


def _holds_between(held: list[FloatArray], largest: float) -> bool:
    """Whether an input is nearly constant between edges, for nine samples of ten, and in the mean.

    A sweep or noise may move like an edge, but is not constant afterwards. On measured steps the
    nine tenths lie within 2 % of the amplitude, on random inputs and sweeps beyond 45 %. The output
    of a controller moves on after the edge of its set point: the mean of ten samples leaves the
    level by 10 to 100 % of the largest edge in simulated loops, by 1.4 % in measured steps. Slow
    noise that a controller feeds back moves it everywhere, where edges tell more than noise.
    """
    away = [part - np.median(part) for part in held if part.size]
    whole = (despike(part, _SPIKE)[: part.size // _MEAN * _MEAN] for part in away)
    means = np.concatenate([part.reshape(-1, _MEAN).mean(axis=1) for part in whole])
    noise = _UNLIKELY * mad_sigma(means) if means.size else 0.0
    if np.quantile(np.abs(np.concatenate(away)), 0.9) > _HOLDS * largest:
        return False
    moves = bool(np.abs(means).max(initial=0.0) > max(_MOVES * largest, noise))
    return not (moves and Rule.HELD_STEPS.on)
