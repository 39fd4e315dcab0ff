"""Where in a long record its inputs move."""

from __future__ import annotations

import numpy as np
import pytest

from ctrl_realize.numerics.signals.excitation import lively_start


def moving(samples: int) -> np.ndarray:
    return np.random.default_rng(1).choice([-1.0, 1.0], samples)


@pytest.mark.parametrize("level", [0.0, 1e6])
def test_an_input_that_moves_from_the_beginning_is_taken_from_there(level):
    assert lively_start(level + moving(5000)[None], 400) == 0


@pytest.mark.parametrize("rest", [450, 1000, 3999])
@pytest.mark.parametrize("level", [0.0, 1e6])
def test_a_rest_is_left_out(rest, level):
    signal = level + np.concatenate([np.zeros(rest), moving(2000), np.zeros(3000)])
    start = lively_start(signal[None], 400)
    # half of the variance there is: the stretch begins up to half its length before
    assert rest - 300 <= start <= rest + 100


def test_of_two_inputs_both_move_in_it():
    inputs = np.zeros((2, 4000))
    inputs[0, :3000] = moving(3000)
    inputs[1, 2000:] = moving(2000)
    assert 1600 <= lively_start(inputs, 400) <= 2600


def test_a_short_record_is_taken_from_its_start():
    assert lively_start(np.concatenate([np.zeros(300), moving(100)])[None], 400) == 0


def test_an_input_that_moves_at_the_very_end_gives_the_end():
    signal = np.zeros(1000)
    signal[-1] = 1.0
    assert lively_start(signal[None], 300) == 700
