"""What design functions say of the loop on the model itself."""

import pickle
import re

import control as ct
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import ctrl_realize as cr
from ctrl_realize.errors import ModelWarning, OptionError, UnsuitableSystemError
from ctrl_realize.io import FitSummary


def fit_with_interval(interval):
    return FitSummary("Fit", "Fit", (), values=(("dead_time_interval", interval),))


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
    named = re.search(
        r"Use rule='(\w+)', kind='(\w+)', reduction='(\w+)'.* Ms = ([\d.]+)", str(refused.value)
    )
    rule, kind, reduction, ms = named.groups()
    made = cr.design.pid(furnace(), rule, kind, reduction=reduction)
    assert outside(furnace(), made) == 0
    assert made.check.margins.ms == pytest.approx(float(ms), rel=5e-3)


@pytest.mark.parametrize("gain", [1.0, -3.0])
def test_a_dead_time_within_the_interval_that_makes_the_loop_unstable_is_said(gain):
    plant = quick() * gain
    limit = 0.029 + cr.design.pid(plant).check.margins.delay_margin
    sure = plant.replace(fit=fit_with_interval((0.02, limit - 0.002)))
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
    assert found.best(max_sensitivity=5).rule == "amigo"
    assert "PI simc: the loop is unstable for some dead time" in found.report()
    none = cr.design.compare_pid(unsure, ["simc"], ["PI"])
    with pytest.raises(OptionError, match="1 are unstable within the interval"):
        none.best(max_sensitivity=5)


def output_weight(plant):
    return plant.delay_free.C.T @ plant.delay_free.C


DESIGNS = {
    "smith_predictor": lambda plant: cr.design.smith_predictor(
        plant, cr.design.PIDController(3.0, 0.08, dt=0.001)
    ),
    "predictor_lqr": lambda plant: cr.design.predictor_lqr(plant, output_weight(plant), 0.001),
    "lqg": lambda plant: cr.design.lqg(plant, output_weight(plant), 0.001, 1.0, 0.01),
}


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
