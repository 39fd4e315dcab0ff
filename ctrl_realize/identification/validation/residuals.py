"""Residual analysis: correlations of the residual with itself and with the input."""

from __future__ import annotations

from collections.abc import Iterator

import control as ct
import numpy as np
from scipy.special import ndtri

from ..._checks import integer, within
from ..._flags import Flag, flagged
from ...data import Record
from ...data.given import as_record
from ...delayed.simulation import Start, as_delayed, simulate_record
from ...errors import DataError
from ...numerics.arrays import BoolArray, FloatArray, read_only
from ...numerics.blas_threads import single_threaded
from ...numerics.signals.correlation import correlation, cross_bound, fit_percent, whiteness
from .residuals_result import ResidualAnalysis

EXACT = 1e-8
"""Residual relative to the range of the output below which a model counts as exact."""


@single_threaded
def analyse_residuals(
    system: ct.StateSpace,
    record: Record,
    *,
    lags: int = 25,
    confidence: float = 0.99,
    start: Start = "estimate",
) -> ResidualAnalysis:
    """Simulate a model with the input of a record and analyse the residual.

    For another record than the model was estimated from, this is cross-validation.

    Parameters
    ----------
    system : control.StateSpace
        Discrete, with the sample time of the record; also a `DelayedStateSpace`.
    record : Record
    lags : int, default 25
        Largest lag of the correlations.
    confidence : float, default 0.99
        Level of bounds and tests.
    start : {"estimate", "rest"}
        Initial state of the simulation: ``"estimate"`` fits the offset, the state and the past
        input within the dead time (16 constant pieces for a long dead time), and of a plant that
        integrates the level of the input at which it rests; ``"rest"`` is the
        steady state for the first sample of the input, with the best offset.

    Returns
    -------
    ResidualAnalysis

    Raises
    ------
    DataError
        A record that does not match the system, has missing samples, or is too short.
    UnsuitableSystemError
        A continuous or unstable system.

    Notes
    -----
    Tests of whiteness and of independence from the input follow [1]_, with the statistic of [2]_.

    References
    ----------
    .. [1] L. Ljung, System Identification: Theory for the User, 2nd ed., Prentice Hall 1999,
       section 16.6 (Residual analysis).
    .. [2] G. M. Ljung and G. E. P. Box, On a measure of lack of fit in time series models,
       Biometrika 65 (1978) 297-303, doi:10.1093/biomet/65.2.297.

    Examples
    --------
    >>> import control as ct
    >>> import numpy as np
    >>> import ctrl_realize as cr
    >>> plant = cr.DelayedStateSpace(ct.ss([[0.8]], [[1.0]], [[0.2]], [[0.0]], 0.1), 5)
    >>> rng = np.random.default_rng(0)
    >>> u = rng.standard_normal(2000)
    >>> y = 7 + plant.simulate(u) + 0.05 * rng.standard_normal(2000)
    >>> record = cr.Record(0.1 * np.arange(2000), u, y)
    >>> cr.validation.analyse_residuals(plant, record)
    <ResidualAnalysis: fit 85.1 %, white True, independent True>
    >>> cr.validation.analyse_residuals(plant.replace(delay=4), record).independent
    False
    """
    count = integer(lags, "lags", 1)
    # beyond it, 1 - confidence is lost in rounding, or the bound is zero
    level = within(confidence, "confidence", "probability", 1e-12, 1 - 1e-12)
    simulated = simulate_record(system, as_record(record), start)
    y, u = np.atleast_2d(record.output), np.atleast_2d(record.input)
    if record.n_samples < 3 * count:
        raise DataError(
            f"lags={count} needs {3 * count} samples, the record has {record.n_samples}"
        )
    e = y - simulated
    # A residual of rounding errors has no information about the model.
    e[np.abs(e).max(axis=1) <= EXACT * np.ptp(y, axis=1)] = 0.0
    own = np.stack([correlation(row, row, count) for row in e])
    cross = np.stack([[_two_sided(row, drive, count) for drive in u] for row in e])
    bounds = np.array([[cross_bound(row, drive, count, level) for drive in u] for row in e])
    probability = np.array([whiteness(rho[1:], record.n_samples) for rho in own])
    outside = _outside(cross, bounds, level)
    # For a plant without feedthrough, a correlation at lag 0 is caused by a controller.
    direct = as_delayed(system, record).markov(1).reshape(len(y), len(u)) != 0
    later, earlier = outside[:, :, count:].copy(), outside[:, :, : count + 1].copy()
    later[:, :, 0] &= direct
    earlier[:, :, -1] &= ~direct
    return ResidualAnalysis(
        fit_percent=read_only(fit_percent(y, simulated)),
        simulated=read_only(simulated.reshape(record.output.shape)),
        residual=read_only(e.reshape(record.output.shape)),
        autocorrelation=read_only(own),
        cross=read_only(cross),
        bound=float(-ndtri((1 - level) / 2) / np.sqrt(record.n_samples)),
        cross_bound=read_only(bounds),
        whiteness=read_only(probability),
        white=bool(np.all(probability > 1 - level)),
        independent=not later.any(),
        confidence=level,
        record=record,
        flags=tuple(_flags(later, earlier, cross[:, :, count:])),
    )


def _outside(cross: FloatArray, bounds: FloatArray, level: float) -> BoolArray:
    """Mark the correlations beyond one bound for all lags together.

    The probability of a false alarm for one input and output is ``1 - level``.
    """
    family = 1 - (1 - level) / cross.shape[-1]
    wider = float(ndtri((1 - family) / 2) / ndtri((1 - level) / 2))
    return np.asarray(np.abs(cross) > wider * bounds[:, :, None])


def _flags(later: BoolArray, earlier: BoolArray, cross: FloatArray) -> Iterator[Flag]:
    """Flag significant correlations: `later` is `cross` at lags 0...L, `earlier` at -L...0."""
    if later.any():
        size = np.where(later, np.abs(cross), 0.0)
        _, _, lag = np.unravel_index(np.argmax(size), size.shape)
        yield flagged("input_in_residual", lag=lag)
    if earlier.any():
        yield flagged("feedback.residual")


def _two_sided(residual: FloatArray, drive: FloatArray, lags: int) -> FloatArray:
    """Correlation at lags -lags...lags; at positive lags the residual comes later."""
    before = correlation(drive, residual, lags)[:0:-1]
    return np.concatenate([before, correlation(residual, drive, lags)])
