"""Tuning rules against their published forms, loops against brute-force simulation."""

import warnings

import control as ct
import numpy as np
import pytest

import ctrl_realize as cr
from tests.oracles.dense import step_response

DT = 7.8125e-4
FOPDT = cr.design.ProcessModel(gain=2.0, lag=10.0, dead_time=2.0)
SOPDT = cr.design.ProcessModel(gain=2.0, lag=10.0, dead_time=2.0, second_lag=3.0)
SLOW = cr.design.ProcessModel(gain=2.0, lag=100.0, dead_time=1.0)
IPDT = cr.design.ProcessModel(gain=0.5, lag=0.0, dead_time=2.0, integrating=True)


@pytest.mark.parametrize(
    ("model", "rule", "kind", "expected"),
    [  # by hand from the published formulas, K = 2, T = 10, L = 2 (K' = 0.5, L = 2)
        (FOPDT, "simc", "P", (1.25, np.inf, 0)),
        (FOPDT, "simc", "PI", (1.25, 10, 0)),
        (SLOW, "simc", "PI", (25, 8, 0)),  # 4 (tau_c + theta) (Skogestad 2003)
        (SOPDT, "simc", "PID", (1.25 * 1.3, 13, 3 / 1.3)),
        (IPDT, "simc", "PI", (0.5, 16, 0)),
        (FOPDT, "lambda", "PI", (10 / (2 * 12), 10, 0)),
        (IPDT, "lambda", "PI", (14 / (0.5 * 64), 14, 0)),
        (FOPDT, "imc", "PI", (22 / (4 * 3.4), 11, 0)),
        (FOPDT, "imc", "PID", (22 / (4 * 2.6), 11, 20 / 22)),
        (FOPDT, "amigo", "PI", (0.075 + (0.35 - 20 / 144) * 2.5, 0.7 + 2600 / 368, 0)),
        (FOPDT, "amigo", "PID", (1.225, 8.8 / 12 * 2 * 10 / 10, 10 / 10.6)),
        (IPDT, "amigo", "PI", (0.35, 26.8, 0)),
        (IPDT, "amigo", "PID", (0.45, 16, 1)),
        (FOPDT, "ziegler_nichols", "P", (2.5, np.inf, 0)),
        (FOPDT, "ziegler_nichols", "PI", (2.25, 20 / 3, 0)),
        (FOPDT, "ziegler_nichols", "PID", (3.0, 4, 1)),
        (FOPDT, "cohen_coon", "P", (2.5 * (1 + 0.2 / 3), np.inf, 0)),
        (FOPDT, "cohen_coon", "PI", (2.5 * (0.9 + 0.2 / 12), 2 * 30.6 / 13, 0)),
        (FOPDT, "cohen_coon", "PD", (2.5 * (1.25 + 0.2 / 6), np.inf, 2 * 5.6 / 22.6)),
        (FOPDT, "cohen_coon", "PID", (2.5 * (4 / 3 + 0.05), 2 * 33.2 / 14.6, 8 / 11.4)),
        (FOPDT, "chr_setpoint_0", "P", (0.75, np.inf, 0)),
        (FOPDT, "chr_setpoint_0", "PI", (0.875, 12, 0)),
        (FOPDT, "chr_setpoint_0", "PID", (1.5, 10, 1)),
        (FOPDT, "chr_setpoint_20", "P", (1.75, np.inf, 0)),
        (FOPDT, "chr_setpoint_20", "PI", (1.5, 10, 0)),
        (FOPDT, "chr_setpoint_20", "PID", (2.375, 14, 0.94)),
        (FOPDT, "chr_load_0", "P", (0.75, np.inf, 0)),
        (FOPDT, "chr_load_0", "PI", (1.5, 8, 0)),
        (FOPDT, "chr_load_0", "PID", (2.375, 4.8, 0.84)),
        (FOPDT, "chr_load_20", "P", (1.75, np.inf, 0)),
        (FOPDT, "chr_load_20", "PI", (1.75, 4.6, 0)),
        (FOPDT, "chr_load_20", "PID", (3, 4, 0.84)),
        (FOPDT, "itae_load", "PI", (0.859 * 5**0.977 / 2, 10 / (0.674 * 5**0.680), 0)),
        (
            FOPDT,
            "itae_load",
            "PID",
            (1.357 * 5**0.947 / 2, 10 / (0.842 * 5**0.738), 3.81 / 5**0.995),
        ),
        (FOPDT, "itae_setpoint", "PI", (0.586 * 5**0.916 / 2, 10 / 0.997, 0)),
        (FOPDT, "itae_setpoint", "PID", (0.965 * 5**0.85 / 2, 10 / 0.7667, 3.08 / 5**0.929)),
    ],
)
@pytest.mark.filterwarnings("ignore:Ms is:ctrl_realize.errors.ModelWarning")  # on purpose
def test_rules_give_their_published_parameters(model, rule, kind, expected):
    found = cr.design.pid(model, rule, kind)
    if rule == "amigo" and kind == "PID" and not model.integrating:
        expected = (1.225, (0.4 * 2 + 0.8 * 10) / (2 + 1.0) * 2, 0.5 * 20 / (0.6 + 10))
    np.testing.assert_allclose((found.kp, found.ti, found.td), expected, rtol=1e-12)
    assert found.kind == kind
    assert found.dt == 0
    assert found.name == f"{kind}_{rule}"


