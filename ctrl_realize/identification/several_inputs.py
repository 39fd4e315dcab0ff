"""A process model with dead time for every input of a record with one output.

The models are those of the output-error fit, each of the output without the responses to the other
inputs, in turn until nothing changes: Gauss-Seidel iterations of the common least-squares problem
[1]_. They begin with finite impulse responses to the inputs, or to their integrals. They are slow
where inputs move alike: after the first turns all parameters are fitted together, from rest if the
record begins so. Each interval then holds for the other models as they are; it is widened by what
the other parameters leave open, from the information matrix of all [2]_.

References
----------
.. [1] A. Buja, T. Hastie and R. Tibshirani, Linear smoothers and additive models, Ann. Statist. 17
   (1989) 453-510, doi:10.1214/aos/1176347115 (backfitting).
.. [2] L. Ljung, System Identification: Theory for the User, 2nd ed., Prentice Hall 1999, section
   9.4 (covariance of parameters).
"""

from __future__ import annotations

import warnings
from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial, reduce
from typing import TYPE_CHECKING, Any, Literal

import numpy as np
from scipy.signal import lfilter

from ..data import Record
from ..data.given import as_records, check_inputs_move
from ..data.shown_units import in_shown_units
from ..delayed import DelayedStateSpace, fit_of
from ..delayed.parts import signals_of
from ..errors import DataError, DataWarning
from ..numerics.arrays import FloatArray
from ..numerics.blas_threads import single_threaded
from ..numerics.constants import SMALLEST
from ..numerics.engine.modal import lag_sum
from ..numerics.engine.plausible_models import PlausibleModel
from ..numerics.families.physical import ProcessParameter, process_parameters
from ..numerics.output_error.result import ProcessEstimate
from .impulse.from_io import impulse_from_io
from .output_error.actuated.limits import at_updates
from .output_error.any_input import begins_at_rest
from .output_error.fit import fit_output_error, model_alone
from .output_error.result import OutputErrorFit
from .output_error.summary import fitted_model
from .several_inputs_joint import bounds_of, fitted_together, from_rest, own_columns, prescribed
from .several_inputs_result import SeveralInputsFit

if TYPE_CHECKING:
    from .process_structures import Structures

MOST_CYCLES = 8
"""Turns of the iterations; inputs that move alike converge slowly."""
_INTEGRATES = 0.5
"""Part of what is left by plants that settle, at which plants that integrate begin the iterations.
Both leave the noise of steps whose response ends; a tank's two valves leave 2 to 15 % of it."""
_SETTLED = 0.02
"""Change of a response, in standard deviations of the residual, from which on all is settled: a
tenth of the error of a response that five parameters have from a thousand samples."""
_A_LITTLE = 0.2
"""The same, up to which fits in turn may move about the fit of all together: three such errors."""


