"""Which step of the method is asked for what, with steps that are written by hand."""

from __future__ import annotations

from dataclasses import dataclass
from types import SimpleNamespace

import control as ct
import numpy as np
import pytest

import ctrl_realize as cr
from ctrl_realize.errors import DelayRangeError, OptionError
from ctrl_realize.identification import identify as module
from ctrl_realize.identification.identify import _against_noise, _half_risen, fit_records

DT = 0.1
TIME = DT * np.arange(60)
RECORD = cr.Record(TIME, TIME > 2, TIME)
TWO_IN = cr.Record(TIME, np.stack([TIME, -TIME]), TIME)
TWO_OUT = cr.Record(TIME, TIME, np.stack([TIME, -TIME]))
KNOWN = ct.tf([1.0], [0.1, 1.0])


# which way a record goes


@pytest.fixture
def ways(monkeypatch):
    """In the place of every way what it was asked; a fit of a step, unless it is changed."""
    set_up = SimpleNamespace(asked=[], fitted=SimpleNamespace(fit=SimpleNamespace(onset=0.5)))

    def way(name, answer=None):
        def take(*args, **options):
            set_up.asked.append((name, args, options))
            return name if answer is None else answer()

        return take

    monkeypatch.setattr(module, "fit_records", way("fit_records", lambda: set_up.fitted))
    monkeypatch.setattr(module, "unit_step", lambda record: {RECORD: "the step"}[record])
    for name in ("fit_channels", "with_modes_judged", "_paper", "_scan"):
        monkeypatch.setattr(module, name, way(name))
    return set_up


DEFAULTS = {
    "order": None,
    "max_delay": None,
    "known": None,
    "loss": "huber",
    "noise": "auto",
    "structures": None,
    "include_known": False,
}


def test_a_step_is_fitted_with_what_is_given(ways):
    assert cr.identify(RECORD) is ways.fitted
    given = {
        "order": 2,
        "max_delay": 30,
        "known": KNOWN,
        "loss": "least_squares",
        "noise": "white",
        "structures": [(1, 1)],
        "include_known": True,
    }
    assert cr.identify([RECORD, RECORD], **given) is ways.fitted
    assert ways.asked == [
        ("fit_records", (RECORD,), DEFAULTS),
        ("fit_records", ([RECORD, RECORD],), given),
    ]


@pytest.mark.parametrize(
    ("given", "asked"), [({}, False), ({"order": 2}, True), ({"structures": [(1, 1)]}, True)]
)
def test_modes_are_judged_where_the_input_is_no_step(ways, given, asked):
    ways.fitted.fit.onset = float("nan")
    assert cr.identify(RECORD, max_delay=30, **given) == "with_modes_judged"
    assert ways.asked[1] == ("with_modes_judged", (ways.fitted, 30), {"asked": asked})


def test_with_known_dynamics_no_modes_are_judged(ways):
    ways.fitted.fit.onset = float("nan")
    assert cr.identify(RECORD, known=KNOWN) is ways.fitted


@pytest.mark.parametrize("given", [TWO_IN, TWO_OUT, [RECORD, TWO_OUT]])
def test_several_channels_have_a_fit_of_their_own(ways, given):
    assert cr.identify(given) == cr.identify(given, order=3) == "fit_channels"
    assert ways.asked == [("fit_channels", (given, None), {}), ("fit_channels", (given, 3), {})]


FIT_ONLY = {
    "known": KNOWN,
    "structures": [(1, 1)],
    "loss": "least_squares",
    "noise": "white",
    "include_known": True,
}


@pytest.mark.parametrize("name", [*FIT_ONLY, "max_delay"])
def test_several_channels_take_an_order_alone(ways, name):
    given = {**FIT_ONLY, "max_delay": 5}
    with pytest.raises(OptionError, match=f"^{name}: not for records of several channels"):
        cr.identify(TWO_IN, **{name: given[name]})
    assert ways.asked == []


@pytest.mark.parametrize("method", ["scan", "paper"])
@pytest.mark.parametrize("name", FIT_ONLY)
def test_a_scan_takes_nothing_that_is_for_the_fit(ways, method, name):
    with pytest.raises(OptionError, match=f"^{name}: not for method={method!r}"):
        cr.identify(RECORD, method=method, **{name: FIT_ONLY[name]})


@pytest.mark.parametrize(
    ("name", "value"), [("cutoff_hz", None), ("samples", 9), ("feedthrough", False)]
)
def test_the_fit_takes_nothing_that_is_for_a_scan(ways, name, value):
    with pytest.raises(OptionError, match=f"^{name}: not for method='output_error'"):
        cr.identify(RECORD, **{name: value})
    assert ways.asked == []


