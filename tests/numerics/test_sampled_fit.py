"""The fit of records of any input, step by step, with fits that are by hand."""

from __future__ import annotations

from dataclasses import dataclass, replace
from types import SimpleNamespace

import numpy as np
import pytest

from ctrl_realize.numerics import sampled_fit as module
from ctrl_realize.numerics.sampled_data import cut
from ctrl_realize.numerics.sampled_fit import (
    MORE_LAGS,
    ORDERS,
    SampledFit,
    _explained,
    _first_order,
    _fit,
    _noise_levels,
    _own_delay,
    _seen,
    fit_sampled,
)
from ctrl_realize.numerics.separable_fit import KnownFactor, Structure, evaluate, respond
from ctrl_realize.numerics.structure_search import Candidate, Scales

ONE, TWO, THREE = Structure(1, 1), Structure(2, 2), Structure(3, 3)
DT = 0.5
KNOWN = KnownFactor(np.array([-3.0 + 0j]), np.array([3.0]))
NOTHING = KnownFactor()


def records(*lengths, seed=0):
    rng = np.random.default_rng(seed)
    outputs = [rng.standard_normal(n) for n in lengths]
    return outputs, [rng.standard_normal(n) for n in lengths]


# --- the order of things


@dataclass(frozen=True)
class Likelihood:
    """What the likelihood tells, as it was asked."""

    of: object
    asked: dict
    fitted: np.ndarray
    chain: str = ""
    correlation: float = 1.0
    adequate: bool = True
    misfit: float = 0.0


@dataclass(frozen=True)
class Whole:
    """A fit of all records, of a given order and colour."""

    data: object
    correlation: float = 1.0
    variance: float = 1.0
    order: int = 2
    more: tuple = ()

    @property
    def best(self):
        return SimpleNamespace(structure=Structure(self.order, self.order))

    @property
    def window(self):
        return SimpleNamespace(output=np.zeros(sum(self.data.counts)))


@pytest.fixture
def steps(monkeypatch):
    """Every step is recorded; the first-order model has a delay of 6 s and a lag of 8 s."""
    seen = SimpleNamespace(
        rough=Candidate(ONE, np.array([6.0, np.log(1 / 8)]), 1.0),
        wholes=[Whole],
        fits=[],
        firsts=[],
        levels=[],
        noise=None,
        chain="",
        left=1.0,
    )

    def first_order(problem, n, dt, limit, onsets):
        seen.firsts.append((problem, n, dt, limit, onsets))
        return seen.rough

    def fit(data, known, structures, scales, huber):
        seen.fits.append((data, known, structures, scales, huber))
        make = seen.wholes[min(len(seen.fits), len(seen.wholes)) - 1]
        return make(data)

    def noise_levels(data, whole):
        seen.levels.append((data, whole))
        return np.ones(len(data.counts)) if seen.noise is None else np.array(seen.noise)

    def likelihood_fit(whole, **asked):
        fitted = np.arange(float(sum(whole.data.counts)))
        return Likelihood(whole, asked, fitted, seen.chain, whole.correlation)

    def correlation_time(error):
        seen.error = error
        return seen.left

    monkeypatch.setattr(module, "_first_order", first_order)
    monkeypatch.setattr(module, "_seen", lambda data, limit: ["seen", limit])
    monkeypatch.setattr(module, "_fit", fit)
    monkeypatch.setattr(module, "_noise_levels", noise_levels)
    monkeypatch.setattr(module, "likelihood_fit", likelihood_fit)
    monkeypatch.setattr(module, "correlation_time", correlation_time)
    monkeypatch.setattr(module, "chains_of", lambda whole: ["chains of", whole])
    monkeypatch.setattr(module, "extended", lambda whole, more: replace(whole, more=more))
    monkeypatch.setattr(module, "_explained", lambda whole: ("explained", whole))
    return seen


def test_a_first_order_model_comes_first_without_a_twentieth_of_each_record(steps):
    outputs, inputs = records(200, 119)
    fit_sampled(outputs, inputs, DT)
    ((problem, n, dt, limit, onsets),) = steps.firsts
    assert (n, dt) == (200, DT)
    # a quarter of the longest record
    assert limit == 25.0
    assert onsets == ["seen", 25.0]
    assert problem.drive.starts == (10, 5)
    fit_sampled(outputs, inputs, DT, latest=9.0)
    assert steps.firsts[-1][3] == 9.0
    assert steps.firsts[-1][4] == ["seen", 9.0]


