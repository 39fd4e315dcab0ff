"""Level, drift and initial state of every stretch, noise and criterion of its fit."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose

from ctrl_realize.numerics.separable.local_terms import FixedTerms, LocalTerms, Segments
from ctrl_realize.numerics.separable.poles import poles_from_parameters
from ctrl_realize.numerics.separable.responses import StepSequence
from ctrl_realize.numerics.separable.structures import Candidate
from ctrl_realize.numerics.separable.varpro import (
    KnownFactor,
    Problem,
    Structure,
    respond,
)
from ctrl_realize.numerics.separable.window import Window
from ctrl_realize.numerics.signals.bins import response_bins

CLOCK = np.concatenate([np.arange(70.0), np.arange(110.0)])
EDGES = np.array([0, 70, 180])
SHAPES = np.stack([np.ones(180), CLOCK], axis=1)
STRETCHES = Segments(EDGES, CLOCK, SHAPES)
# real; a ringing pair; the same pair just on either side of critical damping; all of them
THETA = {
    "real": [-3.0],
    "ringing": [np.log(0.3), np.log(0.1)],
    "below critical": [np.log(0.1), -1e-9],
    "above critical": [np.log(0.1), 1e-9],
    "three": [-3.0, np.log(0.3), np.log(0.1)],
}


@pytest.mark.parametrize("theta", THETA.values(), ids=THETA.keys())
def test_what_a_record_has_for_itself_disappears(theta):
    poles, _ = poles_from_parameters(np.array([theta]))
    rng = np.random.default_rng(0)
    own = LocalTerms(FixedTerms(STRETCHES, np.ones(180)), poles)
    data = np.zeros(180)
    for rows in STRETCHES.rows:
        # every real free response: with conjugate amplitudes
        amplitudes = rng.normal(size=poles.shape[1]) + 1j * rng.normal(size=poles.shape[1])
        free = (np.exp(CLOCK[rows, None] * poles[0]) @ amplitudes).real
        data[rows] = free + rng.normal() + rng.normal() * CLOCK[rows]
    left = own.without(data[None, :, None])[0, :, 0]
    assert_allclose(left, 0.0, atol=1e-9 * np.abs(data).max())


def test_a_free_response_that_is_over_before_the_first_row_takes_nothing_away():
    clock = np.arange(60.0) + 0.5
    rows = Segments(np.array([0, 60]), clock, np.ones((60, 1)))
    fixed = FixedTerms(rows, np.ones(60))
    data = np.random.default_rng(0).normal(size=(1, 60, 1))
    alone = LocalTerms(fixed, np.array([[-0.2 + 0j]])).without(data)
    beside = LocalTerms(fixed, np.array([[-0.2 + 0j, -900.0 + 0j]])).without(data)
    assert_allclose(beside, alone, atol=1e-12)
    none = LocalTerms(fixed, np.array([[-900.0 + 0j]])).without(data)
    assert_allclose(none, data - data.mean(), atol=1e-12)


def test_nothing_else_disappears_and_records_do_not_mix():
    poles, _ = poles_from_parameters(np.array([THETA["three"]]))
    own = LocalTerms(FixedTerms(STRETCHES, np.ones(180)), poles)
    data = np.zeros(180)
    data[:70] = np.random.default_rng(0).normal(size=70)
    left = own.without(data[None, :, None])[0, :, 0]
    assert np.all(left[70:] == 0)
    # five own terms of the first stretch, three of them of the plant
    columns = np.concatenate([SHAPES[:70], np.exp(CLOCK[:70, None] * poles[0])], axis=1)
    expected = data[:70] - (columns @ np.linalg.lstsq(columns, data[:70] + 0j, rcond=None)[0]).real
    assert_allclose(left[:70], expected, rtol=0, atol=1e-10)


ONE, TWO, ZERO = Structure(1, 1), Structure(2, 2), Structure(2, 1)
SIZE, EDGE, DT = 120, 20, 0.5
TRUTH = np.array([3.7, np.log(0.2)])  # dead time and rate, in s and 1/s


def drive(first, width):
    return StepSequence(DT * first, width, DT, np.array([EDGE * DT]), np.ones(1))


def windows():
    """One lag behind a dead time on a level of 3: on bins, and sample by sample."""
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
    own = Segments(np.array([0, SIZE]), clock, level)
    problem = replace(
        means.problem,
        data=means.bins.average(means.output + free),
        root_weight=single,
        regressors=none,
        segments=Segments(np.array([0, middle.size]), middle, means.bins.average(level)),
    )
    window = replace(means, problem=problem, columns=np.ones((SIZE, 0)), own=own)
    found = window.predict(problem, Candidate(ONE, TRUTH, 0.0))
    assert found == pytest.approx(means.output + free, abs=1e-10)
