"""Which options and records a fit of the delay takes, and what counts as a step experiment."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

import ctrl_realize as cr
from ctrl_realize.errors import DataError, NoStepError, OptionError, OrderError
from ctrl_realize.identification import delay_fit
from ctrl_realize.identification.delay_fit import (
    _edges,
    _holds_between,
    _records,
    _step_data,
    _structures,
)
from ctrl_realize.numerics.separable_fit import Structure

DT = 0.1


def of_input(values):
    time = DT * np.arange(len(values))
    return cr.Record(time, np.asarray(values, dtype=float), time)


# the options


def test_structures_are_pairs_each_tried_once():
    assert _structures(None) is None
    assert _structures([(2, 1), (1, 1), (2, 1)]) == (Structure(2, 1), Structure(1, 1))
    assert _structures([(8, 8), (8.0, 1)]) == (Structure(8, 8), Structure(8, 1))


@pytest.mark.parametrize("pair", [(9, 1), (9, 9), (2, 3), (2, 0), (0, 0), (2, -1)])
def test_a_relative_degree_lies_between_one_and_the_order(pair):
    with pytest.raises(OrderError, match=r"1 <= relative degree <= order <= 8"):
        _structures([(1, 1), pair])


@pytest.mark.parametrize("pair", [3, (3,), (3, 2, 1), ("a", 1), (None, 1)])
def test_what_is_no_pair_of_numbers_is_no_structure(pair):
    with pytest.raises(OptionError, match="relative_degree"):
        _structures([pair])


# the records


def test_twenty_samples_are_needed():
    assert len(_records(of_input(range(20)))) == 1
    with pytest.raises(DataError, match="19 samples"):
        _records([of_input(range(20)), of_input(range(19))])


def test_an_output_that_moves_by_nothing_is_refused():
    time = np.arange(30.0)
    tiny = np.where(time < 10, 0.0, 1e-70)
    assert len(_records(cr.Record(time, time, tiny))) == 1
    with pytest.raises(DataError, match="does not leave its rest level"):
        _records(cr.Record(time, time, 0.5 * tiny))


def test_several_channels_and_missing_samples_are_refused():
    time = np.arange(30.0)
    for u, y in ((np.stack([time, time]), time), (time, np.stack([time, time]))):
        with pytest.raises(DataError, match="inputs and"):
            _records(cr.Record(time, u, y))
    holes = cr.Record(time, time, np.where(time == 4, np.nan, time), missing="keep")
    with pytest.raises(DataError, match="fit_delay needs every sample"):
        _records(holes)


# what counts as a step experiment


def edge(index, samples=1, amplitude=1.0):
    return SimpleNamespace(index=index, samples=samples, amplitude=amplitude, time=index * DT)


def strays(count, by, where=0):
    """A step of 1 at sample 50 of 101, of which some samples lie beside their level."""
    signal = np.where(np.arange(101) < 50, 0.0, 1.0)
    signal[where : where + count] += by
    return signal


def test_an_input_holds_where_nine_samples_of_ten_do():
    one = [edge(50)]
    # of 101 samples the 0.9 quantile is the eleventh from above
    assert _holds_between(strays(10, 5.0), one)
    assert not _holds_between(strays(11, 5.0), one)
    assert not _holds_between(strays(11, -5.0, 60), one)
    assert _holds_between(strays(11, 0.1999), one)
    assert not _holds_between(strays(11, 0.2001), one)
    assert _holds_between(strays(11, 1.0), [edge(50, amplitude=5.0)])  # just a fifth


def test_an_input_may_stray_by_a_fifth_of_its_largest_edge():
    signal = strays(11, 0.39)
    for up in (2.0, -2.0):
        assert _holds_between(signal, [edge(50, amplitude=up)])
        assert _holds_between(signal, [edge(50, amplitude=up), edge(101, amplitude=0.1)])
    assert not _holds_between(signal, [edge(50, amplitude=-1.9)])


def test_a_ramp_is_no_straying():
    signal = np.clip((np.arange(100) - 49) / 20, 0.0, 1.0)  # up from sample 50 to 69
    assert _holds_between(signal, [edge(50, samples=20)])
    assert not _holds_between(signal, [edge(50, samples=1)])
    # its last sample has arrived: of 50 + 31 samples the ninth from above is the 0.9 quantile
    late = np.where(np.arange(100) < 69, 0.0, 1.0)
    late[80:88] = 5.0
    assert _holds_between(late, [edge(50, samples=20)])
    late[88] = 5.0
    assert not _holds_between(late, [edge(50, samples=20)])
    wild = np.where(np.arange(100) < 50, 0.0, np.arange(100) % 7.0)
    assert _holds_between(wild, [edge(50, samples=60)])  # nothing is left behind the ramp


def test_every_level_between_edges_is_a_level_of_its_own():
    stairs = np.repeat([0.0, 1.0, 3.0, 2.0], 25)
    edges = [edge(25), edge(50, amplitude=2.0), edge(75, amplitude=-1.0)]
    assert _holds_between(stairs, edges)
    assert not _holds_between(stairs, edges[:2])


def test_a_ramp_that_runs_into_the_next_edge_leaves_that_level_alone():
    signal = np.r_[np.zeros(40), np.linspace(0.0, 1.0, 20), np.full(40, 1.0)]
    assert _holds_between(signal, [edge(40, samples=30), edge(60)])


def test_twelve_edges_are_a_step_experiment_and_thirteen_are_none():
    for steps, found in ((12, 12), (13, 0)):
        levels = np.arange(steps + 1) % 2
        assert len(_edges(of_input(np.repeat(levels, 40)))) == found
    rng = np.random.default_rng(0)
    moving = np.repeat([0.0, 4.0], 200) + rng.standard_normal(400)
    assert len(_edges(of_input(moving))) == 0  # an edge, and no level that holds


def test_an_input_that_moves_at_the_very_end_alone_is_no_experiment():
    with pytest.raises(NoStepError):
        _edges(of_input(np.ones(60)))
    late = np.zeros(60)
    late[-1] = 1.0
    with pytest.raises(NoStepError):
        _edges(of_input(late))
    sines = np.sin(np.arange(60.0))
    assert _edges(of_input(sines)) == ()


@pytest.mark.parametrize(("moved", "refused"), [(5, True), (6, False)])
def test_five_samples_at_the_end_say_nothing(monkeypatch, moved, refused):
    def no_step(record):
        raise NoStepError("none")

    monkeypatch.setattr(delay_fit, "detect_step", no_step)
    given = of_input(np.r_[np.zeros(60 - moved), np.ones(moved)])
    if refused:
        with pytest.raises(NoStepError, match="none"):
            _edges(given)
    else:
        assert _edges(given) == ()


@pytest.fixture
def data_by_hand(monkeypatch):
    """Edges and the data that are made of them, as set."""
    set_up = SimpleNamespace(
        edges=[edge(40, 3)], data=SimpleNamespace(motion=SimpleNamespace(crossing=10), sigma=0.25)
    )
    set_up.asked = []

    def step_data(output, signal, dt, edges):
        set_up.asked.append((output.shape, signal.shape, dt, edges))
        return set_up.data

    monkeypatch.setattr(delay_fit, "_edges", lambda record: tuple(set_up.edges))
    monkeypatch.setattr(delay_fit, "step_data", step_data)
    return set_up


def test_the_data_of_a_step_record_are_its_signals_and_edges(data_by_hand):
    given = of_input(range(120))
    assert _step_data(given) is data_by_hand.data
    assert data_by_hand.asked == [((120,), (120,), given.dt, [(40, 3)])]
    data_by_hand.edges = []
    assert _step_data(given) is None


def test_an_output_that_stays_at_rest_is_told_with_its_noise_and_the_time_of_the_step(data_by_hand):
    data_by_hand.data.motion = None
    with pytest.raises(
        DataError, match=r"record 'a' .* 5 sigma \(1\.25\) .* after the step at 4 s"
    ):
        _step_data(cr.Record(np.arange(30), np.arange(30), np.arange(30), name="a"))


def test_steps_that_follow_too_fast_are_any_input(data_by_hand):
    # three times the first motion of ten samples
    data_by_hand.edges = [edge(40), edge(70), edge(71)]
    assert _step_data(of_input(range(120))) is data_by_hand.data
    data_by_hand.edges = [edge(40), edge(69)]
    assert _step_data(of_input(range(120))) is None
