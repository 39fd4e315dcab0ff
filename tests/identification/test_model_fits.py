"""What the results of all estimators have in common, and that a model file keeps it."""

import control as ct
import numpy as np
import pytest

import ctrl_realize as cr
from ctrl_realize.design import reduce
from ctrl_realize.frequency import fit_frf
from ctrl_realize.identification import DelayTracker, fit_state_space, realize_mimo
from ctrl_realize.io import FitSummary
from ctrl_realize.results import INTERVAL_LABELS, ModelFit
from tests.test_cards import assert_says_itself

DT = 0.01
TIME = DT * np.arange(900)
STEP = cr.Record(
    TIME,
    np.where(TIME < 1.0, 0.0, 2.0),
    np.where(TIME < 1.125, 0.0, 6 * -np.expm1(-(TIME - 1.125) / 0.4))
    + 0.01 * np.random.default_rng(1).standard_normal(900),
    name="step",
)
PULSE = np.r_[np.zeros(38), 0.1 * 0.9 ** np.arange(300)]
PLANT = cr.delayed_ss(ct.ss([[0.8]], [[1.0]], [[0.2]], [[0.0]], DT), 5)


def random_record() -> cr.Record:
    u, noise = np.random.default_rng(0).standard_normal((2, 300))
    return cr.Record(DT * np.arange(300), u, PLANT.simulate(u) + 0.05 * noise)


def measured_frf() -> cr.MeasuredFRF:
    f = np.geomspace(0.1, 20, 80)
    s = 2j * np.pi * f
    noise = 0.01 * np.random.default_rng(0).standard_normal((80, 2)) @ [1, 1j]
    return cr.MeasuredFRF(2 * np.exp(-0.0289 * s) / (0.08 * s + 1) ** 2 + noise, f)


def joint_frf() -> cr.MeasuredFRF:
    f = np.geomspace(0.1, 2, 12)
    s = 2j * np.pi * f
    noise = 0.01 * np.random.default_rng(0).standard_normal((12, 2)) @ [1, 1j]
    return cr.MeasuredFRF(3 * np.exp(-0.125 * s) / (0.4 * s + 1) + noise, f)


def tracked() -> cr.DelayedStateSpace:
    tracker = DelayTracker(PLANT, max_delay=20, forgetting_time=3.0)
    u = np.repeat(np.random.default_rng(0).choice([-1.0, 1.0], 40), 25)
    for sample in zip(u, PLANT.simulate(u), strict=True):
        tracker.update(*sample)
    return tracker.model


MADE = {
    "output error": lambda: cr.fit_output_error(STEP, structures=[(1, 1)]),
    "joint": lambda: cr.identify(STEP, frf=joint_frf(), order=1),
    "scan": lambda: cr.identify(STEP, method="scan", order=1),
    "realization": lambda: cr.realize(PULSE, 1, delay=37, dt=DT),
    "several channels": lambda: realize_mimo(PULSE, 1, dt=DT),
    "state space": lambda: fit_state_space(random_record(), 1),
    "frequency response": lambda: fit_frf(measured_frf(), 2),
    "reduction": lambda: reduce(PLANT, 1),
    "tracker": tracked,
}
CORE = [
    "dead_time", "interval", "interval_kind", "interval_label", "delay", "delay_interval",
    "total_delay", "total_delay_interval", "onset", "order", "gain", "gain_interval",
    "gain_std_given_structure", "residual_std", "sampling", "choices", "flags",
]  # fmt: skip


@pytest.fixture(scope="module", params=MADE)
def system(request):
    return MADE[request.param]()


def test_every_estimator_gives_a_fit_with_the_same_core(system):
    fit = system.fit
    assert isinstance(fit, ModelFit)
    for name in (*CORE, "records"):
        getattr(fit, name)
    assert all(isinstance(record, cr.Record) for record in fit.records)
    assert fit.interval_label == INTERVAL_LABELS[fit.interval_kind]
    if fit.delay is not None:
        exact = isinstance(fit, cr.identification.OutputErrorFit | cr.identification.DelayScan)
        off = abs(fit.delay - fit.dead_time / system.dt)
        assert off <= (1e-9 if exact else 0.5 + 1e-9)
    if fit.interval is not None:
        low, high = fit.interval
        assert low - system.dt / 2 <= fit.dead_time <= high + system.dt / 2
        # a whole delay of a tracker stands for the dead times within half a sample
        half = np.array([-0.5, 0.5]) * (fit.interval_kind == "tracked")
        ends = (np.array(fit.delay_interval) + half) * system.dt
        np.testing.assert_allclose(ends, fit.interval)


def test_a_model_file_keeps_the_core(system, tmp_path):
    cr.save_model(tmp_path / "a.json", system)
    kept = cr.load_model(tmp_path / "a.json").fit
    for name in CORE:
        np.testing.assert_equal(getattr(kept, name), getattr(system.fit, name), err_msg=name)
    assert kept.report() == system.fit.report()


def test_a_fit_says_itself_and_is_the_same_after_pickling(system):
    assert_says_itself(system.fit)


def test_a_result_holds_the_estimate_and_cannot_be_changed():
    fit = cr.fit_output_error(STEP, structures=[(1, 1)]).fit
    assert (fit.dead_time, fit.interval) == (
        fit.estimate.dead_time,
        (fit.estimate.low, fit.estimate.high),
    )
    assert fit.structures is fit.estimate.structures
    for values in (fit.time, fit.measured, fit.fitted, fit.poles, fit.estimate.profile[0]):
        assert not values.flags.writeable


def test_a_loaded_model_of_an_impulse_invariant_response_is_compared_without_the_hold(tmp_path):
    # A central difference samples the analog response: no hold is to be divided out.
    system = cr.identify(STEP, method="paper", max_delay=40, samples=300, cutoff_hz=20.0)
    cr.save_model(tmp_path / "a.json", system)
    loaded = cr.load_model(tmp_path / "a.json")
    f = np.geomspace(0.1, 5, 20)
    frf = cr.MeasuredFRF(np.asarray(system(np.exp(2j * np.pi * f * DT))), f)
    found = [cr.compare_frf(model, frf).rms_relative_error for model in (system, loaded)]
    assert found[0] == found[1] < 1e-9


def test_an_older_summary_is_read():
    rows = (("delay", "37 samples"),)
    values = (("delay", 37), ("dead_time", 0.37), ("interval", (0.36, "inf")))
    kept = FitSummary("DelayScan", "Delay scan", rows, values)
    assert (kept.interval_kind, kept.interval) == (None, (0.36, np.inf))
    assert kept.interval_label == INTERVAL_LABELS["flatness"]
    assert (kept.choices, kept.gain, kept.onset) == ((), None, None)
