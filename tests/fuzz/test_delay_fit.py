"""Records of every kind, through the output-error fit of the delay.

A step at order 1 takes 20 ms, a random input five times, the choice of the order ten times as long,
so these are drawn more seldom.
"""

import numpy as np

import ctrl_realize as cr
from tests.fuzz.draws import any_float, generator, sometimes
from tests.fuzz.lane import fuzz, good_end
from tests.fuzz.test_estimators import any_experiment, check


def check_fit(model: cr.DelayedStateSpace) -> None:
    check(model)
    low, high = model.fit.interval
    assert low <= model.fit.dead_time <= high
    assert low >= 0
    # where the residual follows the input, a model in sections is what identify gives
    if isinstance(model.fit, cr.identification.OutputErrorFit):
        assert model.fit.noise >= 0
        assert np.isfinite(model.fit.residual)


@fuzz(6)
def test_any_record_is_fitted_or_refused(rng):
    arrays = any_experiment(rng, random_one_in=12)
    order = rng.choice([None, *[1] * 50, 2, 2, 2, rng.randint(0, 6)])
    max_delay = rng.choice([None, rng.randint(-1, 400)])
    loss = rng.choice(["huber", "least_squares", "absolute"])
    with good_end(seconds=60) as models:
        record = cr.Record(*arrays)
        models.append(cr.identify(record, order=order, max_delay=max_delay, loss=loss))
    for model in models:
        check_fit(model)


@fuzz(4)
def test_records_of_gains_that_differ_are_fitted_together_or_refused(rng):
    noise, n = generator(rng), rng.randint(80, 160)
    records = []
    for _ in range(rng.randint(2, 4)):
        t, u, y = np.arange(n), (np.arange(n) >= 30) * rng.uniform(-4, 4), np.zeros(n)
        for k in range(6, n):
            y[k] = 0.8 * y[k - 1] + 0.2 * u[k - 6]
        y = y * rng.choice([1.0, 0.5, 0.25, -1.0, 1e-6]) + 0.01 * noise.standard_normal(n)
        records.append((0.1 * t, u, y))
    with good_end(seconds=60) as models:
        models.append(cr.identify([cr.Record(*arrays) for arrays in records], order=1))
    for model in models:
        check_fit(model)


@fuzz(10)
def test_any_handful_of_samples_is_fitted_or_refused(rng):
    n, noise = rng.randint(3, 40), generator(rng)
    onset = rng.randrange(n)
    u = np.where(np.arange(n) < onset, 0.0, rng.choice([1.0, -16.0, 1e-30, 1e30]))
    if sometimes(rng, 12):
        u = noise.standard_normal(n)
    y = 0.2 * np.cumsum(np.concatenate([np.zeros(3), u])[:n]) * rng.choice([1.0, 0.0, 1e-9])
    y = y + rng.choice([0.0, 1e-9, 0.1]) * noise.standard_normal(n)
    for _ in range(rng.randint(0, 2)):
        rng.choice([u, y])[rng.randrange(n)] = any_float(rng)
    if sometimes(rng, 3):
        with np.errstate(invalid="ignore"):  # a signalling NaN
            y = y - 0.1 * np.arange(n)
    with good_end(seconds=30) as models:
        record = cr.Record(np.arange(n) * rng.choice([1.0, 1e-6]), u, y)
        models.append(cr.identify(record, order=rng.choice([None, *[1] * 50, 2, 2, 2])))
    for model in models:
        check_fit(model)