@pytest.mark.parametrize("dead_time", [0.15, 5.0])
def test_lags_beside_an_integrator_are_dead_time_for_rules_that_have_none(dead_time):
    # Skogestad's half rule: half of the largest lag beside the integrator, all of the others.
    model = cr.design.ProcessModel(0.2, lag=5.0, dead_time=dead_time, integrating=True)
    theta = dead_time + 2.5
    pi = cr.design.pid(model, "simc", reduction="half_rule")
    assert [pi.kp, pi.ti] == pytest.approx([1 / (0.2 * 2 * theta), 8 * theta])
    # Without sampling: the plant whose samples are many times as fast.
    sampled = model.system(dead_time / 60)
    for rule in ("simc", "lambda", "amigo"):
        pi, expected = (cr.design.pid(plant, rule) for plant in (model, sampled))
        assert [pi.kp, pi.ti] == pytest.approx([expected.kp, expected.ti], rel=0.01), rule
        assert pi.check.margins.ms < 1.7, rule


def test_a_second_lag_beside_an_integrator_and_a_lag_is_no_derivative():
    lags = {"lag": 5.0, "second_lag": 2.0, "dead_time": 5.0}
    model = cr.design.ProcessModel(0.2, **lags, integrating=True)
    pid = cr.design.pid(model, "simc", "PID", reduction="half_rule")
    # Half rule: lag 5 + 2/2, dead time 5 + 2/2; in series form ti = 8 theta, td = the lag.
    series, theta = 6.0 / 48.0, 6.0
    expected = [(1 + series) / (0.2 * 2 * theta), 48.0 * (1 + series), 6.0 / (1 + series)]
    assert [pid.kp, pid.ti, pid.td] == pytest.approx(expected)


@pytest.mark.filterwarnings("ignore:Ms is:ctrl_realize.errors.ModelWarning")  # on purpose
def test_a_system_is_tuned_half_a_sample_later_than_its_model():
    plant = FOPDT.system(0.5)
    found = cr.design.pid(plant, "ziegler_nichols", "P")
    assert found.kp == pytest.approx(10 / (2 * 2.25), rel=1e-6)
    assert found.dt == 0.5
    assert found.model.dead_time == pytest.approx(2.25, rel=1e-6)


@pytest.mark.parametrize("plant", [FOPDT, SLOW, IPDT])
@pytest.mark.parametrize("dt", [0.01, 0.1, None])
def test_simc_has_no_derivative_for_a_lag_that_the_plant_has_not(plant, dt):
    core = ct.tf(plant.transfer_function())
    given = plant.system(dt) if dt else core * cr.delay(plant.dead_time)
    pid, pi = (cr.design.pid(given, "simc", kind) for kind in ("PID", "PI"))
    assert (pid.kind, pid.td, pid.name) == ("PI", 0.0, "PI_simc")
    assert pid.kp == pytest.approx(pi.kp, rel=1e-3)
    assert pid.ti == pytest.approx(pi.ti, rel=1e-3)


