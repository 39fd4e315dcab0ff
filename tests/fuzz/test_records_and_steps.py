"""Arrays that are no record, and records that are no step."""

import numpy as np

import ctrl_realize as cr
from tests.fuzz.draws import any_array, any_float, generator
from tests.fuzz.lane import fuzz, good_end


def any_signals(rng):
    """Time, input and output of one length, near to a step record and far from it."""
    n = rng.randint(3, 120)
    dt = rng.choice([1.0, 7.8125e-4, 1e-9, 1e6, 1e-65, 1e65, 0.1])
    time = dt * (np.arange(n) + rng.choice([0, -7, 1e6]))
    onset = rng.randrange(n)
    amplitude = rng.choice([1.0, -16.0, 1e-12, 1e65, -1e69, 1e-69, 5e-324, 0.0])
    offset = rng.choice([0.0, 4.0, 1e6, -1e69])
    ramp = rng.randint(1, 5)
    u = np.clip((np.arange(n) - onset + 1) / ramp, 0, 1) * amplitude + offset
    y = np.concatenate([np.zeros(onset), 1 - np.exp(-np.arange(n - onset) / 5)]) * amplitude
    noise = rng.choice([0.0, 1e-3, 1.0]) * max(abs(amplitude), 1e-300)
    y = y + noise * generator(rng).standard_normal(n)
    for _ in range(rng.randint(0, 3)):
        bad = any_float(rng) if rng.randrange(2) else rng.uniform(-10, 10)
        rng.choice([u, y])[rng.randrange(n)] = bad
    if rng.randrange(2):
        with np.errstate(over="ignore", invalid="ignore"):
            y = np.round(y, rng.randint(0, 3))
    return time, u, y


@fuzz(150)
def test_any_arrays_make_a_record_or_are_refused(rng):
    time, u, y = any_array(rng), any_array(rng), any_array(rng)
    if rng.randrange(2):
        # of one length, so that more than the length is looked at
        n = rng.randint(3, 9)
        time = np.arange(float(n)) * rng.choice([1.0, 0.1, 1e-9])
        u, y = (np.array([any_float(rng) for _ in range(n)]) for _ in range(2))
    missing = rng.choice(["refuse", "keep", "drop"])
    with good_end() as records:
        records.append(cr.Record(time, u, y, missing=missing))
    with good_end() as resampled:
        resampled.append(cr.Record.resampled(time, u, y))
    for record in records + resampled:
        assert record.dt > 0
        assert record.time.shape == record.output.shape[-1:]
    for record in records:
        # what it holds is what it was given
        np.testing.assert_array_equal(np.ravel(record.input), np.ravel(u).astype(float))
        np.testing.assert_array_equal(np.ravel(record.output), np.ravel(y).astype(float))


@fuzz(100)
def test_any_time_axis_is_uniform_resampled_or_refused(rng):
    n = rng.randint(3, 20)
    dt = abs(any_float(rng, finite=True)) or 1.0
    kind = rng.randrange(4)
    if kind == 0:
        time = np.array([any_float(rng) for _ in range(n)])
    elif kind == 1:
        time = np.sort([any_float(rng, finite=True) for _ in range(n)])
    else:
        with np.errstate(over="ignore"):
            time = dt * (np.arange(n) + rng.choice([0, 0.01, 0.3]) * generator(rng).random(n))
        if kind == 3:
            time[rng.randrange(n)] = any_float(rng)
    u = np.arange(n)
    with good_end() as records:
        records.append(cr.Record(time, u, u))
    choice = rng.choice([None, 10 ** rng.uniform(-3, 3)])
    with good_end(megabytes=2000) as resampled:
        resampled.append(cr.Record.resampled(time, u, u, max_jitter=rng.uniform(0, 2), dt=choice))
    for record in records + resampled:
        np.testing.assert_allclose(np.diff(record.time), record.dt, rtol=0.11)


def step_functions(record: cr.Record) -> None:
    edge = cr.detect_step(record)
    assert 0 <= edge.index < record.n_samples
    assert edge.amplitude != 0
    step = cr.unit_step(record, edge)
    assert np.isfinite(step.output).all()
    for difference in ("backward", "central"):
        impulse = cr.impulse_from_step(step, difference=difference)
        assert np.isfinite(impulse.markov).all()


@fuzz(200)
def test_any_record_has_a_step_or_is_refused(rng):
    time, u, y = any_signals(rng)
    before = u.copy(), y.copy()
    with good_end() as records:
        records.append(cr.Record(time, u, y))
    for record in records:
        with good_end():
            step_functions(record)
    np.testing.assert_array_equal(u, before[0])
    np.testing.assert_array_equal(y, before[1])
