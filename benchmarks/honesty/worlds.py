"""Simulated plants in the worlds that estimators meet: noise of three kinds, wrong structures."""

from __future__ import annotations

from dataclasses import dataclass

import control as ct
import numpy as np
from scipy.signal import lfilter
from scipy.special import gammainc, ndtr

import ctrl_realize as cr
from ctrl_realize.numerics.actuators.limits import slew_limited
from tests import rigs

DT = rigs.TS
BEFORE, AFTER = 600, 1000
COLOUR = 0.9
"""Pole of the coloured noise: 19 of its samples tell as much as one that is white."""
BITS = 8
NOISES = (0.001, 0.005, 0.01, 0.02)
KINDS = ("white", "coloured", "quantised", "wrong structure")
PLANTS = {"R1": rigs.R1, "R2": rigs.R2, "R3": rigs.R3, "R4": rigs.R4}
WRONG = (
    "eight equal lags",
    "diffusion",
    "dispersion",
    "slew limit",
    "static friction",
    "quadratic sensor",
)
MORE_WRONG = ("narrow dispersion", "two paths")
"""Plants of wrong structure that only the single fits meet."""


@dataclass(frozen=True, eq=False)
class StepCase:
    """A record with what is true of it; the delay in samples.

    Of a stem that sticks, the delay lasts until it is pulled loose: no step of one height tells
    the two parts of that apart.
    """

    record: cr.Record
    delay: float
    plant: str
    gain: float = 1.0


def noise_of(kind: str, size: int, rng: np.random.Generator) -> np.ndarray:
    """Draw noise of unit variance, white or coloured."""
    white = rng.standard_normal(size + 200)
    if kind == "coloured":
        return lfilter([np.sqrt(1 - COLOUR**2)], [1, -COLOUR], white)[200:]
    return white[200:]


def rounded(values: np.ndarray, span: float) -> np.ndarray:
    """Pass values through a converter of 8 bits over 1.25 times their span."""
    quantum = 1.25 * span / 2**BITS
    return np.round(values / quantum) * quantum


def step_case(
    kind: str,
    plant: str,
    noise: float,
    seed: int,
    *,
    delay: float | None = None,
    before: int = BEFORE,
    after: int = AFTER,
    amplitude: float | None = None,
) -> StepCase:
    """Simulate a step at any delay in 30 to 45 samples, gain and offset.

    Parameters
    ----------
    kind : str
        One of `KINDS`.
    plant : str
        One of `PLANTS`, or of `WRONG` and `MORE_WRONG` where the kind is "wrong structure".
    noise : float
        Standard deviation as a part of the step.
    """
    rng = np.random.default_rng([seed, KINDS.index(kind)])
    drawn = float(rng.uniform(30, 45))
    at = drawn if delay is None else delay
    height = float(rng.choice([-3.0, 0.2, 16.0])) if amplitude is None else amplitude
    gain = float(rng.choice([0.3, 1.0, 20.0]))
    k = np.arange(before + after)
    after_edge = (k - before - at) * DT
    if plant == "static friction":
        at += _pull_loose()
    shape = (unit_step if plant in PLANTS else wrong_step)(plant, after_edge)
    y = shape + noise * noise_of(kind, k.size, rng)
    y = gain * height * y + 10 * rng.normal() * gain
    if kind == "quantised":
        y = rounded(y, gain * abs(height))
    u = 4.0 + height * (k >= before)
    return StepCase(cr.Record(k * DT, u, y, name="simulated"), at, plant, gain)


def unit_step(plant: str, time: np.ndarray) -> np.ndarray:
    return rigs.exact_step(PLANTS[plant], time)


def wrong_step(name: str, time: np.ndarray) -> np.ndarray:
    """Unit step response of a plant that no model of the toolbox describes."""
    after = np.clip(time, 0, None)
    if name == "eight equal lags":
        return gammainc(8, after * 2 * np.pi * 10.0)
    if name == "diffusion":
        return _diffusion(after)
    if name == "dispersion":
        return _dispersion(after)
    if name == "narrow dispersion":
        return _dispersion(after, shape=0.4)
    if name == "two paths":
        return 0.3 * unit_step("R2", time) + 0.7 * unit_step("R2", time - 40 * DT)
    if name == "slew limit":
        return slew_limited(unit_step("R3", time), 4.0, 4.0, DT)
    if name == "static friction":
        return _stick_and_slip(time)
    bent = unit_step("R3", time)
    return (bent + 0.15 * bent**2) / 1.15


