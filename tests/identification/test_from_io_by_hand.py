"""How `impulse_from_io` chooses length and method, with regressions that are written by hand."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

import ctrl_realize as cr
from ctrl_realize.errors import DataError, DataWarning, OptionError
from ctrl_realize.identification import from_io
from ctrl_realize.identification.from_io import (
    MOST_UNKNOWNS,
    _latest_onset,
    _tail_flags,
    as_group,
    impulse_from_io,
)
from ctrl_realize.identification.pulse_choice import Choice
from ctrl_realize.identification.pulse_regression import PulseRegression
from ctrl_realize.results import Flag

DT = 0.1


def record(n=900, m=1, p=1, name="", dt=DT):
    def rows(k):
        signals = np.random.default_rng(k).standard_normal((k, n))
        return signals if k > 1 else signals[0]

    return cr.Record(dt * np.arange(n), rows(m), rows(p), name=name)


@pytest.fixture
def by_hand(monkeypatch):
    """Regressions that find a response of `alive` samples, and an onset at lag 0."""
    set_up = SimpleNamespace(
        alive=0, onset=0, choice=Choice("regularized", ("SS",), "why"), flags=(), asked=[]
    )

    def regression(method):
        def made(group, count, start, *last):
            set_up.asked.append((method, count, start, *last))
            p, m = group[0].n_outputs, group[0].n_inputs
            markov = np.ones((p, m, count))
            markov[..., set_up.alive :] = 0.0
            std = np.full((p, m, count), 1e-3)
            return PulseRegression(markov, std, np.ones(p), 7, "by hand", set_up.flags)

        return made

    def onset(drive, row, lags, confidence):
        set_up.lags = lags
        return SimpleNamespace(onset=set_up.onset)

    def choice(group, count, start):
        set_up.asked.append(("choice", count, start))
        return set_up.choice

    monkeypatch.setattr(from_io, "without_prior", regression("least_squares"))
    monkeypatch.setattr(from_io, "with_prior", regression("regularized"))
    monkeypatch.setattr(from_io, "through_arx", regression("okid"))
    monkeypatch.setattr(from_io, "correlation_onset", onset)
    monkeypatch.setattr(from_io, "choose_estimate", choice)
    return set_up


def test_a_method_that_is_asked_for_is_taken_as_it_is(by_hand):
    for options, asked in (
        ({"method": "least_squares"}, ("least_squares", 50, "unknown")),
        ({"method": "least_squares", "start": "rest"}, ("least_squares", 50, "rest")),
        ({"method": "regularized"}, ("regularized", 50, "unknown", ("auto", "auto"))),
        ({"method": "regularized", "kernel": "DC"}, ("regularized", 50, "unknown", ("DC", "DC"))),
        ({"method": "okid"}, ("okid", 50, "unknown", None)),
        ({"method": "okid", "arx_order": 6}, ("okid", 50, "unknown", 6)),
    ):
        by_hand.asked.clear()
        found = impulse_from_io(record(p=2, name="rig"), 50, **options)
        assert by_hand.asked == [asked]
        assert (found.name, found.dt, found.method, found.rows) == ("rig", DT, "by hand", 7)
        assert (found.choices, found.flags) == ((), ())


def test_without_a_method_the_chosen_one_and_its_kernels_are_taken(by_hand):
    found = impulse_from_io(record(), 50, start="rest")
    assert by_hand.asked == [("choice", 50, "rest"), ("regularized", 50, "rest", ("SS",))]
    assert found.choices == ("why",)
    by_hand.asked.clear()
    # but a kernel that was asked for stays
    impulse_from_io(record(), 50, kernel="TC")
    assert by_hand.asked[1] == ("regularized", 50, "unknown", ("TC",))
    by_hand.choice = Choice("okid", ("SS",), "")
    assert impulse_from_io(record(), 50).choices == ()
    assert by_hand.asked[-1] == ("okid", 50, "unknown", None)


def counts(by_hand):
    return [count for method, count, *_ in by_hand.asked if method == "regularized"]


def test_the_window_is_doubled_until_the_response_has_died_away(by_hand):
    by_hand.alive = 300
    assert impulse_from_io(record(n=1500)).n_samples == 400
    assert counts(by_hand) == [100, 200, 400]
    # the choice is made once, on the first window
    assert [count for method, count, *_ in by_hand.asked if method == "choice"] == [100]


def test_a_length_that_is_asked_for_stays_and_says_what_is_missing(by_hand):
    by_hand.alive = 300
    found = impulse_from_io(record(), 60, method="regularized")
    assert counts(by_hand) == [60]
    assert [flag.code for flag in found.flags] == ["not_died_away"]
    assert impulse_from_io(record(), 2, method="regularized").n_samples == 2
    with pytest.raises(OptionError, match="length"):
        impulse_from_io(record(), 1)


@pytest.mark.parametrize(
    ("n", "m", "tried"),
    [
        (900, 1, [100, 200, 300]),  # a third of the record
        (899, 1, [100, 200, 299]),
        (300, 1, [100]),
        (297, 1, [99]),
        (9000, 1, [100, 200, MOST_UNKNOWNS]),
        (9000, 3, [100, 133]),  # of all inputs together
        (3, 1, [2]),
    ],
)
def test_the_window_ends_at_a_third_of_the_record_or_at_what_can_be_computed(by_hand, n, m, tried):
    by_hand.alive = 10_000
    found = impulse_from_io([record(n=n, m=m), record(n=3, m=m)], method="regularized")
    assert counts(by_hand) == tried
    assert [flag.code for flag in found.flags] == ["not_died_away"]
    assert by_hand.lags == tried[-1]


def test_a_response_that_begins_late_has_twice_the_time(by_hand):
    by_hand.alive = 1
    for onset, first in ((50, 100), (51, 102), (149, 298), (200, 300)):
        by_hand.asked.clear()
        by_hand.onset = onset
        impulse_from_io(record(), method="regularized")
        assert counts(by_hand) == [first]


def test_the_latest_output_counts_and_signals_that_stand_still_do_not(monkeypatch):
    asked = []

    def onset(drive, row, lags, confidence):
        asked.append((drive[0], row[0], lags, confidence))
        return SimpleNamespace(onset=int(drive[0] * row[0]))

    monkeypatch.setattr(from_io, "correlation_onset", onset)
    k = np.arange(20.0)
    one = cr.Record(
        k, np.stack([3 + k, np.ones(20), 4 + k]), np.stack([5 + k, -6 - k, np.ones(20)])
    )
    short = cr.Record(k[:9], np.ones((3, 9)), np.ones((3, 9)))
    assert _latest_onset((short, one), 7) == 20
    assert asked == [(3, 5, 7, 0.999), (3, -6, 7, 0.999), (4, 5, 7, 0.999), (4, -6, 7, 0.999)]
    # none follows, or there is none to follow
    still = cr.Record(k, 3 + k, -6 - k)
    assert _latest_onset((still,), 7) == 0
    assert _latest_onset((short,), 7) == 0
    holes = cr.Record(k, 3 + k, np.r_[np.nan, k[1:]], missing="keep")
    assert _latest_onset((holes,), 7) == 0


def test_channels_are_kept_where_there_are_several_or_rows(by_hand):
    assert impulse_from_io(record(), 9, method="okid").markov.shape == (9,)
    assert impulse_from_io(record(), 9, method="okid").std.shape == (9,)
    one = record()
    for u, y in ((one.input[None], one.output), (one.input, one.output[None])):
        found = impulse_from_io(cr.Record(one.time, u, y), 9, method="okid")
        assert found.markov.shape == found.std.shape == (1, 1, 9)
    assert impulse_from_io(record(m=2, p=3), 9, method="okid").markov.shape == (3, 2, 9)


def test_a_prior_that_fills_in_warns_and_other_flags_do_not(by_hand):
    by_hand.flags = (Flag("no_response", "none"),)
    found = impulse_from_io(record(), 30, method="regularized")
    assert found.flags == by_hand.flags
    by_hand.flags += (Flag("partly_excited", "the input excites 10 of 30 lags"),)
    with pytest.warns(DataWarning, match="excites 10 of 30 lags"):
        found = impulse_from_io(record(), 30, method="regularized")
    assert found.flags == by_hand.flags


def test_an_order_belongs_to_okid(by_hand):
    with pytest.raises(OptionError, match="arx_order=4 belongs to method='okid', not 'auto'"):
        impulse_from_io(record(), 30, arx_order=4)


def tail_of(markov, std=1e-6):
    markov = np.asarray(markov, dtype=float)
    return _tail_flags(
        PulseRegression(markov, std * np.ones(markov.shape), np.ones(1), 7, "by hand")
    )


def test_a_tail_is_the_last_tenth_beside_the_largest():
    pulse = np.zeros((1, 1, 40))
    pulse[0, 0, 5] = -2.0
    for level, told in ((0.0999, False), (0.1001, True)):  # 5 % of 2
        pulse[0, 0, -4:] = level
        assert bool(tail_of(pulse)) == told
    (flag,) = tail_of(pulse)
    assert flag.code == "not_died_away"
    assert flag.message.startswith("at the end of 40 samples the response is still 5 %")
    # what is before the last tenth is no tail, and its root of the mean square counts
    pulse[0, 0, -5], pulse[0, 0, -4:] = 1.0, [0.0, 0.0, 0.0, 0.2001]
    assert len(tail_of(pulse)) == 1
    pulse[0, 0, -1] = 0.1999
    assert tail_of(pulse) == ()
    # of a few samples the last
    assert tail_of([[[1.0, 1.0, 0.0]]]) == ()
    assert len(tail_of([[[1.0, 0.0, 0.1]]])) == 1
    assert tail_of(np.zeros((1, 1, 20))) == ()


def test_a_tail_that_may_be_noise_is_none():
    pulse = np.r_[1.0, np.zeros(38), 0.3][None, None]
    # root of the mean square of four: 0.15
    assert len(tail_of(pulse, 0.0499)) == 1
    assert tail_of(pulse, 0.0501) == ()


def test_one_channel_that_lives_on_is_enough_and_channels_are_judged_by_themselves():
    markov = np.zeros((2, 1, 20))
    markov[0, 0, 0], markov[1, 0, 0] = 100.0, 1.0
    markov[1, 0, -2:] = 0.5
    (flag,) = tail_of(markov)
    assert "still 50 %" in flag.message
    # a channel of noise alone, which is as large at its end as anywhere, is not named
    markov[0] = 1e-3
    std = np.array([1e-3, 1e-6])[:, None, None] * np.ones((1, 1, 20))
    (flag,) = tail_of(markov, std)
    assert "still 50 %" in flag.message


def test_records_of_one_plant_have_one_sample_time_and_the_same_channels():
    one = record()
    near, far = record(dt=DT * (1 + 0.9e-3)), record(dt=DT * (1 + 1.1e-3))
    assert as_group([one, near]) == (one, near)
    assert as_group(one) == (one,)
    with pytest.raises(DataError, match=r"record 2 has the sample time 0\.10011 s, the first"):
        as_group([one, near, far])
    # of nanoseconds as well
    with pytest.raises(DataError, match="sample time 2e-09 s, the first one 1e-09 s"):
        as_group([record(dt=1e-9), record(dt=2e-9)])
    with pytest.raises(DataError, match="record 1 has 2 inputs and 1 outputs, the first one 1 and"):
        as_group([one, record(m=2)])
    with pytest.raises(DataError, match="record 1 has 1 inputs and 2 outputs"):
        as_group([one, record(p=2)])


def test_the_onset_of_a_response_is_seen_in_its_correlation():
    rng = np.random.default_rng(0)
    u = rng.standard_normal(600)
    y = np.r_[np.zeros(40), u[:-40]] + 0.1 * rng.standard_normal(600)
    assert _latest_onset((cr.Record(DT * np.arange(600), u, y),), 100) == 40
