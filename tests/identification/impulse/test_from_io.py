"""Pulse responses from any input."""

import control as ct
import numpy as np
import pytest
from numpy.testing import assert_allclose

import ctrl_realize as cr
from ctrl_realize.errors import DataError
from tests import measured
from tests.rigs import DT, TWO_STATES

METHODS = [
    {"method": "regularized", "kernel": "TC"},
    {"method": "regularized", "kernel": "SS"},
    {"method": "least_squares"},
    {"method": "okid"},
]


def record(n=600, noise=0.05, seed=0, plant=TWO_STATES, u0=0.0, y0=0.0, **options):
    rng = np.random.default_rng(seed)
    u = rng.choice([-1.0, 1.0], (n,) if plant.issiso() else (plant.ninputs, n))
    y = plant.simulate(u)
    y = y + noise * rng.standard_normal(y.shape)
    return cr.Record(DT * np.arange(n), u + u0, y + y0, **options)


@pytest.mark.parametrize("options", METHODS)
def test_the_true_response_lies_in_the_band_of_the_estimate(options):
    truth = TWO_STATES.markov(50)
    z = np.concatenate(
        [
            (g.markov - truth)[:30] / g.std[:30]
            for g in (cr.impulse_from_io(record(seed=s), 50, **options) for s in range(8))
        ]
    )
    # 240 values: white errors would give 1 -+ 0.05; neighbours are correlated, and a prior that
    # is not the truth's moves the estimate within its band
    assert 0.5 < np.sqrt(np.mean(z**2)) < 1.35
    assert np.mean(np.abs(z) < 3) > 0.97


def test_std_of_least_squares_is_the_cramer_rao_bound():
    estimates = [
        cr.impulse_from_io(record(n=300, seed=s), 30, method="least_squares") for s in range(150)
    ]
    scatter = np.std([g.markov for g in estimates], axis=0)
    bound = np.mean([g.std for g in estimates], axis=0)
    # 30 scatters of 150 draws each: 6 % per sigma, 3.5 sigma
    assert_allclose(scatter / bound, 1.0, rtol=0, atol=0.2)
    assert_allclose(np.mean(scatter / bound), 1.0, rtol=0, atol=0.03)


def test_missing_samples_take_out_the_equations_that_they_touch():
    whole = record()
    y = whole.output.copy()
    y[[100, 250, 251]] = np.nan
    u = whole.input.copy()
    u[400] = np.nan
    holes = cr.Record(whole.time, u, y, missing="keep")
    g = cr.impulse_from_io(holes, 40, method="least_squares")
    # rows 39...599, less 3 outputs, less the 40 rows that see u[400]
    assert g.rows == 561 - 3 - 40
    assert np.all(np.abs(g.markov - TWO_STATES.markov(40)) < 4.5 * g.std)


@pytest.mark.parametrize("options", METHODS)
@pytest.mark.parametrize(
    ("name", "u"), [("constant", np.full(400, 2.0)), ("sine", np.sin(0.2 * np.arange(400)))]
)
def test_an_input_that_does_not_excite_gets_no_answer(options, name, u):
    rng = np.random.default_rng(0)
    y = TWO_STATES.simulate(u) + 0.1 * rng.standard_normal(400)
    with pytest.raises(DataError, match="does not excite"):
        cr.impulse_from_io(cr.Record(DT * np.arange(400), u, y), 30, **options)


@pytest.mark.parametrize("options", METHODS)
def test_an_output_that_does_not_follow_is_flagged(options):
    flagged = 0
    for seed in range(20):
        rng = np.random.default_rng(seed)
        one = cr.Record(DT * np.arange(500), rng.normal(size=500), rng.normal(size=500))
        g = cr.impulse_from_io(one, 30, **options)
        flagged += "no_response" in [flag.code for flag in g.flags]
    assert flagged >= 18  # a test at 1 %, with room for two alarms


