"""The search for order and delays, with criteria that are written by hand instead of fits."""

from __future__ import annotations

import control as ct
import numpy as np
import pytest
from numpy.testing import assert_allclose

import ctrl_realize as cr
from ctrl_realize.errors import DataError, OrderError
from ctrl_realize.identification.channel_search import (
    Candidate,
    Search,
    experiments,
)


def centred(values):
    return np.asarray(values, dtype=float) - np.mean(values)


def ramps(samples=10, start=0.0):
    """Inputs k and 10 k, outputs 100 + k and 5 k^2."""
    k = np.arange(float(samples))
    return cr.Record(k + start, np.stack([k, 10 * k]), np.stack([100 + k, 5 * k**2]))


def test_signals_are_aligned_by_their_delays():
    (found,) = experiments([ramps()], ((2, 0), (0, 3)))
    # from sample 2 on the first input is that of 0, the second that of 2
    assert_allclose(found.v, [centred(range(8)), centred(10 * np.arange(2, 10))], atol=1e-13)
    # means are those of the whole record; what an output still shows of the past is not there
    assert_allclose(found.y[0], np.arange(2, 10) - 4.5, atol=1e-13)
    later = 5 * np.arange(5, 10.0) ** 2 - np.mean(5 * np.arange(10.0) ** 2)
    assert_allclose(found.y[1], [*later, np.nan, np.nan, np.nan], atol=1e-12)


def test_only_as_many_samples_as_asked_for_are_taken_of_all_records_together():
    shares = ((0, 0), (0, 0))
    found = experiments([ramps(), ramps(20)], shares, 13)
    assert [one.v.shape[1] for one in found] == [10, 3]
    assert_allclose(found[1].y[0], [-1.0, 0.0, 1.0], atol=1e-13)
    assert [one.v.shape[1] for one in experiments([ramps(), ramps(20)], shares)] == [10, 20]
    # one sample is not enough, and none are left for the others
    assert len(experiments([ramps(), ramps(20)], shares, 11)) == 1
    assert len(experiments([ramps(), ramps(20)], shares, 12)) == 2


def test_records_shorter_than_the_delays_are_left_out():
    shares = ((9, 0), (0, 0))
    found = experiments([ramps(10), ramps(11), ramps(12)], shares)
    assert [one.v.shape[1] for one in found] == [2, 3]
    with pytest.raises(DataError, match="longer than the delays, 9 samples"):
        experiments([ramps(10)], shares)


def candidate(order=1, inputs=(0,), outputs=(0,), direct=False, bic=0.0):
    return Candidate(None, order, inputs, outputs, direct, bic)


class ByHand(Search):
    """Criteria by a function of order, inputs, outputs and direct term; None: no such rank."""

    def __init__(self, bic, samples=40, channels=(1, 1)):
        self._bic = bic
        self._markov = np.zeros((*channels, samples))
        self.asked, self.starts = [], []

    def fit(self, order, shares, *, direct, start=None):
        self.asked.append((order, *shares, direct))
        self.starts.append(start)
        bic = self._bic(order, *shares, direct)
        if bic is None:
            raise OrderError("rank")
        return candidate(order, *shares, direct, bic)


def test_rising_orders_are_tried_until_three_were_no_better():
    table = {1: 9.0, 2: 5.0, 3: 6.0, 4: 5.0, 5: 7.0, 6: 0.0}
    search = ByHand(lambda order, *_: table[order])
    fits = search.by_order(list(table), ((2,), (1,)), direct=True)
    assert [c.order for c in fits] == [1, 2, 3, 4, 5]
    assert search.asked[0] == (1, (2,), (1,), True)
    table[4] = 4.0
    assert len(search.by_order(list(table), ((0,), (0,)), direct=False)) == 6


def test_orders_above_the_rank_end_the_search():
    search = ByHand(lambda order, *_: 1.0 if order < 3 else None)
    assert [c.order for c in search.by_order([1, 2, 3, 4], ((0,), (0,)), direct=False)] == [1, 2]
    with pytest.raises(OrderError, match="rank below 3"):
        search.by_order([3, 4], ((0,), (0,)), direct=False)


def test_delays_move_while_that_is_better():
    def valley(order, inputs, outputs, direct):
        return abs(inputs[0] - 7) + abs(outputs[0] - 4) + abs(outputs[1] - 1) - 0.5 * direct

    search = ByHand(valley, channels=(2, 1))
    start = search.fit(2, ((5,), (0, 0)), direct=False)
    found = search.improved(start, delays=True, direct=False)
    assert (found.inputs, found.outputs, found.direct, found.bic) == ((7,), (4, 1), False, 0.0)
    assert {asked[0] for asked in search.asked} == {2}
    with_term = search.improved(start, delays=True, direct=True)
    assert (with_term.inputs, with_term.outputs, with_term.direct) == ((7,), (4, 1), True)
    held = search.improved(start, delays=False, direct=True)
    assert (held.inputs, held.outputs, held.direct) == ((5,), (0, 0), True)
    assert search.improved(start, delays=False, direct=False) is start