def test_samples_are_left_out_for_one_and_a_half_of_its_delays(steps):
    outputs, inputs = records(200, 31)
    found = fit_sampled(outputs, inputs, DT)
    # 9 s are 18 samples; half of the short record
    assert found.data.starts == (18, 15)
    steps.rough = replace(steps.rough, parameters=np.array([6.1, np.log(1 / 8)]))
    assert fit_sampled(outputs, inputs, DT).data.starts == (19, 15)


def test_its_delay_and_lag_are_the_scales_of_the_search(steps):
    outputs, inputs = records(200, 119)
    fit_sampled(outputs, inputs, DT, known=KNOWN, huber=False)
    data, known, structures, scales, huber = steps.fits[0]
    # what is left of the longer record: 182 samples
    assert scales == Scales(6.0, pytest.approx(8.0), 91.0, DT, 25.0)
    assert (known, structures, huber) == (KNOWN, ORDERS, False)
    assert data.counts == [182, 101]
    assert (
        tuple(Structure(n, r) for n, r in ((1, 1), (2, 2), (2, 1), (3, 3), (3, 2), (3, 1)))
        == ORDERS
    )
    # half a sample and two at least
    steps.rough = Candidate(ONE, np.array([0.1, np.log(1 / 0.3)]), 1.0)
    fit_sampled(outputs, inputs, DT)
    scales = steps.fits[-1][3]
    assert (scales.onset, scales.rise) == (0.25, 1.0)
    fit_sampled(outputs, inputs, DT, structures=[TWO])
    assert steps.fits[-1][2] == (TWO,)
    assert steps.fits[-1][4] is True


def test_records_of_different_noise_are_weighted(steps):
    outputs, inputs = records(200, 119)
    steps.noise = [2.0, 2.6]
    assert fit_sampled(outputs, inputs, DT).data.scales == (1.0, 1.0)
    assert len(steps.fits) == 1
    steps.noise = [2.0, 2.62]
    found = fit_sampled(outputs, inputs, DT)
    assert len(steps.fits) == 3
    # over the mean one, in logarithms
    mean = np.sqrt(1.31)
    assert found.data.scales == pytest.approx((1 / mean, 1.31 / mean))
    assert steps.fits[-1][0] is found.data
    assert steps.fits[-1][1:] == steps.fits[-2][1:]
    assert found.fit.of.data is found.data
    # records come back in their own unit
    first, second = found.fitted
    assert first == pytest.approx(np.arange(182.0) / mean)
    assert second == pytest.approx(np.arange(182.0, 283.0) * 1.31 / mean)


def slow(correlation=3.1, variance=1.0, order=2):
    return lambda data: Whole(data, correlation, variance, order)


def test_slow_disturbances_are_fitted_along_where_they_take_half_of_the_variance(steps):
    outputs, inputs = records(200, 119)
    steps.wholes = [slow(3.1, 2.0), slow(2.0, 0.98)]
    found = fit_sampled(outputs, inputs, DT)
    # ten times 14 s
    assert found.data.period == pytest.approx(140.0)
    assert found.fit.of.variance == 0.98
    assert found.data is steps.fits[1][0]
    assert steps.fits[0][1:] == steps.fits[1][1:]
    # else they are let be
    steps.fits.clear()
    steps.wholes = [slow(3.1, 2.0), slow(2.0, 1.0)]
    found = fit_sampled(outputs, inputs, DT)
    assert found.data.period == np.inf
    assert found.fit.of.variance == 2.0
    # white residuals have none
    steps.fits.clear()
    steps.wholes = [slow(3.0), slow(2.0, 0.1)]
    fit_sampled(outputs, inputs, DT)
    assert len(steps.fits) == 1


def test_periods_of_less_than_forty_samples_are_none_of_slow_disturbances(steps):
    outputs, inputs = records(200)
    steps.wholes = [slow(), slow(2.0, 0.1)]
    # ten times 2 s is forty samples
    steps.rough = Candidate(ONE, np.array([1.0, 0.0]), 1.0)
    assert fit_sampled(outputs, inputs, DT).data.period == pytest.approx(20.0)
    steps.fits.clear()
    steps.rough = Candidate(ONE, np.array([0.999, 0.0]), 1.0)
    assert fit_sampled(outputs, inputs, DT).data.period == np.inf
    assert len(steps.fits) == 1