@pytest.mark.parametrize("kind", ["P", "PI", "PD", "PID"])
@pytest.mark.parametrize("limit", [1.3, 1.6, 2.0])
def test_the_optimal_controller_reaches_its_limit_on_sensitivity(valve, kind, limit):
    plant = valve(37)
    found = cr.design.pid(plant, "optimal", kind, max_sensitivity=limit)
    checked = cr.design.margins(plant, found)
    assert checked.stable
    assert checked.ms == pytest.approx(limit, rel=1e-3)  # limit is read on a grid of 0.05 rad


LAGS = 1 / np.array([1, 1.3, 1.7, 2.2, 2.9, 3.7])


def in_parallel(lags):
    """The series of the lags as their sum: residues of 150 cancel to a gain of 1e-16 beyond."""
    residues = [1 / lag / np.prod([1 - other / lag for other in lags if other != lag])
                for lag in lags]  # fmt: skip
    return ct.ss(np.diag(-1 / lags), np.ones((lags.size, 1)), [residues], 0)


@pytest.mark.parametrize(("core", "dead_time"), [
    # rounding of a series of lags far above the slowest, and of a sum of lags that cancel
    (ct.tf([1], np.poly(-1 / (6 * LAGS)) * np.prod(6 * LAGS)), 0.01),
    (in_parallel(LAGS), 0.003), (in_parallel(LAGS), 0.2),
])  # fmt: skip
def test_an_optimal_controller_is_found_though_the_response_ends_in_rounding(core, dead_time):
    (found,) = cr.design.compare_pid(core * cr.delay(dead_time), ["optimal"], ["PI"]).controllers
    s = 1j * np.geomspace(1e-3, 1e2, 20_000)
    lags = np.prod([1 - s / pole for pole in core.poles()], axis=0)
    loop = found.kp * (1 + 1 / found.ti / s) / lags * np.exp(-s * dead_time)
    # read on a grid of 0.05 rad, of a plant that is sampled 1000 times within its lags
    assert np.max(1 / np.abs(1 + loop)) == pytest.approx(1.4, rel=2e-3)


def test_no_neighbour_of_the_optimal_pi_is_better(valve):
    plant = valve(37)
    best = cr.design.pid(plant, "optimal", "PI", max_sensitivity=1.6)

    def load_error(controller):
        return np.abs(step_response(ct.feedback(ct.ss(plant), ct.ss(controller)), 2500)).sum()

    lowest = load_error(best)
    for share in (0.8, 0.9, 1.1, 1.25):
        low, high = 0.0, 10 * best.kp
        for _ in range(40):  # largest gain within the limit, by bisection on exact margins
            kp = (low + high) / 2
            other = cr.design.PIDController(kp, share * best.ti, dt=plant.dt)
            found = cr.design.margins(plant, other)
            low, high = (kp, high) if found.stable and found.ms <= 1.6 else (low, kp)
        assert load_error(cr.design.PIDController(low, share * best.ti, dt=plant.dt)) > lowest


@pytest.mark.parametrize("kind", ["PI", "PID"])
def test_table_numbers_are_those_of_brute_force_simulation(valve, kind):
    plant = valve(37)
    table = cr.design.compare_pid(plant, ["simc", "cohen_coon"], [kind])
    for row, controller in zip(table.table().itertuples(), table.controllers, strict=True):
        setpoint = step_response(ct.feedback(ct.ss(plant) * ct.ss(controller), 1), 4000)
        load = step_response(ct.feedback(ct.ss(plant), ct.ss(controller)), 4000)
        assert row.iae_setpoint == pytest.approx(np.abs(1 - setpoint).sum() * DT, rel=1e-4)
        assert row.iae_load == pytest.approx(np.abs(load).sum() * DT, rel=1e-4)
        assert row.overshoot == pytest.approx(setpoint.max() - 1, abs=1e-5)
        late = np.flatnonzero(np.abs(setpoint - 1) > 0.02)[-1] + 1
        assert row.settling_time == pytest.approx(late * DT, abs=1.5 * DT)
        assert row.ms == pytest.approx(cr.design.margins(plant, controller).ms)


