"""Draws, blocks and bands of a bootstrap, with estimators that are written by hand."""

from __future__ import annotations

from types import SimpleNamespace

import control as ct
import numpy as np
import pytest

import ctrl_realize as cr
from ctrl_realize.errors import DataError, OptionError
from ctrl_realize.identification import bootstrap as module
from ctrl_realize.identification.bootstrap import (
    Bootstrap,
    _band,
    _block,
    _identified,
    _middle,
    _model_and_residual,
    _redrawn,
    _scaled,
)
from ctrl_realize.results import Flag
from ctrl_realize.wording import in_time, interval_in_time

DT = 0.5
N = 200
TIME = DT * np.arange(N)


def model(pole=0.5, delay=1, gain=2.0, fit=None):
    """A lag sampled at 0.5 s of that gain behind its delay."""
    core = ct.ss([[pole]], [[1.0]], [[gain * (1 - pole)]], [[0.0]], DT)
    return cr.DelayedStateSpace(core, delay, fit=fit)


def drawn(waits=(1.0, 2.0, 4.0), poles=None, kind="residuals", block=7, failed=0, fit=None):
    poles = poles or [0.5] * len(waits)
    gains = 2.0 + np.arange(len(waits))
    systems = tuple(model(p, gain=g) for p, g in zip(poles, gains, strict=True))
    return Bootstrap(model(fit=fit), systems, np.array(waits), kind, block, failed)


# what is read off the draws


def test_scatter_and_gains_are_those_of_the_draws():
    result = drawn()
    assert result.std == pytest.approx(np.sqrt(7 / 3), rel=1e-12)  # of 1, 2, 4: mean 7/3
    np.testing.assert_allclose(result.gains, [2.0, 3.0, 4.0], rtol=1e-12)
    assert [p.tolist() for p in drawn(poles=[0.1, 0.2, 0.3]).poles()] == [[0.1], [0.2], [0.3]]


def test_of_79_draws_the_second_and_the_last_but_one_are_the_ends():
    # the k-th of B has k / (B + 1) below it: 2 / 80 is a fortieth
    waits = np.random.default_rng(0).permutation(np.arange(79.0))
    assert drawn(waits).interval == pytest.approx((1.0, 77.0), rel=1e-12)
    low, high = _middle(np.stack([waits, 2 * waits], axis=1), 0.9)
    np.testing.assert_allclose([low, high], [[3.0, 6.0], [75.0, 150.0]], rtol=1e-12)


@pytest.mark.parametrize("level", [0.0, 1.0, -0.5, 1.5])
def test_a_level_lies_between_zero_and_one(level):
    with pytest.raises(OptionError, match="level"):
        _band(np.zeros((3, 2)), level)
    for ask in (drawn().magnitude_band, drawn().phase_band):
        with pytest.raises(OptionError, match="level"):
            ask([0.1], level=level)
    with pytest.raises(OptionError, match="level"):
        drawn().step_band(3, level=level)


def test_the_band_of_steps_lies_between_those_of_the_models():
    # half of three draws: the first and the last
    low, high = drawn().step_band(5, level=0.5)
    unit = np.r_[0.0, 0.0, 0.5, 0.75, 0.875]  # a pole at 0.5 behind one sample and the hold
    np.testing.assert_allclose(low, 2 * unit, atol=1e-12)
    np.testing.assert_allclose(high, 4 * unit, atol=1e-12)


def test_the_band_of_gains_lies_between_those_of_the_models():
    omega = np.array([0.1, 3.0])
    unit = np.abs(0.5 / (np.exp(1j * omega * DT) - 0.5))
    low, high = drawn().magnitude_band(omega, level=0.5)
    np.testing.assert_allclose(low, 2 * unit, rtol=1e-12)
    np.testing.assert_allclose(high, 4 * unit, rtol=1e-12)
    wide = drawn(np.arange(79.0)).magnitude_band([0.0])
    np.testing.assert_allclose(wide, [[3.0], [79.0]], rtol=1e-9)


def test_phases_fall_with_the_delay_and_are_not_wrapped():
    omega = np.linspace(0.5, 6.0, 40)
    delays = np.array([7, 6, 9])
    result = Bootstrap(
        model(), tuple(model(delay=d) for d in delays), delays * DT, "residuals", 7, 0
    )
    low, high = result.phase_band(omega, level=0.5)
    lag = np.angle(0.5 / (np.exp(1j * omega * DT) - 0.5))
    # of three draws the first and the last; a sample is omega / 2
    np.testing.assert_allclose(high, lag - 6 * omega * DT, atol=1e-9)
    np.testing.assert_allclose(low, lag - 9 * omega * DT, atol=1e-9)


