"""Design plots: every result draws itself, into given axes too, and marks the right places."""

import control as ct
import matplotlib.pyplot as plt
import numpy as np
import pytest
from matplotlib.text import Text

import ctrl_realize as cr


@pytest.fixture(scope="module")
def results(valve, pi_controller):
    plant, pi = valve(37), pi_controller(0.5, 0.1)
    bound = cr.design.uncertainty_bound([1.1 * plant], plant, dead_time_interval=(0.028, 0.031))
    return {
        "margins": cr.design.margins(plant, pi),
        "delay": cr.design.delay_robustness(plant, pi, (0.02, 0.4)),
        "rules": cr.design.compare_pid(plant, ["simc", "amigo"]),
        "bound": bound,
        "check": bound.check(pi),
        "reduction": cr.design.reduce(plant, 2).fit,
        "model": cr.design.reduce_fopdt(plant),
    }


@pytest.mark.parametrize(
    "kind", ["margins", "delay", "rules", "bound", "check", "reduction", "model"]
)
def test_every_result_draws_itself(results, kind):
    drawn = results[kind].plot()
    assert isinstance(drawn, ct.ControlPlot)
    assert all(axes.get_xlabel() for axes in np.ravel(drawn.axes))
    assert all(len(lines) for lines in np.ravel(drawn.lines))
    plt.close(drawn.figure)


def test_margins_are_marked_where_they_are(results):
    found = results["margins"]
    gain, phase, _ = np.ravel(found.plot(title="loop").axes)
    (mark,) = [line for line in gain.lines if line.get_label().startswith("gain margin")]
    assert mark.get_xdata()[0] == pytest.approx(found.phase_crossover / (2 * np.pi))
    assert mark.get_ydata()[1] == pytest.approx(-20 * np.log10(found.gain_margin))
    (mark,) = [line for line in phase.lines if line.get_label().startswith("phase margin")]
    assert mark.get_ydata()[0] == pytest.approx(-180, abs=0.1)  # read off the followed curve
    plt.close("all")


def test_rules_that_ring_stand_at_the_edge_with_their_peak():
    # Two lags make the reduced dead time too short, and the classic rules ring.
    core = ct.tf([2.25], [0.95, 1]) * ct.tf([1], [0.12, 1])
    plant = cr.delayed_ss(core, dead_time=0.03, dt=0.01)
    found = cr.design.compare_pid(plant)
    largest = max(m.ms for m in found.margins if m.stable)
    assert largest > 5  # otherwise this says nothing
    drawn = found.plot()
    axes = np.ravel(drawn.axes)[0]
    assert max(np.max(line.get_xdata()) for line in np.ravel(drawn.lines)[0]) == 5
    names = [text.get_text() for text in axes.texts]
    assert sum("Ms = " in name for name in names) == sum(
        m.stable and m.ms > 5 for m in found.margins
    )
    # No name lies upon another.
    drawn.figure.canvas.draw()
    # Of the words alone, without the line to a point.
    boxes = [Text.get_window_extent(text) for text in axes.texts]
    for number, box in enumerate(boxes):
        assert not any(box.overlaps(other) for other in boxes[:number]), names
    plt.close(drawn.figure)


@pytest.mark.parametrize(
    ("units", "shown"),
    [
        ({"u": "%", "y": "degC"}, "degC s / %"),
        ({"u": "l/min", "y": "bar"}, "bar s / (l/min)"),
        ({"y": "K"}, "K s / input"),
        ({}, "output s / input"),
    ],
)
def test_the_load_error_is_in_the_unit_of_the_output_times_seconds_per_input(units, shown):
    t = np.arange(400.0)
    y = np.where(t > 105, -np.expm1(-(t - 105) / 30), 0.0)
    y += 1e-3 * np.random.default_rng(0).standard_normal(t.size)
    record = cr.Record(t, 1.0 * (t >= 100), y, units=units)
    sys = cr.identify(record, structures="FOPDT")
    drawn = cr.design.compare_pid(sys, ["simc"], ["PI"]).plot()
    assert np.ravel(drawn.axes)[0].get_ylabel() == f"integrated absolute load error [{shown}]"
    plt.close(drawn.figure)


def test_the_load_error_of_a_plant_in_minutes_is_in_minutes():
    plant = cr.delayed_ss(ct.tf([2.0], [1200.0, 1]), dead_time=300.0, dt=60.0, time_unit="min")
    found = cr.design.compare_pid(plant, ["simc"], ["PI"])
    (axes,) = found.plot().figure.axes
    assert axes.get_ylabel() == "integrated absolute load error [output min / input]"
    (point,) = axes.lines[0].get_ydata()
    assert point == pytest.approx(found.performance[0].load_error / 60)
    plt.close(axes.figure)


def test_the_loop_is_drawn_with_its_actuator_limits_and_noise(valve):
    plant = valve(37)
    pid = cr.design.pid(plant, "simc", "PI")
    drawn = cr.plots.closed_loop_plot(plant, {"PI": pid}, span=0.3, setpoint_step=2.0)
    assert drawn.axes.shape == (2, 2)
    # the linear responses against the simulation sample by sample
    count = len(drawn.lines[0, 0][0].get_ydata())
    for column, step in enumerate(
        ({"setpoint_step": 2.0}, {"setpoint_step": 0.0, "load_step": 1.0})
    ):
        simulated = cr.design.simulate_loop(plant, pid, count + 1, **step)
        for row, signal in enumerate((simulated.measured, simulated.output)):
            np.testing.assert_allclose(
                drawn.lines[row, column][0].get_ydata(), signal[1:], rtol=0, atol=1e-5
            )
    limited = cr.plots.closed_loop_plot(
        plant, {"PI": pid}, span=0.3, setpoint_step=2.0, output_limits=(-2, 2.1), noise_std=0.01
    )
    output = limited.lines[1, 0][0].get_ydata()
    assert output.max() == 2.1
    # white noise passes the proportional action
    still = limited.lines[1, 1][0].get_ydata()
    assert np.std(np.diff(still[-40:])) == pytest.approx(0.01 * pid.kp * np.sqrt(2), rel=0.4)
    marked = [line.get_ydata()[0] for line in limited.axes[1, 0].lines[1:]]
    assert {-2, 2.1} <= set(marked)
    plt.close("all")


def test_a_plot_of_loops_needs_a_controller(valve):
    with pytest.raises(cr.errors.OptionError, match="controllers is empty"):
        cr.plots.closed_loop_plot(valve(37), {})
