"""What the output-error fit asks of records and options, with fits that are written by hand."""

from __future__ import annotations

from dataclasses import dataclass, field
from types import SimpleNamespace

import control as ct
import numpy as np
import pytest

import ctrl_realize as cr
from ctrl_realize.errors import DataError, NoStepError, OptionError, OrderError
from ctrl_realize.identification import delay_fit
from ctrl_realize.identification.delay_fit import (
    _edges,
    _fit_mean,
    _fit_one,
    _holds_between,
    _records,
    _step_data,
    _structures,
)
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


def of_input(values):
    time = DT * np.arange(len(values))
    return cr.Record(time, np.asarray(values, dtype=float), time)


# the options


def test_structures_are_pairs_each_tried_once():
    assert _structures(None) is None
    assert _structures([(2, 1), (1, 1), (2, 1)]) == (Structure(2, 1), Structure(1, 1))
    assert _structures([(8, 8), (8.0, 1)]) == (Structure(8, 8), Structure(8, 1))


@pytest.mark.parametrize("pair", [(9, 1), (9, 9), (2, 3), (2, 0), (0, 0), (2, -1)])
def test_a_relative_degree_lies_between_one_and_the_order(pair):
    with pytest.raises(OrderError, match=r"1 <= relative degree <= order <= 8"):
        _structures([(1, 1), pair])


@pytest.mark.parametrize("pair", [3, (3,), (3, 2, 1), ("a", 1), (None, 1)])
def test_what_is_no_pair_of_numbers_is_no_structure(pair):
    with pytest.raises(OptionError, match="relative_degree"):
        _structures([pair])


# the records


def test_twenty_samples_are_needed():
    assert len(_records(of_input(range(20)))) == 1
    with pytest.raises(DataError, match="19 samples"):
        _records([of_input(range(20)), of_input(range(19))])


def test_an_output_that_moves_by_nothing_is_refused():
    time = np.arange(30.0)
    tiny = np.where(time < 10, 0.0, 1e-70)
    assert len(_records(cr.Record(time, time, tiny))) == 1
    with pytest.raises(DataError, match="does not leave its rest level"):
        _records(cr.Record(time, time, 0.5 * tiny))


def test_several_channels_and_missing_samples_are_refused():
    time = np.arange(30.0)
    for u, y in ((np.stack([time, time]), time), (time, np.stack([time, time]))):
        with pytest.raises(DataError, match="inputs and"):
            _records(cr.Record(time, u, y))
    holes = cr.Record(time, time, np.where(time == 4, np.nan, time), missing="keep")
    with pytest.raises(DataError, match="fit_delay needs every sample"):
        _records(holes)


# what counts as a step experiment


def edge(index, samples=1, amplitude=1.0):
    return SimpleNamespace(index=index, samples=samples, amplitude=amplitude, time=index * DT)


def strays(count, by, where=0):
    """A step of 1 at sample 50 of 101, of which some samples lie beside their level."""
    signal = np.where(np.arange(101) < 50, 0.0, 1.0)
    signal[where : where + count] += by
    return signal


def test_an_input_holds_where_nine_samples_of_ten_do():
    one = [edge(50)]
    # of 101 samples the 0.9 quantile is the eleventh from above
    assert _holds_between(strays(10, 5.0), one)
    assert not _holds_between(strays(11, 5.0), one)
    assert not _holds_between(strays(11, -5.0, 60), one)
    assert _holds_between(strays(11, 0.1999), one)
    assert not _holds_between(strays(11, 0.2001), one)
    assert _holds_between(strays(11, 1.0), [edge(50, amplitude=5.0)])  # just a fifth


def test_an_input_may_stray_by_a_fifth_of_its_largest_edge():
    signal = strays(11, 0.39)
    for up in (2.0, -2.0):
        assert _holds_between(signal, [edge(50, amplitude=up)])
        assert _holds_between(signal, [edge(50, amplitude=up), edge(101, amplitude=0.1)])
    assert not _holds_between(signal, [edge(50, amplitude=-1.9)])


