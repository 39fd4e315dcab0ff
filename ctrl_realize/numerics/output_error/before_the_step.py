"""What a record shows before its step: noise, hum, a drift, or the free response of the plant.

Chosen by an information criterion [1]_; how much evidence a motion needs follows [2]_. That
it may not take the place of the response to the step is our own rule.

References
----------
.. [1] G. Schwarz, Estimating the dimension of a model, Ann. Statist. 6 (1978) 461-464,
   doi:10.1214/aos/1176344136.
.. [2] R. E. Kass and A. E. Raftery, Bayes factors, J. Amer. Statist. Assoc. 90 (1995) 773-795,
   doi:10.1080/01621459.1995.10476572.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import cache

import numpy as np

from ..constants import STRONG, VERY_STRONG
from ..engine.eliminate import evaluate
from ..engine.modal import respond
from ..engine.problem import Structure
from ..engine.structures import SIMPLE_STRUCTURES, Candidate, needless_parameters
from ..engine.window_fit import WindowFit
from ..rules import Rule
from .step_data import StepData

_OUTLIER = 3.0  # standard deviations at which residuals are cut where explanations are compared

_MOST_TO_COME = 10.0
"""How much more a free response may move after the step than before it. One that hardly moves
before it takes the place of the response to the step, whose gain is then lost: 50 and more in joint
fits of 13 step records of a two-cart drive, with gains up to three times too large; 0.7 to 1 for
simulated records that were moving."""
_MOST_OF_A_BEND = 2.0
"""The same where the baseline has risen and fallen: the extremes of the motion are in it then. 0.4
to 0.7 for simulated pulses just before the record, 1.7 for a heater in a box."""


def fitted_from_rest(
    data: StepData,
    fit: Callable[..., WindowFit],
    structures: tuple[Structure, ...],
    is_noise: Callable[[StepData, WindowFit, Candidate], bool],
) -> tuple[StepData, WindowFit]:
    """Fit structures with the model of the samples before the step that has the most evidence.

    None is taken that takes the place of the response to the step.
    """
    ways, unseen = data.explanations(), not (data.drift or data.bend)
    fit = cache(fit)  # what a plant at rest explains is asked for twice
    if len(ways) > 1 and not (unseen and _rests(ways, fit, structures, is_noise)):
        # A structure that is given may want an unseen motion for what it misses.
        simple = unseen or len(structures) > len(SIMPLE_STRUCTURES)
        few = SIMPLE_STRUCTURES if simple else structures
        data = _most_evident([(way, fit(way, way.output.size, few)) for way in ways])
    fits = fit(data, data.output.size, structures)
    if _takes_the_gain(data, fits):
        # Nor is the next one taken: a drift in place of a free response takes the gain as well.
        data = replace(ways[-1], drift=0.0, relaxing=False)
        fits = fit(data, data.output.size, structures)
    return data, fits


def _rests(
    ways: Sequence[StepData],
    fit: Callable[..., WindowFit],
    structures: tuple[Structure, ...],
    is_noise: Callable[[StepData, WindowFit, Candidate], bool],
) -> bool:
    """Whether a plant at rest explains a record, and no motion has evidence that was not seen.

    The motion is tried with the structure that is best at rest, and with one and two lags, which
    may take the place of a richer one.
    """
    moving, still = ways
    fits = fit(still, still.output.size, structures)
    if not is_noise(still, fits, fits.best):
        return False
    tried = {fits.best.structure, *(s for s in structures if s.order <= 2 and not s.zeros)}
    other = fit(moving, moving.output.size, tuple(tried))
    return _most_evident([(moving, other), (still, fits)]) is still


def _most_evident(ways: list[tuple[StepData, WindowFit]]) -> StepData:
    """Choose between models of the samples before the step by an information criterion.

    A motion that goes on after the step needs strong evidence: it changes the gain of the model. A
    drift, which goes on to the end of the record, needs very strong evidence ([2]_). Ablation:
    strong evidence of a motion, very strong evidence of a drift.
    """
    closest = min((fits for _, fits in ways), key=lambda fits: fits.sigma)
    worst = _OUTLIER * closest.sigma

    def criterion(way: tuple[StepData, WindowFit]) -> float:
        data, fits = way
        best = fits.best.structure
        error = fits.residual(fits.best)
        squares = float(np.sum(np.clip(error, -worst, worst) ** 2))
        terms = best.order + best.zeros + 2 * len(data.hum)
        terms += best.order if data.relaxing else bool(data.drift)
        value = squares / closest.variance + closest.penalty * terms + needless_parameters(best)
        if data.drift:
            return value + (VERY_STRONG if Rule.DRIFT_EVIDENCE.on else STRONG)
        return value + (STRONG if data.relaxing and Rule.MOTION_EVIDENCE.on else 0.0)

    return min(ways, key=criterion)[0]


def _takes_the_gain(data: StepData, fits: WindowFit) -> bool:
    """Whether a motion before the step takes the place of the response to it.

    Together with a slow pole, which is its opposite, a drift leaves the gain without a value, and
    both motions one of the wrong sign: poles of a free response are also those of the response,
    whose errors tell what is left open. Ablation: motion that takes the gain.
    """
    if not (data.drift or data.relaxing):
        return False
    if data.relaxing and not _dies_away(data, fits):
        return True
    static = fits.static(fits.best)
    unresolved = bool(data.drift) and not static.resolved
    return (unresolved or static.reached * static.gain < 0) and Rule.TAKES_GAIN.on


def _dies_away(data: StepData, fits: WindowFit) -> bool:
    """Whether the free response in the best model is mostly over when the step comes."""
    best = fits.best
    state = evaluate(fits.problem, best.structure, best.parameters[None])
    forced = respond(fits.window.drive, fits.problem.known, state.numerator[0], best.parameters)
    free = fits.window.predict(fits.problem, best) - forced
    most = _MOST_OF_A_BEND if data.bend else _MOST_TO_COME
    return bool(np.ptp(free[data.edge :]) <= most * np.ptp(free[: data.edge]))