def test_where_three_poles_are_chosen_more_lags_are_tried(steps):
    outputs, inputs = records(200)
    assert fit_sampled(outputs, inputs, DT).fit.of.more == ()
    steps.wholes = [slow(1.0, order=3)]
    assert (
        fit_sampled(outputs, inputs, DT).fit.of.more
        == MORE_LAGS
        == (
            Structure(4, 4),
            Structure(5, 5),
        )
    )
    assert fit_sampled(outputs, inputs, DT, structures=[THREE]).fit.of.more == ()


def test_the_likelihood_is_asked_with_chains_unless_structures_are_given(steps):
    outputs, inputs = records(200)
    steps.wholes = [slow(3.0, order=3)]
    found = fit_sampled(outputs, inputs, DT).fit
    assert found.asked == {"adequate": True, "chains": ["chains of", found.of]}
    assert fit_sampled(outputs, inputs, DT, structures=[ONE]).fit.asked["chains"] == []
    steps.wholes = [slow(3.01)]
    assert fit_sampled(outputs, inputs, DT).fit.asked["adequate"] is False


def test_a_chain_is_held_against_what_it_leaves_itself(steps):
    outputs, inputs = records(200)
    steps.wholes = [slow(4.0)]
    steps.left = 2.25
    plain = fit_sampled(outputs, inputs, DT)
    assert (plain.fit.correlation, plain.fit.adequate) == (4.0, True)
    # the root of the correlation, for what shows in means over bins
    assert plain.fit.misfit == 2.0
    steps.chain = "chain of 4 nearly equal lags"
    found = fit_sampled(outputs, inputs, DT)
    assert (found.fit.correlation, found.fit.misfit) == (2.25, 1.5)
    assert found.fit.adequate is True
    assert np.array_equal(steps.error, -found.fit.fitted)
    steps.left = 3.0
    assert fit_sampled(outputs, inputs, DT).fit.adequate is True
    steps.left = 3.01
    assert fit_sampled(outputs, inputs, DT).fit.adequate is False


def test_the_answer_has_everything_that_is_asked_of_it_afterwards(steps):
    outputs, inputs = records(200)
    found = fit_sampled(outputs, inputs, DT, known=KNOWN)
    assert found.known is KNOWN
    assert found.explained == ("explained", found.fit.of)
    assert [part.size for part in found.fitted] == [182]
    assert fit_sampled(outputs, inputs, DT).known.poles.size == 0


# --- its steps


def test_a_fit_of_samples_has_no_bins_and_a_least_noise(monkeypatch):
    monkeypatch.setattr(module, "fit_window", lambda *given: given)
    outputs, inputs = records(50, 40)
    outputs[1] *= 1e9
    data = replace(cut(outputs, inputs, DT), scales=(1.0, 1e9), starts=(3, 2))
    window, structures, scales, noise, huber = _fit(data, KNOWN, (TWO,), "scales", False)
    assert (structures, scales, huber) == ((TWO,), "scales", False)
    assert (window.start, window.bins, window.own) == (0, None, None)
    problem = window.problem
    assert window.output is problem.data
    assert window.drive is problem.drive
    assert window.columns is problem.regressors
    assert problem.data.size == 47 + 38
    assert problem.known is KNOWN
    # a ten-thousandth of what moves, or a billionth of that where nothing is left that does
    span = max(np.ptp(problem.data), 1e-9 * np.ptp(outputs[1]))
    assert noise == (pytest.approx(1e-4 * span), 0.0)
    still = np.zeros(50)
    still[0] = 7.0
    spiked = replace(cut([still, np.zeros(40)], inputs, DT), starts=(3, 2))
    noise = _fit(spiked, NOTHING, (ONE,), "scales", True)[3]
    assert noise[0] == pytest.approx(7e-13, rel=1e-9, abs=0)


def test_the_coarsest_of_all_quantisers_counts(monkeypatch):
    monkeypatch.setattr(module, "fit_window", lambda *given: given)
    outputs, inputs = records(300, 300, 300)
    steps = 0.25, 0.5
    rounded = [np.round(y / q) * q for y, q in zip(outputs, steps, strict=False)] + outputs[2:]
    assert _fit(cut(rounded, inputs, DT), NOTHING, (ONE,), "scales", True)[3][1] == 0.5


