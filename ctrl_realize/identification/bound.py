"""Standard errors that a test will have: the Cramer-Rao bound of a model, an input and a noise.

The information [1]_ of dead time, poles, numerator and level, from the derivatives of the response
that the fits use. Beside inputs other than steps these estimate a drift and the free response to
what was before as well. Coloured noise is whitened by its autoregression; tests of one plant add
up.

References
----------
.. [1] S. M. Kay, Fundamentals of Statistical Signal Processing: Estimation Theory, Prentice Hall
   1993, sections 3.7 and 3.8 (vector parameter, transformations).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Literal, NamedTuple, TypeAlias

import numpy as np
from scipy.linalg import block_diag
from scipy.signal import lfilter

from ..errors import UnsuitableSystemError
from ..numerics.arrays import BoolArray, ComplexArray, FloatArray
from ..numerics.constants import SMALLEST
from ..numerics.engine.local_terms import Segments, local_columns
from ..numerics.engine.modal import parameters_from_poles, poles_from_parameters, respond
from ..numerics.engine.plausible_models import PlausibleModel
from ..numerics.engine.problem import KnownFactor, Problem, Structure
from ..numerics.engine.responses import SampledInput
from ..numerics.engine.static_gain import LocalErrors, local_errors, parameter_steps
from ..numerics.engine.structures import SLOWEST, Candidate
from ..numerics.loops.reference import (
    controller_response,
    grid,
    largest_sensitivity,
    model_response,
    robust_pi,
)
from .noise import NoiseModel
from .output_error.arguments import DWELL

Wanted: TypeAlias = Literal["dead_time", "gain", "phase", "Ms"]
WANTED: tuple[Wanted, ...] = ("dead_time", "gain", "phase", "Ms")


class Experiment(NamedTuple):
    """Input (N,), from rest, the noise of its record, the samples that are seen, and sample time.

    The noise is that of the samples that are seen, as if they were neighbours. The sample time is
    that of the input in s, 0 if it is that of the bound.
    """

    input: FloatArray
    noise: NoiseModel
    seen: BoolArray | slice = slice(None)
    dt: float = 0.0


@dataclass(frozen=True, eq=False)
class Bound:
    """Standard errors of one model, at a sample time in s.

    Integrators are known to integrate.
    """

    model: PlausibleModel
    dt: float

    def response(self, signal: FloatArray) -> FloatArray:
        """Response (N,) to an input, from rest."""
        there, known = self._parts(signal.size)
        return respond(self._drive(signal), known, self.model.numerator, there.parameters)

    def errors(self, tests: Sequence[Experiment], gradient: FloatArray) -> FloatArray:
        """Standard errors (k,) of quantities with gradients (k, p) after all tests together."""
        white = [_white(replace(self, dt=one.dt or self.dt), one) for one in tests]
        slopes, own = zip(*white, strict=True)
        together = LocalErrors(np.concatenate(slopes), block_diag(*own))
        # The parameters themselves are asked for as well: all of them are unknown.
        every = np.concatenate([gradient, np.eye(gradient.shape[1])])
        return together.std(every, 1.0)[: len(gradient)]

    def slopes(self, signal: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Derivatives (N, p) of the response by the parameters, and terms beside it (N, q).

        These are the level, and drift and free responses unless the test consists of steps.
        """
        n = signal.size
        there, known = self._parts(n)
        clock, own = self.dt * np.arange(n, dtype=np.float64), np.ones((n, 1))
        held = self.dt * np.diff(np.flatnonzero(np.diff(signal)))
        # A fit takes any other test for one of steps, which begin at rest.
        if np.any(held < DWELL * self.model.dead_time):
            own = operating_terms(clock, self.model.poles)
        problem = Problem(np.zeros(n), np.ones(n), self._drive(signal), own, known)
        found = local_errors(problem, there, self.model.numerator, n * self.dt)
        return found.slopes, found.own

    @property
    def point(self) -> FloatArray:
        """Dead time, pole parameters and numerator (p,), without those of an integrator."""
        return np.concatenate([self._parts(1)[0].parameters, self.model.numerator])

    def at(self, point: FloatArray) -> Bound:
        """The same structure with other parameters (p,)."""
        split = 1 + np.count_nonzero(self.model.poles)
        poles = poles_from_parameters(point[None, 1:split])[0][0]
        poles = np.append(poles, self.model.poles[self.model.poles == 0])
        return replace(self, model=PlausibleModel(float(point[0]), poles, point[split:]))

    def gradient(self, wanted: Sequence[Wanted]) -> FloatArray:
        """Derivatives (k, p) of quantities by dead time, pole parameters and numerator."""
        return self.derivatives(quantities(self.model, self.dt, wanted))

    def derivatives(self, value: Callable[[PlausibleModel], FloatArray]) -> FloatArray:
        """The same of values (k,) of a model."""
        steps = parameter_steps(self._parts(1)[0], self.model.numerator, self.dt)
        point = self.point

        def at(moved: FloatArray) -> FloatArray:
            return value(self.at(moved).model)

        return np.stack([(at(point + s) - at(point - s)) / (2 * s.sum()) for s in steps], axis=1)

    def _drive(self, signal: FloatArray) -> SampledInput:
        return SampledInput(signal - signal[0], self.dt)

    def _parts(self, samples: int) -> tuple[Candidate, KnownFactor]:
        """Structure with free parameters [dead time, poles...], and the integrator."""
        poles = self.model.poles
        moving = poles[poles != 0]
        if poles.size - moving.size > 1 or np.any(moving.real >= 0):
            raise UnsuitableSystemError(
                "the plant is unstable, or has more than one integrator; expected a structure of "
                "fewer lags, with one integrator at most"
            )
        theta = np.concatenate([[self.model.dead_time], parameters_from_poles(moving)])
        slow = np.full(poles.size - moving.size, -SLOWEST / (samples * self.dt), dtype=complex)
        structure = Structure(theta.size - 1, theta.size - self.model.numerator.size)
        return Candidate(structure, theta, 0.0), KnownFactor(slow)


