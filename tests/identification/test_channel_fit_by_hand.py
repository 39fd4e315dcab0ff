"""What a fit of several channels makes of its arguments and of its searches, without fits."""

from __future__ import annotations

import warnings
from types import SimpleNamespace

import control as ct
import numpy as np
import pytest

import ctrl_realize as cr
from ctrl_realize.errors import DataError, DataWarning, OptionError, OrderError
from ctrl_realize.identification import channel_fit as module
from ctrl_realize.identification.channel_fit import (
    LEVEL,
    Outcome,
    _check_signals,
    _from_start,
    _orders,
    _silence,
    _split,
    from_starts,
)
from ctrl_realize.identification.channel_search import ORDERS, Candidate

K = np.arange(60.0)
U = np.random.default_rng(0).choice([-1.0, 1.0], (2, 60))
RECORD = cr.Record(K, U, np.stack([U[0] + U[1], U[0] - U[1]]))


def candidate(order, bic, inputs=(0, 0), outputs=(0, 0), direct=False):
    found = SimpleNamespace(
        spread=np.array([9.0, 9.0]),
        variance=np.array([1.0, 1.0]),
        counts=np.array([60.0, 60.0]),
        model=SimpleNamespace(D=np.zeros((2, 2))),
    )
    return Candidate(found, order, inputs, outputs, direct, bic)


@pytest.fixture
def searched(monkeypatch):
    """A search that is by hand: two orders, of which the second one is better."""
    seen = SimpleNamespace(
        calls=[],
        flags=(),
        warning=None,
        fits=[candidate(2, 30.0), candidate(3, 10.0)],
        moved=candidate(3, 5.0, (2, 1)),
        lowered=candidate(3, 5.0, (2, 1)),
    )
    markov = np.ones((2, 2, 40))

    class Search:
        highest = 3

        def __init__(self, group, markov, top, enough):
            seen.calls.append(("search", group, markov.shape, top, enough))

        def orders(self, asked):
            seen.calls.append(("orders", asked))
            return asked or (1, 2, 3)

        def by_order(self, orders, shares, *, direct):
            seen.calls.append(("by order", orders, shares, direct))
            return seen.fits

        def improved(self, best, *, delays, direct):
            seen.calls.append(("improved", best, delays, direct))
            return seen.moved

        def lowered(self, best, orders, *, delays):
            seen.calls.append(("lowered", best, orders, delays))
            return seen.lowered

        def finish(self, best):
            seen.calls.append(("finish", best))
            return ("finished", best)

    def impulse_from_io(group, *, method, start):
        seen.calls.append(("impulse", group, method, start))
        warnings.warn("filled in by the prior", DataWarning, stacklevel=2)
        if seen.warning:
            warnings.warn("of another kind", seen.warning, stacklevel=2)
        one = group[0].n_inputs == 1
        return SimpleNamespace(markov=markov[0, 0] if one else markov, flags=seen.flags)

    def channel_delays(impulse, *, level):
        seen.calls.append(("delays", level))
        return np.array([[1]]) if impulse.markov.ndim == 1 else np.array([[1, 0], [3, -1]])

    monkeypatch.setattr(module, "Search", Search)
    monkeypatch.setattr(module, "impulse_from_io", impulse_from_io)
    monkeypatch.setattr(module, "channel_delays", channel_delays)
    monkeypatch.setattr(module, "fitted_system", lambda *given: given)
    return seen


def begun(asked=None, delays=None, feedthrough=None, way=("rest", "okid")):
    return _from_start((RECORD,), way, asked, delays, feedthrough, 77)


def called(seen, name):
    return [call[1:] for call in seen.calls if call[0] == name]


def test_a_start_goes_from_the_impulse_response_to_delays_orders_and_the_last_fit(searched):
    found = begun()
    assert called(searched, "impulse") == [((RECORD,), "okid", "rest")]
    assert called(searched, "search") == [((RECORD,), (2, 2, 40), max(ORDERS), 77)]
    assert called(searched, "orders") == [(None,)]
    assert called(searched, "delays") == [(LEVEL,)]
    # 1 and 3 in the first column: the second output is two later, the first input one
    shares = (1, 0), (0, 2)
    assert called(searched, "by order") == [((1, 2, 3), shares, True)]
    assert called(searched, "improved") == [(searched.fits[1], True, True)]
    assert called(searched, "lowered") == [(searched.moved, (1, 2, 3), True)]
    assert called(searched, "finish") == [(searched.lowered,)]
    assert (found.bic, found.seen, found.best) == (5.0, True, searched.lowered)
    assert found.search.highest == 3
    finished, group, bic, choices, flags = found.system
    assert finished == ("finished", searched.lowered)
    assert group == (RECORD,)
    # of the order that was moved the last value counts
    assert bic == {2: 30.0, 3: 5.0}
    assert choices[0] == "order 3 has the least BIC; others: 2 (+25)"
    assert choices[1].startswith("delays where the responses set in, (1, 0) and (0, 2)")
    assert flags == ()


