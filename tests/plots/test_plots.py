"""Plots show what results hold, to scale and with units."""

import control as ct
import matplotlib as mpl
import matplotlib.pyplot as plt
import numpy as np
import pytest
from matplotlib.figure import Figure
from numpy.testing import assert_allclose

import ctrl_realize as cr
from ctrl_realize import plots
from ctrl_realize.errors import OptionError, UnsuitableSystemError
from ctrl_realize.plots import style

AFTER = "time after the step "


@pytest.fixture(scope="module")
def record(valve):
    return valve.step_record(16.0, rng=5)


@pytest.fixture(scope="module")
def scanned(record):
    impulse = cr.impulse_from_step(cr.unit_step(record))
    return cr.estimate_delay(impulse, 3, max_delay=80, samples=600)


@pytest.fixture(scope="module")
def fitted(record):
    return cr.fit_output_error(record, structures=[(3, 3)])


@pytest.fixture(scope="module")
def measured(valve):
    frequency = np.geomspace(0.1, 50.0, 120)
    truth = valve.truth.frf(frequency)
    coherence = 1 / (1 + (frequency / 15.0) ** 6)
    rng = np.random.default_rng(0)
    noise = rng.standard_normal((2, 120)) @ np.eye(120) * 0.02 * np.sqrt(1 - coherence)
    return cr.MeasuredFRF(
        truth.frdata[0, 0] + noise[0] + 1j * noise[1],
        frequency,
        coherence=coherence,
        std=0.002 + 0.02 * np.sqrt(1 - coherence),
    )


@pytest.fixture(scope="module")
def every(record, scanned, fitted, measured, valve):
    """Each public plot: name -> function of ax, number of axes, label of the lowest."""
    impulse = scanned.fit.impulse
    orders = cr.scan_orders(impulse, 4, max_delay=60, samples=500)
    records = [valve.step_record(height, rng=k) for k, height in enumerate((16, 16, 8, 8))]
    campaign = cr.identify_campaign(records, method="scan", order=3, max_delay=80, progress=False)
    comparison = cr.compare_frf(fitted, measured)
    return {
        "record_plot": (lambda ax: plots.record_plot(record, ax=ax), 2, "time [s]"),
        "step_plot": (lambda ax: plots.step_plot(record, fitted, ax=ax), 1, AFTER + "[s]"),
        "onset_plot": (lambda ax: plots.onset_plot(record, fitted, ax=ax), 1, AFTER + "[ms]"),
        "impulse_plot": (lambda ax: plots.impulse_plot(impulse, scanned, ax=ax), 1, "time [ms]"),
        "delay_plot": (lambda ax: plots.delay_plot(scanned, ax=ax), 1, "delay [samples]"),
        "values": (lambda ax: plots.singular_value_plot(scanned, ax=ax), 1, "number"),
        "order_plot": (lambda ax: plots.order_plot(orders, ax=ax), 2, "order"),
        "fit_plot": (lambda ax: plots.fit_plot(fitted, ax=ax), 3, "dead time [ms]"),
        "dead_time_plot": (lambda ax: plots.dead_time_plot(fitted, ax=ax), 1, "dead time [ms]"),
        "campaign": (lambda ax: plots.campaign_plot(campaign, truth=37, ax=ax), 1, "delay ["),
        "frf_plot": (lambda ax: plots.frf_plot([measured, fitted], ax=ax), 3, "frequency [Hz]"),
        "comparison": (lambda ax: plots.comparison_plot(comparison, ax=ax), 2, "frequency [Hz]"),
        "truth_plot": (lambda ax: plots.truth_plot(valve.truth, ax=ax), 2, "frequency [Hz]"),
        "system_plot": (lambda ax: plots.system_plot(fitted, ax=ax), 1, AFTER + "[s]"),
    }


def test_every_plot_returns_a_control_plot_with_units_on_its_axes(every):
    for name, (draw, count, label) in every.items():
        drawn = draw(None)
        assert isinstance(drawn, ct.ControlPlot), name
        assert drawn.axes.size == count, name
        assert drawn.lines.shape == drawn.axes.shape, name
        assert all(len(lines) > 0 for lines in drawn.lines.ravel()), name
        assert drawn.axes.ravel()[-1].get_xlabel().startswith(label), name
        assert drawn.figure is drawn.axes[0, 0].figure, name


def test_plots_draw_into_what_they_are_given_and_make_no_figure_of_their_own(every):
    for name, (draw, count, _) in every.items():
        given = np.ravel(Figure().subplots(count, 1, squeeze=False))
        assert list(draw(given).axes.ravel()) == list(given), name
        assert draw(Figure()).axes.size == count, name
    assert plt.get_fignums() == []


def test_a_response_is_drawn_until_it_has_settled():
    lags = np.polymul([180.0, 1.0], [41.0, 1.0])
    plant = cr.delayed_ss(ct.tf([0.8], lags), dead_time=45.0, dt=0.5)
    drawn = plots.system_plot(plant).lines.ravel()[0][0].get_ydata()
    assert drawn[-1] == pytest.approx(0.8, rel=0.02)  # it was 0.1 of that


