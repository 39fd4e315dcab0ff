"""Frequency responses of every kind, through what is made of them."""

import control as ct
import numpy as np

import ctrl_realize as cr
from tests.fuzz.draws import any_array, any_float, chosen, generator, of, sometimes
from tests.fuzz.lane import fuzz, good_end


def any_points(rng):
    """Frequencies and response of a plant, some of them out of order."""
    k = rng.randint(1, 40)
    noise = generator(rng)
    f = np.geomspace(0.01, 1.0, k) if rng.randrange(2) else np.arange(k) / 10
    f = f * rng.choice([1.0, 1.0, 1e-9, 1e9, 1e-60])
    w = 2 * np.pi * f
    lag, dead = 1 / (w[-1] or 1.0), rng.choice([0.0, 1.0, 5.0]) / (w[-1] or 1.0)
    g = np.exp(-1j * w * dead) / (1 + 3j * w * lag)
    g = g + rng.choice([0.0, 1e-6, 0.01, 1.0]) * (noise.standard_normal((2, k)).T @ [1, 1j])
    g = g * rng.choice([1.0, 1.0, -3.0, 1e-40, 1e40, 0.0])
    for _ in range(rng.choice([0, 0, 1, 2])):
        which = rng.choice([f, g])
        which[rng.randrange(k)] = any_float(rng)
    return g, f


def any_side(rng, like):
    """Coherence or deviation beside a response, mostly right."""
    if rng.randrange(2):
        return None
    beside = generator(rng).random(like.shape) * rng.choice([1.0, 1.0, 1e-3, 0.0, 5.0])
    if sometimes(rng, 5):
        beside[rng.randrange(beside.size)] = any_float(rng)
    return beside


def check_frf(frf: cr.MeasuredFRF) -> None:
    assert repr(frf)
    assert np.isfinite(frf.frdata).all()
    assert (frf.frequency_hz >= 0).all()
    assert (np.diff(frf.frequency_hz) >= 0).all()
    for beside in (frf.std, frf.coherence):
        assert beside is None or beside.shape[-1] == frf.frequency_hz.size


@fuzz(150)
def test_any_arrays_make_a_measured_response_or_are_refused(rng):
    if rng.randrange(2):
        g, f = any_points(rng)
        std, coherence = any_side(rng, g), any_side(rng, g)
    else:
        g, f, std, coherence = (any_array(rng) for _ in range(4))
    with good_end() as responses:
        responses.append(cr.MeasuredFRF(g, f, std=std, coherence=coherence))
    for frf in responses:
        check_frf(frf)
        np.testing.assert_array_equal(np.sort(np.ravel(f)), frf.frequency_hz)
        low, high = sorted((any_float(rng), any_float(rng)))
        with good_end() as parts:
            parts.append(frf.between_hz(low, high))
        with good_end():
            parts.append(frf.trusted(rng.choice([0.5, 0.95, any_float(rng)])))
        for part in parts:
            check_frf(part)


@fuzz(6)
def test_any_measured_response_is_fitted_or_refused(rng):
    g, f = any_points(rng)
    std = any_side(rng, g)
    top = max(float(f[-1]), 1e-300)
    # an order of 2 takes six times as long as one of 1, the search among all orders forty times
    options = {
        "order": rng.choice([1] * 200 + [[1], 0, 2, 2, 2, 2, None, rng.randint(-1, 6)]),
        "relative_degree": rng.choice([None] * 6 + [0, 1, 1, [0, 1], rng.randint(-1, 3)]),
        "max_dead_time": rng.choice([None, None, None, 3 / top, any_float(rng)]),
        "weighting": rng.choice(["auto", "auto", "std", "relative", "uniform"]),
        "dt": rng.choice([None, None, 0.1, any_float(rng)]),
    }
    with good_end(seconds=60) as models:
        models.append(cr.fit_frf(cr.MeasuredFRF(g, f, std=std), **options))
    for model in models:
        fit = model.fit
        assert fit.report()
        assert fit.dead_time >= 0
        low, high = fit.interval
        assert low <= fit.dead_time <= high
        assert np.isfinite(model.delay_free.A).all()
        assert np.abs(model.delay_free.poles()).max(initial=0.0) < 1 + 1e-9


WAYS = {
    "kernel": of("TC", "TC", "SS", "other"),
    "weighting": of("std", "relative", "uniform", "auto"),
    "hold": of("zoh", "foh"),
    "band_hz": lambda rng: (any_float(rng), any_float(rng)),
}


@fuzz(40)
def test_any_measured_response_gives_a_pulse_response_or_is_refused(rng):
    g, f = any_points(rng)
    dt = rng.choice([0.1, 1.0, 1e-9, any_float(rng)])
    length, std = rng.randint(-1, rng.choice([12, 60])), any_side(rng, g)
    choice = chosen(rng, WAYS)
    with good_end() as pulses:
        pulses.append(cr.impulse_from_frf(cr.MeasuredFRF(g, f, std=std), dt, length, **choice))
    for pulse in pulses:
        assert np.isfinite(pulse.markov).all()


PLANT = cr.delayed_ss(ct.ss(0.9, 1, 0.1, 0, 0.1), 3)


@fuzz(40)
def test_any_measured_response_is_compared_or_refused(rng):
    g, f = any_points(rng)
    with good_end() as comparisons:
        frf = cr.MeasuredFRF(g, f, std=any_side(rng, g), coherence=any_side(rng, g))
        comparisons.append(cr.compare_frf(PLANT, frf))
    for comparison in comparisons:
        assert comparison.report()
