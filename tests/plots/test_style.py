"""The toolbox's style: on its own figures, and nowhere else."""

from __future__ import annotations

import matplotlib as mpl
import matplotlib.pyplot as plt
import pytest
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

import ctrl_realize as cr
from ctrl_realize.errors import OptionError
from ctrl_realize.plots import style
from ctrl_realize.plots.names import plain


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


def test_what_others_switch_inside_stays_switched():
    # A notebook's backend becomes interactive with the first figure, and must stay so.
    mpl.rcParams["interactive"] = False
    with style.context():
        mpl.rcParams["interactive"] = True
    assert mpl.rcParams["interactive"]


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


def test_a_canvas_is_the_axes_that_were_given():
    given = Figure().subplots(2, 1)
    with style.canvas(given, 2) as axes:
        assert axes == list(given)
    with pytest.raises(OptionError, match="needs 1"), style.canvas(given):
        pass


@pytest.mark.parametrize("letter", ["W", "\u5b57", "a", "\U0001f600"])
def test_names_of_wide_letters_are_cut_before_they_take_the_axes(letter):
    shown = plain(250 * letter, 34)
    figure = Figure(figsize=(6, 3))
    text = figure.text(0, 0, shown, fontsize=10)
    drawn = text.get_window_extent(FigureCanvasAgg(figure).get_renderer())
    # 34 ordinary letters of 10 points take about 190 points
    assert drawn.width * 72 / figure.dpi < 230
    assert shown.endswith("…")
    assert len(shown) > 15
