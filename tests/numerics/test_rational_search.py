"""How far a search over structures of a transfer function goes, with fits that are by hand."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

from ctrl_realize.numerics import rational_search as module
from ctrl_realize.numerics.rational_search import fit_structures


@pytest.fixture
def searched(monkeypatch):
    """Search where the structure nearest to a given one has the lowest criterion."""

    def run(best, orders=None, degrees=None, points=200):
        def criteria(data, fits):
            return {key: abs(key[0] - best[0]) + 0.1 * abs(key[1] - best[1]) for key in fits}

        monkeypatch.setattr(module, "_fit_one", lambda data, ladder, fits, n, r: (n, r))
        monkeypatch.setattr(module, "information_criteria", criteria)
        return set(fit_structures(SimpleNamespace(s=np.zeros(points)), orders, degrees))

    return run


UP_TO_FOUR = {(n, r) for n in range(1, 5) for r in range(1, n + 1)}


def test_a_search_ends_with_four_orders_where_the_last_is_no_better(searched):
    assert searched((3, 1)) == UP_TO_FOUR
    assert searched((1, 1)) == UP_TO_FOUR


@pytest.mark.parametrize(
    ("degree", "beyond"),
    [
        (1, {5: (1, 2), 6: (1, 2), 7: (1, 2)}),
        (3, {5: (2, 3, 4), 6: (2, 3, 4), 7: (2, 3, 4)}),
        (6, {5: (3, 4, 5), 6: (4, 5, 6), 7: (5, 6, 7)}),
    ],
)
def test_an_order_is_believed_when_a_larger_one_was_tried_beside_its_relative_degree(
    searched, degree, beyond
):
    # of an order beyond four, the degrees are tried that lie next to the best one so far
    tried = {(n, r) for n, degrees in beyond.items() for r in degrees}
    assert searched((6, degree)) == UP_TO_FOUR | tried


def test_given_relative_degrees_are_kept_to_beyond_four_orders(searched):
    assert searched((6, 2), degrees=(2,)) == {(n, 2) for n in range(2, 8)}
    assert searched((5, 0), degrees=(0,)) == {(n, 0) for n in range(1, 7)}


def test_given_orders_are_all_that_is_tried(searched):
    assert searched((9, 1), orders=(2, 3)) == {key for key in UP_TO_FOUR if key[0] in (2, 3)}


def test_a_search_ends_at_order_ten_and_where_points_do_not_carry_more(searched):
    assert max(n for n, _ in searched((99, 1))) == 10
    # four points for an order: 21 carry five of them, and the sixth is tried
    assert max(n for n, _ in searched((99, 1), points=21)) == 6


def test_no_structure_is_fitted_where_no_degree_fits_an_order(searched):
    assert searched((3, 1), degrees=(7,)) == set()
