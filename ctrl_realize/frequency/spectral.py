"""A frequency response from records of noise, operating data or periodic signals."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from typing import Literal

import numpy as np
from scipy.signal import get_window

from ..checks import one_of, real, whole
from ..errors import DataError, OptionError, TimeAxisError
from ..numerics.arrays import ComplexArray, FloatArray
from ..numerics.spectra import (
    SpectralSums,
    independent_segments,
    period_statistics,
    segment_sums,
)
from ..signals import MeasuredFRF, Record
from ..signals.given import as_records, check_complete

_LONGEST_DEFAULT_SEGMENT = 8192
_MIN_LINE_POWER = 1e-4
_MIN_LINE_TO_NOISE = 10.0


def spectral_frf(
    records: Record | Iterable[Record],
    *,
    method: Literal["H1", "H2", "Hv"] = "H1",
    segment: int | None = None,
    window: str | tuple[str, float] = "hann",
    overlap: float = 0.5,
    delay: int = 0,
    period: int | None = None,
    skip_periods: int = 1,
    name: str = "measured",
) -> MeasuredFRF:
    r"""Estimate a frequency response from input and output spectra.

    Without `period`: Welch's method, the averaged spectra of overlapping windowed segments.
    With `period`: the mean over whole periods of a periodic input (multisine), which has no
    leakage, at the lines that the input excites.

    Parameters
    ----------
    records : Record or iterable of Record
        Any number of inputs and outputs (with `method` "H1"). An iterable is gone through once
        and never held in memory, so it may be a generator that reads a long file piece by piece.
        No segment reaches from one record into the next.
    method : {"H1", "H2", "Hv"}
        "H1" is for noise on the output, "H2" for noise on the input, "Hv" is their geometric
        mean. For periodic records all three are the ratio of the mean spectra.
    segment : int, optional
        Samples in a segment; default a power of two, about an eighth of the first record, at
        most 8192.
    window : str or tuple, default "hann"
        Any window that `scipy.signal.get_window` knows.
    overlap : float, default 0.5
        Part of a segment that the next one shares, in 0...0.95.
    delay : int, default 0
        Dead time in samples that is known beforehand. The output is shifted by it before the
        segments are cut and the phase is put back afterwards: the segments of input and output
        then belong together, and the estimate loses its bias of ``delay / segment``.
    period : int, optional
        Samples in a period of the input.
    skip_periods : int, default 1
        Periods to leave out at the start of each record, where the transient is.
    name : str, default "measured"
        Name of the result in plots.

    Returns
    -------
    MeasuredFRF
        With coherence and the standard deviation of the complex response. With several
        channels, shape (outputs, inputs, K); the coherence is then the multiple coherence of
        each output, the same for all its inputs.

    Raises
    ------
    DataError
        Records too short for two segments or periods, of different sample time or channels, or
        inputs that do not excite, or not independently.
    OptionError
        Options that make no sense.

    Notes
    -----
    The coherence is :math:`\gamma^2 = |S_{yu}|^2 / (S_{uu} S_{yy})`. The variance of the complex
    response is :math:`|H|^2 (1 - \gamma^2) / (\gamma^2 K)` with K independent segments: the
    number of segments, reduced for what overlapping ones share (Welch 1967). For periods it
    comes from their scatter [1]_.

    A file that does not fit into memory is gone through piece by piece::

        n, t = 2**20, dt * np.arange(2**20)
        u, y = (np.memmap(name, dtype="f4", mode="r") for name in ("u.bin", "y.bin"))
        pieces = (cr.Record(t, u[k : k + n], y[k : k + n]) for k in range(0, u.size - n + 1, n))
        frf = cr.spectral_frf(pieces, segment=8192)

    An input that is held between the samples makes this the response of the *sampled* plant,
    which has the hold in it: ``compare_frf(..., hold=None)``.

    References
    ----------
    .. [1] R. Pintelon and J. Schoukens, *System Identification: A Frequency Domain Approach*,
       2nd ed., section 2.5.

    Examples
    --------
    >>> import numpy as np
    >>> import ctrl_realize as cr
    >>> u = np.random.default_rng(0).standard_normal(20_000)
    >>> y = 2 * np.roll(u, 5)
    >>> frf = cr.spectral_frf(cr.Record(0.01 * np.arange(u.size), u, y), delay=5)
    >>> print(round(abs(frf.complex[10]), 3), frf.coherence.min() > 0.9999)
    2.0 True
    """
    one_of(method, "method", ("H1", "H2", "Hv"))
    whole(delay, "delay", 0)
    stream = _aligned(records, delay)
    if period is not None:
        whole(period, "period", 4)
        whole(skip_periods, "skip_periods", 0)
        if segment is not None:
            raise OptionError("segment and period are given; periodic records take period alone")
        response, frequency, coherence, std, dt = _from_periods(stream, period, skip_periods)
    else:
        if not 0 <= real(overlap, "overlap", "part in 0...0.95") <= 0.95:
            raise OptionError(f"overlap={overlap!r}; needed is a part in 0...0.95")
        response, frequency, coherence, std, dt = _from_segments(
            stream, method, segment, window, overlap
        )
    response = response * np.exp(-2j * np.pi * frequency * delay * dt)
    return MeasuredFRF(response, frequency, coherence=coherence, std=std, name=name)


_Estimate = tuple[ComplexArray, FloatArray, FloatArray, FloatArray, float]


def _aligned(
    records: Record | Iterable[Record], delay: int
) -> Iterator[tuple[FloatArray, FloatArray, float]]:
    """Yield input, output (moved earlier by `delay`) and sample time of each record."""
    first_dt, channels = None, None
    for record in as_records(records):
        check_complete(record, "spectral_frf")
        if first_dt is None:
            first_dt = record.dt
        elif abs(record.dt - first_dt) > 1e-6 * first_dt:
            raise TimeAxisError(
                f"records have sample times of {first_dt:g} s and {record.dt:g} s; one is needed"
            )
        u, y = np.atleast_2d(record.input), np.atleast_2d(record.output)
        if channels is None:
            channels = len(u), len(y)
        elif channels != (len(u), len(y)):
            raise DataError(
                f"{record!r} has {len(u)} inputs and {len(y)} outputs, the first record "
                f"{channels[0]} and {channels[1]}"
            )
        if delay >= u.shape[1]:
            raise DataError(f"delay={delay} leaves nothing of {record!r}")
        yield u[:, : u.shape[1] - delay], y[:, delay:], record.dt
    if first_dt is None:
        raise DataError("no records; needed is at least one")


def _from_segments(
    stream: Iterator[tuple[FloatArray, FloatArray, float]],
    method: str,
    segment: int | None,
    window: str | tuple[str, float],
    overlap: float,
) -> _Estimate:
    """Estimate by Welch's method."""
    sums: SpectralSums | None = None
    taps, hop, dt, longest = np.ones(1), 1, 0.0, 0
    for u, y, sample_time in stream:
        dt = sample_time
        longest = max(longest, u.shape[1])
        if sums is None and taps.size == 1:
            taps = _window(segment or _default_segment(u.shape[1]), window)
            hop = max(1, round(taps.size * (1 - overlap)))
        if u.shape[1] >= taps.size:
            part = segment_sums(u, y, taps, hop)
            sums = part if sums is None else sums + part
    if sums is None or sums.count < 2:
        raise DataError(
            f"records of up to {longest} samples hold {0 if sums is None else sums.count} segments "
            f"of {taps.size}; at least two are needed: state a shorter segment"
        )
    frequency = np.asarray(np.fft.rfftfreq(taps.size, dt), dtype=np.float64)
    # Zero was removed with the mean; the last line is the Nyquist frequency.
    lines = slice(1, (taps.size + 1) // 2)
    averages = independent_segments(taps, hop, sums.count)
    several = sums.yu.shape[:2] != (1, 1)
    if several and method != "H1":
        raise OptionError(f"method={method!r} is for one input and one output; several take 'H1'")
    estimate = _many_channels if several else _one_channel
    return *estimate(sums, frequency, lines, method, averages), dt


_Spectra = tuple[ComplexArray, FloatArray, FloatArray, FloatArray]


def _one_channel(
    sums: SpectralSums, frequency: FloatArray, lines: slice, method: str, averages: float
) -> _Spectra:
    """Divide the spectra of one input and one output."""
    uu, yy, yu = sums.uu[0, 0, lines].real, sums.yy[0, lines], sums.yu[0, 0, lines]
    if not np.any(uu > 0):
        raise DataError("the input is constant: it does not excite the plant")
    excited = (uu > np.finfo(float).eps ** 2 * uu.max()) & (yy > 0) & (np.abs(yu) > 0)
    if not excited.any():
        raise DataError("the output is constant: there is no response to estimate")
    uu, yy, yu = uu[excited], yy[excited], yu[excited]
    h1, h2 = yu / uu, yy / yu.conj()
    response = {"H1": h1, "H2": h2, "Hv": yu / np.abs(yu) * np.sqrt(yy / uu)}[method]
    coherence = np.minimum(np.abs(yu) ** 2 / (uu * yy), 1.0)
    std = np.abs(h1) * np.sqrt((1 - coherence) / (coherence * averages))
    return response, frequency[lines][excited], coherence, std


def _many_channels(
    sums: SpectralSums, frequency: FloatArray, lines: slice, method: str, averages: float
) -> _Spectra:
    """Solve ``S_yu = H S_uu`` at every frequency (H1)."""
    uu = np.moveaxis(sums.uu[..., lines], -1, 0)
    yu, yy = np.moveaxis(sums.yu[..., lines], -1, 0), sums.yy[:, lines].T
    m = uu.shape[1]
    if averages <= m:
        raise DataError(
            f"{averages:.3g} independent segments are too few for {m} inputs; state a shorter "
            "segment"
        )
    power = np.einsum("fii->fi", uu).real
    excited = np.all(power > np.finfo(float).eps ** 2 * power.max(), axis=1)
    # Inputs that move together cannot be told apart: their matrix is singular.
    scaled = uu / np.sqrt(np.maximum(power[:, :, None] * power[:, None, :], 1e-300))
    excited &= np.linalg.eigvalsh(scaled)[:, 0] > 1e-6
    if not excited.any():
        raise DataError(
            "the inputs do not excite the plant independently: at no frequency can their "
            "shares be told apart"
        )
    uu, yu, yy = uu[excited], yu[excited], yy[excited]
    inverse = np.linalg.inv(uu)
    response = yu @ inverse
    explained = np.einsum("fij,fij->fi", response, yu.conj()).real
    coherence = np.clip(explained / np.maximum(yy, 1e-300), 0.0, 1.0)
    left = yy * (1 - coherence) / (averages - m)
    share = np.einsum("fii->fi", inverse).real
    std = np.sqrt(left[:, :, None] * share[:, None, :])
    return (
        np.moveaxis(response, 0, -1),
        frequency[lines][excited],
        np.moveaxis(np.broadcast_to(coherence[:, :, None], response.shape), 0, -1),
        np.moveaxis(std, 0, -1),
    )


def _window(length: int, window: str | tuple[str, float]) -> FloatArray:
    whole(length, "segment", 8)
    try:
        return np.asarray(get_window(window, length), dtype=np.float64)
    except (ValueError, TypeError) as error:
        raise OptionError(f"window={window!r} is none that scipy knows: {error}") from error


def _default_segment(n_samples: int) -> int:
    length = 1 << max(3, (n_samples // 8).bit_length() - 1)
    return min(length, _LONGEST_DEFAULT_SEGMENT)


def _from_periods(
    stream: Iterator[tuple[FloatArray, FloatArray, float]], period: int, skip: int
) -> _Estimate:
    """Estimate by averaging whole periods."""
    inputs, outputs, dt, n_skipped = [], [], 0.0, 0
    for inputs_now, outputs_now, sample_time in stream:
        if (len(inputs_now), len(outputs_now)) != (1, 1):
            raise DataError("period is for records with one input and one output")
        u, y, dt = inputs_now[0], outputs_now[0], sample_time
        whole_periods = u.size // period
        n_skipped += min(skip, whole_periods)
        span = slice(skip * period, whole_periods * period)
        inputs.append(u[span].reshape(-1, period))
        outputs.append(y[span].reshape(-1, period))
    stats = None
    count = sum(part.shape[0] for part in inputs)
    if count >= 2:
        stats = period_statistics(np.vstack(inputs), np.vstack(outputs))
    if stats is None:
        raise DataError(
            f"the records hold {count} periods of {period} samples after {n_skipped} were left "
            "out; at least two are needed"
        )
    power = np.abs(stats.mean_u) ** 2
    lines = np.arange(power.size)
    inside = (lines > 0) & (lines < (period + 1) // 2)
    strongest = power[inside].max()
    if strongest == 0:
        raise DataError("the input is constant: it does not excite the plant")
    excited = inside & (power > _MIN_LINE_POWER * strongest)
    excited &= power > _MIN_LINE_TO_NOISE * stats.var_u / count
    excited &= np.abs(stats.mean_y) > 0
    if not excited.any():
        raise DataError(
            f"no line stands out of the input's noise; is its period really {period} samples?"
        )
    U, Y = stats.mean_u[excited], stats.mean_y[excited]
    var_u, var_y, cov = stats.var_u[excited], stats.var_y[excited], stats.cov_yu[excited]
    response = Y / U
    relative = var_y / np.abs(Y) ** 2 + var_u / np.abs(U) ** 2 - 2 * (cov / (Y * U.conj())).real
    std = np.abs(response) * np.sqrt(np.maximum(relative, 0.0) / count)
    # Sums over the periods from means and scatter: sum |U|^2 = P |mean|^2 + (P - 1) var.
    share = (count - 1) / count
    uu, yy = np.abs(U) ** 2 + share * var_u, np.abs(Y) ** 2 + share * var_y
    coherence = np.minimum(np.abs(Y * U.conj() + share * cov) ** 2 / (uu * yy), 1.0)
    return response, np.fft.rfftfreq(period, dt)[excited], coherence, std, dt
