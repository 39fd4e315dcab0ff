"""One delay and one dynamics from several records of any input."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.testing import assert_allclose

import ctrl_realize as cr
from ctrl_realize.errors import DataError, OptionError
from tests.rigs import lag, pair

DT = 0.01
DELAY = 12.4  # samples
SKIP = 100  # samples of operation before a record begins
START = 20  # samples of a record that the bound does not count: about those that a fit leaves out


def signal(kind, seed, n):
    rng = np.random.default_rng(seed)
    if kind == "prbs":
        return np.repeat(rng.choice([-1.0, 1.0], n // 10 + 1), 10)[:n]
    if kind == "noise":
        return rng.standard_normal(n)
    return np.sin(2 * np.pi * np.cumsum(np.geomspace(0.2, 8, n)) * DT)


def respond(u, values):
    """Plant of delay [samples], gain, pole [Hz], and a pair [Hz, damping] if there is one."""
    delay, gain, hz, *more = values
    plant = gain * lag(hz) * (pair(*more) if more else 1)
    return cr.delayed_ss(plant, dead_time=delay * DT, dt=DT).simulate(u)


def operation(kind, seed, n, values, *, sigma=0.02, size=1.0, level=0.0, drift=0.0, name=""):
    """A piece cut out of operation, noise `sigma`; returns the record and the whole input."""
    u = size * signal(kind, seed, n + SKIP)
    y = respond(u, values) + sigma * np.random.default_rng(seed + 999).standard_normal(n + SKIP)
    time = DT * np.arange(n)
    y = level + drift * time + y[SKIP:]
    return cr.Record(time, 4 + u[SKIP:], y, name=name or f"{kind} {seed}"), u


def bound(inputs, sigmas, values):
    """Cramer-Rao bound of the delay in samples; level, drift and state of each record are free."""
    information = np.zeros((len(values), len(values)))
    for u, sigma in zip(inputs, sigmas, strict=True):
        slopes = []
        for i, value in enumerate(values):
            step = 1e-4 * value
            ends = [respond(u, [*values[:i], value + h, *values[i + 1 :]]) for h in (step, -step)]
            slopes.append((ends[0] - ends[1])[SKIP + START :] / (2 * step))
        slopes = np.array(slopes).T
        k = np.arange(len(slopes))
        plant = lag(values[2]) * (pair(*values[3:]) if values[3:] else 1)
        poles = plant.poles()[plant.poles().imag >= 0]
        free = np.exp(np.outer(k * DT, poles))
        own = np.column_stack([np.ones(k.size), k / k.size, free.real, free.imag])
        own = np.linalg.svd(own, full_matrices=False)
        base = own.U[:, own.S / own.S[0] > 1e-9]
        left = slopes - base @ (base.T @ slopes)
        information += left.T @ left / sigma**2
    return np.sqrt(np.linalg.inv(information)[0, 0])


KINDS = [("prbs", 300, 1.0, 0.02), ("chirp", 400, 0.5, 0.02), ("noise", 250, 2.0, 0.1)]


@pytest.mark.parametrize(
    "values", [(DELAY, 1.0, 2.0), (DELAY, 2.5, 2.0, 5.0, 0.5)], ids=["R1", "R3"]
)
def test_error_and_standard_error_are_those_of_the_bound(values):
    structures = [(1, 1)] if len(values) == 3 else [(3, 3)]
    errors, claims, limits = [], [], []
    for seed in range(4):
        made = [
            operation(
                kind, 10 * seed + i, n, values, sigma=sigma, size=size, level=i, drift=-0.3 * i
            )
            for i, (kind, n, size, sigma) in enumerate(KINDS)
        ]
        fit = cr.fit_output_error([record for record, _ in made], structures=structures).fit
        limits.append(bound([u for _, u in made], [sigma for *_, sigma in KINDS], values))
        errors.append(fit.delay - DELAY)
        claims.append(fit.std_given_structure / DT)
        assert fit.at_noise_level
        assert fit.repeatability.p_value > 1e-3
    # noise levels are known from 250 samples each, and Huber's loss costs 2 %
    assert_allclose(np.array(claims) / limits, 1.0, rtol=0, atol=0.25)
    assert_allclose(np.mean(np.array(claims) / limits), 1.0, rtol=0, atol=0.12)
    # chi-square of four: 18.5 is exceeded once in 1000
    assert np.sum((np.array(errors) / limits) ** 2) < 18.5


def test_several_records_find_the_structure_that_made_them():
    values = (DELAY, 2.5, 2.0, 5.0, 0.5)
    records = [operation("prbs", seed, 400, values)[0] for seed in range(3)]
    sys = cr.identify(records)
    assert sys.fit.structure == (3, 3)
    assert sys.fit.interval[0] <= DELAY * DT <= sys.fit.interval[1]
    assert sys.fit.gain == pytest.approx(2.5, abs=0.02)
    assert sys.fit.fitted.size == sys.fit.measured.size < 1200
    assert np.all(np.diff(sys.fit.time) > 0)
    assert "records" in sys.fit.report()


def test_steps_and_random_inputs_go_together():
    values = (DELAY, 1.0, 2.0)
    random, _ = operation("prbs", 1, 400, values)
    k = np.arange(400)
    u = np.where(k < 100, 0.0, 2.0)
    y = respond(u, values) + 0.02 * np.random.default_rng(5).standard_normal(400)
    fit = cr.fit_output_error(
        [random, cr.Record(DT * k, u, y, name="step")], structures=[(1, 1)]
    ).fit
    assert abs(fit.delay - DELAY) < 4 * fit.std_given_structure / DT
    assert fit.repeatability.p_value > 0.01
    assert fit.repeatability.amplitudes.tolist() == [2.0, 2.0]


def test_records_that_do_not_go_together_are_refused():
    one, _ = operation("prbs", 1, 300, (DELAY, 1.0, 2.0))
    slow = cr.Record(2 * one.time, one.input, one.output)
    with pytest.raises(DataError, match="one sample time"):
        cr.fit_output_error([one, slow])
    with pytest.raises(OptionError, match="takes one record"):
        cr.identify([one, one], method="scan")
