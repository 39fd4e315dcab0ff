"""What is known before a test: a model, others that are plausible, the noise, earlier records."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from ..data import Record
from ..data.given import as_records
from ..delayed import DelayedStateSpace
from ..design import ProcessModel
from ..errors import UnsuitableSystemError
from ..identification import OutputErrorFit, identify
from ..identification.bound import Bound, Experiment, operating_terms
from ..identification.noise import NoiseModel, noise_of
from ..identification.output_error.own_gains import at_model_gain
from ..numerics.arrays import FloatArray
from ..numerics.engine.plausible_models import PlausibleModel
from ..numerics.engine.static_gain import INTEGRATOR
from ..numerics.signals.noise import correlation_time, quantisation_step, winsorised_sigma


@dataclass(frozen=True, eq=False)
class Known:
    """Model, plausible others, sample time, noise and records, as far as they are known."""

    model: PlausibleModel
    others: tuple[PlausibleModel, ...] = ()
    dt: float | None = None
    noise: NoiseModel | None = None
    tests: tuple[Experiment, ...] = ()
    level: float = 0.0
    move: float | None = None


def known_from(given: Any, options: dict[str, Any]) -> Known:
    """Read a model, or fit the records.

    Raises
    ------
    UnsuitableSystemError
        A model that was not fitted by the output-error fit; options beside a model.
    DataError
        Neither a model nor records.
    """
    if options and isinstance(given, PlausibleModel | ProcessModel | DelayedStateSpace):
        raise UnsuitableSystemError(
            f"got {', '.join(options)} beside a model; options of identify are for records"
        )
    if isinstance(given, PlausibleModel):
        return Known(given)
    if isinstance(given, ProcessModel):
        lags = np.array([lag for lag in (given.lag, given.second_lag) if lag])
        poles = np.append(-1 / lags, np.zeros(int(given.integrating))).astype(np.complex128)
        return Known(PlausibleModel(given.dead_time, poles, np.array([given.gain / np.prod(lags)])))
    return known_from_fit(fitted(given, options))


def fitted(given: Any, options: dict[str, Any]) -> OutputErrorFit:
    """Fit of a model, or of records."""
    system = given if isinstance(given, DelayedStateSpace) else None
    fit = (system or identify(as_records(given), **options)).fit
    if not isinstance(fit, OutputErrorFit):
        raise UnsuitableSystemError(
            f"got {given!r}; expected records, a model that identify made, or a ProcessModel"
        )
    return fit


def known_from_fit(fit: OutputErrorFit) -> Known:
    """Take model, plausible models, records and their noise from a fit; the last noise is next."""
    slowest = INTEGRATOR / min(record.time[-1] - record.time[0] for record in fit.records)
    drawn = () if fit.plausible_models is None else fit.plausible_models.models
    # Poles that the shortest record does not distinguish from an integrator's are 0.
    poles = [np.where(np.abs(one.poles) < slowest, 0.0, one.poles) for one in drawn]
    others = [one._replace(poles=own) for one, own in zip(drawn, poles, strict=True)]
    model = PlausibleModel(fit.dead_time, fit.poles, fit.estimate.numerator)
    records, residuals = at_model_gain(fit), [fit.measured - fit.fitted]
    if len(fit.records) > 1 or fit.data.every > 1:
        # Means were fitted: of step records, or of samples.
        residuals = [_left(record, model) for record in records]
    tests = [
        Experiment(_moved(record), _noise_of(residual, record, fit), record.seen, record.dt)
        for record, residual in zip(records, residuals, strict=True)
    ]
    plausible = tuple(one for one in others if np.sum(one.poles == 0) <= 1)
    move = float(max(np.concatenate([_moved(record) for record in fit.records]), key=abs))
    level = float(fit.records[0].input.flat[0])
    return Known(model, plausible, fit.dt, tests[-1].noise, tuple(tests), level, move)


def _noise_of(residual: FloatArray, record: Record, fit: OutputErrorFit) -> NoiseModel:
    """Noise of a residual; coloured where it is more so than white noise scatters to.

    No less than that of rounding: a rounded output may stand still.
    """
    quantum = quantisation_step(np.ravel(record.output)[record.seen])
    noise = NoiseModel(np.empty(0), winsorised_sigma(residual, quantum), fit.dt)
    if correlation_time(residual) > 1:
        noise = noise_of(residual, fit.dt, fit._noise_filter)
    return replace(noise, std=max(noise.std, quantum / np.sqrt(12)))


def _moved(record: Record) -> FloatArray:
    """Deviation of the input (N,) from that at the start."""
    return np.asarray(np.ravel(record.input) - record.input.flat[0])


def _left(record: Record, model: PlausibleModel) -> FloatArray:
    """What a model leaves of a record, beside its level, a drift and the free response.

    The latter begins after the dead time: until then the output depends on the input before.
    """
    time = record.time - record.time[0]
    rows = record.seen & (time >= min(model.dead_time, time[-1] / 2))
    left = (np.ravel(record.output) - Bound(model, record.dt).response(_moved(record)))[rows]
    columns = operating_terms(time, model.poles)[rows]
    return np.asarray(left - columns @ np.linalg.lstsq(columns, left, rcond=None)[0])
