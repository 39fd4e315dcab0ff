"""The choice between a prior and OKID, with estimates and errors that are written by hand."""

from __future__ import annotations

from types import SimpleNamespace

import control as ct
import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

import ctrl_realize as cr
from ctrl_realize.errors import DataError
from ctrl_realize.identification import pulse_choice
from ctrl_realize.identification.pulse_choice import (
    CLEARLY,
    MOST_JUDGED,
    _by_arx,
    _by_convolution,
    _error,
    _percent,
    choose_estimate,
)

DT = 0.1


def record(n=300, p=1, level=0.0, seed=0, **options):
    rng = np.random.default_rng(seed)
    y = rng.standard_normal((p, n)) + level
    return cr.Record(DT * np.arange(n), rng.standard_normal(n), y if p > 1 else y[0], **options)


@pytest.fixture
def by_hand(monkeypatch):
    """Estimates by both methods, and the errors 0.2 and 0.05 of them."""
    set_up = SimpleNamespace(
        smooth=SimpleNamespace(kernels=("SS",), error=0.2),
        arx=SimpleNamespace(error=0.05),
        asked=[],
    )

    def estimate(which):
        def made(group, count, start, last):
            set_up.asked.append((which, group, count, start, last))
            found = getattr(set_up, which)
            if isinstance(found, Exception):
                raise found
            return found

        return made

    monkeypatch.setattr(pulse_choice, "with_prior", estimate("smooth"))
    monkeypatch.setattr(pulse_choice, "through_arx", estimate("arx"))

    def error(group, splits, found, count):
        set_up.judged = group, splits, count
        return found.error

    monkeypatch.setattr(pulse_choice, "_error", error)
    return set_up


def test_both_are_fitted_to_two_thirds_of_every_record_and_judged_on_the_rest(by_hand):
    group = (record(300), record(100))
    chosen = choose_estimate(group, 40, "rest")
    assert (chosen.method, chosen.kernels) == ("okid", ("SS",))
    assert chosen.reason == (
        "on the last third of the data, unseen, the regularized estimate misses 20 % of the "
        "output, OKID 5 %"
    )
    assert by_hand.judged == (group, [200, 67], 40)
    for (which, first, count, start, last), expected in zip(
        by_hand.asked, [("smooth", ("auto",)), ("arx", None)], strict=True
    ):
        assert ((which, last), count, start) == (expected, 40, "rest")
        assert [one.n_samples for one in first] == [200, 67]
        assert_array_equal(first[0].output, group[0].output[:200])
        assert_array_equal(first[1].input, group[1].input[:67])


def test_okid_has_to_halve_the_error(by_hand):
    for error, method in ((CLEARLY * 0.2, "regularized"), (CLEARLY * 0.2 * 0.999, "okid")):
        by_hand.arx.error = error
        assert choose_estimate((record(),), 40, "unknown").method == method


def test_a_kernel_is_looked_for_output_by_output(by_hand):
    choose_estimate((record(p=3),), 40, "unknown")
    assert by_hand.asked[0][-1] == ("auto", "auto", "auto")


def test_where_two_thirds_are_too_short_the_prior_stays(by_hand):
    by_hand.arx = DataError("too short")
    chosen = choose_estimate((record(),), 40, "unknown")
    assert (chosen.method, chosen.kernels, chosen.reason) == ("regularized", ("SS",), "")
    by_hand.smooth = DataError("too short")
    chosen = choose_estimate((record(p=2),), 40, "unknown")
    assert (chosen.method, chosen.kernels, chosen.reason) == ("regularized", ("auto", "auto"), "")


def test_missing_samples_cannot_be_simulated(by_hand):
    y = record().output.copy()
    y[[50, 250]] = np.nan  # in what is fitted and in what is judged
    holes = cr.Record(record().time, record().input, y, missing="keep")
    chosen = choose_estimate((record(), holes), 40, "unknown")
    assert (chosen.method, chosen.kernels, chosen.reason) == ("regularized", ("SS",), "")
    assert [which for which, *_ in by_hand.asked] == ["smooth"]


def test_ten_times_the_output_is_all_of_it():
    assert _percent(0.0512) == "5.12 %"
    assert _percent(9.99) == "999 %"
    assert _percent(10.0) == "all of it (unstable, or nearly)"


def pulses(*markov):
    return SimpleNamespace(arx=None, markov=np.array(markov))


def filtered(u, *taps):
    return np.convolve(u, taps)[: u.size]


def test_the_error_is_what_is_missed_over_the_output_on_what_was_held_back():
    rng = np.random.default_rng(0)
    u = rng.standard_normal(400)
    y = filtered(u, 0.0, 1.0, 0.5)
    one = cr.Record(DT * np.arange(400), u, y + 7.0)
    assert _error((one,), [300], pulses([[0.0, 1.0, 0.5]]), 3) < 1e-12
    # a level that is off is no error, a model of nothing misses all
    assert_allclose(_error((one,), [300], pulses([[0.0, 0.0, 0.0]]), 3), 1.0, rtol=1e-12)
    part = (y - filtered(u, 0.0, 0.9, 0.5))[300:]
    expected = part.std() / y[300:].std()
    assert_allclose(_error((one,), [300], pulses([[0.0, 0.9, 0.5]]), 3), expected, rtol=1e-9)
    # what was seen in the fit does not count
    spoiled = y.copy()
    spoiled[:250] = 1e3
    other = cr.Record(one.time, u, spoiled)
    assert_allclose(_error((other,), [300], pulses([[0.0, 0.9, 0.5]]), 3), expected, rtol=1e-9)


