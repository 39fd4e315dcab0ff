"""PID forms against the equations of their documents, the algorithm against the linear loop."""

import re

import control as ct
import numpy as np
import pytest

import ctrl_realize as cr

PID = cr.design.PIDController
FULL = (1.7, 40.0, 6.0, 0.6)  # kp, ti, td, tf
LOWER, UPPER = 50.0, 250.0  # measured range; the output is 0...20
RANGES = {"measured_range": (LOWER, UPPER), "output_range": (0.0, 20.0)}
s = ct.tf("s")


def ideal(k, ti, td, tf):
    return k * (1 + 1 / (ti * s) + td * s / (tf * s + 1))


def series(k, ti, factor):
    return k * (1 + 1 / (ti * s)) * factor


# Transfer functions in seconds and percent, from the documents that pid_forms names.
DOCUMENTED = {
    "ideal": lambda v: ideal(v["kp"], v["ti"], v["td"], v["tf"]),
    "series": lambda v: series(v["kc"], v["ti"], (v["td"] * s + 1) / (v["tf"] * s + 1)),
    "parallel": lambda v: v["kp"] + v["ki"] / s + v["kd"] * s / (v["tf"] * s + 1),
    "proportional_band": lambda v: ideal(
        100 / v["proportional band"], 1 / v["reset"], v["rate"], v["filter"]
    ),
    "beckhoff_basic_pid": lambda v: ideal(v["fKp"], v["fTn"], v["fTv"], v["fTd"]),
    "emerson_deltav_standard": lambda v: ideal(
        v["GAIN"], v["RESET"], v["RATE"], v["ALPHA"] * v["RATE"]
    ),
    "emerson_deltav_series": lambda v: series(
        v["GAIN"], v["RESET"], 1 + v["RATE"] * s / (v["ALPHA"] * v["RATE"] * s + 1)
    ),
    "honeywell_interactive": lambda v: series(
        v["K"], 60 * v["T1"], (60 * v["T2"] * s + 1) / (0.1 * 60 * v["T2"] * s + 1)
    ),
    "labview_pid": lambda v: ideal(v["Kc"], 60 * v["Ti"], 60 * v["Td"], 0.6),
    "matlab_pid": lambda v: v["Kp"] + v["Ki"] / s + v["Kd"] * s / (v["Tf"] * s + 1),
    "rockwell_pid_dependent": lambda v: ideal(
        v["Kc (.KP)"], 60 * v["Ti (.KI)"], 60 * v["Td (.KD)"], 0.6
    ),
    "rockwell_pid_independent": lambda v: (
        v["Kp (.KP)"] + v["Ki (.KI)"] / s + v["Kd (.KD)"] * s / (0.6 * s + 1)
    ),
    "rockwell_pide_dependent": lambda v: ideal(
        v["PGain (Kc)"], 60 * v["IGain (Ti)"], 60 * v["DGain (Td)"], 0.6
    ),
    "rockwell_pide_independent": lambda v: (
        v["PGain (Kp)"] + v["IGain (Ki)"] / 60 / s + 60 * v["DGain (Kd)"] * s / (0.6 * s + 1)
    ),
    "siemens_pid_compact": lambda v: ideal(v["Gain"], v["Ti"], v["Td"], v["TdFiltRatio"] * v["Td"]),
    "yokogawa_utadvanced": lambda v: ideal(100 / v["P"], v["I"], v["D"], 0.6),
}
IN_PERCENT = (UPPER - LOWER) / 20  # %/% of 1
SCALE = {"siemens_pid_compact": 100 / 20}  # the output only
PHYSICAL = {"ideal", "series", "parallel", "beckhoff_basic_pid", "labview_pid", "matlab_pid"}


def values_of(form):
    return {each.name: each.value for each in form.values}


