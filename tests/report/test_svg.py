"""Figures on a page: thin, apart from each other, and in the page's colours."""

import re
from xml.etree import ElementTree

import numpy as np
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_array_equal

from ctrl_realize.plots import style
from ctrl_realize.report.svg import envelope, inline_svg, laid_out, path_of


def drawn(draw, key, size, description):
    return inline_svg(laid_out(draw, size), key, description)


def line(figure):
    with style.context():
        axes = figure.subplots()
        axes.plot([0.0, 1.0], [0.0, 1.0], color=style.MEASURED)
        axes.set_title('<script>alert("x")</script> & 0.123456789')


def test_a_drawn_figure_is_well_formed_and_has_its_own_ids():
    one, two = drawn(line, "one", (4, 3), "d"), drawn(line, "two", (4, 3), "d")
    for svg in (one, two):
        ElementTree.fromstring(svg.replace("<svg ", '<svg xmlns:xlink="x" ', 1))
    ids = [set(re.findall(r'\bid="([^"]+)"', svg)) for svg in (one, two)]
    assert all(ids)
    assert not ids[0] & ids[1]
    used = set(re.findall(r"#([\w-]+)[)\"]", one))
    assert used
    assert used <= ids[0]


@given(st.lists(st.floats(-1e6, 1e6), min_size=3, max_size=300), st.integers(2, 60), st.booleans())
def test_the_envelope_keeps_ends_and_extremes_and_invents_nothing(values, points, logarithmic):
    y = np.array(values)
    x = np.arange(1.0, y.size + 1)
    thin_x, thin_y = envelope(x, y, points, logarithmic=logarithmic)
    assert_array_equal(y[thin_x.astype(int) - 1], thin_y)
    assert np.all(np.diff(thin_x) > 0)
    assert thin_x[0] == 1
    assert thin_x[-1] == y.size
    assert thin_y.min() == y.min()
    assert thin_y.max() == y.max()
    assert thin_x.size <= points + 4  # two of each stretch, and both ends


def test_a_loop_that_is_thinned_out_is_the_same_curve():
    corners = np.array([[0, 0], [0, 1], [1, 1], [1, 0], [0, 0]], dtype=np.float64)
    along = np.linspace(0, 4, 40_001)
    x, y = (np.interp(along, range(5), corners[:, k]) for k in (0, 1))
    rest = np.repeat(x, 3), np.repeat(y, 3)  # a curve that rests
    thin = np.stack(path_of(*rest), axis=1)
    assert thin.shape[0] < 4000
    for k in range(0, x.size, 97):
        assert np.abs(thin - [x[k], y[k]]).max(axis=1).min() <= 1 / 400
