"""Impulse responses and records of every size, shape and scale, through the estimators."""

import numpy as np

import ctrl_realize as cr
from tests.fuzz.draws import any_float, chosen, generator, of, sometimes
from tests.fuzz.lane import fuzz, good_end

POLES = [0.0, 0.5, 0.9, -0.8, 0.999, 1.0, 1.01]


def any_response(rng):
    """A unit-pulse response: exact, noisy, flat, growing, with single samples out of order."""
    n = rng.randint(1, rng.choice([24, 24, 60, 160]))
    k = np.arange(n)
    g = np.zeros(n)
    for _ in range(rng.randint(0, 3)):
        g = g + rng.choice([1.0, -0.5, 3.0]) * rng.choice(POLES) ** k
    g = np.concatenate([np.zeros(rng.randint(0, 30)), g])[:n]
    g = g + rng.choice([0.0, 0.0, 1e-12, 1e-3, 1.0]) * generator(rng).standard_normal(n)
    g = g * rng.choice([1.0, 1.0, 1e-90, 1e90, 1e-300, 1e150, 0.0])
    if sometimes(rng, 3):
        g[rng.randrange(n)] = any_float(rng)
    with np.errstate(invalid="ignore"):  # half a signalling NaN
        return np.stack([[g, 0.5 * g], [-g, g[::-1]]]) if sometimes(rng, 5) else g


CHOICES = {
    "samples": lambda rng: rng.choice([None, rng.randint(-1, 200)]),
    "feedthrough": of(None, True, False),
    "hankel": of("square", "padded", "round"),
}
STEPS = [1.0, 7.8125e-4, 1e-9, 1e9]


def check(model: cr.DelayedStateSpace) -> None:
    core = model.delay_free
    for matrix in (core.A, core.B, core.C, core.D):
        assert np.isfinite(matrix).all()
    assert repr(model)
    assert model.fit.report()


@fuzz(100)
def test_any_response_is_realized_or_refused(rng):
    g, order, choice = any_response(rng), rng.randint(-1, 9), chosen(rng, CHOICES)
    delay, dt = rng.randint(-1, 40), rng.choice(STEPS)
    before = g.copy()
    with good_end() as models:
        models.append(cr.realize(g, order, delay=delay, dt=dt, **choice))
    for model in models:
        check(model)
        assert model.delay_free.nstates == order
        assert model.delay == delay
        if choice.get("hankel") == "padded":
            # stable by construction, up to rounding
            assert np.abs(model.delay_free.poles()).max() < 1 + 1e-9
    np.testing.assert_array_equal(g, before)


