"""Convert the record of a step experiment to separable least-squares problems.

Means over bins are weighted by the inverse of their variance [1]_.

What the record shows before its step (noise, hum, a drift, or the free response of the plant) is
chosen by an information criterion [2]_; how much evidence a motion needs follows [3]_. That it may
not take the place of the response to the step is our own rule.

References
----------
.. [1] A. C. Aitken, On least squares and linear combination of observations, Proc. Roy. Soc.
   Edinburgh 55 (1935) 42-48.
.. [2] G. Schwarz, Estimating the dimension of a model, Ann. Statist. 6 (1978) 461-464,
   doi:10.1214/aos/1176344136.
.. [3] R. E. Kass and A. E. Raftery, Bayes factors, J. Amer. Statist. Assoc. 90 (1995) 773-795,
   doi:10.1080/01621459.1995.10476572.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cache

import numpy as np

from ..arrays import ComplexArray, FloatArray, IntArray
from ..constants import STRONG, VERY_STRONG
from ..engine.eliminate import evaluate
from ..engine.local_terms import Segments, local_columns
from ..engine.modal import respond
from ..engine.problem import KnownFactor, Problem, Structure
from ..engine.responses import StepSequence
from ..engine.structures import SIMPLE_STRUCTURES, Candidate, Scales, needless_parameters
from ..engine.window_fit import Window, WindowFit
from ..rules import Rule
from ..signals.baseline import noise_about_a_motion, relaxation
from ..signals.bins import response_bins
from ..signals.filters import moving_mean
from ..signals.load_step import LoadStep
from ..signals.noise import (
    colouring,
    correlation_of_noise,
    correlation_time,
    hum_frequencies,
    is_coarse,
    quantisation_step,
    rest_noise,
    sine_pair,
)
from ..signals.onset import FirstMotion, first_motion
from ..signals.step_sequence import input_moves

_MANY = 100  # samples at rest in which dither would show more than two levels
_MOST_MISSING = 0.5  # of the samples at rest, for a sinusoid to be looked for
_OUTLIER = 3.0  # standard deviations at which residuals are cut where explanations are compared

_MOST_TO_COME = 10.0
"""How much more a free response may move after the step than before it. One that hardly moves
before it takes the place of the response to the step, whose gain is then lost: 50 and more in joint
fits of 13 step records of a two-cart drive, with gains up to three times too large; 0.7 to 1 for
simulated records that were moving."""
_MOST_OF_A_BEND = 2.0
"""The same where the baseline has risen and fallen: the extremes of the motion are in it then. 0.4
to 0.7 for simulated pulses just before the record, 1.7 for a heater in a box."""


@dataclass(frozen=True, eq=False)
class StepData:
    """A record of one or several steps, with the properties of its baseline.

    Attributes
    ----------
    output : ndarray, shape (N,)
        Samples that there are.
    input : ndarray, shape (K,)
        At every sample, K >= N.
    dt : float
        Sample time in s.
    edges : list of (index, samples)
        Samples at which the input moves, and the durations.
    rows : ndarray of int, shape (N,)
        Samples at which there is an output; 0...N - 1 if none is missing.
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
    span : float or None
        Duration of records without a step, in s.
    bend : float
        Noise about a baseline that bends or swings; 0 if it does neither.
    every : int
        Samples of a record for each output of a record without a step.
    load : LoadStep or None
        Step of a load that moved the output as well.
    """

    output: FloatArray
    input: FloatArray
    dt: float
    edges: list[tuple[int, int]]
    rows: IntArray
    sigma: float
    quantum: float
    drift: float
    colour: float
    hum: list[float]
    motion: FirstMotion | None
    quiet: FloatArray
    relaxing: bool = False
    span: float | None = None
    bend: float = 0.0
    every: int = 1
    load: LoadStep | None = None

    @property
    def clock(self) -> FloatArray:
        """Times (N,) of the outputs since the first sample, in s."""
        return _at(self.rows, self.dt)

    @property
    def edge(self) -> int:
        """Number of outputs before the sample at which the input has first moved."""
        return self.before(self.edges[0][0])

    @property
    def length(self) -> float:
        """Duration of the record from its first edge on, in s."""
        fits = (self.input.size - self.edges[0][0]) * self.dt
        return fits if self.span is None else self.span

    @property
    def since(self) -> IntArray:
        """Samples (N,) from the first edge to each output."""
        return self.rows - self.edges[0][0]

    def before(self, sample: int) -> int:
        """Number of outputs before a sample."""
        return int(np.searchsorted(self.rows, sample))

    @property
    def coarse(self) -> bool:
        """Quantised so coarsely that averaging does not remove the rounding."""
        rest = self.output[: self.edge]
        # A baseline between two levels jumps between both, however small the noise: this is not
        # dither, which needs more levels (95 % of its samples are within two, half a step high).
        two_levels = rest.size >= _MANY and np.ptp(rest) < 1.5 * self.quantum
        return bool(is_coarse(self.sigma, self.quantum) or two_levels) and Rule.COARSE.on

    def with_load(self, load: LoadStep, response: FloatArray) -> StepData:
        """Add a load, with its part (N,) of the output, without which the response is seen."""
        quiet = self.quiet - response
        gaps = None if self.rows.size == self.input.size else self.since
        motion = first_motion(quiet, self.edge, self.sigma, self.quantum, self.drift, gaps)
        return replace(self, load=load, quiet=quiet, motion=motion)

    def explanations(self) -> list[StepData]:
        """Models of a motion before the step: drift, hum, free response of the plant, or none.

        A drift continues to the end, and so does hum. A baseline that bends or swings is no drift,
        and its noise is that about the motion if it is a free response. In a short rest a free
        response need not show.
        """
        if self.bend:
            ways = [replace(self, relaxing=True, hum=[], sigma=self.bend, colour=1.0), self]
        elif self.drift:
            still = replace(self, drift=0.0)
            ways = [self, replace(still, relaxing=True), still]
        elif briefly_at_rest(self):
            ways = [replace(self, relaxing=True), self]
        else:
            return [self]
        ways = [way for way in ways if not way.relaxing or Rule.FREE_RESPONSE.on]
        return [way for way in ways if way.drift or way.relaxing or Rule.NO_SLOPE.on] or [self]


def step_data(
    output: FloatArray, signal: FloatArray, dt: float, edges: list[tuple[int, int]]
) -> StepData:
    """Determine noise, drift, hum and visible onset of a step record.

    The output (K,) is NaN where a sample is missing. The noise is that of the samples that there
    are, as if they were neighbours: its correlation is then an average over the gaps.
    """
    rows = np.flatnonzero(~np.isnan(output))
    since = rows - edges[0][0]
    edge = int(np.searchsorted(since, 0))
    gaps = at_rest = None
    if rows.size < output.size:
        output, gaps, at_rest = output[rows], since, since[:edge]
    quantum = quantisation_step(output)
    sigma, drift = rest_noise(output[:edge], output, quantum, at_rest)
    hum: list[float] = []
    colour, quiet, relaxing, bend = 1.0, output, False, 0.0
    if edge >= 8:
        columns = np.stack([np.ones(edge), since[:edge] / edge], axis=1)
        line = columns @ np.linalg.lstsq(columns, output[:edge], rcond=None)[0]
        hum = [wave for wave in _hum(output[:edge] - line, at_rest) if Rule.HUM.on]
        curve = None if hum else relaxation(output, edge, gaps)
        if hum:
            waves = _hum_columns(rows, hum)
            columns = np.concatenate([columns, waves[:edge]], axis=1)
            weights = np.linalg.lstsq(columns, output[:edge], rcond=None)[0]
            quiet = output - waves @ weights[2:]
            line = columns @ weights
            sigma, drift = rest_noise(quiet[:edge], quiet, 0.0, at_rest)
            sigma = max(sigma, quantum / np.sqrt(12))
        elif curve is not None:
            quiet, line, relaxing = output - curve, curve[:edge], True
            sigma, drift = rest_noise(quiet[:edge], quiet, quantum, at_rest)[0], 0.0
        if curve is None and not drift:
            bend = noise_about_a_motion(output[:edge], quantum, at_rest)
        colour = colouring(output[:edge] - line, sigma)
    span = float(np.ptp(output))
    sigma = max(sigma, 1e-4 * span)
    loud = sigma * _unseen_at_rest(quiet[:edge] - line) if edge >= 8 else sigma
    motion = first_motion(quiet, edge, loud, quantum, drift, gaps)
    if (drift or relaxing) and not Rule.DRIFT.on:
        drift, relaxing = 0.0, False
    seen = sigma, quantum, drift, colour, hum, motion, quiet, relaxing
    return StepData(output, signal, dt, edges, rows, *seen, bend=bend)


def _unseen_at_rest(rest: FloatArray) -> float:
    """Scatter of slow noise about the level of a short rest, over that about a line through it.

    The line takes part c of the variance (`correlation_of_noise`), and the level is off by half of
    that. Without, an excursion of the noise passes for the first motion, and no dead time is later.
    Ablation: first motion in slow noise.
    """
    _, lost = correlation_of_noise(correlation_time(rest), 2 / rest.size)
    wider = float(np.sqrt((1.0 + 0.5 * lost) / (1.0 - lost)))
    return wider if lost and Rule.SLOW_REST.on else 1.0


def bare_data(
    output: FloatArray, signal: FloatArray, dt: float, sigma: float, span: float, every: int = 1,
    relaxing: bool = True,
) -> StepData:  # fmt: skip
    """Data of records without a step, with a duration `span` in s: there is no baseline."""
    rows = np.arange(output.size)
    seen = sigma, 0.0, 0.0, 1.0, list[float](), None, output, relaxing
    return StepData(output, signal, dt, [(0, 1)], rows, *seen, span=span, every=every)


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
    first = edge + int(reached[0]) if reached.size else n
    step = data.edges[0][0]
    onset, crossing = data.before(step + int(motion.onset)), data.before(step + motion.crossing)
    return min(n, max(first, onset + 10, crossing + 3))


def _rise(data: StepData, stop: int) -> int:
    """Samples from the step until 63 % of the response, or until output `stop`."""
    return int(data.rows[min(stop, stop_at(data, 0.63)) - 1]) + 1 - data.edges[0][0]


def briefly_at_rest(data: StepData) -> bool:
    """Whether the output was seen for less time before the step than it takes to rise.

    Nothing tells then that the plant was at rest, nor how a motion would go on without the step,
    from which the visible onset is counted. Ablation: rest shorter than the response.
    """
    brief = data.motion is not None and data.edges[0][0] < _rise(data, data.output.size)
    return brief and Rule.BRIEF_REST.on


def settled_at(data: StepData) -> int:
    """Output from which on a response has settled: twice the rise to 95 % after the step."""
    step, stop = data.edges[0][0], stop_at(data, 0.95)
    end = int(data.rows[stop]) if stop < data.rows.size else data.input.size
    return data.before(step + 2 * (end - step))


def window(data: StepData, stop: int, known: KnownFactor) -> Window:
    """Set up the fit of the outputs up to `stop`, which is not among them."""
    crossing = data.motion.crossing if data.motion else 0
    rows = data.rows[:stop]
    end = int(rows[-1]) + 1
    edges = [i for i, _ in data.edges if i < end]
    bins = response_bins(end, edges, crossing, relaxing=data.relaxing)
    index, size = input_moves(data.input, data.edges, end)
    times = _at(rows, data.dt)
    if rows.size < end:
        bins = bins.holding(rows)
    moves = _at(index, data.dt)
    columns = fixed_regressors(data)[:stop]
    drive = StepSequence(times[bins.first], bins.width, data.dt, moves, size)
    if rows.size < end:
        drive = replace(drive, samples=times)
    means, on_bins, own = bins.average(columns), None, None
    if data.relaxing:
        on_bins, own = Segments.single(drive.first, means, drive), Segments.single(times, columns)
        columns, means = columns[:, :0], means[:, :0]
    weights = bins.width.astype(np.float64)  # inverse variances, over that of a single sample
    if data.coarse:  # means of samples without dither keep the rounding error
        weights = weights / (1 + weights) * 2
    problem = Problem(
        bins.average(data.output[:stop]), np.sqrt(weights), drive, means, known, on_bins
    )
    single = np.broadcast_to(np.int64(1), stop)  # no memory for ones
    drive = StepSequence(times, single, data.dt, moves, size)
    spacing = float(rows[-1] - rows[0]) / max(rows.size - 1, 1)
    return Window(
        data.edge, data.output[:stop], problem, drive, columns, bins, own, spacing=spacing
    )


def step_scales(
    data: StepData, stop: int, latest: float | None, earliest: float = 0.0, apparent: bool = False
) -> Scales:
    """Initial guesses of the times of the response, from its onset and its 63 % point.

    No dead time is later than the visible onset, but an `apparent` one may be: until `latest`.
    """
    assert data.motion is not None
    motion, dt = data.motion, data.dt
    end = int(data.rows[stop - 1]) + 1
    since = _rise(data, stop)
    rise = since - motion.onset
    last = (motion.crossing + max(1.0, 0.05 * motion.crossing)) * dt
    if data.relaxing and (data.bend or briefly_at_rest(data)):
        # Beside a motion that goes on, that of the response is not visible before it is large.
        last = max(last, since * dt)
    if latest is None:
        latest = last
    elif earliest < last and not apparent:
        latest = min(last, latest)
    return Scales(
        onset=max(motion.onset, 0.5) * dt,
        rise=max(rise, 2.0) * dt,
        length=(end - data.edges[0][0]) * dt,
        dt=dt,
        latest=latest,
        earliest=earliest,
    )


def fixed_regressors(data: StepData) -> FloatArray:
    """Offset, drift if there is one, and hum, shape (N, q)."""
    n = data.output.size
    if not data.drift and not data.hum and data.load is None:
        return np.broadcast_to(1.0, (n, 1))  # no memory for ones
    columns = [np.ones((n, 1))]
    if data.drift:
        columns.append((data.since / data.input.size)[:, None])
    if data.hum:
        columns.append(_hum_columns(data.rows, data.hum))
    if data.load is not None:
        columns.append(data.load.columns(data.clock))
    return np.concatenate(columns, axis=1)


def own_regressors(data: StepData, poles: ComplexArray) -> FloatArray:
    """Local terms of the record at every sample, shape (N, q).

    The fixed regressors, and the free response of a plant with poles (n,) if there is one.
    """
    fixed = fixed_regressors(data)
    if not data.relaxing:
        return fixed
    return np.asarray(local_columns(Segments.single(data.clock, fixed), poles[None])[0])


def _at(index: IntArray, dt: float) -> FloatArray:
    return np.asarray(dt * index.astype(np.float64))


def _hum(rest: FloatArray, rows: IntArray | None) -> list[float]:
    """Sinusoids of the baseline; `rows` are the samples that there are if others are missing."""
    if rows is None:
        return hum_frequencies(rest)
    if rest.size < _MOST_MISSING * -rows[0]:
        return []
    # The line through a gap weakens a sinusoid, and leaves its frequency.
    return hum_frequencies(np.interp(np.arange(rows[0], 0), rows, rest))


def _hum_columns(rows: IntArray, frequencies: list[float]) -> FloatArray:
    index = rows.astype(np.float64)
    return np.concatenate([sine_pair(index, f) for f in frequencies], axis=1)


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
    drift, which goes on to the end of the record, needs very strong evidence ([3]_). Ablation:
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
