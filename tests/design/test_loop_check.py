"""What design functions say of the loop on the model itself."""

import pickle
import re
import warnings

import control as ct
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import ctrl_realize as cr
from ctrl_realize.errors import ModelWarning, OptionError, UnsuitableSystemError
from ctrl_realize.io import FitSummary
from tests import rigs


def fit_with_interval(interval, **values):
    values["dead_time_interval"] = interval
    return FitSummary("Fit", "Fit", (), values=tuple(values.items()))


def typed(message, sys):
    """Make the controller that a message says to type, without any further warning."""
    return eval(
        re.search(r"(?:Try |is )(design\.pid\(.*?\))(?:: |,)", message)[1], vars(cr) | {"sys": sys}
    )


def furnace():
    """A lag of 40 min behind 6 min of dead time, and a drift that looks like a lag of three days.

    Least squares over the whole step response see the drift only.
    """
    core = ct.tf([2.0], [2400.0, 1]) + ct.tf([7.0], [2.5e5, 1])
    return cr.design.to_discrete(core, 360.0, 30.0)


def quick():
    return cr.design.ProcessModel(gain=1.0, lag=0.08, dead_time=0.029).system(0.001)


def outside(plant, controller):
    """Closed-loop poles outside the unit circle, of the augmented matrices."""
    return np.sum(np.abs(ct.feedback(ct.ss(plant) * ct.ss(controller), 1).poles()) > 1 + 1e-9)


@settings(max_examples=25, deadline=None)
@given(
    fast=st.floats(0.5, 5),
    ratio=st.floats(3, 300),
    share=st.floats(0.1, 10),
    wait=st.floats(0.05, 4),
    order=st.sampled_from(["fopdt", "sopdt"]),
)
def test_a_reduction_has_no_less_dead_time_than_its_system(fast, ratio, share, wait, order):
    core = ct.tf([1.0], [fast, 1]) + ct.tf([share], [fast * ratio, 1])
    plant = cr.design.to_discrete(core, wait, 0.05 * fast)
    reduce = cr.design.reduce_fopdt if order == "fopdt" else cr.design.reduce_sopdt
    for method in ("optimal", "half_rule"):
        assert reduce(plant, method=method).dead_time >= wait * (1 - 1e-6)


@pytest.mark.parametrize(("rule", "kind"), [("simc", "PI"), ("simc", "PID"), ("amigo", "PI")])
def test_a_controller_that_is_unstable_on_its_own_model_is_refused_for_one_that_is_stable(
    rule, kind
):
    with pytest.raises(UnsuitableSystemError, match="does not stabilize the model") as refused:
        cr.design.pid(furnace(), rule, kind)
    made = typed(str(refused.value), furnace())
    assert outside(furnace(), made) == 0
    ms = re.search(r"\): Ms ([\d.]+)", str(refused.value))[1]
    assert made.check.margins.ms == pytest.approx(float(ms), rel=5e-3)


@pytest.mark.parametrize("gain", [1.0, -3.0])
def test_a_dead_time_within_the_interval_that_makes_the_loop_unstable_is_said(gain):
    plant = quick() * gain
    limit = 0.029 + cr.design.pid(plant).check.margins.delay_margin
    sure = plant.replace(fit=fit_with_interval((0.02, limit - 0.002)))
    with pytest.warns(
        ModelWarning, match=r"Ms is [\d.]+, more than 2, at a dead time of .* Try design\.pid"
    ):
        made = cr.design.pid(sure)
    assert made.check.stable_within_interval
    assert "stable, dead time" in made.report()
    unsure = plant.replace(fit=fit_with_interval((0.02, limit + 0.002)))
    with pytest.warns(ModelWarning, match="unstable for some dead time") as warned:
        made = cr.design.pid(unsure)
    assert warned[0].filename == __file__
    assert made.check.stable
    assert made.check.stable_within_interval is False
    assert outside(plant.replace(delay=round(limit / 0.001) + 1), made) > 0
    assert [flag.code for flag in made.check.flags] == ["unstable_within_interval"]
    assert "UNSTABLE somewhere" in made.report()


