"""Ultimate gain and period against closed forms, and the rules that start there."""

import control as ct
import numpy as np
import pytest
from scipy.optimize import brentq

import ctrl_realize as cr
from ctrl_realize import design
from ctrl_realize.errors import UnsuitableSystemError

RATE, WAIT = 0.1, 3.0
INTEGRATOR = design.ProcessModel(gain=RATE, lag=0.0, dead_time=WAIT, integrating=True)
K_U, T_U = np.pi / (2 * RATE * WAIT), 4 * WAIT  # of k exp(-L s) / s


@pytest.mark.parametrize("sign", [1, -1])
def test_an_integrator_with_dead_time_has_a_quarter_period_of_dead_time(sign):
    plant = ct.tf([sign * RATE], [1, 0]) * cr.delay(WAIT)
    for found in (design.ultimate(plant), design.ultimate(plant.to_discrete(0.3), continuous=True)):
        assert found.gain == pytest.approx(sign * K_U, rel=1e-9)
        assert found.period == pytest.approx(T_U, rel=1e-9)
        assert found.dt == 0
        assert found.gain_interval is None


def test_behind_a_hold_an_integrator_has_half_a_sample_more_dead_time():
    # h k / (z - 1) z^-d is k exp(-(L + h / 2) s) / s times (w h / 2) / sin(w h / 2)
    h = 0.3
    found = design.ultimate(INTEGRATOR.system(h))
    omega = np.pi / 2 / (WAIT + h / 2)
    assert found.dt == h
    assert found.period == pytest.approx(2 * np.pi / omega, rel=1e-9)
    assert found.gain == pytest.approx(2 * np.sin(omega * h / 2) / (RATE * h), rel=1e-9)


def test_the_ultimate_point_of_one_lag_solves_its_phase_condition():
    K, T, L = 2.0, 20.0, 5.0
    omega = brentq(lambda w: w * L + np.arctan(w * T) - np.pi, 0.1, 1.0, xtol=1e-15)
    for model in (design.ProcessModel(K, T, L), design.ProcessModel(-K, T, L)):
        found = design.ultimate(model)
        assert abs(found.gain) == pytest.approx(np.hypot(1, omega * T) / K, rel=1e-9)
        assert np.sign(found.gain) == np.sign(model.gain)
        assert found.period == pytest.approx(2 * np.pi / omega, rel=1e-9)


@pytest.mark.parametrize("unit", [1e-12, 1e9, 1e12])
def test_the_ultimate_gain_has_no_unit_of_time(unit):
    # a pole of 1e-10 rad/s counted as an integrator: gain -15.9 for 5.89
    one, other = (
        design.ultimate(ct.tf([1], [10 * time, 1]) * cr.delay(3 * time)) for time in (1.0, unit)
    )
    assert other.gain == pytest.approx(one.gain, rel=1e-9)
    assert other.period == pytest.approx(unit * one.period, rel=1e-9)


@pytest.mark.parametrize(
    ("plant", "words"),
    [
        (ct.tf([1], [1, 1]), "never reaches"),
        (ct.tf([1], [1, 0, 0]) * cr.delay(1.0), "small gains"),
        (ct.tf([1], [1, -1]) * cr.delay(0.1), "small gains"),
        (cr.delayed_ss(ct.tf([1], [1, -1]), dead_time=0.1, dt=0.01), "small gains"),
    ],
)
def test_plants_without_an_ultimate_gain_are_refused(plant, words):
    with pytest.raises(UnsuitableSystemError, match=words):
        design.ultimate(plant)


def test_a_sign_that_is_given_stands_above_that_of_the_static_gain():
    # a slow part of the other sign, as a drift leaves it in a fit
    wanted = design.ProcessModel(2.0, 20.0, 5.0)
    plant = (ct.tf([2.0], [20.0, 1]) - ct.tf([5.0], [9000.0, 1])) * cr.delay(5.0)
    right, found = design.ultimate(wanted), design.ultimate(plant, reverse=False)
    assert design.ultimate(plant).gain < 0 < found.gain
    assert found.gain == pytest.approx(right.gain, rel=0.02)
    assert found.period == pytest.approx(right.period, rel=0.02)


@pytest.mark.parametrize(("unit", "name"), [(1e-6, "µs"), (1e-3, "ms"), (1.0, "s")])
def test_times_are_told_in_a_unit_of_their_size(unit, name):
    # an integrator: the period is four dead times and two samples of the hold
    plant = design.ProcessModel(1.0 / unit, 0.0, 5.0 * unit, integrating=True).system(2.0 * unit)
    told = design.ultimate(plant)
    assert f"period 24 {name}, behind a hold of 2 {name}>" in repr(told)
    rule = design.compare_pid(plant, ["simc"], ["PI"])
    error = rule.performance[0].setpoint_error / unit
    assert f"set-point {error:.3g} {name}, overshoot" in rule.report()