def operating_terms(clock: FloatArray, poles: ComplexArray) -> FloatArray:
    """Level, drift and free responses (N, q), which a fit of any input estimates beside a model."""
    shapes = np.stack([np.ones_like(clock), clock / max(float(clock[-1]), SMALLEST)], axis=1)
    return np.asarray(local_columns(Segments.single(clock, shapes), poles[None, poles != 0])[0])


def _white(bound: Bound, test: Experiment) -> list[FloatArray]:
    """Slopes and level in units of the noise, without those that its filter does not reach."""
    whitening = [1.0, *-test.noise.coefficients]
    left = [lfilter(whitening, [1.0], part[test.seen], axis=0) for part in bound.slopes(test.input)]
    return [np.asarray(part[len(whitening) - 1 :] / test.noise.std) for part in left]


def quantities(
    model: PlausibleModel, dt: float, wanted: Sequence[Wanted]
) -> Callable[[PlausibleModel], FloatArray]:
    """Function of a model: what is wanted of it; that of loops with the PI of the first model.

    The phase is that of the model in degrees at the crossover of the first one's loop, from there.
    """
    loops = "phase" in wanted or "Ms" in wanted
    omega = grid(model, dt) if loops else np.ones(1)
    controller = controller_response(*robust_pi(model, dt), omega, dt) if loops else omega + 0j
    own = model_response(model, omega)
    below = np.flatnonzero(np.abs(controller * own) < 1)
    crossing = int(below[0]) if below.size else omega.size - 1

    def gain(one: PlausibleModel) -> float:
        return float(one.numerator[0] / np.prod(-one.poles[one.poles != 0]).real)

    def phase(one: PlausibleModel) -> float:
        turned = model_response(one, omega[crossing : crossing + 1]) / own[crossing]
        return float(np.degrees(np.angle(turned[0])))

    def largest(one: PlausibleModel) -> float:
        return float(largest_sensitivity(controller * model_response(one, omega)))

    every: dict[Wanted, Callable[[PlausibleModel], float]] = {
        "dead_time": lambda one: one.dead_time,
        "gain": gain,
        "phase": phase,
        "Ms": largest,
    }
    return lambda one: np.array([every[each](one) for each in wanted])
