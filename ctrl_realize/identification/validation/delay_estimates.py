"""Compare the delay estimates of all methods that the data allow."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from ..._checks import check_type, integer
from ..._flags import Flag, flagged
from ...data import MeasuredFRF, Record
from ...data.given import check_complete
from ...delayed import fit_of
from ...errors import CtrlRealizeError, DataError
from ...numerics.blas_threads import single_threaded
from ...numerics.rational.phase import dead_time_from_phase, unwrap_with_dead_time
from ...numerics.signals.onset import correlation_onset, phase_slope
from ..impulse.from_io import impulse_from_io
from ..output_error.fit import fit_output_error
from ..output_error.result import OutputErrorFit
from ..realization.delay_scan import estimate_delay
from ..realization.delay_scan_result import DelayScan
from ..step.impulse import impulse_from_step
from ..step.steps import unit_step
from .delay_estimates_result import DelayComparison, DelayEstimate

TOP_BAND = 1 / 3
"""Upper part of the band in which the slope of the phase is estimated, as a fraction."""
MOST_LAGS = 1000
"""Largest lag of the cross-correlation."""
UNSEEN = 0.01
"""Probability of a significant cross-correlation by chance."""
NO_LEVEL = "its interval shows how flat the IAE curve is; it is not a confidence interval"
"""Doubt about any scan: its interval contains the true delay in fewer than half of all records."""
DOUBTFUL = ("no_delay_resolved", "order_in_noise", "delay_at_bound", "phase_leads")
"""Flags by which a method reports that its data do not support its estimate."""


@single_threaded
def compare_delay_estimates(
    record: Record | None = None,
    *,
    frf: MeasuredFRF | None = None,
    max_delay: int | None = None,
    order: int | None = None,
) -> DelayComparison:
    """Estimate a delay by all methods that the data allow, and compare.

    From a record: output-error fit (`fit_output_error`), the paper's scan (`estimate_delay`, from
    the differentiated step or from `impulse_from_io`), visible onset after a step from rest, and
    onset of the cross-correlation with the prewhitened input. From an FRF: fit with continuous dead
    time (`fit_frf`) and slope of the phase at the upper end of the band.

    Parameters
    ----------
    record : Record, optional
        A step or any other input; one input, one output.
    frf : MeasuredFRF, optional
        Of the same plant, one input, one output.
    max_delay : int, optional
        Largest delay of the scan in samples. Default: the total delay of the fit, and ten samples.
    order : int, optional
        Order of the scan; default: that of the output-error fit, at most 3.

    Returns
    -------
    DelayComparison

    Raises
    ------
    DataError
        Neither record nor FRF, or data for which every method fails.

    Notes
    -----
    The scan has no confidence interval: its row shows the delays that fit about as well, widened by
    one sample on each side because it is limited to whole samples. If its flags state that the data
    do not show whether there is a delay, or that its order is in the noise, it is in doubt and does
    not count; nor does a fit to an FRF whose phase leads. The others have 95 % intervals, and the
    one to rely on is the narrowest. Visible onset, onset of the correlation and slope of the phase
    cannot be shorter than the dead time (except for noise), and exceed it by part of the lags: they
    are upper bounds.

    The methods belong to the classes of [1]_: explicit parameter, approximation (onset and
    correlation) and phase.

    References
    ----------
    .. [1] S. Bjorklund and L. Ljung, A review of time-delay estimation techniques, Proc. 42nd IEEE
       Conf. Decision and Control (2003) 2502-2507, doi:10.1109/CDC.2003.1272997.

    Examples
    --------
    >>> import control as ct
    >>> import numpy as np
    >>> import ctrl_realize as cr
    >>> plant = cr.delayed_ss(ct.tf([2.0], [0.3, 1]), dead_time=0.125, dt=0.01)
    >>> rng = np.random.default_rng(0)
    >>> u = np.repeat(rng.choice([-1.0, 1.0], 60), 15)
    >>> y = plant.simulate(u) + 0.05 * rng.standard_normal(900)
    >>> record = cr.Record(0.01 * np.arange(900), u, y)
    >>> check = cr.validation.compare_delay_estimates(record, order=1)
    >>> check.agree, [view.method for view in check.estimates]
    (True, ['output error', 'scan', 'cross-correlation'])
    """
    if record is None and frf is None:
        raise DataError("expected a record or an FRF, got neither")
    if max_delay is not None:
        integer(max_delay, "max_delay", 0)
    if order is not None:
        integer(order, "order", 1)
    found: list[DelayEstimate | Flag] = []
    if record is not None:
        found += _from_record(record, max_delay, order)
    if frf is not None:
        check_type(frf, MeasuredFRF, "frf", "a MeasuredFRF, such as read_frf(path)")
        found += _from_frf(frf)
    estimates = tuple(one for one in found if isinstance(one, DelayEstimate))
    flags = tuple(one for one in found if isinstance(one, Flag))
    if not estimates:
        raise DataError("no method found a delay: " + "; ".join(map(str, flags)))
    return DelayComparison(estimates, None if record is None else record.dt, flags)


def _from_record(
    record: Record, max_delay: int | None, order: int | None
) -> Iterator[DelayEstimate | Flag]:
    """Estimates of the methods for records, and a flag for each that fails."""
    check_complete(record, "compare_delay_estimates")
    if not record.issiso():
        raise DataError(f"{record!r} has several channels; expected one input and one output")
    dt = record.dt
    total, model_order, stepped = 0.1 * record.n_samples * dt, 2, False
    try:
        fit = fit_of(fit_output_error(record), OutputErrorFit)
    except CtrlRealizeError as problem:
        yield flagged("no_output_error", problem=problem)
    else:
        yield DelayEstimate("output error", "record", "dead time", fit.dead_time, *fit.interval)
        stepped = bool(np.isfinite(fit.onset))
        if stepped and not fit.data.relaxing:
            # Back to the last sample at the baseline; the motion started within the sample before.
            first = max(fit.onset, 0.0)
            yield DelayEstimate("onset", "record", "upper bound", first, 0.0, first + dt)
        total, model_order = max(fit.total_delay, fit.dead_time), min(fit.order, 3)
    most = int(np.ceil(total / dt)) + 10 if max_delay is None else max_delay
    try:
        yield _scan(record, stepped, most, order or model_order, total)
    except CtrlRealizeError as problem:
        yield flagged("no_scan", problem=problem)
    if not stepped:
        yield _from_correlation(record, most)


def _from_correlation(record: Record, most: int) -> DelayEstimate | Flag:
    lags = int(min(MOST_LAGS, max(most, 20), record.n_samples // 4))
    seen = correlation_onset(record.input.ravel(), record.output.ravel(), lags, 1 - UNSEEN)
    if seen.onset < 0:
        return flagged("no_correlation", lags=lags)
    # With a hold, the first visible response at lag k started within the sample before.
    value = seen.onset * record.dt
    return DelayEstimate("cross-correlation", "record", "upper bound", value, 0.0, value)


def _scan(record: Record, stepped: bool, most: int, order: int, total: float) -> DelayEstimate:
    if stepped:
        impulse = impulse_from_step(unit_step(record))
    else:
        tail = int(np.ceil(6 * total / record.dt)) + 20
        length = min(most + max(tail, 8 * order), record.n_samples // 4)
        impulse = impulse_from_io(record, length)
    system = estimate_delay(impulse, order, max_delay=min(most, impulse.n_samples // 2))
    scan = fit_of(system, DelayScan)
    low, high = scan.delay_interval
    at, start, stop = (n * record.dt for n in (scan.delay, max(low - 1, 0), high + 1))
    doubt = _doubt(scan.flags) or NO_LEVEL
    return DelayEstimate("scan", "record", "dead time", at, start, stop, doubt)


def _doubt(flags: tuple[Flag, ...]) -> str:
    """Return the reasons of a method to doubt its own estimate."""
    return "; ".join(str(flag) for flag in flags if flag.code in DOUBTFUL)


def _from_frf(frf: MeasuredFRF) -> Iterator[DelayEstimate | Flag]:
    """Estimates of the methods for frequency responses, and a flag for each that fails."""
    # Not imported at the top: most comparisons have no FRF, and its fit is a large part of the
    # package.
    from ...frequency.fit import fit_frf
    from ...frequency.frf_fit import FRFFit

    try:
        fit = fit_of(fit_frf(frf), FRFFit)
    except CtrlRealizeError as problem:
        yield flagged("no_frf_fit", problem=problem)
    else:
        doubt = _doubt(fit.flags)
        yield DelayEstimate("FRF fit", "FRF", "dead time", fit.dead_time, *fit.interval, doubt)
    omega = 2 * np.pi * np.asarray(frf.frequency_hz)
    values = np.asarray(frf.complex, dtype=np.complex128).ravel()
    if omega.size < 4:
        yield flagged("no_phase_slope", count=omega.size)
        return
    phase = unwrap_with_dead_time(omega, values, dead_time_from_phase(omega, values))
    slope, std = phase_slope(omega, phase, TOP_BAND)
    low, high = max(slope - 2 * std, 0.0), slope + 2 * std
    yield DelayEstimate("phase slope", "FRF", "upper bound", slope, low, high)
