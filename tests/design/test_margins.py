"""Margins against brute force, closed forms and closed loops."""

import re

import control as ct
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.optimize import brentq, minimize_scalar

import ctrl_realize as cr
from tests.rigs import codes

DT = 7.8125e-4
DELAYS = (0, 37, 100, 300, 1000)


def brute_force(core, delay, gain, ti):
    """Margins from the matrices alone: solves on a fine grid, and roots between its points."""

    def loop(omega):
        z = np.exp(1j * np.atleast_1d(omega) * core.dt)
        states = np.linalg.solve(z[:, None, None] * np.eye(core.nstates) - core.A, core.B)
        pi = gain * (1 + core.dt / ti / (z - 1)) if ti else gain
        return ((core.C @ states)[:, 0, 0] + core.D[0, 0]) * pi * z**-delay

    fine = np.linspace(1e-4, np.pi, 40 * delay + 4000)
    omega = np.union1d(np.geomspace(1e-4, np.pi, 4000), fine)[:-1] / core.dt
    L = loop(omega)

    def roots(function, at):
        ends = ((omega[i], omega[i + 1]) for i in at)
        found = [brentq(lambda w: function(loop(w)[0]), *pair, rtol=1e-14) for pair in ends]
        return np.array(found)

    level, lag = np.abs(L) > 1, L.imag > 0
    gains = roots(lambda value: np.log(abs(value)), np.flatnonzero(level[1:] != level[:-1]))
    crossing = np.flatnonzero((lag[1:] != lag[:-1]) & (L.real[1:] < 0))
    # the gain margin nearest to 1 is one of the few with the largest |log| proximity
    near = crossing[np.argsort(np.abs(np.log(np.abs(L[crossing]))))[:2]]
    gms, distances = [*1 / np.abs(loop(roots(np.imag, near)))], []
    integrates = bool(ti) or np.any(np.abs(core.poles() - 1) < 1e-9)
    for w in (np.pi / core.dt,) if integrates else (0.0, np.pi / core.dt):  # ends of the axis
        value = loop(w)[0].real
        distances.append(abs(1 + value))
        gms += [-1 / value] if value < 0 else []
    closest = np.argmin(np.abs(1 + L))
    between = omega[max(closest - 1, 0)], omega[min(closest + 1, omega.size - 1)]
    nearest = minimize_scalar(
        lambda w: abs(1 + loop(w)[0]), bounds=between, method="bounded", options={"xatol": 1e-9}
    )
    pms = np.degrees(np.angle(-loop(gains)))
    return (
        min(gms, key=lambda g: abs(np.log(g)), default=np.inf),
        min(pms, key=abs, default=np.inf),
        min([nearest.fun, *distances]),
        min(np.radians(np.where(pms < 0, pms + 360, pms)) / gains, default=np.inf),
        gains,
    )


LOOPS = [
    ("valve", 0.5, 0.2),
    ("stable", 8.0, 0.5),
    ("integrating", 2.0, 3.0),
    ("unstable", 1.0, 0.0),
    ("unstable", 0.6, 0.0),  # closest to -1 at frequency 0
    ("resonant", 0.4, 0.4),
    ("direct", 1.5, 0.3),
]


@pytest.mark.parametrize("delay", DELAYS)
@pytest.mark.parametrize(("kind", "gain", "ti"), LOOPS)
def test_margins_equal_those_of_brute_force(valve, cores, pi_controller, kind, gain, ti, delay):
    core = valve(0).delay_free if kind == "valve" else cores[kind]
    controller = pi_controller(gain, ti) if ti else gain
    found = cr.design.margins(cr.delayed_ss(core, delay), controller)
    gm, pm, modulus, wait, crossovers = brute_force(core, delay, gain, ti)
    # 1e-6 is what is promised; the curve itself is exact to about 1e-12.
    np.testing.assert_allclose(found.gain_crossovers, crossovers, rtol=1e-9)
    np.testing.assert_allclose(found.phase_margin, pm, rtol=1e-6, atol=1e-6)
    np.testing.assert_allclose(found.gain_margin, gm, rtol=1e-6)
    np.testing.assert_allclose(found.modulus_margin, modulus, rtol=1e-6)
    if found.stable:
        np.testing.assert_allclose(found.delay_margin, wait, rtol=1e-6)
        assert found.delay_margin_samples == found.delay_margin / DT
    else:
        assert np.isnan(found.delay_margin)