def test_what_is_given_is_not_searched(searched):
    begun((2,), [[1, 0], [3, 2]], False)
    assert called(searched, "search")[0][2] == 2
    assert called(searched, "orders") == [((2,),)]
    assert called(searched, "delays") == []
    assert called(searched, "by order") == [((2,), ((1, 0), (0, 2)), False)]
    assert called(searched, "improved") == [(searched.fits[1], False, False)]
    # one order has no lower one
    assert called(searched, "lowered") == []
    searched.calls.clear()
    begun((2, 3), [[1, 0], [3, 2]], True)
    assert called(searched, "by order")[0][2] is True
    assert called(searched, "improved") == [(searched.fits[1], False, False)]
    assert called(searched, "lowered") == [(searched.moved, (2, 3), False)]


def test_the_highest_order_that_was_tried_is_flagged_where_it_is_the_best(searched):
    def codes(asked):
        return [flag.code for flag in begun(asked).system[4]]

    assert codes((2, 3)) == ["highest_order"]
    assert "order that was tried, 3, is" in str(begun((2, 3)).system[4][0])
    assert codes((2, 3, 4)) == []
    # one order was asked for, and is the answer
    assert codes((3,)) == []
    searched.fits[1] = candidate(max(ORDERS), 10.0)
    assert codes(None) == ["highest_order"]


def test_outputs_that_the_impulse_response_does_not_show_are_told(searched):
    silent = SimpleNamespace(code="no_response")
    searched.flags = (silent, SimpleNamespace(code="prior"))
    assert begun().seen is False
    searched.flags = (silent, silent)
    with pytest.raises(DataError, match="no output shows a response"):
        begun()
    searched.flags = (SimpleNamespace(code="prior"),) * 2
    assert begun().seen is True


def test_an_output_that_is_not_explained_is_flagged_by_the_fit(searched):
    searched.lowered.found.spread[1] = 1.001
    flags = begun().system[4]
    assert [str(flag)[:8] for flag in flags] == ["output 1"]
    assert flags == _silence(searched.lowered)


def test_flags_of_the_order_and_of_outputs_stand_beside_each_other(searched):
    searched.lowered.found.spread[1] = 1.001
    assert [flag.code for flag in begun((2, 3)).system[4]] == ["no_response", "highest_order"]


@pytest.mark.parametrize("unit", [1e-3, 50.0])
def test_whether_an_output_is_explained_does_not_depend_on_its_unit(unit):
    best = candidate(3, 0.0)
    best.found.spread[1] = 1.001
    flags = [str(flag) for flag in _silence(best)]
    best.found.spread *= unit
    best.found.variance *= unit
    assert [str(flag) for flag in _silence(best)] == flags
    assert len(flags) == 1


def test_one_channel_is_a_matrix_of_one(searched):
    one = cr.Record(K, U[0], U[1])
    searched.lowered = searched.moved = candidate(3, 5.0, (1,), (0,))
    _from_start((one,), ("rest", "okid"), None, None, None, 77)
    assert called(searched, "search")[0][1] == (1, 1, 40)
    assert called(searched, "by order")[0][1] in (((1,), (0,)), ((0,), (1,)))


def test_warnings_of_another_kind_are_given(searched):
    searched.warning = RuntimeWarning
    with pytest.warns(RuntimeWarning, match="of another kind"):
        begun()


# --- which starts


def test_starts_are_given_what_was_asked_for(monkeypatch):
    calls = []

    def from_start(*given):
        calls.append(given)
        checks = [SimpleNamespace(independent=True)]
        return Outcome(1.0, SimpleNamespace(fit=SimpleNamespace(checks=checks)), True, None, None)

    monkeypatch.setattr(module, "_from_start", from_start)
    from_starts((RECORD,), (2, 3), "delays", "feedthrough", enough=77)
    assert calls == [((RECORD,), ("unknown", "auto"), (2, 3), "delays", "feedthrough", 77)]
    # inputs that stand still, each at its level, are at rest
    still = U.copy()
    still[:, :10] = [[0.0], [3.0]]
    from_starts((cr.Record(K, still, RECORD.output),))
    assert calls[1][1] == ("rest", "auto")
    assert calls[1][2:] == (None, None, None, module.ENOUGH_SAMPLES)


# --- refine


@pytest.fixture
def refined(monkeypatch):
    seen = SimpleNamespace()

    def experiments(group, shares):
        seen.group, seen.shares = group, shares
        return "data"

    def fit_sections(data, start, *, direct):
        seen.data, seen.start, seen.direct = data, start, direct
        return "found"

    monkeypatch.setattr(module, "experiments", experiments)
    monkeypatch.setattr(module, "fit_sections", fit_sections)
    monkeypatch.setattr(module, "fitted_system", lambda *given: given)
    return seen


def plant(D=0.0):
    core = ct.ss([[0.5, 0.1], [0.0, 0.3]], np.eye(2), np.eye(2), [[0, 0], [D, 0]], 1.0)
    return cr.DelayedStateSpace(core, (2, 5), output_delay=(0, 7))


