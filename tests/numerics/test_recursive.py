from __future__ import annotations

import numpy as np
import pytest
from numpy.testing import assert_allclose

import ctrl_realize as cr
from ctrl_realize.numerics.recursive import DelayBank, pole_directions, sensitivity_system
from ctrl_realize.numerics.state_space import markov, simulate
from tests.rigs import R3, lag, pair

DT = 1e-3


def matrices(plant):
    core = cr.delayed_ss(plant, delay=0, dt=DT).delay_free
    return core.A, core.B[:, 0], core.C[0], float(core.D[0, 0])


def test_sensitivities_are_the_slopes_of_the_pulse_response():
    A, B, C, D = matrices(R3)
    directions = pole_directions(np.linalg.eigvals(A), DT)
    names = [what for what, _, _ in directions]
    assert sorted(names) == ["damping", "speed", "speed"]
    big = sensitivity_system(A, B, C, D, directions)
    found = markov(big[0], big[1][:, None], big[2], big[3][:, None], 1500)[:, 0]

    def pulse(real=0.0, speed=0.0, damping=0.0):
        plant = lag(2.2 * (1 + real)) * pair(8 * (1 + speed), 0.7 + damping)
        return cr.delayed_ss(plant, delay=0, dt=DT).markov(1500)

    h = 1e-3
    slopes = [
        (pulse(**{what: h}) - pulse(**{what: -h})) / (2 * h)
        for what in ("real", "speed", "damping")
    ]
    # The zeros of sampling are kept while the poles move: an error of the order of w dt / 12.
    for slope in slopes:
        distance = [np.linalg.norm(row - slope) / np.linalg.norm(slope) for row in found[1:]]
        assert min(distance) < 1e-3
    assert_allclose(found[0], pulse(), rtol=0, atol=1e-15)


@pytest.mark.parametrize("low", [0, 3])
def test_the_bank_solves_the_weighted_least_squares_of_every_delay(low):
    rng = np.random.default_rng(0)
    A, B, C, D = matrices(R3)
    big = sensitivity_system(A, B, C, D, pole_directions(np.linalg.eigvals(A), DT))
    u, y = rng.normal(size=120), 5 + rng.normal(size=120)
    bank = DelayBank(*big, low, 9, 0.98)
    for pair_ in zip(u, y, strict=True):
        bank.update(*pair_)
    q = big[2].shape[0]
    prior, precision = rng.normal(size=q), np.array([1e-4, 2e-4, 3e-4, 4e-4])
    found = bank.solve(prior, precision)
    phi = simulate(big[0], big[1][:, None], big[2], big[3][:, None], u[None])
    weight = 0.98 ** np.arange(119, -1, -1)
    for i, d in enumerate(range(low, 10)):
        late = np.concatenate([np.zeros((q, d)), phi[:, : 120 - d]], axis=1)
        rows = np.vstack([late, np.ones(120)]).T * np.sqrt(weight)[:, None]
        pull = np.hstack([np.diag(np.sqrt(precision)), np.zeros((q, 1))])
        target = np.concatenate([y * np.sqrt(weight), np.sqrt(precision) * prior])
        answer, misfit, *_ = np.linalg.lstsq(np.vstack([rows, pull]), target, rcond=None)
        # regressors of 1e-3 give the normal matrix a condition number of 1e6
        assert_allclose(found.theta[i], answer[:-1], rtol=1e-6, atol=1e-6)
        assert_allclose(found.offset[i], answer[-1], rtol=0, atol=1e-8)
        assert_allclose(found.misfit[i], misfit[0], rtol=1e-8)
        assert_allclose(
            bank.predict(d, found.theta[i]), answer[:-1] @ late[:, -1], rtol=1e-5, atol=1e-9
        )


def test_poles_that_cannot_change_speed_have_no_direction():
    poles = np.array([1.0, 0.0, -0.4, 0.5, 0.3 + 0.2j, 0.3 - 0.2j])
    assert [(what, p) for what, p, _ in pole_directions(poles, DT)] == [
        ("speed", 0.5),
        ("speed", 0.3 + 0.2j),
        ("damping", 0.3 + 0.2j),
    ]