def test_phases_are_taken_within_half_a_turn_of_the_first_model():
    phases = np.array([2.2, -2.2, 3.1, -3.1, 2.0])
    systems = tuple(lambda z, phase=phase: np.exp([1j * phase]) for phase in phases)
    result = Bootstrap(model(), systems, np.ones(5), "residuals", 7, 0)
    # of five in a row 1 / 6 and 5 / 6: 2, 2.2, 3.1, 2 pi - 3.1 and 2 pi - 2.2
    low, high = result.phase_band([1.0], level=2 / 3)
    np.testing.assert_allclose([low[0], high[0]], [2.0, 2 * np.pi - 2.2], rtol=1e-12)


def test_bands_are_of_95_percent_unless_asked():
    result = drawn(np.arange(79.0))
    for ask, what in (
        (result.step_band, 3),
        (result.magnitude_band, [1.0]),
        (result.phase_band, [1.0]),
    ):
        np.testing.assert_array_equal(ask(what), ask(what, level=0.95))


def test_failed_draws_and_coarse_rounding_are_flagged():
    assert drawn().flags == ()
    (failed,) = drawn(failed=3).flags
    assert (failed.code, "3 draws" in failed.message) == ("failed_draws", True)
    fit = SimpleNamespace(flags=(Flag("hum", "x"), Flag("coarse_quantisation", "y")))
    assert [f.code for f in drawn(failed=1, fit=fit).flags] == [
        "failed_draws",
        "coarse_quantisation",
    ]
    assert drawn(fit=SimpleNamespace(flags=(Flag("hum", "x"),))).flags == ()
    assert drawn(fit=SimpleNamespace()).flags == ()


def test_the_card_tells_the_scatter_and_what_it_does_not_see():
    result = drawn((1.0, 1.2, 1.7), block=7)
    low, high = result.interval
    assert result.report().splitlines() == [
        "Bootstrap of residuals: 3 models",
        "  dead time           1.2 s (median)",
        f"  middle 95 %         {interval_in_time(low, high)}",
        f"  standard deviation  {in_time(np.sqrt(0.13))}",
        "  gain                3 +- 1",
        "  blocks              7 samples of the residual",
        "  not seen            bias: what the method does wrong on every record",
    ]
    assert repr(result) == f"<Bootstrap of residuals: 3 models, {low:.4g}...{high:.4g} s>"
    assert "blocks" not in drawn(block=0).report()
    assert dict(drawn((1.23456, 1.23456, 9.0))._rows())["dead time"] == "1.2346 s (median)"


# how the noise is drawn


def record(output, n=N, **labels):
    u = np.where(np.arange(n) < 20, 5.0, 6.0)
    return cr.Record(TIME[:n], u, output, **labels)


def test_offset_and_slope_are_not_in_the_residual():
    k = np.arange(N)
    step = 2 * (1 - 0.5 ** np.clip(k - 21.0, 0, None))  # the model behind a sample of delay
    given = record(7 + step + 0.03 * k)
    response, residual = _model_and_residual(model(), given)
    np.testing.assert_allclose(residual, 0.0, atol=1e-10)
    np.testing.assert_allclose(response, given.output, atol=1e-10)
    # the rest is where the input is at first
    early = cr.Record(
        TIME, np.where(k < 1, 5.0, 6.0), 7 + 2 * (1 - 0.5 ** np.clip(k - 2.0, 0, None))
    )
    np.testing.assert_allclose(_model_and_residual(model(), early)[1], 0.0, atol=1e-10)
    noise = np.where(k % 2, 1.0, -1.0)
    response, residual = _model_and_residual(model(), record(step + noise))
    np.testing.assert_allclose(response + residual, step + noise, atol=1e-12)
    # alternating noise has next to no line in it: 2 / N
    np.testing.assert_allclose(residual, noise, atol=0.03)