def test_refining_keeps_order_and_delays(refined):
    best, group, bic, choices, flags = cr.refine(plant(), RECORD)
    assert refined.group == group == (RECORD,)
    assert refined.shares == ((2, 5), (0, 7))
    assert refined.data == "data"
    assert (best.found, best.order, best.inputs, best.outputs) == ("found", 2, (2, 5), (0, 7))
    assert np.isnan(best.bic)
    assert (bic, choices, flags) == ({}, (), ())
    # the sections are those of the core
    A, B, C, D = refined.start.matrices()
    markov = [C @ np.linalg.matrix_power(A, k) @ B for k in range(4)]
    core = plant().delay_free
    assert np.allclose(
        markov, [core.C @ np.linalg.matrix_power(core.A, k) @ core.B for k in range(4)]
    )
    assert not D.any()


def test_refining_has_a_direct_term_where_the_system_has_one_or_it_is_asked_for(refined):
    for feedthrough, D, direct in (
        (None, 0.0, False),
        (None, 0.1, True),
        (True, 0.0, True),
        (False, 0.1, False),
    ):
        best, *_ = cr.refine(plant(D), RECORD, feedthrough=feedthrough)
        assert refined.direct is best.direct is direct


def test_an_unstable_model_is_refined_as_well(refined):
    cr.refine(ct.ss([[1.5]], [[1.0]], [[1.0]], [[0.0]], 1.0), cr.Record(K, U[0], U[1]))
    assert refined.shares == ((0,), (0,))


# --- arguments


def test_the_fit_is_that_of_the_best_start(monkeypatch):
    calls = []

    def from_starts(*given):
        calls.append(given)
        return SimpleNamespace(system="system")

    monkeypatch.setattr(module, "from_starts", from_starts)
    assert cr.fit_channels(RECORD) == "system"
    assert calls == [((RECORD,), None, None, None)]
    cr.fit_channels([RECORD, RECORD], [3, 2], delays=[[1]], feedthrough=False)
    assert calls[1] == ((RECORD, RECORD), (2, 3), [[1]], False)
    with pytest.raises(OptionError, match="feedthrough='yes'"):
        cr.fit_channels(RECORD, feedthrough="yes")


def test_refining_asks_for_a_direct_term_or_none(refined):
    with pytest.raises(OptionError, match="feedthrough='yes'"):
        cr.refine(plant(), RECORD, feedthrough="yes")


def test_orders_are_rising_and_each_is_tried_once():
    assert _orders(None) is None
    assert _orders(3) == (3,)
    assert _orders([4, 2, 4]) == (2, 4)
    assert _orders(np.array([5])) == (5,)
    assert _orders(n for n in (2, 1)) == (1, 2)
    with pytest.raises(OrderError, match="order is empty"):
        _orders([])
    for wrong in (0, [2, 0], 1.5):
        with pytest.raises(OptionError, match="order"):
            _orders(wrong)


def test_signals_are_checked_in_all_records():
    _check_signals([RECORD, RECORD], None)
    for feedthrough in (True, False):
        _check_signals([RECORD], feedthrough)
    with pytest.raises(OptionError, match="feedthrough='yes'"):
        _check_signals([RECORD], "yes")
    gap = U.copy()
    gap[1, 7] = np.nan
    with pytest.raises(DataError, match="record 1 has gaps in its input"):
        _check_signals([RECORD, cr.Record(K, gap, RECORD.output, missing="keep")], None)
    # outputs may have them
    _check_signals([cr.Record(K, U, gap, missing="keep")], None)


@pytest.mark.parametrize("name", ["input", "output"])
def test_signals_of_which_squares_vanish_are_refused(name):
    def scaled(*sizes):
        signals = {"input": U, "output": RECORD.output}
        signals[name] = (
            signals[name] * np.array(sizes)[:, None] / np.abs(signals[name]).max(1)[:, None]
        )
        return cr.Record(K, signals["input"], signals["output"])

    _check_signals([scaled(1e-70, 1.0)], None)
    with pytest.raises(DataError, match=f"{name} 0 stays below 1e-70"):
        _check_signals([scaled(0.99e-70, 1.0)], None)
    with pytest.raises(DataError, match=f"{name} 1 stays below 1e-70"):
        _check_signals([scaled(0.99e-70, 0.9e-70)], None)
    # in one of the records it moves
    _check_signals([scaled(1.0, 1e-80), RECORD], None)


def test_delays_are_split_into_those_of_inputs_and_outputs():
    assert _split(np.array([[2, 5], [9, 12]])) == ((2, 5), (0, 7))
    # a channel without response has no say
    assert _split(np.array([[1, 0], [3, -1]])) == ((1, 0), (0, 2))
    # one with a response at once allows none to its input and its output
    inputs, outputs = _split(np.array([[0, 3], [4, 5]]))
    assert (inputs[0], outputs[0]) == (0, 0)
    assert inputs[1] <= 3
    assert outputs[1] <= 4
    assert inputs[1] + outputs[1] == 5
    inputs, outputs = _split(np.array([[4]]))
    assert inputs[0] + outputs[0] == 4
    assert {type(d) for d in inputs + outputs} == {int}
