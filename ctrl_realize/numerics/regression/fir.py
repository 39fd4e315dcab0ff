"""Regularised impulse responses: Gaussian priors tuned by their marginal likelihood.

The priors are those of `kernel_prior`; decay and size of the response are estimated from the data
by `kernel_search` [1]_. `cautious_std` is our own: a posterior standard deviation is valid only if
the prior is.

References
----------
.. [1] T. Chen, H. Ohlsson and L. Ljung, On the estimation of transfer functions, regularizations
   and Gaussian processes - revisited, Automatica 48 (2012) 1525-1535,
   doi:10.1016/j.automatica.2012.05.026.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from scipy.linalg import block_diag, solve_triangular

from ..arrays import FloatArray
from .kernel_search import CLOSE, KernelProblem
from .normal_equations import NormalEquations


@dataclass(frozen=True, eq=False)
class KernelFit:
    """Posterior of the pulse response of one output.

    ``markov`` (m, n) is the mean and ``std`` its standard deviation; `decay` (m,) is lambda,
    `scale` (m,) c, and `evidence` the log marginal likelihood up to a constant. ``effective`` is
    the number of parameters determined by the data, trace(I - M^-1); ``kernel`` is the prior.
    """

    markov: FloatArray
    std: FloatArray
    noise_variance: float
    decay: FloatArray
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
    kernel : {"TC", "SS", "auto"}
        ``"auto"``: TC or SS, whichever has the larger marginal likelihood.
    """
    problem = KernelProblem.of(equations, lags, kernel)
    if kernel == "auto":
        tried = [replace(problem, kernel=name) for name in ("TC", "SS")]
        problem = min(tried, key=lambda each: each.roughly()[1])
    return _posterior(problem, problem.best())


def cautious_std(equations: NormalEquations, lags: int, fit: KernelFit) -> FloatArray:
    """Standard deviations (m, lags) that do not depend on the smoothness of the prior.

    At each lag the larger of that of the fit and that for TC, including the difference of both
    means. That of the fit assumes that smoothness and decay of the response are known: with SS it
    is too small at the onset, and where the response decays more slowly than at first.
    """
    if fit.kernel == "TC":
        return fit.std
    problem = KernelProblem.of(equations, lags, "TC")
    # Grouped taps make the decay too fast for the last ones.
    other = _posterior(problem, problem.search(problem.roughly()[0], CLOSE)[0])
    return np.maximum(fit.std, np.hypot(other.std, fit.markov - other.markov))


def _posterior(problem: KernelProblem, x: FloatArray) -> KernelFit:
    """Mean and standard deviation of the response for given hyper-parameters."""
    m, lags = problem.inputs, problem.taps
    factors = problem.factors(x)
    found = problem.likelihood(factors)
    variance = found.least / problem.freedom
    # Mean F M^-1 F' b and covariance sigma^2 F M^-1 F' of the posterior (Chen et al. 2012).
    weights = solve_triangular(found.C.T, found.half, lower=False)
    wide = block_diag(*factors)
    spread = solve_triangular(found.C, wide.T, lower=True)
    inverse_diagonal = solve_triangular(found.C, np.eye(m * lags), lower=True)
    return KernelFit(
        markov=(wide @ weights).reshape(m, lags),
        std=np.sqrt(variance * (spread**2).sum(axis=0)).reshape(m, lags),
        noise_variance=variance,
        decay=np.exp(-np.exp(x[::2])),
        scale=np.exp(x[1::2]) * variance,
        evidence=-found.value / 2,
        effective=float(m * lags - (inverse_diagonal**2).sum()),
        kernel=problem.kernel,
    )