@single_threaded
@in_shown_units
def fit_several_inputs(
    records: Record | Sequence[Record],
    *,
    structures: Structures | None = None,
    max_delay: float | None = None,
    noise: Any = "auto",
) -> DelayedStateSpace:
    """Fit a model with dead time for each input of a record with several inputs and one output.

    Parameters
    ----------
    records : Record
        Two inputs or more, one output.
    structures, max_delay, noise : optional
        As for `fit_output_error`, the same for every input.

    Returns
    -------
    DelayedStateSpace
        With all inputs; its `.fit` is a `SeveralInputsFit`.

    Raises
    ------
    DataError
        Several records or outputs, one input, or an input that the output does not respond to.

    Examples
    --------
    >>> import numpy as np
    >>> import ctrl_realize as cr
    >>> t = np.arange(200.0)
    >>> u = np.stack([1.0 * (t > 20), 1.0 * (t > 110)])
    >>> y = 2.0 * (t > 25) - 1.0 * (t > 118) + 0.01 * np.random.default_rng(0).standard_normal(200)
    >>> sys = cr.identification.fit_several_inputs(cr.Record(t, u, y), structures="FOPDT")
    >>> sys.fit.table()["gain"].round(1).tolist()
    [2.0, -1.0]
    """
    record, repeated = at_updates(_checked(as_records(records)))
    inputs, output = np.atleast_2d(record.input), np.ravel(record.output)
    options: dict[str, Any] = {"max_delay": max_delay, "noise": noise}
    rested = begins_at_rest(record)
    responses = _starting(record, rested)
    systems: list[DelayedStateSpace] = []
    asked: list[Any] = [structures] * len(inputs)
    cycle, settled, earlier, together = 0, False, np.zeros(output.size), 0.0 * responses
    while cycle < MOST_CYCLES:
        cycle, moved, systems = cycle + 1, 0.0, []
        # the last turn, once settled, chooses structures again and finds the intervals
        for i in range(len(inputs)):
            left = output - earlier - (responses.sum(axis=0) - responses[i])
            fit_one = fit_output_error if settled or cycle == MOST_CYCLES else model_alone
            options["structures"] = structures if settled else asked[i]
            system = _one(record, i, left, fit_one, settled, options)
            response = system.simulate(inputs[i] - inputs[i, 0])
            fit = fit_of(system, OutputErrorFit)
            moved = max(moved, float(np.std(response - responses[i])) / fit.residual_std)
            responses[i] = response
            asked[i] = structures if fit.estimate.process.form is not None else [fit.structure]
            systems.append(system)
        if settled:
            break
        settled = moved < _SETTLED
        fits = [fit_of(system, OutputErrorFit) for system in systems]
        if not settled and cycle < MOST_CYCLES // 2 and not any(map(prescribed, fits)):
            responses, earlier = fitted_together(fits, record, rested)
            apart = np.std(responses - together, axis=1) / fits[-1].residual_std
            # Fits in turn may weight samples in another way, and move a little for ever.
            settled = bool(apart.max() < _SETTLED) and moved < _A_LITTLE
            together = responses.copy()
    if record.irregular:
        systems = [_sampled(system, record.sample_time) for system in systems]
    fits = [fit_of(system, OutputErrorFit) for system in systems]
    fits[0] = replace(fits[0], flags=(*repeated, *fits[0].flags))
    result = SeveralInputsFit(_wider(fits, record, earlier), (record,), responses, cycle, settled)
    return _joined(systems, result)


def _checked(records: tuple[Record, ...]) -> Record:
    record = records[0]
    if len(records) > 1 or record.ninputs < 2 or record.noutputs > 1:
        raise DataError(
            f"got {len(records)} record(s) with {record.ninputs} inputs and {record.noutputs} "
            "outputs; process models of several inputs need one record with one output. Without "
            "structures= all channels are fitted by fit_state_space"
        )
    check_inputs_move(records)
    moves = np.diff(record.input)
    size = np.maximum(np.abs(moves).max(axis=1, keepdims=True), SMALLEST)
    if np.linalg.matrix_rank(moves / size) < len(moves):
        raise DataError(
            f"the inputs {', '.join(record.input_labels)} move alike: the responses to them "
            "cannot be told apart; expected inputs that also move on their own"
        )
    return record


def _starting(record: Record, rested: bool) -> FloatArray:
    """Responses (m, N) to each input or its integral, by finite impulse responses."""
    even = record.at_equal_distances()
    start: Literal["rest", "unknown"] = "rest" if rested else "unknown"
    moves = np.atleast_2d(even.input) - even.input[..., :1]
    output = np.ravel(even.output)
    seen = ~np.isnan(output)
    line = np.stack([np.ones(seen.sum()), even.time[seen]], axis=1)  # a drift is no response
    found, left = [], []
    for driven in (moves, np.cumsum(moves, axis=1)):
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", DataWarning)  # a start need not be exact
            fir = impulse_from_io(even.__replace__(input=driven), method="regularized", start=start)
        pairs = zip(fir.markov[0], driven, strict=True)
        found.append(np.array([lfilter(h, [1.0], u) for h, u in pairs]))
        rest = (output - found[-1].sum(axis=0))[seen]
        left.append(float(np.std(rest - line @ np.linalg.lstsq(line, rest, rcond=None)[0])))
    best = found[left[1] < _INTEGRATES * left[0]]
    return np.array([np.interp(record.time, even.time, one) for one in best])


def _one(
    record: Record, i: int, left: FloatArray, fit_one: Callable[..., DelayedStateSpace],
    settled: bool, options: dict[str, Any],
) -> DelayedStateSpace:  # fmt: skip
    name = record.input_labels[i]
    units = {k: v for k, v in record.units.items() if k in (name, "time", *record.output_labels)}
    one = Record(
        record.time, np.atleast_2d(record.input)[i], left, units=units,
        name=", ".join(filter(None, [record.name, f"input {name}"])),
        input_labels=[name], output_labels=list(record.output_labels), missing="keep",
    )  # fmt: skip
    try:
        return fit_one(one, **options)
    except DataError as error:
        advice = f"leave the input {name!r} out of the record, or "
        if not settled:
            advice = "the models of the inputs have not converged: "
        raise DataError(
            f"{error}. Or {advice}give structures= that describe every plant, ['FOPDT', 'IPDT'] "
            "where one may integrate"
        ) from None


