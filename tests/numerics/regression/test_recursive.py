import numpy as np
import pytest
from numpy.testing import assert_allclose

import ctrl_realize as cr
from ctrl_realize.numerics.regression.recursive import DelayBank
from ctrl_realize.numerics.state_space.pole_sensitivity import (
    moved_core,
    pole_directions,
    sensitivity_system,
)
from ctrl_realize.numerics.state_space.responses import markov, simulate
from tests.rigs import R3, lag, pair

DT = 1e-3


def matrices(plant):
    core = cr.delayed_ss(plant, delay=0, dt=DT).delay_free
    return core.A, core.B[:, 0], core.C[0], float(core.D[0, 0])


@pytest.mark.parametrize("restart", [0, 30])
@pytest.mark.parametrize("low", [0, 3])
def test_the_bank_solves_the_weighted_least_squares_of_every_delay(low, restart):
    rng = np.random.default_rng(0)
    A, B, C, D = matrices(R3)
    big = sensitivity_system(A, B, C, D, pole_directions(np.linalg.eigvals(A), DT))
    u, y = rng.normal(size=120), 5 + rng.normal(size=120)
    bank = DelayBank(big, low, 9, 0.98)
    for k, sample in enumerate(zip(u, y, strict=True)):
        if restart and k == restart:
            bank.restart()
        bank.update(*sample)
    q = big[2].shape[0]
    prior, precision = rng.normal(size=q), np.array([1e-4, 2e-4, 3e-4, 4e-4])
    found = bank.solve(prior, precision)
    phi = simulate(big[0], big[1][:, None], big[2], big[3][:, None], u[None])
    weight = np.where(np.arange(120) < restart, 0.0, 0.98 ** np.arange(119, -1, -1))
    for i, d in enumerate(range(low, 10)):
        late = np.concatenate([np.zeros((q, d)), phi[:, : 120 - d]], axis=1)
        rows = np.vstack([late, np.ones(120)]).T * np.sqrt(weight)[:, None]
        pull = np.hstack([np.diag(np.sqrt(precision)), np.zeros((q, 1))])
        target = np.concatenate([y * np.sqrt(weight), np.sqrt(precision) * prior])
        answer, misfit, *_ = np.linalg.lstsq(np.vstack([rows, pull]), target, rcond=None)
        # regressors of 1e-3 give the normal matrix a condition number of 1e6
        assert_allclose(found.theta[i], answer[:-1], rtol=1e-6, atol=1e-6)
        assert_allclose(found.offset[i], answer[-1], rtol=0, atol=1e-8)
        assert_allclose(found.weighted_sse[i], misfit[0], rtol=1e-8)
        assert_allclose(
            bank.predict(d, found.theta[i]), answer[:-1] @ late[:, -1], rtol=1e-5, atol=1e-9
        )


def test_a_moved_core_has_the_moved_poles_and_the_same_gain():
    A, B, C, D = matrices(R3)
    zeros = cr.delayed_ss(R3, delay=0, dt=DT).zeros()
    directions = pole_directions(np.linalg.eigvals(A), DT)
    moves = np.array(
        [{"damping": -0.1}.get(what, 0.2 if p.imag else 0.1) for what, p, _ in directions]
    )
    core, fresh = moved_core((A, B, C, D), zeros, directions, moves, DT)
    expected = lag(2.2 * np.exp(0.1)) * pair(8 * np.exp(0.2), 0.6)
    wanted = cr.delayed_ss(expected, delay=0, dt=DT).delay_free
    assert_allclose(
        np.sort_complex(np.linalg.eigvals(core[0])), np.sort_complex(wanted.poles()), rtol=1e-9
    )
    found = markov(core[0], core[1][:, None], core[2][None], np.array([[core[3]]]), 1500)[0, 0]
    assert_allclose(found.sum(), 1.0, rtol=1e-8)
    # The zeros of sampling stay while they should move a little.
    pulse = cr.DelayedStateSpace(wanted).markov(1500)
    assert np.abs(found - pulse).max() < 2e-3 * np.abs(pulse).max()
    assert [what for what, _, _ in fresh] == [what for what, _, _ in directions]
    for (_, before, _), (_, after, _) in zip(directions, fresh, strict=True):
        assert abs(after - before) < 0.1


@pytest.mark.parametrize("angle", [0.1, 0.3, 0.5, np.pi / 4, 1.0, np.pi / 2, 2.0])
@pytest.mark.parametrize("move", [-0.2, -1.0])
def test_a_pair_that_has_lost_its_damping_is_no_moved_model_however_it_is_rounded(angle, move):
    s = -0.1 * angle + 1j * angle
    p = np.exp(s)
    A = np.array([[p.real, -p.imag], [p.imag, p.real]])
    core = (A, np.array([1.0, 0.0]), np.array([0.0, 1.0]), 0.0)
    directions = [d for d in pole_directions(np.linalg.eigvals(A), 1.0) if d[0] == "damping"]
    zeros = np.zeros(0, complex)
    assert moved_core(core, zeros, directions, np.array([move]), 1.0) is None
    assert moved_core(core, zeros, directions, np.array([-0.05]), 1.0) is not None