def test_the_best_of_a_comparison_is_stable_over_the_interval():
    limit = 0.029 + cr.design.pid(quick()).check.margins.delay_margin
    unsure = quick().replace(fit=fit_with_interval((0.02, limit + 0.002)))
    found = cr.design.compare_pid(unsure, ["simc", "amigo"], ["PI"])
    with pytest.warns(ModelWarning, match=r"Ms is .* best of the table"):
        assert found.best(max_sensitivity=5).rule == "amigo"
    assert "PI simc: the loop is unstable for some dead time" in found.report()
    none = cr.design.compare_pid(unsure, ["simc"], ["PI"])
    with pytest.raises(OptionError, match="1 are unstable within the interval"):
        none.best(max_sensitivity=5)


def test_the_best_of_a_comparison_is_robust_over_the_interval_if_any_is():
    plant = quick().replace(fit=fit_with_interval((0.029, 0.045)))
    found = cr.design.compare_pid(plant, ["simc", "amigo"], ["PI"])
    load = dict(zip(found.table()["rule"], found.table()["iae_load"], strict=True))
    assert load["simc"] < load["amigo"]
    assert found.best().rule == "amigo"


def test_a_comparison_refuses_what_no_rule_can_tune_once():
    with pytest.raises(UnsuitableSystemError, match=r"^a PID controller needs one input"):
        cr.design.compare_pid(ct.ss([], [], [], np.eye(2), 0.1))


def brute_ms(plant, controller):
    """Largest 1 / |1 + L| on a fine grid."""
    z = np.exp(1j * np.linspace(1e-4, np.pi, 40001))
    return np.max(1 / np.abs(1 + plant(z) * controller(z)))


@pytest.mark.parametrize("sign", [1, -1])
@pytest.mark.parametrize(
    ("dead_times", "gains"),
    [(None, (0.7, 1.6)), ((0.02, 0.05), None), ((0.02, 0.04), (0.8, 1.5)), ((0.03, 0.05), (1, 1))],
)
def test_ms_at_the_corners_of_the_intervals_is_that_of_such_a_plant(sign, dead_times, gains):
    gains = None if gains is None else tuple(sorted(sign * end for end in gains))
    fit = fit_with_interval(dead_times, gain=float(sign), gain_interval=gains)
    plant = (sign * quick()).replace(fit=fit)
    with pytest.warns(ModelWarning) as warned:
        made = cr.design.pid(plant)
    times, factors = dead_times or (0.029,), [abs(end) for end in gains or (1.0,)]
    plants = [plant.replace(delay=round(t / 0.001)) * k for t in times for k in factors]
    # grid of 8e-5 rad, by which a maximum is missed by less than 1e-6 of it
    worst = max(brute_ms(each, made) for each in plants)
    assert made.check.worst.ms == pytest.approx(worst, rel=1e-5)
    assert made.check.margins.ms < 2 < worst
    assert [flag.code for flag in made.check.flags] == ["sensitive_within_interval"]
    message = str(warned[0].message)
    assert (
        f"Ms is {worst:.3g}, more than 2, at a dead time of {1000 * max(times):.4g} ms" in message
    )
    assert (f"a gain of {sign * max(factors):.4g}" in message) or gains is None
    assert f"Ms {worst:.3g}" in made.report()
    robust = typed(message, plant)
    assert max(brute_ms(each, robust) for each in plants) < 2


def test_the_loop_of_an_identified_plant_is_checked_with_models_that_fit_as_well():
    record = rigs.step_record(rigs.R2, before=300, after=900, dt=0.02, delay=20, noise=0.03, seed=2)
    plant = cr.fit_output_error(record)
    made = cr.design.pid(plant)
    every = sorted(brute_ms(each, made) for each in plant.fit.plausible_models.systems)
    assert made.check.worst.ms == pytest.approx(every[-2], rel=1e-4)
    assert f"Ms {every[-2]:.3g}, with a plausible model: lags of its own, " in made.report()
    assert not made.check.flags


