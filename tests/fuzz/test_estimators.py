"""Impulse responses and records of every size, shape and scale, through the estimators."""

from __future__ import annotations

import numpy as np
from hypothesis import event, given
from hypothesis import strategies as st

import ctrl_realize as cr
from tests.fuzz.lane import fuzz, good_end


@st.composite
def responses(draw):
    """Unit-pulse responses: exact, noisy, flat, growing, with single samples out of order."""
    n = draw(st.integers(1, 160))
    k = np.arange(n)
    poles = draw(st.lists(st.sampled_from([0.0, 0.5, 0.9, -0.8, 0.999, 1.0, 1.01]), max_size=3))
    g = np.zeros(n)
    for pole in poles:
        g = g + draw(st.sampled_from([1.0, -0.5, 3.0])) * pole**k
    delay = draw(st.integers(0, 30))
    g = np.concatenate([np.zeros(delay), g])[:n]
    rng = np.random.default_rng(draw(st.integers(0, 99)))
    g = g + draw(st.sampled_from([0.0, 0.0, 1e-12, 1e-3, 1.0])) * rng.standard_normal(n)
    g = g * draw(st.sampled_from([1.0, 1e-90, 1e90, 1e-300, 1e150, 0.0]))
    if draw(st.booleans()):
        g[draw(st.integers(0, n - 1))] = draw(st.floats(width=64))
    if draw(st.integers(0, 4)) == 0:
        g = np.stack([[g, 2 * g], [-g, g[::-1]]])
    return g


CHOICES = {
    "samples": st.one_of(st.none(), st.none(), st.integers(-1, 200)),
    "feedthrough": st.sampled_from([None, True, False]),
    "hankel": st.sampled_from(["square", "padded", "round"]),
}
DT = st.sampled_from([1.0, 7.8125e-4, 1e-9, 1e9])
ORDERS = st.integers(-1, 9)


def check(model: cr.DelayedStateSpace) -> None:
    event("model")
    core = model.delay_free
    for matrix in (core.A, core.B, core.C, core.D):
        assert np.isfinite(matrix).all()
    assert repr(model)
    assert model.fit.report()


@fuzz(100)
@given(responses(), ORDERS, st.integers(-1, 40), DT, st.fixed_dictionaries({}, optional=CHOICES))
def test_any_response_is_realized_or_refused(g, order, delay, dt, choice):
    before = g.copy()
    with good_end() as models:
        models.append(cr.realize(g, order, delay=delay, dt=dt, **choice))
    for model in models:
        check(model)
        assert model.delay_free.nstates == order
        if choice.get("hankel") == "padded":
            # stable by construction, up to rounding
            assert np.abs(model.delay_free.poles()).max() < 1 + 1e-9
    np.testing.assert_array_equal(g, before)


@fuzz(60)
@given(responses(), ORDERS, st.integers(-1, 60), DT, st.fixed_dictionaries({}, optional=CHOICES))
def test_any_response_is_scanned_for_its_delay_or_refused(g, order, max_delay, dt, choice):
    with good_end() as models:
        models.append(cr.estimate_delay(g, order, max_delay=max_delay, dt=dt, **choice))
    for model in models:
        check(model)
        scan = model.fit
        assert scan.iae.shape == (max_delay + 1,)
        assert scan.delay == model.delay
        # the smallest, or the first of those that rounding cannot tell from it
        assert scan.iae[scan.delay] <= scan.iae.min() + 1e-10 * np.abs(g).sum()
        low, high = scan.interval
        assert low <= scan.delay <= high


@fuzz(40)
@given(
    responses(), st.integers(0, 6), st.integers(0, 30), st.fixed_dictionaries({}, optional=CHOICES)
)
def test_any_response_is_scanned_over_orders_or_refused(g, orders, max_delay, choice):
    with good_end() as scans:
        scans.append(cr.scan_orders(g, orders, max_delay=max_delay, dt=1.0, **choice))
    for scan in scans:
        event("scan")
        assert repr(scan)
        assert scan.report()


@st.composite
def experiments(draw):
    """Step records and random ones, short and noisy, of any scale, with bad samples."""
    n = draw(st.one_of(st.integers(3, 260), st.integers(150, 260)))
    rng = np.random.default_rng(draw(st.integers(0, 99)))
    dt = draw(st.sampled_from([1.0, 0.01, 1e-6, 1e5]))
    onset = draw(st.one_of(st.integers(0, n - 1), st.integers(0, n // 3)))
    u = (np.arange(n) >= onset).astype(float)
    if draw(st.integers(0, 2)) == 0:
        u = rng.choice([-1.0, 1.0], n)
    delay = draw(st.integers(0, 20))
    y = np.zeros(n)
    for k in range(1, n):
        y[k] = 0.8 * y[k - 1] + 0.2 * (u[k - delay - 1] if k > delay else 0.0)
    y = y + draw(st.sampled_from([0.0, 1e-6, 0.01, 1.0])) * rng.standard_normal(n)
    scale = draw(st.sampled_from([1.0, -3.0, 1e-12, 1e12, 1e-60, 1e60, 0.0]))
    y = y * scale + draw(st.sampled_from([0.0, 5.0, 1e6]))
    if draw(st.integers(0, 3)) == 0:
        y[draw(st.integers(0, n - 1))] = draw(st.floats(-1e69, 1e69))
    if draw(st.booleans()):
        y = np.round(y, 2)
    return dt * np.arange(n), u, y


@fuzz(60)
@given(
    experiments(),
    st.sampled_from(["scan", "paper"]),
    st.one_of(st.none(), st.integers(0, 5)),
    st.one_of(st.none(), st.integers(0, 50)),
)
def test_any_record_is_identified_by_the_scan_or_refused(arrays, method, order, max_delay):
    with good_end() as models:
        record = cr.Record(*arrays)
        models.append(cr.identify(record, method=method, order=order, max_delay=max_delay))
    for model in models:
        check(model)


@fuzz(40)
@given(experiments(), st.integers(-1, 60))
def test_any_record_gives_an_impulse_response_or_is_refused(arrays, length):
    with good_end() as results:
        results.append(cr.impulse_from_io(cr.Record(*arrays), length))
    for impulse in results:
        event("impulse")
        assert np.isfinite(impulse.markov).all()


@fuzz(40)
@given(experiments())
def test_any_record_gives_a_frequency_response_or_is_refused(arrays):
    with good_end() as results:
        results.append(cr.spectral_frf(cr.Record(*arrays)))
    for frf in results:
        event("frf")
        assert np.isfinite(frf.frdata).all()
