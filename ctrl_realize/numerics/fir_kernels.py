r"""Regularised impulse responses: Gaussian priors tuned by their marginal likelihood.

A pulse response that decays is a Gaussian process with covariance c D K D, where
D = diag(lambda^(w i)) is the decay and K a stationary correlation of neighbours:

- TC ("tuned/correlated"): lambda^max(i, j), so w = 1/2 and K = lambda^(\|i-j\|/2);
- DC ("diagonal/correlated"): w = 1/2 and K = rho^\|i-j\| with rho free;
- SS ("stable spline"): w = 3/2 and K = (3 lambda^(\|i-j\|/2) - lambda^(3\|i-j\|/2)) / 2, smoother.

With K = L L^T the estimate, its covariance and the likelihood of (lambda, rho, c) need one
Cholesky factorization of ``I + (c / sigma^2) L^T D R D L``, R the Gram matrix of the lagged input;
sigma^2 is eliminated in closed form. The inverse of a kernel, whose entries reach lambda^-n, is
never formed.

References
----------
T. Chen, H. Ohlsson, L. Ljung, On the estimation of transfer functions, regularizations and
Gaussian processes - revisited, Automatica 48 (2012), 1525-1535;
G. Pillonetto, G. De Nicolao, A new kernel-based approach for linear system identification,
Automatica 46 (2010), 81-93.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from scipy.linalg import solve_triangular
from scipy.linalg.blas import dtrmm
from scipy.linalg.lapack import dpotrf, dtrtrs
from scipy.optimize import minimize

from .arrays import FloatArray
from .lagged import NormalEquations

CHOSEN_FROM = ("TC", "SS")
"""Kernels that are compared when none is asked for: a search in DC takes several times as long."""

FEW = 40
"""Taps to which a response is tied for that comparison."""

COARSE = 100
"""Taps up to which hyper-parameters are searched at full resolution."""
_WORST = 1e300
_ROUNDING = 1e-13
"""Part of the mean square added to the squares, so that rounding leaves none below zero."""
FLOOR = 1e-13
"""Least noise variance, as a share of the output's: what rounding leaves of the sums."""


@dataclass(frozen=True, eq=False)
class KernelFit:
    """Posterior of the pulse response of one output.

    ``markov`` (m, n) is the mean and ``std`` its standard deviation; `decay` (m,) holds lambda,
    `correlation` (m,) the correlation of neighbours, `scale` (m,) c, and `evidence` the log
    marginal likelihood up to a constant. ``effective`` is the number of parameters that the data
    decide, trace(I - M^-1); ``kernel`` is the prior.
    """

    markov: FloatArray
    std: FloatArray
    noise_variance: float
    decay: FloatArray
    correlation: FloatArray
    scale: FloatArray
    evidence: float
    effective: float
    kernel: str