@pytest.mark.parametrize("form", DOCUMENTED)
def test_the_step_response_of_each_form_is_that_of_the_ideal_one(form):
    pid = PID(*FULL)
    written = pid.as_form(form, **RANGES)
    scale = 1.0 if form in PHYSICAL else SCALE.get(form, IN_PERCENT)
    # A filter that is fixed in the block is the one difference, and is told.
    wanted = PID(*written.ideal)
    np.testing.assert_allclose(wanted.ideal[:3], FULL[:3], rtol=1e-12)
    if form == "honeywell_interactive":
        assert any("fixed" in note for note in written.notes)
    else:
        np.testing.assert_allclose(wanted.ideal, FULL, rtol=1e-12)
    time = np.linspace(0, 120, 241)
    got = ct.step_response(ct.ss(DOCUMENTED[form](values_of(written))) / scale, time)
    expected = ct.step_response(wanted, time)
    np.testing.assert_allclose(got.outputs, expected.outputs, rtol=1e-9)
    back = PID.from_form(form, values_of(written), **RANGES)
    np.testing.assert_allclose(back.ideal, wanted.ideal, rtol=1e-12)


@pytest.mark.parametrize("unit", ["ms", "min", "h"])
def test_a_written_form_comes_back_with_its_ranges_and_unit(unit):
    # ti of 600 s came back as 10 s, and a gain of 2 as 8
    pid = PID(*FULL, time_unit=unit)
    for form in ("ideal", "series", "parallel", "proportional_band"):
        np.testing.assert_allclose(PID.from_form(form, pid.as_form(form)).ideal[:3], FULL[:3])
    for form in DOCUMENTED:
        back = PID.from_form(form, pid.as_form(form, **RANGES))
        np.testing.assert_allclose(back.ideal[:3], FULL[:3], rtol=1e-12)
    written = PID(2.0, 600.0).as_form("ideal")
    assert PID.from_form("ideal", written, time_unit="min").ti == pytest.approx(36_000)


def test_every_form_is_compared_with_its_equation_and_names_its_document():
    listed = cr.design.pid_forms()
    bands = {
        "omron_pidat": "Tik", "abb_commander_1900": "Integral Action Time", "eurotherm_3116": "TI"
    }  # fmt: skip
    assert set(listed["form"]) == {*DOCUMENTED, "honeywell_hc900", *bands}
    assert listed["source"].str.len().min() > 20
    # of which only P and PI are documented: 100 / PB, repeats per minute
    written = PID(0.5, 120.0).as_form("honeywell_hc900", measured_range=(0, 400))
    assert values_of(written) == pytest.approx({"Prop Band": 50.0, "Reset": 0.5})
    for form, integral in bands.items():  # 100 / PB, and the integral time in s
        written = values_of(PID(0.5, 120.0).as_form(form, measured_range=(0, 400)))
        assert list(written.values()) == [50.0, 120.0]
        assert written[integral] == 120.0
    with pytest.raises(cr.errors.OptionError, match="P and PI only"):
        PID(*FULL).as_form("honeywell_hc900")


@pytest.mark.parametrize("kind", ["P", "PI", "PD", "PID"])
@pytest.mark.parametrize("form", sorted(DOCUMENTED))
def test_every_kind_and_sign_comes_back_from_every_form(form, kind):
    pid = PID(-0.4, 30.0 if "I" in kind else np.inf, *((4.0, 0.5) if "D" in kind else ()))
    written = pid.as_form(form, **RANGES)
    values = values_of(written)
    assert PID(*written.ideal).kind == kind
    assert written.reversed_action == (values[written.values[0].name] > 0)
    reverse = written.reversed_action
    back = PID.from_form(form, values, reversed_action=reverse, **RANGES)
    np.testing.assert_allclose(back.ideal[:3], pid.ideal[:3], rtol=1e-12)
    assert PID.from_form(form, written, **RANGES).ideal == back.ideal
    if reverse:  # or with a sign for all gains
        parallel = cr.design.pid_forms().set_index("form")["structure"][form] == "parallel"
        gains = written.values if parallel else written.values[:1]
        values |= {each.name: -each.value for each in gains}
        back = PID.from_form(form, values, **RANGES)
        np.testing.assert_allclose(back.ideal[:3], pid.ideal[:3], rtol=1e-12)


