"""Choose the input of a test by the standard error that it will have."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from numbers import Real
from typing import Any

import numpy as np
from scipy.linalg import toeplitz

from .._checks import band, not_negative, one_of, positive, real
from .._wording import in_time, plainly
from ..data import Record
from ..data.shown_units import shown_time_unit
from ..delayed import DelayedStateSpace
from ..design import ProcessModel
from ..errors import OptionError
from ..identification.bound import WANTED, Bound, Experiment, Wanted
from ..identification.noise import NoiseModel
from ..identification.plausible import continuous_core
from ..numerics.arrays import FloatArray
from ..numerics.engine.modal import lag_sum
from ..numerics.engine.plausible_models import PlausibleModel
from ..numerics.loops.relay import relay_loop
from ..numerics.state_space.sampling import sample_with_dead_time
from .first import Known, known_from
from .result import ErrorCurve, ExperimentPlan, PlannedTest
from .signals import KINDS, shapes

_LATE, _FEWEST, _MOST_REST = 1.5, 10, 0.2
"""Dead times of rest before a test, beside the lags: a fit takes the past of a record for unknown,
leaves out what may depend on it, and estimates the state that it left. Samples at least, and part
of a test at most."""
_CLOSE = 1.05
"""Errors that count as one: of these the slowest signal of a kind is taken, since further lags,
which no model has, hide what is fast, and the kind that moves the output least."""
_OTHERS = 4  # every fourth plausible model stands for all in the errors: time
_HYSTERESIS = 3.0  # standard deviations of the noise, by which a relay does not switch
_LONG = 8  # order of an autoregression in place of an ARMA(1, 1)
_MOST_SAMPLES = 20_000
_LENGTHS = (0.25, 0.5, 1.0, 2.0, 4.0)  # of tests on the curve, in the one that is planned


@dataclass(frozen=True, eq=False)
class _Setting:
    """What all candidates share: models, gradients of the first ones, noise, limits."""

    bounds: list[Bound]
    gradients: list[FloatArray]
    noise: NoiseModel
    limits: tuple[float, float]
    output_limit: float
    records: tuple[Experiment, ...]
    dt: float
    returns: bool
    """Whether the plant integrates, so that the sum of the input must be zero."""


def plan(
    first: Record | Sequence[Record] | DelayedStateSpace | ProcessModel | PlausibleModel,
    *,
    time: float | None = None,
    amplitude: float | Sequence[float] | None = None,
    rate: float | None = None,
    want: Wanted = "dead_time",
    output_limit: float | None = None,
    level: float | None = None,
    noise: float | None = None,
    noise_pole: float = 0.0,
    resolution: float = 0.0,
    **options: Any,
) -> ExperimentPlan:
    """Plan the test that tells a dead time, a gain, or a margin most closely.

    Parameters
    ----------
    first : Record, sequence of Record, DelayedStateSpace or ProcessModel
        Records that there are, which are identified, or the model of such; or a guess of the plant.
    time : float, optional
        Length of the test in s, rest before it included. Default: that of the longest record.
    amplitude : float or (float, float), optional
        Largest move of the input from its level, in one direction (both, if the plant integrates);
        or lowest and highest deviation. Default: that of the records.
    rate : float, optional
        Samples per second. Default: that of the records.
    want : {"dead_time", "gain", "phase", "Ms"}
        What is to be known: the dead time in s, the static gain (slope per second if the plant
        integrates), the phase in degrees at the crossover, or the largest sensitivity Ms. Both are
        those of a loop with the PI of the rule SIMC for the model.
    output_limit : float, optional
        Largest deviation of the output, on any plausible model; signals are made smaller to keep
        it.
    level : float, optional
        Input at rest. Default: that of the first record, or 0.
    noise : float, optional
        Standard deviation of the output's noise. Default: that of the records, as coloured as it
        is.
    noise_pole : float, optional
        Pole of `noise` per sample, 0 for white noise.
    resolution : float, optional
        Step of the sensor, whose rounding is noise of a twelfth of its square.
    **options
        Of `identify`, for records.

    Returns
    -------
    ExperimentPlan
        With the best input as array, file and record, and a table of all candidates.

    Raises
    ------
    OptionError
        Something that is neither given nor known from records, or out of range.
    UnsuitableSystemError
        A plant that is unstable or has several integrators, or a fit of another kind.
    DataError
        Neither a model nor records.

    Notes
    -----
    Candidates are one step, repeated steps, 3-2-1-1, a pseudo-random binary signal, a multisine of
    small crest factor, a chirp and a relay with hysteresis, each with several periods. Their errors
    are predicted by the Cramer-Rao bound [1]_ of the structure of the model, level included, and
    ranked by the geometric mean over the model and plausible others [2]_; for a gain over those
    that integrate if the model does, since a slope is no static gain. The bound is local: it is
    reached where the error is small against the lags. If the plant integrates, the second half of
    an input is its first with the other sign, so that the output comes back; that of a relay is
    kept by its feedback.

    References
    ----------
    .. [1] S. M. Kay, Fundamentals of Statistical Signal Processing: Estimation Theory, Prentice
       Hall 1993, section 3.7.
    .. [2] K. Chaloner and I. Verdinelli, Bayesian experimental design: a review, Statist. Sci. 10
       (1995) 273-304, doi:10.1214/ss/1177009939.

    Examples
    --------
    >>> import ctrl_realize as cr
    >>> flow = cr.design.ProcessModel(gain=1.2, lag=3.0, dead_time=2.0)
    >>> plan = cr.experiment.plan(flow, time=60, amplitude=5, rate=5, noise=0.1)
    >>> plan.kind, f"{plan.step.std / plan.std:.1f} times better than one step"
    ('3-2-1-1', '3.4 times better than one step')
    """
    known = known_from(first, options)
    wanted = one_of(want, "want", WANTED)
    longest = max((one.input.size * one.dt for one in known.tests), default=0.0)
    length = _given(time, longest, "time", "length of the test in s")
    dt = 1 / _given(rate, known.dt and 1 / known.dt, "rate", "samples per second")
    move = known.move if amplitude is None else amplitude
    if move is None:
        raise OptionError("amplitude=None; expected the largest move of the input")
    count = round(length / dt)
    least = _least(known.model, dt)
    if not least <= count <= _MOST_SAMPLES:
        room = f"{least} to {_MOST_SAMPLES}, for a rest, the dead time and a response"
        if least > _MOST_SAMPLES:
            room = f"a lower rate: dead time and response take {least}, of {_MOST_SAMPLES} at most"
        raise OptionError(
            f"time={length:g} s at rate={1 / dt:g} are {count} samples; expected {room}"
        )
    heard = _noise(known, noise, noise_pole, resolution, dt)
    integrates = bool(np.any(known.model.poles == 0))
    others = [x for x in known.others if want != "gain" or np.any(x.poles == 0) == integrates]
    judged = [Bound(model, dt) for model in (known.model, *others[::_OTHERS])]
    limited = () if output_limit is None else [Bound(model, dt) for model in known.others]
    setting = _Setting(
        [*judged, *limited], [bound.gradient([wanted]) for bound in judged], heard,
        _limits(move, integrates),
        np.inf if output_limit is None else positive(output_limit, "output_limit", "deviation"),
        known.tests, dt, integrates,
    )  # fmt: skip
    candidates = _candidates(setting, count)
    best = candidates[0]
    colour = "coloured" if heard.coefficients.size else "white"
    rest = known.level if level is None else real(level, "level", "input at rest")
    return ExperimentPlan(
        time=dt * np.arange(count, dtype=np.float64),
        command=rest + best.input,
        want=wanted,
        candidates=tuple(candidates),
        curve=_curve(setting, count, best.kind),
        level=rest,
        model=known.model,
        noise=heard,
        tests=known.tests,
        kind=best.kind,
        choices=(
            f"errors by the Cramer-Rao bound of the model, ranked over it and {len(judged) - 1} "
            "that are plausible",
            f"noise {plainly(heard.sigma, 3)}, {colour}",
        ),
        time_unit=shown_time_unit(first),
    )


def _least(model: PlausibleModel, dt: float) -> int:
    """Samples of the shortest test whose output responds."""
    return max(4 * _FEWEST, int(model.dead_time / dt / (1 - _MOST_REST)) + 2)


def _given(value: float | None, known: float | None, name: str, what: str) -> float:
    if value is None and not known:
        raise OptionError(f"{name}=None; expected the {what}, which is known only from records")
    return positive(known if value is None else value, name, what)


def _limits(amplitude: Any, returns: bool) -> tuple[float, float]:
    """Two ends of the input's deviation, that of a single step last."""
    if isinstance(amplitude, Real):
        low, high = sorted((0.0, real(amplitude, "amplitude", "move of the input")))
        returns = False  # by as much in the other direction
    else:
        low, high = band(amplitude, "amplitude", "deviation of the input")
    if low == high or not low <= 0 <= high or (returns and low * high == 0):
        raise OptionError(
            f"amplitude={amplitude!r}; expected a move, or a low and a high end, 0 between them, "
            "not at one of them if the plant integrates"
        )
    return (high, low) if -low > high else (low, high)