def test_intervals_are_the_extremes_over_the_plausible_models():
    heater = cr.bench.heater()
    sys = cr.identify(heater.step_record(rng=1))
    for continuous in (False, True):
        found = design.ultimate(sys, continuous=continuous)
        plant = heater.truth.sampled
        truth = design.ultimate(plant, continuous=continuous)
        assert (found.dt, truth.gain_interval) == (0 if continuous else 1, None)
        for name in ("gain", "period"):
            low, high = getattr(found, f"{name}_interval")
            assert low <= getattr(truth, name) <= high
            assert low <= getattr(found, name) <= high
        low, high = found.gain_interval
        assert f"{low:.4g} to {high:.4g}" in found.report()
    assert "continuous" in repr(found)
    gains = [design.ultimate(one).gain for one in sys.fit.plausible_models.systems]
    assert design.ultimate(sys).gain_interval == pytest.approx((min(gains), max(gains)), rel=1e-9)


@pytest.mark.parametrize(
    ("rule", "kind", "expected"),
    [
        ("ziegler_nichols_ultimate", "P", (0.5 * K_U, np.inf, 0)),
        ("ziegler_nichols_ultimate", "PI", (0.45 * K_U, T_U / 1.2, 0)),
        ("ziegler_nichols_ultimate", "PID", (0.6 * K_U, T_U / 2, T_U / 8)),
        ("tyreus_luyben", "PI", (K_U / 3.2, 2.2 * T_U, 0)),
        ("tyreus_luyben", "PID", (K_U / 2.2, 2.2 * T_U, T_U / 6.3)),
    ],
)
@pytest.mark.filterwarnings("ignore:Ms is:ctrl_realize.errors.ModelWarning")  # on purpose
def test_rules_that_start_there_give_their_published_parameters(rule, kind, expected):
    found = design.pid(INTEGRATOR, rule, kind)
    np.testing.assert_allclose((found.kp, found.ti, found.td), expected, rtol=1e-9)


def test_tyreus_and_luyben_is_their_tuning_of_an_integrator_with_dead_time():
    # printed for k exp(-L s) / s: Kc = 0.487 / (k L), tau_I = 8.75 L (1992)
    found = design.pid(INTEGRATOR, "tyreus_luyben", "PI")
    assert found.kp == pytest.approx(0.487 / (RATE * WAIT), rel=0.01)
    assert found.ti == pytest.approx(8.75 * WAIT, rel=0.01)


def test_chr_rules_keep_the_overshoot_that_they_are_named_for():
    plant = design.ProcessModel(gain=2.0, lag=10.0, dead_time=3.0)
    rules = [f"chr_{what}_{share}" for what in ("setpoint", "load") for share in (0, 20)]
    table = design.compare_pid(plant, rules, ["PI"]).table().set_index("rule")
    assert table.overshoot["chr_setpoint_0"] < 0.01
    assert 0.1 < table.overshoot["chr_setpoint_20"] < 0.2
    for share in ("0", "20"):
        assert table.iae_load[f"chr_load_{share}"] < table.iae_load[f"chr_setpoint_{share}"]


@pytest.mark.parametrize("load", [False, True], ids=["setpoint", "load"])
@pytest.mark.filterwarnings("ignore:Ms is:ctrl_realize.errors.ModelWarning")  # on purpose
def test_no_neighbour_of_the_itae_pi_is_much_better(load):
    model, dt = design.ProcessModel(gain=2.0, lag=10.0, dead_time=3.0), 0.1
    plant, time = model.system(dt), dt * np.arange(1200)
    rule = design.pid(model, "itae_load" if load else "itae_setpoint", "PI")

    def itae(kp, ti):
        pi = design.PIDController(kp, ti, dt=dt)
        loop = ct.feedback(plant, pi) if load else ct.feedback(plant * pi)
        response = np.asarray(loop.step(time.size)).ravel()
        return float(np.sum(time * np.abs(response if load else 1 - response)))

    least = itae(rule.kp, rule.ti)
    for share in (0.75, 1.3):
        assert itae(share * rule.kp, rule.ti) > 0.93 * least
        assert itae(rule.kp, share * rule.ti) > 0.93 * least


def test_itae_rules_are_refused_outside_the_ratios_that_they_were_fitted_to():
    with pytest.raises(UnsuitableSystemError, match=r"0\.1 to 1 lags, the model has 2"):
        design.pid(design.ProcessModel(1.0, 1.0, 2.0), "itae_setpoint")
    for rule in ("chr_load_0", "itae_load"):
        with pytest.raises(UnsuitableSystemError, match="integrating"):
            design.pid(INTEGRATOR, rule)


def test_the_ultimate_gain_has_its_closed_form_in_every_unit_of_time():
    for dead_time in (1e-6, 1.0, 1e8):  # pi / (2 k L) and 4 L of k exp(-L s) / s
        model = design.ProcessModel(1.0, 0.0, dead_time, integrating=True)
        found = design.ultimate(model)
        assert found.gain * dead_time == pytest.approx(np.pi / 2, rel=1e-9)
        assert found.period == pytest.approx(4 * dead_time, rel=1e-9)


def test_an_integrator_alone_is_refused_by_what_its_loop_lacks():
    with pytest.raises(UnsuitableSystemError, match=r"no lag and no dead time.*cr\.delay\(1\)"):
        cr.design.ultimate(ct.tf([1.0], [1, 0]))
