"""From a measured step to a unit-step response."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ..._checks import check_type
from ..._wording import named
from ...data import Record, StepEdge, StepResponse
from ...data.given import as_record, check_complete, check_input
from ...errors import DataError, NoStepError, OptionError
from ...numerics.arrays import FloatArray
from ...numerics.constants import SMALLEST
from ...numerics.signals.baseline import rest_line
from ...numerics.signals.edges import difference_noise, find_edges


def detect_step(record: Record) -> StepEdge:
    """Find the step in the input of a record.

    Spikes (of up to 0.1 % of the record, between 3 and 50 samples), noise, slow drift and an offset
    of the input do not affect the result, and no samples before the step are needed. Of several
    edges the first large one is returned (at least half as high as the highest); `edges` lists all
    that are at least a tenth of the input's range.

    Parameters
    ----------
    record : Record
        One input signal.

    Returns
    -------
    StepEdge

    Raises
    ------
    NoStepError
        The input is constant, consists of noise only, or steps at the last sample.

    Notes
    -----
    Medians on both sides of every sample are compared, so that spikes shorter than half a window
    have no effect; the window length and the rule for the end of an edge are our own. In the paper
    the time of the step is known [1]_.

    References
    ----------
    .. [1] J. van Helvoirt, O. Bosgra, B. de Jager and M. Steinbuch, Approximate realization of
       valve dynamics with time delay, Proc. 16th IFAC World Congress, 2005, section 3.1.

    Examples
    --------
    >>> import numpy as np
    >>> import ctrl_realize as cr
    >>> t = 0.01 * np.arange(400)
    >>> u = np.where(t < 1.0, 4.0, 20.0)
    >>> u[50] = 40.0  # a spike
    >>> edge = cr.detect_step(cr.Record(t, u, 0 * t))
    >>> edge.index, edge.baseline, edge.amplitude
    (100, 4.0, 16.0)
    """
    return found_step(record)


def found_step(record: Record, most: int | None = None) -> StepEdge:
    """As `detect_step`, with at most `most` + 1 edges, because there may be millions."""
    signal = _single(as_record(record).input, "input", record)
    # A short record does not contain a window of that length on both sides of its step.
    spikes = int(np.clip(record.n_samples // 1000, 3, 50))
    spikes = min(spikes, max((record.n_samples - 3) // 6, 0))
    found = find_edges(signal, spikes, most=most)
    if not found and np.ptp(signal) == 0:
        raise NoStepError(
            f"no step in the input {_of(record)}: it is {signal[0]:.6g} throughout. If the "
            "record begins with its step, give the steady state before it with "
            "record.with_baseline(u0, y0) or read_record(..., rest=(u0, y0)); otherwise check "
            "which column is the input"
        )
    if not found:
        raise NoStepError(
            f"no step in the input {_of(record)}: it runs from {signal.min():.6g} to "
            f"{signal.max():.6g} with noise of {difference_noise(signal):.2g}, and no level holds "
            f"for more than {spikes} samples. Check which column is the input; for other inputs "
            "use impulse_from_io"
        )
    edges = tuple(StepEdge(**vars(e), time=float(record.time[e.index])) for e in found)
    highest = max(abs(edge.amplitude) for edge in edges)
    if highest < SMALLEST:
        raise NoStepError(
            f"the largest edge {_of(record)} has the height {highest:g} and cannot be "
            "distinguished from zero"
        )
    main = next(edge for edge in edges if abs(edge.amplitude) >= 0.5 * highest)
    if main.index + main.samples >= record.n_samples:
        raise NoStepError(
            f"the step {_of(record)} comes at sample {main.index} of {record.n_samples}: "
            "nothing was recorded after it"
        )
    return replace(main, edges=edges)


def found_edges(record: Record, most: int) -> tuple[StepEdge, ...]:
    """Edges of an input that has at least one, and at most `most`; none for any other input."""
    try:
        edges = found_step(record, most=most).edges
    except NoStepError:
        return ()
    return edges if len(edges) <= most else ()


def unit_step(
    record: Record, edge: StepEdge | None = None, *, remove_drift: bool | None = None
) -> StepResponse:
    """Cut out the response to one step, subtract its baseline and scale it to a unit step.

    Parameters
    ----------
    record : Record
        One input and one output.
    edge : StepEdge, optional
        Step to use. Default: that of `detect_step`.
    remove_drift : bool, optional
        Subtract a straight line through the samples before the step instead of their mean. Default:
        if its slope is significant (five standard errors) over at least 50 samples.

    Returns
    -------
    StepResponse
        From the step to the next edge or the end; the samples before it are in `.pre_step`.

    Raises
    ------
    NoStepError
        See `detect_step`.
    DataError
        Several channels, or fewer than five samples after the step.

    References
    ----------
    .. [1] J. van Helvoirt, O. Bosgra, B. de Jager and M. Steinbuch, Approximate realization of
       valve dynamics with time delay, Proc. 16th IFAC World Congress, 2005, section 3.2.

    Examples
    --------
    >>> import numpy as np
    >>> import ctrl_realize as cr
    >>> t = 0.01 * np.arange(400)
    >>> u = np.where(t < 1.0, 4.0, 20.0)
    >>> y = 3.0 + 2.0 * (u - 4.0)
    >>> step = cr.unit_step(cr.Record(t, u, y))
    >>> float(step.output[-1]), step.amplitude, step.pre_step.size
    (2.0, 16.0, 100)
    """
    u = _single(as_record(record).input, "input", record)
    y = _single(record.output, "output", record)
    at = detect_step(record) if edge is None else edge
    check_type(at, StepEdge, "edge", "the result of detect_step", OptionError)
    if not (0 <= at.index < at.stop <= record.n_samples and 0 <= at.start <= at.index):
        raise DataError(
            f"the edge lies at samples {at.start}...{at.index}...{at.stop}, the record has "
            f"{record.n_samples} samples; check that it belongs to this record"
        )
    if abs(at.amplitude) < SMALLEST:
        raise DataError(f"the edge has the amplitude {at.amplitude:g}, which cannot be divided by")
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
        input=(u[at.index : at.stop] - at.baseline) / at.amplitude,
        pre_step=scaled[: before.size],
        dt=record.dt,
        amplitude=at.amplitude,
        baseline=level,
        drift=slope / record.dt,
        edge=at,
        name=record.name,
        record=record,
    )


def _single(signal: FloatArray, what: str, record: Record) -> FloatArray:
    (check_input if what == "input" else check_complete)(record, "a step response")
    if signal.ndim == 2 and signal.shape[0] > 1:
        labels = record.input_labels if what == "input" else record.output_labels
        raise DataError(
            f"the record has {signal.shape[0]} {what}s ({', '.join(labels)}); "
            "a step response has one; select it when the record is made"
        )
    return signal if signal.ndim == 1 else signal[0]


def _of(record: Record) -> str:
    return f"of {named('record', record.name)}"