def _noise(
    known: Known, noise: float | None, pole: float, resolution: float, dt: float
) -> NoiseModel:
    rounding = not_negative(resolution, "resolution", "step of the sensor") ** 2 / 12
    if noise is None and known.noise is not None:
        heard = known.noise
        if heard.coefficients.size and known.dt and abs(dt / known.dt - 1) > 1e-6:
            raise OptionError(
                f"the noise of the records is coloured, and known at a rate of {1 / known.dt:g} "
                "only; expected this rate, or noise and noise_pole"
            )
        # What was measured is rounded already, unless it stood still.
        return replace(heard, std=max(heard.std, float(np.sqrt(rounding))))
    if noise is None and not rounding:
        raise OptionError("noise=None; expected the standard deviation of the output's noise")
    sigma = not_negative(noise or 0.0, "noise", "standard deviation")
    turn = real(pole, "noise_pole", "pole per sample")
    if abs(turn) >= 1 or not 0 < sigma * sigma + rounding < np.inf:
        raise OptionError(
            f"noise={sigma:g}, noise_pole={turn:g}; expected noise with a variance above 0 that is "
            "a number, and a pole between -1 and 1"
        )
    # With white rounding AR(1) noise is none: a longer autoregression, by Yule and Walker.
    covariance = sigma**2 * turn ** np.arange(1.0 + bool(turn) * (_LONG if rounding else 1))
    covariance[0] += rounding
    past = np.asarray(np.linalg.solve(toeplitz(covariance[:-1]), covariance[1:]), np.float64)
    return NoiseModel(past, float(np.sqrt(covariance[0] - past @ covariance[1:])), dt)


