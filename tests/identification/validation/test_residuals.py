"""Residuals of models that are right and wrong, and simulation from an unknown start."""

import control as ct
import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal
from scipy.signal import lfilter

import ctrl_realize as cr
from tests.measured import halves
from tests.rigs import DT, TWO_INPUTS, TWO_STATES

MIMO = cr.DelayedStateSpace(TWO_INPUTS.delay_free, (2, 4), output_delay=(0, 3, 1))


def record(
    plant=TWO_STATES, n=1000, noise=0.05, seed=0, colour=0.0, skip=0, drive=0.0, label="rig"
):
    rng = np.random.default_rng(seed)
    shape = (n + skip,) if plant.issiso() else (plant.ninputs, n + skip)
    u = lfilter([1], [1, -drive], rng.standard_normal(shape))
    y = plant.simulate(u)
    e = lfilter([1], [1, -colour], noise * rng.standard_normal(y.shape))
    return cr.Record(DT * np.arange(n), u[..., skip:], (7 + y + e)[..., skip:], name=label)


@pytest.mark.parametrize("drive", [0.0, 0.9])
@pytest.mark.parametrize("colour", [0.0, 0.9])
def test_the_true_model_leaves_noise_and_raises_no_alarm(drive, colour):
    alarms = []
    for seed in range(25):
        check = cr.validation.analyse_residuals(
            TWO_STATES, record(seed=seed, colour=colour, drive=drive, skip=50), confidence=0.999
        )
        alarms.append(not check.independent or bool(check.flags))
        assert check.white == (colour == 0)
    assert sum(alarms) <= 1


@pytest.mark.parametrize("plant", [TWO_STATES, MIMO], ids=["siso", "mimo"])
def test_a_record_cut_out_of_the_middle_of_an_experiment_is_explained_from_its_start(plant):
    one = record(plant, noise=0.0, skip=137, n=400)
    check = cr.validation.analyse_residuals(plant, one)
    # state, offset and what was inside the dead times are found from exact data
    assert_allclose(check.residual, 0, atol=1e-9)
    assert np.all(check.fit_percent > 100 - 1e-7)
    rest = cr.validation.analyse_residuals(plant, one, start="rest")
    assert np.all(rest.fit_percent < 99.9)
    assert np.abs(rest.residual).max() > 0.05


@pytest.mark.parametrize("delay", [4, 6])
def test_a_delay_that_is_off_by_one_shows_in_the_cross_correlation(delay):
    check = cr.validation.analyse_residuals(TWO_STATES.replace(delay=delay), record())
    assert not check.independent
    assert [flag.code for flag in check.flags] == ["input_in_residual"]
    # the model's first response is missing, or comes too soon: G_1 = 0.1 at the sample after
    # the shorter of the delays
    assert np.abs(check.cross[0, 0, 25:]).argmax() in (5, 6, 7)


