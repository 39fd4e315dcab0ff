"""What is of the wrong kind, masked, complex or not finite is refused in our words everywhere."""

import control as ct
import numpy as np
import pytest

import ctrl_realize as cr
from ctrl_realize.errors import CtrlRealizeError, DataError, OptionError, UnsuitableSystemError
from tests.rigs import step_record

KINDS = [None, True, -1, 1.5, float("nan"), "x", b"x", [], {}, np.ones(3), object(), 1j]
RECORD = step_record(noise=1e-3, seed=1, before=150, after=500)
STEP = cr.unit_step(RECORD)
PLANT = cr.delayed_ss(ct.ss(0.9, 1, 0.1, 0, 0.1), 3)
PID = cr.design.PIDController(2.0, 10.0, dt=0.1)
FREQUENCY = np.geomspace(0.05, 4, 20)
FRF = cr.MeasuredFRF(np.ravel(PLANT(np.exp(0.2j * np.pi * FREQUENCY))), FREQUENCY)

MAIN = {
    "detect_step": lambda odd: cr.detect_step(odd),
    "unit_step": lambda odd: cr.unit_step(odd),
    "unit_step, edge": lambda odd: cr.unit_step(RECORD, odd),
    "impulse_from_step": lambda odd: cr.impulse_from_step(odd),
    "identify": lambda odd: cr.identify(odd),
    "identify, scan": lambda odd: cr.identify(odd, method="scan"),
    "fit_output_error": lambda odd: cr.fit_output_error(odd),
    "compare_delay_estimates": lambda odd: cr.validation.compare_delay_estimates(odd),
    "analyse_residuals": lambda odd: cr.validation.analyse_residuals(PLANT, odd),
    "analyse_residuals, system": lambda odd: cr.validation.analyse_residuals(odd, RECORD),
    "impulse_from_io": lambda odd: cr.impulse_from_io(odd),
    "spectral_frf": lambda odd: cr.spectral_frf(odd),
    "stepped_sine_frf": lambda odd: cr.stepped_sine_frf(odd),
    "fit_frf": lambda odd: cr.fit_frf(odd),
    "impulse_from_frf": lambda odd: cr.impulse_from_frf(odd, 0.1, length=20),
    "compare_frf": lambda odd: cr.compare_frf(odd, FRF),
    "identify_campaign": lambda odd: cr.identify_campaign(odd),
    "DelayTracker": lambda odd: cr.DelayTracker(odd, max_delay=5, forgetting_time=10.0),
    "read_record": lambda odd: cr.read_record(odd),
    "load_model": lambda odd: cr.load_model(odd),
    "from_response": lambda odd: cr.Record.from_response(odd),
    "verdict_of": lambda odd: cr.report.verdict_of(odd),
    "write_campaign": lambda odd: cr.report.write_campaign("a.html", odd),
    "write_comparison": lambda odd: cr.report.write_comparison("a.html", PLANT, FRF, odd),
    "write_comparison, frf": lambda odd: cr.report.write_comparison("a.html", PLANT, odd, None),
    "write_identification, controller": lambda odd: cr.report.write_identification(
        "a.html", PLANT, RECORD, controller=odd
    ),
    "write_identification, comparison": lambda odd: cr.report.write_identification(
        "a.html", PLANT, RECORD, comparison=odd
    ),
    "delayed_ss, name": lambda odd: cr.delayed_ss(PLANT.delay_free, 3, name=odd),
    "delay, name": lambda odd: cr.delay(1.0, name=odd),
    "DelaySystem, name": lambda odd: cr.DelaySystem(PLANT.delay_free, name=odd),
    "pid, name": lambda odd: cr.design.pid(PLANT, name=odd),
    "smith_predictor, name": lambda odd: cr.design.smith_predictor(PLANT, 0.1, name=odd),
}
HAVE_DEFAULTS = {  # or any text for a name
    "unit_step, edge": [None],
    "write_identification, controller": [None],
    "write_identification, comparison": [None],
    **{name: [None, "x"] for name in MAIN if name.endswith(", name")},
}