def _candidates(setting: _Setting, count: int) -> list[PlannedTest]:
    """Every kind with its best choice, the least error first, or one as small that moves less."""
    every: dict[str, list[PlannedTest]] = {}
    for kind, number, signal in _signals(setting, count):
        every.setdefault(kind, []).append(_predicted(setting, kind, number, signal))
    best = []
    for tests in every.values():
        least = _CLOSE * min(one.score for one in tests)
        best.append(next(one for one in tests if one.score <= least))
    best.sort(key=lambda one: one.score)
    close = [one for one in best if one.score <= _CLOSE * best[0].score]
    least_moving = min(close, key=lambda one: one.excursion)
    return [least_moving, *(one for one in best if one is not least_moving)]


def _signals(setting: _Setting, count: int) -> Iterator[tuple[str, int, FloatArray]]:
    """Kind, choice and deviation (N,) of every signal within the limits of the input."""
    model = setting.bounds[0].model
    late = model.dead_time / setting.dt
    slowest = late + lag_sum(model.poles[model.poles != 0], model.numerator) / setting.dt
    lead = (_LATE - 1) * late + slowest
    rest = max(min(round(lead), int(_MOST_REST * count)), _FEWEST)
    near, far = setting.limits
    middle, half = (near + far) / 2, (far - near) / 2
    if setting.returns:
        middle, half = 0.0, near or far
    signals = [*shapes(count - rest, slowest, returns=setting.returns)]
    signals.append(("relay", 0, _relay(setting, count - rest, middle, half)))
    for kind, number, signal in signals:
        yield kind, number, np.concatenate([np.zeros(rest), middle + half * signal])


def _predicted(setting: _Setting, kind: str, number: int, signal: FloatArray) -> PlannedTest:
    moved = max(float(np.abs(bound.response(signal)).max()) for bound in setting.bounds)
    scale = min(1.0, setting.output_limit / max(moved, 1e-300))
    test = Experiment(scale * signal, setting.noise)
    pairs = zip(setting.bounds, setting.gradients, strict=False)
    errors = np.array([float(bound.errors([test], gradient)[0]) for bound, gradient in pairs])
    together = setting.bounds[0].errors([*setting.records, test], setting.gradients[0])[0]
    name = KINDS[kind if kind in KINDS else "steps"][1]
    detail = f"{name} {in_time(number * setting.dt)}" if number else "switched by the output"
    others = float(errors.min()), float(errors.max())
    score = float(np.exp(np.mean(np.log(errors))))
    return PlannedTest(
        kind, detail, test.input, float(errors[0]), others, float(together), scale * moved, score
    )


def _relay(setting: _Setting, count: int, middle: float, half: float) -> FloatArray:
    """Output (N,) of a relay with hysteresis about the level that the model has at its middle."""
    model, noise = setting.bounds[0].model, setting.noise
    core = continuous_core(model.numerator, model.poles)
    plant = sample_with_dead_time(core.A, core.B, core.C, core.D, setting.dt, model.dead_time)
    gain = float(model.numerator[0] / np.prod(-model.poles[model.poles != 0]).real)
    goal, turn = 0.0 if setting.returns else gain * middle, float(np.sign(gain * half))
    levels = middle + half, middle - half
    drive, _ = relay_loop(
        plant, count, levels, _HYSTERESIS * noise.sigma, lambda _, moved: turn * (moved - goal)
    )
    return (drive - middle) / half


def _curve(setting: _Setting, count: int, kind: str) -> ErrorCurve:
    """Errors of tests of several lengths, and today's."""
    own = replace(setting, bounds=setting.bounds[:1], gradients=setting.gradients[:1], records=())
    lengths = [n for n in (round(part * count) for part in _LENGTHS)
               if _least(setting.bounds[0].model, setting.dt) <= n <= _MOST_SAMPLES]  # fmt: skip
    found = [{one.kind: one.std for one in _candidates(own, n)} for n in lengths]
    first = None
    if setting.records:
        today = setting.bounds[0].errors(setting.records, setting.gradients[0])[0]
        first = sum(one.input.size * one.dt for one in setting.records), float(today)
    step = "up and down" if setting.returns else "one step"
    return ErrorCurve(
        setting.dt * np.array(lengths, dtype=np.float64),
        np.array([each.get(kind, each[step]) for each in found]),  # too short for repetitions
        np.array([each[step] for each in found]),
        first,
    )