def test_a_search_of_delays_stays_in_the_first_half_of_the_response():
    search = ByHand(lambda order, inputs, outputs, direct: -inputs[0], samples=40)
    found = search.improved(search.fit(1, ((5,), (2,)), direct=False), delays=True, direct=False)
    assert (found.inputs, found.outputs) == ((17,), (2,))  # 19 of 40 samples
    level = ByHand(lambda *_: 1.0)
    start = level.fit(1, ((5,), (2,)), direct=False)
    assert level.improved(start, delays=True, direct=True) is start  # as good is not better


def test_a_lower_order_of_one_channel_finds_its_own_delay():
    def traded(order, inputs, outputs, direct):
        best = {4: 3, 3: 5, 2: 8}
        return None if order == 1 else (inputs[0] - best[order]) ** 2 + order - 0.5 * direct

    search = ByHand(traded)
    begun = search.fit(4, ((3,), (0,)), direct=False)
    found = search.lowered(begun, [1, 2, 3, 4], delays=True)
    assert (found.order, found.inputs, found.direct, found.bic) == (2, (8,), False, 2.0)
    assert search.lowered(begun, [1, 2, 3, 4], delays=False) is begun
    two = ByHand(traded, channels=(2, 1))
    assert two.lowered(begun, [1, 2, 3, 4], delays=True) is begun


def test_dead_times_that_the_data_do_not_rule_out_are_plausible():
    def valley(order, inputs, outputs, direct):
        return 1000.0 if direct else 100.0 + 4.0 * (inputs[0] - 9) ** 2

    search = ByHand(valley)
    best = search.fit(2, ((9,), (1,)), direct=False)
    # 4 and 16 at one and two samples, of which up to 10 is not ruled out
    assert search.plausible(best, 1.0) == (9, 12.0)
    # each fit starts from the one before
    assert [start.inputs[0] for start in search.starts[1:]] == [9, 8, 7, 9, 10, 11]
    assert {asked[:1] + asked[2:] for asked in search.asked} == {(2, (1,), False)}
    # two that are ruled out in a row end the search
    assert {asked[1][0] for asked in search.asked} == {6, 7, 8, 9, 10, 11, 12}
    # when four samples of the residual count as one: 16 / 4 and 36 / 4
    assert search.plausible(best, 4.0) == (7, 14.0)


def test_one_delay_that_is_ruled_out_is_passed_over_and_a_direct_term_counts():
    def valley(order, inputs, outputs, direct):
        if direct:
            return {12: 0.0, 14: 10.0}.get(inputs[0], 50.0)
        return {12: 9.0}.get(inputs[0], 50.0)

    search = ByHand(valley)
    best = search.fit(2, ((12,), (0,)), direct=True)
    assert search.plausible(best, 1.0) == (11.0, 14.0)
    assert any(not asked[3] for asked in search.asked)
    # without direct term nothing is plausible but the start, whose own term is kept
    plain = candidate(2, (12,), (0,), False, 9.0)
    assert search.plausible(plain, 1.0) == (12, 13.0)
    # a delay is neither negative nor beyond half of the response
    flat = ByHand(lambda *_: 0.0, samples=40)
    assert flat.plausible(candidate(2, (3,), (0,)), 1.0) == (0, 16.0)  # 12 samples further
    assert flat.plausible(candidate(2, (15,), (0,)), 1.0) == (3, 20.0)  # 19 < 40 // 2


def search_of(u, samples=400, outputs=1):
    rng = np.random.default_rng(0)
    record = cr.Record(np.arange(float(samples)), u, rng.standard_normal((outputs, samples)))
    return Search([record], np.ones((outputs, np.atleast_2d(u).shape[0], 30)), 4)


def test_orders_are_those_that_records_can_tell():
    rng = np.random.default_rng(1)
    rich = search_of(rng.standard_normal((2, 400)), outputs=3)
    # 1200 values, three for each of 6 + 5 n parameters
    assert rich.highest == (400 - 6) // 5
    assert rich.orders(None) == (1, 2, 3, 4, 5, 6, 8, 10, 12, 16, 20)
    assert rich.orders([3, 78]) == (3, 78)
    with pytest.raises(DataError, match="400 samples are too few for a model of order 79"):
        rich.orders([3, 79])
    # a sine has two directions: lags of an order 1, and no more
    sine = search_of(np.sin(0.3 * np.arange(400.0)))
    assert sine.orders(None) == (1,)
    with pytest.raises(DataError, match=r"does not excite enough .* for a model of order 2"):
        sine.orders([1, 2])


