"""What cannot be answered is refused: one table by the class of the error, with its words."""

from __future__ import annotations

import control as ct
import numpy as np
import pytest

import ctrl_realize as cr
from ctrl_realize import bench
from ctrl_realize.errors import (
    DataError,
    DelayRangeError,
    NoStepError,
    OptionError,
    OrderError,
    UnsuitableSystemError,
)
from tests.rigs import TS, TWO_STATES, step_record

T = 0.1 * np.arange(400)
RNG = np.random.default_rng(0)
DRIVEN = cr.Record(T, RNG.standard_normal(400), RNG.standard_normal(400))
QUIET = cr.Record(T, np.zeros(400), RNG.standard_normal(400))
SINE = cr.Record(T / 10, np.sin(2 * T), np.sin(2 * T - 0.1))
STEP = step_record(before=150, after=500)
HOLES = cr.Record(T, DRIVEN.input, np.r_[np.nan, DRIVEN.output[1:]], missing="keep")
NO_INPUT = cr.Record(T, np.r_[np.nan, DRIVEN.input[1:]], DRIVEN.output, missing="keep")
ONES, PULSE = np.ones(50), 0.9 ** np.arange(300)
F = np.linspace(0.2, 4.0, 60)
LAG = ct.tf([1.0], [1.0, 1.0])
FRF = cr.MeasuredFRF(np.ravel(LAG(2j * np.pi * F)), F)
SQUARE = ct.ss(-np.eye(2), np.eye(2), np.eye(2), np.zeros((2, 2)))
DISCRETE = ct.ss(0.5, 1, 1, 0, 0.1)
GROWING = ct.ss(1.2, 1, 1, 0, 0.1)
FOPDT = cr.design.ProcessModel(2.0, 1.0, 0.3)
IPDT = cr.design.ProcessModel(0.5, 0.0, 1.0, integrating=True)


def fit(**options):
    return cr.fit_output_error(STEP, **options)


def realize(pulse=ONES, order=1, **options):
    return cr.realize(pulse, order, **{"dt": 1.0, **options})


def scan(order=1, max_delay=10, pulse=PULSE, **options):
    return cr.estimate_delay(pulse, order, max_delay=max_delay, dt=TS, **options)


def fit_frf(frf=FRF, **options):
    return cr.fit_frf(frf, **options)


def tracker(model=TWO_STATES, **options):
    return cr.DelayTracker(model, **{"max_delay": 40, "forgetting_time": 20.0, **options})