def test_all_that_was_measured_is_shown_and_the_trusted_band_is_marked(valve):
    frequency = np.geomspace(0.1, 50.0, 300)
    truth = valve.truth.frf(frequency)
    noise = 2e-4 * np.array([1, 1j]) @ np.random.default_rng(2).standard_normal((2, 300))
    power = np.abs(truth.complex) ** 2
    frf = cr.MeasuredFRF(truth.complex + noise, frequency, coherence=power / (power + 8e-8))
    drawn = plots.frf_plot([frf, truth], dead_time=valve.truth.dead_time, ax=Figure())
    low, high = cr.compare_frf(valve.truth.sampled, frf).band_hz
    for axes, line in zip(drawn.axes[:2, 0], drawn.lines[:2, 0], strict=True):
        every = axes.get_lines()[0].get_ydata()  # pale points included
        assert np.isfinite(every).all()
        assert axes.get_ylim()[0] < every.min() < every.max() < axes.get_ylim()[1]
        (band,) = (patch for patch in axes.patches if patch.get_label() == "trusted band")
        assert_allclose((band.get_x(), band.get_x() + band.get_width()), (low, high))
        assert np.isnan(line[0].get_ydata()[-1])
    # Noise turns no phase by more than half a turn beyond that at the end of the trusted band.
    phase, exact = drawn.axes[1, 0].get_lines()[0].get_ydata(), drawn.lines[1, 0][1].get_ydata()
    inside = frequency <= high
    assert_allclose(phase[inside], exact[inside], atol=15)
    assert np.abs(phase - exact).max() < 360


@pytest.fixture(autouse=True)
def settings_of_the_session():
    with mpl.rc_context():
        yield
    plt.close("all")


def test_the_style_holds_inside_and_the_users_settings_are_back_behind():
    mine = {"font.size": 7.5, "lines.linewidth": 0.3, "axes.grid": False, "text.color": "#123456"}
    mpl.rcParams.update(mine)
    before = dict(mpl.rcParams)
    with style.context():
        assert mpl.rcParams["font.size"] == 12
        assert mpl.rcParams["axes.grid"]
    assert {key: mpl.rcParams[key] for key in mine} == mine
    assert dict(mpl.rcParams) == before


PLANT = cr.DelayedStateSpace(ct.ss([[0.8]], [[1.0]], [[0.2]], [[0.0]], 0.1), 5)


@pytest.fixture
def random_record():
    rng = np.random.default_rng(0)
    u = rng.standard_normal(300)
    y = PLANT.simulate(u) + 0.05 * rng.standard_normal(300)
    return cr.Record(0.1 * np.arange(300), u, y, output_labels=["level"])


def test_residual_plot_shows_data_model_and_correlations(random_record):
    check = cr.validation.analyse_residuals(PLANT, random_record)
    drawn = check.plot()
    assert isinstance(drawn, ct.ControlPlot)
    measured, simulated = drawn.lines[0, 0]
    assert_allclose(measured.get_ydata(), random_record.output)
    assert_allclose(simulated.get_ydata(), check.simulated)
    assert_allclose(drawn.lines[2, 0][0].get_ydata(), check.cross[0, 0])
    assert drawn.axes[0, 0].get_ylabel() == "level"
    with pytest.raises(OptionError, match="output"):
        plots.residual_plot(check, output=1)


def test_times_of_a_record_in_minutes_are_in_minutes_on_plots_of_what_comes_of_it(tmp_path):
    time = 20.0 * np.arange(300)
    u = np.where(time < 1000, 0.0, 10.0)
    y = cr.design.ProcessModel(gain=2.0, lag=600.0, dead_time=140.0).system(20.0).simulate(u)
    y += 0.05 * np.random.default_rng(0).standard_normal(time.size)
    system = cr.identify(cr.Record(time, u, y, units={"time": "min"}), structures=[(1, 1)])
    cr.save_model(tmp_path / "model.json", system)
    pid = cr.design.pid(system, "simc")
    drawn = [
        system.fit.plausible_models.plot(),
        cr.load_model(tmp_path / "model.json").fit.plausible_models.plot(),
        cr.experiment.plan(system).using("one step").plot(),
        (system[0, 0] * pid).plot(),
        cr.design.delay_robustness(system, pid).plot(),
    ]
    for each in drawn:
        assert each.figure.axes[0].get_xlabel().endswith("[min]")
    # the interval is shaded where its numbers are
    low, high = system.fit.interval
    shaded = drawn[-1].figure.axes[0].patches[0].get_extents()
    ends = drawn[-1].figure.axes[0].transData.inverted().transform(shaded)[:, 0]
    assert_allclose(ends, [low / 60, high / 60])


def test_plots_of_one_channel_refuse_others_than_there_are(record, fitted):
    for output in (1, -1, 0.5):
        with pytest.raises(OptionError, match="output"):
            plots.each_record_plot(fitted, [record], output=output)
    two = fitted.append(fitted)
    for plot in (plots.step_plot, plots.onset_plot):
        with pytest.raises(UnsuitableSystemError, match="2 inputs and 2 outputs"):
            plot(record, two)
