"""What is identified depends neither on the last digit of a record nor on its units.

One unit in the last place of every sample is what another processor, or another order of a sum,
does to the same record.
"""

import control as ct
import numpy as np
import pytest

import ctrl_realize as cr
from tests import measured, rigs

CLOSE = 1e-6  # of the dead time, or of a sample where that is longer


def last_digit(record):
    sign = np.random.default_rng(0).choice([-1.0, 1.0], record.n_samples)
    return cr.Record(record.time, record.input, record.output * (1 + sign * np.finfo(float).eps))


def in_other_units(record):
    """Of time (nanoseconds), input and output at once, which moves last digits too."""
    return cr.Record(1e9 * record.time, 0.3 * record.input, 700.0 * record.output)


def two_lags_of_random_levels():
    rng = np.random.default_rng(5)
    u = np.repeat(rng.choice([-1.0, 0.0, 1.0, 2.0], 40), 10)
    plant = cr.delayed_ss(rigs.lag(0.8) * rigs.lag(4.0), dead_time=0.072, dt=0.01)
    y = 3 + np.ravel(plant.simulate(u)) + 0.02 * rng.standard_normal(u.size)
    return cr.Record(0.01 * np.arange(u.size), u, y)


def answer(fit):
    shape = fit.order, fit.relative_degree, sorted(flag.code for flag in fit.flags)
    return shape, np.array([fit.dead_time, *fit.interval]) / fit.dt


def rounded():
    record = rigs.step_record(rigs.R2, noise=0.005, seed=2, before=150, after=450)
    return cr.Record(record.time, record.input, np.round(record.output, 1))


@pytest.mark.parametrize(
    ("make", "change"),
    [
        (lambda: rigs.step_record(noise=0.005, seed=3, before=150, after=450), in_other_units),
        (rounded, last_digit),  # steps of a converter
        (two_lags_of_random_levels, in_other_units),
        (lambda: measured.record("heating_system/edge2"), last_digit),
    ],
    ids=["step", "rounded step", "random levels", "measured"],
)
def test_a_changed_record_is_answered_alike(make, change):
    record = make()
    shape, times = answer(cr.fit_output_error(record).fit)
    again, others = answer(cr.fit_output_error(change(record)).fit)
    assert again == shape
    np.testing.assert_allclose(others, times, rtol=0, atol=CLOSE * max(times[0], 1.0))


def two_modes_that_do_not_begin_at_rest(seed):
    rng = np.random.default_rng(seed)
    plant = cr.delayed_ss(rigs.pair(1.5, 0.05) + rigs.pair(6.0, 0.02), dead_time=0.03, dt=0.01)
    u = np.repeat(rng.choice([-1.0, 1.0], 120), 5)
    y = np.ravel(plant.simulate(u)) + 0.02 * rng.standard_normal(u.size)
    return cr.Record(0.01 * np.arange(400), u[200:], y[200:])


def test_the_interval_of_the_total_delay_has_the_unit_of_time():
    # beside a zero, steps for derivatives were a part of the largest coefficient, whatever its
    # unit: the interval was 1.4 times as wide
    rng = np.random.default_rng(1)
    time = 0.1 * np.arange(400)
    u = np.select([time < 6.55, time < 19.95, time < 29.95], [0.0, 1.0, -0.5], 0.4)
    plant = cr.delayed_ss(-3 * ct.tf([1], [1.5, 1]) * ct.tf([1], [0.6, 1]), dead_time=1.25, dt=0.1)
    y = plant.simulate(u) + 0.05 * rng.standard_normal(400)
    here, there = (cr.identify(cr.Record(unit * time, u, y)).fit for unit in (1.0, 1e9))
    low, high = here.total_delay_interval
    # of ends that are found to a thousandth of the width
    assert there.total_delay_interval == pytest.approx(
        (1e9 * low, 1e9 * high), abs=1e6 * (high - low)
    )


def test_states_are_chosen_alike():
    def states(record):
        fit = cr.fit_state_space(record).fit
        flags = sorted(flag.code for flag in fit.flags)
        return (fit.order, fit.input_delays, fit.feedthrough, flags), fit.noise_std / np.std(
            record.output
        )

    record = two_modes_that_do_not_begin_at_rest(8)
    shape, noise = states(record)
    assert shape[:2] == (4, (3,))
    # 400 samples tell a standard deviation to 4 %
    assert noise * np.std(record.output) == pytest.approx(0.02, rel=0.12)
    again, other = states(in_other_units(record))
    assert again == shape
    np.testing.assert_allclose(other, noise, rtol=1e-4)
