"""Convert the record of a step experiment to separable least-squares problems.

Means over bins are weighted by the inverse of their variance [1]_.

References
----------
.. [1] A. C. Aitken, On least squares and linear combination of observations, Proc. Roy. Soc.
   Edinburgh 55 (1935) 42-48.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from ..arrays import ComplexArray, FloatArray, IntArray
from ..separable.local_terms import Segments, local_columns
from ..separable.responses import StepSequence
from ..separable.structures import Scales
from ..separable.varpro import KnownFactor, Problem
from ..separable.window import Window
from ..signals.baseline import relaxation
from ..signals.bins import BINS_AT_REST, Bins, response_bins
from ..signals.filters import moving_mean
from ..signals.noise import (
    colouring,
    hum_frequencies,
    is_coarse,
    quantisation_step,
    rest_noise,
    sine_pair,
)
from ..signals.onset import FirstMotion, first_motion
from ..signals.step_sequence import input_moves

_BINS_RELAXING = 60  # of a rest in which the output comes to rest, so that lags show in it
_MANY = 100  # samples at rest in which dither would show more than two levels


@dataclass(frozen=True, eq=False)
class StepData:
    """A record of one or several steps, with the properties of its baseline.

    Attributes
    ----------
    output, input : ndarray, shape (N,)
    dt : float
        Sample time in s.
    edges : list of (index, samples)
        Samples at which the input moves, and the durations.
    sigma, quantum : float
        Noise level and quantisation step of the output.
    drift : float
        Significant slope before the step, per sample.
    colour : float
        Standard deviation of means of samples relative to that for white noise.
    hum : list of float
        Sinusoids in the noise, in cycles per sample.
    motion : FirstMotion or None
        None if the output does not move.
    quiet : ndarray, shape (N,)
        Output without hum and without the extrapolated motion before the step.
    relaxing : bool
        The output was not in steady state before the step: the model includes a free response.
    """

    output: FloatArray
    input: FloatArray
    dt: float
    edges: list[tuple[int, int]]
    sigma: float
    quantum: float
    drift: float
    colour: float
    hum: list[float]
    motion: FirstMotion | None
    quiet: FloatArray
    relaxing: bool = False

    @property
    def edge(self) -> int:
        """First sample at which the input has moved."""
        return self.edges[0][0]

    @property
    def coarse(self) -> bool:
        """Quantised so coarsely that averaging does not remove the rounding."""
        rest = self.output[: self.edge]
        # A baseline between two levels jumps between both, however small the noise: this is not
        # dither, which needs more levels (95 % of its samples are within two, half a step high).
        two_levels = rest.size >= _MANY and np.ptp(rest) < 1.5 * self.quantum
        return bool(is_coarse(self.sigma, self.quantum) or two_levels)

    def explanations(self) -> list[StepData]:
        """Models of a slope before the step: drift, free response of the plant, or none.

        A drift continues to the end.
        """
        if not self.drift:
            return [self]
        still = replace(self, drift=0.0)
        return [self, replace(still, relaxing=True), still]


def step_data(
    output: FloatArray, signal: FloatArray, dt: float, edges: list[tuple[int, int]]
) -> StepData:
    """Determine noise, drift, hum and visible onset of a step record."""
    edge = edges[0][0]
    quantum = quantisation_step(output)
    sigma, drift = rest_noise(output[:edge], output, quantum)
    hum: list[float] = []
    colour, quiet, relaxing = 1.0, output, False
    if edge >= 8:
        columns = np.stack([np.ones(edge), np.arange(-edge, 0) / edge], axis=1)
        line = columns @ np.linalg.lstsq(columns, output[:edge], rcond=None)[0]
        hum = hum_frequencies(output[:edge] - line)
        curve = None if hum else relaxation(output, edge)
        if hum:
            waves = _hum_columns(output.size, hum)
            columns = np.concatenate([columns, waves[:edge]], axis=1)
            weights = np.linalg.lstsq(columns, output[:edge], rcond=None)[0]
            quiet = output - waves @ weights[2:]
            line = columns @ weights
            sigma, drift = rest_noise(quiet[:edge], quiet, 0.0)
            sigma = max(sigma, quantum / np.sqrt(12))
        elif curve is not None:
            quiet, line, relaxing = output - curve, curve[:edge], True
            sigma, drift = rest_noise(quiet[:edge], quiet, quantum)[0], 0.0
        colour = colouring(output[:edge] - line, sigma)
    span = float(np.ptp(output))
    sigma = max(sigma, 1e-4 * span)
    motion = first_motion(quiet, edge, sigma, quantum, drift)
    return StepData(
        output, signal, dt, edges, sigma, quantum, drift, colour, hum, motion, quiet, relaxing
    )


def bare_data(output: FloatArray, signal: FloatArray, dt: float, sigma: float) -> StepData:
    """Data of a record without a step: there is no baseline."""
    return StepData(output, signal, dt, [(0, 1)], sigma, 0.0, 0.0, 1.0, [], None, output)


def stop_at(data: StepData, part: float) -> int:
    """Sample at which the response first reaches `part` of its final value (1: the end)."""
    n = data.output.size
    if part >= 1 or data.motion is None:
        return n
    motion, edge = data.motion, data.edge
    width = int(np.clip(0.02 * (n - edge), 1, 9))
    moved = moving_mean(data.quiet - motion.rest, width)
    reached = np.flatnonzero(moved[edge:] * motion.sign > part * motion.span)
    if not reached.size:
        reached = np.flatnonzero(np.abs(moved[edge:]) > part * motion.span)
    first = int(reached[0]) if reached.size else n - edge
    return min(n, edge + max(first, int(motion.onset) + 10, motion.crossing + 3))


def settled_at(data: StepData) -> int:
    """Sample from which on a response has settled: twice the rise to 95 % after the step."""
    return data.edge + 2 * (stop_at(data, 0.95) - data.edge)


def window(data: StepData, stop: int, known: KnownFactor) -> Window:
    """Set up the fit of the samples up to `stop`."""
    crossing = data.motion.crossing if data.motion else 0
    at_rest = _BINS_RELAXING if data.relaxing else BINS_AT_REST
    bins = response_bins(stop, [i for i, _ in data.edges if i < stop], crossing, at_rest)
    index, size = input_moves(data.input, data.edges, stop)
    moves = _at(index, data.dt)
    columns = fixed_regressors(data)[:stop]
    own: tuple[Segments | None, Segments | None] = None, None
    if data.relaxing:
        own = _free_response(data, bins, columns)
        columns = columns[:, :0]
    problem = Problem(
        bins.average(data.output[:stop]),
        np.sqrt(_weights(data, bins)),
        StepSequence(_at(bins.first, data.dt), bins.width, data.dt, moves, size),
        bins.average(columns),
        known,
        own[0],
    )
    single = np.broadcast_to(np.int64(1), stop)  # no memory for ones
    drive = StepSequence(_at(np.arange(stop), data.dt), single, data.dt, moves, size)
    return Window(data.edge, data.output[:stop], problem, drive, columns, bins, own[1])


def _free_response(data: StepData, bins: Bins, columns: FloatArray) -> tuple[Segments, Segments]:
    """Local terms of the record, on bins and at every sample: regressors and free response."""
    # In the middle of a bin, which is narrow compared with the decay of the free response there.
    middle = data.dt * (bins.first + (bins.width - 1) / 2)
    every = data.dt * np.arange(len(columns), dtype=np.float64)
    return (
        Segments(np.array([0, middle.size]), middle, bins.average(columns)),
        Segments(np.array([0, every.size]), every, columns),
    )


def step_scales(data: StepData, stop: int, latest: float | None) -> Scales:
    """Initial guesses of the times of the response, from its onset and its 63 % point."""
    assert data.motion is not None
    motion, dt = data.motion, data.dt
    rise = min(stop, stop_at(data, 0.63)) - data.edge - motion.onset
    last = (motion.crossing + max(1.0, 0.05 * motion.crossing)) * dt
    return Scales(
        onset=max(motion.onset, 0.5) * dt,
        rise=max(rise, 2.0) * dt,
        length=(stop - data.edge) * dt,
        dt=dt,
        latest=last if latest is None else min(last, latest),
    )


def fixed_regressors(data: StepData) -> FloatArray:
    """Offset, drift if there is one, and hum, shape (N, q)."""
    n = data.output.size
    if not data.drift and not data.hum:
        return np.broadcast_to(1.0, (n, 1))  # no memory for ones
    columns = [np.ones((n, 1))]
    if data.drift:
        columns.append(((np.arange(n) - data.edge) / n)[:, None])
    if data.hum:
        columns.append(_hum_columns(n, data.hum))
    return np.concatenate(columns, axis=1)


def own_regressors(data: StepData, poles: ComplexArray | None) -> FloatArray:
    """Local terms of the record at every sample, shape (N, q).

    The fixed regressors, and the free response of a plant with poles (n,) if they are given.
    """
    fixed = fixed_regressors(data)
    if poles is None:
        return fixed
    clock = data.dt * np.arange(len(fixed), dtype=np.float64)
    stretch = Segments(np.array([0, clock.size]), clock, fixed)
    return np.asarray(local_columns(stretch, poles[None])[0])


def _weights(data: StepData, bins: Bins) -> FloatArray:
    """Inverse variance of every mean, relative to that of a single sample."""
    count = bins.width.astype(np.float64)
    # Means of samples without dither keep the rounding error, however many there are.
    return count / (1 + count) * 2 if data.coarse else count


def _at(index: IntArray, dt: float) -> FloatArray:
    return np.asarray(dt * index.astype(np.float64))


def _hum_columns(n: int, frequencies: list[float]) -> FloatArray:
    index = np.arange(n, dtype=np.float64)
    return np.concatenate([sine_pair(index, f) for f in frequencies], axis=1)