@settings(max_examples=60, deadline=None, derandomize=True)
@given(data=st.data())
def test_the_count_is_the_number_of_unstable_eigenvalues_of_the_closed_loop(data):
    n = data.draw(st.integers(1, 4))
    poles = data.draw(
        st.lists(
            st.one_of(st.floats(-0.95, 0.9), st.just(1.0), st.floats(1.001, 1.2)),
            min_size=n,
            max_size=n,
        )
    )
    rng = np.random.default_rng(data.draw(st.integers(0, 2**31)))
    A = np.diag(poles) + 0.1 * np.triu(rng.standard_normal((n, n)), 1)
    core = ct.ss(A, rng.standard_normal((n, 1)), rng.standard_normal((1, n)), 0.0, 0.1)
    gain = 10 ** data.draw(st.floats(-3, 0.5))
    plant = cr.delayed_ss(core, data.draw(st.integers(0, 20)))
    controller = ct.ss([[1.0]], [[1.0]], [[0.1 * gain]], [[gain]], 0.1)
    loop = ct.ss(plant) * controller
    radius = np.abs(np.linalg.eigvals(loop.A - loop.B @ loop.C / (1 + loop.D[0, 0])))
    found = cr.design.margins(plant, controller)
    # An eigenvalue next to the circle is beyond what either side can tell.
    if np.min(np.abs(radius - 1)) > 1e-6:
        assert found.unstable_poles == np.sum(radius > 1)
        assert found.stable == (not np.any(radius > 1))


def test_a_cancelled_unstable_pole_is_seen_when_plant_and_controller_are_given_apart():
    plant = ct.tf([1.0], [1, -1.2], 0.1)
    cancelling = ct.tf([0.1, -0.12], [1, -0.5], 0.1)
    found = cr.design.margins(plant, cancelling)
    assert not found.stable
    assert found.unstable_poles == 1


@pytest.mark.parametrize("kind", ["valve", "integrating", "unstable", "resonant"])
def test_the_delay_margin_is_where_stability_is_lost(valve, cores, pi_controller, kind):
    core = valve(0).delay_free if kind == "valve" else cores[kind]
    gain, ti = {name: pair for name, *pair in reversed(LOOPS)}[kind]
    controller = pi_controller(gain, ti) if ti else gain
    found = cr.design.margins(cr.delayed_ss(core, 7), controller)
    assert found.stable
    room = int(np.floor(found.delay_margin_samples))
    assert cr.design.margins(cr.delayed_ss(core, 7 + room), controller).stable
    assert not cr.design.margins(cr.delayed_ss(core, 8 + room), controller).stable


def test_a_negative_phase_margin_leaves_a_delay_margin_of_almost_a_turn(cores):
    """Stable, and yet the crossover nearest to -1 lies beyond it: lag helps there at first."""
    core = cr.delayed_ss(cores["resonant"], 0)
    found = cr.design.margins(core, -0.4)
    assert found.stable
    assert found.phase_margins.min() < 0
    room = int(np.floor(found.delay_margin_samples))
    assert cr.design.margins(core.replace(delay=room), -0.4).stable
    assert not cr.design.margins(core.replace(delay=room + 1), -0.4).stable


def test_continuous_first_order_with_dead_time_has_its_closed_form():
    # L = 2 exp(-0.3 s) / (s + 1): |L| = 1 at sqrt(3), phase there -atan(sqrt 3) - 0.3 sqrt 3.
    found = cr.design.margins(ct.tf([2.0], [1, 1]), dead_time=0.3)
    expected = 180 - 60 - np.degrees(0.3 * np.sqrt(3))
    assert found.phase_margin == pytest.approx(expected, rel=1e-10)
    assert found.delay_margin == pytest.approx(np.radians(expected) / np.sqrt(3), rel=1e-10)
    assert found.stable
    assert np.isnan(found.delay_margin_samples)
    assert not cr.design.margins(
        ct.tf([2.0], [1, 1]), dead_time=0.3 + 1.001 * found.delay_margin
    ).stable