def test_a_block_is_three_correlation_times_long(monkeypatch):
    times = {50: 4.4, 100: 2.0}
    monkeypatch.setattr(module, "correlation_time", lambda residual: times[residual.size])
    parts = [(np.zeros(n), np.zeros(n)) for n in (100, 50)]
    assert _block(parts, None) == 12  # a quarter of the shortest; three times 4.4 are 13
    times[50] = 3.9
    assert _block(parts, None) == 12  # 11.7
    times[50] = 1.0
    assert _block(parts, None) == 6
    times.update({100: 0.1, 50: 0.1})
    assert _block(parts, None) == 1
    times[3] = 9.0
    assert _block([(np.zeros(3), np.zeros(3))], None) == 1


def test_a_block_that_is_given_is_taken_up_to_the_shortest_record():
    parts = [(np.zeros(n), np.zeros(n)) for n in (100, 50)]
    assert [_block(parts, block) for block in (1, 50)] == [1, 50]
    for block in (0, 51, 1.5):
        with pytest.raises(OptionError, match="block"):
            _block(parts, block)


def test_a_residual_is_scaled_up_by_what_model_and_blocks_have_taken(monkeypatch):
    monkeypatch.setattr(module, "correlation_time", lambda residual: 5.0)
    kept = []

    def kept_in_blocks(residual, length):
        kept.append(length)
        return 0.8 if residual.size == 100 else 0.1

    monkeypatch.setattr(module, "kept_in_blocks", kept_in_blocks)
    parts = [(np.arange(3.0), np.ones(100)), (np.arange(4.0), np.ones(150))]
    (first, one), (second, other) = _scaled(parts, 9, model())
    # 250 / 5 independent samples, 7 parameters: a pole, gain, dead time, two offsets and slopes
    np.testing.assert_allclose(one, 1 / np.sqrt(43 / 50 * 0.8), rtol=1e-12)
    np.testing.assert_allclose(other, 1 / np.sqrt(43 / 50 * 0.5), rtol=1e-12)  # at most twice
    assert kept == [9, 9]
    assert (first.tolist(), second.tolist()) == ([0.0, 1.0, 2.0], [0.0, 1.0, 2.0, 3.0])
    ((_, few),) = _scaled([(np.zeros(100), np.ones(100))], 9, model(delay=0))
    np.testing.assert_allclose(few, 1 / np.sqrt(0.75 * 0.8), rtol=1e-12)  # 5 of 20
    monkeypatch.setattr(module, "correlation_time", lambda residual: 50.0)
    ((_, fewer),) = _scaled([(np.zeros(100), np.ones(100))], 9, model())
    np.testing.assert_allclose(fewer, 1 / np.sqrt(0.5 * 0.8), rtol=1e-12)


class Starts:
    """A generator whose draws are known."""

    def __init__(self, starts):
        self.starts = starts

    def integers(self, high, size):
        assert high == 10
        assert size == len(self.starts)
        return np.array(self.starts)


@pytest.mark.parametrize(
    ("length", "starts", "index"),
    [
        (4, [8, 0, 5], [8, 9, 0, 1, 0, 1, 2, 3, 5, 6]),
        (5, [3, 9], [3, 4, 5, 6, 7, 9, 0, 1, 2, 3]),
        (10, [1], [1, 2, 3, 4, 5, 6, 7, 8, 9, 0]),
        (1, [3] * 10, [3] * 10),
    ],
)
def test_blocks_run_around_the_circle_until_the_record_is_full(length, starts, index):
    given = record(np.zeros(10), 10, name="a")
    residual = np.arange(10.0)
    again = _redrawn(given, np.full(10, 100.0), residual, length, Starts(starts))
    np.testing.assert_array_equal(again.output, 100.0 + np.array(index))
    np.testing.assert_array_equal(again.input, given.input)
    np.testing.assert_array_equal(again.time, given.time)
    assert again.name == "a"


# one identification after the other


def test_the_dead_time_of_a_draw_is_that_of_its_fit_or_of_its_model():
    fitted = _identified(lambda draw: model(fit=SimpleNamespace(dead_time=0.7)), "draw")
    assert fitted[1] == 0.7
    assert fitted[0].fit is None
    for fit in (None, SimpleNamespace(dead_time=None)):
        assert _identified(lambda draw, fit=fit: model(delay=3, fit=fit), "draw")[1] == 3 * DT


def test_an_error_of_the_method_is_a_failed_draw_and_any_other_is_raised():
    def broken(draw):
        raise draw

    assert _identified(broken, DataError("no")) is None
    with pytest.raises(KeyError):
        _identified(broken, KeyError("no"))