def test_a_ramp_is_no_straying():
    signal = np.clip((np.arange(100) - 49) / 20, 0.0, 1.0)  # up from sample 50 to 69
    assert _holds_between(signal, [edge(50, samples=20)])
    assert not _holds_between(signal, [edge(50, samples=1)])
    # its last sample has arrived: of 50 + 31 samples the ninth from above is the 0.9 quantile
    late = np.where(np.arange(100) < 69, 0.0, 1.0)
    late[80:88] = 5.0
    assert _holds_between(late, [edge(50, samples=20)])
    late[88] = 5.0
    assert not _holds_between(late, [edge(50, samples=20)])
    wild = np.where(np.arange(100) < 50, 0.0, np.arange(100) % 7.0)
    assert _holds_between(wild, [edge(50, samples=60)])  # nothing is left behind the ramp


def test_every_level_between_edges_is_a_level_of_its_own():
    stairs = np.repeat([0.0, 1.0, 3.0, 2.0], 25)
    edges = [edge(25), edge(50, amplitude=2.0), edge(75, amplitude=-1.0)]
    assert _holds_between(stairs, edges)
    assert not _holds_between(stairs, edges[:2])


def test_a_ramp_that_runs_into_the_next_edge_leaves_that_level_alone():
    signal = np.r_[np.zeros(40), np.linspace(0.0, 1.0, 20), np.full(40, 1.0)]
    assert _holds_between(signal, [edge(40, samples=30), edge(60)])


def test_twelve_edges_are_a_step_experiment_and_thirteen_are_none():
    for steps, found in ((12, 12), (13, 0)):
        levels = np.arange(steps + 1) % 2
        assert len(_edges(of_input(np.repeat(levels, 40)))) == found
    rng = np.random.default_rng(0)
    moving = np.repeat([0.0, 4.0], 200) + rng.standard_normal(400)
    assert len(_edges(of_input(moving))) == 0  # an edge, and no level that holds


def test_an_input_that_moves_at_the_very_end_alone_is_no_experiment():
    with pytest.raises(NoStepError):
        _edges(of_input(np.ones(60)))
    late = np.zeros(60)
    late[-1] = 1.0
    with pytest.raises(NoStepError):
        _edges(of_input(late))
    sines = np.sin(np.arange(60.0))
    assert _edges(of_input(sines)) == ()


@pytest.mark.parametrize(("moved", "refused"), [(5, True), (6, False)])
def test_five_samples_at_the_end_say_nothing(monkeypatch, moved, refused):
    def no_step(record):
        raise NoStepError("none")

    monkeypatch.setattr(delay_fit, "detect_step", no_step)
    given = of_input(np.r_[np.zeros(60 - moved), np.ones(moved)])
    if refused:
        with pytest.raises(NoStepError, match="none"):
            _edges(given)
    else:
        assert _edges(given) == ()


@pytest.fixture
def data_by_hand(monkeypatch):
    """Edges and the data that are made of them, as set."""
    set_up = SimpleNamespace(
        edges=[edge(40, 3)], data=SimpleNamespace(motion=SimpleNamespace(crossing=10), sigma=0.25)
    )
    set_up.asked = []

    def step_data(output, signal, dt, edges):
        set_up.asked.append((output.shape, signal.shape, dt, edges))
        return set_up.data

    monkeypatch.setattr(delay_fit, "_edges", lambda record: tuple(set_up.edges))
    monkeypatch.setattr(delay_fit, "step_data", step_data)
    return set_up


def test_the_data_of_a_step_record_are_its_signals_and_edges(data_by_hand):
    assert _step_data(record()) is data_by_hand.data
    assert data_by_hand.asked == [((120,), (120,), record().dt, [(40, 3)])]
    data_by_hand.edges = []
    assert _step_data(record()) is None


def test_an_output_that_stays_at_rest_is_told_with_its_noise_and_the_time_of_the_step(data_by_hand):
    data_by_hand.data.motion = None
    with pytest.raises(
        DataError, match=r"record 'a' .* 5 sigma \(1\.25\) .* after the step at 4 s"
    ):
        _step_data(record("a"))


def test_steps_that_follow_too_fast_are_any_input(data_by_hand):
    # three times the first motion of ten samples
    data_by_hand.edges = [edge(40), edge(70), edge(71)]
    assert _step_data(record()) is data_by_hand.data
    data_by_hand.edges = [edge(40), edge(69)]
    assert _step_data(record()) is None


# one record, several records


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
    assert result == Summary(fit, numerics.data, one.time, (one,), (("flags", False, 30.0),))
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
