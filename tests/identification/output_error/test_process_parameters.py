"""Gain, lags and dead time of a fit with their errors, as a table, in one line, in files."""

import re

import control as ct
import numpy as np
import pytest
from scipy.optimize import curve_fit

import ctrl_realize as cr
from tests import rigs

STEP, BEFORE, DT = 10.0, 60, 5.0
GAIN, LAG, SECOND, DEAD_TIME = 0.8, 179.0, 41.0, 44.7


def furnace(noise=0.0, seed=0, **options):
    """A furnace: 0.8 degC/% behind 44.7 s and lags of 179 s and 41 s, sampled every 5 s."""
    t = DT * np.arange(400)
    after = np.clip(t - DT * BEFORE - DEAD_TIME, 0, None)
    rise = 1 - (LAG * np.exp(-after / LAG) - SECOND * np.exp(-after / SECOND)) / (LAG - SECOND)
    y = 20 + GAIN * STEP * rise + noise * np.random.default_rng(seed).standard_normal(t.size)
    u = 30 + STEP * (t >= DT * BEFORE)
    return cr.Record(t, u, y, **options)


def test_standard_errors_are_those_of_nonlinear_least_squares():
    sigma = 0.05
    record = rigs.step_record(
        rigs.R1, noise=sigma / 16, seed=3, delay=20.4, before=300, after=900, amplitude=16.0
    )
    t, y = record.time, record.output

    def model(t, level, gain, dead_time, lag):
        after = np.clip(t - 300 * rigs.TS - dead_time, 0, None)
        return level + 16 * gain * -np.expm1(-after / lag)

    start = 0.3, 1.0, 20.4 * rigs.TS, 1 / (4 * np.pi)
    expected, covariance = curve_fit(model, t, y, start, sigma=np.full(t.size, sigma))
    fit = cr.fit_output_error(record, structures=[(1, 1)], loss="least_squares").fit
    table = fit.parameter_table(time_unit="s")
    names = ["gain", "dead_time", "lag_1"]
    # the fit knows the noise from its residual, 2 % of 1200 samples; means over bins lose little
    np.testing.assert_allclose(
        table.loc[names, "std_given_structure"], np.sqrt(np.diag(covariance))[1:], rtol=0.08
    )
    away = np.abs(table.loc[names, "value"] - expected[1:])
    assert (away < 0.3 * table.loc[names, "std_given_structure"]).all()
    assert (table["low"] <= table["value"]).all()
    assert (table["value"] <= table["high"]).all()


def test_a_pair_and_a_zero_have_their_time_constants():
    # (0.05 s + 1) / (0.2^2 s^2 + 2 0.4 0.2 s + 1)
    core = cr.delayed_ss(ct.tf([0.05, 1], [0.04, 0.16, 1]), dead_time=0.3, dt=0.01)
    u = (np.arange(700) >= 100).astype(float)
    y = core.simulate(u) + 1e-3 * np.random.default_rng(1).standard_normal(700)
    fit = cr.fit_output_error(cr.Record(0.01 * np.arange(700), u, y), structures=[(2, 1)]).fit
    values = fit.parameter_table()["value"]
    expected = {"gain": 1.0, "pair_time_1": 0.2, "pair_damping_1": 0.4, "lead_1": 0.05}
    errors = fit.parameter_table()["std_given_structure"]
    for name, value in expected.items():
        assert abs(values[name] - value) < 4 * errors[name] < 0.4 * value
    assert " s^2 + 0.16" in fit.formula


def test_the_transfer_function_is_one_line_in_the_unit_of_time_asked_for():
    fit = cr.fit_output_error(furnace(noise=0.02), structures=[(2, 2)]).fit
    assert fit.formula.startswith("0.7996 (+-0.0003) ")
    assert fit.formula.endswith("s + 1))")
    assert " e^(-4" in fit.formula
    assert fit.report().splitlines()[1].split(maxsplit=2)[2] == fit.formula
    seconds, minutes = fit.parameter_table(), fit.parameter_table(time_unit="min")
    times = ["dead_time", "lag_1", "lag_2"]
    columns = ["value", "std_given_structure", "low", "high"]
    np.testing.assert_allclose(seconds.loc[times, columns], 60 * minutes.loc[times, columns])
    assert minutes.loc["gain", "value"] == seconds.loc["gain", "value"]
    with pytest.raises(cr.errors.OptionError, match="time_unit='weeks'; expected one of"):
        fit.parameter_table(time_unit="weeks")


