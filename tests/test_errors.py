"""What cannot be answered is refused: one table by the class of the error, with its words."""

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
from ctrl_realize.identification import ProcessStructure
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
LATE = LAG * cr.delay(0.3)
INTEGRAL = ct.tf([1, 0.5], [1, 0])
PI = ct.ss([[1.0]], [[1.0]], [[0.02]], [[0.4]], 0.1)
VALVE = cr.delayed_ss(PI, 3)
LOOP = ct.feedback(VALVE, 0.1)
AT_ONCE = [
    cr.delayed_ss(PI, 0, name="P", inputs="u", outputs="y"),
    ct.ss([], [], [], 2.5, 0.1, name="K", inputs="y", outputs="u"),
]
WIDE = cr.delayed_ss(ct.ss(0.5 * np.eye(2), np.eye(2), np.eye(2), np.zeros((2, 2)), 0.1), 300)
BETWEEN = np.linspace(0, 1, 11)
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


def form(name, **options):
    return cr.design.PIDController(1.7, 40.0, 6.0, 0.6).as_form(name, **options)


def tracker(model=TWO_STATES, **options):
    return cr.DelayTracker(model, **{"max_delay": 40, "forgetting_time": 20.0, **options})


ERRORS = {
    OrderError: [
        (lambda: fit(structures=[(2, 3)]), "1 <= relative degree <= order"),
        (lambda: realize(order=26), "1 <= order <= 24"),
        (lambda: realize(np.zeros(50)), "rank of the data after 0 samples is 0; .*pure gain"),
        (lambda: realize(np.eye(60)[5], 6), "rank of the data after 0 samples is 5"),
        (lambda: scan(600), "order=600"),
        (lambda: scan(2), "rank of the data after 0 samples is 1"),
        (lambda: cr.scan_orders(PULSE, [1, 700], max_delay=50, dt=TS), "order=700"),
        (lambda: ProcessStructure("P4D"), "0 to 3 lags"),
        (lambda: ProcessStructure("P1DU"), "at least 2 with U"),
        (lambda: ProcessStructure("P1DZ"), "fewer zeros than poles"),
    ],
    DelayRangeError: [
        (lambda: scan(max_delay=5000), "max_delay=5000 needs more than 5001 samples"),
        (lambda: realize(delay=60), "delay=60 needs more than 61 samples"),
        (lambda: realize(delay=5, samples=50), "need 56 samples.*has 50"),
        (lambda: cr.identify(STEP, method="paper", max_delay=5000), "need 6001 samples"),
        (lambda: tracker(max_delay=0), "only one candidate"),
        (lambda: tracker(forgetting_time=0.05), "forgetting_time"),
        (lambda: cr.delay(-0.1), ">= 0"),
        (lambda: cr.delay(0.25, 0.1), r"2.5 samples.*to_discrete"),
        (lambda: cr.delayed_ss(LAG, -1, dt=TS), "delay=-1"),
        (lambda: cr.delayed_ss(LAG, 2.5, dt=TS), "fractional"),
        (lambda: cr.delayed_ss(LAG, dead_time=-0.1, dt=TS), ">= 0"),
        (lambda: cr.delayed_ss(PI, dead_time=0.15), "needs a whole number"),
        (lambda: cr.delayed_ss(PI, 10**8), "at most 10000000"),
        (lambda: cr.delayed_ss(PI, [1, 2]), "1 input"),
        (lambda: cr.DelaySystem(PI, [-1]), ">= 0"),
        (lambda: cr.DelaySystem(PI, [2.5]), "2.5 samples.*whole"),
        (lambda: cr.DelaySystem(PI, [1e9]), "at most"),
    ],
    NoStepError: [
        (lambda: cr.detect_step(QUIET), "no step"),
        (lambda: cr.identify(cr.Record(T, 1.0 * (T > 39.85), DRIVEN.output)), "after it"),
    ],
    UnsuitableSystemError: [
        (lambda: VALVE / VALVE, "is not proper"),
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
        (lambda: cr.design.pid("plant"), "linear system, .*; got a str"),
        (lambda: cr.design.pid(ct.tf([1, 1], [1])), "PID controller needs a proper system"),
        (lambda: cr.delayed_ss(ct.tf([1, 1], [1]), dt=0.1), "needs a proper system"),
        (lambda: cr.design.pid(GROWING), "unstable"),
        (lambda: cr.design.pid(IPDT, "imc"), "not for integrating"),
        # systems with dead time, and what python-control cannot make of them
        (lambda: cr.delayed_ss(LAG, 3), "give dt"),
        (lambda: cr.delayed_ss("valve", 3), "is a str"),
        (lambda: cr.delayed_ss(1 + LAG, dead_time=0.15, dt=0.1), "jumps"),
        (lambda: cr.DelayedStateSpace(ct.ss(LAG), 3), "sample time"),
        (lambda: cr.DelaySystem(PI, [1, 2]), "2 delays"),
        (lambda: cr.DelaySystem(ct.tf(PI), [1]), "ct.ss converts"),
        (lambda: ct.feedback(cr.delayed_ss(PI, 0), -2.5), "algebraic loop"),
        (lambda: ct.feedback(1 + LATE, -1), "algebraic loop"),
        (lambda: cr.interconnect(AT_ONCE, inplist="P.u", outlist="P.y"), "algebraic loop"),
        (
            lambda: ct.feedback(VALVE, ct.ss(PI.A, PI.B, PI.C, PI.D, 0.2)),
            "different time bases: dt = 0.1 s and dt = 0.2 s",
        ),
        (lambda: VALVE + LAG, "time bases.*continuous.*to_discrete"),
        (lambda: LATE * DISCRETE, "continuous and dt = 0.1|dt = 0.1 s and continuous"),
        (lambda: 1 / cr.delayed_ss(LAG, 3, dt=0.1), "not proper"),
        (lambda: LATE**-1, "not proper"),
        (lambda: cr.delay(1.0) / ct.tf([0.7], [0.2, 1]), "not proper"),
        (lambda: ct.tf([2], [3, 1]) * cr.delay(1.3) / ct.ss(-1, 1, 1, 0), "not proper"),
        (lambda: VALVE + ct.tf([1, 0], [1], 0.1), "more zeros than poles"),
        (lambda: ct.tf([1, 0], [1]) * cr.delay(1.0), "proper"),
        (lambda: VALVE + np.nan, "non-finite"),
        (lambda: cr.interconnect([PI, "plant"]), "str"),
        (lambda: VALVE + np.complex128(1j), "complex"),
        (lambda: ct.feedback(WIDE, np.eye(2)).zeros(), "602 states.*400 at most.*longer sample"),
        (lambda: LATE.A, "no|not have.*pade"),
        (lambda: ct.step_response(LATE, T), r"step_response of python-control.*sys\.step_resp"),
        (lambda: ct.feedback(ct.ss(INTEGRAL), LATE), r"feedback of python-.*cr\.interconnect"),
        (lambda: ct.margin(LATE), r"ct\.margin\(1 \* P\)"),
        (lambda: ct.gangof4_response(LATE, INTEGRAL), r"gangof4_resp.*cr\.design\.gang_of_four"),
        (lambda: ct.sisotool(INTEGRAL * LATE), r"sisotool.*cr\.design\.root_locus"),
        (lambda: INTEGRAL * ct.feedback(LATE), r"P \* C.*cr\.DelaySystem\(ct\.ss\(C\)\)"),
        (lambda: LATE.step(10), r"step_response\(timepts\)"),
        (lambda: ct.feedback(LAG * cr.delay(1e-7)).step_response(BETWEEN), "shortest delay"),
        # design functions
        (
            lambda: cr.design.smith_predictor(ct.tf([1], [1, 0]) * cr.delay(1.0), 0.1),
            "pole at s = 0.*to_discrete",
        ),
        (lambda: cr.design.smith_predictor(ct.feedback(LATE), INTEGRAL), "internal delays"),
        (lambda: cr.design.smith_predictor(LATE, PI), "continuous controller"),
        (lambda: cr.design.smith_predictor(LATE, -10 * INTEGRAL), "does not stabilize"),
        (lambda: cr.design.lqg(LATE, 1.0, 1.0, 1.0, 1.0), r"sys\.to_discrete"),
        (
            lambda: cr.design.pid(ct.feedback(LATE)),
            "internal delays.*dead time at the input or output",
        ),
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
        (lambda: VALVE.simulate(np.ones((2, 5))), r"\(1, N\)"),
        (lambda: fit_frf(cr.MeasuredFRF(FRF.complex, np.r_[1e-50, F[1:]])), "span a ratio of"),
        (lambda: LATE.forced_response(BETWEEN + 1, BETWEEN), "increase from 0"),
        (lambda: LATE.forced_response(BETWEEN, np.ones(5)), r"\(1, 11\)"),
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
        (lambda: tracker(forgetting_time=1e308), "expected at most"),
        (lambda: cr.design.margins(DISCRETE, dead_time=0.3), "discrete"),
        (lambda: cr.design.margins(LAG, dead_time=-1.0), ">= 0"),
        (lambda: cr.design.pid(FOPDT, "simk"), "rule='simk'"),
        (lambda: cr.design.pid(FOPDT, "lambda", "PID"), "has no PID; available: PI"),
        (lambda: cr.design.pid(FOPDT, "simc", closed_loop_time=-1.0), "closed_loop_time=-1"),
        (lambda: cr.design.pid(FOPDT, "optimal", max_sensitivity=1.0), "max_sensitivity=1"),
        (lambda: cr.design.pid(FOPDT, "simc", max_sensitivity=1.2), "argument of 'optimal', not"),
        (lambda: cr.design.predictor_lqr(VALVE, -np.eye(1), 1), "eigenvalue of -1"),
        (lambda: WIDE * VALVE.append(VALVE).append(VALVE), r"\(2, 2\) and \(3, 3\)"),
        (lambda: cr.delay("long"), "finite number"),
        (lambda: cr.delayed_ss(LAG, dead_time=np.nan, dt=TS), "finite"),
        (lambda: cr.delayed_ss(LAG, 1, dead_time=0.1, dt=TS), "one of them"),
        (lambda: cr.delayed_ss(LAG, 1, dt=-1.0), "positive sample time"),
        (lambda: cr.delayed_ss(PI, 1, dt=0.2), "sample time"),
        (lambda: VALVE.markov(0), ">= 1"),
        (lambda: cr.design.smith_predictor(cr.DelaySystem(ct.ss(LAG)), INTEGRAL), "no dead time"),
        (lambda: cr.design.delay_robustness(LATE, INTEGRAL), "dead_time_interval="),
        (lambda: cr.design.to_discrete(LATE, 0.1, 0.1), "that already has one"),
        (lambda: cr.design.margins(LOOP, dead_time=0.1), "discrete loop"),
        (lambda: form("simatic"), "siemens_pid_compact"),
        (lambda: form("labview_pid", time_unit="s"), "times in min"),
        (lambda: form("ideal", time_unit="week"), "time_unit"),
        (lambda: form("series", measured_range=(3, 1)), "lower end first"),
        (lambda: ProcessStructure("P2DX"), "'P2DX'; expected a pair"),
        (lambda: ProcessStructure("P1D", fixed={"Tz": 1}), "parameters of"),
        (lambda: ProcessStructure("P1", fixed={"Td": 1}), "parameters of P1"),
        (lambda: ProcessStructure("P1D", fixed={"lag_1": -1}), "0...inf"),
        (lambda: ProcessStructure("P1D", bounds={"lag_1": (3, 2)}), "expected low < high"),
        (
            lambda: ProcessStructure("P1D", fixed={"Kp": 1}, bounds={"gain": (0, 2)}),
            "fixed and bounded",
        ),
        (lambda: fit(structures=["P1D", (2, 2)]), "pairs and names"),
    ],
    cr.CtrlRealizeError: [
        (lambda: fit_frf(3.0), "float"),
        (lambda: fit_frf(order=1, dt=1e70), "use a shorter dt"),
        (lambda: cr.DelayedStateSpace(PI, 10**200), "at most 10000000|is larger than"),
        (lambda: cr.delayed_ss(PI, dead_time=1e199), "at most 10000000"),
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
