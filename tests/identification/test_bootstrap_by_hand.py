"""Draws, blocks and bands of a bootstrap, with estimators that are written by hand."""

from __future__ import annotations

import control as ct
import numpy as np
import pytest

import ctrl_realize as cr
from ctrl_realize.errors import DataError
from ctrl_realize.identification.bootstrap import (
    Bootstrap,
)
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


def test_the_card_tells_the_scatter_and_what_it_does_not_see():
    result = drawn((1.0, 1.2, 1.7), block=7)
    low, high = result.interval
    assert result.report().splitlines() == [
        "Bootstrap of residuals: 3 models",
        "  dead time           1.20 s (median)",
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


# one identification after the other


NOISY = [
    record(np.random.default_rng(k).standard_normal(N), name=f"r{k}", input_labels=["i"])
    for k in range(5)
]


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
