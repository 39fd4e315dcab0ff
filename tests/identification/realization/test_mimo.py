import bz2
import importlib.util
import pickle
from pathlib import Path

import control as ct
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_allclose

import ctrl_realize as cr

DT = 0.1
CORE = ct.ss(
    [[0.8, 0.1, 0.0], [0.0, 0.5, 0.2], [0.1, 0.0, 0.3]],
    [[1.0, 0.5], [1.0, 1.0], [0.3, -1.0]],
    [[1.0, 0.2, 0.1], [1.0, 1.0, -0.5], [0.4, -1.0, 1.0]],
    np.zeros((3, 2)),
    DT,
)  # all nine products C B are away from zero: every entry has relative degree 1
delays_of = st.integers(0, 12)


@given(st.tuples(delays_of, delays_of), st.tuples(delays_of, delays_of, delays_of))
def test_delays_of_inputs_and_outputs_come_back_with_one_core(inputs, outputs):
    plant = cr.DelayedStateSpace(CORE, inputs, output_delay=outputs)
    data = plant.markov(200)
    sys = cr.identification.realize_mimo(data, 3, level=0.0, dt=DT)
    assert sys.fit.structure == "common"
    assert np.array_equal(np.broadcast_to(sys.delay, (3, 2)), np.add.outer(outputs, inputs))
    assert sys.delay_free.nstates == 3
    # the response has decayed to 1e-13 of its size within the samples
    assert_allclose(sys.markov(200), data, rtol=0, atol=1e-11)
    assert_allclose(np.sort_complex(sys.delay_free.poles()), np.sort_complex(CORE.poles()),
                    rtol=0, atol=1e-8)  # fmt: skip


def separate(delays):
    """Entries of first and second order, each with a delay of its own."""
    entries = np.zeros((*np.shape(delays), 200))
    for (i, j), d in np.ndenumerate(delays):
        pulse = np.concatenate([np.zeros(d + 1), (0.5 + 0.1 * i + 0.2 * j) ** np.arange(200.0)])
        entries[i, j] = pulse[:200]
    return entries


@pytest.mark.parametrize(
    ("delays", "structure"),
    [
        ([[3, 20], [5, 20]], "rows"),  # input lines of 5 and 20 samples
        ([[3, 5], [20, 20]], "columns"),
    ],
)
def test_delays_that_no_split_explains_take_the_fewest_states(delays, structure):
    data = separate(np.array(delays))
    sys = cr.identification.realize_mimo(data, 2, dt=DT)
    fit = sys.fit
    assert fit.structure == structure
    assert_allclose(sys.markov(200), data, rtol=0, atol=1e-9)
    assert sys.nstates == fit.states == 4 + 25
    for other in ("rows", "columns"):
        assert cr.identification.realize_mimo(data, 2, dt=DT, structure=other).nstates >= fit.states
    # with one core and that many states the data are explained as well
    core = cr.identification.realize_mimo(data, 12, dt=DT, structure="common")
    assert core.nstates >= fit.states - 1


def test_noise_is_not_taken_for_a_response():
    plant = cr.DelayedStateSpace(CORE, (4, 7), output_delay=(0, 2, 0))
    rng = np.random.default_rng(0)
    u = rng.standard_normal((2, 3000))
    y = plant.simulate(u) + 0.05 * rng.standard_normal((3, 3000))
    estimate = cr.impulse_from_io(cr.Record(DT * np.arange(3000), u, y), 60)
    assert np.array_equal(cr.identification.delay_matrix(estimate), plant.delay)
    sys = cr.identification.realize_mimo(estimate, 3)
    assert np.array_equal(sys.delay, plant.delay)
    assert np.abs(sys.markov(60) - plant.markov(60)).max() < 0.03
    fresh = rng.standard_normal((2, 1000))
    check = cr.validation.analyse_residuals(
        sys, cr.Record(DT * np.arange(1000), fresh, plant.simulate(fresh))
    )
    assert np.all(check.fit_percent > 97)


@pytest.mark.parametrize("coupled", [True, False])
def test_the_model_does_not_depend_on_the_units_of_channels(coupled):
    # of an output in Pa instead of bar the Hankel matrix saw the others no more: 10 % off
    core = (
        CORE if coupled else ct.ss(np.diag([0.8, 0.5]), np.eye(2), np.eye(2), np.zeros((2, 2)), DT)
    )
    g = cr.DelayedStateSpace(core, (4, 7)).markov(60)
    g = g + 0.02 * np.abs(g).max() * np.random.default_rng(0).standard_normal(g.shape)
    units = np.array([1.0, 1e5, 1e-3])[: len(g), None] * [1e3, 0.1]
    one, other = (cr.identification.realize_mimo(each, 3, level=0.2, dt=DT).markov(60)
                  for each in (g, units[:, :, None] * g))  # fmt: skip
    # sizes and their products are rounded to some 1e-16, which singular vectors multiply
    assert_allclose(other / units[:, :, None], one, rtol=0, atol=1e-10 * np.abs(one).max())


