"""Responses of state-space models and of sums of sections, and their fit."""

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy.linalg import block_diag
from scipy.optimize import least_squares

from ctrl_realize.numerics.state_space import responses
from ctrl_realize.numerics.state_space.responses import simulate
from ctrl_realize.numerics.state_space.section_fit import Experiment, fit_sections
from ctrl_realize.numerics.state_space.sections import in_sections, motion


def system(seed: int, n: int = 4, m: int = 2, p: int = 3, radius: float = 0.95):
    rng = np.random.default_rng(seed)
    A = rng.standard_normal((n, n))
    A *= radius / np.abs(np.linalg.eigvals(A)).max()
    return (
        A,
        rng.standard_normal((n, m)),
        rng.standard_normal((p, n)),
        rng.standard_normal((p, m)),
    )


@pytest.mark.parametrize("count", [1, 2, 3, 64, 65, 66, 129, 500])
def test_markov_parameters_are_powers_of_a(count):
    A, B, C, D = system(0)
    expected = [D] + [C @ np.linalg.matrix_power(A, k) @ B for k in range(count - 1)]
    assert_allclose(
        responses.markov(A, B, C, D, count), np.stack(expected, axis=-1), rtol=0, atol=1e-12
    )


PLANT = (
    np.array([[0.7, 0.3, 0.0], [-0.3, 0.7, 0.2], [0.0, 0.0, 0.4]]),
    np.array([[1.0, 0.3], [0.2, 1.0], [0.5, -0.4]]),
    np.array([[1.0, 0.0, 0.5], [0.3, 1.0, -0.2]]),
    np.zeros((2, 2)),
)
NOISE = np.array([0.05, 0.5])


def experiment(seed, samples=500, noise=NOISE, level=0.0):
    rng = np.random.default_rng(seed)
    v = rng.standard_normal((2, samples))
    y = simulate(*PLANT, v, rng.standard_normal(3)) + level
    return Experiment(v, y + noise[:, None] * rng.standard_normal(y.shape))


def near():
    return in_sections(PLANT[0] * 0.9, PLANT[1], PLANT[2], PLANT[3])


def resonance(pole, samples=200, size=30.0):
    """Two states that begin far from rest, in white noise."""
    rng = np.random.default_rng(4)
    A, C = np.array([[0.0, 1.0], [-(abs(pole) ** 2), 2 * pole.real]]), np.array([[0.5, 1.0]])
    B, D = np.array([[0.0], [1.0]]), np.zeros((1, 1))
    v = rng.standard_normal((1, samples))
    y = simulate(A, B, C, D, v, np.array([size, 0.0])) + rng.standard_normal((1, samples))
    return Experiment(v, y), (A, B, C, D)


def test_the_end_of_a_fit_that_begins_far_from_rest_is_a_minimum():
    # what the initial state moves by is a part of the slopes; SciPy minimises the same sum
    data, (A, B, C, D) = resonance(0.97 * np.exp(0.3j))
    start = in_sections(0.98 * A, B, C, D)
    found = fit_sections([data], start, feedthrough=False, enough=1e-10, most=100)

    def left(x):
        plant = np.array([[0.0, 1.0], [-x[0], -x[1]]]), B, x[None, 2:4], D
        return (data.y - simulate(*plant, data.v, x[4:6]) - x[6]).ravel()

    x = least_squares(left, [0.94, -1.85, 0.5, 1.0, 30.0, 0.0, 0.0], xtol=1e-14, ftol=1e-14).x
    assert_allclose(found.variance, np.mean(left(x) ** 2), rtol=1e-8)
    poles = np.roots([1.0, x[1], x[0]])
    assert_allclose(np.sort_complex(found.model.poles), np.sort_complex(poles), atol=1e-5)


def test_a_pole_at_the_edge_of_stability_does_not_keep_the_others_from_their_minimum():
    # the resonance grows by 1 % in 10 samples: the best stable one does not die away
    data, (A, B, C, D) = resonance(1.001 * np.exp(0.3j), size=3.0)
    y = data.y + 4 * simulate(np.array([[0.6]]), B[1:], np.ones((1, 1)), D, data.v, np.zeros(1))
    found = []
    for pole in (0.3, 0.7):
        plant = block_diag(A * [[1.0, 1.0], [0.99, 0.995]], pole)
        start = in_sections(plant, np.vstack([B, 1.0]), np.column_stack([C, 1.0]), D)
        found.append(
            fit_sections([Experiment(data.v, y)], start, feedthrough=False, enough=1e-9, most=60)
        )
        assert found[-1].steps < 60
        assert np.sort(np.abs(found[-1].model.poles))[1:] == pytest.approx(1.0, abs=1e-6)
    assert found[0].loss == pytest.approx(found[1].loss, abs=1e-6)


def test_errors_are_those_that_the_cramer_rao_bound_allows():
    # 24 records: the mean of chi-square over degrees of freedom is 1 within 3 x 0.08
    truth = in_sections(*PLANT)
    ratios = []
    for seed in range(24):
        data = experiment(seed, 300)
        found = fit_sections([data], near(), feedthrough=False)
        own = motion(truth, data.v)
        wrong = motion(found.model, data.v).output(found.model, data.v) - own.output(truth, data.v)
        linear = own.starts(truth)
        levels = np.broadcast_to(np.eye(2)[:, :, None], (2, 2, 300))
        base = np.concatenate([linear, levels], axis=1) / NOISE[:, None, None]
        base = base.transpose(0, 2, 1).reshape(600, -1)
        error = (wrong / NOISE[:, None]).ravel()
        error -= base @ np.linalg.lstsq(base, error, rcond=None)[0]
        ratios.append(error @ error / (3 * 4))  # n (p + m) parameters of the response
    assert np.mean(ratios) == pytest.approx(1.0, abs=0.24)
