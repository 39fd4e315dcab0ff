"""The separable fit: responses, derivatives, optimum; batches of starts against closed forms."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose

from ctrl_realize.numerics.engine.descend import fit_batch
from ctrl_realize.numerics.engine.eliminate import compress, drawn_numerators, eliminate, evaluate
from ctrl_realize.numerics.engine.local_terms import Segments
from ctrl_realize.numerics.engine.modal import parameters_from_poles, respond
from ctrl_realize.numerics.engine.problem import KnownFactor, Problem, Structure
from ctrl_realize.numerics.engine.responses import SampledInput, SeveralInputs, StepSequence
from ctrl_realize.numerics.engine.structures import Scales, parameter_bounds, search
from ctrl_realize.numerics.joint.data import with_rows
from ctrl_realize.numerics.signals.sines import Sines
from tests import rigs
from tests.oracles.varpro import evaluate as oracle

ONES = np.ones(300, dtype=np.int64)
TRAIN = StepSequence(np.arange(300.0), ONES, 1.0, np.array([0.0, 50.0]), np.array([1.0, 0.5]))
STEP = StepSequence(np.arange(300.0), ONES, 1.0, np.array([3.0]), np.array([0.7]))
RANDOM = SampledInput(np.random.default_rng(0).normal(size=30).repeat(10), 1.0)
KNOWN = KnownFactor(np.array([-0.3 + 0j]), np.array([0.2, 0.3]))
PAIR = KnownFactor(np.array([-0.3, -0.2 + 0.4j, -0.2 - 0.4j]), np.array([0.1, 0.06]))
THETA = {
    1: [np.log(0.03)],
    2: np.log([0.05, 0.7]),
    3: np.log([0.03, 0.05, 0.7]),
    4: np.log([0.05, 0.7, 0.1, 1.2]),
    5: np.log([0.03, 0.05, 0.7, 0.1, 1.2]),
}


def two_records(data, weight):
    """Records with a level, a drift and a free response of their own."""
    rng = np.random.default_rng(0)
    parts = tuple(SampledInput(rng.normal(size=n // 10).repeat(10), 1.0) for n in (140, 200))
    clock = np.concatenate([np.arange(120.0), np.arange(180.0)])
    own = Segments(np.array([0, 120, 300]), clock, np.stack([np.ones(300), clock], axis=1))
    drive = SeveralInputs(parts, (slice(20, None),) * 2)
    return Problem(data, weight, drive, np.empty((300, 0)), KnownFactor(), own)


def behind_known(drive):
    return lambda data, weight: Problem(data, weight, drive, np.ones((300, 1)), KNOWN)


@pytest.mark.parametrize(
    "made", [behind_known(TRAIN), behind_known(RANDOM), two_records], ids=["steps", "random", "own"]
)
@pytest.mark.parametrize(("n", "r"), [(1, 1), (2, 2), (2, 1), (3, 3), (3, 1), (4, 2), (5, 5)])
def test_at_the_optimum_the_jacobian_is_minus_the_derivative_of_the_residual(n, r, made):
    # Kaufman's form leaves out a term that is proportional to the residual: it is exact where
    # the residual vanishes. Data: what the model itself makes of a random walk.
    x, structure = np.concatenate([[7.3], THETA[n]])[None], Structure(n, r)
    walk = np.random.default_rng(n).normal(size=300).cumsum()
    weight = np.linspace(0.5, 2.0, 300)
    data = walk - evaluate(made(walk, weight), structure, x).residual[0] / weight
    problem = made(data, weight)
    state = evaluate(problem, structure, x)
    assert np.abs(state.residual).max() < 1e-9 * np.abs(data).max()
    for q in range(n + 1):
        step = np.zeros_like(x)
        step[0, q] = 1e-5
        ahead = evaluate(problem, structure, x + step).residual
        behind = evaluate(problem, structure, x - step).residual
        derivative = (behind - ahead)[0] / 2e-5
        scale = np.abs(derivative).max()
        # central differences of step 1e-5: 1e-10 from curvature, 1e-7 from rounding
        assert_allclose(state.jacobian[0, :, q], derivative, rtol=0, atol=2e-6 * scale)
    assert problem.local_count(n) == (2 * (2 + n) if made is two_records else 0)


def drives() -> dict[str, StepSequence | SampledInput]:
    """Inputs of 300 samples: of one step also the means over bins, and in one of them it comes."""
    width = np.array([1] * 40 + [3, 5, 7, 4, 1, 2, 20, 60, 158])
    first = np.cumsum(width) - width
    move, size = np.array([3.0]), np.array([0.7])
    return {
        "step": StepSequence(np.arange(300.0), ONES, 1.0, move, size),
        "bins": StepSequence(first.astype(float), width, 1.0, move, size),
        "a bin of the onset": StepSequence(first.astype(float), width, 1.0, move + 20, size),
        "steps": TRAIN,
        "random": RANDOM,
    }


@pytest.mark.parametrize("coloured", [False, True])
@pytest.mark.parametrize("drive", drives().values(), ids=drives())
@pytest.mark.parametrize(("n", "r"), [(1, 1), (2, 2), (2, 1), (3, 3), (3, 1), (4, 4), (5, 2)])
def test_compression_changes_no_products_of_residual_and_jacobian(n, r, drive, coloured):
    x = np.tile(np.concatenate([[22.3], THETA[n]]), (3, 1))
    x += 0.1 * np.random.default_rng(n).normal(size=x.shape)
    if n > 1:
        x[1, -1] = np.log(1.7)  # two lags beside pairs of conjugates, in one batch
    rows = 300 if isinstance(drive, SampledInput) else drive.first.size
    rng = np.random.default_rng(r)
    walk, weight = rng.normal(size=rows).cumsum(), rng.uniform(0.5, 2.0, rows)
    clock = np.stack([np.ones(rows), np.linspace(0, 1, rows)], axis=1)
    whitener = np.eye(rows) - 0.8 * np.eye(rows, k=-1) if coloured else None
    problem = Problem(walk, weight, drive, clock, KnownFactor(), whitener=whitener)
    whole, short = (way(problem, Structure(n, r), x) for way in (evaluate, compress))
    assert short.residual.shape[1] < 20
    for mine, theirs in zip(*(products(one) for one in (short, whole)), strict=True):
        assert_allclose(mine, theirs, rtol=0, atol=1e-9 * np.abs(theirs).max())


def product(state, size, squared):
    """Product of Jacobian with itself or the residual, its columns in units of a size (B, p)."""
    columns = state.jacobian / size[:, None]
    other = columns if squared else state.residual[:, :, None]
    return np.einsum("bmp,bmq->bpq", columns, other)


def products(state):
    """Squares and products of residual and Jacobian, the latter in columns of one size."""
    size = np.sqrt(np.einsum("bmp,bmp->bp", state.jacobian, state.jacobian))
    columns = state.jacobian / size[:, None]
    downhill = np.einsum("bmp,bm->bp", columns, state.residual)
    return state.cost, size, downhill, np.einsum("bmp,bmq->bpq", columns, columns)


def several(data, weight):
    """Two records and points of a frequency response below one another, behind known dynamics."""
    record = replace(two_records(data, weight), known=KNOWN, regressors=np.ones((300, 1)))
    sines = Problem(
        data[:80], weight[:80], Sines(np.geomspace(0.01, 2.0, 40)), np.ones((80, 1)), KNOWN
    )
    return with_rows(record, sines)


def points(data, weight):
    return Problem(data, weight, Sines(np.geomspace(0.01, 2.0, 150)), np.ones((300, 1)), PAIR)


@pytest.mark.parametrize(
    "made",
    [behind_known(TRAIN), behind_known(RANDOM), behind_known(STEP), two_records, several, points],
    ids=["steps", "random", "step", "own", "several", "points"],
)
@pytest.mark.parametrize(("n", "r"), [(1, 0), (1, 1), (2, 1), (3, 0), (3, 3), (4, 2), (5, 2)])
def test_all_ways_of_elimination_agree_with_one_basis_of_all_terms(n, r, made):
    rng = np.random.default_rng(10 * n + r)
    x = np.tile(np.concatenate([[22.3], THETA[n]]), (3, 1))
    x += 0.1 * rng.normal(size=x.shape)
    if n > 1:
        x[1, -1] = np.log(1.7)  # two lags beside pairs of conjugates, in one batch
    given = made(rng.normal(size=300).cumsum(), rng.uniform(0.5, 2.0, 300))
    slow = oracle(given, Structure(n, r), x)
    rows, short, bare = (way(given, Structure(n, r), x) for way in (evaluate, compress, eliminate))
    # Without a jump of its own a dead time is no direction: its column is rounding.
    scale = slow.sensitivity[:, None]
    assert_allclose(rows.residual, slow.residual, rtol=0, atol=1e-10 * np.abs(slow.residual).max())
    assert_allclose(rows.jacobian / scale, slow.jacobian / scale, rtol=0, atol=1e-10)
    assert_allclose(rows.sensitivity, slow.sensitivity, rtol=1e-9)
    assert_allclose(rows.regression, slow.regression, rtol=1e-8, atol=1e-10)
    for squared in (True, False):
        mine, theirs = (product(one, slow.sensitivity, squared) for one in (short, slow))
        assert_allclose(mine, theirs, rtol=0, atol=1e-10 * np.abs(theirs).max())
    for other in (rows, short, bare):
        assert_allclose(other.cost, slow.cost, rtol=1e-10)
        assert_allclose(other.numerator, slow.numerator, rtol=1e-8)


def test_the_response_is_the_closed_form_at_any_fraction_of_a_sample():
    poles = rigs.R3.poles().astype(complex)
    time = rigs.TS * np.arange(-50, 900)
    drive = StepSequence(time, np.ones(950, dtype=np.int64), rigs.TS, np.zeros(1), np.ones(1))
    for dead_time in (0.0, 36.25, 37.0, 41.9):
        x = np.concatenate([[dead_time * rigs.TS], parameters_from_poles(poles)])
        ours = respond(drive, KnownFactor(), np.array([np.prod(-poles).real]), x)
        assert_allclose(ours, rigs.exact_step(rigs.R3, time - dead_time * rigs.TS), atol=1e-12)


def test_no_random_start_beats_the_few_that_are_tried():
    # The starts are ten; thirty random ones from the whole box must not find a lower cost.
    worse = 0
    for seed in range(6):
        rng = np.random.default_rng(seed)
        time = rigs.TS * np.arange(-20, 480)
        dead_time = rng.uniform(30, 45)
        data = rigs.exact_step(rigs.R3, time - dead_time * rigs.TS)
        data = data + 0.003 * rng.standard_normal(time.size)
        drive = StepSequence(time, np.ones(500, dtype=np.int64), rigs.TS, np.zeros(1), np.ones(1))
        problem = Problem(data, np.ones(500), drive, np.ones((500, 1)), KnownFactor())
        scales = Scales(52 * rigs.TS, 90 * rigs.TS, 480 * rigs.TS, rigs.TS, 75 * rigs.TS)
        found = search(problem, [Structure(3, 3)], scales)[Structure(3, 3)]
        box = parameter_bounds(Structure(3, 3), scales)
        starts = rng.uniform(box.low, box.high, size=(30, 4))
        _, cost = fit_batch(problem, Structure(3, 3), starts, box, most_iterations=60)
        worse += found.cost > cost.min() * (1 + 1e-4)
    assert worse == 0


ONE, TWO, ZERO, JUMP = Structure(1, 1), Structure(2, 2), Structure(2, 1), Structure(1, 0)
SIZE, DT = 90, 0.5
TIME = DT * np.arange(SIZE)
NOTHING = KnownFactor()
LAG = 2.5
TRUTH = np.array([3.3, -np.log(LAG)])


def train(unit=1.0, at=2.0):
    ones = np.ones(SIZE, dtype=np.int64)
    return StepSequence(unit * TIME, ones, unit * DT, np.array([unit * at]), np.ones(1))


def problem(data, **changed):
    given = {
        "root_weight": np.ones(SIZE),
        "drive": train(),
        "regressors": np.ones((SIZE, 1)),
        "known": NOTHING,
    } | changed
    return Problem(data, **given)


def lag(time, rate):
    return -np.expm1(-rate * np.clip(time, 0, None))


def noisy(gain=2.0, level=5.0, noise=0.02, seed=0):
    clean = level + gain * lag(TIME - 2.0 - TRUTH[0], 1 / LAG)
    return clean + noise * np.random.default_rng(seed).standard_normal(SIZE)


def test_the_residual_is_that_of_weighted_least_squares():
    data, weight = noisy(), np.linspace(0.5, 2.0, SIZE)
    trials = TRUTH + np.array([[0.0, 0.0], [0.7, 0.2], [-1.0, -0.5]])
    state = evaluate(problem(data, root_weight=weight), ONE, trials)
    for row, (dead_time, rate) in enumerate(trials):
        columns = np.stack([lag(TIME - 2.0 - dead_time, np.exp(rate)), np.ones(SIZE)], axis=1)
        best = np.linalg.lstsq(columns * weight[:, None], data * weight, rcond=None)[0]
        left = weight * (data - columns @ best)
        assert state.residual[row] == pytest.approx(left, abs=1e-12)
        assert state.cost[row] == pytest.approx(left @ left)
        # b over s + a has the static gain b / a
        assert state.numerator[row, 0] / np.exp(rate) == pytest.approx(best[0])
        assert state.regression[row, 0] == pytest.approx(best[1])


@pytest.mark.parametrize("made", [behind_known(TRAIN), two_records], ids=["steps", "own"])
def test_drawn_numerators_scatter_by_linear_least_squares(made):
    # At given dead time and poles numerators are linear: the covariance of white noise of unit
    # variance is that of the fits to unit errors in each sample, W W^T.
    x, structure = np.concatenate([[7.3], THETA[2]])[None], Structure(2, 1)
    weight = np.linspace(0.5, 2.0, 300)
    data = np.random.default_rng(1).normal(size=300).cumsum()

    def numerator(values):
        return eliminate(made(values, weight), structure, x).numerator[0]

    unit = np.array([numerator(row) for row in np.diag(1 / weight)])
    exact = 0.5**2 * unit.T @ unit
    rng = np.random.default_rng(2)
    drawn = drawn_numerators(made(data, weight), structure, np.tile(x, (4000, 1)), 0.5, rng)
    # a variance of 4000 draws has a relative standard error of 2.2 %, a mean one of 1.6 % of its
    # standard deviation: four of them
    std = np.sqrt(np.diag(exact))
    assert_allclose(np.cov(drawn.T) / np.outer(std, std), exact / np.outer(std, std), atol=0.09)
    assert_allclose((drawn.mean(axis=0) - numerator(data)) / std, 0.0, atol=0.064)
