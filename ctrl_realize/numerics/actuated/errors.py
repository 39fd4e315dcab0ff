"""Standard errors of a model with an actuator: gain, lags, total delay, values of the actuator.

From the curvature of the sum of squares, by the delta method [1]_.

References
----------
.. [1] E. L. Lehmann and G. Casella, Theory of Point Estimation, 2nd ed., Springer 1998, section 1.8
   (the delta method), doi:10.1007/b98854.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from ..arrays import FloatArray
from ..engine.poles import lag_sum, poles_from_parameters
from ..engine.static_gain import StaticGain
from ..families.physical import ProcessParameter, process_parameters
from .family import Member, Task

_STEP = 1e-4  # part of a coefficient, for a difference


class Errors(NamedTuple):
    """Static response, parameters of the process, and values of the actuator, with errors."""

    static: StaticGain
    parameters: tuple[ProcessParameter, ...]
    value_std: tuple[float, ...]


def propagated(
    task: Task, member: Member, coefficients: FloatArray, variance: float, length: float
) -> Errors:
    """Propagate the errors of a fit.

    Parameters
    ----------
    task : Task
    member : Member
    coefficients : ndarray, shape (1 + zeros,)
        Gain, and gain times lead.
    variance : float
        Of the noise, with its correlation.
    length : float
        Duration of the longest record in s.
    """
    point = np.concatenate([member.x, coefficients])
    steps = np.concatenate([task.steps, _STEP * np.abs(coefficients).max() + 0 * coefficients])
    covariance = variance * _inverse(task, point, steps)
    order = task.family.structure.order
    here = _told(point, order, member.x.size, length)
    slopes = np.stack(
        [
            (_told(point + move, order, member.x.size, length) - here) / step
            for move, step in zip(np.diag(steps), steps.tolist(), strict=True)
        ],
        axis=1,
    )
    std = np.sqrt(np.maximum(np.einsum("ij,jk,ik->i", slopes, covariance, slopes), 0.0))
    poles = poles_from_parameters(member.theta[None])[0][0]
    numerator = coefficients * np.prod(-poles).real
    named = process_parameters(poles, numerator, member.dead_time, length)
    parameters = tuple(
        one._replace(std=float(error)) for one, error in zip(named, std[:-1], strict=False)
    )
    slowest = length * float(np.abs(poles.real).min())
    static = StaticGain(
        gain=float(coefficients[0]),
        gain_std=float(std[0]),
        total=float(here[-1]),
        total_std=float(std[-1]),
        slowest=slowest,
        integrates=False,
        reached=float(coefficients[0]),
        sign_known=True,
    )
    own = np.sqrt(np.maximum(np.diag(covariance)[task.family.values], 0.0))
    if task.family.form.logged:
        own = np.array(member.values) * own
    values = tuple(own.tolist())
    return Errors(static, parameters, values)


def _told(point: FloatArray, order: int, size: int, length: float) -> FloatArray:
    """Parameters of the process, and the total delay last."""
    poles = poles_from_parameters(point[None, 1 : 1 + order])[0][0]
    numerator = point[size:] * np.prod(-poles).real
    named = process_parameters(poles, numerator, float(point[0]), length)
    return np.array([one.value for one in named] + [point[0] + lag_sum(poles, numerator)])


def _inverse(task: Task, point: FloatArray, steps: FloatArray) -> FloatArray:
    """Inverse of the normal matrix of x and the linear coefficients."""
    size = point.size - 1 - task.family.structure.zeros
    x, coefficients = point[:size], point[size:]
    columns = task.columns(x)
    high = task.bounds[1]

    def modelled(at: FloatArray) -> FloatArray:
        forced = [part @ coefficients for part in task.columns(at)]
        return task.records.projected([part[:, None] for part in forced])[:, 0]

    here, slopes = modelled(x), []
    for i in range(size):
        if task.family.form.stepwise and i >= task.family.values.start:
            slopes.append(np.zeros(here.size))
            continue
        step = steps[i] if x[i] + steps[i] <= high[i] else -steps[i]
        moved = x.copy()
        moved[i] += step
        slopes.append((modelled(moved) - here) / step)
    jacobian = np.concatenate([np.stack(slopes, axis=1), task.records.projected(columns)], axis=1)
    norm = np.sqrt((jacobian**2).sum(axis=0))
    norm[norm == 0] = np.inf
    scaled = np.linalg.pinv(jacobian / norm, rcond=1e-10)
    return np.asarray((scaled @ scaled.T) / np.outer(norm, norm))
