"""A frequency response that contradicts a model is told, and where."""

from __future__ import annotations

import control as ct
import numpy as np
import pytest

import ctrl_realize as cr
from ctrl_realize import report

F = np.geomspace(0.1, 20, 60)
S = 2j * np.pi * F
PLANT = ct.tf([2.0], [0.05, 1.0])
MODEL = cr.delayed_ss(PLANT, dead_time=0.02, dt=0.001)


def measured(response, **beside):
    return cr.MeasuredFRF(response, F, **beside)


def exact(scale=1.0):
    return scale * PLANT(S) * np.exp(-0.02 * S)


def codes(comparison):
    return [flag.code for flag in comparison.flags]


def test_a_response_that_the_model_follows_is_no_objection():
    found = cr.compare_frf(MODEL, measured(exact()))
    assert codes(found) == []
    assert report.verdict_of(MODEL, found.flags).level == "good"


@pytest.mark.parametrize(("scale", "code"), [(1.1, "frf_differs"), (1.5, "frf_disagrees")])
def test_a_gain_that_is_off_is_told(scale, code):
    assert codes(cr.compare_frf(MODEL, measured(exact(scale)))) == [code]


def test_the_band_in_which_the_model_is_off_is_named():
    # a second lag that the model lacks shows from 2 Hz on: |1 + 0.1 s| = 1.2 at 1 Hz
    comparison = cr.compare_frf(MODEL, measured(exact() / (1 + 0.1 * S)))
    (flag,) = comparison.flags
    assert flag.code == "frf_disagrees"
    off = comparison.frequency_hz[comparison.relative_error > 0.2]
    assert f"from {off[0]:.4g} Hz to {off[-1]:.4g} Hz" in str(flag)


def test_noise_of_the_response_is_no_disagreement():
    rng = np.random.default_rng(3)
    clean = exact()
    std = 0.08 * np.abs(clean)
    noise = std * (rng.standard_normal((F.size, 2)) @ [1, 1j]) / np.sqrt(2)
    assert codes(cr.compare_frf(MODEL, measured(clean + noise, std=std))) == []
    # without its deviation nobody knows that it is noise
    assert codes(cr.compare_frf(MODEL, measured(clean + noise))) == ["frf_differs"]


def test_a_contradiction_is_the_first_line_of_the_verdict():
    comparison = cr.compare_frf(MODEL, measured(exact(1.5)))
    more = [cr.results.Flag("delay_at_bound", "try a larger one"), *comparison.flags]
    verdict = report.verdict_of(MODEL, more)
    assert verdict.level == "poor"
    assert "contradicts" in verdict.judgement
    assert "contradicts" in verdict.reasons[0]


def test_the_response_of_the_motor_contradicts_the_model_of_its_step(shared_data):
    folder = shared_data / "dc_motor_tacho"
    system = cr.identify(cr.read_record(folder / "up.csv"))
    comparison = cr.compare_frf(system, cr.read_frf(folder / "frf.csv"))
    verdict = report.verdict_of(system, comparison.flags)
    assert verdict.level == "poor"
    assert "measured frequency response contradicts" in verdict.reasons[0]
    assert f"{100 * comparison.rms_relative_error:.3g} %" in verdict.reasons[0]