@pytest.mark.parametrize("unit", [1.0, 1e-3])
def test_noise_is_what_the_best_model_leaves_of_each_record(unit):
    outputs, inputs = records(4000, 3000, 1000)
    data = replace(cut(outputs, inputs, DT), starts=(500, 0, 0))
    scaled = np.concatenate([y[s:] for y, s in zip(data.outputs, data.starts, strict=True)])
    scaled[3500:6500] *= 3.0
    scaled[6500:] = 0.0
    scaled[:3500:100] = 40.0  # spikes hardly count
    scaled *= unit
    seen = []
    model = np.linspace(0.0, 9.0, 7500)

    def predict(problem, best):
        seen.append((problem, best))
        return model

    window = SimpleNamespace(output=scaled + model, predict=predict)
    found = _noise_levels(data, SimpleNamespace(window=window, problem="p", best="b"))
    assert seen == [("p", "b")]
    # known to a standard error of one per cent, and what spikes and clipping add
    assert found[:2] == pytest.approx([unit, 3.0 * unit], rel=0.05)
    # a ten-thousandth of all that moves at least
    assert found[2] == pytest.approx(1e-4 * np.ptp(scaled + model))


def exact(delay=2.3, gain=0.4, lengths=(90, 70), seed=1, lag=5.0):
    """Records of one lag behind a delay, on a level of 3, from their first samples on."""
    _, inputs = records(*lengths, seed=seed)
    parameters = np.array([delay, np.log(1 / lag)])
    rest = cut([np.zeros(n) for n in lengths], inputs, DT)
    model = respond(rest.problem(NOTHING).drive, NOTHING, np.array([gain]), parameters)
    parts = np.split(model, rest.edges[1:-1])
    return [3.0 + part for part in parts], inputs, parameters


def test_what_the_input_explains_is_a_chi_square():
    outputs, inputs, parameters = exact()
    problem = cut(outputs, inputs, DT).problem(NOTHING)
    cost = evaluate(problem, ONE, parameters[None]).cost[0]
    assert cost < 1e-20
    own = problem.own_terms(np.array([[-0.2 + 0j]]))
    squares = np.sum(own.without(problem.data[None, :, None]) ** 2)
    whole = SimpleNamespace(
        problem=problem, best=Candidate(ONE, parameters, 0.25 * squares), variance=0.01
    )
    assert squares > 0.1
    assert _explained(whole) == pytest.approx(0.75 * squares / 0.01)
    whole.variance = 0.0
    assert _explained(whole) > 1e290


def delayed(lags, n=600, seed=0, share=0.3):
    rng = np.random.default_rng(seed)
    u = rng.choice([-1.0, 1.0], n)
    return np.concatenate([np.zeros(lags), u])[:n] + share * rng.standard_normal(n), u


def test_the_output_is_seen_to_follow_the_input():
    outputs, inputs = zip(delayed(20), delayed(30, seed=1), delayed(22, seed=2), strict=True)
    data = cut(list(outputs), list(inputs), DT)
    # in samples; the median of three
    (seen,) = _seen(data, 100.0)
    assert seen == pytest.approx(22, abs=1)
    # within 10.9 s, which are 21 samples, in the first of them alone
    (seen,) = _seen(data, 10.9)
    assert seen == pytest.approx(20, abs=1)


def test_where_nothing_is_seen_nothing_is_guessed():
    outputs, _ = records(300)
    _, u = delayed(1, 300)
    assert _seen(cut(outputs, [u], DT), 50.0) == []
    # an input that stands still, a limit of a single sample
    assert _seen(cut(outputs, [np.ones(300)], DT), 50.0) == []
    late, u = delayed(1, share=0.0)
    assert _seen(cut([late], [u], DT), 0.9) == []
    assert _seen(cut([late], [u], DT), 1.0) == [1.0]
    assert _seen(cut([late], [1e-3 * u], DT), 50.0) == [1.0]
    # what follows at once has no lag
    assert _seen(cut([u], [u], DT), 50.0) == []
    # no further than a third of a short record
    for size, seen in ((57, []), (63, [20.0])):
        late, u = delayed(20, size, share=0.0)
        assert _seen(cut([late], [u], DT), 50.0) == seen, size


