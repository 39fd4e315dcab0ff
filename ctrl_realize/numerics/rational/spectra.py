"""Spectra, averaged over segments or periods, for frequency responses.

Segments are averaged as in [1]_, [2]_, periods as in [3]_; the hold is that of [4]_.

References
----------
.. [1] P. D. Welch, The use of fast Fourier transform for the estimation of power spectra, IEEE
   Trans. Audio Electroacoust. 15 (1967) 70-73, doi:10.1109/TAU.1967.1161901.
.. [2] J. S. Bendat and A. G. Piersol, Random Data, 4th ed., Wiley 2010, chapters 9 and 11,
   doi:10.1002/9781118032428.
.. [3] R. Pintelon and J. Schoukens, System Identification: A Frequency Domain Approach, 2nd ed.,
   Wiley 2012, chapter 2, doi:10.1002/9781118287422.
.. [4] K. J. Astrom and B. Wittenmark, Computer-Controlled Systems, 3rd ed., Prentice Hall 1997,
   section 2.3.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view

from ..arrays import ComplexArray, FloatArray


def hold_response(omega: FloatArray, dt: float) -> ComplexArray:
    """Evaluate a zero-order hold of unit gain: ``(1 - exp(-j w dt)) / (j w dt)``.

    Its phase is ``-w dt / 2``, half a sample of delay.

    Examples
    --------
    >>> import numpy as np
    >>> hold = hold_response(np.array([2 * np.pi * 13.0]), 7.8125e-4)
    >>> print(np.round(np.degrees(np.angle(hold)), 3))
    [-1.828]
    """
    half = 0.5 * omega * dt
    return np.asarray(np.sinc(half / np.pi) * np.exp(-1j * half), dtype=np.complex128)


@dataclass(frozen=True, eq=False)
class SpectralSums:
    """Auto and cross power, summed over `count` segments.

    ``uu[i, j] = sum U_i conj(U_j)`` (m, m, F), ``yu[i, j] = sum Y_i conj(U_j)`` (p, m, F) and
    ``yy[i] = sum |Y_i|^2`` (p, F), with the windowed discrete Fourier transforms of the segments.
    Sums of two sets of segments add.
    """

    uu: ComplexArray
    yy: FloatArray
    yu: ComplexArray
    count: int

    def __add__(self, other: SpectralSums) -> SpectralSums:
        """Join the sums of two sets of segments."""
        return SpectralSums(
            self.uu + other.uu, self.yy + other.yy, self.yu + other.yu, self.count + other.count
        )


def segment_sums(u: FloatArray, y: FloatArray, window: FloatArray, hop: int) -> SpectralSums:
    """Sum the spectra of overlapping segments, each without its mean.

    Parameters
    ----------
    u, y : ndarray, shapes (m, N), (p, N), N >= L
    window : ndarray, shape (L,)
    hop : int
        Samples from one segment to the next.

    Returns
    -------
    SpectralSums
        At the F = L // 2 + 1 frequencies of ``rfft``.
    """
    length = window.size
    inputs, outputs = (sliding_window_view(x, length, axis=1)[:, ::hop] for x in (u, y))
    (m, n_segments), p, size = inputs.shape[:2], y.shape[0], length // 2 + 1
    uu = np.zeros((m, m, size), dtype=np.complex128)
    yu = np.zeros((p, m, size), dtype=np.complex128)
    yy = np.zeros((p, size))
    # Blocks of segments, to limit the memory for long records.
    block = max(1, 2**20 // (length * (m + p)))
    for first in range(0, n_segments, block):
        parts = (x[:, first : first + block] for x in (inputs, outputs))
        U, Y = (np.fft.rfft((x - x.mean(axis=2, keepdims=True)) * window) for x in parts)
        uu += np.einsum("isf,jsf->ijf", U, U.conj())
        yu += np.einsum("isf,jsf->ijf", Y, U.conj())
        yy += (Y.real**2 + Y.imag**2).sum(axis=1)
    return SpectralSums(uu, yy, yu, n_segments)


def independent_segments(window: FloatArray, hop: int, count: int) -> float:
    """Count the independent averages in `count` overlapping segments (Welch 1967).

    Examples
    --------
    >>> import numpy as np
    >>> independent_segments(np.ones(64), 64, 10)
    10.0
    """
    length = window.size
    energy = float(window @ window)
    excess = 0.0
    for lag in range(1, min(count, -(-length // hop))):
        shift = lag * hop
        # Welch (1967): the correlation of two periodograms is (sum w[n] w[n + shift] / sum w^2)^2.
        shared = float(window[: length - shift] @ window[shift:]) / energy
        excess += 2 * (1 - lag / count) * shared**2
    return count / (1 + excess)


@dataclass(frozen=True, eq=False)
class PeriodStatistics:
    """Means and (co)variances of the lines over the periods of a periodic record.

    ``mean_u``, ``mean_y`` are the means of the discrete Fourier transforms of the periods;
    ``var_u``, ``var_y`` and ``cov_yu`` are the (complex) variances and the covariance of one
    period about them, with divisor ``count - 1``.
    """

    mean_u: ComplexArray
    mean_y: ComplexArray
    var_u: FloatArray
    var_y: FloatArray
    cov_yu: ComplexArray
    count: int


def period_statistics(u: FloatArray, y: FloatArray) -> PeriodStatistics:
    """Transform every period; compute mean and scatter of each line.

    Parameters
    ----------
    u, y : ndarray, shape (P, L), P >= 2
        One period per row; the transform over a whole period has no leakage.
    """
    count = u.shape[0]
    U, Y = np.fft.rfft(u, axis=1), np.fft.rfft(y, axis=1)
    mean_u, mean_y = U.mean(axis=0), Y.mean(axis=0)
    du, dy = U - mean_u, Y - mean_y
    freedom = count - 1
    return PeriodStatistics(
        mean_u=mean_u,
        mean_y=mean_y,
        var_u=(np.abs(du) ** 2).sum(axis=0) / freedom,
        var_y=(np.abs(dy) ** 2).sum(axis=0) / freedom,
        cov_yu=(dy * du.conj()).sum(axis=0) / freedom,
        count=count,
    )
