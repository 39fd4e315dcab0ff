"""Responses and relaxations of long records are found in pieces, and are the same."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.testing import assert_allclose

from ctrl_realize.numerics import delayed_modes
from ctrl_realize.numerics.delayed_modes import MoveTrain, SampledInput, SeveralInputs
from ctrl_realize.numerics.relaxation import relaxation
from ctrl_realize.numerics.separable_fit import KnownFactor, respond


@pytest.mark.parametrize("piece", [1, 7, 64, 1000])
def test_a_response_found_in_pieces_has_no_seams(monkeypatch, piece):
    width = np.array([1] * 60 + [3] * 40)
    first = 0.1 * np.concatenate([[0], np.cumsum(width)[:-1]])
    drive = MoveTrain(first, width, 0.1, np.array([1.0, 4.0]), np.array([2.0, -1.0]))
    # the delay in s and the logarithms of a lag of 0.5 s
    model = (KnownFactor(), np.array([2.0]), np.array([0.37, np.log(2.0)]))
    whole = respond(drive, *model)
    monkeypatch.setattr(delayed_modes, "_PIECE", piece)
    parts = drive.pieces()
    assert max(part.first.size for part in parts) <= piece
    assert len(parts) == -(-width.size // piece)
    assert sum(part.first.size for part in parts) == width.size
    # one sum of two products at every bin, in whatever order a library takes it
    assert_allclose(respond(drive, *model), whole, rtol=1e-13, atol=1e-15)
    assert np.ptp(whole) > 0.5


def test_recursions_are_not_cut():
    one = SampledInput(np.ones(9), 0.1)
    assert one.pieces() == [one]
    several = SeveralInputs((one, one), (0, 2))
    assert several.pieces() == [several]


def test_a_relaxation_is_told_by_the_rest_and_continued_to_the_end():
    k = np.arange(5000)
    exact = 3 + 0.8 * np.exp(-k / 60)
    noise = 1e-3 * np.random.default_rng(0).standard_normal(k.size)
    after = np.where(k < 400, 0, 50.0)  # what comes after the step is nobody's business here
    curve = relaxation(exact + noise + after, 400)
    # the rates that are tried lie 19 % apart; half of that turns 0.8 into 0.8 (1 +- 0.035)
    assert_allclose(curve, exact, atol=0.04)
    assert curve.size == k.size
    assert relaxation(0.001 * k + noise, 400) is None