@pytest.mark.parametrize("dt", [0, 0.1])
def test_a_loop_of_gain_zero_is_stable_with_every_gain_and_delay(dt):
    found = cr.design.margins(ct.tf([0.0], [1.0, 0.5], dt) if dt else 0 * cr.delay(0.3))
    assert found.stable
    assert found.modulus_margin == 1
    assert found.gain_margin == found.delay_margin == np.inf


@pytest.mark.parametrize("apart", [False, True])
@pytest.mark.parametrize("unit", [1e-6, 1.0, 1e4, 1e6])
def test_a_loop_with_two_integrators_is_stable_in_every_unit_of_time(unit, apart):
    # dead time of one unit, simc; the margins do not depend on the unit, the delay margin scales
    s = ct.tf("s")
    controller = 5 * (1 + 1 / (8 * unit * s))
    if apart:  # integrator and dead time in different systems
        found = cr.design.margins(cr.delay(unit), 0.1 / unit / s * controller)
    else:
        found = cr.design.margins(0.1 / unit / s * cr.delay(unit), controller)
    # |L| = 1 for x = (omega unit)^2 with x^2 = (x + 1/64) / 4
    omega = np.sqrt((1 / 4 + np.sqrt(1 / 16 + 1 / 64)) / 2)
    phase = np.arctan(8 * omega) - omega
    assert found.stable
    assert np.allclose(found.phase_margin, np.degrees(phase), rtol=1e-9)
    assert np.allclose(found.delay_margin, unit * phase / omega, rtol=1e-9)
    name = "µs" if unit < 1 else "s"
    number, told = repr(found).removesuffix(">").rpartition("delay ")[2].split()
    assert told == name
    assert float(number) * (1e-6 if unit < 1 else 1) == pytest.approx(found.delay_margin, rel=1e-3)


@pytest.mark.parametrize("delay", [0, 37, 300])
def test_margins_of_response_data_are_those_of_the_system(valve, pi_controller, delay):
    plant, pi = valve(delay), pi_controller(0.5, 0.2)
    omega = np.geomspace(0.05, 0.99 * np.pi / DT, 500)
    hertz = omega / (2 * np.pi)
    data = cr.MeasuredFRF(plant(np.exp(1j * omega * DT)), hertz, sample_time=DT)
    exact, found = cr.design.margins(plant, pi), cr.design.margins(data, pi)
    # Interpolation between 500 points: h^3 of a smooth curve.
    assert found.gain_margin == pytest.approx(exact.gain_margin, rel=1e-4)
    assert found.phase_margin == pytest.approx(exact.phase_margin, rel=1e-4)
    assert found.modulus_margin == pytest.approx(exact.modulus_margin, rel=1e-3)
    assert found.delay_margin == pytest.approx(exact.delay_margin, rel=1e-4)
    assert found.stable
    plain = ct.frd(np.asarray(data.frdata[0, 0]), omega, dt=DT, name="plain")
    plain = cr.design.margins(plain, pi)
    assert plain.gain_margin == pytest.approx(found.gain_margin, rel=1e-12)  # Hz -> rad/s rounds


@pytest.mark.parametrize("known", [None, 0.004])
def test_a_discrete_controller_acts_on_measured_data_through_its_hold(known):
    # gain and phase were too good by up to 26 % and 22 deg in loops that are sampled slowly
    plant, dt = ct.tf([2.0], [0.2, 1]) * cr.delay(0.3), 0.01
    pi = cr.design.PIDController(0.25, 0.3, dt=dt)
    hertz = np.geomspace(0.005, 400, 800)  # above 50 Hz the controller is an alias
    omega = 2 * np.pi * hertz
    hold = 1.0 if known is None else -np.expm1(-1j * omega * known) / (1j * omega * known)
    frf = cr.MeasuredFRF(plant(1j * omega) * hold, hertz, sample_time=known)
    found, exact = cr.design.margins(frf, pi), cr.design.margins(plant.to_discrete(dt), pi)
    # the aliases of the sampled plant are left out: 0.1 % at a thirtieth of the sampling rate
    assert found.gain_margin == pytest.approx(exact.gain_margin, rel=2e-3)
    assert found.phase_margin == pytest.approx(exact.phase_margin, rel=2e-3)
    assert codes(found) == {"beyond_nyquist"}


