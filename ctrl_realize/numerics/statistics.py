"""Robust summaries of repeated estimates.

Trimmed means follow [1]_; the ratio of a complex normal error to a standard deviation from repeats
has the distribution given by [2]_ for spectra.

References
----------
.. [1] K. K. Yuen, The two-sample trimmed t for unequal population variances, Biometrika 61 (1974)
   165-170, doi:10.1093/biomet/61.1.165.
.. [2] N. R. Goodman, Statistical analysis based on a certain multivariate complex Gaussian
   distribution, Ann. Math. Statist. 34 (1963) 152-177, doi:10.1214/aoms/1177704250.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy import special

from ..errors import OptionError
from .arrays import FloatArray


@dataclass(frozen=True)
class TrimmedStatistics:
    """Mean and scatter of the values that remain after trimming both ends.

    ``mean`` and ``variance`` are those of the ``count`` values left;
    ``std_error`` is Yuen's, ``winsorized std / ((1 - 2 share) sqrt(n))`` with ``share = trim / n``,
    and ``interval`` is ``mean +- t std_error`` with ``count - 1`` degrees of freedom.

    Parameters
    ----------
    mean : float
        Mean of the remaining values.
    variance : float
        Variance of the remaining values, with divisor ``count - ddof``.
    std_error : float
        Standard error of `mean` as an estimate of the trimmed mean of the population.
    interval : tuple of float
        95 % interval of the trimmed mean.
    count : int
        Number of remaining values.
    dropped : int
        Number of values left out at both ends together.

    Examples
    --------
    >>> from ctrl_realize import paper
    >>> found = paper.table_1_statistics()
    >>> print(f"{found.mean:.2f} samples of {found.count} records, variance {found.variance:.2f}")
    36.68 samples of 34 records, variance 2.10
    """

    mean: float
    variance: float
    std_error: float
    interval: tuple[float, float]
    count: int
    dropped: int


def trimmed_statistics(values: FloatArray, trim: int, *, ddof: int = 1) -> TrimmedStatistics:
    """Leave out the `trim` smallest and the `trim` largest values and summarize the rest.

    Parameters
    ----------
    values : ndarray
        Values; all axes are pooled.
    trim : int
        Number of values to leave out at each end, ``0 <= 2 trim < size``.
    ddof : int, default 1
        Divisor of the variance is ``count - ddof``.

    Returns
    -------
    TrimmedStatistics
        The standard error is NaN if fewer than two values remain.

    Raises
    ------
    OptionError
        No value remains, or a negative `trim`.

    Notes
    -----
    The paper pools the 40 delays of its Table 1 and leaves out "the three smallest and highest
    values", which gives a mean of 36.68 and a variance of 2.04 (`ddof` 0) or 2.10 (`ddof` 1);
    printed are 37 and 2.

    References
    ----------
    .. [1] K. K. Yuen, The two-sample trimmed t for unequal population variances,
       Biometrika 61 (1974), 165-170.

    Examples
    --------
    >>> import numpy as np
    >>> summary = trimmed_statistics(np.array([1.0, 5.0, 6.0, 7.0, 90.0]), 1)
    >>> summary.mean, summary.variance
    (6.0, 1.0)
    """
    ordered = np.sort(np.ravel(values).astype(np.float64))
    n = ordered.size
    if not 0 <= 2 * trim < n:
        raise OptionError(f"trim={trim} of {n} values; expected 0 <= 2 trim < number of values")
    kept = ordered[trim : n - trim]
    # Rounding may make the mean of equal values differ from them.
    mean = float(np.clip(kept.mean(), kept[0], kept[-1]))
    winsorized = np.clip(ordered, kept[0], kept[-1])
    std_error = half_width = float("nan")
    if kept.size > 1:
        std_error = float(winsorized.std(ddof=1) / ((kept.size / n) * np.sqrt(n)))
        half_width = float(special.stdtrit(kept.size - 1, 0.975)) * std_error
    variance = float(kept.var(ddof=ddof)) if kept.size > ddof else float("nan")
    interval = mean - half_width, mean + half_width
    return TrimmedStatistics(mean, variance, std_error, interval, int(kept.size), 2 * trim)


def circle_quantile(level: float, repeats: float | None) -> float:
    """Radius of the circle that contains a complex normal error, in standard deviations.

    Parameters
    ----------
    level : float
        In 0...1, ends excluded.
    repeats : float or None
        Number of values, above 1, behind the standard deviation: the squared error divided by it
        has the F distribution with 2 and ``2 (repeats - 1)`` degrees of freedom. None if the
        standard deviation is known.

    Examples
    --------
    >>> for repeats in None, 1000, 5:
    ...     print(f"{circle_quantile(0.95, repeats):.3f}")
    1.731
    1.732
    2.112
    """
    # F with 2 and 2 (n - 1) degrees of freedom: P(F > f) = (1 + f / (n - 1))^-(n - 1).
    beyond = -np.log1p(-level)
    if repeats is None:
        return float(np.sqrt(beyond))
    with np.errstate(over="ignore"):
        return float(np.sqrt((repeats - 1) * np.expm1(beyond / (repeats - 1))))


def upper_quantile(tail: float, repeats: float | None) -> float:
    """Number of standard deviations exceeded with probability `tail` in one direction of the plane.

    Student's with ``2 (repeats - 1)`` degrees of freedom; see `circle_quantile`.

    Examples
    --------
    >>> for repeats in None, 5:
    ...     print(f"{upper_quantile(0.025, repeats):.3f}")
    1.960
    2.306
    """
    if repeats is None:
        return -float(special.ndtri(tail))
    return -float(special.stdtrit(2 * (repeats - 1), tail))
