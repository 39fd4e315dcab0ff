"""The judgement between lags and modes, with fits that are written by hand."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from types import SimpleNamespace

import control as ct
import numpy as np
import pytest

import ctrl_realize as cr
from ctrl_realize.errors import DataError, OrderError, UnsuitableSystemError
from ctrl_realize.identification import mode_choice
from ctrl_realize.identification.mode_choice import (
    CLEAR,
    _chosen,
    _gain,
    _left,
    _total_delay,
    with_modes_judged,
)
from ctrl_realize.numerics.coloured_noise import noise_lags
from ctrl_realize.numerics.noise_level import correlation_time
from ctrl_realize.results import Flag
from ctrl_realize.wording import interval_in_time

DT = 0.1
RECORDS = ("first", "second")


@dataclass(frozen=True)
class Lags:
    order: int = 3
    relative_degree: int = 2
    records: tuple = RECORDS
    repeatability: object = None
    flags: tuple = ()


@dataclass(frozen=True)
class System:
    fit: object = field(default_factory=Lags)
    input_delays: tuple = (2,)
    output_delays: tuple = (3,)

    def replace(self, fit):
        return replace(self, fit=fit)


@pytest.fixture
def by_hand(monkeypatch):
    """Residuals that follow the input, modes of order 4 behind 5 samples, and their gain."""
    set_up = SimpleNamespace(
        follows=[True, False],
        left=["e1", "e2"],
        found=SimpleNamespace(system=System(SimpleNamespace(order=4))),
        gain=CLEAR + 1,
        starts=[],
    )

    def left(system, records):
        assert records == RECORDS
        if isinstance(set_up.left, Exception):
            raise set_up.left
        return set_up.follows, set_up.left

    def starts(records, **kwargs):
        set_up.starts.append(kwargs)
        if isinstance(set_up.found, Exception):
            raise set_up.found
        return set_up.found

    monkeypatch.setattr(mode_choice, "_left", left)
    monkeypatch.setattr(mode_choice, "from_starts", starts)

    def gain(fit, left, found):
        assert isinstance(fit, Lags)
        assert (left is None) == isinstance(set_up.left, Exception)
        assert found is set_up.found
        return set_up.gain

    monkeypatch.setattr(mode_choice, "_gain", gain)
    monkeypatch.setattr(mode_choice, "_chosen", lambda *args: args)
    return set_up


def told(system):
    (flag,) = system.fit.flags
    assert flag.code == "input_in_residual"
    return flag.message


def test_lags_that_leave_nothing_of_the_input_stay(by_hand):
    by_hand.follows = [False, False]
    system = System()
    assert with_modes_judged(system, None) is system
    assert by_hand.starts == []


def test_modes_that_are_clearly_better_are_taken(by_hand):
    found, fit, following, gain = with_modes_judged(System(), None)
    assert (found, fit, following, gain) == (by_hand.found, Lags(), 1, CLEAR + 1)
    assert by_hand.starts == [{"most_starts": 3, "enough": mode_choice.MOST_SAMPLES}]
    assert with_modes_judged(System(), 5)[0] is by_hand.found


def test_modes_that_are_not_clearly_better_or_too_late_are_named(by_hand):
    earlier = Flag("gains_differ", "they do")
    late = with_modes_judged(System(Lags(flags=(earlier,))), 4)
    assert late.fit.flags[0] is earlier
    assert "a model of 4 states starts after max_delay" in late.fit.flags[1].message
    by_hand.gain = CLEAR
    message = told(with_modes_judged(System(), None))
    assert message.startswith("the residual of 1 of 2 record(s) still follows the input")
    assert "a model of 4 states (fit_channels) is no better" in message


@pytest.mark.parametrize("error", [DataError("too few"), OrderError("too few")])
def test_why_no_modes_could_be_fitted_is_told(by_hand, error):
    by_hand.found = error
    assert "for modes and zeros, too few" in told(with_modes_judged(System(), None))


def test_structures_that_were_asked_for_and_records_of_several_plants_are_not_searched(by_hand):
    assert "identify without order" in told(with_modes_judged(System(), None, asked=True))
    for outlying, searched in ((True, 0), (False, 1)):
        lags = Lags(repeatability=SimpleNamespace(outlying=outlying))
        by_hand.gain = 0.0
        message = told(with_modes_judged(System(lags), None))
        assert ("not of one plant" in message) == outlying
        assert len(by_hand.starts) == searched


def test_an_unstable_model_has_no_residual_to_tell_of(by_hand):
    by_hand.left = UnsuitableSystemError("unstable")
    assert with_modes_judged(System(), None)[2] == 2  # both records count as following
    by_hand.gain = 0.0
    system = System()
    assert with_modes_judged(system, None) is system


def test_residuals_are_asked_behind_the_delay_as_far_as_the_record_goes(monkeypatch):
    asked = []

    def check(system, record, lags):
        asked.append(lags)
        return SimpleNamespace(independent=lags > 20, residual=np.ones((1, lags)))

    monkeypatch.setattr(mode_choice, "check_residuals", check)
    records = [SimpleNamespace(n_samples=n) for n in (600, 60)]
    follows, left = _left(SimpleNamespace(delay=4.2), records)
    assert asked == [5 + 25, 20]
    assert follows == [False, True]
    assert [e.shape for e in left] == [(30,), (20,)]


def test_gain_is_the_difference_of_the_criteria(monkeypatch):
    noise = [np.random.default_rng(k).standard_normal(100) for k in (0, 1)]
    monkeypatch.setattr(mode_choice, "_left", lambda system, records: ([], noise))
    found = SimpleNamespace(system=SimpleNamespace(fit=SimpleNamespace(order=2, direct=True)))
    # lags: 2 * 3 - 2 + 2 and two initial states of 3; modes: 2 * 2 + 2 and two of 2
    fewer = (12 - 10) * np.log(200)
    assert _gain(Lags(), noise, found) == pytest.approx(fewer, rel=1e-12)
    # e times as much is left in all samples that count
    count = 200 - 2 * noise_lags(100)
    more = _gain(Lags(), [np.e * e for e in noise], found)
    assert more == pytest.approx(2 * count + fewer, rel=1e-12)
    assert _gain(Lags(), None, found) == np.inf


@pytest.mark.parametrize("direct", [0.0, 0.3])
def test_the_total_delay_is_the_first_moment_of_the_pulse_less_half_a_hold(direct):
    core = ct.ss([[0.8, 0.1], [0.0, 0.5]], [[0.0], [1.0]], [[0.2, 0.1]], [[direct]], DT)
    system = cr.DelayedStateSpace(core, 2, output_delay=1)
    pulse = system.markov(400)  # 0.8^400 is nothing
    moment = pulse @ np.arange(400) / pulse.sum()
    assert _total_delay(system) == pytest.approx((moment - 0.5) * DT, rel=1e-12)
    # in other units
    small = ct.ss(core.A, 1e-12 * core.B, core.C, 1e-12 * core.D, DT)
    found = _total_delay(cr.DelayedStateSpace(small, 2, output_delay=1))
    assert found == pytest.approx((moment - 0.5) * DT, rel=1e-12)


def test_without_a_gain_there_is_no_total_delay():
    core = ct.ss([[0.5]], [[1.0]], [[-0.5]], [[1.0]], DT)  # 1 - 0.5 / (1 - 0.5)
    assert _total_delay(cr.DelayedStateSpace(core, 2)) is None
    # 0.2 * 1 - 0.1 * 2, which rounding leaves at 2e-17
    core = ct.ss([[0.8, 0.1], [0.0, 0.5]], [[0.0], [1.0]], [[0.2, -0.1]], [[0.0]], DT)
    assert _total_delay(cr.DelayedStateSpace(core, 2)) is None


PLANT = cr.DelayedStateSpace(ct.ss([[0.8]], [[1.0]], [[0.2]], [[0.0]], DT), 3, output_delay=1)


@pytest.fixture(scope="module")
def modes():
    rng = np.random.default_rng(0)
    u = rng.standard_normal(300)
    y = PLANT.simulate(u) + 0.1 * rng.standard_normal(300)
    return cr.refine(PLANT, cr.Record(DT * np.arange(300), u, y))


def taken(modes, own=(3.5, 4.5), interval=(0.2, 0.6), residual=0.1, flags=()):
    """What `_chosen` makes of these modes; lags leave `residual` and have this interval in s."""
    asked = []

    def plausible(best, independent):
        asked.append((best, independent))
        return own

    found = SimpleNamespace(
        system=modes, search=SimpleNamespace(plausible=plausible), best="the best"
    )
    lags = SimpleNamespace(
        dt=DT, residual=residual, interval=interval, order=3, records=RECORDS, flags=flags
    )
    system = _chosen(found, lags, 1, 123.4)
    assert asked == [("the best", correlation_time(np.ravel(modes.fit.checks[0].residual)))]
    assert system.fit.lags is lags
    return system.fit


def test_modes_that_were_chosen_have_a_dead_time_and_reasons(modes):
    fit = taken(modes)
    assert fit.dead_time == pytest.approx(0.4)
    assert fit.total_delay == _total_delay(modes)
    assert fit.choices[0].startswith("1 states with zeros (fit_channels) instead of 3 lags behind")
    assert "follows the input in 1 of 2 record(s)" in fit.choices[0]
    assert "BIC is 123 smaller" in fit.choices[0]
    assert "whole samples" in fit.choices[1]


def test_lags_that_leave_little_more_widen_the_interval(modes):
    noise = float(modes.fit.noise_std[0])
    for residual, interval in ((2.0 * noise, (0.2, 0.6)), (2.01 * noise, (0.35, 0.45))):
        assert taken(modes, residual=residual).interval == pytest.approx(interval)
    # of lags that end sooner the one end, and that of the modes on the other side
    assert taken(modes, interval=(0.1, 0.4)).interval == pytest.approx((0.1, 0.45))
    assert taken(modes, interval=(0.4, 0.7)).interval == pytest.approx((0.35, 0.7))


def codes(fit):
    return [flag.code for flag in fit.flags]


def test_flags_of_modes_tell_of_no_delay_and_of_lags_that_disagree(modes):
    assert codes(taken(modes, interval=(0.35, 0.45))) == []
    assert codes(taken(modes, own=(0.5, 1.5), interval=(0.1, 0.2))) == ["no_delay_resolved"]
    assert codes(taken(modes, own=(0.6, 1.5), interval=(0.1, 0.2))) == []
    # up to half of the dead time, 0.2 s, or twice the interval of the modes is no contradiction
    assert codes(taken(modes, interval=(0.26, 0.45))) == []
    apart = taken(modes, interval=(0.24, 0.45))
    assert codes(apart) == ["structures_disagree"]
    assert apart.flags[0].message == (
        f"modes put the dead time in {interval_in_time(0.35, 0.45)}, lags behind a dead time in "
        f"{interval_in_time(0.24, 0.45)}"
    )
    assert codes(taken(modes, own=(3.0, 4.5), interval=(0.17, 0.45))) == []
    assert codes(taken(modes, own=(3.0, 4.5), interval=(0.14, 0.45))) == ["structures_disagree"]


def test_flags_of_the_records_are_kept_and_those_of_the_lags_are_not(modes):
    flags = (Flag("gains_differ", "they do"), Flag("order_uncertain", "it is"))
    fit = taken(modes, interval=(0.35, 0.45), flags=flags)
    assert fit.flags == flags[:1]