ERRORS = {
    OrderError: [
        (lambda: fit(structures=[(2, 3)]), "1 <= relative degree <= order"),
        (lambda: realize(order=26), "1 <= order <= 24"),
        (lambda: realize(np.zeros(50)), "rank of the data after 0 samples is 0; .*pure gain"),
        (lambda: realize(np.eye(60)[5], 6), "rank of the data after 0 samples is 5"),
        (lambda: scan(600), "order=600"),
        (lambda: scan(2), "rank of the data is 1"),
        (lambda: cr.scan_orders(PULSE, [1, 700], max_delay=50, dt=TS), "order=700"),
    ],
    DelayRangeError: [
        (lambda: scan(max_delay=5000), "max_delay=5000 needs more than 5001 samples"),
        (lambda: realize(delay=60), "delay=60 needs more than 61 samples"),
        (lambda: realize(delay=5, samples=50), "need 56 samples.*has 50"),
        (lambda: cr.identify(STEP, method="paper", max_delay=5000), "need 6001 samples"),
        (lambda: tracker(max_delay=0), "only one candidate"),
        (lambda: tracker(forgetting_time=0.05), "forgetting_time"),
    ],
    NoStepError: [
        (lambda: cr.detect_step(QUIET), "no step"),
        (lambda: cr.identify(cr.Record(T, 1.0 * (T > 39.85), DRIVEN.output)), "after it"),
    ],
    UnsuitableSystemError: [
        (lambda: fit(known=ct.tf([1], [1, -2.0])), r"2\+0j rad/s.*stable"),
        (lambda: fit(known=DISCRETE), "continuous"),
        (lambda: fit(known=3.0), "float"),
        (lambda: fit(known=SQUARE), "2 inputs, 2 outputs"),
        (lambda: fit(known=ct.tf([1, 0, 0], [1, 1])), "more zeros than poles"),
        (lambda: tracker(GROWING), "unstable"),
        (lambda: tracker(ct.ss(-1, 1, 1, 0)), "discrete"),
        (lambda: cr.validation.analyse_residuals("plant", DRIVEN), "a str; expected a discrete"),
        (lambda: cr.validation.analyse_residuals(GROWING, DRIVEN), "unstable"),
        (lambda: cr.design.margins(ct.ss([], [], [], np.eye(2), 0.1)), "2 inputs"),
        (lambda: cr.design.margins(LAG, DISCRETE), "time bases"),
        (lambda: cr.design.margins(ct.tf([1], [1, 0.5], True)), "dt=True"),
        (lambda: cr.design.margins(ct.tf([1, 1, 1], [1, 1])), "improper"),
        (lambda: cr.design.pid("plant"), "discrete system; got a str"),
        (lambda: cr.design.pid(ct.tf([1, 1], [1])), "PID controller needs a proper system"),
        (lambda: cr.delayed_ss(ct.tf([1, 1], [1]), dt=0.1), "needs a proper system"),
        (lambda: cr.design.pid(GROWING), "unstable"),
        (lambda: cr.design.pid(IPDT, "imc"), "not for integrating"),
    ],
    DataError: [
        (lambda: realize(np.r_[np.ones(9), np.nan]), "index 9"),
        (lambda: realize(np.ones((5, 5))), "shape"),
        (lambda: realize(["a", "b", "c"]), "real numbers"),
        (lambda: cr.identify_campaign([]), "no records"),
        (lambda: cr.identify_campaign(["a.csv"]), "records.0. is a str"),
        (lambda: cr.fit_output_error(NO_INPUT), "missing samples in the input: 1.*from_samples"),
        (lambda: cr.detect_step(NO_INPUT), "missing samples in the input: 1"),
        (lambda: cr.unit_step(HOLES), "missing samples in this record: 1.*identify"),
        (lambda: cr.spectral_frf(HOLES), "missing samples in this record: 1"),
        (lambda: cr.stepped_sine_frf([HOLES]), "missing samples in this record: 1"),
        (lambda: cr.validation.predict(TWO_STATES, HOLES, 1), "missing samples in this record: 1"),
        (lambda: cr.validation.analyse_residuals(ct.ss(0.5, 1, 1, 0, 0.2), DRIVEN), "0.2 s"),
        (lambda: cr.design.margins(cr.MeasuredFRF([1.0, 0.5], [1, 2])), "2 points"),
    ],
    OptionError: [
        (lambda: cr.identify(STEP, method="magic"), "'output_error', 'scan', 'paper'"),
        (
            lambda: cr.identify(STEP, method="scan", known=LAG),
            "known: not an argument of method='scan'",
        ),
        (lambda: cr.identify(STEP, order=0), "order=0"),
        (lambda: cr.identify(STEP, order=2, structures=[(1, 1)]), "got both"),
        (lambda: fit(structures=[]), "empty"),
        (lambda: fit(loss="l1"), "choose one of"),
        (lambda: fit(max_delay=-1), "positive"),
        (lambda: realize(order=1.5), "order=1.5"),
        (lambda: realize(delay=-1), "delay=-1"),
        (lambda: realize(hankel="round"), "'square', 'padded'"),
        (lambda: realize(dt=-1.0), "dt=-1"),
        (lambda: realize(cr.data.ImpulseResponse(ONES, 0.5)), "omit dt"),
        (lambda: scan(max_delay=2.5), "max_delay=2.5"),
        (lambda: cr.scan_orders(PULSE, [], max_delay=50, dt=TS), "empty"),
        (lambda: cr.identify_campaign([STEP], ordr=3), "ordr"),
        (lambda: cr.identify_campaign([STEP], n_jobs=0), "n_jobs=0"),
        (lambda: cr.impulse_from_step(cr.unit_step(STEP), cutoff_hz=640.0), "half the sample rate"),
        (lambda: cr.impulse_from_step(cr.unit_step(STEP), filter_order=0), "1...10"),
        (lambda: tracker(forgetting_time=-1.0), "forgetting_time"),
        (lambda: tracker(min_delay=1.5), "min_delay"),
        (lambda: cr.design.margins(DISCRETE, dead_time=0.3), "discrete"),
        (lambda: cr.design.margins(LAG, dead_time=-1.0), ">= 0"),
        (lambda: cr.design.pid(FOPDT, "simk"), "rule='simk'"),
        (lambda: cr.design.pid(FOPDT, "lambda", "PID"), "has no PID; available: PI"),
        (lambda: cr.design.pid(FOPDT, "simc", closed_loop_time=-1.0), "closed_loop_time=-1"),
        (lambda: cr.design.pid(FOPDT, "optimal", max_sensitivity=1.0), "max_sensitivity=1"),
    ],
    cr.CtrlRealizeError: [
        (lambda: fit_frf(3.0), "float"),
        (lambda: fit_frf(order=2, relative_degree=3), "above"),
        (lambda: fit_frf(cr.MeasuredFRF(0 * F, F)), "usable"),
        (lambda: fit_frf(weighting="std"), "no standard deviation"),
        (lambda: fit_frf(hold="zoh"), "needs dt"),
        (lambda: cr.impulse_from_frf(FRF, 0.1, length=2), "length"),
        (lambda: cr.impulse_from_frf(FRF, 0.1, length=80, kernel="RBF"), "'TC'"),
        (lambda: cr.compare_frf(SQUARE, FRF), "2 inputs"),
        (lambda: cr.compare_frf(LAG, FRF, min_coherence=0.9), "no coherence"),
        (lambda: cr.compare_frf(LAG, FRF, band_hz=(60, 70)), "no point"),
        (lambda: cr.compare_frf(ct.ss(0.5, 1, 1, 0, 10.0), FRF), "Nyquist"),
        (lambda: cr.spectral_frf(DRIVEN, method="H3"), "'H1'"),
        (lambda: cr.spectral_frf(DRIVEN, segment=4096), "two"),
        (lambda: cr.spectral_frf(DRIVEN, delay=5000), "leaves no samples"),
        (lambda: cr.spectral_frf(DRIVEN, period=100, skip_periods=-1), "skip_periods"),
        (lambda: cr.stepped_sine_frf([]), "no records"),
        (lambda: cr.stepped_sine_frf([SINE], frequency_hz=[1.0, 2.0]), "1 frequencies"),
        (lambda: cr.stepped_sine_frf([SINE], settle=-1.0), "settle"),
        (lambda: cr.stepped_sine_frf([QUIET]), "constant"),
        (lambda: bench.valve(dead_time=-1e-3), "dead_time"),
        (lambda: bench.valve(noise=float("nan")), "noise"),
        (lambda: bench.valve(anti_aliasing="none"), "linear-phase"),
    ],
}


@pytest.mark.parametrize("error", ERRORS, ids=lambda error: error.__name__)
def test_what_cannot_be_answered_is_refused_with_what_is_needed(error):
    for call, words in ERRORS[error]:
        with pytest.raises(error, match=words):
            call()