def test_a_first_order_model_is_looked_for_from_a_grid_of_delays_and_lags(monkeypatch):
    asked = []

    def search(problem, structures, scales):
        assert problem == "problem"
        assert structures == [ONE]
        asked.append(scales)
        cost = abs(scales.onset - 2.5) + abs(scales.rise - 5.0)
        return {ONE: Candidate(ONE, np.array([scales.onset, scales.rise]), cost)}

    monkeypatch.setattr(module, "search", search)
    best = _first_order("problem", 100, DT, 8.0, [])
    # 1, 5 and 20 samples, not beyond the limit; 2, 10 and 50, not beyond a quarter of the record
    assert sorted({scales.onset for scales in asked}) == [0.5, 2.5, 8.0]
    assert sorted({scales.rise for scales in asked}) == [1.0, 5.0, 12.5]
    assert len(asked) == 9
    assert {(s.length, s.dt, s.latest) for s in asked} == {(50.0, DT, 8.0)}
    assert best.parameters.tolist() == [2.5, 5.0]
    asked.clear()
    _first_order("problem", 100, DT, 8.0, [7.0])
    assert sorted({scales.onset for scales in asked}) == [0.5, 2.5, 3.5, 8.0]
    assert len(asked) == 12


# --- one record against the common model


def common(delay=2.3, gain=0.4, lag=5.0):
    return SimpleNamespace(delay=delay, numerator=np.array([gain]), poles=np.array([-1 / lag + 0j]))


@pytest.mark.parametrize(("shift", "ratio"), [(0.0, 1.0), (0.21, 1.5), (-0.4, 0.7), (0.3, -2.0)])
def test_a_record_of_its_own_delay_and_gain_is_recognised(shift, ratio):
    outputs, inputs, _ = exact(2.3 + shift, 0.4 * ratio, (200,))
    found = _own_delay(cut(outputs, inputs, DT), common(), NOTHING)
    # Gauss-Newton steps end a thousandth of a sample before the next
    assert found.shift == pytest.approx(shift, abs=1e-3 * DT)
    assert found.gain == pytest.approx(ratio, rel=1e-3)
    assert 0 < found.error < 0.05
    assert 0 < found.gain_error < 0.05


def test_a_delay_that_is_its_own_optimum_has_errors_of_rounding():
    outputs, inputs, _ = exact(lengths=(200,))
    found = _own_delay(cut(outputs, inputs, DT), common(), NOTHING)
    assert (found.shift, found.gain) == (pytest.approx(0, abs=1e-9), pytest.approx(1))
    assert 1e-12 * DT <= found.error < 1e-9
    assert 1e-12 <= found.gain_error < 1e-9


def test_a_record_that_stands_still_has_no_gain():
    _, inputs, _ = exact(lengths=(200,))
    found = _own_delay(cut([np.zeros(200)], inputs, DT), common(), NOTHING)
    assert (found.gain, found.shift) == (0.0, 0.0)


def test_standard_errors_are_those_of_many_records():
    outputs, inputs, _ = exact(lengths=(300,))
    sigma = 0.05 * np.std(outputs[0])
    rng = np.random.default_rng(0)
    tries = [
        _own_delay(
            cut([outputs[0] + sigma * rng.standard_normal(300)], inputs, DT), common(), NOTHING
        )
        for _ in range(60)
    ]
    # a standard deviation from 60 values is known to nine per cent, its error to less
    for value, error in (("shift", "error"), ("gain", "gain_error")):
        scatter = np.std([getattr(one, value) for one in tries])
        claimed = np.mean([getattr(one, error) for one in tries])
        assert scatter == pytest.approx(claimed, rel=0.27)
    # the same of a model of twice the gain, which has the same delay
    twice = _own_delay(cut([2 * outputs[0]], inputs, DT), common(), NOTHING)
    assert twice.gain == pytest.approx(2.0)


def test_standard_errors_are_those_of_a_regression():
    outputs, inputs, parameters = exact(lengths=(60,))
    y = outputs[0] + 0.02 * np.random.default_rng(3).standard_normal(60)
    found = _own_delay(cut([y], inputs, DT), common(), NOTHING)
    drive = cut([y], inputs, DT).problem(NOTHING).drive

    def at(delay):
        x = np.array([delay, parameters[1]])
        return respond(drive, NOTHING, np.array([0.4]), x)

    end, h, clock = 2.3 + found.shift, 0.05, DT * np.arange(60)
    slope = (at(end + h) - at(end - h)) / (2 * h)
    columns = np.stack([at(end), slope, clock**0, clock, np.exp(-0.2 * clock)], axis=1)
    weights, (squares,), _, _ = np.linalg.lstsq(columns, y, rcond=None)
    spread = squares / (60 - 5) * np.linalg.inv(columns.T @ columns)
    # the last step is less than a thousandth of a sample; slopes are central differences
    assert found.gain == pytest.approx(weights[0], rel=1e-3)
    assert found.gain_error == pytest.approx(np.sqrt(spread[0, 0]), rel=3e-3)
    assert found.error == pytest.approx(np.sqrt(spread[1, 1]) / weights[0], rel=3e-3)


