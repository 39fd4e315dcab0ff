"""Responses of modes to a delayed, held input, against the sums that define them."""

from __future__ import annotations

import numpy as np
import pytest

from ctrl_realize.numerics.separable.responses import MoveTrain, SampledInput, SeveralInputs

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


def close(found, expected):
    # products of a few exponentials; those of a bin are means of up to forty
    np.testing.assert_allclose(found, expected, rtol=1e-12, atol=1e-12)


def train(first, width, moves, sizes, dt=0.1):
    first = dt * np.asarray(first, dtype=float)
    return MoveTrain(first, np.asarray(width), dt, np.array(moves), np.array(sizes))


@pytest.mark.parametrize("poles", [POLES, np.array([[-0.4 + 0j, -3.0], [-1.1, -0.02]])])
def test_a_mode_is_the_sum_over_the_moves_that_have_arrived(poles):
    moves, sizes = [0.35, 0.4, 2.0, 2.71], [1.0, -0.5, 2.0, 0.3]
    tau = np.array([0.0, 1.234])
    found = train(range(60), [1] * 60, moves, sizes).modes(tau, poles)
    for row in range(2):
        expected = by_definition(0.1 * np.arange(60), moves, sizes, tau[row], poles[row])
        for one, values in zip(found, expected, strict=True):
            close(one[row], values)
    # all three are there before the first arrival, as nothing
    assert not any(one[1, :16].any() for one in found)


@pytest.mark.parametrize("widest", [2, 40])
@pytest.mark.parametrize("poles", [POLES, np.array([[-0.4 + 0j, -3.0], [-1.1, -1e-9]])])
def test_means_over_bins_are_those_of_their_samples(poles, widest):
    moves, sizes = [0.35, 0.4, 2.0, 2.71], [1.0, -0.5, 2.0, 0.3]
    tau = np.array([0.0, 1.234])
    width = np.array([1, 2, 1, 7, 7, 20, 2, 40] if widest == 40 else [1, 1] + [2] * 39)
    first = np.concatenate([[0], np.cumsum(width)[:-1]])
    found = train(first, width, moves, sizes).modes(tau, poles)
    for row in range(2):
        samples = by_definition(0.1 * np.arange(80), moves, sizes, tau[row], poles[row])
        for one, values in zip(found, samples, strict=True):
            sums = np.add.reduceat(values, first, axis=0)
            means = (sums.T / width).T
            # a pole of 1e-9: a series to the second order, a ten-millionth of it
            np.testing.assert_allclose(one[row], means, rtol=1e-8, atol=1e-12)


@pytest.mark.parametrize("count", [5, 100])
@pytest.mark.parametrize("rate", [0.99e-4, 1.01e-4, 1e-6, 0.3])
def test_the_mean_of_a_slow_mode_is_as_right_as_that_of_a_fast_one(rate, count):
    pole = -rate / count / 0.1
    _, mode, slope = train([1], [count], [0.0], [1.0]).modes(
        np.array([0.0]), np.array([[pole + 0j]])
    )
    time = 0.1 * np.arange(1, 1 + count)
    # the next term of the series is (1e-4)^2 / 6; above, rounding is divided by 1e-4
    assert mode[0, 0, 0] == pytest.approx(np.exp(pole * time).mean(), rel=3e-9)
    assert slope[0, 0, 0] == pytest.approx((time * np.exp(pole * time)).mean(), rel=1e-8)


def test_several_records_stand_one_after_the_other_without_their_first_samples():
    rng = np.random.default_rng(1)
    parts = tuple(SampledInput(rng.standard_normal(n), 0.1) for n in (7, 5, 9))
    tau = np.array([0.12, 0.2])
    found = SeveralInputs(parts, (2, 0, 3)).modes(tau, POLES)
    alone = [part.modes(tau, POLES) for part in parts]
    for i, one in enumerate(found):
        assert one.shape[1] == 5 + 5 + 6
        pieces = [alone[0][i][:, 2:], alone[1][i], alone[2][i][:, 3:]]
        assert np.array_equal(one, np.concatenate(pieces, axis=1))