@pytest.mark.parametrize("kernel", ["auto", "TC", "SS"])
def test_the_errors_of_a_regularized_response_hold_the_truth_also_where_it_dies_away(kernel):
    # two lags of 0.8 and 4 Hz behind ten samples; the smooth prior alone held 22 % of the tail
    core = ct.tf([1], [1 / (2 * np.pi * 0.8), 1]) * ct.tf([1], [1 / (2 * np.pi * 4.0), 1])
    plant = cr.delayed_ss(core, dead_time=0.098, dt=0.01)
    rng = np.random.default_rng(5)
    held = []
    for _ in range(3):
        u = np.repeat(rng.choice([-1.0, 0.0, 1.0, 2.0], 834), 3)[:2500]
        y = plant.simulate(u) + 0.01 * rng.standard_normal(2500)
        taken = cr.Record(0.01 * np.arange(2500), u, y)
        found = cr.impulse_from_io(taken, 160, method="regularized", kernel=kernel)
        held.append(np.abs(found.markov - plant.markov(160)) <= 1.96 * found.std)
    # of three records: every part of the response, not only most of it
    assert np.mean(held, axis=0).reshape(8, 20).mean(axis=1).min() > 0.85


@pytest.mark.parametrize("options", METHODS)
@pytest.mark.parametrize(
    ("plant", "length", "delay"),
    [("hairdryer", 60, 3), ("gas_furnace", 40, 3), ("exchanger", 250, 0)],
)
def test_measured_plants_have_the_delay_that_their_authors_state(options, plant, length, delay):
    g = cr.impulse_from_io(measured.record(f"{plant}/record"), length, **options)
    assert cr.estimate_delay(g, 2, max_delay=15).delay == delay


@pytest.mark.parametrize("delay", [110, 250])
def test_a_response_that_begins_behind_the_first_window_is_found(delay):
    rng = np.random.default_rng(0)
    plant = cr.delayed_ss(ct.ss([[0.9]], [[1.0]], [[0.1]], [[0.0]], 0.01), delay)
    u = rng.choice([-1.0, 1.0], 1000)
    y = plant.simulate(u) + 0.05 * rng.standard_normal(u.size)
    g = cr.impulse_from_io(cr.Record(0.01 * np.arange(1000), u, y))
    assert g.n_samples > delay + 50
    # the largest value is 0.1 behind the delay, its noise 0.05 / sqrt(700)
    assert abs(int(np.argmax(g.markov)) - delay - 1) <= 1
    assert np.abs(g.markov[: delay - 5]).max() < 0.02


@pytest.mark.parametrize("options", METHODS)
def test_units_of_inputs_change_nothing_but_those_of_their_responses(options):
    core = ct.ss([[0.9, 0.1], [0, 0.7]], np.eye(2), [[1.0, 1.0]], np.zeros((1, 2)), DT)
    usual = record(plant=cr.DelayedStateSpace(core, (3, 9)))
    size = np.array([1e6, 1e-5])  # as Pa and m^3/s
    other = cr.Record(usual.time, size[:, None] * usual.input, usual.output)
    expected, found = (cr.impulse_from_io(one, 40, **options).markov for one in (usual, other))
    # the prior is sought to 0.02 of its logarithms, where rounding may lead the search elsewhere
    assert_allclose(found * size[:, None], expected, rtol=0, atol=0.01 * np.abs(expected).max())


@pytest.mark.parametrize("held", [1, 5])
def test_the_band_of_an_arx_estimate_contains_what_its_order_leaves_out(held):
    """Output noise makes ARX models of every order biased, most with a feedthrough."""
    dead_time, size = 5, 1000
    within = []
    for seed in range(4):
        rng = np.random.default_rng(seed)
        u = np.repeat(rng.choice([-1.0, 1.0], size // held), held)
        plant = cr.delayed_ss(ct.tf([1, 2], [1, 1]).sample(0.1), dead_time)
        y = plant.simulate(u)
        y = y + 0.1 * y.std() * rng.standard_normal(size)
        found = cr.impulse_from_io(cr.Record(0.1 * np.arange(size), u, y), 60, method="okid")
        error = np.abs(found.markov - plant.markov(60))[dead_time:35]
        within.append(np.mean(error <= 2 * found.std[dead_time:35]))
    # 95 % of 30 values that are correlated, of four records; it was a third and two thirds
    assert np.mean(within) > 0.85
