"""What the sums of a tracker say, from sums that are written by hand."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from ctrl_realize.identification.tracker_solution import (
    LinearisedBank,
    _fraction,
    _interval,
    _no_choice,
    _no_reply,
    _too_far,
    solve,
)
from ctrl_realize.numerics.recursive import BankSolution

SPEED, DAMPING = ("speed", 0.5 + 0j, 0.1 + 0j), ("damping", 0.5 + 0.1j, 0.1 + 0j)


class Bank:
    """Three candidates from 10 samples on, whose misfit is least in the middle."""

    low, high = 10, 12
    weight = weight_squared = 100.0

    def __init__(self, moves=(), gain=2.0, misfit=(9.0, 1.0, 5.0), **other):
        q = 1 + len(moves)
        theta = np.array([gain, *(gain * np.asarray(moves))])
        self.answer = {
            "theta": np.stack([theta + 1, theta, theta + 2]),
            "misfit": np.array(misfit),
            "offset": np.array([5.0, 7.0, 6.0]),
            "inverse": np.stack([k * np.diag(np.arange(1.0, q + 1) ** 2) for k in (3.0, 1.0, 2.0)]),
            "power": 400.0,
            "weight": self.weight,
            **other,
        }

    def solve(self, prior, precision):
        self.asked = prior, precision
        return BankSolution(**self.answer)


def solved(bank, directions=(), moved=(), variance=0.5, inflation=1.0):
    now = LinearisedBank(bank, SimpleNamespace(), list(directions), np.array(moved))
    return solve(now, variance, inflation)


def test_the_best_candidate_is_told():
    found = solved(Bank())
    assert (found.delay, found.gain, found.offset) == (11, 2.0, 7.0)
    # the parabola through 9, 1, 5 is lowest at (9 - 5) / (2 (9 - 2 + 5))
    assert found.place == pytest.approx(11 + 4 / 24, rel=1e-12)
    assert (found.sees_reply, found.reason) == (True, "")
    assert found.moves.size == 0


def test_the_prior_is_a_gain_of_one_and_poles_at_rest_within_a_third():
    bank = Bank(moves=(0.1, 0.0))
    solved(bank, (SPEED, DAMPING), (0.0, 0.0), variance=0.45)
    prior, precision = bank.asked
    assert_array_equal(prior, [1.0, 0.0, 0.0])
    assert_allclose(precision, [0.45, 5.0, 5.0], rtol=1e-12)  # 0.45 / 0.3^2


@pytest.mark.parametrize(("moves", "free"), [((), 98), ((0.1,), 97)])
def test_samples_of_the_same_weight_give_the_unbiased_variance(moves, free):
    # 100 samples less the parameters and the offset
    found = solved(Bank(moves), [SPEED] * len(moves), np.zeros(len(moves)))
    assert found.variance == pytest.approx(1.0 / free, rel=1e-12)
    deviations = [found.gain_std, *(found.gain * found.move_std)]
    assert_allclose(deviations, np.sqrt(1.0 / free) * np.arange(1, len(moves) + 2), rtol=1e-12)


def test_weights_that_fall_count_as_fewer_samples():
    bank = Bank()
    bank.weight_squared = 200.0  # as 50 samples of weight 2
    assert solved(bank).variance == pytest.approx(0.01 * (1 + 2 / 48), rel=1e-12)
    bank.weight_squared = 5000.0  # as two samples, of which nothing is free: one is taken
    assert solved(bank).variance == pytest.approx(0.01 * (1 + 2 / 1), rel=1e-12)


def test_a_correlated_residual_widens_what_is_said_and_not_the_variance():
    plain, slow = solved(Bank()), solved(Bank(), inflation=100.0)
    assert slow.variance == plain.variance
    assert slow.gain_std == pytest.approx(10 * plain.gain_std, rel=1e-12)
    # excess 8, 0, 4 over a hundred variances of 1/98: chances 0.020, 1, 0.141
    assert (plain.interval, slow.interval) == ((11, 11), (11, 12))


def test_exact_data_are_known_to_what_sums_can_resolve():
    found = solved(Bank(misfit=(9.0, 0.0, 5.0)))
    assert found.variance == 0.0
    # a power of 400 in 14 digits
    assert found.gain_std == pytest.approx(np.sqrt(1e-14 * 400), rel=1e-12)
    silent = solved(Bank(misfit=(0.0, 0.0, 0.0), power=0.0))
    assert silent.gain_std == pytest.approx(1e-150, rel=1e-12)
    assert not silent.sees_reply


def test_gain_and_moves_without_a_gain_are_not_known():
    found = solved(Bank(moves=(0.1,), gain=0.0), [SPEED], [0.2])
    assert_array_equal(found.moves, [0.0])
    assert_array_equal(found.move_std, [np.inf])
    assert found.speed_ratios == (pytest.approx(np.exp(0.2)),)
    assert found.reason == "the output does not follow the input"


def test_moves_are_parts_of_the_gain_also_where_it_is_negative():
    found = solved(Bank(moves=(0.1, -0.2), gain=-2.0), (DAMPING, SPEED), (0.5, 0.25))
    assert_allclose(found.moves, [0.1, -0.2], rtol=1e-12)
    assert np.all(found.move_std > 0)
    # the speed alone, since the starting model
    assert found.speed_ratios == (pytest.approx(np.exp(0.25 - 0.2), rel=1e-12),)


def test_a_speed_is_shown_up_to_e_squared_of_the_present_one():
    for move, shown in ((5.0, 2.0), (-5.0, -2.0)):
        found = solved(Bank(moves=(move,)), [SPEED], [0.0])
        assert found.speed_ratios == (pytest.approx(np.exp(shown), rel=1e-12),)


def test_only_speeds_can_be_too_far():
    assert "too far" in solved(Bank(moves=(0.4,)), [SPEED], [0.0]).reason
    assert solved(Bank(moves=(0.4,)), [DAMPING], [0.0]).reason == ""


def test_what_is_missing_first_is_named_first():
    # neither a reply, nor one delay, nor a pole that is near
    everything = Bank(moves=(0.4,), misfit=(399.9, 399.8, 399.9))
    assert "nothing moved" in solved(everything, [SPEED], [0.0]).reason
    found = solved(Bank(moves=(0.4,), misfit=(1.0, 2.0, 5.0)), [SPEED], [0.0])
    assert (found.delay, found.place) == (10, 10.0)
    assert found.reason == "the best delay is min_delay=10; try a smaller one"
    assert found.sees_reply


def test_an_interval_holds_95_of_100_parts_of_the_chances():
    def interval(*parts):
        # the misfit of a chance under noise of variance 0.3
        return _interval(-2 * 0.3 * np.log(np.array(parts)), 0.3, 5)

    assert interval(0.02, 0.02, 0.92, 0.02, 0.02) == (6, 8)
    assert interval(0.02, 0.96, 0.02) == (6, 6)
    assert interval(0.03, 0.94, 0.03) == (5, 7)
    assert interval(1.0) == (5, 5)
    # a misfit far beyond the noise overflows nowhere
    assert _interval(np.array([1e300, 0.0, 1e300]), 1e-200, 0) == (1, 1)


@pytest.mark.parametrize("vertex", [-0.4, 0.0, 0.3])
def test_the_fraction_is_where_a_parabola_is_lowest(vertex):
    misfit = np.array([9.0, *(3 + 2 * (np.array([-1.0, 0.0, 1.0]) - vertex) ** 2), 9.0])
    for unit in (1.0, 1e-20):
        assert _fraction(unit * misfit, 2) == pytest.approx(vertex, abs=1e-12)


def test_there_is_no_fraction_at_the_ends_and_on_a_plain():
    assert _fraction(np.array([1.0, 2.0, 4.0]), 0) == 0.0
    assert _fraction(np.array([4.0, 2.0, 1.0]), 2) == 0.0
    assert _fraction(np.array([4.0, 1.0, 2.0]), 1) != 0.0
    assert _fraction(np.ones(3), 1) == 0.0
    # two that are equal: half way
    assert _fraction(np.array([1.0, 1.0, 3.0]), 1) == -0.5


def test_a_reply_stands_four_sigma_out_of_the_noise_with_a_gain_of_three():
    assert _no_reply(15.9, 1.0, 0.1).startswith("nothing moved")
    assert _no_reply(16.1, 1.0, 0.1) == ""
    assert _no_reply(100.0, 0.29, 0.1) == "the output does not follow the input"
    for gain in (0.31, -0.31):
        assert _no_reply(100.0, gain, 0.1) == ""


def test_one_delay_stands_out_unless_it_is_at_an_end_or_half_of_all_fit():
    assert "max_delay=20" in _no_choice(20, (20, 20), (4, 20))
    assert "min_delay=4" in _no_choice(4, (4, 4), (4, 20))
    assert _no_choice(0, (0, 1), (0, 20)) == ""  # no delay is no end
    assert _no_choice(9, (6, 14), (4, 20)) == ""
    assert _no_choice(9, (6, 15), (4, 20)) == "any delay from 6 to 15 samples fits"


def test_poles_may_move_by_a_third_to_either_side():
    assert _too_far(np.array([])) == ""
    assert _too_far(np.array([0.3, -0.3])) == ""
    assert "moved by +49 %" in _too_far(np.array([0.1, 0.4]))  # e^0.4 - 1
    assert "moved by -33 %" in _too_far(np.array([-0.4, 0.1]))  # e^-0.4 - 1
