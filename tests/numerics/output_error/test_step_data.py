"""From the record of a step to least-squares problems; long records condensed."""

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy.signal import lfilter

from ctrl_realize.numerics.engine.local_terms import local_columns
from ctrl_realize.numerics.engine.problem import KnownFactor
from ctrl_realize.numerics.engine.profile import profile_limits
from ctrl_realize.numerics.engine.responses import SampledInput
from ctrl_realize.numerics.output_error.any_input.condensed import MOST_LAGS, condensed
from ctrl_realize.numerics.output_error.any_input.data import cut
from ctrl_realize.numerics.output_error.step_data import (
    StepData,
    fixed_regressors,
    step_data,
    stop_at,
    window,
)

EDGE, DELAY, LAG, DT = 200, 40, 60.0, 0.5


def data(*, height: float = 2.0, noise: float = 1e-3, quantum: float = 0.0) -> StepData:
    """One lag of 60 samples, 40 samples after a step at sample 200 of 1400."""
    k = np.arange(1400.0)
    after = np.clip(k - EDGE - DELAY, 0, None)
    y = height * -np.expm1(-after / LAG) + noise * np.random.default_rng(0).standard_normal(k.size)
    y = np.round(y / quantum) * quantum if quantum else y
    return step_data(y, 1.0 * (k >= EDGE), DT, [(EDGE, 1)])


def reached(part: float) -> float:
    return EDGE + DELAY - LAG * np.log1p(-part)


@pytest.mark.parametrize("height", [2.0, -2.0])
@pytest.mark.parametrize("part", [0.1, 0.3, 0.63, 0.9])
def test_a_fit_stops_where_a_part_of_the_excursion_is_made(height, part):
    # means over nine samples; near its start the response is too short to stop in
    assert stop_at(data(height=height), part) == pytest.approx(reached(part), abs=5)


def weights(made: StepData) -> tuple[np.ndarray, np.ndarray]:
    found = window(made, 1400, KnownFactor())
    return found.bins.width, np.square(found.problem.root_weight)


def test_means_weigh_what_they_hold_and_of_coarsely_rounded_samples_hardly_more():
    width, weight = weights(data())
    np.testing.assert_allclose(weight, width)
    assert width.max() > 9
    made = data(noise=1e-4, quantum=0.05)
    assert made.coarse
    width, weight = weights(made)
    assert weight[width == 1] == pytest.approx(1.0)
    assert weight.max() < 2.0
    assert weight[np.argmax(width)] > 1.8


def test_hum_is_found_at_rest_and_taken_off_before_the_noise_is_measured():
    k = np.arange(1400.0)
    line = 0.05 * np.sin(2 * np.pi * 0.063 * k + 1)
    made = step_data(data().output + line, 1.0 * (k >= EDGE), DT, [(EDGE, 1)])
    assert made.hum == pytest.approx([0.063], rel=1e-3)
    assert made.sigma == pytest.approx(1e-3, rel=0.2)
    assert made.motion.crossing == pytest.approx(data().motion.crossing, abs=2)
    # rounding is not less noise than it is
    coarse = np.round((data().output + line) / 0.02) * 0.02
    found = step_data(coarse, 1.0 * (k >= EDGE), DT, [(EDGE, 1)])
    assert found.sigma >= 0.02 / np.sqrt(12) * (1 - 1e-9)


def test_a_record_that_begins_while_the_plant_moves_has_a_free_response_of_its_own():
    k = np.arange(1400.0)
    moving = data().output + 0.8 * np.exp(-k / LAG)
    made = step_data(moving, 1.0 * (k >= EDGE), DT, [(EDGE, 1)])
    assert made.relaxing
    assert made.drift == 0.0
    # a rough curve is taken off before the noise is measured: of 0.8 little is left
    assert 0.8e-3 < made.sigma < 6e-3
    assert made.motion.crossing == pytest.approx(data().motion.crossing, abs=3)
    found = window(made, 1400, KnownFactor())
    np.testing.assert_allclose(found.own.clock, DT * np.arange(1400))
    # means of the exponentials over the bins, not their values in the middle
    poles = np.array([[-0.3 + 2j, -0.3 - 2j]]) / (40 * DT)
    single, means = (
        local_columns(found.own, poles)[0],
        local_columns(found.problem.segments, poles)[0],
    )
    np.testing.assert_allclose(means, found.bins.average(single), atol=1e-12)
    assert window(data(), 1400, KnownFactor()).own is None


def white(n, seed=0):
    return np.random.default_rng(seed).standard_normal(n)


