"""Simulated responses that are timed: a third-order valve behind 37 samples, and long ones."""

from __future__ import annotations

import control as ct
import numpy as np
from scipy.signal import lfilter

import ctrl_realize as cr
from ctrl_realize.identification.step.impulse import impulse_from_step
from ctrl_realize.identification.step.steps import unit_step
from ctrl_realize.numerics.state_space.responses import markov

TS = 7.8125e-4
SAMPLES = 1000
MAX_DELAY = 100
DELAYS = MAX_DELAY + 1


def valve() -> ct.TransferFunction:
    """2.2 Hz lag with an 8 Hz pair of damping 0.7."""
    slow, fast = 2 * np.pi * 2.2, 2 * np.pi * 8.0
    return ct.tf([slow], [1, slow]) * ct.tf([fast**2], [1, 1.4 * fast, fast**2])


def record(seed: int, noise: float) -> cr.Record:
    """Step of 16 after 3 s of rest."""
    model = cr.delayed_ss(valve(), 37, dt=TS)
    step = np.r_[np.zeros(3840), model.step(2600)]
    output = 16 * (step + noise * np.random.default_rng(seed).standard_normal(step.size))
    return cr.Record(TS * np.arange(step.size), 16.0 * (np.arange(step.size) >= 3840), output)


def pulse(kind: str, seed: int = 1) -> cr.ImpulseResponse:
    """Impulse response of a record with 0.2 % noise, differentiated and filtered as named."""
    step = unit_step(record(seed, 0.0 if kind == "clean" else 2e-3))
    settings = {
        "clean": {"cutoff_hz": None},
        "unfiltered": {"cutoff_hz": None, "difference": "central"},
        "zero-phase": {"cutoff_hz": 50.0, "difference": "central"},
        "causal": {"cutoff_hz": 50.0, "difference": "central", "zero_phase": False},
    }[kind]
    return impulse_from_step(step, **settings)


def long_pulse(n: int, order: int, noise: float = 1e-4) -> np.ndarray:
    """Response of any length with a clear gap behind `order` singular values."""
    rng = np.random.default_rng(order)
    k = np.arange(n)
    total = np.zeros(n)
    modes = order // 2
    for i in range(modes):
        total += 0.97**k * np.cos(np.pi * (i + 1) / (modes + 1.5) * k)
    if order % 2:
        total += 0.97**k
    return total + noise * rng.standard_normal(n)


def channels(p: int, m: int, n: int, order: int, noise: float) -> np.ndarray:
    """Markov parameters (p, m, n + 1) of a plant of `order`, with noise."""
    rng = np.random.default_rng(order)
    A = np.zeros((order, order))
    for i in range(0, order, 2):
        size, angle = rng.uniform(0.9, 0.98), rng.uniform(0.01, 0.6)
        A[i, i] = A[i + 1, i + 1] = size * np.cos(angle)
        A[i, i + 1], A[i + 1, i] = -size * np.sin(angle), size * np.sin(angle)
    B, C = rng.standard_normal((order, m)), rng.standard_normal((p, order))
    return markov(A, B, C, np.zeros((p, m)), n + 1) + noise * rng.standard_normal((p, m, n + 1))


LONG_RECORDS = (
    "one step",
    "five steps",
    "a step in coloured noise",
    "a step with outliers",
    "a step into a coarse converter",
    "a ramp",
    "a step into an integrator",
    "a pulse into an integrator",
    "binary noise",
    "binary noise after a rest",
    "binary noise in coloured noise",
    "binary noise and a random walk",
    "a multisine",
    "a sweep",
    "a controller that follows set-points",
)


def long_record(kind: str, samples: int) -> cr.Record:
    """A lag of 20 samples behind 12.37 of 0.01 s, noise of 5 %, and one of `LONG_RECORDS`."""
    rng = np.random.default_rng(1)
    noise = 0.05 * rng.standard_normal(samples)
    # a step response behind a hold, the fraction of the sample included
    pole, part = np.exp(-1 / 20), np.exp(-0.63 / 20)
    pulse = np.concatenate([np.zeros(13), [1 - part, part - pole]])
    if kind == "a controller that follows set-points":
        u, y = _in_a_loop(pulse, pole, _long_input("set-points", samples, rng), noise)
        return cr.Record(0.01 * np.arange(samples), u, y)
    u = _long_input(kind, samples, rng)
    y = lfilter(pulse, [1.0, -pole], u - u[0]) + u[0]
    if "integrator" in kind:
        y = 0.01 * np.cumsum(y)
    if "in coloured noise" in kind:
        noise = lfilter([np.sqrt(1 - 0.95**2)], [1, -0.95], noise)
    elif "random walk" in kind:
        noise += 0.01 * np.cumsum(rng.standard_normal(samples))
    elif "outliers" in kind:
        noise[rng.integers(0, samples, samples // 1000)] += 5
    y = y + noise
    if "coarse converter" in kind:
        y = np.round(y, 1)
    return cr.Record(0.01 * np.arange(samples), u, y)


def _long_input(kind: str, samples: int, rng: np.random.Generator) -> np.ndarray:
    k = np.arange(samples)
    if kind.startswith("a step") or kind == "one step":
        return np.where(k < samples // 10, 0.0, 1.0)
    if kind.startswith("a pulse"):
        return np.where((k >= samples // 10) & (k < samples // 10 + samples // 100), 1.0, 0.0)
    if kind == "a ramp":
        return np.clip((k - samples // 10) / 2000, 0.0, 1.0)
    if kind == "five steps":
        return np.repeat([0.0, 1.0, 0.3, 1.2, -0.5], -(-samples // 5))[:samples]
    if kind == "a multisine":
        waves = zip((1, 2, 5, 10, 20, 40, 80), rng.uniform(0, 2 * np.pi, 7), strict=True)
        return np.sum([np.sin(2e-4 * np.pi * f * k + phase) for f, phase in waves], axis=0)
    if kind == "a sweep":
        return np.sin(np.pi * 0.05 * k**2 / samples)
    held = 1000 if kind == "set-points" else 20
    u = np.repeat(rng.choice([-1.0, 1.0], -(-samples // held)), held)[:samples]
    if kind == "binary noise after a rest":
        u[: samples // 10] = 0.0
    return u


def _in_a_loop(
    pulse: np.ndarray, pole: float, target: np.ndarray, noise: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Hold a plant by a gain of 0.5; what the dead time brings is known a dead time ahead."""
    late = int(np.flatnonzero(pulse)[0])
    u, y, state = np.zeros(target.size), np.zeros(target.size), np.zeros(1)
    before = 0.0
    for first in range(0, target.size, late):
        now = slice(first, first + late)
        past = u[max(first - late, 0) : first] if first else np.zeros(late)
        move = pulse[late] * past + pulse[late + 1] * np.r_[before, past[:-1]]
        answer, state = lfilter([1.0], [1.0, -pole], move[: y[now].size], zi=state)
        before = float(past[-1])
        y[now] = answer + noise[now]
        u[now] = 0.5 * (target[now] - y[now])
    return u, y
