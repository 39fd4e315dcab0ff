"""Worlds that the model describes: every flag that doubts it is needless."""

from __future__ import annotations

import numpy as np
from scipy.signal import cont2discrete, dlsim

from .simulation import (
    Case,
    H,
    binary,
    coloured,
    drawn,
    held,
    late,
    levels,
    noisy,
    record,
    sampled,
    step,
    stepped,
)
from .steps import up_and_down

Rng = np.random.Generator


def one_lag(rng: Rng) -> Case:
    """One lag, one step."""
    plant, u = drawn(rng, ((0.2, 0.5),)), step()
    return plant.case(record(u, noisy(rng, stepped(rng, plant, u))))


def two_lags(rng: Rng) -> Case:
    """Two lags, one step."""
    plant, u = drawn(rng), step()
    return plant.case(record(u, noisy(rng, stepped(rng, plant, u), 0.002)))


def three_lags(rng: Rng) -> Case:
    """Three lags, one step, little noise."""
    plant, u = drawn(rng, ((0.05, 0.1), (0.15, 0.25), (0.3, 0.5))), step()
    return plant.case(record(u, noisy(rng, stepped(rng, plant, u), 0.001)))


def resonance(rng: Rng) -> Case:
    """A pair of damping 0.3, one step."""
    dead, w, zeta = float(rng.uniform(0.1, 0.3)), float(rng.uniform(5, 10)), 0.3
    dead, u = round(dead / H) * H, step()
    A, B, C, D, _ = cont2discrete(
        (np.array([[0, 1], [-(w**2), -2 * zeta * w]]), np.array([[0], [w**2]]), np.eye(1, 2), 0), H
    )
    y = dlsim((A, B, C, D, H), late(held(u), dead))[1].ravel()
    return Case(record(u, noisy(rng, sampled(y))), dead, 1.0, dead + 2 * zeta / w)


def slow_noise(rng: Rng) -> Case:
    """Two lags, one step, AR(1) noise with a pole at 0.9."""
    plant, u = drawn(rng), step()
    y = stepped(rng, plant, u)
    return plant.case(record(u, y + 0.005 * np.ptp(y) * coloured(rng, u.size, 0.9)))


def several_steps(rng: Rng) -> Case:
    """Two lags, steps up and down."""
    plant, u = drawn(rng), up_and_down((1.0, 0.0, 0.5, 1.0))
    return plant.case(record(u, noisy(rng, stepped(rng, plant, u))))


def random_levels(rng: Rng) -> Case:
    """Two lags, random levels."""
    plant, u = drawn(rng), levels(rng, (-1.0, 0.0, 1.0))
    return plant.case(record(u, noisy(rng, stepped(rng, plant, u), 0.02)))


def random_binary(rng: Rng) -> Case:
    """Two lags, a random binary signal."""
    plant, u = drawn(rng), binary(rng)
    return plant.case(record(u, noisy(rng, stepped(rng, plant, u), 0.01)))


def binary_in_slow_noise(rng: Rng) -> Case:
    """One lag, a random binary signal, AR(1) noise with a pole at 0.9."""
    plant, u = drawn(rng, ((0.2, 0.5),)), binary(rng, hold=25)
    y = stepped(rng, plant, u)
    return plant.case(record(u, y + 0.01 * np.ptp(y) * coloured(rng, u.size, 0.9)))


def fine_converter(rng: Rng) -> Case:
    """Two lags, one step, a converter of 500 steps over the range."""
    plant, u = drawn(rng), step()
    y = noisy(rng, stepped(rng, plant, u), 0.002)
    return plant.case(record(u, np.round(y / np.ptp(y) * 500) / 500 * np.ptp(y)))


WORLDS = (
    one_lag,
    two_lags,
    three_lags,
    resonance,
    slow_noise,
    several_steps,
    random_levels,
    random_binary,
    binary_in_slow_noise,
    fine_converter,
)
