"""The choice of an order, on misfits that are written by hand."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

import ctrl_realize as cr
from ctrl_realize.identification.order_choice import (
    _within_deviations,
    _worth_it,
    suggest_order,
)


@pytest.mark.parametrize(
    ("misfits", "most", "rounding", "chosen"),
    [
        ([9.0, 1.0], 0, 0.0, 0),  # not beyond what stands out of the noise
        ([9.0, 1.0], 1, 0.0, 1),
        ([9.0, 8.9], 1, 0.0, 0),  # too little
        ([9.0, 9.0, 1.0], 2, 0.0, 2),  # nothing by one, but by two
        ([9.0, 9.0, 1.0], 1, 0.0, 0),
        ([2.6, 2.5, 1.0], 2, 0.0, 0),  # two must lower it by four
        ([4.0, 4.0, 1.0], 2, 0.0, 0),  # just four is not more than that
        ([4.0, 4.0, 1.0], 2, 0.5, 0),
        ([1.3, 1.0], 1, 0.0, 0),
        ([1.4, 1.0], 1, 0.2, 0),  # nothing but rounding
        ([8.0, 4.0, 2.0, 1.9], 3, 0.0, 2),
        ([0.0, 0.0], 1, 0.0, 0),  # exact already
    ],
)
def test_an_order_is_taken_where_it_lowers_the_misfit_enough(misfits, most, rounding, chosen):
    assert _worth_it(np.array(misfits), most, rounding) == chosen


@pytest.mark.parametrize(
    ("share", "chosen"),
    [
        ([2.0, 0.9, 0.2, 0.19], 2),  # within at 1, four times better at 2, no more at 3
        ([2.0, 0.9, 0.2], 2),
        ([0.9, 0.25, 0.05], 2),
        ([0.75, 0.25], 0),  # just three times is not more than that
        ([0.09, 0.01], 0),  # a tenth of what is known: better means nothing
        ([3.0, 0.5], 1),
    ],
)
def test_an_estimate_is_followed_as_far_as_it_is_known(share, chosen):
    assert _within_deviations(np.array(share)) == chosen


def surface(misfits, *, noise=None, rounding=0.0, impulse=None):
    return SimpleNamespace(
        iae=np.array(misfits)[:, np.newaxis],
        orders=(2, 3, 5)[: len(misfits)],
        noise_floor=noise,
        rounding=rounding,
        impulse=impulse,
        window=4,
    )


def test_singular_values_within_the_noise_give_the_lowest_order():
    assert suggest_order(surface([9.0, 1.0], noise=1.0), np.array([1.2, 1.1])) == 2
    assert suggest_order(surface([9.0, 1.0], noise=1.0), np.array([5.0, 1.4])) == 3
    assert suggest_order(surface([9.0, 3.0, 0.1], noise=1.0), np.array([5.0, 1.4, 1.3])) == 3


def test_without_noise_the_first_order_within_a_tenth_of_the_least_misfit_is_taken():
    last = np.ones(3)
    assert suggest_order(surface([9.0, 1.05, 1.0]), last) == 3
    assert suggest_order(surface([9.0, 1.2, 1.0]), last) == 5
    assert suggest_order(surface([9.0, 1.2, 1.0], rounding=0.2), last) == 3
    assert suggest_order(surface([0.0, 0.0, 0.0]), last) == 2


def test_an_estimate_that_no_order_follows_is_judged_by_its_misfits_alone():
    u = np.random.default_rng(0).standard_normal(400)
    estimate = cr.impulse_from_io(cr.Record(0.1 * np.arange(400), u, np.roll(u, 1)), 8)
    known = float(estimate.std[:4].sum())
    last = np.ones(3)
    # more than known everywhere: as if nothing were known of it
    assert suggest_order(surface(known * np.array([9.0, 2.1, 2.0]), impulse=estimate), last) == 3
    # within what is known from the second on, and no other three times better
    assert suggest_order(surface(known * np.array([9.0, 0.9, 0.4]), impulse=estimate), last) == 3
    assert suggest_order(surface(known * np.array([9.0, 0.9, 0.2]), impulse=estimate), last) == 5
