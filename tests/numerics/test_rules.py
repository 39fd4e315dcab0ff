"""Rules: switched off for a while, asked where they act, and on in every other context."""

from threading import Thread

import numpy as np
import pytest

import ctrl_realize as cr
from ctrl_realize.numerics.engine.problem import Structure
from ctrl_realize.numerics.engine.structures import choose
from ctrl_realize.numerics.output_error.step_data import step_data
from ctrl_realize.numerics.rules import Rule, asked, without
from ctrl_realize.numerics.signals.onset import first_motion

ONE_LAG, ONE_ZERO = Structure(1, 1), Structure(2, 1)
EDGE, DT = 200, 0.01


def white(count: int) -> np.ndarray:
    return np.random.default_rng(3).standard_normal(count)


def rest(hum: float = 0.0):
    """Data of a step of 1 in noise of 0.01, with a sine of 0.1 cycles a sample."""
    k = np.arange(500)
    output = 1.0 * (k >= EDGE + 20) + hum * np.sin(2 * np.pi * 0.1 * k) + 0.01 * white(k.size)
    return step_data(output, 1.0 * (k >= EDGE), DT, [(EDGE, 1)])


def test_without_the_rule_for_hum_a_sine_is_noise_of_its_standard_deviation():
    with_rule = rest(hum=0.1)
    with without(Rule.HUM):
        alone = rest(hum=0.1)
    assert with_rule.hum == pytest.approx([0.1], abs=1e-4)
    assert with_rule.sigma == pytest.approx(0.01, rel=0.2)  # 200 samples tell it to 5 %
    assert alone.hum == []
    # clipped at two median deviations a sine has less than its standard deviation
    assert 0.05 < alone.sigma < 0.1 / np.sqrt(2) * 1.2


def test_a_zero_is_charged_six_unless_that_rule_is_off():
    for gained, chosen in ((5.0, ONE_LAG), (7.0, ONE_ZERO)):
        assert choose({ONE_LAG: gained, ONE_ZERO: 0.0}) == chosen
        with without(Rule.NEEDLESS):
            assert choose({ONE_LAG: gained, ONE_ZERO: 0.0}) == ONE_ZERO


def test_a_step_of_one_and_a_half_deviations_shows_in_means_alone():
    k = np.arange(3000)
    output = 1.5 * (k >= 1000) + white(k.size)
    found = first_motion(output, 1000, 1.0, 0.0, 0.0)
    with without(Rule.MEANS):
        alone = first_motion(output, 1000, 1.0, 0.0, 0.0)
    assert alone is None
    assert found is not None
    assert found.onset < 64  # samples of the longest mean


def test_spikes_move_a_dead_time_unless_they_are_left_out():
    dead_time, time = 0.25, DT * np.arange(500)
    since = np.maximum(time - EDGE * DT - dead_time, 0.0)
    output = 1 - np.exp(-since / 0.3) + 0.005 * white(time.size)
    output[[EDGE + 20, EDGE + 21, 300, 350]] += 5.0
    record = cr.Record(time, 1.0 * (time >= EDGE * DT), output)

    def found() -> float:
        return cr.fit_output_error(record, structures=(1, 1)).fit.dead_time

    with without(Rule.SPIKES):
        alone = found()
    # noise of half a per cent and a lag of 30 samples: the dead time has an error of a tenth
    assert found() == pytest.approx(dead_time, abs=0.3 * DT)
    assert abs(alone - dead_time) > 10 * DT


def test_a_rule_is_on_again_after_an_exception():
    with pytest.raises(ArithmeticError, match="on: False"), without(Rule.HUM):
        raise ArithmeticError(f"on: {Rule.HUM.on}")
    assert Rule.HUM.on


def test_rules_that_are_off_add_up():
    with without(Rule.HUM, Rule.LOAD):
        with without(Rule.DRIFT):
            assert [rule for rule in Rule if not rule.on] == [Rule.DRIFT, Rule.LOAD, Rule.HUM]
        assert [rule for rule in Rule if not rule.on] == [Rule.LOAD, Rule.HUM]
    assert all(rule.on for rule in Rule)


def test_only_a_record_with_hum_is_touched_by_the_rule_for_it():
    with asked() as of_both:
        with asked() as plain:
            rest()
        with asked() as humming:
            rest(hum=0.1)
    rest(hum=0.1)
    assert Rule.HUM not in plain
    assert Rule.HUM in humming
    assert of_both == plain | humming


def test_a_rule_that_is_off_is_asked_all_the_same():
    with asked() as rules, without(Rule.HUM):
        rest(hum=0.1)
    assert Rule.HUM in rules


def test_another_thread_has_all_rules_and_is_not_watched():
    on = []
    with asked() as rules, without(Rule.HUM):
        other = Thread(target=lambda: on.extend(rule.on for rule in Rule))
        other.start()
        other.join()
    assert on == len(Rule) * [True]
    assert rules == set()
