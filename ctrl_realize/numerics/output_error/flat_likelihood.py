"""Place the dead time where a likelihood does not: flat down to the earliest, its maximum there.

The likelihood of a residual that is correlated in an unknown way, or coarsely rounded, is that of
fewer independent samples [1]_; where it hardly depends on a short dead time, its maximum may be at
the bound although the output plainly moves later. The dead time is then the median of several
estimates, as where no model is adequate; the interval remains that of the likelihood. The rule is
our own, see docs/rules.md.

References
----------
.. [1] C. J. Geyer, Practical Markov chain Monte Carlo, Statist. Sci. 7 (1992) 473-483,
   doi:10.1214/ss/1177011137.
"""

from __future__ import annotations

from dataclasses import replace
from functools import partial

import numpy as np

from ..constants import SMALLEST, Z_95
from ..engine.compared_fits import at_dead_time
from ..engine.eliminate import evaluate
from ..engine.problem import Structure
from ..engine.profile import dead_time_error
from ..engine.window_fit import WindowFit
from ..families.physical import process_parameters
from .extrapolation import least_extrapolating
from .margins import close_to
from .result import OutputErrorEstimate, RobustKey, followed_by
from .step_data import StepData

_PINNED = 0.25
"""Distance of the dead time from the earliest one, where a likelihood interval ends, in its widths,
up to which it counts as pinned there. Ablation: estimates against a pinned likelihood."""


def with_close_decision(found: OutputErrorEstimate, ratio: float) -> OutputErrorEstimate:
    """Add a decision on the source of the dead time to the close ones, if its ratio is near 1."""
    return replace(found, close=found.close + close_to("likelihood", ratio, 1.0))


def pinned(found: OutputErrorEstimate, data: StepData, fits: WindowFit) -> float:
    """Below 1 if a likelihood is flat down to the earliest dead time, and its maximum there.

    So it may be where the residual is quantised, or correlated in a way that is not known.
    """
    white = not data.coarse and fits.correlation == 1.0
    lags = found.distributed.chain is None and not found.distributed.follows_flow
    if white or found.residual.whitened or not lags or found.low > fits.scales.earliest:
        return np.inf
    return float((found.dead_time - found.low) / max(_PINNED * (found.high - found.low), SMALLEST))


def closer(early: WindowFit, lags: Structure, found: OutputErrorEstimate) -> float:
    """Below 1 if the first part of the response alone, with `lags`, tells the dead time better.

    Width of the interval that it gives, in that of the likelihood.
    """
    error = dead_time_error(early.problem, early.candidates[lags], early.variance)
    return float(2 * Z_95 * error / max(found.high - found.low, SMALLEST))


def later(found: OutputErrorEstimate, estimates: tuple[tuple[RobustKey, float], ...]) -> float:
    """Below 1 if most delay estimates agree with each other that the output moves later."""
    dead_times = np.array([at for _, at in estimates[:-1]])
    middle = float(np.median(dead_times))
    apart = float(np.median(np.abs(dead_times - middle)))
    later = middle - found.dead_time
    return 2 * apart / later if later > 0 else np.inf


def moved(
    found: OutputErrorEstimate, fits: WindowFit, estimates: tuple[tuple[RobustKey, float], ...]
) -> OutputErrorEstimate:
    """Put the dead time at the median of the delay estimates; the interval is not changed."""
    dead_time = float(np.clip(np.median([at for _, at in estimates[:-1]]), found.low, found.high))
    own = fits.candidates[found.structure]
    fixed = at_dead_time(fits.problem, own, fits.scales, dead_time)
    fixed, static = least_extrapolating(fits, fixed, dead_time_fixed=True)
    state = evaluate(fits.problem, fixed.structure, fixed.parameters[None])
    return replace(
        found,
        dead_time=dead_time,
        poles=fixed.poles,
        numerator=state.numerator[0],
        fitted=fits.window.predict(fits.problem, fixed),
        followed=followed_by(fits, fixed, state.numerator[0]),
        static=static,
        delay_estimates=estimates,
        process=replace(
            found.process,
            find=partial(
                process_parameters, fixed.poles, state.numerator[0], dead_time, fits.scales.length
            ),
        ),
    )