@pytest.mark.parametrize("name", MAIN)
def test_what_is_no_record_response_or_system_is_refused(name):
    for odd in KINDS:
        if any(odd is default for default in HAVE_DEFAULTS.get(name, ())):
            continue
        with pytest.raises(CtrlRealizeError):
            MAIN[name](odd)


NO_SENSE = [
    lambda: cr.compare_frf(PLANT, FRF, band_hz=3.0),
    lambda: cr.compare_frf(PLANT, FRF, band_hz=(1.0,)),
    lambda: cr.fit_frf(FRF, band_hz="ab"),
    lambda: cr.fit_frf(FRF, order=10**30),
    lambda: cr.impulse_from_frf(FRF, 0.1, length=10**30),
    lambda: cr.spectral_frf(RECORD, period=10**30),
    lambda: cr.realize(STEP.output, 10**30, dt=0.1),
    lambda: cr.realize(STEP.output, 2, dt=0.1, hankel=np.ones(2)),
    lambda: cr.identify_campaign([RECORD], n_jobs=10**30),
    lambda: cr.identify_campaign([RECORD], method=np.ones(2)),
    lambda: cr.validation.analyse_residuals(PLANT, RECORD, confidence=1e-300),
    lambda: cr.Record([0, 1, 2], [0, 1, 1], [0, 0, 1], input_labels=3),
    lambda: cr.DelayedStateSpace(PLANT, 1, inputs=["a", "b"]),
    lambda: cr.DelayedStateSpace(PLANT, 1, inputs=[1]),
    lambda: cr.DelayedStateSpace(PLANT, 1, outputs=7),
    lambda: PID.algorithm(output_limits=100),
    lambda: PID.algorithm(output_limits=("low", np.inf)),
    lambda: PID.algorithm().simulate(np.ones(3), np.zeros(3), ["auto", "auto", "auto"]),
    lambda: cr.bench.valve_loop().simulate(100, setpoint="ramp"),
    lambda: cr.bench.valve_loop().simulate(100, settle=np.inf),
    lambda: cr.bench.relay_test(PLANT),
    lambda: cr.experiment.achieved(RECORD, RECORD),
    lambda: cr.validation.compare_delay_estimates(frf=RECORD),
]


def test_values_that_make_no_sense_are_refused():
    for call in NO_SENSE:
        with pytest.raises((OptionError, DataError, CtrlRealizeError)):
            call()


DELAYED = ct.tf([2.0], [3.0, 1]) * cr.delay(0.7)
TWO = ct.ss(-np.eye(2), np.eye(2), np.eye(2), 0)
SAYS = {
    "controller is a MeasuredFRF; expected": lambda: cr.design.performance(DELAYED, FRF),
    "controller is a NoneType; expected": lambda: cr.design.performance(DELAYED, None),
    "controller is a str; expected": lambda: cr.design.performance(PLANT, "PI"),
    "needs one input and one output": lambda: cr.design.smith_predictor(DELAYED, TWO),
    "got a NoneType; expected a control.StateSpace": lambda: ct.feedback(PLANT, None),
    "got a complex128; expected a control.StateSpace": lambda: DELAYED.feedback(np.complex128(1j)),
    "got the divisor nan; expected a finite number": lambda: DELAYED / np.nan,
    "got the divisor inf; expected a finite number": lambda: PLANT / np.inf,
    "got the divisor 0.0; expected": lambda: DELAYED / 0.0,
    "got the divisor 0; expected": lambda: PLANT / 0,
    "timepts=nan; expected a finite number": lambda: PLANT.step_response(np.nan),
    "timepts=inf; expected a finite number": lambda: PLANT.impulse_response(np.inf),
    "timepts=-1; expected a value >= 0": lambda: PLANT.step_response(-1),
    "timepts='x'; expected a finite number": lambda: DELAYED.step_response("x"),
    "a system is a float; expected": lambda: cr.interconnect([PLANT, 1.0]),
    "systems is a DelayedStateSpace; expected a list": lambda: cr.interconnect(PLANT),
    "expected a Record, .* got a NoneType": lambda: cr.valves.valve_report(None),
    "rule=3.0; choose one of 'simc'": lambda: cr.design.compare_pid(PLANT, 3.0),
    "rule='imcc'; choose one of 'simc'": lambda: cr.design.pid(PLANT, np.str_("imcc")),
    "rule='itae_load' is for models with a lag": lambda: cr.design.pid(INTEGRATING, "itae_load"),
    "rule='chr_load_0' is for models": lambda: cr.design.pid(INTEGRATING, "chr_load_0"),
    "form=\\[\\]; choose one of 'ideal'": lambda: PID.as_form([]),
    "uncertainty is a .*; expected that of": lambda: cr.design.robust_stability(PLANT, PID),
}
INTEGRATING = ct.tf([1.0], [1, 0]) * cr.delay(0.7)