@pytest.mark.parametrize(
    ("core", "limit"), [(ct.tf([1.5], [1, -1]), 2 / 3), (ct.tf([-0.8], [1, 1]), 1.25)]
)
def test_a_loop_that_is_lost_at_frequency_zero(core, limit):
    # it said 3.08 and 19.9
    loop = core * cr.delay(0.3)
    found = cr.design.margins(loop)
    assert found.gain_margin == pytest.approx(limit, rel=1e-9)
    assert cr.design.margins(core).gain_margin == pytest.approx(limit, rel=1e-9)
    for gain in (0.99 * limit, 1.01 * limit):
        assert ct.feedback(gain * loop).is_stable() == ((gain < limit) == (limit > 1))


def test_data_of_an_unstable_plant_need_the_number_of_its_poles():
    hertz = np.geomspace(1e-3, 20, 400)
    frf = cr.MeasuredFRF((ct.tf([1.5], [1, -1]) * cr.delay(0.3))(2j * np.pi * hertz), hertz)
    with pytest.raises(cr.errors.DataError, match=r"unstable_poles=0.* 1 unstable poles"):
        cr.design.margins(frf)
    assert cr.design.margins(frf, unstable_poles=1).stable


def test_response_data_of_an_unstable_loop_are_called_unstable(valve, pi_controller):
    plant = valve(37)
    omega = np.geomspace(0.05, 0.99 * np.pi / DT, 500)
    for gain, stable in ((0.5, True), (2.4, True), (2.6, False)):
        pi = pi_controller(gain, 0.2)
        assert cr.design.margins(plant, pi).stable == stable
        loop = cr.MeasuredFRF((plant * pi)(np.exp(1j * omega * DT)), omega / (2 * np.pi))
        assert cr.design.margins(loop).stable == stable


@pytest.mark.parametrize(
    ("gain", "points", "noise"),
    [(0.5, 60, 0.01), (0.5, 250, 0.02), (1.5, 60, 0.05), (1.5, 120, 0.2), (2.3, 80, 0.05)],
)
def test_intervals_of_measured_margins_cover_the_truth(valve, pi_controller, gain, points, noise):
    """From clean data to noise in which the loop crosses the unit circle many times."""
    plant, pi = valve(37), pi_controller(gain, 0.2)
    truth = cr.design.margins(plant, pi)
    omega = np.geomspace(1.0, 200.0, points)
    clean = plant(np.exp(1j * omega * DT))
    rng = np.random.default_rng(3)
    std = noise * np.abs(clean)
    names = ("gain_margin", "phase_margin", "delay_margin", "modulus_margin")
    asked, hits = dict.fromkeys(names, 0), dict.fromkeys(names, 0)
    for _ in range(50):
        errors = rng.standard_normal((2, omega.size)) * std / np.sqrt(2)
        values, hertz = clean + errors[0] + 1j * errors[1], omega / (2 * np.pi)
        data = cr.MeasuredFRF(values, hertz, std=std, sample_time=DT)
        found = cr.design.margins(data, pi)
        for name, (low, high) in found.intervals.items():
            asked[name] += 1
            hits[name] += low <= getattr(truth, name) <= high
    for name in names:
        # No delay margin of a loop that noise makes unstable. Binomial(50, 0.95) is below 43
        # once in 90, and the intervals are a little wide; the seed is fixed.
        assert asked[name] >= (30 if name == "delay_margin" else 50)
        assert hits[name] >= 0.86 * asked[name], (name, hits)