@pytest.mark.parametrize("method", ["scan", "paper"])
def test_a_scan_is_given_the_step_and_its_choices(ways, method):
    assert cr.identify(RECORD, method=method) == f"_{method}"
    more = {"order": 2, "max_delay": 30, "cutoff_hz": 4.0, "samples": 9, "feedthrough": False}
    cr.identify(RECORD, method=method, **more)
    assert ways.asked == [
        (f"_{method}", ("the step", None, None, "auto", None, None), {}),
        (f"_{method}", ("the step", *more.values()), {}),
    ]
    with pytest.raises(OptionError, match="takes one record"):
        cr.identify([RECORD], method=method)


def test_an_order_stands_for_all_its_relative_degrees(monkeypatch):
    asked = []
    monkeypatch.setattr(module, "fit_delay", lambda *args, **how: asked.append((args, how)))
    fit_records(RECORD, order=3, loss="huber")
    fit_records(RECORD, structures=[(2, 1)])
    fit_records(RECORD, order=8)
    fit_records(RECORD, order=1)
    assert asked[:2] == [
        ((RECORD,), {"structures": [(3, 1), (3, 2), (3, 3)], "loss": "huber"}),
        ((RECORD,), {"structures": [(2, 1)]}),
    ]
    assert [len(how["structures"]) for _, how in asked[2:]] == [8, 1]
    for order in (0, 9, 1.0):
        with pytest.raises(OptionError, match="order="):
            fit_records(RECORD, order=order)
    with pytest.raises(OptionError, match="not both"):
        fit_records(RECORD, order=1, structures=[(1, 1)])


# the scans


@dataclass(frozen=True)
class Fit:
    order: int = 3
    choices: tuple = ()


class Step:
    """A step response by hand."""

    def __init__(self, output, record=None):
        self.output = np.asarray(output, dtype=float)
        self.n_samples = self.output.size
        self.record = record


CORE = ct.ss([[0.5]], [[1.0]], [[1.0]], [[0.0]], DT)
RISING = np.r_[np.zeros(7), np.ones(93)]


@pytest.fixture
def steps(monkeypatch):
    """In the place of every step what it was asked; responses of 100 samples, half up at 7."""
    set_up = SimpleNamespace(
        asked=[],
        impulse=SimpleNamespace(filter="low-pass of 5", n_samples=100),
        floor=0.5,
        model=cr.DelayedStateSpace(CORE, 2, fit=Fit(), name="own"),
    )

    def impulse_from_step(step, **how):
        assert isinstance(step, Step)
        set_up.asked.append(("impulse", how))
        return set_up.impulse

    def estimate_delay(impulse, order, **how):
        assert impulse is set_up.impulse
        set_up.asked.append(("scan", order, how))
        return set_up.model

    def scan_orders(impulse, orders, **how):
        assert impulse is set_up.impulse
        set_up.asked.append(("orders", list(orders), how))
        return SimpleNamespace(
            order=4,
            noise_floor=set_up.floor,
            last_singular_value=lambda order: 0.625 if order == 4 else None,
            system=lambda: set_up.model,
        )

    monkeypatch.setattr(module, "impulse_from_step", impulse_from_step)
    monkeypatch.setattr(module, "estimate_delay", estimate_delay)
    monkeypatch.setattr(module, "scan_orders", scan_orders)
    return set_up


def scanned(step=None, order=None, max_delay=None, cutoff_hz="auto", samples=None, direct=None):
    step = step or Step(RISING)
    return module._scan(step, order, max_delay, cutoff_hz, samples, direct)


def test_a_scan_tries_orders_one_to_five_up_to_half_the_rise(steps):
    system = scanned()
    assert steps.asked == [
        ("impulse", {"cutoff_hz": "auto"}),
        (
            "orders",
            [1, 2, 3, 4, 5],
            {"max_delay": 7, "samples": None, "feedthrough": None},
        ),
    ]
    difference, low_pass, reach, order = system.fit.choices
    assert difference.startswith("backward difference")
    assert low_pass.startswith("filter: low-pass of 5 ")
    assert reach.startswith("delays up to 7 samples tried")
    assert order == (
        "order 4: its last singular value is 1.2 times that of the noise before the step"
    )


def test_a_scan_takes_what_it_is_given(steps):
    system = scanned(None, 2, 0, 4.0, 30, False)
    assert steps.asked == [
        ("impulse", {"cutoff_hz": 4.0}),
        ("scan", 2, {"max_delay": 0, "samples": 30, "feedthrough": False}),
    ]
    assert len(system.fit.choices) == 2
    steps.impulse.filter = None
    assert scanned(max_delay=30).fit.choices[1].startswith("no filter")
    assert steps.asked[-1][2] == {"max_delay": 30, "samples": None, "feedthrough": None}
    assert len(scanned(max_delay=30).fit.choices) == 3
    scanned(samples=40, direct=True)
    assert steps.asked[-1][2] == {"max_delay": 7, "samples": 40, "feedthrough": True}


