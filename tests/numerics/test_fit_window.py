"""Noise, criterion and prediction of fits to one stretch, with searches that are by hand."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from ctrl_realize.numerics.separable.compared_fits import at_delay
from ctrl_realize.numerics.separable.local_terms import Stretches
from ctrl_realize.numerics.separable.responses import MoveTrain
from ctrl_realize.numerics.separable.structures import Candidate, Scales
from ctrl_realize.numerics.separable.varpro import (
    KnownFactor,
    Problem,
    Structure,
    evaluate,
    respond,
)
from ctrl_realize.numerics.separable.window import Window
from ctrl_realize.numerics.signals.bins import response_bins

ONE, TWO, ZERO = Structure(1, 1), Structure(2, 2), Structure(2, 1)
SIZE, EDGE, DT = 120, 20, 0.5
SCALES = Scales(onset=4.0, rise=5.0, length=50.0, dt=DT, latest=6.0)
TRUTH = np.array([3.7, np.log(0.2)])  # delay and rate, in s and 1/s


def drive(first, width):
    return MoveTrain(DT * first, width, DT, np.array([EDGE * DT]), np.ones(1))


def windows():
    """One lag behind a delay on a level of 3: on bins, and sample by sample."""
    index, single = np.arange(SIZE), np.ones(SIZE, dtype=np.int64)
    every = drive(index.astype(float), single)
    output = 3.0 + respond(every, KnownFactor(), np.array([0.4]), TRUTH)
    bins = response_bins(SIZE, [EDGE], 8)
    assert bins.width.max() > 1
    level = np.ones((SIZE, 1))
    means = Problem(
        bins.average(output),
        np.sqrt(bins.width),
        drive(bins.first.astype(float), bins.width),
        np.ones((bins.first.size, 1)),
        KnownFactor(),
    )
    samples = Problem(output, np.ones(SIZE), every, level, KnownFactor())
    return (
        Window(EDGE, output, means, every, level, bins),
        Window(EDGE, output, samples, every, level, None),
    )


@pytest.mark.parametrize("window", windows(), ids=["bins", "samples"])
def test_a_model_is_predicted_at_every_sample(window):
    exact = window.predict(window.problem, Candidate(ONE, TRUTH, 0.0))
    assert exact == pytest.approx(window.output, abs=1e-12)
    # of other parameters gain and level are those of the problem's data
    other = window.predict(window.problem, Candidate(ONE, np.array([4.7, np.log(0.27)]), 0.0))
    assert 1e-3 < np.abs(other - window.output).max() < 0.5
    half = window.with_output(0.5 * window.output)
    assert window.predict(half, Candidate(ONE, TRUTH, 0.0)) == pytest.approx(0.5 * window.output)


def test_a_free_response_is_predicted_at_every_sample():
    means, _ = windows()
    clock = DT * np.arange(SIZE)
    free = 2.0 * np.exp(-0.2 * clock)
    # in the middle of bins, of which those with one sample alone count here
    middle = means.bins.average(clock)
    single = 1.0 * (means.bins.width == 1)
    none = np.ones((means.bins.first.size, 0))
    level = np.ones((SIZE, 1))
    own = Stretches(np.array([0, SIZE]), clock, level)
    problem = replace(
        means.problem,
        data=means.bins.average(means.output + free),
        root_weight=single,
        regressors=none,
        stretches=Stretches(np.array([0, middle.size]), middle, means.bins.average(level)),
    )
    window = replace(means, problem=problem, columns=np.ones((SIZE, 0)), own=own)
    found = window.predict(problem, Candidate(ONE, TRUTH, 0.0))
    assert found == pytest.approx(means.output + free, abs=1e-10)


# --- what the best of the candidates leaves


def noise(size=1000, seed=0):
    return np.random.default_rng(seed).standard_normal(size)


def test_a_model_with_a_given_delay_is_the_best_one_with_it():
    window, _ = windows()
    kept = Candidate(ONE, TRUTH, 0.0)
    moved = at_delay(window.problem, kept, SCALES, 4.7)
    assert moved.structure == ONE
    assert moved.delay == 4.7
    assert TRUTH[0] == 3.7
    # less delay, less lag: a second later the response must be faster
    assert moved.poles[0].real < -0.2
    left = window.predict(window.problem, moved) - window.output
    assert moved.cost == pytest.approx(
        np.sum(window.bins.width * window.bins.average(left) ** 2), rel=1e-9
    )
    rates = -moved.poles[0].real * np.array([0.99, 1.0, 1.01])
    starts = np.stack([np.full(3, 4.7), np.log(rates)], axis=1)
    slower, best, faster = evaluate(window.problem, ONE, starts).cost
    assert best < min(slower, faster)


# --- residuals