@pytest.mark.parametrize("words", SAYS)
def test_what_is_wrong_is_said_in_our_words(words):
    with pytest.raises(CtrlRealizeError, match=words):
        SAYS[words]()


def test_one_delay_and_one_rule_need_no_list_and_a_form_no_capitals():
    system = cr.DelaySystem(TWO, 0.3)
    assert system.internal_delays == cr.DelaySystem(TWO, [0.3]).internal_delays == (0.3,)
    assert len(cr.design.compare_pid(PLANT, "simc", "PI").controllers) == 1
    slow = cr.design.PIDController(0.5, 120.0, time_unit="min")
    assert slow.as_form("Ideal").values == slow.as_form("ideal").values


@pytest.mark.parametrize("wrong", [{"td": -1.0}, {"tf": -1.0}])
def test_times_of_a_pid_are_not_negative(wrong):
    with pytest.raises(cr.errors.OptionError, match=r"t[df]=-1"):
        cr.design.PIDAlgorithm(1.0, 10.0, **wrong)


def test_points_of_a_characteristic_are_pairs_whatever_its_kind():
    with pytest.raises(cr.errors.OptionError, match="at least two pairs"):
        cr.actuators.Characteristic("linear", points=(1, 2, 3))


def test_a_filter_slower_than_the_record_is_refused_before_memory_is_given_to_it():
    # 1e-6 Hz of 1280 Hz: 51 GB of zeros before the step
    with pytest.raises(OptionError, match="takes 5e\\+06 s to settle"):
        cr.impulse_from_step(STEP, cutoff_hz=1e-6)


T = 0.1 * np.arange(50)
U = (T > 1).astype(float)
Y = (T > 2).astype(float)


def masked():
    """The last nine samples are masked; below the mask stands 1e20, as netCDF files have it."""
    values = np.where(T > 4.05, 1e20, Y)
    return np.ma.masked_array(values, mask=T > 4.05)


@pytest.mark.parametrize("given", [masked(), [masked()], (masked(),), list(masked())])
def test_masked_samples_are_missing_in_lists_too(given):
    count = int(np.sum(T > 4.05))
    assert cr.Record(T, U, given, missing="keep").n_missing == count
    for make in (
        lambda: cr.Record(T, U, given),
        lambda: cr.Record.resampled(T, U, given),
        lambda: PLANT.simulate(given),
    ):
        with pytest.raises(DataError, match="non-finite"):
            make()


COMPLEX = np.array([1.0, 2.0]) + 1j