@pytest.mark.parametrize("integral", [0.0, 0.1])
def test_a_controller_of_the_same_sample_is_feedback_and_no_wrong_delay(integral):
    rng = np.random.default_rng(1)
    n, total = 2000, 0.0
    u, y, e = np.zeros(n), np.zeros(n), 0.3 * rng.standard_normal(n)
    target = np.repeat(rng.choice([-1.0, 1.0], n // 20), 20)
    state = 0.0
    for k in range(n):
        state = 0.8 * state + (0.2 * u[k - 4] if k > 3 else 0.0)
        y[k] = state + e[k]
        total += integral * (target[k] - y[k])
        u[k] = target[k] - y[k] + total
    core = ct.ss([[0.8]], [[1.0]], [[0.2 * 0.8]], [[0.2]], DT)
    check = cr.validation.analyse_residuals(
        cr.DelayedStateSpace(core, 4), cr.Record(DT * np.arange(n), u, y)
    )
    assert [flag.code for flag in check.flags] == ["feedback"]
    assert check.independent
    # a model that answers at once may be wrong at lag 0 itself
    direct = ct.ss([[0.8]], [[1.0]], [[0.16]], [[0.2]], DT)
    at_once = cr.validation.analyse_residuals(direct, cr.Record(DT * np.arange(n), u, y))
    assert not at_once.independent


@pytest.mark.parametrize(
    ("direct", "shift", "told"),
    [
        (0.0, -1, "feedback"),
        (0.0, 0, "feedback"),  # the model cannot answer at once, so a controller has
        (0.0, 1, "input_in_residual"),
        (2.0, -1, "feedback"),
        (2.0, 0, "input_in_residual"),
        (2.0, 1, "input_in_residual"),
    ],
)
def test_an_input_in_the_residual_is_told_by_its_lag(direct, shift, told):
    rng = np.random.default_rng(0)
    u = rng.standard_normal(1002)
    plant = ct.ss([[0.5]], [[1.0]], [[0.5]], [[direct]], DT)
    y = cr.DelayedStateSpace(plant).simulate(u) + 0.1 * rng.standard_normal(1002)
    # what is left follows the input of `shift` samples before: 0.1 of it, sigma is 0.03
    y = (y + 0.03 * np.roll(u, shift))[1:-1]
    for system in (plant, ct.tf(plant), cr.DelayedStateSpace(plant)):
        check = cr.validation.analyse_residuals(system, cr.Record(DT * np.arange(1000), u[1:-1], y))
        assert [flag.code for flag in check.flags] == [told]
        assert check.independent == (told == "feedback")
        assert np.abs(check.cross[0, 0]).argmax() == 25 + shift


def test_predictions_fall_from_the_noise_model_to_the_simulation():
    one = record(noise=0.1, colour=0.95, n=2000)
    simulated = cr.validation.analyse_residuals(TWO_STATES, one).fit_percent[0]
    fits = [cr.validation.predict(TWO_STATES, one, k).fit_percent[0] for k in (1, 5, 20, 200)]
    assert fits[0] > fits[1] > fits[2]
    assert abs(fits[-1] - simulated) < 2.0
    prediction = cr.validation.predict(TWO_STATES, one, 1)
    # what is left one step ahead is the innovation, of 0.1
    assert_allclose(np.std(one.output - prediction.output), 0.1, rtol=0.06)
    assert prediction.noise_order == (1,)
    assert "1 samples ahead" in prediction.report()
    # as far ahead as the record is long there is no past, whatever the horizon
    analysis = cr.validation.analyse_residuals(TWO_STATES, one)
    for horizon in (2000, 10**9):
        assert_array_equal(
            cr.validation.predict(TWO_STATES, one, horizon).output, analysis.simulated
        )


def test_records_of_equal_names_have_a_column_each():
    names = {"x": 0.0, "x (2)": 0.1, "x ": 1.0}
    records = [record(noise=s, n=200, label=name.strip()) for name, s in names.items()]
    table = cr.validation.cross_validate(TWO_STATES, records)
    fits = [cr.validation.analyse_residuals(TWO_STATES, one).fit_percent[0] for one in records]
    assert_allclose(table.to_numpy(), [fits])
    assert table.columns.is_unique


@pytest.mark.parametrize(
    ("plant", "length", "order", "least"),
    [("hairdryer", 60, 2, 91.0), ("gas_furnace", 30, 2, 55.0), ("exchanger", 250, 3, 62.0)],
)
def test_measured_plants_are_predicted_on_the_half_that_was_not_used(plant, length, order, least):
    first, second = halves(f"{plant}/record")
    model = cr.estimate_delay(cr.impulse_from_io(first, length), order, max_delay=10)
    assert cr.validation.analyse_residuals(model, second).fit_percent[0] > least
    assert cr.validation.predict(model, second, 1).fit_percent[0] > least + 3


@pytest.mark.parametrize("delay", [0, 4])
def test_an_integrating_plant_rests_at_a_level_of_the_input_that_is_not_the_first(delay):
    """The record starts in operation: about its first input the model was a ramp."""
    rng = np.random.default_rng(0)
    u, noise = 3 + rng.standard_normal(500), 0.05 * rng.standard_normal(500)
    late = np.r_[np.zeros(1 + delay), (u - 3)[: 499 - delay]]
    y = 0.1 * np.cumsum(late) + noise
    tank = cr.DelayedStateSpace(ct.ss([[1.0]], [[1.0]], [[0.1]], [[0.0]], DT), delay)
    check = cr.validation.analyse_residuals(tank, cr.Record(DT * np.arange(500), u, y))
    # noise, less what the unknown start takes of 500 samples
    assert check.residual.std() == pytest.approx(0.05, rel=0.1)
    assert check.independent
    assert check.white