def test_a_slope_before_the_step_has_three_explanations():
    k = np.arange(1000)

    def ways(edge):
        output = 0.05 * k + 0.01 * white(1000) + 200.0 * (k >= edge + 20)
        return step_data(output, 1.0 * (k >= edge), 1.0, [(edge, 1)]).explanations()

    level, slope = fixed_regressors(ways(100)[0]).T
    assert_allclose(level, 1.0)
    assert_allclose(np.diff(slope), slope[1] - slope[0])
    moving = ways(100)[1]
    assert moving.relaxing
    assert fixed_regressors(moving).shape == (1000, 1)
    assert [(bool(way.drift), way.relaxing) for way in ways(100)] == [
        (True, False), (False, True), (False, False),
    ]  # fmt: skip
    assert len(step_data(white(1000), 1.0 * (k >= 100), 1.0, [(100, 1)]).explanations()) == 1


def test_at_most_half_of_what_was_measured_waits_for_a_dead_time():
    output = white(100)
    output[40:] = np.nan
    data = cut((output,), (white(100, 1),), 1.0, 1, KnownFactor())
    assert [data.after(late).counts for late in (5.0, 90.0)] == [[32], [20]]


def test_profile_limits_are_where_a_parabola_crosses():
    dead_time = np.linspace(-4, 8, 13)
    low, high = profile_limits(dead_time, ((dead_time - 2) / 1.5) ** 2)
    # the root of the excess is linear, so that interpolation is exact
    assert_allclose(
        [low, high], [2 - 1.5 * np.sqrt(3.841458820694124), 2 + 1.5 * np.sqrt(3.841458820694124)]
    )
    assert profile_limits(dead_time, np.zeros(13)) == (-4, 8)


FINE = 0.01
LAGS = 40


def held_response(pulse, u):
    """Response (N,) whose pulse response has the lags 1 to L: a held input acts a sample later."""
    return lfilter(np.append(0.0, pulse), [1.0], u)


def record(samples, seed=0, pulse=None, noise=0.1):
    rng = np.random.default_rng(seed)
    u = np.repeat(rng.choice([-1.0, 1.0], samples // 3 + 1), 3)[:samples]
    g = 0.9 ** np.arange(LAGS) if pulse is None else pulse
    return held_response(g, u) + noise * rng.standard_normal(samples), u


def test_the_condensed_misfit_differs_from_that_of_all_samples_by_a_constant():
    # two records, one of them longer than what is summed at a time
    both = [record(3000), record(140_000, seed=1)]
    rng = np.random.default_rng(5)
    y = [output + 0.0 for output, _ in both]
    found = condensed(y, [u for _, u in both], FINE, LAGS, huber=False)
    models = [0.9 ** np.arange(LAGS) + 0.01 * rng.standard_normal(LAGS) for _ in range(4)]
    short = [float(np.sum((found.data - found.drive.factor @ g) ** 2)) for g in models]
    assert found.noise_lags == 0  # white noise is left as it is
    whole = []
    for g in models:
        total = 0.0
        for output, u in zip(y, (u for _, u in both), strict=True):
            error = (output - held_response(g, u))[LAGS:]
            pieces = np.array_split(error, -(-error.size // 2**17))
            total += sum(float(np.sum((piece - piece.mean()) ** 2)) for piece in pieces)
        whole.append(total)
    # the pieces with a level of their own begin elsewhere, by a sample or so
    assert_allclose(np.diff(short), np.diff(whole), rtol=1e-4)
    assert abs(found.noise / 0.1 - 1) < 0.01


def test_the_drive_is_the_response_to_a_pulse_times_the_factor():
    y, u = record(3000)
    found = condensed([y], [u], FINE, LAGS, huber=False)
    tau, poles = np.array([0.023, 0.1]), np.array([[-3.0, -8 + 5j], [-20.0, -1.0 + 0j]])
    pulse = np.zeros(LAGS + 1)
    pulse[0] = 1.0
    exact = SampledInput(pulse, FINE).modes(tau, poles)
    for one, other in zip(found.drive.modes(tau, poles), exact, strict=True):
        after = np.einsum("ml,bl...->bm...", found.drive.factor, other[:, 1:])
        assert_allclose(one, after, atol=1e-9)


def test_outliers_count_for_little_with_hubers_loss():
    y, u = record(30_000)
    spikes = np.random.default_rng(4).integers(0, y.size, 300)
    y[spikes] += 50.0
    size = {}
    for huber in (False, True):
        found = condensed([y], [u], FINE, LAGS, huber=huber)
        size[huber] = found.noise
    assert size[False] > 10 * 0.1
    assert size[True] < 1.2 * 0.1


@pytest.mark.parametrize(("samples", "lags"), [(500, LAGS), (30_000, MOST_LAGS + 1), (3000, 1)])
def test_what_cannot_be_condensed_is_left(samples, lags):
    y, u = record(samples)
    assert condensed([y], [u], FINE, lags, huber=True) is None