def test_units_of_the_record_come_with_the_controller():
    model = cr.design.ProcessModel(gain=2.0, lag=600.0, dead_time=120.0).system(20.0)
    time = 20.0 * np.arange(300)
    u = np.where(time < 1000, 0.0, 10.0)
    units = {"u": "%", "y": "degC", "time": "min"}
    record = cr.Record(time, u, model.simulate(u), units=units)
    sys = cr.identify(record, structures=[(1, 1)])
    pid = cr.design.pid(sys, "simc", "PI")
    assert "1.154 %/degC" in str(pid)
    assert "10 min" in str(pid.discretised(60.0))
    parallel = pid.as_form("parallel")
    assert [each.unit for each in parallel.values] == ["%/degC", "%/(degC min)"]
    assert parallel["ki"] == pytest.approx(60 * pid.kp / pid.ti)
    assert pid.as_form("rockwell_pide_dependent").values[0].unit == ""


def test_minutes_and_hours_are_chosen_for_forms_without_a_unit():
    pid = PID(*FULL)
    minutes = pid.as_form("proportional_band", time_unit="min")
    assert minutes["reset"] == pytest.approx(1.5)
    assert minutes.values[1].unit == "repeats/min"
    weighted = pid.as_form("siemens_pid_compact", setpoint_weight=0.6)
    assert (weighted["PWeighting"], weighted["DWeighting"], weighted.notes) == (0.6, 0.0, ())
    derivative = pid.as_form("siemens_pid_compact", derivative_weight=0.2)
    assert (derivative["PWeighting"], derivative["DWeighting"]) == (1.0, 0.2)
    assert PID.from_form("siemens_pid_compact", values_of(weighted)).ideal == pytest.approx(FULL)
    assert pid.as_form("parallel", time_unit="h")["ki"] == pytest.approx(1.7 / 40 * 3600)


def test_complex_zeros_have_no_series_form_and_values_need_their_names():
    with pytest.raises(cr.errors.OptionError, match=r"td of at most 9\.702 s"):
        PID(1.0, 40.0, 12.0, 0.6).as_form("series")
    with pytest.raises(cr.errors.OptionError, match="'Gain'"):
        PID.from_form("siemens_pid_compact", {"gain": 2.0})
    edge = PID(1.0, 40.0, 9.7, 0.6).as_form("series")
    assert edge.ideal == pytest.approx((1.0, 40.0, 9.7, 0.6))


METHODS = ["tustin", "forward", "backward"]
RNG = np.random.default_rng(3)
ERROR = np.r_[0.0, RNG.standard_normal(300)]


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("kind", ["P", "PI", "PD", "PID"])
def test_the_algorithm_without_limits_is_the_linear_controller(kind, method):
    settings = (30.0 if "I" in kind else np.inf, *((4.0, 0.5) if "D" in kind else ()))
    pid = PID(1.3, *settings, dt=0.4, method=method)
    algorithm = pid.algorithm(derivative_weight=1.0)
    linear = ct.forced_response(pid, pid.dt * np.arange(ERROR.size), ERROR).outputs
    np.testing.assert_allclose(algorithm.simulate(ERROR, 0 * ERROR), linear, rtol=0, atol=1e-12)
    # and of the measured value, whatever the weights
    weighted = pid.algorithm(setpoint_weight=0.3 if "I" in kind else 1.0)
    np.testing.assert_allclose(weighted.simulate(0 * ERROR, -ERROR), linear, rtol=0, atol=1e-12)


def test_set_point_weights_act_on_the_set_point_alone():
    pid = PID(2.0, 10.0, 3.0, 0.5, dt=0.5)
    step = np.r_[0.0, np.ones(20)]
    still = 0 * step
    jump = [
        pid.algorithm(setpoint_weight=b, derivative_weight=c).simulate(step, still)[1]
        for b, c in ((0, 0), (0.6, 0), (0, 0.5))
    ]
    now = 2.0 * 0.5 / 10 / 2
    assert jump == pytest.approx([now, 2 * 0.6 + now, now + 0.5 * 2 * 3 / (0.5 + 0.5)])