def test_every_output_counts_in_its_own_unit():
    u = np.random.default_rng(0).standard_normal(300)
    outputs = np.stack([filtered(u, 0.0, 1.0), 1e6 * filtered(u, 0.0, 0.0, 2.0)])
    one = cr.Record(DT * np.arange(300), u, outputs)
    # all of the small output is missed, nothing of the large one
    found = pulses([[0.0, 0.0, 0.0]], [[0.0, 0.0, 2e6]])
    assert_allclose(_error((one,), [200], found, 3), np.sqrt(0.5), rtol=1e-9)


def test_a_large_output_that_is_missed_hides_nothing_of_a_small_one():
    u = np.random.default_rng(0).standard_normal(300)
    outputs = np.stack([filtered(u, 0.0, 1.0), 1e9 * filtered(u, 0.0, 0.0, 2.0)])
    one = cr.Record(DT * np.arange(300), u, outputs)
    nothing = pulses([[0.0, 0.0, 0.0]], [[0.0, 0.0, 0.0]])
    assert_allclose(_error((one,), [200], nothing, 3), 1.0, rtol=1e-12)


def test_every_record_counts_by_its_samples():
    u = np.random.default_rng(0).standard_normal(900)
    known = cr.Record(DT * np.arange(900), u, filtered(u, 0.0, 1.0))
    unrelated = cr.Record(DT * np.arange(300), np.zeros(300), u[:300])
    found = pulses([[0.0, 1.0]])
    # of 100 + 300 samples the 100 are missed
    assert_allclose(_error((unrelated, known), [200, 600], found, 2), np.sqrt(0.25), rtol=1e-9)
    assert_allclose(_error((known, unrelated), [600, 200], found, 2), np.sqrt(0.25), rtol=1e-9)


def test_the_past_of_what_was_held_back_is_twice_the_response_or_as_long():
    rng = np.random.default_rng(0)
    u = np.r_[np.full(500, 3.0), rng.standard_normal(100)]
    taps = 0.9 ** np.arange(40)
    y = filtered(u, *taps)
    one = cr.Record(DT * np.arange(600), u, y)
    # from 80 samples before the split on: those of 0.9^40 of a step are not seen
    assert _error((one,), [550], pulses([taps]), 40) < 1e-12
    # without a past the step of the input 100 samples before would be missing
    begins = []

    def simulated(markov, part):
        begins.append(part.n_samples)
        return np.zeros((1, part.n_samples))

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(pulse_choice, "_by_convolution", simulated)
        for split, count in ((550, 40), (400, 40), (100, 80), (0, 10)):
            _error((one,), [split], pulses([taps]), count)
    assert begins == [130, 400, 600, 600]


def test_of_a_long_record_the_end_is_judged():
    n = 3 * MOST_JUDGED
    u = np.random.default_rng(0).standard_normal(n)
    y = filtered(u, 0.0, 1.0)
    y[: n - MOST_JUDGED] = 1e3  # not looked at
    one = cr.Record(DT * np.arange(n), u, y)
    # of 6000 samples one, the answer to the input before them, is not known
    assert _error((one,), [n // 2], pulses([[0.0, 1.0]]), 2) < 0.03


def test_an_output_that_stands_still_can_be_missed_a_million_times_at_most():
    u = np.random.default_rng(0).standard_normal(300)
    one = cr.Record(DT * np.arange(300), u, np.full(300, 5.0))
    found = _error((one,), [200], pulses([[0.0, 1.0]]), 2)
    assert 1e5 < found <= 1e6
    assert _error((one,), [200], pulses([[0.0, 0.0]]), 2) == 0.0


def test_pulse_responses_of_several_inputs_add_up_from_their_first_sample_on():
    rng = np.random.default_rng(0)
    u = rng.standard_normal((2, 50))
    markov = rng.standard_normal((3, 2, 7))
    found = _by_convolution(markov, cr.Record(DT * np.arange(50), u, u))
    moved = u - u[:, :1]
    expected = [sum(filtered(moved[j], *markov[a, j]) for j in range(2)) for a in range(3)]
    assert_allclose(found, expected, rtol=0, atol=1e-12)


@pytest.mark.parametrize(("pole", "stable"), [(0.8, True), (1.01, False)])
def test_an_arx_model_is_simulated_from_its_best_start_unless_it_runs_away(pole, stable):
    fit = SimpleNamespace(a=np.array([[[-pole]]]), b=np.array([[[0.0]], [[1.0]]]), delay=0)
    rng = np.random.default_rng(0)
    u = rng.standard_normal(80)
    plant = cr.DelayedStateSpace(ct.ss([[pole]], [[1.0]], [[1.0]], [[0.0]], DT))
    y = (3.0 + plant.simulate(u))[30:]
    one = cr.Record(DT * np.arange(50), u[30:], y)
    found = _by_arx(fit, one)
    if stable:
        assert_allclose(found[0], y, rtol=0, atol=1e-9)
    else:
        assert_allclose(found, np.full((1, 50), 1e6 * np.ptp(y)))
    with_arx = SimpleNamespace(arx=fit, markov=None)
    assert (_error((one,), [30], with_arx, 5) < 1e-9) == stable
