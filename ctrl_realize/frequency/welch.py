"""Frequency response from the spectra of overlapping segments."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TypeAlias

import numpy as np
from scipy.signal import get_window

from .._checks import integer
from ..errors import DataError, OptionError
from ..numerics.arrays import FloatArray
from ..numerics.rational.spectra import SpectralSums, independent_segments, segment_sums
from .points import MeasuredPoints

Stream: TypeAlias = Iterator[tuple[FloatArray, FloatArray, float]]
"""Input (m, N), output (p, N) and sample time of each record."""

_LONGEST_DEFAULT_SEGMENT = 8192
_INDEPENDENT = 1e-6
"""Least eigenvalue of the coherence matrix of the inputs for which they are distinguishable."""


def from_segments(
    stream: Stream,
    method: str,
    segment: int | None,
    window: str | tuple[str, float],
    overlap: float,
) -> tuple[MeasuredPoints, float]:
    """MeasuredPoints by Welch's method: averaged spectra of overlapping windowed segments.

    Returns the estimate and the sample time.
    """
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
            f"records of up to {longest} samples hold {0 if sums is None else sums.count} "
            f"segments of {taps.size}; expected at least two: give a shorter segment"
        )
    frequency = np.asarray(np.fft.rfftfreq(taps.size, dt), dtype=np.float64)
    # Zero frequency was removed with the mean; the last line is the Nyquist frequency.
    lines = slice(1, (taps.size + 1) // 2)
    averages = independent_segments(taps, hop, sums.count)
    several = sums.yu.shape[:2] != (1, 1)
    if several and method != "H1":
        raise OptionError(
            f"method={method!r} is for one input and one output; use 'H1' for several"
        )
    return _divided(sums, frequency, lines, method, averages), dt


def _divided(
    sums: SpectralSums, frequency: FloatArray, lines: slice, method: str, averages: float
) -> MeasuredPoints:
    """Solve ``S_yu = H S_uu`` at every frequency: H1, of which H2 and Hv are multiples."""
    uu = np.moveaxis(sums.uu[..., lines], -1, 0)
    yu, yy = np.moveaxis(sums.yu[..., lines], -1, 0), sums.yy[:, lines].T
    m, single = uu.shape[1], yu.shape[1:] == (1, 1)
    if averages <= m:
        raise DataError(
            f"{averages:.3g} independent segments are too few for {m} inputs; give a shorter "
            "segment"
        )
    power = np.einsum("fii->fi", uu).real
    if single and not np.any(power > 0):
        raise DataError("the input is constant: it does not excite the plant")
    excited = np.all(power > np.finfo(float).eps ** 2 * power.max(), axis=1)
    # Fully correlated inputs cannot be distinguished: their matrix is singular.
    scaled = uu / np.sqrt(np.maximum(power[:, :, None] * power[:, None, :], 1e-300))
    excited &= np.linalg.eigvalsh(scaled)[:, 0] > _INDEPENDENT
    if not excited.any():
        raise DataError(
            "the inputs do not excite the plant independently: their contributions cannot be "
            "separated at any frequency"
        )
    if single:
        excited &= (yy[:, 0] > 0) & (np.abs(yu[:, 0, 0]) > 0)
    if not excited.any():
        raise DataError("the output is constant: there is no response to estimate")
    uu, yu, yy = uu[excited], yu[excited], yy[excited]
    inverse = np.linalg.inv(uu)
    response = yu @ inverse
    explained = np.einsum("fij,fij->fi", response, yu.conj()).real
    coherence = np.clip(explained / np.maximum(yy, 1e-300), 0.0, 1.0)
    left = yy * (1 - coherence) / (averages - m)
    share = np.einsum("fii->fi", inverse).real
    std = np.sqrt(left[:, :, None] * share[:, None, :])
    response = response / coherence[:, :, None] ** {"H1": 0.0, "Hv": 0.5, "H2": 1.0}[method]
    part = (0, 0) if single else ...
    seen = np.broadcast_to(coherence[:, :, None], response.shape)
    response, seen, std = (np.moveaxis(each, 0, -1)[part] for each in (response, seen, std))
    return MeasuredPoints(frequency[lines][excited], response, seen, std, averages - m + 1)


def _window(length: int, window: str | tuple[str, float]) -> FloatArray:
    integer(length, "segment", 8)
    try:
        return np.asarray(get_window(window, length), dtype=np.float64)
    except (ValueError, TypeError) as error:
        raise OptionError(f"window={window!r} is not a window known to scipy: {error}") from error


def _default_segment(n_samples: int) -> int:
    length = 1 << max(3, (n_samples // 8).bit_length() - 1)
    return min(length, _LONGEST_DEFAULT_SEGMENT)
