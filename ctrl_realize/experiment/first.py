"""What is known before a test: a model, others that are plausible, the noise, earlier records."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from ..data import Record
from ..data.given import as_records
from ..delayed import DelayedStateSpace
from ..design import ProcessModel
from ..errors import UnsuitableSystemError
from ..identification import OutputErrorFit, identify
from ..identification.bound import Bound, Experiment
from ..identification.noise import NoiseModel, noise_of
from ..numerics.arrays import FloatArray
from ..numerics.engine.plausible_models import PlausibleModel
from ..numerics.engine.static_gain import INTEGRATOR
from ..numerics.signals.noise import correlation_time, winsorised_sigma


@dataclass(frozen=True, eq=False)
class Known:
    """Model, plausible others, sample time, noise and records, as far as they are known."""

    model: PlausibleModel
    others: tuple[PlausibleModel, ...] = ()
    dt: float | None = None
    noise: NoiseModel | None = None
    tests: tuple[Experiment, ...] = ()
    level: float = 0.0


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
    length = min(record.time[-1] - record.time[0] for record in fit.records)
    drawn = () if fit.plausible_models is None else fit.plausible_models.models
    others = [_integrating(one, length) for one in drawn]
    model = PlausibleModel(fit.dead_time, fit.poles, fit.estimate.numerator)
    held = [np.ravel(record.input) for record in fit.records]
    inputs = [signal - signal[0] for signal in held]
    residuals = [fit.measured - fit.fitted]
    if len(inputs) > 1:
        # Step records are scaled and averaged before they are fitted.
        followed = [Bound(model, fit.data.dt).response(signal) for signal in inputs]
        residuals = [_left(*each) for each in zip(fit.records, followed, strict=True)]
    tests = [
        Experiment(signal, _noise_of(residual, fit.dt), record.seen, record.dt)
        for signal, residual, record in zip(inputs, residuals, fit.records, strict=True)
    ]
    plausible = tuple(one for one in others if np.sum(one.poles == 0) <= 1)
    return Known(model, plausible, fit.dt, tests[-1].noise, tuple(tests), float(held[0][0]))


def _noise_of(residual: FloatArray, dt: float) -> NoiseModel:
    """Noise of a residual; coloured where it is more so than white noise scatters to."""
    if correlation_time(residual) > 1:
        return noise_of(residual, dt)
    return NoiseModel(np.empty(0), winsorised_sigma(residual, 0.0), dt)


def _left(record: Record, followed: FloatArray) -> FloatArray:
    """What a model leaves of a record, beside its level and a drift."""
    left = np.ravel(record.output) - followed
    seen = np.isfinite(left)
    left, time = left[seen], record.time[seen] - record.time[0]
    return np.asarray(left - np.polyval(np.polyfit(time, left, 1), time))


def largest_move(records: Sequence[Experiment]) -> float | None:
    """Farthest deviation of the input in the records, with its sign."""
    moved = np.concatenate([one.input for one in records]) if records else np.zeros(1)
    return float(moved[np.argmax(np.abs(moved))]) or None


def _integrating(model: PlausibleModel, length: float) -> PlausibleModel:
    """Poles that the record does not distinguish from an integrator's are 0."""
    slow = np.abs(model.poles) * length < INTEGRATOR
    return model._replace(poles=np.where(slow, 0.0, model.poles))
