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

from dataclasses import dataclass
from typing import Any

import numpy as np

from ..arrays import ComplexArray, FloatArray
from ..separable.poles import poles_from_parameters
from ..separable.responses import SampledInput
from .kinds import Acting
from .records import ActuatedRecord

_AT_ONCE = 1e-9  # samples by which a move and a sample may be apart and be at one time
_DECAYED = -60.0  # exponent of what has decayed: 1e-26


@dataclass(frozen=True, eq=False)
class _Events:
    """Jumps and changes of slope of a position, at times in s."""

    times: FloatArray
    jumps: FloatArray
    slopes: FloatArray


def forced_response(
    record: ActuatedRecord, acting: Acting, dead_time: float, theta: FloatArray, start: float
) -> tuple[FloatArray, FloatArray]:
    """Response of unit gain at every bin (M,), and its time derivative.

    Parameters
    ----------
    record : ActuatedRecord
    acting : Acting
    dead_time : float
        In s.
    theta : ndarray, shape (n,)
        Parameters of the poles, see `poles_from_parameters`.
    start : float
        Where the actuator is within play or friction at first, -1...1.
    """
    poles = poles_from_parameters(theta[None])[0][0]
    if acting.place == "input":
        if record.listed:
            return _summed(_positions(record, acting, start), record.time, dead_time, poles)
        return _filtered(record, _sampled(record, acting, start), dead_time, poles)
    rest = Acting("none", "input")
    if record.listed:
        events = _positions(record, rest, 0.0)
        demand, slope = _summed(events, record.time, dead_time, poles)
    else:
        demand, slope = _filtered(record, record.command, dead_time, poles)
    if acting.form.static:
        demand = demand + record.command[0]  # where the stem is, not how far it went
    return _moved(acting, demand, record.time, start), slope


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
    since = np.diff(time, prepend=time[0]).tolist()
    current, out = float(demand[0]), []
    for wanted, dt in zip(demand.tolist(), since, strict=True):
        away, rise, fall = wanted - current, up * dt, down * dt
        current = current + rise if away > rise else current - fall if away < -fall else wanted
        out.append(current)
    return np.array(out)


def _positions(record: ActuatedRecord, acting: Acting, start: float) -> _Events:
    """Position for a command that is a list of moves."""
    form = acting.form
    if form.position is None:
        return _ramps(record, *_rates(acting))
    held, index = record.held
    times = record.dt * index.astype(np.float64)
    position = form.position(acting, held, start)
    jumps = np.diff(position, prepend=position[0])
    moving = jumps != 0
    return _Events(times[moving], jumps[moving], np.zeros(int(moving.sum())))


def _ramps(record: ActuatedRecord, up: float, down: float) -> _Events:
    """Ramps from level to level; a new one may begin before the last has ended."""
    times = (record.dt * record.moves.astype(np.float64)).tolist()
    levels = record.command[record.moves].tolist()
    current, found = float(record.command[0]), []
    for i, (at, level) in enumerate(zip(times, levels, strict=True)):
        following = times[i + 1] if i + 1 < len(times) else np.inf
        slope = up if level >= current else -down
        end = min(at + (level - current) / slope, following)
        found += [(at, slope), (end, -slope)]
        current = level if end < following else current + slope * (end - at)
    moments, slopes = np.array(found, dtype=np.float64).reshape(-1, 2).T
    return _Events(moments, np.zeros(moments.size), slopes)


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
    """Step response of unit gain: 1 + sum_j residue_j exp(pole_j t)."""
    gap = poles[:, None] - poles[None]
    np.fill_diagonal(gap, 1.0)
    return np.asarray(np.prod(-poles) / (poles * gap.prod(axis=1)))


def _summed(
    events: _Events, time: FloatArray, dead_time: float, poles: ComplexArray
) -> tuple[FloatArray, FloatArray]:
    """Sum the responses to all events; exact for jumps and ramps.

    Between two events each mode is one exponential, which is carried from event to event.
    """
    if not events.times.size:
        return np.zeros(time.size), np.zeros(time.size)
    residues: Any = _residues(poles)
    rates: Any = poles
    if not poles.imag.any():
        rates, residues = poles.real, residues.real
    arrivals = events.times + dead_time
    weights = residues * (events.jumps[:, None] + events.slopes[:, None] / rates)
    decays = np.exp(np.diff(events.times)[:, None] * rates)
    carried = [weights[0]]
    for decay, weight in zip(decays, weights[1:], strict=True):
        carried.append(carried[-1] * decay + weight)
    here = np.searchsorted(arrivals * (1 + _AT_ONCE), time, side="left")
    before = np.maximum(here - 1, 0)
    since = np.where(here > 0, time - arrivals[before], 0.0)
    response, slope = _real_waves(since, rates, np.array(carried)[before])
    slopes = np.cumsum(events.slopes)
    level = np.cumsum(events.jumps)
    level[1:] += np.cumsum(slopes[:-1] * np.diff(events.times))
    bent = float(np.sum(residues / rates).real)
    response += level[before] + slopes[before] * (since - bent)
    slope += slopes[before]
    return np.where(here > 0, response, 0.0), np.where(here > 0, slope, 0.0)


def _real_waves(since: FloatArray, rates: Any, weights: Any) -> tuple[FloatArray, FloatArray]:
    """Sum of weights (M, n) times exponentials over the n modes, and its derivative."""
    total, slope = np.zeros((2, since.size))
    for rate, weight in zip(rates.tolist(), weights.T, strict=True):
        if rate.imag < 0:
            continue  # counted with its conjugate
        # What has decayed is cut: denormal numbers take time.
        size = np.exp(np.maximum(since * rate.real, _DECAYED))
        if not rate.imag:
            wave = size * weight.real
            total += wave
            slope += rate.real * wave
            continue
        angle = since * rate.imag
        cosine, sine = 2 * size * np.cos(angle), 2 * size * np.sin(angle)
        wave = cosine * weight.real - sine * weight.imag
        total += wave
        turned = sine * weight.real + cosine * weight.imag
        slope += rate.real * wave - rate.imag * turned
    return total, slope


def _filtered(
    record: ActuatedRecord, position: FloatArray, dead_time: float, poles: ComplexArray
) -> tuple[FloatArray, FloatArray]:
    """Response to a position that is held over every sample."""
    drive = SampledInput(position - position[0], record.dt)
    static, mode, _ = drive.modes(np.array([dead_time]), poles[None])
    residues = _residues(poles)
    response = static[0] + _real_product(mode[0], residues)
    slope = _real_product(mode[0], residues * poles)
    rows = record.rows
    return record.averaged(response[rows]), record.averaged(slope[rows])


def _real_product(mode: Any, weights: ComplexArray) -> FloatArray:
    """Real part of modes (M, n) times weights (n,); complex products take ten times as long."""
    found = np.ascontiguousarray(mode.real) @ weights.real
    if np.iscomplexobj(mode):
        found -= np.ascontiguousarray(mode.imag) @ weights.imag
    return np.asarray(found)
