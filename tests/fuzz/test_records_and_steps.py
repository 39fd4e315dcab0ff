"""Arrays that are no record, and records that are no step."""

from __future__ import annotations

import numpy as np
from hypothesis import event, given
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

import ctrl_realize as cr
from tests.fuzz.lane import fuzz, good_end

ANY_FLOAT = st.floats(width=64)
SHAPES = hnp.array_shapes(min_dims=0, max_dims=3, min_side=0, max_side=8)
ANY_ARRAY = st.one_of(
    hnp.arrays("f8", SHAPES, elements=ANY_FLOAT),
    hnp.arrays("i8", SHAPES),
    hnp.arrays("c16", SHAPES),
    hnp.arrays("U3", SHAPES),
    hnp.arrays("?", SHAPES),
    st.lists(st.one_of(ANY_FLOAT, st.none(), st.text(max_size=2)), max_size=5),
    st.lists(st.lists(ANY_FLOAT, max_size=4), max_size=4),
    st.one_of(st.none(), st.text(max_size=3), st.integers(), st.just({})),
)


@st.composite
def signals(draw):
    """Time, input and output of one length, near to a step record and far from it."""
    n = draw(st.integers(3, 120))
    rng = np.random.default_rng(draw(st.integers(0, 99)))
    dt = draw(st.sampled_from([1.0, 7.8125e-4, 1e-9, 1e6, 1e-65, 1e65, 0.1]))
    time = dt * (np.arange(n) + draw(st.sampled_from([0, -7, 1e6])))
    onset = draw(st.integers(0, n - 1))
    amplitude = draw(st.sampled_from([1.0, -16.0, 1e-12, 1e65, -1e69, 1e-69, 5e-324, 0.0]))
    offset = draw(st.sampled_from([0.0, 4.0, 1e6, -1e69]))
    ramp = draw(st.integers(1, 5))
    u = np.clip((np.arange(n) - onset + 1) / ramp, 0, 1) * amplitude + offset
    y = np.concatenate([np.zeros(onset), 1 - np.exp(-np.arange(n - onset) / 5)]) * amplitude
    noise = draw(st.sampled_from([0.0, 1e-3, 1.0]))
    y = y + noise * max(abs(amplitude), 1e-300) * rng.standard_normal(n)
    for _ in range(draw(st.integers(0, 3))):
        which = draw(st.sampled_from([u, y]))
        which[draw(st.integers(0, n - 1))] = draw(st.one_of(ANY_FLOAT, st.floats(-10, 10)))
    if draw(st.booleans()):
        y = np.round(y, draw(st.integers(0, 3)))
    return time, u, y


@fuzz(150)
@given(ANY_ARRAY, ANY_ARRAY, ANY_ARRAY, st.sampled_from(["refuse", "keep", "drop"]))
def test_any_arrays_make_a_record_or_are_refused(time, u, y, missing):
    for make in (cr.Record, cr.Record.resampled):
        with good_end() as records:
            records.append(
                make(time, u, y, missing=missing) if make is cr.Record else make(time, u, y)
            )
        for record in records:
            assert record.dt > 0
            assert record.time.shape == record.output.shape[-1:]


@fuzz(100)
@given(
    hnp.arrays("f8", st.integers(3, 20), elements=ANY_FLOAT),
    st.floats(0, 2),
    st.one_of(st.none(), st.floats(1e-3, 1e3)),
)
def test_any_time_axis_is_uniform_resampled_or_refused(time, max_jitter, dt):
    u = np.arange(time.size)
    with good_end() as records:
        records.append(cr.Record(time, u, u))
    with good_end(megabytes=2000) as records:
        records.append(cr.Record.resampled(time, u, u, max_jitter=max_jitter, dt=dt))
    for record in records:
        steps = np.diff(record.time)
        np.testing.assert_allclose(steps, record.dt, rtol=0.11)


def step_functions(record: cr.Record) -> None:
    edge = cr.detect_step(record)
    assert 0 <= edge.index < record.n_samples
    assert edge.amplitude != 0
    step = cr.unit_step(record, edge)
    assert np.isfinite(step.output).all()
    for difference in ("backward", "central"):
        impulse = cr.impulse_from_step(step, difference=difference)
        assert np.isfinite(impulse.markov).all()
    event("impulse")


@fuzz(200)
@given(signals())
def test_any_record_has_a_step_or_is_refused(arrays):
    time, u, y = arrays
    before = u.copy(), y.copy()
    with good_end() as records:
        records.append(cr.Record(time, u, y))
    for record in records:
        with good_end():
            step_functions(record)
    np.testing.assert_array_equal(u, before[0])
    np.testing.assert_array_equal(y, before[1])
