"""One BLAS thread while the library computes, and the caller's setting afterwards."""

from __future__ import annotations

import threading

import control as ct
import numpy as np
import pytest
import scipy.linalg  # noqa: F401 - has a BLAS of its own, loaded here and not inside a test
from numpy.testing import assert_array_equal
from threadpoolctl import threadpool_info, threadpool_limits

import ctrl_realize as cr
from ctrl_realize.errors import DataError
from ctrl_realize.numerics.blas_threads import one_blas_thread, single_threaded


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


def test_an_error_leaves_the_setting_as_it_was(two_threads):
    with pytest.raises(DataError):
        cr.impulse_from_io(cr.Record(np.arange(50.0), np.zeros(50), np.arange(50.0)))
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