@fuzz(60)
def test_any_response_is_scanned_for_its_delay_or_refused(rng):
    g, order, choice = any_response(rng), rng.randint(-1, 9), chosen(rng, CHOICES)
    max_delay, dt = rng.randint(-1, 3 + g.shape[-1] // 2), rng.choice(STEPS)
    with good_end() as models:
        models.append(cr.estimate_delay(g, order, max_delay=max_delay, dt=dt, **choice))
    for model in models:
        check(model)
        scan = model.fit
        assert scan.iae.shape == (max_delay + 1,)
        assert scan.delay == model.delay
        # the smallest, or the first of those that rounding cannot tell from it
        assert scan.iae[scan.delay] <= scan.iae.min() + 1e-10 * np.abs(g).sum()
        low, high = scan.delay_interval
        assert low <= scan.delay <= high


@fuzz(40)
def test_any_response_is_scanned_over_orders_or_refused(rng):
    g, choice = any_response(rng), chosen(rng, CHOICES)
    orders, max_delay = rng.randint(0, 6), rng.randint(0, 3 + g.shape[-1] // 3)
    with good_end() as scans:
        scans.append(cr.scan_orders(g, orders, max_delay=max_delay, dt=1.0, **choice))
    for scan in scans:
        assert repr(scan)
        assert scan.report()


def any_plant(rng, u):
    """Answer to an input that comes after the delay: of a lag, or of what no model here can be."""
    kind = rng.choice(["lag"] * 6 + ["chain", "gain", "slope", "stiction", "limit", "wrong way"])
    n, pole, gain, chain = u.size, 0.8, np.ones(u.size), 1
    if kind == "chain":
        chain = rng.randint(6, 20)  # more lags than are tried
    elif kind == "gain":
        gain = 1 + rng.uniform(-1, 1) * np.arange(n) / n  # wanders during the record
    elif kind == "slope":
        pole = rng.choice([1.0, 1.02])  # integrates, or runs off
    elif kind == "stiction":
        u = np.round(2 * u) / 2 * (np.abs(np.diff(u, prepend=0.0)) > 0.2)
    y = gain * u
    for _ in range(chain):
        moved = np.zeros(n)
        for k in range(1, n):
            moved[k] = pole * moved[k - 1] + (0.2 if pole < 1 else 0.01) * y[k]
        y = moved
    if kind == "limit":
        y = np.clip(y, -0.3, 0.5)
    if kind == "wrong way":
        y = y - 0.5 * np.diff(y, prepend=0.0) * 8
    return y


def any_experiment(rng, random_one_in=3):
    """A step record or a random one, short and noisy, of any scale, with bad samples."""
    n = rng.randint(3, rng.choice([40, 120, 260])) if rng.randrange(2) else rng.randint(100, 200)
    noise = generator(rng)
    dt = rng.choice([1.0, 0.01, 1e-6, 1e5])
    onset = rng.randrange(n if rng.randrange(2) else n // 3)
    u = (np.arange(n) >= onset).astype(float)
    if sometimes(rng, random_one_in):
        u = noise.choice([-1.0, 1.0], n)
    delay = rng.randint(0, 20)
    y = any_plant(rng, np.concatenate([np.zeros(delay + 1), u])[:n])
    y = y + rng.choice([0.0, 1e-6, 0.01, 1.0]) * noise.standard_normal(n)
    scale = rng.choice([1.0, -3.0, 1e-12, 1e12, 1e-60, 1e60, 0.0])
    y = y * scale + rng.choice([0.0, 5.0, 1e6])
    if sometimes(rng, 4):
        y[rng.randrange(n)] = rng.uniform(-1e69, 1e69)
    if rng.randrange(2):
        y = np.round(y, 2)
    return dt * np.arange(n), u, y


@fuzz(60)
def test_any_record_is_identified_by_the_scan_or_refused(rng):
    arrays, method = any_experiment(rng), rng.choice(["scan", "paper"])
    order = rng.choice([None, rng.randint(0, 5)])
    max_delay = rng.choice([None, rng.randint(0, arrays[0].size // 3)])
    with good_end() as models:
        record = cr.Record(*arrays)
        models.append(cr.identify(record, method=method, order=order, max_delay=max_delay))
    for model in models:
        check(model)


WAYS = {
    "method": of("auto", "regularized", "least_squares", "okid"),
    "kernel": of("TC", "other"),
    "start": of("rest", "unknown", 3),
}


@fuzz(40)
def test_any_record_gives_an_impulse_response_or_is_refused(rng):
    arrays = any_experiment(rng)
    length = rng.choice([None, rng.randint(-1, rng.choice([12, 60]))])
    choice = chosen(rng, WAYS)
    # most with one method and one kernel: the choices among them take most of a case's time
    choice.setdefault("method", rng.choice(["auto", "regularized", "okid"]))
    choice.setdefault("kernel", rng.choice(["auto", "TC", "SS"]))
    with good_end() as results:
        results.append(cr.impulse_from_io(cr.Record(*arrays), length, **choice))
    for impulse in results:
        assert np.isfinite(impulse.markov).all()


@fuzz(40)
def test_any_record_gives_a_frequency_response_or_is_refused(rng):
    arrays = any_experiment(rng)
    with good_end() as results:
        results.append(cr.spectral_frf(cr.Record(*arrays)))
    for frf in results:
        assert np.isfinite(frf.frdata).all()


# a step at order 1 takes 20 ms, a random input five times, the choice of the order ten times as
# long, so these are drawn more seldom


def check_fit(model: cr.DelayedStateSpace) -> None:
    check(model)
    low, high = model.fit.interval
    assert low <= model.fit.dead_time <= high
    assert low >= 0
    # where the residual follows the input, a model in sections is what identify gives
    if isinstance(model.fit, cr.identification.OutputErrorFit):
        assert model.fit.noise >= 0
        assert np.isfinite(model.fit.residual)


@fuzz(4)
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


@fuzz(6)
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