def test_colour_of_the_noise_is_in_the_standard_errors(monkeypatch):
    outputs, inputs, _ = exact(lengths=(200,))
    data = cut([outputs[0] + 0.01 * records(200)[0][0]], inputs, DT)
    white = _own_delay(data, common(), NOTHING)
    monkeypatch.setattr(module, "correlation_time", lambda left: 4.0)
    slow = _own_delay(data, common(), NOTHING)
    assert (slow.shift, slow.gain) == (white.shift, white.gain)
    assert slow.error == pytest.approx(2 * white.error)
    assert slow.gain_error == pytest.approx(2 * white.gain_error)


@pytest.mark.parametrize("unit", [1e3, 1e-6])
def test_an_own_delay_does_not_depend_on_the_unit_of_time(unit):
    outputs, inputs, _ = exact(2.51, 0.6, (200,))
    y = outputs[0] + 0.01 * records(200)[0][0]
    same = _own_delay(cut([y], inputs, DT), common(), NOTHING)
    model = common(2.3 * unit, 0.4 / unit, 5.0 * unit)
    found = _own_delay(cut([y], inputs, DT * unit), model, NOTHING)
    assert found.shift == pytest.approx(same.shift * unit, rel=1e-6)
    assert found.error == pytest.approx(same.error * unit, rel=1e-6)
    assert (found.gain, found.gain_error) == pytest.approx((same.gain, same.gain_error), rel=1e-6)


@pytest.mark.parametrize("side", [-1, 1])
def test_a_step_of_an_own_delay_is_twenty_samples_at_most(monkeypatch, side):
    monkeypatch.setattr(module, "_TURNS", 1)
    # a lag of 400 samples under one step is nearly a line: 36 samples are told at once
    u = 1.0 * (np.arange(800) >= 60)
    parameters = np.array([40.0 + 18.0 * side, -np.log(200.0)])
    drive = cut([u], [u], DT).problem(NOTHING).drive
    y = respond(drive, NOTHING, np.array([0.4]), parameters)
    found = _own_delay(cut([y], [u], DT), common(40.0, lag=200.0), NOTHING)
    assert found.shift == pytest.approx(10.0 * side, rel=1e-9)


def test_a_delay_is_never_negative():
    outputs, inputs, _ = exact(0.0, lengths=(200,))
    found = _own_delay(cut(outputs, inputs, DT), common(0.2), NOTHING)
    assert found.shift == pytest.approx(-0.2, abs=0.07)


def test_a_record_is_held_against_the_model_like_those_that_were_fitted(monkeypatch):
    seen = []
    monkeypatch.setattr(module, "_own_delay", lambda *given: seen.append(given) or "own")
    fitted = replace(cut(*records(50, 60), DT), starts=(8, 9), period=77.0, scales=(0.5, 2.0))
    whole = SampledFit("fit", fitted, (), 0.0, KNOWN)
    (output,), (signal,) = records(40, seed=5)
    assert whole.own_delay(output, signal) == "own"
    data, fit, known = seen[0]
    assert (fit, known) == ("fit", KNOWN)
    assert data.starts == (9,)
    assert data.scales == (1.0,)
    assert data.dt == DT
    assert data.outputs[0].tolist() == output.tolist()
    assert data.inputs[0] == pytest.approx(signal - signal.mean())
    whole.own_delay(output[:17], signal[:17])
    assert seen[1][0].starts == (8,)


# --- all of it


def test_records_of_different_lengths_with_a_slow_disturbance_are_fitted_together():
    outputs, inputs, _ = exact(lengths=(500, 333), lag=2.0, gain=1.0)
    for i, y in enumerate(outputs):
        y += np.sin(2 * np.pi * np.arange(y.size) / 300 + i)
        y += 0.02 * np.random.default_rng(i).standard_normal(y.size)
    found = fit_sampled(outputs, inputs, DT, structures=[ONE])
    # cosines in one record and the other, as many as half periods of 43 s go into them
    assert np.isfinite(found.data.period)
    assert found.fit.low < 2.3 < found.fit.high
    assert found.fit.delay == pytest.approx(2.3, abs=0.1)
