"""Response of an actuator with linear dynamics behind it, or before it.

In front (`place` "input") the actuator changes the command, and lags and dead time follow: a
Hammerstein model. At the stem, lags and dead time come first: a Wiener model [1]_. A dead time
commutes with any actuator, so that there is only one. Stiction before linear dynamics was
identified in this way in [2]_.

References
----------
.. [1] F. Giri and E.-W. Bai (eds.), Block-oriented Nonlinear System Identification, Springer 2010,
   doi:10.1007/978-1-84996-513-2.
.. [2] M. Jelali, Estimation of valve stiction in control loops using separable least-squares and
   global search algorithms, Journal of Process Control 18 (2008) 632-642.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, TypeAlias

import numpy as np

from ..arrays import ComplexArray, FloatArray, IntArray
from ..engine.poles import poles_from_parameters
from ..engine.responses import SampledInput
from .kinds import Acting
from .records import ActuatedRecord

_Case: TypeAlias = tuple[Acting, float]

_AT_ONCE = 1e-9  # samples by which a move and a sample may be apart and be at one time
_DECAYED = -60.0  # exponent of what has decayed: 1e-26


@dataclass(frozen=True, eq=False)
class _Events:
    """Jumps and changes of slope of K positions, (K, E) or (1, E), at times in s."""

    times: FloatArray
    jumps: FloatArray
    slopes: FloatArray


def forced_responses(
    record: ActuatedRecord,
    actings: Sequence[Acting],
    dead_times: FloatArray,
    theta: FloatArray,
    starts: FloatArray,
    zeros: int = 0,
) -> FloatArray:
    """Responses of unit gain of K models at every bin, and their time derivatives.

    Parameters
    ----------
    record : ActuatedRecord
    actings : sequence of Acting
        K actuators of one kind at one place.
    dead_times : ndarray, shape (K,)
        In s.
    theta : ndarray, shape (K, n)
        Parameters of the poles, see `poles_from_parameters`.
    starts : ndarray, shape (K,)
        Where the actuator is within play or friction at first, -1...1.
    zeros : {0, 1}
        Whether the derivatives are wanted.

    Returns
    -------
    ndarray, shape (1 + zeros, K, M)
    """
    poles = poles_from_parameters(theta)[0]
    each = list(zip(actings, starts.tolist(), strict=True))
    if actings[0].place == "input":
        if record.listed:
            return _summed(_positions(record, each), record.time, dead_times, poles, zeros)
        sampled = _once(lambda one: _sampled(record, *one), each)
        return _filtered(record, sampled, dead_times, poles, zeros)
    # Models with other actuators behind the same lags have one demand.
    lags = [(wait, *row.tolist()) for wait, row in zip(dead_times.tolist(), theta, strict=True)]
    first = [lags.index(one) for one in dict.fromkeys(lags)]
    own = [lags[k] for k in first]
    dead_times, poles = dead_times[first], poles[first]
    if record.listed:
        events = _positions(record, [(Acting("none", "input"), 0.0)])
        demands = _summed(events, record.time, dead_times, poles, zeros)
    else:
        demands = _filtered(record, [record.command] * len(first), dead_times, poles, zeros)
    found = demands[:, [own.index(one) for one in lags]]
    for (acting, start), demand in zip(each, found[0], strict=True):
        # Of a static actuator it matters where the stem is, not how far it went.
        level = record.command[0] if acting.form.static else 0.0
        demand[:] = _moved(acting, demand + level, record.time, start)
    return found


def _once(function: Callable[[_Case], FloatArray], cases: Sequence[_Case]) -> list[FloatArray]:
    """Results for all cases, of which many are the same."""
    known = {case: function(case) for case in dict.fromkeys(cases)}
    return [known[case] for case in cases]


def _moved(acting: Acting, demand: FloatArray, time: FloatArray, start: float) -> FloatArray:
    """Position for a demand (M,) at times that need not be equally spaced."""
    position = acting.form.position
    if position is None:
        return _slewed(demand, time, *_rates(acting))
    return position(acting, demand, start)


def _rates(acting: Acting) -> tuple[float, float]:
    """Highest rates upwards and downwards."""
    return acting.values[0], acting.values[-1]


def _slewed(demand: FloatArray, time: FloatArray, up: float, down: float) -> FloatArray:
    """Follow a demand at no more than a rate. Exact while one of them alone decides."""
    change, since = np.diff(demand, prepend=demand[0]), np.diff(time, prepend=time[0])
    too_fast = np.flatnonzero((change > up * since) | (change < -down * since))
    out, rises, falls = demand.tolist(), (up * since).tolist(), (-down * since).tolist()
    k = 0  # caught up with the demand, until it is too fast again
    for first in too_fast.tolist():
        if first <= k:
            continue
        k, current = first, out[first - 1]
        while k < len(out):
            away = out[k] - current
            if falls[k] <= away <= rises[k]:
                break
            current += rises[k] if away > 0 else falls[k]
            out[k] = current
            k += 1
    return np.array(out)


def _positions(record: ActuatedRecord, cases: Sequence[_Case]) -> _Events:
    """Positions for a command that is a list of moves."""
    form = cases[0][0].form
    if form.position is None:
        ramps = np.stack(_once(lambda one: _ramps(record, *_rates(one[0])), cases))
        return _Events(ramps[:, 0], np.zeros_like(ramps[:, 0]), ramps[:, 1])
    position = form.position
    held, index = record.held
    positions = np.stack(_once(lambda one: position(one[0], held, one[1]), cases))
    jumps = np.diff(positions, prepend=positions[:, :1])
    moving = jumps.any(axis=0)
    jumps = jumps[:, moving]
    return _Events(record.dt * index[None, moving].astype(np.float64), jumps, np.zeros_like(jumps))


def _ramps(record: ActuatedRecord, up: float, down: float) -> FloatArray:
    """Ramps from level to level; a new one may begin before the last has ended.

    Times in s and changes of the slope (2, E).
    """
    times = (record.dt * record.moves.astype(np.float64)).tolist()
    levels = record.command[record.moves].tolist()
    current, found = float(record.command[0]), []
    for i, (at, level) in enumerate(zip(times, levels, strict=True)):
        following = times[i + 1] if i + 1 < len(times) else np.inf
        slope = up if level >= current else -down
        end = min(at + (level - current) / slope, following)
        found += [(at, slope), (end, -slope)]
        current = level if end < following else current + slope * (end - at)
    return np.array(found, dtype=np.float64).reshape(-1, 2).T


def _sampled(record: ActuatedRecord, acting: Acting, start: float) -> FloatArray:
    """Position for any command: its mean over every sample, over which it is held."""
    position = acting.form.position
    if position is not None:
        return position(acting, record.command, start)
    up, down = (rate * record.dt for rate in _rates(acting))
    current, out = float(record.command[0]), []
    for wanted in record.command.tolist():
        away = wanted - current
        most = up if away > 0 else down
        if abs(away) > most:
            move = most if away > 0 else -most
            out.append(current + move / 2)
            current += move
        else:
            out.append(wanted - away * abs(away) / (2 * most))
            current = wanted
    return np.array(out)


def _residues(poles: ComplexArray) -> ComplexArray:
    """Step responses of unit gain: 1 + sum_j residue_j exp(pole_j t); all are (K, n)."""
    gap = poles[:, :, None] - poles[:, None]
    gap[:, np.arange(poles.shape[1]), np.arange(poles.shape[1])] = 1.0
    return np.asarray(np.prod(-poles, axis=1, keepdims=True) / (poles * gap.prod(axis=2)))


def _summed(
    events: _Events, time: FloatArray, dead_times: FloatArray, poles: ComplexArray, zeros: int
) -> FloatArray:
    """Sum the responses to all events; exact for jumps and ramps.

    Between two events each mode is one exponential, which is carried from event to event.
    """
    count = dead_times.size
    if not events.times.size:
        return np.zeros((1 + zeros, count, time.size))
    residues: Any = _residues(poles)
    rates: Any = poles
    if not poles.imag.any():
        rates, residues = poles.real, residues.real
    gaps = np.diff(events.times)
    weights = residues[:, None] * (
        events.jumps[..., None] + events.slopes[..., None] / rates[:, None]
    )
    carried = np.ascontiguousarray(weights.transpose(1, 0, 2))
    decays = np.exp(gaps.T[..., None] * rates)
    for last, here, decay in zip(carried, carried[1:], decays, strict=False):
        here += last * decay
    arrivals = events.times + dead_times[:, None]
    passed = _passed(arrivals, time)
    before, row = np.maximum(passed - 1, 0), np.arange(count)[:, None]
    since = np.where(passed > 0, time - arrivals[row, before], 0.0)
    found = _real_waves(since, rates, carried[before, row], zeros)
    slopes = np.cumsum(events.slopes, axis=1)
    level = np.cumsum(events.jumps, axis=1)
    level[:, 1:] += np.cumsum(slopes[:, :-1] * gaps, axis=1)
    bent = (residues / rates).sum(axis=1, keepdims=True).real
    of_row = row if len(level) == count else 0
    found[0] += level[of_row, before]
    if slopes.any():
        found[0] += slopes[of_row, before] * (since - bent)
        found[1:] += slopes[of_row, before]
    return np.where(passed > 0, found, 0.0)


def _passed(arrivals: FloatArray, time: FloatArray) -> IntArray:
    """How many of the arrivals (K, E) are before every time: (K, M)."""
    found: list[IntArray] = []
    for k, own in enumerate(arrivals):
        same = k > 0 and np.array_equal(own, arrivals[k - 1])
        here = np.searchsorted(own * (1 + _AT_ONCE), time, side="left")
        found.append(found[-1] if same else here)
    return np.stack(found)


def _real_waves(since: FloatArray, rates: Any, weights: Any, zeros: int) -> FloatArray:
    """Sums of weights (K, M, n) times exponentials over the n modes, and their derivatives."""
    found = np.zeros((1 + zeros, *since.shape))
    for j in range(rates.shape[1]):
        rate, weight = rates[:, j, None], weights[..., j]
        # What has decayed is cut: denormal numbers take time.
        size = np.exp(np.maximum(since * rate.real, _DECAYED))
        if not rate.imag.any():
            wave = size * weight.real
            found[0] += wave
            found[1:] += rate.real * wave
            continue
        size *= 1 + np.sign(rate.imag)  # a pole below the axis is counted with its conjugate
        if not size.any():
            continue
        angle = since * rate.imag
        cosine, sine = size * np.cos(angle), size * np.sin(angle)
        wave = cosine * weight.real - sine * weight.imag
        found[0] += wave
        if zeros:
            turned = sine * weight.real + cosine * weight.imag
            found[1] += rate.real * wave - rate.imag * turned
    return found


def _filtered(
    record: ActuatedRecord,
    positions: Sequence[FloatArray],
    dead_times: FloatArray,
    poles: ComplexArray,
    zeros: int,
) -> FloatArray:
    """Responses to positions that are held over every sample."""
    residues = _residues(poles)
    found = []
    for k, position in enumerate(positions):
        drive = SampledInput(position - position[0], record.dt)
        static, mode, _ = drive.modes(dead_times[k : k + 1], poles[k : k + 1])
        own = [static[0] + _real_product(mode[0], residues[k])]
        if zeros:
            own.append(_real_product(mode[0], residues[k] * poles[k]))
        found.append([record.averaged(one[record.rows]) for one in own])
    return np.array(found).transpose(1, 0, 2)


def _real_product(mode: Any, weights: ComplexArray) -> FloatArray:
    """Real part of modes (M, n) times weights (n,); complex products take ten times as long."""
    found = np.ascontiguousarray(mode.real) @ weights.real
    if np.iscomplexobj(mode):
        found -= np.ascontiguousarray(mode.imag) @ weights.imag
    return np.asarray(found)
