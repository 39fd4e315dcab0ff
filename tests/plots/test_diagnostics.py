from __future__ import annotations

import control as ct
import numpy as np
import pytest
from numpy.testing import assert_allclose

import ctrl_realize as cr
from ctrl_realize import plots
from ctrl_realize.errors import OptionError
from ctrl_realize.identification.delay_check import DelayView

PLANT = cr.DelayedStateSpace(ct.ss([[0.8]], [[1.0]], [[0.2]], [[0.0]], 0.1), 5)


@pytest.fixture
def record():
    rng = np.random.default_rng(0)
    u = rng.standard_normal(300)
    y = PLANT.simulate(u) + 0.05 * rng.standard_normal(300)
    return cr.Record(0.1 * np.arange(300), u, y, output_labels=["level"])


def test_residual_plot_shows_data_model_and_correlations(record):
    check = cr.check_residuals(PLANT, record)
    drawn = check.plot()
    assert isinstance(drawn, ct.ControlPlot)
    measured, simulated = drawn.lines[0, 0]
    assert_allclose(measured.get_ydata(), record.output)
    assert_allclose(simulated.get_ydata(), check.simulated)
    assert_allclose(drawn.lines[2, 0][0].get_ydata(), check.cross[0, 0])
    assert drawn.axes[0, 0].get_ylabel() == "level"
    with pytest.raises(OptionError, match="output"):
        plots.residual_plot(check, output=1)


def test_prediction_plot_shows_the_prediction(record):
    prediction = cr.predict(PLANT, record, 3)
    drawn = prediction.plot(color="k")
    assert_allclose(drawn.lines[0, 0][1].get_ydata(), prediction.output)
    assert drawn.lines[0, 0][1].get_color() == "k"
    assert "3 ahead" in drawn.axes[0, 0].get_legend().get_texts()[1].get_text()


@pytest.mark.parametrize("agree", [True, False])
def test_delay_check_plot_has_a_bar_for_each_view(agree):
    views = (
        DelayView("output error", "record", "dead time", 0.02, 0.01, 0.03),
        DelayView("phase slope", "FRF", "upper bound", 0.05, 0.04, 0.06),
    )
    check = cr.DelayCheck(views, agree, (0.01, 0.03) if agree else None, (), 0.001)
    drawn = check.plot()
    assert len(drawn.lines[0, 0]) == 2
    names = [label.get_text() for label in drawn.axes[0, 0].get_yticklabels()]
    assert names == ["phase slope\n(FRF)", "output error\n(record)"]
    assert (drawn.axes[0, 0].get_legend() is not None) == agree


def test_channels_plot_marks_the_delay_of_every_channel():
    pulse = 0.8 ** np.arange(60)
    late = np.array([np.r_[np.zeros(d + 1), pulse][:60] for d in (3, 7)])[:, None]
    drawn = cr.realize_channels(late, 1, dt=0.1).fit.plot()
    assert drawn.axes.shape == (2, 1)
    ends = [axes.get_lines()[-1].get_xdata()[0] for axes in drawn.axes[:, 0]]
    assert_allclose(ends, [0.3, 0.7])


def test_a_fit_of_channels_is_drawn_beside_its_record(record):
    fit = cr.fit_channels(record, 1).fit
    drawn = fit.plot()
    assert_allclose(drawn.lines[0, 0][1].get_ydata(), fit.checks[0].simulated)
    with pytest.raises(OptionError, match="record=1"):
        fit.plot(record=1)


def test_an_estimate_is_drawn_in_its_band(record):
    estimate = cr.impulse_from_io(record, 40)
    drawn = estimate.plot()
    assert isinstance(drawn, ct.ControlPlot)
    (band,) = drawn.axes[0, 0].collections
    vertices = band.get_paths()[0].vertices
    top = (estimate.density + 2 * estimate.std / estimate.dt).max()
    assert_allclose(vertices[:, 1].max(), top)
