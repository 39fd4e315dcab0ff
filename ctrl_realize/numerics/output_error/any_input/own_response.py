"""Dead time, gain and time constants of one record relative to a model of several.

Gauss-Newton steps [1]_ from the common model.

References
----------
.. [1] L. Ljung, System Identification: Theory for the User, 2nd ed., Prentice Hall 1999, section
   10.2 (Numerical solution by iterative search methods).
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ...arrays import FloatArray
from ...engine.modal import respond
from ...engine.poles import parameters_from_poles, poles_from_parameters
from ...engine.problem import KnownFactor
from ...signals.correlation import fit_percent
from ...signals.noise import correlation_time
from ...validation.own_response import OwnResponse
from ..result import OutputErrorEstimate
from .data import SampledData

_TURNS = 6  # of Gauss and Newton at most
_STRETCH = 0.01  # of the time constants, for a slope by central differences: off by 1e-4
_FARTHEST = 2.0  # logarithm of a stretch that is extrapolated from it


def own_response(data: SampledData, fit: OutputErrorEstimate, known: KnownFactor) -> OwnResponse:
    """Gauss-Newton iterations for gain and dead time; everything else of the model is common."""
    problem = data.problem(known)
    assert problem.segments is not None
    own = problem.local_terms(poles_from_parameters(parameters_from_poles(fit.poles)[None])[0])
    target = own.without(problem.data[None, :, None])[0, :, 0]
    lost = problem.local_count(fit.poles.size)
    h = 0.25 * data.step

    def response(dead_time: float, stretch: float = 1.0) -> FloatArray:
        # The core with a slower time scale: poles divided by the stretch, with the same gain.
        parameters = np.concatenate(
            [[max(dead_time, 0.0)], parameters_from_poles(fit.poles / stretch)]
        )
        powers = np.arange(fit.numerator.size) - float(fit.poles.size)
        return respond(problem.drive, known, fit.numerator * stretch**powers, parameters)

    def regression(columns: Sequence[FloatArray]) -> tuple[FloatArray, FloatArray]:
        moved = own.without(np.stack(columns, axis=1)[None])[0]
        solution = np.linalg.lstsq(moved, target, rcond=None)[0]
        left = target - moved @ solution
        freedom = max(left.size - moved.shape[1] - lost, 1)
        variance = float(left @ left) / freedom * correlation_time(left)
        spread = np.diag(np.linalg.pinv(moved.T @ moved))
        return solution, np.sqrt(variance * np.maximum(spread, 0.0))

    shift, error, gain, gain_error = 0.0, np.inf, 1.0, np.inf
    for _ in range(_TURNS):
        at = max(fit.dead_time + shift, h)
        slope = (response(at + h) - response(at - h)) / (2 * h)
        solution, errors = regression([response(at), slope])
        gain, gain_error = float(solution[0]), float(errors[0])
        size = gain or 1.0
        move = float(solution[1]) / size
        error = float(errors[1]) / abs(size)
        shift = at - fit.dead_time + float(np.clip(move, -20 * data.step, 20 * data.step))
        if abs(move) < 1e-3 * data.step:
            break
    # Small stretches: the derivative of the response with respect to the log of the time constants.
    turn = (response(at, 1 + _STRETCH) - response(at, 1 - _STRETCH)) / (2 * _STRETCH)
    solution, errors = regression([response(at), slope, turn])
    alone, alone_errors = regression([response(fit.dead_time)])
    size = float(solution[0]) or 1.0
    lag = float(np.exp(np.clip(solution[2] / size, -_FARTHEST, _FARTHEST)))
    forced = own.without(response(fit.dead_time)[None, :, None])[0, :, 0]
    followed = fit_percent(target[None], forced[None])
    return OwnResponse(
        shift,
        max(error, 1e-12 * data.step),
        gain,
        max(gain_error, 1e-12),
        lag,
        max(float(errors[2]) / abs(size), 1e-12),
        float(followed[0]),
        float(alone[0]),
        max(float(alone_errors[0]), 1e-12),
    )
