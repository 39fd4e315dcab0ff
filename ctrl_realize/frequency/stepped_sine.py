"""Frequency response from records of sines, one frequency after the other."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from itertools import islice
from typing import Any, TypeAlias

import numpy as np

from .._checks import check_type, not_negative, numbers
from ..data import MeasuredFRF, Record
from ..data.given import as_records, check_complete
from ..errors import DataError, OptionError
from ..numerics.arrays import FloatArray
from ..numerics.rational.sines import dominant_frequency
from .sine_batches import LEAST_SAMPLES, batches, fit_batch, misfit_beside_line

Sweep: TypeAlias = Sequence[Record] | Sequence[Sequence[Record]]

_ENOUGH = 3
"""Least number of repeats for estimating the standard deviation from them."""


def stepped_sine_frf(
    records: Sweep,
    *,
    frequency_hz: Sequence[float] | None = None,
    settle: float | None = None,
    free_frequency: bool = True,
    drift: bool = False,
    name: str = "measured",
) -> MeasuredFRF:
    r"""Estimate a frequency response from a stepped-sine measurement.

    In each record a sine with offset is fitted to input and output by least squares, with a common
    frequency that is estimated as well. The response is the ratio of their phasors. Repeats of a
    frequency are averaged.

    Parameters
    ----------
    records : sequence of Record, or sequence of sequences of Record
        One record for each frequency, or for each frequency its repeats. The frequencies may have
        any order; sample times and lengths may differ.
    frequency_hz : sequence of float, optional
        Frequency of each point in Hz, if known from the generator: the initial value of the fit, or
        the exact value with ``free_frequency=False``. Default: the strongest line of the input.
    settle : float, optional
        Time in s to leave out at the start of each record. Default: twice the time after which the
        misfit of the sine remains at the level of the last half; at most half of the record.
    free_frequency : bool, default True
        Estimate the frequency of each record.
    drift : bool, default False
        Fit a linear drift in addition to the offset.
    name : str, default "measured"
        Name of the result in plots.

    Returns
    -------
    MeasuredFRF
        At the measured frequencies (mean over the repeats), sorted. `std` is that of the averaged
        complex response: from the scatter of the repeats if there are at least three, otherwise
        from the misfit of the sines beside their frequency. `repeats` is the smallest number of
        values behind it at any point, repeats or bins of the misfit's spectrum: if they are few,
        intervals of 1.96 `std` contain less than 95 %, but those of `MeasuredFRF.circle` do. The
        rounding of a converter without noise is the same in every repeat, and is not part of the
        scatter.

    Raises
    ------
    DataError
        No records, records with several signals, too short for a sine, or an input without one.
    OptionError
        The number of frequencies is not that of the points.

    Notes
    -----
    The coherence is that of all samples used at one frequency,

    .. math:: \gamma^2 = \frac{|\sum_i Y_i \bar{U}_i|^2}
              {4 \sum_i P_{u,i} \; \sum_i P_{y,i}},

    with the phasors :math:`U_i, Y_i` of repeat *i* and the power :math:`P` of sine and misfit.
    It is the fraction of the output's power that is a repeatable sine: 1 for a noise-free linear
    plant, and ``1 / (1 + noise power / sine power)`` with noise on the output.

    Between samples the input counts as a sine, as from an analog generator. A sine that is held
    between them, as from a converter, is half a sample late in the input as recorded:
    ``fit_frf(frf, hold="zoh", dt=record.dt)`` divides the hold out.

    The sine with a free frequency is the four-parameter fit of [1]_; averaging over repeats follows
    [2]_.

    References
    ----------
    .. [1] IEEE Std 1057, IEEE Standard for Digitizing Waveform Recorders.
    .. [2] R. Pintelon and J. Schoukens, System Identification: A Frequency Domain Approach, 2nd
       ed., Wiley 2012, chapter 2, doi:10.1002/9781118287422.

    Examples
    --------
    >>> import numpy as np
    >>> import ctrl_realize as cr
    >>> t = 0.01 * np.arange(400)
    >>> u, y = np.sin(6 * t), 0.5 * np.sin(6 * t - 0.3)
    >>> frf = cr.stepped_sine_frf([cr.Record(t, u, y)])
    >>> print(np.round(2 * np.pi * frf.frequency_hz, 9), np.round(np.angle(frf.complex), 9))
    [6.] [-0.3]
    """
    points = _as_points(records)
    flat = [record for point in points for record in point]
    starts = _start_frequencies(points, flat, frequency_hz)
    if settle is not None:
        not_negative(settle, "settle", "time in s")

    estimates: dict[int, tuple[Any, ...]] = {}
    for batch in batches(flat):
        members = [flat[i] for i in batch]
        fit = fit_batch(members, starts[batch], settle, free_frequency, drift)
        power = 0.5 * np.abs(fit.phasor) ** 2 + fit.noise_variance
        # The total variance of a phasor is the trace; that of a ratio is the sum of the relative
        # ones.
        variance = np.trace(fit.phasor_covariance, axis1=2, axis2=3)
        stronger, bins = misfit_beside_line(members, fit)
        relative = (variance * stronger / np.abs(fit.phasor) ** 2).sum(axis=1)
        found = zip(fit.omega, fit.phasor, power, relative, bins, strict=True)
        estimates.update(zip(batch, found, strict=True))
    in_order = iter([estimates[k] for k in range(len(flat))])
    averages = [_averaged(point, islice(in_order, len(point))) for point in points]
    frequency, response, coherence, std, behind = map(np.array, zip(*averages, strict=True))
    least = float(behind.min())
    return MeasuredFRF(response, frequency, coherence=coherence, std=std, repeats=least, name=name)


def _as_points(records: Sweep) -> list[list[Record]]:
    """Check the records and give every point a list of repeats."""
    check_type(records, Iterable, "records", "a list of Records")
    points = [list(as_records(entry)) for entry in records]
    if not points:
        raise DataError("no records; expected at least one for each frequency")
    for point in points:
        for record in point:
            check_complete(record, "stepped_sine_frf")
            if not record.issiso():
                raise DataError(
                    f"{record!r} has several signals; stepped_sine_frf takes one input and one "
                    "output"
                )
            if record.n_samples < LEAST_SAMPLES:
                raise DataError(
                    f"{record!r} is too short for a sine; expected at least {LEAST_SAMPLES} samples"
                )
            for name in ("input", "output"):
                if np.ptp(getattr(record, name)) == 0:
                    raise DataError(f"the {name} of {record!r} is constant; it contains no sine")
    return points


def _start_frequencies(
    points: list[list[Record]], flat: list[Record], frequency_hz: Sequence[float] | None
) -> FloatArray:
    """Return an initial frequency for every record, in rad/s."""
    if frequency_hz is None:
        return _strongest_lines(flat)
    given = numbers(frequency_hz, "frequency_hz")
    if given.shape != (len(points),) or not np.all(np.isfinite(given)) or np.any(given <= 0):
        raise OptionError(
            f"frequency_hz has shape {given.shape}; expected {len(points)} frequencies above "
            "0, one for each point"
        )
    return 2 * np.pi * np.repeat(given, [len(point) for point in points])


def _strongest_lines(flat: list[Record]) -> FloatArray:
    """Find the strongest line of each input, in rad/s."""
    starts = np.empty(len(flat))
    for batch in batches(flat):
        inputs = np.stack([np.asarray(flat[i].input).ravel() for i in batch])
        dt, half = flat[batch[0]].dt, inputs.shape[1] // 2
        # The second half: a transient of the input has decayed.
        late = dominant_frequency(inputs[:, half:], dt)
        # With fewer than three periods in half of the record, the whole record is used.
        few = late * dt * inputs.shape[1] < 12 * np.pi
        starts[batch] = np.where(few, dominant_frequency(inputs, dt), late)
    return starts


def _averaged(
    point: list[Record], estimates: Iterable[tuple[Any, ...]]
) -> tuple[float, complex, float, float, float]:
    """Average the repeats of a point: frequency, response, coherence, std and values behind it."""
    omega, phasors, power, variances, bins = map(np.array, zip(*estimates, strict=True))
    u, y = phasors.T
    if np.any(np.abs(u) == 0):
        raise DataError(f"the input of {point[0]!r} has no sine in it")
    values = y / u
    # H1 over the repeats: strong ones have more weight, and the coherence is defined for it.
    response = (y @ u.conj()) / (u @ u.conj()).real
    total = 4 * power[:, 0].sum() * power[:, 1].sum()
    coherence = min(abs(y @ u.conj()) ** 2 / total, 1.0) if total > 0 else 0.0
    if len(point) >= _ENOUGH:
        variance, behind = np.var(values, ddof=1), len(point)
    else:
        # No mean is subtracted: the number of bins corresponds to one repeat more.
        variance, behind = np.mean(np.abs(values) ** 2 * variances), 1 + bins.sum()
    std = np.sqrt(variance / len(point))
    return omega.mean() / (2 * np.pi), response, coherence, std, behind