def test_intervals_of_faint_noise_are_those_of_the_derivative(valve, pi_controller):
    plant, pi = valve(37), pi_controller(0.5, 0.2)
    omega = np.geomspace(1.0, 200.0, 400)
    clean = plant(np.exp(1j * omega * DT))

    def measured(values, **more):
        hertz = omega / (2 * np.pi)
        return cr.design.margins(cr.MeasuredFRF(values, hertz, sample_time=DT, **more), pi)

    found = measured(clean, std=1e-4 * np.abs(clean))
    step = 1e-5
    larger, later = measured(clean * (1 + step)), measured(clean * np.exp(1j * step))
    for name in ("gain_margin", "phase_margin", "delay_margin"):
        value = getattr(found, name)
        slopes = [(getattr(moved, name) - value) / step for moved in (larger, later)]
        expected = 1.96 * 1e-4 / np.sqrt(2) * np.hypot(*slopes)
        low, high = found.intervals[name]
        # 8 %: the disks are looked at at frequencies that lie 6 % further from each other.
        assert high - value == pytest.approx(expected, rel=0.08), name
        assert value - low == pytest.approx(expected, rel=0.08), name


def test_crossings_that_rounding_makes_near_nyquist_do_not_hide_the_gain_margin():
    valve = cr.bench.valve()
    plant = cr.delayed_ss(valve.truth.core, dead_time=37 * valve.dt, dt=valve.dt)
    loop = plant * (8 * ct.ss(ct.tf([1 + valve.dt / 0.075, -1], [1, -1], valve.dt)))
    found = cr.design.margins(loop)
    omega = np.geomspace(1, 100, 2000)
    gain_margin = ct.stability_margins(ct.frd(loop(np.exp(1j * omega * valve.dt)), omega))[0]
    assert np.all(np.isfinite(found.gain_margins))
    assert found.gain_margin == pytest.approx(gain_margin, rel=1e-5)  # interpolation of the FRD


def test_the_first_crossover_of_a_dead_time_far_longer_than_the_lag_is_found():
    # sampled by 1/1000 of its dead time, exp(-s) / (1e-4 s + 1) is a delay of 1001 samples
    for unit in (1.0, 1e7):
        model = cr.design.ProcessModel(gain=0.5, lag=1e-4 * unit, dead_time=unit)
        found = cr.design.margins(model.system(1e-3 * unit))
        assert found.phase_crossovers[0] * unit == pytest.approx(np.pi / 1.001, rel=1e-6)
        plant = ct.tf(model.transfer_function()) * cr.delay(unit)
        found = cr.design.margins(plant)
        assert found.phase_crossovers[0] * unit == pytest.approx(np.pi / (1 + 1e-4), rel=1e-8)


@pytest.mark.parametrize(("dead_time", "stable"), [(0.1, False), (0.108, True), (1.5035, False)])
def test_a_resonance_far_above_the_other_gain_is_counted(dead_time, stable):
    # 0.003 below the resonance, -1.5j at it: towards -1 if 210 tau is pi / 2 and whole turns
    core = ct.tf([0.003 * 210**2], [1, 2e-3 * 210, 210**2]) * ct.tf([1], [1e-4, 1])
    plant = core * cr.delay(dead_time)
    assert ct.feedback(plant).is_stable() is stable
    assert cr.design.margins(plant).stable is stable
    assert cr.design.margins(core, dead_time=dead_time).stable is stable


def test_the_delay_margin_of_a_model_in_minutes_is_in_minutes():
    # samples of one minute: as many minutes as samples
    plant = cr.delayed_ss(ct.tf([2.0], [1200.0, 1]), dead_time=300.0, dt=60.0, time_unit="min")
    pid = cr.design.pid(plant)
    apart, at_once = cr.design.margins(plant, pid), cr.design.margins(plant * pid)
    said = f"{apart.delay_margin_samples:.4g} min = {apart.delay_margin_samples:.4g} samples"
    cards = [apart.report(), at_once.report(), pid.check.margins.report(), apart._repr_html_()]
    assert [said in card for card in cards] == [True] * 4
    hz = np.geomspace(1e-5, 5e-3, 200)
    frf = cr.MeasuredFRF(plant(np.exp(2j * np.pi * hz * 60.0)), hz)
    assert " min" in cr.design.margins(frf, pid).report()


