"""How one record or several are fitted, with fits that are written by hand."""

from __future__ import annotations

from dataclasses import dataclass, field
from types import SimpleNamespace

import control as ct
import numpy as np
import pytest

import ctrl_realize as cr
from ctrl_realize.errors import DataError
from ctrl_realize.identification import delay_fit
from ctrl_realize.identification.delay_fit import _fit_mean, _fit_one
from ctrl_realize.numerics.separable_fit import Structure
from ctrl_realize.results import Flag
from tests import rigs

DT = 0.1


def record(name="", n=120, amplitude=2.0, delay=7.3, seed=0, **labels):
    """A step at 4 s into a lag of 1 s with a gain of 3, in noise."""
    time = DT * np.arange(n)
    u = amplitude * (np.arange(n) >= 40)
    y = amplitude * rigs.exact_step(ct.tf([3.0], [1.0, 1.0]), time - 4.0 - delay * DT)
    noise = 0.02 * np.random.default_rng(seed).standard_normal(n)
    return cr.Record(time, u, y + noise, name=name, **labels)


@dataclass(frozen=True)
class Result:
    dead_time: float = 0.25
    dt: float = DT
    poles: object = "poles"
    flags: tuple = ()
    repeatability: object = None


@pytest.fixture
def fits(monkeypatch):
    """In the place of fits a result of 0.25 s and a lag of 1 s with gain 3; what was asked."""
    set_up = SimpleNamespace(asked=[], stepped=lambda record: ("edge",))

    def way(name):
        def fit(given, limit, settings):
            set_up.asked.append((name, given, limit, settings))
            return Result(flags=(Flag("own", "x"),)), f"fit of {name}"

        return fit

    def core(fit, poles):
        assert poles == "poles"
        assert fit.startswith("fit of ")
        return ct.ss([[-1.0]], [[1.0]], [[3.0]], [[0.0]])

    for name in ("_fit_one", "_fit_mean", "fit_any_input"):
        monkeypatch.setattr(delay_fit, name, way(name))
    monkeypatch.setattr(delay_fit, "fitted_core", core)
    monkeypatch.setattr(delay_fit, "_edges", lambda record: set_up.stepped(record))
    return set_up


def test_one_record_gives_a_sampled_system_with_its_names(fits):
    one = record("valve.1", input_labels=["i"], output_labels=["x"])
    system = cr.fit_delay(one)
    ((way, given, limit, settings),) = fits.asked
    assert (way, given, limit) == ("_fit_one", one, None)
    assert (settings["structures"], settings["huber"], settings["whiten"]) == (None, True, True)
    assert system.fit == Result(flags=(Flag("own", "x"),))
    assert (system.name, system.input_labels, system.output_labels) == ("valve_1", ["i"], ["x"])
    # a lag of 1 s behind 2.5 samples: 3 (1 - e^(-k DT)) at k = 0.5, 1.5, ...
    response = np.cumsum(np.ravel(system.markov(6)))
    expected = 3 * -np.expm1(-DT * np.clip(np.arange(6) - 2.5, 0.0, None))
    np.testing.assert_allclose(response, expected, atol=1e-12)


def test_a_nameless_record_gives_a_system_with_a_name_of_python_control(fits):
    assert cr.fit_delay(record()).name.startswith("sys")


def test_options_reach_the_fit(fits):
    known = ct.tf([1.0], [0.5, 1.0])
    cr.fit_delay(
        record(),
        structures=[(2, 1)],
        max_delay=30,
        known=known,
        loss="least_squares",
        noise="white",
    )
    ((_, _, limit, settings),) = fits.asked
    assert limit == 30.0
    assert settings["structures"] == (Structure(2, 1),)
    assert (settings["huber"], settings["whiten"]) == (False, False)
    np.testing.assert_allclose(settings["known"].poles, [-2.0], rtol=1e-12)


def test_known_dynamics_are_in_the_model_where_they_are_asked_for(fits):
    known = ct.tf([2.0], [0.5, 1.0])
    without = cr.fit_delay(record(), known=known)
    put_in = cr.fit_delay(record(), known=known, include_known=True)
    assert (without.delay_free.nstates, put_in.delay_free.nstates) == (1, 2)
    assert np.real(without.dcgain()) == pytest.approx(3.0, rel=1e-12)
    assert np.real(put_in.dcgain()) == pytest.approx(6.0, rel=1e-12)
    none = cr.fit_delay(record(), include_known=True)
    assert np.real(none.dcgain()) == pytest.approx(3.0, rel=1e-12)


def test_several_step_records_are_averaged_and_any_others_fitted_one_by_one(fits):
    several = (record("a"), record("b", seed=1))
    system = cr.fit_delay(several, max_delay=9)
    assert fits.asked[0][:3] == ("_fit_mean", several, 9.0)
    assert [flag.code for flag in system.fit.flags] == ["own"]
    assert system.name == "a"
    fits.stepped = lambda given: ("edge",) if given.name == "a" else ()
    cr.fit_delay(list(several))
    assert fits.asked[1][:3] == ("fit_any_input", several, None)


def test_records_that_came_twice_are_flagged_beside_what_the_fit_flags(fits):
    system = cr.fit_delay([record("a"), record("b")])
    assert [flag.code for flag in system.fit.flags] == ["own", "same_records"]