def test_the_gain_of_a_corner_of_an_integrating_plant_is_its_slope():
    """It was that of the rounding of a pole at zero: 21 530 for 0.048."""
    time = np.arange(200.0)
    y = 0.05 * np.clip(time - 52, 0, None) + 0.01 * np.random.default_rng(1).standard_normal(200)
    sys = cr.identify(cr.Record(time, np.where(time < 40, 0.0, 1.0), y))
    assert sys.fit.integrators == 1
    for corner in cr.design.pid(sys).check.corners:
        assert corner.gain == pytest.approx(0.05, rel=0.02)


def test_a_gain_that_makes_the_loop_unstable_is_said_with_the_corner():
    fit = fit_with_interval((0.0289, 0.0291), gain=1.0, gain_interval=(0.5, 4.0))
    with pytest.warns(ModelWarning, match=r"unstable at a dead time of .* and a gain of 4, ends"):
        made = cr.design.pid(quick().replace(fit=fit))
    assert made.check.stable
    assert outside(4 * quick(), made) > 0
    assert [flag.code for flag in made.check.flags] == ["unstable_within_interval"]


def output_weight(plant):
    return plant.delay_free.C.T @ plant.delay_free.C


DESIGNS = {
    "smith_predictor": lambda plant: cr.design.smith_predictor(
        plant, cr.design.PIDController(3.0, 0.08, dt=0.001)
    ),
    "predictor_lqr": lambda plant: cr.design.predictor_lqr(plant, output_weight(plant), 0.001),
    "lqg": lambda plant: cr.design.lqg(plant, output_weight(plant), 0.001, 1.0, 0.01),
}


GROWING = cr.delayed_ss(ct.ss([[1.02]], [[1.0]], [[0.1]], [[0.0]], 0.001), 20)
QUICK = quick()
AGGRESSIVE = {
    "pid": (QUICK, lambda: cr.design.pid(QUICK, "ziegler_nichols")),
    "optimal pid": (QUICK, lambda: cr.design.pid(QUICK, "optimal", max_sensitivity=2.5)),
    "table": (QUICK, lambda: cr.design.compare_pid(QUICK, ["cohen_coon"], ["PI"]).best(9)),
    "smith_predictor": (
        QUICK,
        lambda: cr.design.smith_predictor(QUICK, cr.design.PIDController(3.0, 0.005, dt=0.001)),
    ),
    "predictor_lqr": (GROWING, lambda: cr.design.predictor_lqr(GROWING, 1.0, 1.0)),
    "lqg": (GROWING, lambda: cr.design.lqg(GROWING, 1.0, 1.0, 1.0, 1.0)),
}


@pytest.mark.parametrize("design", AGGRESSIVE)
def test_every_design_function_warns_of_an_ms_above_two_with_what_to_try(design):
    plant, make = AGGRESSIVE[design]
    with pytest.warns(
        ModelWarning, match=r"Ms is [\d.]+, more than 2, on the model itself.*(Try |design\.pid)"
    ) as warned:
        made = make()
    assert warned[0].filename == __file__
    assert [flag.code for flag in made.check.flags] == ["sensitive"]
    assert f"Ms is {made.check.margins.ms:.3g}, more than 2, on" in str(warned[0].message)
    assert made.check.margins.ms > 2
    if design != "predictor_lqr":  # whose loop is that of the states
        assert made.check.margins.ms == pytest.approx(brute_ms(plant, made), rel=1e-5)


def test_a_continuous_smith_predictor_warns_of_an_ms_above_two():
    plant = ct.tf([1], [0.08, 1]) * cr.delay(0.029)
    with pytest.warns(
        ModelWarning, match=r"Ms is [\d.]+, more than 2, on the model itself.*filter_time=0\.029"
    ):
        cr.design.smith_predictor(plant, cr.design.PIDController(3.0, 0.005))
    cr.design.smith_predictor(plant, cr.design.PIDController(1.0, 0.08))