def test_a_robust_closed_loop_time_is_as_long_as_the_data_ask_for():
    truth = cr.design.ProcessModel(gain=1.5, lag=42.0, second_lag=6.0, dead_time=5.0).system(1.0)
    t = np.arange(240.0)
    u = np.where(t < 40, 0.0, 1.0)
    found = {}
    for seed, expected in ((4, False), (10, True)):  # of which the usual time is not robust
        noise = 0.1 * np.random.default_rng(seed).standard_normal(t.size)
        sys = cr.identify(cr.Record(t, u, truth.simulate(u) + noise))
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            usual = cr.design.pid(sys)
        robust = cr.design.pid(sys, closed_loop_time="robust")
        found[seed] = usual, robust
        assert bool(usual.check.flags) is expected
        assert robust.check.worst.ms <= 2
        assert cr.design.margins(truth * robust).ms <= 2
    assert found[4][0].kp == found[4][1].kp
    assert found[10][0].kp > found[10][1].kp
    with pytest.raises(cr.errors.OptionError, match="not of 'amigo'"):
        cr.design.pid(truth, "amigo", closed_loop_time="robust")


@pytest.mark.parametrize("rule", ["simc", "imc"])
def test_a_robust_closed_loop_time_is_found_where_the_usual_one_is_unstable(rule):
    # of a lightly damped pair, 8^2 s^2 + 1.76 s + 1: the usual time was taken for robust
    pair = cr.delayed_ss(ct.tf([2.0], [64.0, 1.76, 1.0]), dead_time=8.4, dt=1.0)
    with pytest.raises(cr.errors.UnsuitableSystemError, match="does not stabilize"):
        cr.design.pid(pair, rule)
    assert cr.design.pid(pair, rule, closed_loop_time="robust").check.margins.ms <= 2


def test_cohen_and_coon_have_no_pd_beyond_three_lags():
    with pytest.raises(cr.errors.UnsuitableSystemError, match="below 3 lags; this model has 5"):
        cr.design.pid(cr.design.ProcessModel(1, 1, 5), "cohen_coon", "PD")


@pytest.mark.parametrize("core", [([0.5, 2.0], [2.0, 1.0]), ([0.5, 1.0, 1.0], [2.0, 3.0, 1.0])])
@pytest.mark.parametrize("kind", ["PI", "PID"])
def test_an_optimal_controller_holds_where_feedthrough_and_dead_time_turn_the_loop(core, kind):
    # at high frequencies the loop is a circle about 0, which no sampled plant shows
    limit, dead_time = 1.4, 1.0
    found = cr.design.pid(
        cr.exp(-dead_time * ct.tf("s")) * ct.tf(*core), "optimal", kind, max_sensitivity=limit
    )
    s = 1j * np.geomspace(1e-3, 1e6, 400_000)
    controller = found.kp * (1 + 1 / (found.ti * s) + found.td * s / (found.tf * s + 1))
    plant = np.polyval(core[0], s) / np.polyval(core[1], s)
    # the points meet all phases of the circle to less than a hundredth of a turn
    assert np.max(1 / np.abs(1 + controller * plant * np.exp(-dead_time * s))) < 1.01 * limit
    assert 0 < found.ti < 60
    assert found.td < 60


def test_a_comparison_takes_the_robust_closed_loop_time_of_a_single_tuning():
    plant = cr.design.ProcessModel(gain=1.0, lag=0.08, dead_time=0.029).system(0.001)
    alone = cr.design.pid(plant, "lambda", closed_loop_time="robust")
    found = cr.design.compare_pid(plant, ["lambda"], ["PI"], closed_loop_time="robust")
    assert found.controllers[0].kp == alone.kp
    with pytest.raises(cr.errors.OptionError, match="not of 'amigo'"):
        cr.design.compare_pid(plant, ["amigo"], ["PI"], closed_loop_time="robust")