def fit_kernel(equations: NormalEquations, lags: int, kernel: str) -> KernelFit:
    """Estimate the pulse responses from every input to one output.

    Parameters
    ----------
    equations : NormalEquations
        Of ``m * lags`` regressors, one target.
    lags : int
    kernel : {"TC", "DC", "SS", "auto"}
        ``"auto"``: TC or SS, whichever has the larger marginal likelihood.

    Returns
    -------
    KernelFit
    """
    m = equations.gram.shape[0] // lags
    equations = _rounded(equations)
    b, power = equations.cross[:, 0], float(equations.power[0, 0])
    group = -(-lags // COARSE)
    misfit = (power, equations.freedom)
    if kernel == "auto":
        values = {name: _tied(equations, m, lags, name)[1] for name in CHOSEN_FROM}
        kernel = min(values, key=lambda name: values[name])
    x = _start(equations, m, lags, kernel)
    if group > 1:
        # Most of the way is gone with neighbouring taps tied, at a fraction of the cost.
        x = _search(*_grouped(equations, m, lags, group), *misfit, kernel, x, 0.7)[0]
        x = _search(equations.gram, b, m, lags, 1, *misfit, kernel, x, 0.15)[0]
    else:
        x = _search(equations.gram, b, m, lags, 1, *misfit, kernel, x, 0.7)[0]
    return _posterior(equations, x, m, lags, kernel)


def cautious_std(equations: NormalEquations, lags: int, fit: KernelFit) -> FloatArray:
    """Standard deviations (m, lags) that do not rest on the smoothness of the prior.

    At each lag the larger one of the fit's own and that under TC, the distance of both means
    included. Its own takes it for known how smooth a response is and how fast it decays: under SS
    it misses the truth where the response sets in, and where it dies away more slowly than it
    began.
    """
    if fit.kernel == "TC":
        return fit.std
    m = equations.gram.shape[0] // lags
    equations = _rounded(equations)
    b, misfit = equations.cross[:, 0], (float(equations.power[0, 0]), equations.freedom)
    x = _tied(equations, m, lags, "TC")[0]
    # Tied taps make the decay too fast for the last ones.
    x = _search(equations.gram, b, m, lags, 1, *misfit, "TC", x, 0.15)[0]
    other = _posterior(equations, x, m, lags, "TC")
    return np.maximum(fit.std, np.hypot(other.std, fit.markov - other.markov))


def _rounded(equations: NormalEquations) -> NormalEquations:
    """Add to the squares what rounding leaves of them."""
    size = equations.gram.shape[0]
    diagonal = np.full(size, _ROUNDING * np.trace(equations.gram) / size)
    return replace(equations, gram=equations.gram + np.diag(diagonal))


def _posterior(
    equations: NormalEquations, x: FloatArray, m: int, lags: int, kernel: str
) -> KernelFit:
    """Mean and standard deviation of the response, given the hyper-parameters."""
    b, power = equations.cross[:, 0], float(equations.power[0, 0])
    factor = _factor(x, m, lags, 1, kernel)
    value, C, half, least = _likelihood(equations.gram, b, factor, power, equations.freedom)
    variance = least / equations.freedom
    weights = solve_triangular(C.T, half, lower=False)
    wide = np.zeros((m * lags, m * lags))
    for i in range(m):
        part = slice(i * lags, (i + 1) * lags)
        wide[part, part] = factor[i]
    spread = solve_triangular(C, wide.T, lower=True)
    inverse_diagonal = solve_triangular(C, np.eye(m * lags), lower=True)
    decay, correlation, scale = _meaning(x, m, kernel)
    return KernelFit(
        markov=(wide @ weights).reshape(m, lags),
        std=np.sqrt(variance * (spread**2).sum(axis=0)).reshape(m, lags),
        noise_variance=variance,
        decay=decay,
        correlation=correlation,
        scale=scale * variance,
        evidence=-value / 2,
        effective=float(m * lags - (inverse_diagonal**2).sum()),
        kernel=kernel,
    )


def _tied(equations: NormalEquations, m: int, lags: int, kernel: str) -> tuple[FloatArray, float]:
    """Search hyper-parameters on tied taps, where a likelihood costs little."""
    tied = _grouped(equations, m, lags, -(-lags // FEW))
    misfit = (float(equations.power[0, 0]), equations.freedom)
    return _search(*tied, *misfit, kernel, _start(equations, m, lags, kernel), 0.7)


def _shape_count(kernel: str) -> int:
    return 2 if kernel == "DC" else 1


def _start(equations: NormalEquations, m: int, lags: int, kernel: str) -> FloatArray:
    """Guess that the response decays within a third of the window and explains the output."""
    energy = np.diag(equations.gram).reshape(m, lags).mean(axis=1)
    signal = 20.0 * equations.freedom / np.maximum(energy, 1e-300) / lags
    shape = [np.log(6.0 / lags)] + ([np.log(3.0 / lags)] if kernel == "DC" else [])
    return np.concatenate([[*shape, np.log(s)] for s in signal])


def _meaning(x: FloatArray, m: int, kernel: str) -> tuple[FloatArray, FloatArray, FloatArray]:
    rows = x.reshape(m, -1)
    rate = np.exp(rows[:, 0])
    decay = np.exp(-rate)
    if kernel == "DC":
        correlation = np.exp(-np.exp(rows[:, 1]))
    elif kernel == "TC":
        correlation = np.exp(-rate / 2)
    else:
        correlation = (3 * np.exp(-rate / 2) - np.exp(-1.5 * rate)) / 2
    return decay, correlation, np.exp(rows[:, -1])


def _factor(x: FloatArray, m: int, lags: int, group: int, kernel: str) -> list[FloatArray]:
    """Return sqrt(c / sigma^2) D L of every input: lower triangular, `lags` rows.

    Taps lie `group` samples apart, the first one in the middle of its group.
    """
    factors = []
    index = group * np.arange(lags)
    apart = np.arange(lags)[:, None] - np.arange(lags)
    for row in x.reshape(m, -1):
        rate, scale = np.exp(row[0]), np.exp(row[-1] / 2)
        if kernel == "SS":
            slow, fast = np.exp(-rate / 2 * index), np.exp(-1.5 * rate * index)
            K = ((3 * slow - fast) / 2)[np.abs(apart)]
            # Smooth kernels are singular to rounding when the decay is slow.
            K.flat[:: lags + 1] += 1e-11
            L = _cholesky(K)
            decline = 1.5 * rate
        else:
            step = np.exp(row[1]) if kernel == "DC" else rate / 2
            L = np.where(apart < 0, 0.0, np.exp(-step * index)[np.abs(apart)])
            L[:, 1:] *= np.sqrt(-np.expm1(-2 * step * group))
            decline = rate / 2
        exponent = decline * (index + (group + 1) / 2)
        # Numbers below 1e-154 square to denormals, on which processors are slow.
        D = np.where(exponent < 350, np.exp(-np.minimum(exponent, 350)), 0.0)
        factors.append(np.asfortranarray(scale * D[:, None] * L))
    return factors


def _likelihood(
    gram: FloatArray, cross: FloatArray, factor: list[FloatArray], power: float, freedom: int
) -> tuple[float, FloatArray, FloatArray, float]:
    """Return -2 log marginal likelihood, Cholesky factor of M, C^-1 L^T b, weighted misfit."""
    n = factor[0].shape[0]
    M = np.empty_like(gram, order="F")
    right = np.empty_like(cross)
    for i, Li in enumerate(factor):
        rows = slice(i * n, (i + 1) * n)
        right[rows] = Li.T @ cross[rows]
        for j, Lj in enumerate(factor[: i + 1]):
            columns = slice(j * n, (j + 1) * n)
            half = dtrmm(1.0, Lj, gram[rows, columns], side=1, lower=1)
            M[rows, columns] = dtrmm(1.0, Li, half, side=0, trans_a=1, lower=1, overwrite_b=1)
    M[np.diag_indices(M.shape[0])] += 1.0
    C = _cholesky(M)
    half = dtrtrs(C, right, lower=1)[0]
    least = max(power - float(half @ half), FLOOR * power)
    value = freedom * np.log(least) + 2.0 * float(np.log(np.diag(C)).sum())
    return value, C, half, least


def _cholesky(matrix: FloatArray) -> FloatArray:
    """Factorize in place where that can be: LAPACK without SciPy's checks, a third of the time."""
    lower, failed = dpotrf(matrix, lower=1, clean=1, overwrite_a=1)
    if failed:
        raise np.linalg.LinAlgError("the matrix is not positive definite")
    return np.asarray(lower, dtype=np.float64)


def _search(
    gram: FloatArray,
    cross: FloatArray,
    m: int,
    lags: int,
    group: int,
    power: float,
    freedom: int,
    kernel: str,
    start: FloatArray,
    size: float,
) -> tuple[FloatArray, float]:
    """Minimize -2 log marginal likelihood over the logarithms of the hyper-parameters.

    The simplex starts with steps of `size`, and ends with a thirtieth of that.
    """
    span = lags * group
    shapes = _shape_count(kernel)
    low = np.tile([np.log(0.1 / span)] * shapes + [-80.0], m)
    high = np.tile([np.log(3.0)] * shapes + [80.0], m)
    # Where one point weighs 1e77 times as much as another, the prior is narrow from the start.
    low[shapes :: shapes + 1] = np.minimum(-80.0, start[shapes :: shapes + 1] - 40.0)

    def misfit(x: FloatArray) -> float:
        factor = _factor(x, m, lags, group, kernel)
        try:
            return _likelihood(gram, cross, factor, power, freedom)[0]
        except np.linalg.LinAlgError:
            # a prior so wide that the rounding of `gram` outweighs the identity: no better for
            # it. Not infinity, which the search takes differences of.
            return _WORST

    steps = np.tile([size] * shapes + [2 * size], m)
    inside = np.clip(start, low, high)
    scales = slice(shapes, None, shapes + 1)
    while misfit(inside) >= _WORST and (inside[scales] > low[scales]).any():
        inside[scales] = np.maximum(inside[scales] - 3.0, low[scales])
    # Steps go inward where the start lies at a bound, or the simplex would be flat there.
    steps = np.where(inside + steps > high, -steps, steps)
    simplex = np.vstack([inside, inside + np.diag(steps)])
    found = minimize(
        misfit,
        inside,
        method="Nelder-Mead",
        bounds=list(zip(low, high, strict=True)),
        # A difference of 0.1 in -2 log likelihood is far inside what the data can tell.
        options={
            "initial_simplex": simplex,
            "xatol": max(size / 30, 0.02),
            "fatol": 0.02 if size > 0.5 else 0.1,
            "maxfev": (300 if size > 0.5 else 40) * m,
        },
    )
    return np.asarray(found.x, dtype=np.float64), float(found.fun)


def _grouped(
    equations: NormalEquations, m: int, lags: int, group: int
) -> tuple[FloatArray, FloatArray, int, int, int]:
    """Tie neighbouring taps together: the same data with `group` times fewer unknowns."""
    edges = np.arange(0, lags, group)
    where = (np.arange(m)[:, None] * lags + edges).ravel()
    gram = np.add.reduceat(np.add.reduceat(equations.gram, where, axis=0), where, axis=1)
    return gram, np.add.reduceat(equations.cross[:, 0], where), m, edges.size, group
