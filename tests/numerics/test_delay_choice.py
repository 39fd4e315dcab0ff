"""The choice between lags, chains of them and flows, on fits that are written by hand."""

from __future__ import annotations

from dataclasses import dataclass, field
from types import SimpleNamespace

import pytest

from ctrl_realize.numerics import delay_choice
from ctrl_realize.numerics.delay_choice import (
    Choice,
    _behind,
    chains_of,
    choose_model,
    flows_of,
)
from ctrl_realize.numerics.dispersed_flow import DispersedFlow
from ctrl_realize.numerics.lag_chains import LagChain
from ctrl_realize.numerics.separable_fit import Structure
from ctrl_realize.numerics.structure_search import needless_charge


@dataclass(frozen=True)
class Model:
    structure: Structure
    cost: float = 0.0


@dataclass(frozen=True)
class Scales:
    earliest: float = 0.0
    latest: float = 9.0


@dataclass(frozen=True)
class Whole:
    """A window whose best structure is given; the criterion of the others is larger."""

    best: Model
    criterion: dict
    problem: str = "problem"
    scales: Scales = field(default_factory=Scales)
    variance: float = 0.5
    penalty: float = 7.0

    def criteria(self, found):
        return {structure: model.cost + 100 for structure, model in found.items()}


def whole(order=2, zeros=0, level=20.0):
    best = Structure(order, order - zeros)
    return Whole(Model(best), {best: level, Structure(6, 1): level + 1})


def chain(criterion, order=8):
    return LagChain(Model(Structure(order, order)), criterion, 0.1)


def flow(criterion, lag=0.0, delay=3.0, cost=4.0):
    return DispersedFlow(delay, 2.0, 0.3, lag, cost, criterion, 0.0)


def test_parameters_are_those_of_what_was_chosen():
    lags = Model(Structure(3, 1))
    assert Choice(lags, 0.0).parameters == 3 + 2
    assert Choice(lags, 0.0, chain=chain(0.0)).parameters == 2
    assert Choice(lags, 0.0, flow=flow(0.0)).parameters == 2
    assert Choice(lags, 0.0, flow=flow(0.0, lag=0.5)).parameters == 3


def test_lags_are_charged_for_what_seems_needless():
    for order, zeros in ((2, 0), (2, 1), (5, 0)):
        found = choose_model(whole(order, zeros), [], [])
        assert found.model == whole(order, zeros).best
        assert found.level == 20.0 + needless_charge(Structure(order, order - zeros))
        assert (found.chain, found.flow) == (None, None)
    assert needless_charge(Structure(5, 5)) > needless_charge(Structure(2, 2)) == 0


def test_the_best_chain_is_taken_where_it_is_better_than_lags():
    better = chain(19.9)
    found = choose_model(whole(), [chain(19.95), better, chain(25.0)], [])
    assert found.chain is better
    assert (found.model, found.level) == (better.candidate, 19.9)
    as_good = choose_model(whole(), [chain(20.0)], [])
    assert as_good.chain is None
    # lags are held to what they are charged with
    assert choose_model(whole(2, 1), [chain(20.1)], []).chain is not None


def test_the_best_flow_is_taken_where_lags_can_follow_it(monkeypatch):
    model, asked = Model(Structure(4, 2)), []

    def behind(window, of):
        asked.append(of)
        return model

    monkeypatch.setattr(delay_choice, "_behind", behind)
    flows = [flow(18.0), flow(17.0), flow(19.0)]
    found = choose_model(whole(), [chain(19.0)], flows)
    assert (found.model, found.level) == (model, 17.0)
    assert found.flow is flows[1]
    assert found.chain is None
    assert asked == [flows[1]]
    assert choose_model(whole(), [chain(17.0)], flows).flow is None  # no better than the chain
    assert choose_model(whole(), [], [flow(20.0)]).flow is None
    monkeypatch.setattr(delay_choice, "_behind", lambda window, of: None)
    assert choose_model(whole(), [chain(19.0)], flows).chain is not None


def test_lags_behind_a_flow_keep_its_dead_time_and_leave_no_more(monkeypatch):
    asked = []
    # up to ten half variances more than the flow leaves
    costs = {Structure(3, 3): 9.0, Structure(4, 4): -20.0, Structure(5, 1): 9.1}

    def search(problem, structures, scales):
        asked.append((problem, structures, scales))
        return {s: Model(s, cost) for s, cost in costs.items()}

    monkeypatch.setattr(delay_choice, "search", search)
    found = _behind(whole(), flow(17.0))
    assert found == Model(Structure(4, 4), -20.0)
    ((problem, structures, scales),) = asked
    assert problem == "problem"
    assert (scales.earliest, scales.latest) == (3.0, 3.0)
    assert min(s.order for s in structures) == 3
    assert max(s.order for s in structures) == 6
    assert len(structures) == 3 + 4 + 5 + 6
    del costs[Structure(4, 4)]
    assert _behind(whole(), flow(17.0)) == Model(Structure(3, 3), 9.0)
    del costs[Structure(3, 3)]
    assert _behind(whole(), flow(17.0)) is None


@pytest.mark.parametrize(
    ("order", "found"), [(1, []), (2, ["diffusion"]), (3, ["tanks", "diffusion"])]
)
def test_chains_are_tried_where_enough_lags_show(monkeypatch, order, found):
    window = whole(order)
    expected = ("problem", window.best, window.scales, 0.5, 7.0)

    def tried(name):
        def fit(*setting):
            assert setting == expected
            return [name]

        return fit

    monkeypatch.setattr(delay_choice, "fit_chains", tried("tanks"))
    monkeypatch.setattr(delay_choice, "fit_diffusion", tried("diffusion"))
    assert chains_of(window) == found


def test_flows_are_tried_where_two_lags_show(monkeypatch):
    window, asked = whole(2), []

    def fit_flows(*setting):
        asked.append(setting)
        return ["flow"]

    monkeypatch.setattr(delay_choice, "fit_flows", fit_flows)
    assert flows_of(whole(1), []) == []
    assert flows_of(window, []) == ["flow"]
    # held to the best of lags and chains
    assert flows_of(window, [SimpleNamespace(criterion=c) for c in (30.0, 15.0)]) == ["flow"]
    setting = ("problem", window.best, window.scales, 0.5, 7.0)
    assert asked == [(*setting, 20.0), (*setting, 15.0)]
