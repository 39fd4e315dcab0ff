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


LONG_RECORDS = ("one step", "five steps", "binary noise", "binary noise after a rest")


def long_record(kind: str, samples: int) -> cr.Record:
    """A lag of 20 samples behind 12.37, noise of 5 %, and one of `LONG_RECORDS` as input."""
    rng = np.random.default_rng(1)
    if kind == "one step":
        u = np.repeat([0.0, 1.0], [samples // 10, samples - samples // 10])
    elif kind == "five steps":
        u = np.repeat([0.0, 1.0, 0.3, 1.2, -0.5], -(-samples // 5))[:samples]
    else:
        u = np.repeat(rng.choice([-1.0, 1.0], -(-samples // 20)), 20)[:samples]
        if kind == "binary noise after a rest":
            u[: samples // 10] = 0.0
    # 0.01 s: the lag behind a hold, the fraction of the sample included
    pole, part = np.exp(-1 / 20), np.exp(-0.63 / 20)
    pulse = np.concatenate([np.zeros(13), [1 - part, part - pole]])
    y = lfilter(pulse, [1.0, -pole], u - u[0]) + u[0] + 0.05 * rng.standard_normal(samples)
    return cr.Record(0.01 * np.arange(samples), u, y)