def test_a_set_point_weight_starts_at_the_bias():
    algorithm = PID(2.0, 10.0, 3.0, 0.5, dt=0.5).algorithm(setpoint_weight=0.4, bias=40.0)
    at_180 = np.full(30, 180.0)
    np.testing.assert_allclose(algorithm.simulate(at_180, at_180), 40.0)
    with pytest.raises(cr.errors.OptionError, match="without integral action"):
        PID(2.0, dt=0.5).algorithm(setpoint_weight=0.4)


def test_anti_windup_leaves_the_limit_early_and_limits_hold():
    model = cr.design.ProcessModel(gain=1.0, lag=10.0, dead_time=2.0)
    plant = model.system(0.5)
    pid = cr.design.pid(plant, "simc", "PI")
    results = {}
    for tracking in (None, 1e9):
        algorithm = pid.algorithm(output_limits=(-0.2, 1.1), tracking_time=tracking)
        results[tracking] = cr.design.simulate_loop(plant, algorithm, 200)
        assert results[tracking].output.max() == 1.1
    shifted = pid.algorithm(output_limits=(39.8, 41.1), bias=40.0)
    again = cr.design.simulate_loop(plant, shifted, 200)
    np.testing.assert_allclose(again.output, results[None].output, atol=1e-9)
    assert results[None].measured.max() < 1.01 < 1.04 < results[1e9].measured.max()
    assert results[None].measured[-1] == pytest.approx(1, abs=1e-3)


def test_manual_operation_returns_without_a_bump():
    algorithm = PID(2.0, 10.0, 3.0, 0.5, dt=0.5).algorithm(output_limits=(0, 100))
    r, y = np.full(60, 50.0), 48 + 0.1 * np.arange(60.0)
    manual = np.full(60, np.nan)
    manual[20:40] = 37.0
    u = algorithm.simulate(r, y, manual)
    assert np.all(u[20:40] == 37)
    # from then on it moves as the error and its integral do
    assert abs(u[40] - 37) < 0.5
    assert np.ptp(u[:20]) > 0


@pytest.mark.parametrize(
    ("options", "match"),
    [
        ({"output_limits": (5, 5)}, "lower limit first"),
        ({"tracking_time": 0.1}, "at least the sample time"),
        ({"setpoint_weight": np.nan}, "setpoint_weight"),
        ({"output_limits": (4, 20)}, r"bias=0 is outside of output_limits=\(4, 20\)"),
        ({"output_limits": (0, 1), "bias": 1.5}, "operating point"),
    ],
)
def test_unusable_algorithms_are_refused(options, match):
    with pytest.raises(cr.errors.OptionError, match=match):
        PID(2.0, 10.0, dt=0.5).algorithm(**options)


def test_a_continuous_controller_has_no_algorithm_and_print_says_what_to_type():
    with pytest.raises(cr.errors.OptionError, match="discretised"):
        PID(2.0, 10.0).algorithm()
    plant = cr.design.ProcessModel(gain=1.0, lag=10.0, dead_time=2.0).system(0.5)
    text = str(cr.design.pid(plant))
    assert "on the design model  stable, Ms" in text
    assert "ki = kp / ti" in text
    assert "A = " not in text
    table = cr.design.pid(plant).forms(measured_range=(0, 400)).set_index("form")["enter"]
    assert table["rockwell_pide_dependent"].startswith("PGain (Kc) = ")
    assert len(table) == len(cr.design.pid_forms())


def test_an_algorithm_is_written_in_the_units_of_its_controller():
    made = cr.design.PIDController(2.0, 600.0, dt=6.0, gain_unit="%/K", time_unit="min").algorithm()
    for text in (made.report(), repr(made)):
        assert re.search(r"kp +2 %/K", text)
        assert re.search(r"ti +10 min", text)
