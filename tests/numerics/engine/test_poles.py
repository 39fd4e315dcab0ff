"""Poles and their derivatives, structures made of them, responses of their modes."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

from ctrl_realize.numerics.constants import VERY_STRONG
from ctrl_realize.numerics.engine.modal import parameters_from_poles, poles_from_parameters
from ctrl_realize.numerics.engine.problem import Structure
from ctrl_realize.numerics.engine.responses import StepSequence
from ctrl_realize.numerics.engine.structures import (
    Candidate,
    choose,
    needless_parameters,
    plausible,
)


def ordered(poles):
    return np.array(sorted(poles, key=lambda p: (round(abs(p), 9), p.imag)))


SETS = [
    [-3.0],
    [-1.0, -4.0],
    [-2.0, -1.0, -5.0],
    [-9.0, -1.0, -5.0, -2.0],
    [-3 + 4j, -3 - 4j],
    [-3 + 4j, -3 - 4j, -2.0],
    [-1.0, -6 + 1j, -6 - 1j, -2.0, -0.1 + 30j, -0.1 - 30j],
]


@pytest.mark.parametrize("poles", SETS)
@pytest.mark.parametrize("unit", [1e-6, 1.0, 1e6])
def test_poles_come_back_in_any_unit_of_time(poles, unit):
    poles = unit * np.array(poles, dtype=complex)
    theta = parameters_from_poles(poles)
    assert theta.shape == (poles.size,)
    back = poles_from_parameters(theta[np.newaxis])[0][0]
    assert_allclose(ordered(back / unit), ordered(poles / unit), rtol=1e-9)


def candidate(n: int, r: int, cost: float = 1.0, poles: object = None) -> Candidate:
    at = -np.arange(1.0, n + 1) if poles is None else np.asarray(poles)
    found = np.concatenate([[1.5], parameters_from_poles(at.astype(np.complex128))])
    return Candidate(Structure(n, r), found, cost)


def test_zeros_and_a_fourth_pole_must_be_worth_it():
    assert [needless_parameters(Structure(n, r)) for n, r in ((3, 3), (3, 1), (4, 4), (5, 4))] == [
        0, 12, 4, 14,
    ]  # fmt: skip
    simple, zero, fourth = Structure(3, 3), Structure(3, 2), Structure(4, 4)
    assert choose({simple: 100.0, zero: 94.5, fourth: 96.5}) == simple
    assert choose({simple: 100.0, zero: 93.5, fourth: 96.5}) == zero
    assert choose({simple: 100.0, zero: 94.5, fourth: 95.5}) == fourth


def test_what_is_near_the_best_is_plausible_and_so_are_lags_that_fit_no_worse():
    chosen = candidate(3, 2, 100.0)
    shapes = [(3, 2), (1, 1), (2, 2), (2, 1), (4, 4), (5, 5)]
    all_of = {Structure(n, r): candidate(n, r, 1000.0) for n, r in shapes}
    all_of[chosen.structure] = chosen
    all_of[Structure(2, 2)] = candidate(2, 2, 100.0 + VERY_STRONG * 0.5)
    all_of[Structure(4, 4)] = candidate(4, 4, 50.0)
    values = dict(zip(all_of, [60.0, 900.0, 900.0, 69.0, 900.0, 71.0], strict=True))
    left = plausible(all_of, values, 0.5, chosen, 60.0)
    # itself; lags within 10 variances; within 10 of the best. Not: more, or four lags that fit
    assert set(left) == {chosen.structure, Structure(2, 2), Structure(2, 1)}
    # a chosen one whose simplicity counts: others have theirs counted as well
    assert Structure(5, 5) not in plausible(all_of, values, 0.5, chosen, 68.0)
    assert Structure(5, 5) in plausible(all_of, values, 0.5, chosen, 70.0)


POLES = np.array([[-0.4 + 0j, -0.3 + 2j, -0.3 - 2j], [-1.1 + 0j, -0.2 + 0.1j, -0.2 - 0.1j]])


def by_definition(time, moves, sizes, tau, poles):
    """H, E and T at times (m,), summed over the moves that have arrived."""
    since = time[:, None] - moves - tau
    arrived = since > 0
    waves = np.exp(poles * np.where(arrived, since, 0.0)[:, :, None])
    sizes = np.where(arrived, sizes, 0.0)
    return (
        sizes.sum(axis=1),
        np.einsum("ml,mlj->mj", sizes, waves),
        np.einsum("ml,ml,mlj->mj", sizes, since, waves),
    )


@pytest.mark.parametrize("widest", [1, 2, 40])
@pytest.mark.parametrize("poles", [POLES, np.array([[-0.4 + 0j, -3.0], [-1.1, -1e-9]])])
def test_a_mode_is_the_sum_over_the_moves_that_have_arrived_or_its_mean_over_a_bin(poles, widest):
    moves, sizes = np.array([0.35, 0.4, 2.0, 2.71]), np.array([1.0, -0.5, 2.0, 0.3])
    tau = np.array([0.0, 1.234])
    width = np.array({1: [1] * 80, 2: [1, 1] + [2] * 39, 40: [1, 2, 1, 7, 7, 20, 2, 40]}[widest])
    first = np.concatenate([[0], np.cumsum(width)[:-1]])
    found = StepSequence(0.1 * first, width, 0.1, moves, sizes).modes(tau, poles)
    for row in range(2):
        samples = by_definition(0.1 * np.arange(80), moves, sizes, tau[row], poles[row])
        for one, values in zip(found, samples, strict=True):
            means = (np.add.reduceat(values, first, axis=0).T / width).T
            # products of a few exponentials; of a bin and a pole of 1e-9 a series to the second
            # order, a ten-millionth of it
            assert_allclose(one[row], means, rtol=1e-12 if widest == 1 else 1e-8, atol=1e-12)
    # all three are there before the first arrival, as nothing
    assert not any(one[1, first + width <= 16].any() for one in found)