def _sampled(system: DelayedStateSpace, step: float) -> DelayedStateSpace:
    """Model with the sample time of irregular stamps, fitted at the steps of their time axis."""
    fit = fit_of(system, OutputErrorFit)
    fit = replace(fit, records=tuple(one.__replace__(sample_time=step) for one in fit.records))
    return fitted_model(fit)


def _wider(
    fits: list[OutputErrorFit], record: Record, earlier: FloatArray
) -> tuple[OutputErrorFit, ...]:
    """Widen the intervals from those with the other models known to those with all estimated."""
    bounds = bounds_of(fits)
    inputs = np.atleast_2d(record.input)
    tangents = [bound.slopes(u)[0] for bound, u in zip(bounds, inputs, strict=True)]
    seen = ~np.isnan(np.ravel(record.output) - earlier)
    clock = (record.time - record.time[0])[seen]
    at_rest = not np.any(earlier) and all(map(from_rest, fits))
    every = [own_columns(fit, clock, at_rest) for fit in fits]
    found = []
    for i, fit in enumerate(fits):
        own = np.column_stack([tangents[i][seen], own_columns(fit, clock, from_rest(fit))])
        others = np.column_stack([*(t[seen] for t in tangents[:i] + tangents[i + 1 :]), *every])
        slopes = bounds[i].derivatives(_values)
        names = ["total", *(one.name for one in _named(bounds[i].model))]
        wider = {name: _ratio(own, others, one) for name, one in zip(names, slopes, strict=True)}
        estimate, factor = fit.estimate, wider["dead_time"]
        at = estimate.dead_time
        low = max(at - factor * (at - estimate.low), 0.0)
        high = at + factor * (estimate.high - at)
        estimate = replace(estimate, low=low, high=high, std=factor * estimate.std)
        if estimate.static is not None:
            more = wider["gain"], wider["total"]
            static = estimate.static.widened(*more)
            alike = tuple((other.widened(*more), weight) for other, weight in estimate.alike)
            estimate = replace(estimate, static=static, alike=alike)
        process = replace(estimate.process, find=partial(_widened, estimate.process, wider))
        found.append(replace(fit, estimate=replace(estimate, process=process)))
    return tuple(found)


def _named(model: PlausibleModel) -> tuple[ProcessParameter, ...]:
    # poles of integrators are exactly zero
    return process_parameters(model.poles, model.numerator, model.dead_time, 1 / SMALLEST)


def _values(model: PlausibleModel) -> FloatArray:
    """Total delay and parameters (k,) of a model."""
    total = model.dead_time + lag_sum(model.poles[model.poles != 0], model.numerator)
    return np.array([total, *(one.value for one in _named(model))])


def _widened(process: ProcessEstimate, wider: dict[str, float]) -> tuple[ProcessParameter, ...]:
    """Parameters with wider errors; a time constant does not reach below zero."""
    found = []
    for one in process.parameters:
        factor, ends = wider.get(one.name, 1.0), one.ends
        if ends is not None:
            low, high = (one.value + factor * (end - one.value) for end in ends)
            ends = (max(low, 0.0) if ends[0] >= 0 else low, high)
        found.append(one._replace(std=factor * one.std, ends=ends))
    return tuple(found)


def _ratio(own: FloatArray, others: FloatArray, weights: FloatArray) -> float:
    """Standard error of a sum of first parameters with all estimated, over that with own alone."""
    # the covariance is the product of the pseudo-inverse with its transpose
    alone = np.linalg.pinv(own)[: weights.size].T @ weights
    together = np.linalg.pinv(np.column_stack([own, others]))[: weights.size].T @ weights
    return float(np.linalg.norm(together) / np.linalg.norm(alone))


def _joined(systems: Sequence[DelayedStateSpace], result: SeveralInputsFit) -> DelayedStateSpace:
    """Add the responses to all inputs."""
    whole: Any = reduce(lambda some, one: some.append(one), systems)
    total: DelayedStateSpace = np.ones((1, len(systems))) * whole
    record = result.records[0]
    return total.replace(fit=result, name=record.name or None, **signals_of(record))