@pytest.mark.parametrize("design", DESIGNS)
def test_every_design_function_says_what_the_interval_of_the_dead_time_does(design):
    made = DESIGNS[design](quick())
    assert made.check.stable
    assert made.check.robustness is None
    assert "on the design model" in made.report()
    limit = 0.029 + made.check.margins.delay_margin
    sure = quick().replace(fit=fit_with_interval((0.0289, 0.0291)))
    assert DESIGNS[design](sure).check.stable_within_interval
    unsure = quick().replace(fit=fit_with_interval((0.0289, limit + 0.002)))
    with pytest.warns(ModelWarning, match="unstable for some dead time") as warned:
        made = DESIGNS[design](unsure)
    assert warned[0].filename == __file__
    assert made.check.stable_within_interval is False
    assert "UNSTABLE somewhere" in made.report()


def test_the_loop_of_a_state_feedback_ends_where_brute_force_says():
    """The core's state is measured, the delay of the plant is not the one that was expected."""
    plant = quick()
    law = cr.design.predictor_lqr(plant, output_weight(plant), 0.001)
    core, d, gain = plant.delay_free, plant.delay, law.gain[0]
    limit = d + int(np.ceil(law.check.margins.delay_margin_samples)) - 1

    def radius(delay):
        n = 1 + max(delay, d)
        A = np.diag(np.ones(n - 2), -1) if n > 2 else np.zeros((n - 1, n - 1))
        full = np.zeros((n, n))
        full[0, 0] = core.A[0, 0]
        full[0, delay] = core.B[0, 0]
        full[1:, 1:] = A
        full[1, : d + 1] = -gain
        return np.abs(np.linalg.eigvals(full)).max()

    assert radius(d) < 1
    assert radius(limit) < 1 < radius(limit + 1)


def test_the_comparison_still_shows_what_is_unstable():
    found = cr.design.compare_pid(furnace(), ["simc"], ["PI"])
    assert list(found.table()["stable"]) == [False]
    assert "UNSTABLE" in found.controllers[0].report()


def test_a_controller_remembers_what_its_loop_does():
    plant = quick()
    made = cr.design.pid(plant)
    found = cr.design.margins(plant, made)
    for controller in (made, pickle.loads(pickle.dumps(made))):
        assert controller.check.stable
        assert controller.check.margins.ms == pytest.approx(found.ms, rel=1e-12)
        assert f"Ms {found.ms:.3g}" in controller.report()
    assert made.check.robustness is None
    assert made.check.stable_within_interval is None
    assert made.discretised(0.002).check is None  # found of another sample time
    assert "stable on the design model" in repr(made.check)


def test_a_process_model_is_checked_in_continuous_time():
    model = cr.design.ProcessModel(gain=1.0, lag=0.08, dead_time=0.029)
    made = cr.design.pid(model)
    exact = cr.design.margins(model.transfer_function(), made, dead_time=0.029)
    assert made.check.margins.delay_margin == pytest.approx(exact.delay_margin, rel=1e-12)


def test_dead_times_of_plausible_models_are_their_own_not_whole_samples():
    # No dead time, known to a tenth of a sample; a sample more would make the loop unstable.
    t = np.arange(600.0)
    rng = np.random.default_rng(1)
    y = -np.expm1(-np.maximum(t - 60, 0) / 15) + 0.005 * rng.standard_normal(600)
    sys = cr.identify(cr.Record(t, (t >= 60) * 1.0, y))
    with warnings.catch_warnings():
        # Ms is 2 and more: the loop is as fast as the sampling lets it be
        warnings.simplefilter("ignore", ModelWarning)
        check = cr.design.pid(sys).check
    assert sys.fit.interval[1] < 0.2
    assert check.margins.delay_margin < 1.0
    assert check.stable_within_interval
    assert check.worst.dead_time < 0.5
    assert re.search("over the interval +stable", check.report())