@pytest.fixture
def numerics(monkeypatch):
    """In the place of the numerics what each was asked; data of edge 3 in 10 samples."""
    set_up = SimpleNamespace(
        asked=[],
        data=SimpleNamespace(motion="moves", output=np.zeros(10), edge=3, dt=DT),
        relaxing=False,
        apart=[()],
        steps=(SimpleNamespace(dt=DT),) * 4,
    )

    def fit(data, *, latest, **settings):
        assert data is set_up.data
        set_up.asked.append(("fit", latest, settings))
        return SimpleNamespace(
            fitted="fitted", delay=0.7, poles="poles", relaxing=set_up.relaxing, widened=False
        )

    def mean(steps, skip):
        assert steps is set_up.steps
        set_up.asked.append(("mean", skip))
        used = tuple(i for i in range(4) if i not in skip)
        return SimpleNamespace(output=np.zeros(10), input=np.ones(10), dt=DT, edge=3, used=used)

    def repeats(steps, mean, model, delay, own):
        assert steps is set_up.steps
        assert (model, delay) == ("fitted", 0.7)
        set_up.asked.append(("repeats", own))
        return f"repeats of {mean.used}"

    def own(data, poles):
        assert data is set_up.data
        return f"own of {poles}"

    def widened(fit, repeats, used):
        assert repeats == f"repeats of {used}"
        return SimpleNamespace(**{**vars(fit), "widened": True})

    def outliers(repeats, used):
        assert repeats == f"repeats of {used}"
        return set_up.apart.pop(0)

    def flags(data, fit, limit):
        assert data is set_up.data
        return (("flags", fit.widened, limit),)

    def step_data(output, signal, dt, edges):
        set_up.asked.append(("data", output.sum(), signal.sum(), dt, edges))
        return set_up.data

    stubs = {
        "fit_output_error": fit,
        "mean_step": mean,
        "aligned_steps": lambda records: set_up.steps,
        "repeatability": repeats,
        "own_regressors": own,
        "widened": widened,
        "delay_outliers": outliers,
        "fit_flags": flags,
        "repeat_flags": lambda repeats: (f"flags of {repeats}",),
        "step_data": step_data,
        "summarise": lambda fit, data, time, records, flags: Summary(
            fit, data, time, records, flags
        ),
    }
    for name, stub in stubs.items():
        monkeypatch.setattr(delay_fit, name, stub)
    return set_up


@dataclass(frozen=True)
class Summary:
    fit: object
    data: object
    time: object
    records: object
    flags: tuple = field(default=())
    repeatability: object = None


def test_one_step_record_is_fitted_up_to_its_largest_delay(numerics, monkeypatch):
    monkeypatch.setattr(delay_fit, "_step_data", lambda record: numerics.data)
    one = record()
    result, fit = _fit_one(one, 30.0, {"huber": True})
    assert numerics.asked == [("fit", 30.0 * one.dt, {"huber": True})]
    assert result.fit is fit
    assert result.data is numerics.data
    np.testing.assert_array_equal(result.time, one.time)
    assert result.records == (one,)
    assert result.flags == (("flags", False, 30.0),)
    _fit_one(one, None, {})
    assert numerics.asked[-1] == ("fit", None, {})


def test_one_record_that_is_no_step_is_any_input(monkeypatch):
    monkeypatch.setattr(delay_fit, "_step_data", lambda record: None)
    monkeypatch.setattr(delay_fit, "fit_any_input", lambda *args: args)
    one = record()
    assert _fit_one(one, 30.0, {"huber": True}) == ((one,), 30.0, {"huber": True})


def test_the_mean_of_records_is_fitted_once_where_none_lies_apart(numerics):
    result, fit = _fit_mean(("a", "b"), 30.0, {"huber": True})
    assert numerics.asked == [
        ("mean", ()),
        ("data", 0.0, 10.0, DT, [(3, 1)]),
        ("fit", 30.0 * DT, {"huber": True}),
        ("repeats", "own of None"),
    ]
    assert fit.widened
    assert result.repeatability == "repeats of (0, 1, 2, 3)"
    assert result.flags == (("flags", True, 30.0), "flags of repeats of (0, 1, 2, 3)")
    assert (result.fit, result.data, result.records) == (fit, numerics.data, ("a", "b"))
    np.testing.assert_allclose(result.time, DT * np.arange(-3, 7), rtol=1e-15)
    numerics.apart = [()]
    _fit_mean(("a", "b"), None, {})
    assert numerics.asked[6] == ("fit", None, {})


def test_records_that_lie_apart_are_left_out_and_the_rest_is_fitted_again_once(numerics):
    numerics.apart = [(1, 3), (0,)]
    numerics.relaxing = True
    result, _ = _fit_mean((), None, {})
    assert [entry for entry in numerics.asked if entry[0] in ("mean", "repeats")] == [
        ("mean", ()),
        ("repeats", "own of poles"),
        ("mean", (1, 3)),
        ("repeats", "own of poles"),
    ]
    assert result.repeatability == "repeats of (0, 2)"


def test_a_mean_that_stays_at_rest_is_refused(numerics):
    numerics.data.motion = None
    with pytest.raises(DataError, match="mean of the records"):
        _fit_mean((), None, {})


def test_one_lag_is_found_in_one_record_and_in_four():
    lag = {"structures": [(1, 1)]}
    one = cr.fit_delay(record(), **lag).fit
    assert one.delay == pytest.approx(7.3, abs=4 * one.std / DT)
    several = [record(str(seed), seed=seed) for seed in range(4)]
    four = cr.fit_delay(several, **lag).fit
    # half the standard error, but that noise is estimated
    assert four.std == pytest.approx(one.std / 2, rel=0.3)
    assert four.delay == pytest.approx(7.3, abs=4 * four.std / DT)
    assert four.time[40] == 0.0
    apart = cr.fit_delay([*several, record("late", delay=7.9, seed=9)], **lag).fit
    assert apart.repeatability.outlying == ("late",)
    assert apart.dead_time == pytest.approx(four.dead_time, abs=2 * four.std)
