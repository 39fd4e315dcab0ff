"""Axial dispersion behind a dead time: the family of models, and its fit.

Three or four lags with a longer dead time have the same response as a flow that disperses [1]_ to
within the noise, which no residual shows; in a fit to the same record, dispersion needs two
parameters instead of four. There may be one lag in series, as of a sensor.

Residence times in a pipe or a packed bed have an inverse Gaussian distribution [1]_, [2]_: with a
mean m and a standard deviation c m the transfer function is

    exp((1 - sqrt(1 + 2 c^2 m s)) / c^2),

and 2/c^2 is the Peclet number. The integral of exp(p (t - s)) over the residence times s < t is

    M = exp(p t + (1 - q) / c^2) F(t; m/q),    q = sqrt(1 + 2 c^2 m p),

with the distribution F of [2]_, for which the density is tilted by exp(-p s); F consists of a
part that is early and one that is late. Derivatives need nothing that M does not:
dF/dm leaves the late part alone, as the densities in it cancel.

References
----------
.. [1] O. Levenspiel, Chemical Reaction Engineering, 3rd ed., Wiley 1999, chapter 13 (The dispersion
   model).
.. [2] J. L. Folks and R. S. Chhikara, The inverse Gaussian distribution and its statistical
   application - a review, J. Roy. Statist. Soc. B 40 (1978) 263-289.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np
from scipy.signal import fftconvolve
from scipy.special import erfcx

from ..arrays import ComplexArray, FloatArray, IntArray
from ..constants import VERY_STRONG
from ..engine.eliminate import eliminate
from ..engine.modal import moved_amplitudes, partial_fractions
from ..engine.problem import Bounds, KnownFactor, Problem
from ..engine.responses import HeldInput, SampledInput, SeveralInputs, StepSequence
from ..engine.structures import REACH, Candidate
from ..engine.window_fit import WindowFit
from ..rules import Rule
from ..signals.sines import HeldSines, Sines, stacked_parts
from .equal_lags import time_moments
from .shaped import ShapedFamily, UnitResponse, lowest

_CHARGE = 8.0
"""What a flow must be worth in the criterion: a few lags are more common. Ablation: charge for a
flow."""
_MINOR = 0.5
"""Of the lag behind it: a flow that spreads by less is no different from a second lag in a step
response. In points of a frequency response, which reach further, it is."""
_FOLLOWED = 3  # starts that are improved: time
_SPREADS = (0.1, 1.2)
"""Standard deviations over means: narrower is no different from many lags, wider from few."""
_DELAYS, _LAGS = (0.0, 0.4, 0.7, 0.95), (0.05, 0.3, 0.6, 0.9)
"""Starts: parts of a dead time that is too long, and of the whole spread in time."""
_ALIASES = 20
"""On either side. A flow passes exp(-sqrt(m omega)/c) of a fast frequency omega: of the first alias
that is left out 1e-10 with a mean m of a sample, and 1e-3 with a tenth of one (c = 0.5)."""
_DOUBLE = 1e-12
"""Instead of a square of q of 0, where a derivative is a quotient of two zeros."""


@dataclass(frozen=True, eq=False)
class FlowModes:
    """Modes exp(p t) in series with a flow, at times (m,), and their derivatives.

    ``values`` (m, J), ``by_time``, ``by_mean`` and ``by_spread`` (the latter two with respect to
    logarithms), and ``by_pole``; real if the poles are.
    """

    values: Any
    by_time: Any
    by_mean: Any
    by_spread: Any
    by_pole: Any


def flow_modes(
    time: FloatArray, mean: float, spread: float, poles: FloatArray | ComplexArray
) -> FlowModes:
    r"""Responses of modes in series with dispersion.

    Parameters
    ----------
    time : ndarray, shape (m,)
        Time since the start of the flow, in s; positive.
    mean, spread : float
        Mean residence time in s, and its standard deviation over the mean.
    poles : ndarray, shape (J,)
        In 1/s; 0 for the flow itself, the fraction that has left the pipe.

    Notes
    -----
    With x = t/m and z = (1 -+ q x) / sqrt(2 c^2 x) a mode is exp(-(1 - x)^2 / (2 c^2 x)) / 2 times
    the sum of both erfcx(z); t times the density of the residence times is
    exp(-(1 - x)^2 / (2 c^2 x)) / (c sqrt(2 pi x)).
    """
    x = time / mean
    root = 1 / (spread * np.sqrt(2 * x))
    envelope = 0.5 * np.exp(-((root * (1 - x)) ** 2))
    arriving = 2 / np.sqrt(np.pi) * root * envelope
    complex_ones = bool(np.any(poles.imag != 0))
    rates = poles if complex_ones else poles.real
    columns = []
    for rate in rates:
        square = (1 + 2 * spread**2 * mean * rate) or _DOUBLE
        q = np.sqrt(square) if complex_ones or square > 0 else 1j * np.sqrt(-square)
        value, late = _halves(q, x, root, envelope, time * rate + (1 - q) / spread**2)
        turned = (value - 2 * late) * (mean / q)
        curved = ((1 - q) ** 2 * value - 2 * (square + 1) * late) / (q * spread**2)
        if not complex_ones:
            turned, curved = turned.real, curved.real
        by_time, by_mean = rate * value + arriving / time, -rate * turned - arriving
        columns.append((value, by_time, by_mean, curved + 2 * arriving, time * value - turned))
    return FlowModes(*(np.stack(column, axis=1) for column in zip(*columns, strict=True)))


def _halves(
    q: Any, x: FloatArray, root: FloatArray, envelope: FloatArray, tilt: Any
) -> tuple[Any, Any]:
    """A mode, and its late part."""
    late = envelope * erfcx(root * (1 + q * x))
    if q.real == 0:
        return 2 * late.real, late  # the early part is its conjugate
    early = root * (1 - q * x)
    behind = early.real < 0
    # erfcx(z) = 2 exp(z^2) - erfcx(-z): for negative z it would overflow.
    sign = np.where(behind, -1.0, 1.0)
    whole = np.exp(np.where(behind, tilt, -np.inf))
    return whole + late + sign * envelope * erfcx(sign * early), late


@dataclass(frozen=True, eq=False)
class FlowFamily(ShapedFamily):
    """Dispersion over x = (dead time, log mean, log spread, log lag), times in s.

    The last is missing if no lag is in series; `order` is 1 if there is one.
    """

    def theta(self, parameters: FloatArray) -> FloatArray:
        """Dead time, without poles: a flow has none."""
        return parameters[:1]

    def tangent(self, x: FloatArray, gain: float) -> FloatArray:
        """Derivatives of dead time and gain, all that it has of a rational model."""
        return np.eye(x.size + 1)[[0, -1]]

    def times(self, x: FloatArray) -> tuple[float, float, float, float]:
        """Dead time, mean, spread and lag; all but the spread in s."""
        mean, spread, *lag = (float(value) for value in np.exp(x[1:]))
        return float(x[0]), mean, spread, lag[0] if lag else 0.0

    def response(self, problem: Problem, x: FloatArray) -> UnitResponse:
        """Unit response in means over the bins (m,), by Simpson's rule for wide bins, and slopes.

        Where samples are missing, in means over two times, as in `StepSequence`. The slopes
        (m, k) are derivatives with respect to the parameters.
        """
        parts = _parts(problem.drive)
        made = np.concatenate([self._rows(part, problem.known, x)[rows] for part, rows in parts])
        poles, moved = self._free(x)
        if problem.segments is None:
            poles, moved = poles[:0], moved[:0]
        return UnitResponse(made[:, 0], made[:, 1:], np.ones(1), poles, moved[:, : x.size])

    def _free(self, x: FloatArray) -> tuple[ComplexArray, ComplexArray]:
        """Poles of a free response, and their derivatives.

        What is still in a flow when a record begins leaves it with its slowest rate in the end;
        a second pole is for what comes before.
        """
        _, mean, spread, lag = self.times(x)
        poles = -np.array([1.0, 2.0]) / (2 * spread**2 * mean)
        moved = -poles[:, None] * [0.0, 1.0, 2.0, 0.0]
        if lag:
            poles = np.append(poles, -1 / lag)
            moved = np.vstack([moved, [0.0, 0.0, 0.0, 1 / lag]])
        return poles.astype(np.complex128), moved.astype(np.complex128)

    def _rows(self, drive: HeldInput, known: KnownFactor, x: FloatArray) -> FloatArray:
        """Unit response and its slopes (m, 1 + k) in the rows of one part of the data."""
        if isinstance(drive, Sines):
            return stacked_parts(self._points(drive.omega, x))
        if isinstance(drive, HeldSines):
            # Samples have all aliases of what passes the hold, over the response of the hold.
            turns = 2 * np.pi / drive.step * np.arange(-_ALIASES, _ALIASES + 1)[:, None]
            omega = drive.omega + turns
            parts = self._points(omega.ravel(), x).reshape(*omega.shape, -1)
            return stacked_parts(np.einsum("ak,akj->kj", drive.omega / omega, parts))
        if isinstance(drive, SampledInput):
            changes = np.diff(drive.signal, prepend=0.0)[:, None]
            times = np.asarray(drive.dt * np.arange(drive.signal.size), dtype=np.float64)
            step = self._step(times, x, *self._residues(known, x))
            return np.asarray(fftconvolve(changes, step, axes=0)[: times.size])
        assert isinstance(drive, StepSequence)
        sampled = partial(self._sampled, drive, known, x)
        if drive.samples is not None:
            early, late = (sampled(drive.first + node) for node in drive.nodes)
            return np.asarray((early + late) / 2)
        wide = drive.width > 1
        span = drive.lengths[wide]
        since = np.concatenate(
            [drive.first, drive.first[wide] + span / 2, drive.first[wide] + span]
        )
        total, middle, end = np.split(sampled(since), [wide.size, wide.size + span.size])
        total[wide] = (total[wide] + 4 * middle + end) / 6
        return total

    def _points(self, omega: FloatArray, x: FloatArray) -> ComplexArray:
        """Frequency response at omega (K,), and its slopes: (K, 1 + k)."""
        dead_time, mean, spread, lag = self.times(x)
        s = 1j * omega
        q = np.sqrt(1 + 2 * spread**2 * mean * s)
        late, turned = (1 - q) / spread**2, mean * s / q
        response = np.exp(late - s * dead_time) / (1 + lag * s)
        slopes = [-s, -turned, -2 * (late + turned), -lag * s / (1 + lag * s)][: x.size]
        return np.asarray(response[:, None] * np.stack([np.ones_like(s), *slopes], axis=1))

    def _sampled(
        self, drive: StepSequence, known: KnownFactor, x: FloatArray, times: FloatArray
    ) -> FloatArray:
        """Unit response and its slopes at given times, shape (m, 1 + k)."""
        weights = self._residues(known, x)
        moves = zip(drive.moves, drive.sizes, strict=True)
        return np.asarray(sum(size * self._step(times - move, x, *weights) for move, size in moves))

    def _step(
        self,
        time: FloatArray,
        x: FloatArray,
        poles: ComplexArray,
        residues: ComplexArray,
        slopes: ComplexArray,
    ) -> FloatArray:
        """Step response of the flow, the lag and the known dynamics, and its slopes."""
        dead_time, mean, spread, lag = self.times(x)
        response = np.zeros((time.size, 1 + x.size))
        begun = time > dead_time
        modes = flow_modes(time[begun] - dead_time, mean, spread, poles)
        response[begun, 0] = (modes.values @ residues).real
        response[begun, 1] = -(modes.by_time @ residues).real
        response[begun, 2] = (modes.by_mean @ residues).real
        response[begun, 3] = (modes.by_spread @ residues).real
        if lag:
            # The pole is minus the inverse of the lag.
            moved = modes.by_pole[:, -2] * residues[-2] / lag
            response[begun, 4] = (modes.values @ slopes + moved).real
        return response

    def _residues(
        self, known: KnownFactor, x: FloatArray
    ) -> tuple[ComplexArray, ComplexArray, ComplexArray]:
        """Poles behind the flow, the lag's and that of the step last; residues in a step response.

        The third are derivatives of the residues with respect to the logarithm of the lag.
        """
        lag = self.times(x)[3]
        poles = np.append(known.poles, [-1 / lag] if lag else [])[None]
        residues, gain, moved = partial_fractions(poles, known.numerator, 1)
        level = np.array([[1 / lag if lag else 1.0]])
        amplitudes = residues[:, :, 0] * level
        slopes = np.zeros_like(amplitudes)
        if lag:
            slopes = moved_amplitudes(poles, amplitudes, moved, level)[:, :, -1] / lag - amplitudes
        return (
            np.append(poles, 0.0),
            np.append(amplitudes, gain * level[0]),
            np.append(slopes, 0.0),
        )


def _parts(drive: HeldInput) -> list[tuple[HeldInput, IntArray | slice]]:
    return drive.wanted if isinstance(drive, SeveralInputs) else [(drive, slice(None))]


@dataclass(frozen=True, eq=False)
class DispersedFlow:
    """Best fit of dispersion with a dead time; times in s.

    `fit` has the parameters of the family, `mean` is that of the residence time, `spread` its
    standard deviation over the mean, `lag` the time constant in series, 0 if there is none.
    `criterion` includes the penalty on dispersion, `delta_bic` is its difference from the best
    lags.
    """

    fit: Candidate
    dead_time: float
    mean: float
    spread: float
    lag: float
    criterion: float
    delta_bic: float

    @property
    def parameters(self) -> int:
        """Number of free parameters besides gain and dead time."""
        return 3 if self.lag else 2

    @property
    def peclet(self) -> float:
        """Peclet number of the flow, 2/c^2."""
        return 2 / self.spread**2


def fit_flows(fits: WindowFit, level: float) -> list[DispersedFlow]:
    """Fit dispersion with a dead time, with and without a lag in series.

    Parameters
    ----------
    fits : WindowFit
        Of a step record, a frequency response, both, or records of any input; the best of them has
        the dead time and the spread in time of the initial values.
    level : float
        Criterion of the best lags: fits far above it are abandoned.

    Returns
    -------
    list of DispersedFlow
        Of steps alone only fits whose spread is at least half of the lag in series; otherwise a
        second lag would be equivalent. A short flow with a long lag and a long flow alone are often
        equally good: both are returned. Empty if the spread in time of the best fit is less than a
        sample, or if a step record has a free response.
    """
    problem, scales, penalty = fits.problem, fits.scales, fits.penalty
    drives = [drive for drive, _ in _parts(problem.drive)]
    points = [isinstance(drive, Sines | HeldSines) for drive in drives]
    # Beside a step the free response to an earlier input takes the place of a flow.
    kinds = StepSequence | Sines | HeldSines if problem.segments is None else SampledInput
    if not all(isinstance(drive, kinds) for drive in drives):
        return []
    mean, square = time_moments(problem, fits.best)
    if not square > scales.dt**2:
        return []
    flows: list[DispersedFlow] = []
    time = np.log(0.1 * scales.dt), np.log(3 * scales.length)
    for lagging in (True, False):
        # Without the lag the sum of squares is no smaller: only a parameter can be saved.
        if not lagging and flows[0].delta_bic - penalty > VERY_STRONG:
            break
        low, high = (
            np.array([dead_time, time[end], np.log(_SPREADS[end]), *[time[end]] * lagging])
            for end, dead_time in enumerate((scales.earliest, scales.latest))
        )
        bounds = Bounds(low, high, smooth=True)
        family = FlowFamily(int(lagging), int(lagging), bounds, (-np.inf, np.inf))
        starts = np.array(list(_starts(family, fits.best.dead_time, mean, float(np.sqrt(square)))))
        if not starts.size:  # responses that begin the other way have a short mean, or none
            break
        promising = starts[np.argsort(eliminate(problem, family, starts).cost)[:_FOLLOWED]]
        charge = (family.bounds.low.size + 1) * penalty + (_CHARGE if Rule.FLOW_CHARGE.on else 0.0)
        most = (level + REACH - charge) * fits.variance
        fit = lowest(problem, family, promising, scales.dt, most)
        criterion = fit.cost / fits.variance + charge + problem.local_count(2 + lagging)
        flows.append(
            DispersedFlow(fit, *family.times(fit.parameters), criterion, criterion - level)
        )
    least = 0.0 if any(points) else _MINOR
    return [flow for flow in flows if flow.spread * flow.mean >= least * flow.lag]


def _starts(
    family: FlowFamily, dead_time: float, mean: float, deviation: float
) -> Iterator[FloatArray]:
    """Divide mean and variance in time between dead time, dispersion and lag."""
    lagging, bounds = bool(family.order), family.bounds
    for part in _DELAYS:
        for share in _LAGS if lagging else (0.0,):
            lag = share * deviation
            residence = mean - part * dead_time - lag
            if residence > 0:
                spread = np.sqrt(deviation**2 - lag**2) / residence
                logs = np.log([residence, spread, *[lag] * lagging])
                yield np.clip(np.append(part * dead_time, logs), bounds.low, bounds.high)
