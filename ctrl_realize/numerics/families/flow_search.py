"""Least squares for the axial-dispersion model of a step record, its gain eliminated.

Steps are Marquardt's [1]_ with Kaufman's Jacobian [2]_, with which the gradient is exact; the last
ones are Newton's.

References
----------
.. [1] D. W. Marquardt, An algorithm for least-squares estimation of nonlinear parameters, J. SIAM
   11 (1963) 431-441, doi:10.1137/0111030.
.. [2] L. Kaufman, A variable projection method for solving separable nonlinear least squares
   problems, BIT 15 (1975) 49-57, doi:10.1007/BF01932995.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass

import numpy as np

from ..arrays import ComplexArray, FloatArray
from ..engine.newton import minimum
from ..engine.responses import StepSequence
from ..engine.structures import Scales
from ..engine.varpro import Problem, partial_fractions
from ..regression.marquardt import Damping, damped_step, descend
from .residence import flow_modes

_SPREADS = (0.1, 1.2)
"""Standard deviations over means: narrower is no different from many lags, wider from few."""
_FREE = 4  # dead time, gain, mean, spread; a lag is one more
_DELAYS, _LAGS = (0.0, 0.4, 0.7, 0.95), (0.05, 0.3, 0.6, 0.9)
"""Starts: parts of a dead time that is too long, and of the whole spread in time."""
_STEPS = 40  # by which a start is improved at most: time
_ROUGHLY = 1e-4  # gain over the cost at which a search ends, and Newton's method begins
_DAMPING = Damping(rise=4.0, fall=2.0)
"""Steps of Gauss and Newton are half too long where a flow is flat: the damping stays. Factors of
10, 5, 3 and 2 took a fifth to two fifths more steps in eleven records."""
_LONGEST_STEP = 1.0  # of a logarithmic parameter, and of the dead time over the rise


@dataclass(frozen=True, eq=False)
class FlowPoint:
    """Parameters (n,), the weighted residual (m,), minus its derivatives (m, n), and its square."""

    x: FloatArray
    residual: FloatArray
    jacobian: FloatArray
    cost: float


@dataclass(frozen=True, eq=False)
class FlowProblem:
    """Least squares over x = (dead time, log mean, log spread, log lag), times over the rise.

    The last is missing if no lag is tried.
    """

    problem: Problem
    drive: StepSequence
    scales: Scales
    lagging: bool

    @property
    def count(self) -> int:
        """Number of parameters, including the gain."""
        return _FREE + self.lagging

    @property
    def bounds(self) -> tuple[FloatArray, FloatArray]:
        """Lowest and highest parameters."""
        s = self.scales
        longest, shortest = np.log(3 * s.length / s.rise), np.log(0.1 * s.dt / s.rise)
        low = [s.earliest / s.rise, shortest, np.log(_SPREADS[0]), shortest]
        high = [s.latest / s.rise, longest, np.log(_SPREADS[1]), longest]
        return np.array(low[: self.count - 1]), np.array(high[: self.count - 1])

    def parameters(self, dead_time: float, mean: float, spread: float, lag: float) -> FloatArray:
        """Parameters of a flow, times in s."""
        rise = self.scales.rise
        lags = [lag / rise] * self.lagging
        return np.append(dead_time / rise, np.log([mean / rise, spread, *lags]))

    def times(self, x: FloatArray) -> tuple[float, float, float, float]:
        """Dead time, mean, spread and lag; all but the spread in s."""
        rise = self.scales.rise
        lag = float(np.exp(x[3])) * rise if self.lagging else 0.0
        return float(x[0]) * rise, float(np.exp(x[1])) * rise, float(np.exp(x[2])), lag

    def at(self, x: FloatArray) -> FlowPoint:
        """Eliminate gain and regressors."""
        response, slopes = self._response(x)
        columns = self.problem.weighted(np.column_stack([response, self.problem.regressors]))
        size = np.maximum(np.linalg.norm(columns, axis=0), 1e-300)
        q, r = np.linalg.qr(columns / size)
        data = self.problem.weighted_data
        inside = q.T @ data
        # Of the response alone, beside the regressors: the gain.
        resolved = abs(r[0, 0]) > 0
        gain = np.linalg.solve(r, inside)[0] / size[0] if resolved else 0.0
        moved = self.problem.weighted(slopes) * gain
        residual = data - q @ inside
        return FlowPoint(x, residual, moved - q @ (q.T @ moved), float(residual @ residual))

    def cost(self, x: FloatArray) -> float:
        """Weighted sum of squares."""
        return self.at(x).cost

    def starts(self, dead_time: float, mean: float, deviation: float) -> Iterator[FloatArray]:
        """Divide mean and variance in time between dead time, dispersion and lag."""
        low, high = self.bounds
        rise = self.scales.rise
        for part in _DELAYS:
            for share in _LAGS if self.lagging else (0.0,):
                lag = share * deviation
                residence = mean - part * dead_time - lag
                if residence > 0:
                    spread = np.sqrt(deviation**2 - lag**2) / residence
                    logs = np.log([residence / rise, spread, *[lag / rise] * self.lagging])
                    yield np.clip(np.append(part * dead_time / rise, logs), low, high)

    def improved(
        self, start: FloatArray, fixed_dead_time: bool = False, converged: bool = False
    ) -> FloatArray:
        """Follow a start towards its minimum, or to it, with free or fixed dead time."""
        low, high = self.bounds
        if fixed_dead_time:
            low[0] = high[0] = start[0]

        def linearised(here: FlowPoint) -> Callable[[float], FlowPoint]:
            normal, downhill = here.jacobian.T @ here.jacobian, here.jacobian.T @ here.residual
            stuck = (here.x <= low) & (downhill <= 0) | (here.x >= high) & (downhill >= 0)
            free = ~(stuck | (low >= high))

            def ahead(damping: float) -> FlowPoint:
                step = np.zeros(here.x.size)
                step[free] = damped_step(normal[np.ix_(free, free)], downhill[free], damping)
                longest = float(np.abs(step).max(initial=0.0)) / _LONGEST_STEP
                return self.at(np.clip(here.x + step / max(1.0, longest), low, high))

            return ahead

        best, _ = descend(
            self.at(np.clip(start, low, high)),
            linearised,
            lambda gain, here: gain < _ROUGHLY * here.cost,
            _DAMPING,
            _STEPS,
        )
        if not converged:
            return best.x
        unit = np.ones(low.size)
        unit[0] = self.scales.dt / self.scales.rise
        return minimum(self._slopes, best.x, (low, high), unit)[0]

    def _slopes(self, rows: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Costs (B,) and their gradients (B, n)."""
        points = [self.at(row) for row in rows]
        gradients = [-2 * point.jacobian.T @ point.residual for point in points]
        return np.array([point.cost for point in points]), np.array(gradients)

    def dead_time_error(self, x: FloatArray, variance: float) -> float:
        """Standard error of the dead time, in units of the rise, from the curvature."""
        jacobian = self.at(x).jacobian
        size = np.maximum(np.linalg.norm(jacobian, axis=0), 1e-300)
        on_dead_time = np.linalg.pinv(jacobian / size)[0] / size[0]
        return float(np.sqrt(variance) * np.linalg.norm(on_dead_time))

    def _response(self, x: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Unit response in means over the bins (m,), by Simpson's rule for wide bins, and slopes.

        Where samples are missing, in means over two times, as in `StepSequence`. The slopes
        (m, n) are derivatives with respect to the parameters.
        """
        drive = self.drive
        if drive.samples is not None:
            early, late = (self._sampled(x, drive.first + node) for node in drive.nodes)
            total = (early + late) / 2
        else:
            wide = drive.width > 1
            span = drive.lengths[wide]
            since = np.concatenate(
                [drive.first, drive.first[wide] + span / 2, drive.first[wide] + span]
            )
            every = self._sampled(x, since)
            total, middle, end = np.split(every, [wide.size, wide.size + span.size])
            total[wide] = (total[wide] + 4 * middle + end) / 6
        return total[:, 0], total[:, 1:]

    def _sampled(self, x: FloatArray, times: FloatArray) -> FloatArray:
        """Unit response and its slopes at given times, shape (k, 1 + n)."""
        moves = zip(self.drive.moves, self.drive.sizes, strict=True)
        return np.asarray(sum(size * self._step(times - move, x) for move, size in moves))

    def _step(self, time: FloatArray, x: FloatArray) -> FloatArray:
        """Step response of the flow, the lag and the known dynamics, and its slopes."""
        dead_time, mean, spread, lag = self.times(x)
        poles, residues, slopes, gain = self._residues(lag)
        found = np.zeros((time.size, 1 + x.size))
        since = time - dead_time
        begun = since > 0
        modes = flow_modes(since[begun], mean, spread, np.append(poles, 0.0))
        weights = np.append(residues, gain)
        found[begun, 0] = (modes.values @ weights).real
        found[begun, 1] = -self.scales.rise * (modes.by_time @ weights).real
        found[begun, 2] = (modes.by_mean @ weights).real
        found[begun, 3] = (modes.by_spread @ weights).real
        if lag:
            # The pole is the inverse of the lag: it grows by itself, with the other sign.
            own = modes.by_pole[:, -2] * residues[-1] / lag
            found[begun, 4] = (modes.values[:, :-1] @ slopes + own).real
        return found

    def _residues(self, lag: float) -> tuple[ComplexArray, ComplexArray, ComplexArray, float]:
        """Poles behind the flow, the lag's last; their residues in a step response, gain.

        The third are derivatives of the residues with respect to the logarithm of the lag.
        """
        known = self.problem.known
        if not lag:
            residues, gain, _ = partial_fractions(known.poles[None], known.numerator, 1)
            return known.poles, residues[0, :, 0], np.zeros_like(known.poles), float(gain[0])
        poles = np.append(known.poles, -1 / lag)
        residues, gain, curved = partial_fractions(poles[None], known.numerator / lag, 1)
        found = residues[0, :, 0]
        apart = 1 / (poles[-1] - known.poles)
        slopes = np.append(found[:-1] * known.poles * apart, 0.0)
        slopes[-1] = -poles[-1] * (curved[0, -1, 0] - found[-1] * np.sum(apart)) - found[-1]
        return poles, found, slopes, float(gain[0])
