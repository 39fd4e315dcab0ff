"""What a realization decides and flags, on short responses whose numbers are known."""

from __future__ import annotations

import numpy as np
import pytest

import ctrl_realize as cr
from ctrl_realize.errors import DelayRangeError, OptionError, OrderError
from ctrl_realize.identification.realization import (
    uses_feedthrough,
)

DT = 0.1
K = np.arange(40)
LAG = np.r_[np.zeros(4), 0.5**K]  # 1 at sample 4, then half of it and half of that


def codes(flags):
    return [flag.code for flag in flags]


def test_a_lag_is_found_behind_its_delay():
    system = cr.realize(LAG, 1, delay=3, dt=DT)
    assert (system.delay, system.dt, system.delay_free.nstates) == (3, DT, 1)
    np.testing.assert_allclose(system.markov(44), LAG, atol=1e-14)
    fit = system.fit
    assert (fit.order, fit.delay, fit.samples, fit.hankel) == (1, 3, 40, "square")
    assert (fit.feedthrough, fit.error_bound, fit.flags) == (True, None, ())
    np.testing.assert_array_equal(fit.impulse.markov, LAG)
    # of 20 rows: the sum of the squares of all entries, 0.25^k, is that of (4/3)^2
    assert fit.singular_values[0] == pytest.approx(4 / 3, rel=1e-9)
    assert not fit.singular_values.flags.writeable
    assert fit.iae < 1e-13


def test_without_a_direct_term_its_sample_is_what_is_missing():
    direct = cr.realize(LAG, 1, delay=4, dt=DT)
    assert direct.delay_free.D.item() == 1.0
    assert direct.fit.iae == pytest.approx(0.0, abs=1e-13)
    without = cr.realize(LAG, 1, delay=4, feedthrough=False, dt=DT)
    assert without.delay_free.D.item() == 0.0
    assert without.fit.iae == pytest.approx(1.0, rel=1e-12)
    assert not without.fit.feedthrough


def test_a_direct_term_is_looked_for_at_the_delay():
    rest = 1e-3 * np.random.default_rng(0).standard_normal(50)
    noisy = cr.ImpulseResponse(LAG + 1e-12, DT, noise=rest)
    assert not cr.realize(noisy, 1, delay=3).fit.feedthrough
    assert cr.realize(noisy, 1, delay=4).fit.feedthrough


def test_samples_beyond_those_asked_for_are_not_seen():
    wild = LAG.copy()
    wild[14] = 9.0
    seen = cr.realize(wild, 1, delay=4, samples=9, dt=DT).fit  # 5 to 13
    assert seen.samples == 9
    assert seen.iae < 1e-13
    assert cr.realize(wild, 1, delay=4, samples=10, dt=DT).fit.iae > 1
    # what comes before the delay is not modelled
    early = LAG.copy()
    early[1] = -2.0
    assert cr.realize(early, 1, delay=4, dt=DT).fit.iae == pytest.approx(2.0, rel=1e-12)


def test_a_padded_matrix_bounds_the_error():
    two = LAG + np.r_[np.zeros(4), 0.1 * 0.2**K]
    fit = cr.realize(two, 1, delay=3, hankel="padded", dt=DT).fit
    assert (fit.hankel, fit.samples) == ("padded", 40)
    model = cr.realize(two, 1, delay=3, hankel="padded", dt=DT)
    z = np.exp(1j * np.linspace(0.0, np.pi, 50))
    off = np.abs(np.polyval(two[::-1], 1 / z) - model(z)).max()
    assert 0 < off <= fit.error_bound < 0.1
    assert fit.following < fit.singular_values[0]
    for hankel in ("round", None):
        with pytest.raises(OptionError, match="hankel="):
            cr.realize(LAG, 1, dt=DT, hankel=hankel)


def test_channels_keep_their_places():
    gains = np.array([[1.0, 2.0], [3.0, -1.0], [0.5, 0.25]])
    pulses = gains[:, :, None] * LAG
    for direct in (None, False):
        system = cr.realize(pulses, 2, delay=4, feedthrough=direct, dt=DT)
        assert system.delay_free.D.shape == (3, 2)
        expected = pulses.copy()
        if direct is False:
            expected[:, :, 4] = 0
        np.testing.assert_allclose(system.markov(44), expected, atol=1e-13)


def test_orders_above_the_rank_are_refused_with_it():
    with pytest.raises(OrderError, match=r"order=2, but .* 3 samples .* rank 1; use .* at most 1"):
        cr.realize(LAG, 2, delay=3, dt=DT)
    with pytest.raises(OrderError, match="rank 0; they are zero: a pure gain"):
        cr.realize(np.zeros(20), 1, dt=DT)
    with pytest.raises(OrderError, match="1 <= order <= 20"):
        cr.realize(LAG, 21, delay=3, dt=DT)
    with pytest.raises(DelayRangeError, match="delay=50"):
        cr.realize(LAG, 1, delay=50, dt=DT)
    for wrong in ({"order": 0}, {"delay": -1}):
        with pytest.raises(OptionError, match=f"{next(iter(wrong))}="):
            cr.realize(LAG, **{"order": 1, "dt": DT, **wrong})


def test_a_padded_matrix_holds_twice_as_many_orders():
    noise = np.random.default_rng(0).standard_normal(9)
    assert cr.realize(noise, 8, hankel="padded", dt=DT).fit.order == 8
    for hankel, most in (("padded", 8), ("square", 4)):
        with pytest.raises(OrderError, match=f"1 <= order <= {most}$"):
            cr.realize(noise, most + 1, hankel=hankel, dt=DT)


def test_flags_of_filter_poles_and_gap_stand_together():
    causal = cr.FilterSpec(5, 1.0, zero_phase=False, dt=DT)
    noise = np.random.default_rng(0).standard_normal(60)
    found = cr.realize(cr.ImpulseResponse(noise, DT, filter=causal), 4)
    assert codes(found.fit.flags)[0] == "filter_delay"
    assert codes(found.fit.flags)[-1] == "no_gap"
    grown = cr.realize(1.1 ** np.arange(30), 1, dt=DT)
    assert codes(grown.fit.flags) == ["unstable"]


# the direct term


def impulse(noise, first=1.0):
    return cr.ImpulseResponse(np.r_[0.5, first, np.zeros(20)], DT, noise=noise)


def test_a_direct_term_is_as_asked_for_or_as_measured():
    quiet = impulse(np.array([1.0, -1.0]), first=0.1)
    assert uses_feedthrough(quiet, 1, True) is True
    assert uses_feedthrough(quiet, 1, False) is False
    assert uses_feedthrough(quiet, 1, None) is False
    assert uses_feedthrough(impulse(None, 1e-9), 1, None) is True
    assert uses_feedthrough(impulse(np.array([9.0]), 1e-9), 1, None) is True
    several = cr.ImpulseResponse(np.ones((2, 1, 9)), DT, noise=np.array([9.0, -9.0]))
    assert uses_feedthrough(several, 1, None) is True


def test_three_standard_deviations_are_needed_to_believe_it():
    two = np.array([1.0, -1.0])  # a standard deviation of the square root of 2
    for sign in (1, -1):
        assert uses_feedthrough(impulse(two, sign * 4.2426), 1, None) is False
        assert uses_feedthrough(impulse(two, sign * 4.2427), 1, None) is True
    assert uses_feedthrough(impulse(two, 9.0), 0, None) is False  # at its own sample


# what is left
