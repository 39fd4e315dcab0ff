"""Gain, dead time, time constants and damping of a fitted model, with standard errors.

The model exp(-L s) b(s) / a(s) in the form of process models [1]_,

    K exp(-L s) prod(T_z s + 1) / (s^i prod(T s + 1) prod(T_w^2 s^2 + 2 zeta T_w s + 1)).

Standard errors by the delta method [2]_ from the curvature of the sum of squares.

References
----------
.. [1] D. E. Seborg, T. F. Edgar, D. A. Mellichamp and F. J. Doyle, Process Dynamics and Control,
   3rd ed., Wiley 2011, chapter 5 (Dynamic behavior of first- and second-order processes).
.. [2] E. L. Lehmann and G. Casella, Theory of Point Estimation, 2nd ed., Springer 1998, section 1.8
   (the delta method), doi:10.1007/b98854.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from ..arrays import ComplexArray, FloatArray
from ..engine.modal import poles_from_parameters
from ..engine.problem import Problem
from ..engine.static_gain import INTEGRATOR, local_errors
from ..engine.structures import Candidate

_REAL = 1e-9  # relative imaginary part that is rounding


class ProcessParameter(NamedTuple):
    """Parameter of a process model, by name, with its standard error for the structure.

    `name` is ``gain`` (with an integrator the slope per second), ``dead_time``, ``lag_1``,
    ``lag_2`` (the slowest first), ``pair_time_1`` and ``pair_damping_1`` of poles that oscillate,
    ``lead_1`` (negative for a zero in the right half plane), ``zero_time_1``, ``zero_damping_1``.
    Times are in s. `std` is NaN if it is not known. `ends` is a 95 % interval if it is not that of
    the standard error; `std` is then half of it over 1.96.
    """

    name: str
    value: float
    std: float = float("nan")
    ends: tuple[float, float] | None = None


def process_parameters(
    poles: ComplexArray, numerator: FloatArray, dead_time: float, length: float
) -> tuple[ProcessParameter, ...]:
    """Parameters of exp(-dead_time s) b(s) / a(s), without standard errors.

    Parameters
    ----------
    poles : ndarray, shape (n,)
        Roots of the monic a, in 1/s.
    numerator : ndarray, shape (m + 1,)
        b, lowest power first.
    dead_time : float
        In s.
    length : float
        Duration of the record in s; poles slower than 0.005 of its inverse are integrators.
    """
    moving = poles[np.abs(poles) * length >= INTEGRATOR]
    zeros = np.roots(numerator[::-1]).astype(np.complex128)
    gain = float(numerator[0] / np.prod(-moving).real)
    found = [("gain", gain), ("dead_time", dead_time)]
    found += [(name, value) for name, value, _, _ in _factors(moving, "lag", "pair")]
    found += [(name, value) for name, value, _, _ in _factors(zeros, "lead", "zero")]
    return tuple(ProcessParameter(name, float(value)) for name, value in found)


def fitted_parameters(
    problem: Problem, candidate: Candidate, numerator: FloatArray, variance: float, length: float
) -> tuple[ProcessParameter, ...]:
    """Parameters of a fitted model with their standard errors, the structure being given.

    Parameters
    ----------
    problem : Problem
    candidate : Candidate
    numerator : ndarray, shape (m + 1,)
        Lowest power first.
    variance : float
        Of the noise, per sample.
    length : float
        As in `process_parameters`.
    """
    theta = candidate.theta
    poles, dpoles = (found[0] for found in poles_from_parameters(theta[None, 1:]))
    kept = np.abs(poles) * length >= INTEGRATOR
    size = theta.size + numerator.size
    pole_slopes = np.zeros((poles.size, size), dtype=np.complex128)
    pole_slopes[:, 1 : theta.size] = dpoles
    zeros = np.roots(numerator[::-1]).astype(np.complex128)
    zero_slopes = np.zeros((zeros.size, size), dtype=np.complex128)
    if zeros.size:
        # b(z) = 0: dz = -sum(db_i z^i) / b'(z)
        slope = np.polyval(np.polyder(numerator[::-1]), zeros)
        powers = zeros[:, None] ** np.arange(numerator.size)
        zero_slopes[:, theta.size :] = -powers / np.where(slope == 0, np.inf, slope)[:, None]
    found = process_parameters(poles, numerator, float(theta[0]), length)
    of_gain = -found[0].value * np.sum(pole_slopes[kept] / poles[kept, None], axis=0).real
    of_gain[theta.size] += 1.0 / np.prod(-poles[kept]).real
    gradients = [of_gain, np.eye(size)[0]]
    for roots, slopes in ((poles[kept], pole_slopes[kept]), (zeros, zero_slopes)):
        factors = _factors(roots, "real", "pair")
        gradients += [(factor * slopes[index]).real for _, _, index, factor in factors]
    errors = local_errors(problem, candidate, numerator, length)
    std = errors.std(np.stack(gradients), variance).tolist()
    return tuple(one._replace(std=error) for one, error in zip(found, std, strict=True))


def _factors(roots: ComplexArray, real: str, pair: str) -> list[tuple[str, float, int, complex]]:
    """Name, value, and derivative with respect to one root, of time constants and damping.

    The slowest come first. The derivative of a real function of a root p is Re(factor dp).
    """
    found: list[tuple[str, float, int, complex]] = []
    is_real = np.abs(roots.imag) <= _REAL * np.abs(roots)
    order = np.argsort(np.abs(roots), kind="stable")
    for number, i in enumerate((i for i in order if is_real[i]), 1):
        p = float(roots[i].real)
        found.append((f"{real}_{number}", -1.0 / p, int(i), complex(1.0 / p**2)))
    for number, i in enumerate((i for i in order if roots[i].imag > 0 and not is_real[i]), 1):
        root = complex(roots[i])
        size = abs(root)
        # d|p| = Re(conj(p) dp) / |p|
        along = root.conjugate() / size
        found.append((f"{pair}_time_{number}", 1.0 / size, int(i), -along / size**2))
        damping = -root.real / size
        found.append((f"{pair}_damping_{number}", damping, int(i), -(1 + damping * along) / size))
    return found
