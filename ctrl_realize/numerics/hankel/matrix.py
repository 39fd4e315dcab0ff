"""Hankel matrices of Markov parameters, dense and as FFT products.

Entry ``(i, j)`` of the Hankel matrix of a sequence ``h`` is ``h[i + j]``;
with ``h[k] = G[k + 1]`` this is the matrix of Kung's algorithm. Parameters of
shape ``(p, m, N)`` give a block Hankel matrix with ``p x m`` blocks.
Sequences that are shorter than a matrix needs are continued by zeros, which
is Kung's zero-padded version.

References
----------
.. [1] G. H. Golub and C. F. Van Loan, Matrix Computations, 4th ed., Johns Hopkins 2013, section 4.8
   (Circulant and discrete Poisson systems).
.. [2] S. Y. Kung, A new identification and model reduction algorithm via singular value
   decomposition, Proc. 12th Asilomar Conf. Circuits, Systems and Computers (1978) 705-714.
"""

from __future__ import annotations

import numpy as np
from scipy.fft import next_fast_len

from ..arrays import ComplexArray, FloatArray


def fft_length(n: int) -> int:
    """Return a fast length of a real FFT, at least `n`.

    A power of two is preferred where it costs at most 6 % more points:
    1024 is faster than 1000 for 999 points.
    """
    power = 1 << max(0, n - 1).bit_length()
    fast = int(next_fast_len(n, real=True))
    return power if power <= 1.06 * fast else fast


def hankel_matrix(h: FloatArray, rows: int, columns: int) -> FloatArray:
    """Return the dense (block) Hankel matrix of a sequence.

    Parameters
    ----------
    h : ndarray, shape (N,) or (p, m, N)
        Sequence; continued by zeros where the matrix needs more.
    rows, columns : int
        Number of block rows and block columns.

    Returns
    -------
    ndarray, shape (rows, columns) or (p rows, m columns)

    Examples
    --------
    >>> import numpy as np
    >>> hankel_matrix(np.array([3.0, 2.0, 1.0]), 3, 2)
    array([[3., 2.],
           [2., 1.],
           [1., 0.]])
    """
    blocks = h if h.ndim == 3 else h[np.newaxis, np.newaxis, :]
    p, m, available = blocks.shape
    length = rows + columns - 1
    padded = np.zeros((p, m, length))
    padded[:, :, :available] = blocks[:, :, :length]
    windows = np.lib.stride_tricks.sliding_window_view(padded, columns, axis=2)
    return np.ascontiguousarray(windows.transpose(2, 0, 3, 1)).reshape(rows * p, columns * m)


class HankelStack:
    """Products with many symmetric Hankel matrices at once, by FFT.

    Parameters
    ----------
    h : ndarray, shape (D, L), L <= 2 size - 1
        One sequence a row; continued by zeros.
    size : int
        Rows (and columns) of every matrix.

    Notes
    -----
    The product is a correlation: ``w[i] = sum_j h[i + j] v[j]`` is the
    inverse transform of ``F(h) * conj(F(v))``. Wrap-around touches only
    entries beyond `size` when the transform has ``2 size - 1`` points.
    All temporaries live in a workspace that is reused from call to call.
    """

    def __init__(self, h: FloatArray, size: int) -> None:
        self.size = size
        self.points = fft_length(2 * size - 1)
        self._spectrum: ComplexArray = np.fft.rfft(h, n=self.points)
        self._transform: ComplexArray = np.empty_like(self._spectrum)
        self._product: FloatArray = np.empty((h.shape[0], self.points))

    def __call__(self, vectors: FloatArray) -> FloatArray:
        """Multiply matrix `d` by ``vectors[d]``.

        The answer, shape (D, size), is a view of the workspace: it lasts
        until the next call and may be overwritten.
        """
        # padded by hand, NumPy's own padding is slower by a sixth of the whole product
        self._product[:, : self.size] = vectors
        self._product[:, self.size :] = 0.0
        np.fft.rfft(self._product, n=self.points, out=self._transform)
        np.conjugate(self._transform, out=self._transform)
        np.multiply(self._transform, self._spectrum, out=self._transform)
        np.fft.irfft(self._transform, n=self.points, out=self._product)
        return self._product[:, : self.size]


class BlockHankel:
    """Products with one block Hankel matrix and its transpose, by FFT.

    Memory is that of the parameters' spectrum; a product costs ``p + m``
    real FFTs and a ``p x m`` product per frequency.

    Parameters
    ----------
    h : ndarray, shape (p, m, N)
        Sequence of blocks; continued by zeros.
    rows, columns : int
        Number of block rows and block columns.
    """

    def __init__(self, h: FloatArray, rows: int, columns: int) -> None:
        self.outputs, self.inputs, _ = h.shape
        self.rows, self.columns = rows, columns
        length = rows + columns - 1
        self.points = fft_length(length)
        spectrum = np.fft.rfft(h[:, :, :length], n=self.points)
        # frequency first: the products below are batched matrix products
        self._spectrum: ComplexArray = np.ascontiguousarray(spectrum.transpose(2, 0, 1))

    @property
    def shape(self) -> tuple[int, int]:
        """Rows and columns of the whole matrix."""
        return self.rows * self.outputs, self.columns * self.inputs

    def times(self, vector: FloatArray) -> FloatArray:
        """Return ``H @ vector``."""
        return self._correlate(self._spectrum, vector, self.inputs, self.rows)

    def transposed_times(self, vector: FloatArray) -> FloatArray:
        """Return ``H.T @ vector``."""
        transposed = self._spectrum.transpose(0, 2, 1)
        return self._correlate(transposed, vector, self.outputs, self.columns)

    def _correlate(
        self, spectrum: ComplexArray, vector: FloatArray, channels: int, length: int
    ) -> FloatArray:
        signals = vector.reshape(-1, channels).T
        transform = np.conjugate(np.fft.rfft(signals, n=self.points))
        product = np.matmul(spectrum, transform.T[:, :, np.newaxis])[:, :, 0]
        response: FloatArray = np.fft.irfft(product.T, n=self.points)
        return response[:, :length].T.ravel()


def hankel_norm_squared(h: FloatArray, rows: int, columns: int) -> float:
    """Return the squared Frobenius norm of a (block) Hankel matrix in O(N).

    Parameters
    ----------
    h : ndarray, shape (N,) or (p, m, N)
        Sequence; continued by zeros.
    rows, columns : int
        Number of block rows and block columns.
    """
    length = min(rows + columns - 1, h.shape[-1])
    k = np.arange(length)
    # h[k] stands on antidiagonal k, which has this many entries.
    times = np.minimum(np.minimum(k + 1, rows + columns - 1 - k), min(rows, columns))
    energy = (h[..., :length] ** 2).reshape(-1, length).sum(axis=0)
    return float(times @ energy)
