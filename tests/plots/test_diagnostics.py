from __future__ import annotations

import control as ct
import numpy as np
import pytest
from numpy.testing import assert_allclose

import ctrl_realize as cr
from ctrl_realize import plots
from ctrl_realize.errors import OptionError
from ctrl_realize.identification.validation.delay_estimates_result import DelayEstimate

PLANT = cr.DelayedStateSpace(ct.ss([[0.8]], [[1.0]], [[0.2]], [[0.0]], 0.1), 5)


@pytest.fixture
def record():
    rng = np.random.default_rng(0)
    u = rng.standard_normal(300)
    y = PLANT.simulate(u) + 0.05 * rng.standard_normal(300)
    return cr.Record(0.1 * np.arange(300), u, y, output_labels=["level"])


def test_residual_plot_shows_data_model_and_correlations(record):
    check = cr.validation.analyse_residuals(PLANT, record)
    drawn = check.plot()
    assert isinstance(drawn, ct.ControlPlot)
    measured, simulated = drawn.lines[0, 0]
    assert_allclose(measured.get_ydata(), record.output)
    assert_allclose(simulated.get_ydata(), check.simulated)
    assert_allclose(drawn.lines[2, 0][0].get_ydata(), check.cross[0, 0])
    assert drawn.axes[0, 0].get_ylabel() == "level"
    with pytest.raises(OptionError, match="output"):
        plots.residual_plot(check, output=1)


@pytest.mark.parametrize("agree", [True, False])
def test_delay_check_plot_has_a_bar_for_each_view(agree):
    views = (
        DelayEstimate("output error", "record", "dead time", 0.02, 0.01, 0.03),
        DelayEstimate("phase slope", "FRF", "upper bound", 0.05, 0.04, 0.06),
    )
    check = cr.validation.DelayComparison(views, agree, (0.01, 0.03) if agree else None, (), 0.001)
    drawn = check.plot()
    assert len(drawn.lines[0, 0]) == 2
    names = [label.get_text() for label in drawn.axes[0, 0].get_yticklabels()]
    assert names == ["phase slope\n(FRF)", "output error\n(record)"]
    assert (drawn.axes[0, 0].get_legend() is not None) == agree


def test_an_estimate_is_drawn_in_its_band(record):
    estimate = cr.impulse_from_io(record, 40)
    drawn = estimate.plot()
    assert isinstance(drawn, ct.ControlPlot)
    (band,) = drawn.axes[0, 0].collections
    vertices = band.get_paths()[0].vertices
    top = (estimate.density + 2 * estimate.std / estimate.dt).max()
    assert_allclose(vertices[:, 1].max(), top)