def _diffusion(after: np.ndarray) -> np.ndarray:
    """Step of 1/cosh(sqrt(s T)), heat through a wall; slowest pole at 2.2 Hz."""
    odd = 2 * np.arange(60) + 1
    slowest = 2 * np.pi * 2.2
    sign = np.where(odd % 4 == 1, 1.0, -1.0)
    terms = sign / odd * np.exp(-slowest * np.outer(after, odd**2))
    return np.where(after > 0, 1 - 4 / np.pi * terms.sum(axis=1), 0.0)


def _dispersion(after: np.ndarray, mean: float = 0.08, shape: float = 0.08) -> np.ndarray:
    """Step of a flow that disperses on its way: inverse Gaussian residence times, in s."""
    time = np.maximum(after, 1e-6)
    root = np.sqrt(shape / time)
    late = np.exp(2 * shape / mean) * ndtr(-root * (time / mean + 1))
    return np.where(after > 1e-6, ndtr(root * (time / mean - 1)) + late, 0.0)


STATIC, SLIDING = 0.06, 0.03
"""Parts of the step: how far the demand is away when the stem comes loose, and while it moves."""


def _pull_loose() -> float:
    """Samples until the demand pulls the stem loose."""
    time = np.arange(0, 200, 0.01)
    return float(time[np.argmax(unit_step("R2", time * DT) > STATIC)])


def _stick_and_slip(time: np.ndarray) -> np.ndarray:
    """Unit step behind a stem that R2's demand pulls loose; behind it a sensor lag of 30 Hz.

    From then on the stem follows the demand, which rises all the time, at a constant distance: a
    step and two modes that begin late, whose responses through the lag are known exactly.
    """
    loose, sensor = DT * _pull_loose(), 2 * np.pi * 30
    since = np.clip(time - loose, 0, None)
    fast = np.exp(-sensor * since)
    poles = PLANTS["R2"].poles().real
    a, b = poles
    y = (1 - SLIDING) * (1 - fast)
    for pole, residue in ((a, b / (a - b)), (b, a / (b - a))):
        size = residue * np.exp(pole * loose) * sensor / (sensor + pole)
        y += size * (np.exp(pole * since) - fast)
    return y / (1 - SLIDING)


@dataclass(frozen=True, eq=False)
class DrivenCase:
    """A record with an input that moves all the time, its plant and its clean output."""

    record: cr.Record
    delay: float
    plant: cr.DelayedStateSpace


DRIVEN_DT = 0.01


def driven_case(
    kind: str,
    noise: float,
    seed: int,
    *,
    samples: int = 1500,
    delay: float | None = None,
    held: int = 12,
    core: ct.TransferFunction | None = None,
    signal: np.ndarray | None = None,
) -> DrivenCase:
    """Simulate a plant behind random levels that are held for `held` samples.

    `noise` is a part of the output's span. The plant of a wrong structure has a sensor with a
    quadratic term; its linear part is what is true.
    """
    rng = np.random.default_rng([seed, 10 + KINDS.index(kind)])
    drawn = float(rng.uniform(5, 12))
    at = drawn if delay is None else delay
    lags = core if core is not None else rigs.lag(0.8) * rigs.lag(4.0)
    plant = cr.delayed_ss(lags, dead_time=at * DRIVEN_DT, dt=DRIVEN_DT)
    levels = rng.choice([-1.0, 0.0, 1.0, 2.0], samples // held + 1)
    u = np.repeat(levels, held)[:samples] if signal is None else signal
    clean = np.ravel(plant.simulate(u))
    span = float(np.ptp(clean)) or 1.0
    y = clean + (0.1 * clean**2 if kind == "wrong structure" else 0.0)
    y = 3.0 + y + noise * span * noise_of(kind, u.size, rng)
    if kind == "quantised":
        y = rounded(y, span)
    time = DRIVEN_DT * np.arange(u.size)
    return DrivenCase(cr.Record(time, u, y, name="simulated"), at, plant)
