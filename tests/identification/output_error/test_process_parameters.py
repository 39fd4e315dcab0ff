"""Gain, lags and dead time of a fit with their errors, as a table, in one line, in files."""

import re

import numpy as np
import pytest

import ctrl_realize as cr

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
    with pytest.raises(cr.errors.OptionError, match="time_unit='weeks'; choose one of"):
        fit.parameter_table(time_unit="weeks")


def test_units_go_from_the_record_to_the_parameters():
    units = {"u": "%", "y": "degC", "time": "min"}
    fit = cr.fit_output_error(furnace(noise=0.02, units=units), structures=[(2, 2)]).fit
    assert fit.formula.startswith("0.7996 (+-0.0003) degC/% e^(-44.")
    assert fit.formula.endswith(" s + 1)), L = 0.743 min, T1 = 2.979 min, T2 = 0.688 min")
    units_of = fit.parameter_table()["unit"].to_dict()
    assert units_of == {"gain": "degC/%", "dead_time": "min", "lag_1": "min", "lag_2": "min"}
    slope = cr.fit_output_error(furnace(noise=0.02, units=units), structures="IPDT").fit
    per_minute, per_second = (
        slope.parameter_table(time_unit=unit).loc["gain"] for unit in ("min", "s")
    )
    assert (per_minute["unit"], per_second["unit"]) == ("degC/(% min)", "degC/(% s)")
    assert per_minute["value"] == pytest.approx(60 * per_second["value"])


def test_intervals_of_a_record_that_ends_early_have_no_impossible_ends():
    t = np.arange(102.0)  # 20 s and 17 s behind 12 s, until 47 % of the response
    since = np.clip(t - 72, 0, None)
    y = 1 - (20 * np.exp(-since / 20) - 17 * np.exp(-since / 17)) / 3
    y += 0.01 * np.random.default_rng(1).standard_normal(t.size)
    fit = cr.fit_output_error(cr.Record(t, (t >= 60) * 1.0, -3 * y), structures=[(2, 2)]).fit
    gain, *_, time, damping = fit.parameters
    assert (gain.low, gain.high) == fit.gain_interval
    assert gain.low == -np.inf
    assert -3 <= gain.high < 0
    assert gain.interval_text() == f"at most {gain.high:.3g}"
    for one, truth in ((time, np.sqrt(340)), (damping, 37 / np.sqrt(4 * 340))):
        assert one.low == 0 < truth < one.high
        assert one.std == one.std_given_structure


def test_a_furnace_in_minutes_is_reported_and_drawn_in_minutes(tmp_path):
    t = 60.0 * np.arange(400)
    after = np.clip(t - 60 * 100 - 360, 0, None)
    noise = 0.02 * np.random.default_rng(1).standard_normal(t.size)
    y = 20 - 8 * np.expm1(-after / 2400) + 2e-4 * t + noise
    units = {"u": "%", "y": "degC", "time": "min"}
    record = cr.Record(t, 30 + 10 * (t >= 6000), y, units=units)
    system = cr.fit_output_error(record, structures="FOPDT")
    rows = dict(line.strip().split("  ", 1) for line in system.fit.report().splitlines()[1:8])
    assert rows["dead time"].strip().startswith("6.0")
    assert " min = 6.0" in rows["dead time"]
    assert rows[system.fit.interval_label].endswith(" min")
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


def test_an_error_of_any_size_is_told_in_a_few_digits():
    # a dead time beyond the response leaves nothing of the gain: 71 digits stood in its formula
    t = np.arange(100.0)
    y = -np.expm1(-np.clip(t - 23, 0, None) / 5)
    y += 0.01 * np.random.default_rng(0).standard_normal(100)
    late = cr.identification.ProcessStructure("P1D", fixed={"Td": 200.0})
    fit = cr.fit_output_error(cr.Record(t, np.where(t < 20, 0.0, 1.0), y), structures=late).fit
    assert "gain K not determined" in fit.report()
    assert not re.search(r"\d{12}", fit.report())