def test_two_short_records_excite_what_one_does_not():
    k = np.arange(400.0)
    group = [cr.Record(k, np.sin(f * k), np.cos(f * k)) for f in (0.3, 0.7)]
    markov = np.ones((1, 1, 30))
    assert Search(group, markov, 4).orders(None) == (1, 2, 3)
    assert Search(group[:1], markov, 4).orders(None) == (1,)


def test_a_search_starts_from_the_scaled_response_behind_the_delays():
    A, C = np.diag([0.8, 0.5]), [[1.0, 1.0], [1.0, -1.0]]
    core = ct.ss(A, [[1.0], [1.0]], C, np.zeros((2, 1)), 1.0)
    plant = cr.DelayedStateSpace(core, (3,), output_delay=(0, 2))
    u = np.random.default_rng(2).standard_normal(300)
    scale = np.array([1.0, 1e-6])
    record = cr.Record(np.arange(300.0), u, plant.simulate(u) * scale[:, None])
    markov = plant.markov(240) * scale[:, None, None]
    search = Search([record], markov, 4)
    found = search._kung(2, ((3,), (0, 2)))
    A, B, C, D = found.matrices()
    assert_allclose(np.sort(np.linalg.eigvals(A).real), [0.5, 0.8], rtol=0, atol=1e-9)
    response = cr.DelayedStateSpace(ct.ss(A, B, C, D, 1.0), (3,), output_delay=(0, 2)).markov(60)
    assert_allclose(response / scale[:, None, None], plant.markov(60), rtol=0, atol=1e-9)
    with pytest.raises(OrderError, match="order=3 is above the rank"):
        search._kung(3, ((3,), (0, 2)))


@pytest.mark.parametrize("direct", [False, True])
def test_the_criterion_counts_parameters_and_samples_the_last_fit_sees_all(direct):
    core = ct.ss(np.diag([0.8, 0.5]), [[1.0], [1.0]], [[1.0, 1.0], [1.0, -1.0]], 0.0, 1.0)
    plant = cr.DelayedStateSpace(core, (3,), output_delay=(0, 2))
    rng = np.random.default_rng(3)
    u = rng.standard_normal(300)
    y = plant.simulate(u) + 0.1 * rng.standard_normal((2, 300))
    search = Search([cr.Record(np.arange(300.0), u, y)], plant.markov(240), 4, enough=120)
    shares = (3,), (0, 2)
    found = search.fit(2, shares, direct=direct)
    assert (found.order, found.inputs, found.outputs) == (2, *shares)
    assert found.direct is direct
    assert np.any(found.found.model.D) == direct
    # the first 3 of 120 samples are lost, and the last 2 of the second output
    assert found.found.counts.tolist() == [117, 115]
    parameters = 2 * 3 + (2 if direct else 0)
    expected = 2 * found.found.loss * 120 / (232 / 2) + parameters * np.log(120)
    assert found.bic == pytest.approx(expected, rel=1e-12)
    last = search.finish(found)
    assert last.found.counts.tolist() == [297, 295]
    assert (last.order, last.inputs, last.bic) == (2, (3,), found.bic)
    assert np.any(last.found.model.D) == direct


def test_sizes_of_signals_are_those_about_the_level_of_each_record():
    u = np.random.default_rng(0).standard_normal(50)
    k = np.arange(50.0)
    group = [cr.Record(k, u + level, 2 * u - level) for level in (0.0, 100.0)]
    search = Search(group, np.ones((1, 1, 30)), 4)
    assert_allclose([search._size_in[0], search._size_out[0]], [u.std(), 2 * u.std()], rtol=1e-12)


def test_six_samples_tell_no_order_and_a_short_response_few():
    k = np.arange(6.0)
    few = cr.Record(k, [1.0, -1.0, 1.0, 1.0, -1.0, 1.0], k)
    with pytest.raises(DataError, match="6 samples are too few for a model of order 1"):
        Search([few], np.ones((1, 1, 30)), 4).orders([1])
    u = np.random.default_rng(0).standard_normal(100)
    short = Search([cr.Record(np.arange(100.0), u, u)], 0.5 ** np.arange(6.0)[None, None], 20)
    # five parameters behind the direct term
    assert short._kung(5, ((0,), (0,))).matrices()[0].shape == (5, 5)
    with pytest.raises(OrderError, match="order=6"):
        short._kung(6, ((0,), (0,)))
