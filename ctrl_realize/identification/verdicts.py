"""One verdict for each question: is the dead time known, the gain, and is the model fit for tuning?

What a verdict looks at are widths of intervals, the sensitivity of a loop over all models that the
data do not rule out, and the flags that go with wrong answers. How often each is right is measured
in `benchmarks.verdicts`, on other records than those by which the limits were chosen.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import Any, Literal, TypeAlias

import numpy as np

from .._flags import Flag, marked
from .._wording import in_time, interval_in_time, only_end, plainly
from ..numerics.arrays import ComplexArray, FloatArray
from ..numerics.engine.plausible_models import PlausibleModel
from ..numerics.loops.reference import (
    controller_response,
    grid,
    largest_sensitivity,
    model_response,
    robust_pi,
)
from ..results import FractionalDelayFit

Level: TypeAlias = Literal["good", "with care", "no"]
Question: TypeAlias = Literal["dead time", "gain", "tuning"]
Response: TypeAlias = Callable[[FloatArray], ComplexArray]
LEVELS: tuple[Level, ...] = ("good", "with care", "no")

_NARROW, _FEW, _OF_TOTAL = 0.4, 2.0, 0.1
"""Width of the interval of a dead time that is well known: parts of the visible onset, or of its
upper end where that is earlier, as in loud noise; samples; or parts of the total delay, beside
which it does not matter."""
_CLOSE, _ROUGH = 0.05, 0.25
"""Half width of the interval of a gain that is well known, and of one that is, in parts of it."""
_ROUNDED = 1e-9  # half of an interval that rounding leaves of a gain that is fixed
_ROBUST, _TOO_MUCH = 2.0, 4.0
"""Ms up to which a loop is robust (gain margin 2, phase margin 29 deg), and up to which it works
at all (1.3 and 14 deg)."""
_SELDOM = 1
"""Of the 39 models, those that may be worse: one of twenty (2 / 40) is at least as bad."""


@dataclass(frozen=True)
class Verdict:
    """Answer to one question about a model.

    Attributes
    ----------
    question : {"dead time", "gain", "tuning"}
    level : {"good", "with care", "no"}
    sentence : str
        The reason, with its number.
    number : float
        Width of the dead time's interval in s; half width of the gain's in parts of the gain;
        largest sensitivity Ms of a PI over the plausible models. Beside a state-space model: part
        by which the gain of lags with dead time differs, Ms of their PI on the model.

    Examples
    --------
    >>> import ctrl_realize as cr
    >>> fit = cr.identify(cr.bench.valve().step_record(16, rng=5)).fit
    >>> for verdict in fit.verdicts:
    ...     print(verdict)
    dead time: good (known to 12.6 ms, 24.8 to 37.4 ms)
    gain: good (known to 0.0059 %)
    tuning: good (a PI has Ms 1.49 on the model, at most 1.49 on models that fit as well)
    """

    question: Question
    level: Level
    sentence: str
    number: float

    def __str__(self) -> str:
        return f"{self.question}: {self.level} ({self.sentence})"


def verdicts(
    fit: FractionalDelayFit, model: PlausibleModel, others: Sequence[PlausibleModel]
) -> tuple[Verdict, ...]:
    """Judge dead time, gain and fitness for tuning of a fit.

    Parameters
    ----------
    fit : FractionalDelayFit
        With interval, gain, total delay and flags.
    model : PlausibleModel
        Its model; integrators have poles of exactly 0.
    others : sequence of PlausibleModel
        Models that the data do not rule out.
    """
    tried = [partial(model_response, one) for one in others]
    said = "a PI has Ms {own} on the model, {there} on models that fit as well"
    return _dead_time(fit), _gain(fit), _tuning(fit, fit.flags, model, tried, _SELDOM, said)


def verdicts_beside_lags(
    fit: Any, lags: FractionalDelayFit, model: PlausibleModel, response: Response
) -> tuple[Verdict, ...]:
    """Judge a state-space model beside the lags with dead time that it replaces, never as good.

    The data do not tell its errors: its gain is compared with that of the lags, and their PI is
    tried on it.

    Parameters
    ----------
    fit : StateSpaceFit
        With gain, dead time, interval and flags.
    lags : FractionalDelayFit
    model : PlausibleModel
        That of the lags.
    response : callable
        Frequency response of the state-space model at frequencies in rad/s, without the hold.
    """
    low, high = lags.gain_interval or (-np.inf, np.inf)
    apart = abs(lags.gain / fit.gain - 1) if fit.gain and lags.gain else np.inf
    some = apart <= _ROUGH and not low <= 0 <= high and not lags.integrators
    level, why = _level(fit.flags, "gain", False, some)
    said = f"{fit.gain:.3g}; lags with dead time have {lags.gain:.3g}"
    gain = Verdict("gain", level, _because(said, why), float(apart))
    said = "a PI for lags with dead time has Ms {own} on them, {there} on this model"
    tuning = _tuning(lags, fit.flags, model, [response], 0, said)
    found = _dead_time(fit), gain, tuning
    return tuple(replace(v, level=max(v.level, "with care", key=LEVELS.index)) for v in found)


def _level(flags: Iterable[Flag], question: str, good: bool, some: bool) -> tuple[Level, str]:
    """Lower what the numbers say where a flag goes with wrong answers; name the first that does."""
    level: Level = "good" if good else "with care" if some else "no"
    lowered: tuple[tuple[str, Level], ...] = (("no", "no"), ("doubts", "with care"))
    for mark, most in lowered:
        for flag in flags:
            if flag.code in marked(f"{mark}_{question}"):
                return max(level, most, key=LEVELS.index), flag.code.replace("_", " ")
    return level, ""


def _dead_time(fit: Any) -> Verdict:
    low, high = fit.interval
    width, least, flags = high - low, _FEW * fit.dt, fit.flags
    if fit.onset is not None and np.isfinite(fit.onset):
        least = max(least, _NARROW * min(fit.onset, high))
        # The start of the response to a step tells it, whatever its end leaves open.
        flags = [flag for flag in flags if flag.code not in marked("not_of_a_step")]
    if fit.total_delay is not None and np.isfinite(fit.total_delay_interval or np.inf).all():
        least = max(least, _OF_TOTAL * fit.total_delay)
    level, why = _level(flags, "dead_time", width <= least, some=True)
    if level == "good" and fit._answered_noise:
        level, why = "with care", "slow noise in a loop"
    said = interval_in_time(low, high)
    if width <= least:
        said = f"known to {in_time(width)}, {said}"
    elif low == 0:
        said = f"{said}, dead time or short lags: the record cannot tell"
    else:
        said = f"{said}, {in_time(width)} wide"
    return Verdict("dead time", level, _because(said, why), float(width))


def _gain(fit: FractionalDelayFit) -> Verdict:
    gain, (low, high) = fit.gain, fit.gain_interval or (-np.inf, np.inf)
    half = max(high - gain, gain - low) / abs(gain) if gain else np.inf
    half = half if half > _ROUNDED else 0.0
    some = half <= _ROUGH and (low > 0 or high < 0)
    level, why = _level(fit.flags, "gain", half <= _CLOSE, some)
    said = f"known to {plainly(100 * half, 2)} %"
    if not np.isfinite(half):
        said = only_end(low, high) or "not determined"
    return Verdict("gain", level, _because(said, why), float(half))


def _tuning(
    fit: FractionalDelayFit, flags: Sequence[Flag], model: PlausibleModel,
    others: Sequence[Response], seldom: int, words: str,
) -> Verdict:  # fmt: skip
    """Try the PI of the model of a fit on others, `seldom` of which may be worse."""
    if np.sum(model.poles == 0) > 1 or np.any(model.poles.real > 0) or not fit.gain:
        return Verdict("tuning", "no", "no rule for such a plant", float("inf"))
    low, high = fit.gain_interval or (-np.inf, np.inf)
    if low <= 0 <= high:
        return Verdict("tuning", "no", "the sign of the gain is not known", float("inf"))
    omega = grid(model, fit.dt)
    controller = controller_response(*robust_pi(model, fit.dt), omega, fit.dt)
    responses = np.stack([model_response(model, omega), *(other(omega) for other in others)])
    loops = controller * responses
    if abs(loops[0, 0]) < 1:
        said = f"a PI of this model crosses over below {omega[0]:.3g} rad/s"
        return Verdict("tuning", "no", said, float("inf"))
    own, *found = largest_sensitivity(loops)
    # The model is one of those that fit as well as it does.
    worst = max(float(np.sort(found)[-1 - seldom]), float(own) * bool(seldom))
    level, why = _level(flags, "tuning", worst <= _ROBUST, worst <= _TOO_MUCH)
    there = f"{'at most ' * bool(seldom)}{worst:.3g}" if np.isfinite(worst) else "is unstable"
    said = words.format(own=f"{own:.3g}", there=there)
    return Verdict("tuning", level, _because(said, why), worst)


def _because(said: str, why: str) -> str:
    return f"{said}; {why}" if why else said
