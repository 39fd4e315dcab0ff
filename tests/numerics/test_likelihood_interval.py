"""Delay and interval of all that is not ruled out, from fits that are written by hand."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
import pytest

from ctrl_realize.numerics import likelihood_interval
from ctrl_realize.numerics.delay_choice import Choice
from ctrl_realize.numerics.dispersed_flow import DispersedFlow
from ctrl_realize.numerics.lag_chains import FREE_IN_A_CHAIN, LagChain, chain_profile
from ctrl_realize.numerics.likelihood_interval import flow_lead, likelihood_fit
from ctrl_realize.numerics.separable_fit import Structure
from ctrl_realize.numerics.structure_search import LEAST_CHARGE, PLAUSIBLE

ONE, TWO, ZERO = Structure(1, 1), Structure(2, 2), Structure(2, 1)


@dataclass(frozen=True)
class Model:
    structure: Structure
    delay: float
    cost: float = 0.0
    poles: tuple = (-1.0, -4.0)


@dataclass(frozen=True)
class Scales:
    earliest: float = 0.0
    latest: float = 9.0
    dt: float = 0.1


@dataclass(frozen=True)
class Whole:
    """A window with two structures, of which one lag is ruled out."""

    candidates: dict
    criterion: dict
    penalty: float = LEAST_CHARGE
    variance: float = 1.0
    problem: str = "problem"
    scales: Scales = field(default_factory=Scales)


@dataclass(frozen=True)
class Found:
    """What is put together, as it came."""

    whole: object
    chosen: object
    adequate: bool
    views: tuple
    profiles: dict
    interval: tuple
    profile: tuple
    chain: str = ""
    beside: tuple = ()
    endless: bool = False
    like_flow: bool = False
    open_start: bool = False
    flows: tuple = ()
    follows_flow: bool = False


def parabola(delay, error=0.1):
    grid = np.linspace(delay - 5 * error, delay + 5 * error, 41)
    return grid, ((grid - delay) / error) ** 2


def flow(criterion, lag=0.0, delay=3.0, excess=0.0):
    return DispersedFlow(delay, 2.0, 0.3, lag, 0.0, criterion, excess)


def chain(criterion, order=4, delay=2.0, error=0.1, hidden=0.0):
    model = Model(Structure(order, order), delay, poles=(-2.0,) * order)
    return LagChain(model, criterion, error, hidden)


def window(**changed):
    # within ten of the best, but one lag, which leaves too much
    candidates = {s: Model(s, d, c) for s, d, c in ((ONE, 6.0, 99.0), (TWO, 4.0, 0.0))}
    return Whole(candidates, {ONE: 100.0, TWO: 0.0}, **changed)


def likelihood(monkeypatch, choice, whole=None, **given):
    """The fit that is put together when `choice` is chosen."""
    seen = []

    def choose_model(whole, tanks, flows):
        seen.append((tanks, flows))
        return choice

    monkeypatch.setattr(likelihood_interval, "choose_model", choose_model)
    monkeypatch.setattr(likelihood_interval, "assembled", Found)
    monkeypatch.setattr(
        likelihood_interval, "profile_of", lambda whole, candidate: parabola(candidate.delay)
    )
    monkeypatch.setattr(
        likelihood_interval,
        "flow_profile",
        lambda problem, flow, scales, variance: parabola(flow.delay),
    )
    found = likelihood_fit(whole or window(), adequate=True, **given)
    ((tanks, flows),) = seen
    assert tanks == [chain for chain in given.get("chains", ()) if not chain.hidden]
    assert list(flows) == list(given.get("flows", ()))
    return found


def of_two(level=0.0, **changed):
    return Choice(Model(TWO, 4.0), level, **changed)


def approx(*values):
    # the profiles are interpolated in their root, which is linear here
    return pytest.approx(values, abs=1e-9)


def test_a_flow_begins_half_of_its_lags_before_a_chain():
    assert flow_lead(np.array([-2.0] * 8)) == pytest.approx(0.5 * 8 * 0.5)
    assert flow_lead(np.array([-1 + 1j, -1 - 1j])) == pytest.approx(0.5 * 2 / np.sqrt(2))


def test_the_interval_is_that_of_the_profile_where_one_structure_is_left(monkeypatch):
    found = likelihood(monkeypatch, of_two())
    half = np.sqrt(3.84) * 0.1
    assert found.interval == approx(4.0 - half, 4.0 + half, 2 * half / 3.92)
    assert list(found.profiles) == [TWO]
    assert found.chosen == Model(TWO, 4.0)
    assert (found.adequate, found.views, found.beside, found.chain) == (True, (), (), "")
    assert not any([found.endless, found.like_flow, found.open_start, found.follows_flow])


def test_structures_that_are_not_ruled_out_widen_it(monkeypatch):
    whole = window()
    whole.criterion[ONE] = PLAUSIBLE
    found = likelihood(monkeypatch, of_two(), whole)
    half = np.sqrt(3.84) * 0.1
    assert found.interval == approx(4.0 - half, 6.0 + half, 2 * half / 3.92)
    assert set(found.profiles) == {ONE, TWO}


def test_where_a_zero_imitates_the_beginning_the_interval_is_opened(monkeypatch):
    choice = Choice(Model(ZERO, 4.0), 0.0)
    whole = Whole({ZERO: choice.model}, {ZERO: 0.0})
    found = likelihood(monkeypatch, choice, whole, onset=4.5)
    assert found.open_start
    # three times the half second before the delay, and a sample after the first motion
    assert found.interval[:2] == approx(2.5, 4.6)
    # of an onset before the delay a sample counts
    half = np.sqrt(3.84) * 0.1
    early = likelihood(monkeypatch, choice, whole, onset=3.0)
    assert early.interval[:2] == approx(3.7, 4.0 + half)
    # as far as a delay may go
    pinned = Whole({ZERO: choice.model}, {ZERO: 0.0}, scales=Scales(3.9, 4.3))
    assert likelihood(monkeypatch, choice, pinned, onset=4.5).interval[:2] == approx(
        4.0 - half, 4.3
    )
    assert not likelihood(monkeypatch, choice, whole).open_start
    assert not likelihood(monkeypatch, of_two(), onset=4.5).open_start
    followed = flow(0.0)
    behind = Choice(choice.model, 0.0, flow=followed)
    assert not likelihood(monkeypatch, behind, whole, flows=[followed], onset=4.5).open_start


def test_chains_and_flows_that_are_not_ruled_out_stand_beside_the_table(monkeypatch):
    flows = [flow(PLAUSIBLE), flow(PLAUSIBLE + 0.1, delay=2.5)]
    chains = [chain(PLAUSIBLE), chain(PLAUSIBLE + 0.1, delay=1.0), chain(0.0, hidden=0.5, order=3)]
    found = likelihood(monkeypatch, of_two(), flows=flows, chains=chains)
    half = np.sqrt(3.84) * 0.1
    names, lows, highs = zip(*found.beside, strict=True)
    assert names == (
        "a flow that disperses",
        "chain of 4 nearly equal lags",
        "modes of diffusion",
    )
    assert lows == approx(3.0 - half, 2.0 - 0.196, 2.0 - 0.196 - 0.5)
    assert highs == approx(3.0 + half, 2.0 + 0.196, 2.0 + 0.196)
    assert found.interval[:2] == approx(2.0 - 0.196 - 0.5, 4.0 + half)
    assert found.flows == (flows[0],)
    assert not found.follows_flow


def test_parameters_are_charged_at_least_as_bic_would_of_many_samples(monkeypatch):
    # a charge of 5 for each parameter: 2 more for the two of a chain and of a flow, as for the
    # two of the lags
    more = LEAST_CHARGE - 5.0
    whole = window(penalty=5.0)
    limit = PLAUSIBLE + 2 * more
    kept = {"flows": [flow(limit - 2 * more)], "chains": [chain(limit - FREE_IN_A_CHAIN * more)]}
    assert len(likelihood(monkeypatch, of_two(), whole, **kept).beside) == 2
    gone = {
        "flows": [flow(limit - 2 * more + 0.1), flow(limit - 3 * more + 0.1, lag=0.5)],
        "chains": [chain(limit - FREE_IN_A_CHAIN * more + 0.1)],
    }
    assert likelihood(monkeypatch, of_two(), whole, **gone).beside == ()
    # one lag has a parameter less
    whole.candidates[ONE] = Model(ONE, 6.0, 99.0)
    whole.criterion[ONE] = PLAUSIBLE + more
    assert set(likelihood(monkeypatch, of_two(), whole).profiles) == {ONE, TWO}
    whole.criterion[ONE] += 0.1
    assert set(likelihood(monkeypatch, of_two(), whole).profiles) == {TWO}
    # two lags and a zero have one more
    whole.candidates[ZERO] = Model(ZERO, 3.0, 99.0)
    whole.criterion[ZERO] = PLAUSIBLE - more
    assert set(likelihood(monkeypatch, of_two(), whole).profiles) == {TWO, ZERO}
    whole.criterion[ZERO] += 0.1
    assert set(likelihood(monkeypatch, of_two(), whole).profiles) == {TWO}
    # a larger charge than the least one is as it is
    costly = window(penalty=LEAST_CHARGE + 3.0)
    costly.criterion[ONE] = PLAUSIBLE
    found = likelihood(monkeypatch, of_two(), costly, flows=[flow(PLAUSIBLE, lag=0.5)])
    assert set(found.profiles) == {ONE, TWO}
    assert len(found.beside) == 1


def test_a_chain_that_is_chosen_takes_its_place_in_the_table(monkeypatch):
    tank = chain(-5.0)
    choice = Choice(tank.candidate, -5.0, tank)
    found = likelihood(monkeypatch, choice, chains=[tank])
    structure = tank.candidate.structure
    assert found.chain == "chain of 4 nearly equal lags"
    assert found.whole.candidates[structure] is tank.candidate
    assert found.whole.criterion[structure] == -5.0
    assert set(found.whole.candidates) == {ONE, TWO, structure}
    own = chain_profile(tank, Scales())
    assert np.array_equal(found.profiles[structure][1], own[1])
    assert np.array_equal(found.profile[0], own[0])
    # its standard error, from a parabola that 13 points follow
    assert found.interval[2] == pytest.approx(0.1, rel=0.02)
    assert not found.like_flow


def test_a_long_chain_may_be_a_flow_unless_that_is_out_of_the_question(monkeypatch):
    def of(order, flows=(), delay=3.0):
        tank = chain(-500.0, order, delay=delay)
        found = likelihood(
            monkeypatch, Choice(tank.candidate, -500.0, tank), chains=[tank], flows=flows
        )
        return found.like_flow, found.interval[0]

    assert of(5)[0] is False
    assert of(6) == (True, pytest.approx(3.0 - 0.5 * 6 * 0.5))
    # a flow of more lags than the delay is long begins with the step
    assert of(7, delay=1.0) == (True, 0.0)
    doubted, ruled_out = flow(0.0, excess=2 * PLAUSIBLE), flow(0.0, excess=2 * PLAUSIBLE + 0.1)
    assert of(6, [ruled_out, doubted])[0] is True
    assert of(6, [ruled_out])[0] is False


def test_what_gets_better_with_every_lag_may_begin_with_the_step(monkeypatch):
    longest = likelihood_interval.still_improving
    monkeypatch.setattr(likelihood_interval, "still_improving", lambda tanks: len(tanks) == 3)
    tanks = [chain(50.0), chain(40.0), chain(30.0)]
    late = window(scales=Scales(earliest=0.7))
    hidden = chain(9.0, 3, 4.0, hidden=0.1)
    found = likelihood(monkeypatch, of_two(), late, chains=[*tanks, hidden])
    assert found.endless
    assert found.interval[0] == 0.7
    assert not longest(tanks)
    assert not likelihood(monkeypatch, of_two(), chains=tanks[:2]).endless


def test_a_flow_that_is_followed_has_the_delay(monkeypatch):
    best, other = flow(-3.0, delay=4.0), flow(-2.0, delay=2.0)
    choice = Choice(Model(TWO, 4.0), -3.0, flow=best)
    found = likelihood(monkeypatch, choice, flows=[other, best])
    assert found.follows_flow
    assert found.flows == (other, best)
    assert np.array_equal(found.profile[0], parabola(4.0)[0])
    assert found.profile is not found.profiles[TWO]