NOISY = [
    record(np.random.default_rng(k).standard_normal(N), name=f"r{k}", input_labels=["i"])
    for k in range(5)
]


@pytest.fixture
def asked():
    """Of an estimator that waits for the mean of what it is given, what it was given."""
    given = []

    def estimator(records):
        given.append(records)
        several = [records] if isinstance(records, cr.Record) else records
        wait = float(np.mean([r.output.mean() for r in several]))
        return model(fit=SimpleNamespace(dead_time=wait))

    estimator.given = given
    return estimator


def test_one_record_stays_one_and_four_stay_four(asked):
    result = cr.bootstrap(NOISY[0], asked, repeats=3, block=17)
    assert (result.kind, result.block, result.failed) == ("residuals", 17, 0)
    assert asked.given[0] is NOISY[0]
    assert [type(draw) for draw in asked.given[1:]] == [cr.Record] * 3
    asked.given.clear()
    four = cr.bootstrap(NOISY[:4], asked, repeats=3)
    assert four.kind == "residuals"
    assert [[r.name for r in draw] for draw in asked.given[1:]] == [["r0", "r1", "r2", "r3"]] * 3
    means = [np.mean([r.output.mean() for r in draw]) for draw in asked.given[1:]]
    np.testing.assert_array_equal(four.dead_times, means)
    assert four.system.fit.dead_time == np.mean([r.output.mean() for r in NOISY[:4]])
    assert all(system.fit is None for system in four.systems)


def test_of_five_records_five_are_drawn_with_replacement(asked):
    result = cr.bootstrap(NOISY, asked, repeats=50)
    assert (result.kind, result.block) == ("records", 0)
    draws = asked.given[1:]
    assert len(draws) == len(result.systems) == 50
    assert all(len(draw) == 5 for draw in draws)
    names = [r.name for draw in draws for r in draw]
    # 250 draws of five: 50 of each within four standard deviations of 6.3
    assert all(abs(names.count(f"r{k}") - 50) < 26 for k in range(5))
    assert any(len({r.name for r in draw}) < 5 for draw in draws)
    assert all(r in NOISY for draw in draws for r in draw)


def test_draws_differ_and_depend_on_the_seed(asked):
    first, again, other = (
        cr.bootstrap(NOISY[0], asked, repeats=4, seed=seed).dead_times for seed in (0, 0, 1)
    )
    np.testing.assert_array_equal(first, again)
    assert len({*first, *other}) == 8
    assert np.array_equal(cr.bootstrap(NOISY[0], asked, repeats=4).dead_times, first)
    # the first draws do not depend on how many there are
    np.testing.assert_array_equal(cr.bootstrap(NOISY[0], asked, repeats=2).dead_times, first[:2])


def test_failed_draws_are_counted_and_two_models_are_needed():
    left = [model(), None, model(), None, model()]

    def estimator(records):
        system = left.pop(0)
        if system is None:
            raise DataError("no")
        return system

    result = cr.bootstrap(NOISY[0], estimator, repeats=4)
    assert (len(result.systems), result.failed) == (2, 2)
    left.extend([model(), None, model(), None])
    with pytest.raises(DataError, match="for 2 of 3 draws"):
        cr.bootstrap(NOISY[0], estimator, repeats=3)


def test_two_hundred_draws_are_made_in_one_process_unless_asked(asked, monkeypatch):
    processes = []

    def parallel(**how):
        processes.append(how)
        return lambda tasks: [call(*args) for call, args, _ in tasks]

    monkeypatch.setattr("joblib.Parallel", parallel)
    assert len(cr.bootstrap(NOISY[0], asked).systems) == 200
    cr.bootstrap(NOISY[0], asked, repeats=2, n_jobs=3)
    assert processes == [{"n_jobs": 1}, {"n_jobs": 3}]


@pytest.mark.parametrize(
    "wrong", [{"repeats": 1}, {"repeats": 2.5}, {"seed": -1}, {"seed": 0.5}, {"estimator": "fit"}]
)
def test_options_are_checked_before_anything_is_fitted(asked, wrong):
    with pytest.raises(OptionError, match=next(iter(wrong))):
        cr.bootstrap(NOISY[0], **{"estimator": asked, **wrong})
    assert asked.given == []
