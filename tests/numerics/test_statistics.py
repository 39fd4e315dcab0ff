"""Trimmed statistics, and threads of the BLAS."""

import gc
import sys
import threading

import control as ct
import numpy as np
import pytest
import scipy.linalg  # noqa: F401 - has a BLAS of its own, loaded here and not inside a test
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from numpy.testing import assert_array_equal
from scipy import stats
from threadpoolctl import threadpool_info, threadpool_limits

import ctrl_realize as cr
from ctrl_realize.errors import DataError
from ctrl_realize.numerics.blas_threads import one_blas_thread, single_threaded
from ctrl_realize.numerics.statistics import circle_quantile, trimmed_statistics, upper_quantile

samples = arrays(np.float64, st.integers(7, 40), elements=st.floats(-1e3, 1e3, width=32))


@given(samples)
def test_trimmed_mean_is_that_of_scipy(values):
    expected = stats.trim_mean(values, 2.5 / values.size)  # floor(2.5) = 2 at each end
    assert trimmed_statistics(values, 2).mean == pytest.approx(expected, rel=1e-12, abs=1e-9)


def test_95_percent_intervals_cover_the_centre_of_heavy_tails():
    rng = np.random.default_rng(3)
    hits = 0
    for _ in range(400):
        low, high = trimmed_statistics(rng.standard_t(3, 40), 3).interval
        hits += low <= 0 <= high
    # Binomial: 95 % of 400 has a standard deviation of 1.1 %; three of them.
    assert 0.917 <= hits / 400 <= 0.983


@pytest.mark.parametrize("repeats", [1.3, 2, 5, 8, 40])
def test_a_complex_error_over_its_scatter_is_distributed_as_f_and_student_say(repeats):
    freedom = 2 * (repeats - 1)
    for level in (0.5, 0.95, 0.999):
        radius = circle_quantile(level, repeats)
        assert radius**2 == pytest.approx(stats.f.ppf(level, 2, freedom), rel=1e-9)
        assert upper_quantile(1 - level, repeats) == pytest.approx(stats.t.ppf(level, freedom))


def threads() -> set[int]:
    return {pool["num_threads"] for pool in threadpool_info() if pool["user_api"] == "blas"}


@pytest.fixture
def two_threads():
    with threadpool_limits(limits=2, user_api="blas"):
        if threads() != {2}:
            pytest.skip("this BLAS does not take a number of threads")
        yield


def record() -> cr.Record:
    rng = np.random.default_rng(1)
    t, u = 0.1 * np.arange(500), rng.choice([-1.0, 1.0], 500)
    plant = ct.ss([[0.9, 0.2], [0, 0.7]], [[0.0], [1.0]], [[1.0, 0.0]], 0, 0.1)
    y = cr.delayed_ss(plant, 3).simulate(u)
    return cr.Record(t, u, y + 0.01 * np.ptp(y) * rng.standard_normal(500))


def test_inside_there_is_one_thread_and_afterwards_as_many_as_before(two_threads):
    with one_blas_thread():
        assert threads() == {1}
        with one_blas_thread():
            assert threads() == {1}
        assert threads() == {1}
    assert threads() == {2}


def test_calls_that_overlap_in_two_python_threads_restore_the_setting(two_threads):
    entered, go_on = threading.Event(), threading.Event()

    @single_threaded
    def wait() -> None:
        entered.set()
        go_on.wait(10)

    other = threading.Thread(target=wait)
    with one_blas_thread():
        other.start()
        assert entered.wait(10)
        assert threads() == {1}
    assert threads() == {2}
    go_on.set()
    other.join()
    assert threads() == {2}


def test_a_model_is_the_same_with_one_thread_and_with_two():
    def numbers() -> list[np.ndarray]:
        g = cr.impulse_from_io(record(), 120)
        system = cr.realize(g, 3)
        return [g.markov, g.std, system.A, system.B, system.C]

    with threadpool_limits(limits=1, user_api="blas"):
        one = numbers()
    with threadpool_limits(limits=2, user_api="blas"):
        two = numbers()
    for a, b in zip(one, two, strict=True):
        assert_array_equal(a, b)


def test_an_error_leaves_the_setting_as_it_was(two_threads):
    with pytest.raises(DataError):
        cr.impulse_from_io(cr.Record(np.arange(50.0), np.zeros(50), np.arange(50.0)))
    assert threads() == {2}


def test_an_interruption_at_any_call_leaves_the_setting_as_it_was(two_threads):
    # An interpreter handles signals where functions are entered, among other places.
    tracer, left = sys.gettrace(), 0
    gc.collect()  # what is freed meanwhile would be interrupted, and tell nobody

    def interrupt(*_: object) -> None:
        nonlocal left
        left -= 1
        if left == 0:
            sys.settrace(None)
            raise KeyboardInterrupt

    for place in range(1, 200):
        left = place
        try:
            sys.settrace(interrupt)
            with one_blas_thread():
                pass
        except KeyboardInterrupt:
            pass
        finally:
            sys.settrace(tracer)
        assert threads() == {2}, place
        with one_blas_thread():
            assert threads() == {1}, place
        if left > 0:
            break
    assert 10 < place < 199
