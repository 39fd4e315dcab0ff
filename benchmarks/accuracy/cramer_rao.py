"""The Cramer-Rao bound of a dead time in a step experiment.

The bound is the inverse Fisher information [1]_ of dead time, poles and linear parameters; the
latter are projected out [2]_: the remainder of the derivative with respect to the dead time is the
Schur complement.

References
----------
.. [1] S. M. Kay, Fundamentals of Statistical Signal Processing: Estimation Theory, Prentice Hall
   1993, section 3.7 (Extension to a vector parameter).
.. [2] G. Golub and V. Pereyra, Separable nonlinear least squares: the variable projection method
   and its applications, Inverse Problems 19 (2003) R1-R26, doi:10.1088/0266-5611/19/2/201.
"""

from __future__ import annotations

import numpy as np

from ctrl_realize.numerics.arrays import ComplexArray, FloatArray
from ctrl_realize.numerics.engine.modal import parameters_from_poles, respond
from ctrl_realize.numerics.engine.problem import KnownFactor, Problem, Structure
from ctrl_realize.numerics.engine.profile import dead_time_error
from ctrl_realize.numerics.engine.responses import StepSequence
from ctrl_realize.numerics.engine.structures import Candidate


def dead_time_bound(
    poles: ComplexArray,
    numerator: FloatArray,
    dead_time: float,
    dt: float,
    samples: tuple[int, int],
    sigma: float,
    *,
    superfluous_zeros: int = 0,
    known: KnownFactor | None = None,
) -> float:
    """Smallest standard error of any unbiased estimate of the dead time, in s.

    The step is ideal, the noise white; poles, numerator and offset are unknown as well.

    Parameters
    ----------
    poles : ndarray, shape (n,)
        Of the plant, stable.
    numerator : ndarray, shape (m + 1,)
        Of the plant over the monic denominator, lowest power first.
    dead_time, dt : float
        Dead time and sample time in s.
    samples : tuple of int
        Number before the step, and from the step on.
    sigma : float
        Standard deviation of the noise.
    superfluous_zeros : int, optional
        Superfluous zeros of the assumed model. With one or more there is no information about the
        dead time: the numerator can take its place.
    known : KnownFactor, optional
        Known dynamics in cascade.

    Returns
    -------
    float
        Infinite if there is no information.

    Examples
    --------
    >>> import numpy as np
    >>> from benchmarks.accuracy.cramer_rao import dead_time_bound
    >>> pole = -2 * np.pi * np.array([2.0 + 0j])
    >>> gain = np.array([2 * np.pi * 2.0])
    >>> error = dead_time_bound(pole, gain, 0.03, 1 / 1280, (1000, 1100), 0.01)
    >>> bool(0.1 < error * 1280 < 0.3)
    True
    >>> dead_time_bound(pole, gain, 0.03, 1 / 1280, (1000, 1100), 0.01, superfluous_zeros=1)
    inf
    """
    before, after = samples
    count = before + after
    time = dt * np.arange(-before, after, dtype=np.float64)
    single = np.ones(count, dtype=np.int64)
    drive = StepSequence(time, single, dt, np.zeros(1), np.ones(1))
    factor = known or KnownFactor()
    parameters = np.concatenate([[dead_time], parameters_from_poles(poles)])
    model = respond(drive, factor, numerator, parameters)
    structure = Structure(poles.size, poles.size - numerator.size + 1 - superfluous_zeros)
    problem = Problem(model, np.ones(count), drive, np.ones((count, 1)), factor)
    return dead_time_error(problem, Candidate(structure, parameters, 0.0), sigma**2)