@pytest.mark.parametrize(
    "use",
    [
        lambda: PLANT.simulate(COMPLEX),
        lambda: cr.design.predictor_lqr(PLANT, [[1 + 1j]], 1.0),
        lambda: cr.design.kalman_predictor(PLANT, 1.0, [[1 + 1j]]),
        lambda: cr.design.unwrapped_phase(PLANT, COMPLEX),
        lambda: cr.design.uncertainty_bound([1.1 * PLANT], PLANT, COMPLEX),
        lambda: cr.design.ProcessModel(1.0, 1.0, 1.0).step(COMPLEX),
        lambda: cr.design.ProcessModel(1.0 + 1j, 1.0, 1.0),
        lambda: cr.Record(T, U, Y + 1j),
        lambda: cr.ImpulseResponse(Y + 1j, 0.1),
        lambda: cr.MeasuredFRF([1.0, 2.0], COMPLEX),
        lambda: cr.design.margins(PLANT, 1 + 1j),
    ],
)
def test_complex_numbers_where_real_ones_belong_are_refused_not_cut(use):
    with pytest.raises(CtrlRealizeError):
        use()


MEASURED = ct.FrequencyResponseData(np.array([1.0, 0.5, 0.1]), [1.0, 2.0, 3.0])


def broken(dt=0.1):
    """Made by somebody's own computation; python-control lets it pass."""
    system = ct.ss([[0.5]], [[1.0]], [[1.0]], [[0.0]], dt)
    system.A = np.array([[np.nan]])
    return system


def broken_fraction():
    system = ct.tf([1.0], [1.0, -0.5], 0.1)
    system.num[0][0][:] = np.nan
    return system


def test_a_mask_in_a_nested_list_is_seen_in_every_kind_of_response():
    response = np.ma.masked_array([1.0, 1e20, 3.0], [False, True, False])
    for make in (
        lambda: cr.ImpulseResponse([[masked()]], 0.1),
        lambda: cr.realize([[masked()]], 1, dt=0.1),
        lambda: cr.MeasuredFRF([[response]], [1.0, 2.0, 3.0]),
        lambda: cr.design.predictor_lqr(PLANT, [np.ma.masked_array([1e20], True)], 1.0),
    ):
        with pytest.raises(DataError, match="non-finite"):
            make()


def test_a_system_that_is_not_finite_is_refused_in_words():
    D = cr.design
    for use in (
        lambda: D.margins(PLANT, broken()),
        lambda: D.margins(PLANT, broken_fraction()),
        lambda: D.margins(PLANT, float("nan")),
        lambda: D.margins(PLANT, float("inf")),
        lambda: D.margins(broken(0), 1.0),
        lambda: D.margins(ct.frd([np.nan, 1.0, 1.0], [1.0, 2.0, 3.0])),
        lambda: D.margins(MEASURED, broken(0)),
        lambda: D.delay_robustness(PLANT, broken(), (0.1, 0.5)),
        lambda: D.smith_predictor(PLANT, broken()),
        lambda: D.smith_predictor(PLANT, float("nan")),
        lambda: D.performance(PLANT, broken()),
        lambda: D.pid(broken()),
        lambda: D.reduce_fopdt(broken()),
        lambda: D.reduce_fopdt(broken(0)),
        lambda: D.to_tf(broken()),
        lambda: D.to_continuous(broken()),
        lambda: D.to_discrete(broken(0), 0.1, 0.1),
        lambda: D.hankel_singular_values(broken()),
        lambda: cr.delayed_ss(broken(), 3),
        lambda: cr.DelayedStateSpace(broken(), 3),
        lambda: cr.DelayTracker(broken(), max_delay=5, forgetting_time=5.0),
    ):
        with pytest.raises(UnsuitableSystemError, match="non-finite"):
            use()


def test_a_jitter_that_is_no_number_does_not_let_gaps_pass():
    gap = np.delete(T, slice(20, 30))
    for jitter in (float("nan"), float("inf"), -0.1, "a", None):
        with pytest.raises(OptionError, match="max_jitter"):
            cr.Record.resampled(gap, gap, gap, max_jitter=jitter)
