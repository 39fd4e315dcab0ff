"""From a measured step to an impulse response, one pure function for each step.

``detect_step`` finds the edge in the input, ``unit_step`` cuts out and scales the response,
``impulse_from_step`` differentiates and filters it (section 3.2 of the paper).
"""

from __future__ import annotations

from typing import Literal

import numpy as np

from ..checks import one_of, positive, real, whole
from ..errors import DataError, NoStepError, OptionError
from ..numerics.arrays import FloatArray
from ..numerics.differences import backward_difference, central_difference
from ..numerics.edges import Edge, difference_noise, find_edges
from ..numerics.filters import low_pass, settling_samples
from ..numerics.rest import rest_line
from ..numerics.rise import rise_time
from ..numerics.time_axis import EXTREME
from ..signals import FilterSpec, ImpulseResponse, Record, StepEdge, StepResponse
from ..signals.given import as_record, check_complete

BANDWIDTH_TIMES_RISE = 0.35
"""-3 dB bandwidth in Hz times the 10-90 % rise time, for a lag of any order within 5 %."""

CUTOFF_OVER_BANDWIDTH = 13.0
"""Automatic cut-off: below 8 the filter shapes the response, above 15 it lets noise through."""


def detect_step(
    record: Record, *, spike_samples: int | None = None, min_share: float = 0.1
) -> StepEdge:
    """Find the step in the input of a record.

    Spikes, noise, slow drift and an offset of the input do not move the result, and no samples
    before the step are needed. Of several edges the first large one is returned (at least half
    as high as the highest); all of them are in its `edges`.

    Parameters
    ----------
    record : Record
        One input signal.
    spike_samples : int, optional
        Longest spike to ignore, in samples. Default: 0.1 % of the record, 3 to 50.
    min_share : float, optional
        Smallest edge to look for, as a part of the range of the input.

    Returns
    -------
    StepEdge

    Raises
    ------
    NoStepError
        The input is constant, only noise, or its step comes with the last sample.

    Examples
    --------
    >>> import numpy as np
    >>> import ctrl_realize as cr
    >>> t = 0.01 * np.arange(400)
    >>> u = np.where(t < 1.0, 4.0, 20.0)
    >>> u[50] = 40.0  # a spike
    >>> edge = cr.detect_step(cr.Record(t, u, 0 * t))
    >>> edge.index, edge.rest, edge.amplitude
    (100, 4.0, 16.0)
    """
    signal = _single(as_record(record).input, "input", record)
    if spike_samples is None:
        spikes = int(np.clip(record.n_samples // 1000, 3, 50))
        # A record of a few samples holds no window of that length on either side of its step.
        spikes = min(spikes, max((record.n_samples - 3) // 6, 0))
    else:
        spikes = whole(spike_samples, "spike_samples", 0, record.n_samples // 3)
    share = real(min_share, "min_share", "part of the input's range, above 0 and below 1")
    if not 0 < share < 1:
        raise OptionError(f"min_share={share:g}; needed is above 0 and below 1")
    found = find_edges(signal, spikes, share)
    if not found:
        raise NoStepError(
            f"no step in the input {_of(record)}: it runs from {signal.min():.6g} to "
            f"{signal.max():.6g} with noise of {difference_noise(signal):.2g}, and no level holds "
            f"for more than {spikes} samples. Check which column is the input; for other inputs "
            "use impulse_from_io"
        )
    edges = tuple(_to_step_edge(edge, record) for edge in found)
    highest = max(abs(edge.amplitude) for edge in edges)
    if highest < 1 / EXTREME:
        raise NoStepError(f"the largest edge {_of(record)} is {highest:g} high, which is nothing")
    main = next(edge for edge in edges if abs(edge.amplitude) >= 0.5 * highest)
    if main.index + main.samples >= record.n_samples:
        raise NoStepError(
            f"the step {_of(record)} comes at sample {main.index} of {record.n_samples}: "
            "nothing was recorded after it"
        )
    return StepEdge(
        main.index,
        main.time,
        main.amplitude,
        main.rest,
        main.samples,
        main.start,
        main.stop,
        edges,
    )


def unit_step(
    record: Record, edge: StepEdge | None = None, *, remove_drift: bool | None = None
) -> StepResponse:
    """Cut out the response to one step, take its rest level off and scale it to a unit step.

    Parameters
    ----------
    record : Record
        One input and one output.
    edge : StepEdge, optional
        Which step; default: what `detect_step` finds.
    remove_drift : bool, optional
        Take off the line through the samples before the step instead of their mean. Default: when
        its slope is significant (five standard errors) over at least 50 samples.

    Returns
    -------
    StepResponse
        From the step up to the next edge or the end; the noise before it is kept in `.pre`.

    Raises
    ------
    NoStepError
        See `detect_step`.
    DataError
        Several channels, or fewer than five samples after the step.

    Examples
    --------
    >>> import numpy as np
    >>> import ctrl_realize as cr
    >>> t = 0.01 * np.arange(400)
    >>> u = np.where(t < 1.0, 4.0, 20.0)
    >>> y = 3.0 + 2.0 * (u - 4.0)
    >>> step = cr.unit_step(cr.Record(t, u, y))
    >>> float(step.output[-1]), step.amplitude, step.pre.size
    (2.0, 16.0, 100)
    """
    u = _single(as_record(record).input, "input", record)
    y = _single(record.output, "output", record)
    at = detect_step(record) if edge is None else edge
    if not isinstance(at, StepEdge):
        raise OptionError(f"edge is a {type(at).__name__}; needed is what detect_step returns")
    if not (0 <= at.index < at.stop <= record.n_samples and 0 <= at.start <= at.index):
        raise DataError(
            f"the edge lies at samples {at.start}...{at.index}...{at.stop}, the record has "
            f"{record.n_samples} samples; is it the edge of another record?"
        )
    if abs(at.amplitude) < 1 / EXTREME:
        raise DataError(f"the edge is {at.amplitude:g} high; nothing can be divided by that")
    if at.stop - at.index < 5:
        raise DataError(
            f"only {at.stop - at.index} samples follow the step {_of(record)} before the next "
            "edge or the end; at least 5 are needed"
        )
    before, after = y[at.start : at.index], y[at.index : at.stop]
    level, slope = rest_line(before, after, remove_drift)
    index = np.arange(at.start - at.index, at.stop - at.index)
    scaled = (y[at.start : at.stop] - level - slope * index) / at.amplitude
    return StepResponse(
        time=np.asarray(record.dt * index[before.size :]),
        output=scaled[before.size :],
        input=(u[at.index : at.stop] - at.rest) / at.amplitude,
        pre=scaled[: before.size],
        dt=record.dt,
        amplitude=at.amplitude,
        rest_output=level,
        drift=slope / record.dt,
        edge=at,
        name=record.name,
        record=record,
    )


def impulse_from_step(
    step: StepResponse,
    *,
    cutoff_hz: float | Literal["auto"] | None = "auto",
    filter_order: int = 5,
    zero_phase: bool = True,
    difference: Literal["backward", "central"] = "backward",
) -> ImpulseResponse:
    """Differentiate a step response and low-pass the result (section 3.2).

    Parameters
    ----------
    step : StepResponse
    cutoff_hz : float, "auto" or None, optional
        Cut-off of the Butterworth low-pass in Hz; the paper's is 50 Hz. ``"auto"`` takes 13
        times the bandwidth of the step response (and no filter where that is beyond 0.45 of the
        sample rate); None filters nothing.
    filter_order : int, optional
        The paper's is 5.
    zero_phase : bool, optional
        Forward and backward, so that the filter adds no delay. A causal filter delays the
        response by its group delay: 13.1 samples for the paper's.
    difference : {"backward", "central"}, optional
        ``"backward"`` is exactly step-invariant: right for simulation and control behind a hold.
        ``"central"`` is the paper's five-point formula; it samples the continuous impulse
        response, half a sample earlier.

    Returns
    -------
    ImpulseResponse
        Unit-pulse response from the step on; `.filter` is the filter that is left in it and
        `.noise` what the samples before the step became.

    Raises
    ------
    OptionError
        A cut-off outside 0...half the sample rate, an order outside 1...10.

    Examples
    --------
    >>> import numpy as np
    >>> import ctrl_realize as cr
    >>> t = 0.01 * np.arange(400)
    >>> u = np.where(t < 1.0, 0.0, 2.0)
    >>> y = np.where(t < 1.095, 0.0, 2 * (1 - np.exp(-(t - 1.1))))
    >>> g = cr.impulse_from_step(cr.unit_step(cr.Record(t, u, y)), cutoff_hz=None)
    >>> print(g.markov[9:13].round(4))
    [0.     0.     0.01   0.0099]
    """
    if not isinstance(step, StepResponse):
        raise DataError(f"step is a {type(step).__name__}; needed is a StepResponse, see unit_step")
    order = whole(filter_order, "filter_order", 1, 10)
    one_of(difference, "difference", ("backward", "central"))
    cutoff = _cutoff(step, cutoff_hz)
    # The samples before the step take part, so that differentiation and filter are settled when
    # the step comes. Where there are too few, rest is what was before: zeros.
    lead = 4 if cutoff is None else settling_samples(cutoff, step.dt) + 4
    zeros = np.zeros(max(lead - step.pre.size, 0))
    joint = np.concatenate([zeros, step.pre, step.output])
    edge = zeros.size + step.pre.size
    pulses = _differentiate(joint, difference)
    noise = _differentiate(step.pre, difference) if step.pre.size >= 20 else None
    if cutoff is not None:
        pulses = low_pass(pulses, order, cutoff, step.dt, zero_phase=zero_phase)
        if noise is not None:
            # Alone, so that a zero-phase filter carries nothing of the step into it.
            noise = low_pass(noise, order, cutoff, step.dt, zero_phase=zero_phase)
    return ImpulseResponse(
        pulses[edge:],
        step.dt,
        filter=None if cutoff is None else FilterSpec(order, cutoff, zero_phase, step.dt),
        noise=noise,
        sampling="step-invariant" if difference == "backward" else "impulse-invariant",
        name=step.name,
        step=step,
    )


def _cutoff(step: StepResponse, cutoff_hz: float | str | None) -> float | None:
    if cutoff_hz is None:
        return None
    rate = 1 / step.dt
    if isinstance(cutoff_hz, str):
        one_of(cutoff_hz, "cutoff_hz", ("auto",))
        rise = rise_time(step.output, step.dt)
        cutoff = CUTOFF_OVER_BANDWIDTH * BANDWIDTH_TIMES_RISE / rise
        return cutoff if cutoff < 0.45 * rate else None
    cutoff = positive(cutoff_hz, "cutoff_hz", "cut-off in Hz")
    if cutoff >= rate / 2:
        raise OptionError(
            f"cutoff_hz={cutoff:g} Hz; needed is below half the sample rate, {rate / 2:g} Hz "
            "(None filters nothing)"
        )
    if settling_samples(cutoff, step.dt) > 10 * (step.output.size + step.pre.size):
        raise OptionError(
            f"cutoff_hz={cutoff:g} Hz: this filter takes {5 / cutoff:.3g} s to settle, the step "
            f"response is {step.output.size * step.dt:.3g} s long"
        )
    return cutoff


def _differentiate(values: FloatArray, difference: str) -> FloatArray:
    if difference == "central":
        return central_difference(values)
    return backward_difference(values, before=float(values[0]))


def _single(signal: FloatArray, what: str, record: Record) -> FloatArray:
    check_complete(record, "a step response")
    if signal.ndim == 2 and signal.shape[0] > 1:
        raise DataError(
            f"the record has {signal.shape[0]} {what}s ({', '.join(_labels(record, what))}); a "
            "step response is taken of one, choose it when the record is made"
        )
    return signal if signal.ndim == 1 else signal[0]


def _labels(record: Record, what: str) -> tuple[str, ...]:
    return record.input_labels if what == "input" else record.output_labels


def _of(record: Record) -> str:
    return f"of record {record.name!r}" if record.name else "of the record"


def _to_step_edge(edge: Edge, record: Record) -> StepEdge:
    return StepEdge(
        edge.index,
        float(record.time[edge.index]),
        edge.amplitude,
        edge.rest,
        edge.samples,
        edge.start,
        edge.stop,
    )
