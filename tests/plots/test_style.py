"""The toolbox's style: on its own figures, and nowhere else."""

from __future__ import annotations

import matplotlib as mpl
import matplotlib.pyplot as plt
import pytest
from matplotlib.figure import Figure

import ctrl_realize as cr
from ctrl_realize.plots import style


@pytest.fixture(autouse=True)
def settings_of_the_session():
    with mpl.rc_context():
        yield
    plt.close("all")


@pytest.fixture
def comparison():
    plant = cr.delayed_ss(cr.bench.valve().truth.core, 37, dt=7.8125e-4)
    return cr.design.compare_pid(plant, ["simc"])


def test_the_style_holds_inside_and_the_users_settings_are_back_behind():
    mine = {"font.size": 7.5, "lines.linewidth": 0.3, "axes.grid": False, "text.color": "#123456"}
    mpl.rcParams.update(mine)
    before = dict(mpl.rcParams)
    with style.context():
        assert mpl.rcParams["font.size"] == 12
        assert mpl.rcParams["axes.grid"]
    assert {key: mpl.rcParams[key] for key in mine} == mine
    assert dict(mpl.rcParams) == before


def test_the_users_settings_are_back_after_an_error():
    before = dict(mpl.rcParams)
    with pytest.raises(ZeroDivisionError), style.canvas(None, title="never"):
        raise ZeroDivisionError
    assert dict(mpl.rcParams) == before


def test_a_figure_of_the_user_after_a_plot_looks_as_before_it(comparison):
    mpl.rcParams.update({"lines.linewidth": 0.7, "axes.labelsize": 5.0})
    comparison.plot()
    axes = plt.figure().subplots()
    (line,) = axes.plot([0, 1])
    axes.set_xlabel("mine")
    assert line.get_linewidth() == 0.7
    assert axes.xaxis.label.get_size() == 5.0
    assert axes.spines["top"].get_visible()


def test_a_title_is_put_on_new_figures_only():
    # The title of a figure that the user made is the user's.
    for ax, title, shown in (
        (None, None, "usual"),
        (None, "mine", "mine"),
        (None, "", ""),
        (Figure(), "mine", ""),
        (Figure().subplots(), "mine", ""),
    ):
        with style.canvas(ax, title=title, default_title="usual") as (axes,):
            pass
        assert axes.get_title(loc="left") == shown


def test_any_plot_can_be_drawn_without_its_title(comparison):
    assert comparison.plot().axes[0, 0].get_title(loc="left") == "Tuning rules on this plant"
    assert comparison.plot(title="").axes[0, 0].get_title(loc="left") == ""
