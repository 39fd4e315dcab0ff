"""From a measured step to an impulse response."""

import control as ct
import numpy as np
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_allclose

import ctrl_realize as cr
from ctrl_realize.numerics.signals.filters import low_pass
from tests.rigs import R3, TS, exact_step, step_record


def record_of(u: np.ndarray, y: np.ndarray | None = None, dt: float = 0.01) -> cr.Record:
    return cr.Record(dt * np.arange(u.size), u, np.zeros(u.size) if y is None else y)


def step_input(n: int = 400, at: int = 100, low: float = 4.0, high: float = 20.0) -> np.ndarray:
    return np.where(np.arange(n) < at, low, high)


@given(positions=st.lists(st.integers(0, 399), min_size=1, max_size=4), seed=st.integers(0, 99))
def test_spikes_shorter_than_the_window_change_nothing(positions, seed):
    rng = np.random.default_rng(seed)
    u = step_input()
    for k in positions:
        # Two spikes closer than two windows may join to one that is longer than the window.
        if all(abs(k - other) > 8 for other in positions if other != k) and abs(k - 100) > 8:
            u[k : k + 3] += rng.choice([-30.0, 50.0])
    edge = cr.detect_step(record_of(u))
    assert (edge.index, edge.amplitude, edge.baseline) == (100, 16.0, 4.0)


def test_all_edges_are_listed_and_the_first_large_one_is_taken():
    u = np.concatenate([np.full(100, 9.0), np.full(80, 4.0), np.full(60, 8.0), np.full(90, 3.0)])
    edge = cr.detect_step(record_of(u))
    assert [e.index for e in edge.edges] == [100, 180, 240]
    assert [e.amplitude for e in edge.edges] == [-5.0, 4.0, -5.0]
    assert (edge.index, edge.start, edge.stop) == (100, 0, 180)
    assert (edge.edges[1].start, edge.edges[1].stop) == (100, 240)
    second = cr.unit_step(record_of(u, 2 * u), edge.edges[1])
    assert_allclose(second.output, 2.0, atol=1e-12)
    assert second.n_samples == 60


def test_a_record_that_starts_at_its_step_is_understood():
    u = np.full(500, 25.0)
    u[0] = 0.0
    edge = cr.detect_step(record_of(u))
    assert (edge.index, edge.baseline, edge.amplitude) == (1, 0.0, 25.0)


def test_significant_drift_is_removed_and_noise_is_not_taken_for_drift():
    base = step_record(noise=1e-3, seed=3, before=3840)
    slope = 0.02 * 16.0  # 2 % of the step per second
    drifting = cr.Record(base.time, base.input, base.output + slope * base.time)
    assert cr.unit_step(base).drift == 0.0
    removed = cr.unit_step(drifting)
    # Standard error of the slope: sigma sqrt(12 / n) / T = 0.016 * 0.056 / 3 s.
    assert_allclose(removed.drift, slope, atol=5 * 3e-4)
    assert cr.unit_step(drifting, remove_drift=False).drift == 0.0


def test_backward_difference_sums_to_the_step():
    step = cr.unit_step(step_record())
    g = cr.impulse_from_step(step, cutoff_hz=None)
    assert_allclose(np.cumsum(g.markov), step.output, rtol=0, atol=1e-12)
    assert g.filter is None
    assert g.sampling == "step-invariant"


def test_central_difference_samples_the_impulse_response():
    step = cr.unit_step(step_record(delay=37.0))
    g = cr.impulse_from_step(step, cutoff_hz=None, difference="central")
    h = 1e-7
    k = np.arange(60, 500)
    density = (exact_step(R3, (k - 37) * TS + h) - exact_step(R3, (k - 37) * TS - h)) / (2 * h)
    # Fourth order: (w Ts)^4 / 30 of the largest, w = 50 rad/s.
    assert_allclose(g.density[k], density, rtol=0, atol=1e-6 * density.max())
    assert g.sampling == "impulse-invariant"


def test_causal_filter_delays_by_its_group_delay_and_zero_phase_does_not():
    step = cr.unit_step(step_record(after=6000))
    k = np.arange(step.n_samples)

    def centroid(**options):
        g = cr.impulse_from_step(step, **options).markov
        return (k * g).sum() / g.sum()

    plain = centroid(cutoff_hz=None)
    assert_allclose(centroid(cutoff_hz=50.0, zero_phase=False) - plain, 13.12, atol=0.02)
    assert_allclose(centroid(cutoff_hz=50.0) - plain, 0.0, atol=0.02)


def test_the_filter_that_is_left_is_recorded():
    step = cr.unit_step(step_record())
    g = cr.impulse_from_step(step, cutoff_hz=50.0, zero_phase=False)
    assert g.filter == cr.data.FilterSpec(5, 50.0, False, TS)


DT = 0.01


def step(before=60, after=240, seed=0):
    """A lag of 0.1 s behind 5 samples after a noisy rest."""
    rng = np.random.default_rng(seed)
    k = np.arange(before + after)
    u = 1.0 * (k >= before)
    y = np.where(k >= before + 5, -np.expm1(-(k - before - 4) * DT / 0.1), 0.0)
    return cr.unit_step(
        cr.Record(DT * k, u, y + 0.01 * rng.standard_normal(k.size)), remove_drift=False
    )


def test_noise_is_the_rest_treated_as_the_response():
    one = step()
    plain = cr.impulse_from_step(one, cutoff_hz=None)
    differences = np.r_[0.0, np.diff(one.pre_step)]  # the first has none before it
    assert_allclose(plain.noise, differences, rtol=0, atol=1e-15)
    assert_allclose(plain.markov, np.diff(np.r_[one.pre_step[-1], one.output]), rtol=0, atol=1e-15)
    smooth = cr.impulse_from_step(one, cutoff_hz=10.0, filter_order=3, zero_phase=False)
    expected = low_pass(differences, 3, 10.0, DT, zero_phase=False)
    assert_allclose(smooth.noise, expected, rtol=0, atol=1e-15)


def test_measured_records_have_one_step_where_it_is(shared_data):
    expected = {"dc_motor_tacho/up.csv": (1366, 4.05), "air_duct/45.csv": (480, 4.0)}
    for name, (index, amplitude) in expected.items():
        edge = cr.detect_step(cr.read_record(shared_data / name))
        assert (edge.index, len(edge.edges)) == (index, 1)
        assert_allclose(edge.amplitude, amplitude, atol=0.01)


def test_without_noise_no_filter_moves_the_delay_of_a_scan():
    """The filter began before the response: the scan was up to 11 samples early, at order 5."""
    k = np.arange(600)
    u = np.where(k < 100, 0.0, 1.0)
    plant = cr.delayed_ss(ct.tf([1], [20 * 37, 57, 1]), dead_time=12, dt=1)
    y = np.ravel(plant.simulate(u))
    system = cr.identify(cr.Record(1.0 * k, u, y), method="scan")
    assert system.delay == 12
    assert system.fit.order == 2
    # at rest a coarse converter has no noise either, and its steps have to be filtered
    rounded = cr.unit_step(cr.Record(1.0 * k, u, np.round(y / 0.02) * 0.02))
    assert cr.impulse_from_step(rounded).filter is not None