@pytest.mark.parametrize(
    ("samples", "orders"),
    [(18, [1, 2, 3, 4, 5]), (17, [1, 2, 3, 4]), (12, [1, 2]), (10, [1]), (8, [1]), (5, [1])],
)
def test_few_samples_hold_few_orders(steps, samples, orders):
    # (samples - 1 - 7) / 2 of them
    steps.impulse.n_samples = samples
    scanned()
    assert steps.asked[-1][1] == orders


def test_the_noise_that_an_order_is_held_against_may_be_unknown():
    orders = SimpleNamespace(order=2, noise_floor=0.0, last_singular_value=lambda n: 0.12345 * n)
    assert _against_noise(orders).startswith("0.247, and none fits better")
    orders.noise_floor = 0.1
    assert _against_noise(orders).startswith("2.5 times that of the noise")


def paper(step=None, order=None, max_delay=None, cutoff_hz="auto", samples=None, direct=None):
    step = step or Step(np.ones(1101))
    return module._paper(step, order, max_delay, cutoff_hz, samples, direct)


AS_PRINTED = {"zero_phase": False, "difference": "central"}


def test_the_papers_numbers_are_taken_where_none_are_given(steps):
    system = paper()
    paper(None, 2, 30, None, 40, False)
    assert steps.asked == [
        ("impulse", {"cutoff_hz": 50.0, **AS_PRINTED}),
        ("scan", 3, {"max_delay": 100, "samples": 1000, "feedthrough": True}),
        ("impulse", {"cutoff_hz": None, **AS_PRINTED}),
        ("scan", 2, {"max_delay": 30, "samples": 40, "feedthrough": False}),
    ]
    (told,) = system.fit.choices
    assert told.endswith("low-pass of 5, order 3, 1000 samples, delays 0...100")
    steps.impulse.filter = None
    assert ", no filter, order" in paper().fit.choices[0]


def test_the_papers_numbers_need_their_samples(steps):
    with pytest.raises(DelayRangeError, match="need 1101 samples after the step"):
        paper(Step(np.ones(1100)))
    paper(Step(np.ones(71)), max_delay=30, samples=40)
    with pytest.raises(DelayRangeError, match="the record has 70"):
        paper(Step(np.ones(70)), max_delay=30, samples=40)


def test_a_scan_is_called_by_its_record(steps):
    record = cr.Record(TIME, TIME, TIME, name="a.b", input_labels=["i"], output_labels=["x"])
    system = scanned(Step(RISING, record), 1)
    assert (system.name, system.input_labels, system.output_labels) == ("a_b", ["i"], ["x"])
    assert len(system.fit.choices) == 3
    nameless = scanned(Step(RISING, RECORD), 1)
    assert (nameless.name, nameless.input_labels) == ("own", list(RECORD.input_labels))
    assert scanned(Step(RISING), 1).name == "own"
    assert system.fit.order == 3


# the largest delay


def half_risen(*pieces):
    return _half_risen(Step(np.concatenate(pieces)))


def test_a_step_response_is_half_risen_where_it_first_reaches_half_its_end():
    assert half_risen(np.zeros(20), np.full(80, 2.0)) == 20
    ramp = np.linspace(0.0, 1.0, 51)  # half at 25
    assert half_risen(ramp, np.ones(100)) == 25
    assert half_risen(-ramp, -np.ones(100)) == 25
    assert half_risen(-ramp, np.zeros(9), np.ones(100)) == 60  # an inverse response does not count
    assert half_risen(ramp, 2 * np.ones(100)) == 50
    assert half_risen(3 * ramp, 2 * np.ones(100)) == 17  # of 2, not of the peak: 1 / 0.06


def test_the_end_is_the_median_of_the_last_tenth():
    end = np.full(10, 4.0)
    end[:4] = -50.0
    assert half_risen(np.zeros(20), np.full(30, 1.9), np.full(40, 2.0), end) == 50
    tenth = np.r_[np.full(6, 4.0), np.full(5, -50.0)]  # eleven of 110
    assert half_risen(np.zeros(20), np.full(39, 1.9), np.full(40, 2.0), tenth) == 59
    # of few samples the last three
    few = [0.0, 0.0, 2.1, 2.1, 0.0]
    assert half_risen(np.zeros(4), np.ones(6), np.full(14, 2.1), few) == 10


def test_a_response_that_ends_where_it_began_is_half_risen_at_half_its_peak():
    pulse = np.r_[np.zeros(10), 1.6, 2.4, 4.0, np.zeros(87)]
    assert half_risen(pulse) == half_risen(-pulse) == 11
    # nothing moves: half of the record
    assert half_risen(np.zeros(101)) == 50


def test_something_is_left_behind_the_largest_delay():
    late = np.r_[np.zeros(90), np.ones(10)]
    assert half_risen(late) == 75  # a quarter
    assert half_risen(np.zeros(2), late) == 77  # of 102 samples 25
    assert half_risen(np.zeros(20), np.ones(5)) == 13  # twelve samples
    assert half_risen(np.ones(30)) == 1
    assert half_risen(np.ones(5)) == 1