def test_an_entry_without_response_does_not_hide_a_mode_of_another():
    # one of 1e-17 counted for the sizes of its channels: the mode of 0.93, in one entry alone, was
    # a thousandth beside the others, and 0.08 off
    C = [[1, 0, 0], [0, 1, 1]]
    core = ct.ss(np.diag([0.8, 0.5, 0.93]), [[1, 0], [0, 1], [0.3, 0]], C, np.zeros((2, 2)), DT)
    exact = cr.DelayedStateSpace(core, (2, 5)).markov(120)
    rng = np.random.default_rng(0)
    g = exact + 3e-3 * rng.standard_normal(exact.shape)
    g[0, 1] = 1e-17 * rng.standard_normal(120)
    found = cr.identification.realize_mimo(g, 3, level=0.2, dt=DT)
    # a Markov parameter of the model is off by no more than the noise of one of the data: of 480
    # the largest is 3.1 standard deviations
    assert np.abs(found.markov(120) - exact).max() < 3.1 * 3e-3


class _Plain:
    pass


class _WithoutTheirClasses(pickle.Unpickler):
    """Reads the numbers of a pickle; importing its package would need a sound card library."""

    def find_class(self, module, name):
        return _Plain if module.startswith("slab") else super().find_class(module, name)


def kemar():
    """Azimuth [deg] and responses (direction, ear, sample) of the horizontal directions."""
    package = importlib.util.find_spec("slab")
    if package is None:
        pytest.skip("package slab, which holds the KEMAR responses, is not installed")
    folder = Path(package.submodule_search_locations[0]) / "data"
    with bz2.open(folder / "mit_kemar_normal_pinna.bz2") as file:
        head = _WithoutTheirClasses(file).load()
    sources = np.asarray(head.sources)
    level = np.flatnonzero(np.abs(sources[:, 1]) < 0.5)
    return sources[level, 0], np.stack([head.data[i].data.T for i in level]), head.samplerate


def test_delays_between_two_ears_are_those_of_a_sphere():
    azimuth, responses, rate = kemar()
    assert responses.shape == (72, 2, 512)
    lateral = np.arcsin(np.sin(np.deg2rad(azimuth)))
    sphere = 0.0875 / 343 * (lateral + np.sin(lateral)) * rate
    found = []
    for ears in responses:
        sys = cr.identification.realize_mimo(ears[:, None, :], 12, samples=160, dt=1 / rate)
        assert sys.fit.structure == "common"
        left, right = sys.output_delays
        found.append(right - left)
    error = np.array(found) - sphere
    assert np.sqrt(np.mean(error**2)) <= 1.0  # sample; 0.82 when this was written
    assert np.abs(error).max() < 2.5


@pytest.mark.parametrize("noise", [0.0, 0.002])
def test_fractions_of_dead_times_make_a_feedthrough(noise):
    # a lag and 5.3 samples: 19 % off with order 1, whose D was 0
    lags, dead_times = ((0.5, 1.0), (0.8, 0.4)), ((0.53, 1.27), (0.31, 0.84))
    entries = [
        [cr.delayed_ss(ct.tf([1], [lag, 1]), dead_time=tau, dt=0.1).markov(160) for lag, tau in row]
        for row in (zip(*pair, strict=True) for pair in zip(lags, dead_times, strict=True))
    ]
    g = np.array(entries)
    measured = g + noise * g.max() * np.random.default_rng(0).standard_normal(g.shape)
    found = cr.identification.realize_mimo(measured, 2, dt=0.1)
    # the largest of 640 values of noise is 3.2 standard deviations
    assert np.abs(found.markov(160) - g).max() <= max(1e-12, 3.2 * noise) * g.max()
    assert found.fit.delays.tolist() == [[6, 13], [4, 9]]


def test_a_feedthrough_behind_the_delays_is_no_response_of_the_next_sample():
    D = [[1, 0.5], [0.3, 2]]
    core = ct.ss([[0.8, 0.1], [0, 0.5]], [[1, 0], [1, 1]], [[1, 0], [1, 1]], D, 0.1)
    g = cr.DelayedStateSpace(core, (3, 6), output_delay=(0, 9)).markov(200)
    found = cr.identification.realize_mimo(g, 2, level=0, dt=0.1)
    np.testing.assert_allclose(found.markov(200), g, rtol=0, atol=1e-12)
    assert found.nstates == 2 + 3 + 6 + 9