def test_units_go_from_the_record_to_the_parameters():
    units = {"u": "%", "y": "degC", "time": "min"}
    fit = cr.fit_output_error(furnace(noise=0.02, units=units), structures=[(2, 2)]).fit
    assert fit.formula.startswith("0.7996 (+-0.0003) degC/% e^(-0.74")
    assert fit.formula.endswith(" s + 1)), time in min")
    units_of = fit.parameter_table()["unit"].to_dict()
    assert units_of == {"gain": "degC/%", "dead_time": "min", "lag_1": "min", "lag_2": "min"}
    slope = cr.fit_output_error(furnace(noise=0.02, units=units), structures="IPDT").fit
    per_minute, per_second = (
        slope.parameter_table(time_unit=unit).loc["gain"] for unit in ("min", "s")
    )
    assert (per_minute["unit"], per_second["unit"]) == ("degC/(% min)", "degC/(% s)")
    assert per_minute["value"] == pytest.approx(60 * per_second["value"])


def test_a_model_file_keeps_the_parameters(tmp_path):
    system = cr.fit_output_error(furnace(noise=0.02), structures=[(2, 2)])
    cr.save_model(tmp_path / "furnace.json", system)
    again = cr.load_model(tmp_path / "furnace.json").fit
    assert again.formula == system.fit.formula
    assert again.parameters == system.fit.parameters
    assert again["fit_percent"] == system.fit.fit_percent


@pytest.mark.parametrize(
    ("value", "error", "text"),
    [
        (0.79971, 0.0010, "0.800 +-0.001"),
        (0.79971, 0.0014, "0.7997 +-0.0014"),
        (179.04, 0.4, "179.0 +-0.4"),
        (2400.0, 31.0, "2400 +-31"),
        (2.5, float("nan"), "2.5"),
    ],
)
def test_an_estimate_is_rounded_like_its_error(value, error, text):
    assert cr.results.Parameter("lag_1", value, error).text() == text


def test_a_furnace_in_minutes_is_reported_and_drawn_in_minutes(tmp_path):
    t = 60.0 * np.arange(400)
    after = np.clip(t - 60 * 100 - 360, 0, None)
    noise = 0.02 * np.random.default_rng(1).standard_normal(t.size)
    y = 20 - 8 * np.expm1(-after / 2400) + 2e-4 * t + noise
    units = {"u": "%", "y": "degC", "time": "min"}
    record = cr.Record(t, 30 + 10 * (t >= 6000), y, units=units)
    system = cr.fit_output_error(record, structures="FOPDT")
    rows = dict(line.strip().split("  ", 1) for line in system.fit.report().splitlines()[1:5])
    assert rows["dead time"].strip().startswith("6.0")
    assert " min = 6.0" in rows["dead time"]
    assert rows["95 % interval"].endswith(" min")
    flag = next(flag for flag in system.fit.flags if flag.code == "drift")
    assert flag.message.startswith("a drift of 0.012 per min")
    assert system.fit.plot().figure.axes[1].get_xlabel() == "time [min]"
    above, below = record.plot().figure.axes
    assert (above.get_ylabel(), below.get_ylabel()) == ("output [degC]", "input [%]")
    assert below.get_xlabel() == "time [min]"
    assert cr.plots.step_plot(record).figure.axes[0].get_ylabel().endswith("[degC/%]")
    cr.save_model(tmp_path / "furnace.json", system)
    again = cr.load_model(tmp_path / "furnace.json").fit
    assert again.report() == system.fit.report()
    assert (again.output_unit, again.input_unit, again.time_unit) == ("degC", "%", "min")
    assert " h = 6.0" in system.fit.report(time_unit="h")
    controller = cr.design.pid(system, "simc", "PI").report()
    assert re.search(r"gain kp +3\.\d+ %/degC", controller)
    assert re.search(r"integral ti +(39|40)\.\d+ min", controller)
    assert re.search(r"delay margin 1\d\.?\d* min", controller)
