"""Samples of every kind, streamed into the delay tracker."""

import control as ct
import numpy as np

import ctrl_realize as cr
from ctrl_realize.errors import CtrlRealizeError
from tests.fuzz.draws import any_float, generator, sometimes
from tests.fuzz.lane import ends, fuzz, good_end

DT = 0.1
CORES = [
    ct.ss([[0.8]], [[1.0]], [[0.2]], [[0.0]], DT),
    ct.ss([[0.8, 0.1], [0.0, 0.5]], [[0.0], [1.0]], [[1.0, 0.0]], [[0.0]], DT),
    ct.ss([[0.9, 0.2], [-0.2, 0.9]], [[0.0], [1.0]], [[0.3, 0.0]], [[0.1]], DT),
    ct.ss([], [], [], [[2.0]], DT),
    ct.ss([[1.0]], [[1.0]], [[0.1]], [[0.0]], DT),
]


def any_stream(rng, n):
    """Input and output: moving, constant, unrelated, jumping, of any size."""
    noise = generator(rng)
    kind = rng.choice(["steps", "steps", "white", "constant", "zero", "late"])
    if kind == "steps":
        u = np.repeat(noise.choice([-1.0, 1.0], n // 20 + 1), 20)[:n]
    elif kind == "white":
        u = noise.standard_normal(n)
    else:
        u = np.full(n, rng.choice([1.0, -3.0]) if kind == "constant" else 0.0)
        if kind == "late":
            u[-rng.randint(1, n) :] = 1.0
    y = cr.DelayedStateSpace(rng.choice(CORES), rng.randint(0, 9)).simulate(u)
    if sometimes(rng, 4):
        y = noise.standard_normal(n) if rng.randrange(2) else np.full(n, 5.0)
    y = y + rng.choice([0.0, 0.0, 1e-9, 0.01, 1.0]) * noise.standard_normal(n)
    scale = rng.choice([1.0, 1.0, 1e-12, 1e12, -1e-60, 1e60])
    u = u * rng.choice([1.0, scale]) + rng.choice([0.0, 4.0, 1e6])
    return u, y * scale + rng.choice([0.0, 0.3, 1e6])


@fuzz(20)
def test_any_stream_is_followed_or_refused_sample_by_sample(rng):
    u, y = any_stream(rng, rng.randint(2, rng.choice([30, 30, 30, 80, 80, 220])))
    bad = {rng.randrange(u.size): any_float(rng) for _ in range(rng.choice([0, 0, 1, 3]))}
    options = {
        "max_delay": rng.choice([5, 10, 12]),
        "forgetting_time": rng.choice([3.0, 10.0, 1e6]),
        "min_delay": rng.choice([0, 0, 2]),
        "dynamics": rng.random() < 0.7,
    }
    tracker = cr.DelayTracker(rng.choice(CORES), **options)
    taken = []
    with good_end():
        for k, (before, after) in enumerate(zip(u, y, strict=True)):
            pair = (bad[k], after) if k in bad and k % 2 else (before, bad.get(k, after))
            try:
                tracker.update(*pair)
            except CtrlRealizeError:
                assert not all(abs(value) <= 1e70 for value in pair)
            else:
                assert np.isfinite(pair).all()
                taken.append(float(pair[0]))
    for _ in range(2):
        told = tracker.estimate()
    assert not taken or told.time == (len(taken) - 1) * DT
    assert options["min_delay"] <= told.delay <= options["max_delay"]
    assert told.report()
    assert repr(tracker)
    if told.resolved:
        ends["tells"] += 1
        low, high = told.delay_interval
        assert low <= told.delay <= high
        assert np.isfinite([told.dead_time, told.gain_ratio, told.gain_std]).all()
        # a constant input says nothing of the delay
        assert np.ptp(taken) > 0
    with good_end() as models:
        models.append(tracker.model)
    for model in models:
        assert np.isfinite(model.delay_free.A).all()


@fuzz(10)
def test_any_start_of_a_tracker_is_taken_or_refused(rng):
    with good_end():
        cr.DelayTracker(
            rng.choice([*CORES, -CORES[0], ct.tf(1, [1, 1]), ct.ss(2.0, 1, 1, 0, DT), None]),
            max_delay=rng.choice([5, 0, -1, 2.5, None]),
            forgetting_time=rng.choice([3.0, any_float(rng), None]),
            min_delay=rng.choice([0, 0, 7, -1]),
            dynamics=rng.choice([True, False]),
        )
