"""What is of the wrong kind is refused in our words, by whatever function it meets first."""

import control as ct
import numpy as np
import pytest

import ctrl_realize as cr
from ctrl_realize.errors import CtrlRealizeError, DataError, OptionError
from tests.rigs import step_record

KINDS = [None, True, -1, 1.5, float("nan"), "x", b"x", [], {}, np.ones(3), object(), 1j]
RECORD = step_record(noise=1e-3, seed=1, before=150, after=500)
STEP = cr.unit_step(RECORD)
PLANT = cr.delayed_ss(ct.ss(0.9, 1, 0.1, 0, 0.1), 3)
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
    "bootstrap": lambda odd: cr.validation.bootstrap(odd, cr.fit_output_error),
    "DelayTracker": lambda odd: cr.DelayTracker(odd, max_delay=5, forgetting_time=10.0),
    "read_record": lambda odd: cr.read_record(odd),
    "load_model": lambda odd: cr.load_model(odd),
}


@pytest.mark.parametrize("name", MAIN)
def test_what_is_no_record_response_or_system_is_refused(name):
    for odd in KINDS:
        if odd is None and name == "unit_step, edge":
            continue  # the default
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
]


def test_values_that_make_no_sense_are_refused():
    for call in NO_SENSE:
        with pytest.raises((OptionError, DataError, CtrlRealizeError)):
            call()


def test_a_filter_slower_than_the_record_is_refused_before_memory_is_given_to_it():
    # 1e-6 Hz of 1280 Hz: 51 GB of zeros before the step
    with pytest.raises(OptionError, match="takes 5e\\+06 s to settle"):
        cr.impulse_from_step(STEP, cutoff_hz=1e-6)