def test_cards_of_a_loop_in_minutes_have_no_seconds():
    plant = cr.delayed_ss(ct.tf([2.0], [1200.0, 1]), dead_time=300.0, dt=60.0, time_unit="min")
    pid = cr.design.pid(plant)
    predictor = cr.design.smith_predictor(plant, pid)
    found = [
        cr.design.delay_robustness(plant, pid, (240.0, 360.0)),
        cr.design.predictor_lqr(plant, 1.0, 1.0),
        cr.design.to_continuous(plant),
        cr.design.ultimate(plant),
        predictor.check,
        predictor,
    ]
    for card in found:
        assert " min" in card.report(), card
        assert not re.search(r"[1-9]\d* s\b", card.report()), card
    for card in (plant, ct.feedback(plant * pid), predictor):
        assert "5 min" in card._repr_html_(), card


@pytest.mark.parametrize(
    ("lag", "gain"), [(86400.0, 1e-5), (7200.0, 1e-4), (86400.0, 1.0), (1.0, 1e9)]
)
def test_margins_do_not_depend_on_the_units_of_time_and_gain(lag, gain):
    """SciPy's conversion to state space leaves out the zero of the first three plants."""

    def plant(T, K):
        return ct.tf([-2 * T * K, K], (np.poly1d([T, 1]) ** 4).c)

    slow, plain = plant(lag, gain), plant(1.0, 1.0)
    omega = np.array([0.1, 1.0, 3.0])
    exact = slow(1j * omega / lag) * np.exp(-0.1j * omega)
    late = slow * cr.delay(0.1 * lag)
    sampled = cr.delayed_ss(slow, dead_time=0.1 * lag, dt=0.01 * lag)
    np.testing.assert_allclose(late(1j * omega / lag), exact, rtol=1e-12)
    # behind a hold; what is folded back falls with the third power of (3 / 628)
    held = exact * (1 - np.exp(-0.01j * omega)) / (0.01j * omega)
    np.testing.assert_allclose(sampled(np.exp(0.01j * omega)), held, rtol=1e-5)
    found = [
        cr.design.margins(G, cr.design.pid(G * cr.delay(L)), dead_time=L)
        for G, L in ((slow, 0.1 * lag), (plain, 0.1))
    ]
    # a rule is applied to the plant sampled finely, which costs digits: 7e-4
    assert found[0].modulus_margin == pytest.approx(found[1].modulus_margin, rel=2e-3)
    assert found[0].delay_margin / lag == pytest.approx(found[1].delay_margin, rel=2e-3)


@pytest.mark.parametrize("dt", [0.0, 6e-5])
def test_margins_of_lags_in_parallel_are_those_of_the_lags_in_series(dt):
    # residues cancel: far above the lags the response of the sum is rounding of its terms
    rates = np.array([1, 1.3, 1.7, 2.2, 2.9, 3.7]) if dt else 1 + np.arange(6) / 100
    residues = [p * np.prod([q / (q - p) for q in rates if q != p]) for p in rates]
    parallel = ct.ss(np.diag(-rates), np.ones((6, 1)), [residues], 0)
    series = ct.tf([np.prod(rates)], np.poly(-rates))
    found = []
    for core in (parallel, series):
        plant = cr.delayed_ss(core, dead_time=0.003, dt=dt) if dt else core * cr.delay(0.003)
        check = cr.design.margins(plant, cr.design.PIDController(0.4, 2.0, dt=dt))
        found.append([check.ms, check.gain_margin, check.phase_margin, check.delay_margin])
        omega = np.geomspace(0.01, 1, 5)
        found[-1].extend(cr.design.unwrapped_phase(plant, omega))
    # residues of 1e9, of lags 1 % apart, leave seven digits of the gain, 0.1 at the last frequency
    np.testing.assert_allclose(found[0], found[1], rtol=1e-9 if dt else 1e-5)


def test_sample_times_that_differ_by_rounding_are_one():
    """They were refused as `dt = 0.1 s and dt = 0.1 s`; sums and products of systems take them."""
    plant, late = (
        cr.delayed_ss(ct.tf([1.0], [1.0, 1.0]), dead_time=0.5, dt=dt) for dt in (0.1, 0.1 + 1e-13)
    )
    pi = cr.design.PIDController(0.8, 1.0, dt=0.1)
    # a sample time that is longer by 1e-12 of itself moves no margin by more than its rounding
    assert cr.design.margins(late, pi).ms == pytest.approx(
        cr.design.margins(plant, pi).ms, rel=1e-9
    )
