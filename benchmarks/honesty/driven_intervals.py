"""What reports an interval from other records: moving inputs, sines, frequency responses."""

from __future__ import annotations

from unittest.mock import patch

import control as ct
import numpy as np

import ctrl_realize as cr
from ctrl_realize.identification.validation import delay_estimates

from .step_intervals import view_coverage
from .trial import Seen, inside, quietly
from .worlds import DRIVEN_DT, DrivenCase, driven_case, noise_of, rounded

LENGTH = 180
"""Lags, after which the response has fallen to a ten-thousandth."""
PERIOD = 500
LAGS_HZ = np.array([0.8, 4.0])
"""Of the plant of `driven_case`."""
METHODS = ("regularized", "least_squares", "okid")


def pulses(kind: str, plant: str, noise: float, seed: int) -> Seen:
    """Part of the Markov parameters within 1.96 std of the plant's, three methods."""
    case = driven_case(kind, noise, seed, samples=2500, held=3)
    truth = np.ravel(case.plant.markov(LENGTH))
    covered = {}
    with quietly():
        for method in METHODS:
            found = cr.impulse_from_io(case.record, LENGTH, method=method)
            hit = np.abs(found.markov - truth) <= 1.96 * found.std
            covered[f"impulse_from_io, {method}: -+ 1.96 std, lags"] = float(np.mean(hit))
    return Seen("pulses", kind, plant, noise, seed, covered)


def any_input(kind: str, plant: str, noise: float, seed: int) -> Seen:
    """fit_output_error and compare_delay_estimates behind an input that moves all the time."""
    case = driven_case(kind, noise, seed)
    truth = case.delay * DRIVEN_DT
    with quietly():
        model = cr.fit_output_error(case.record)
        # The check would fit the same record once more.
        with patch.object(delay_estimates, "fit_output_error", lambda record: model):
            check = cr.validation.compare_delay_estimates(case.record)
    fit = model.fit
    reach = 1.96 * fit.std_given_structure
    near = (fit.dead_time - reach, fit.dead_time + reach)
    covered = {
        "fit_output_error, moving input: interval": inside(fit.interval, truth),
        "fit_output_error, moving input: -+ 1.96 std": inside(near, truth),
    }
    for name, value in view_coverage(check, truth).items():
        covered[f"{name}, moving input"] = value
    numbers = {"disagree": float(not check.agree)}
    return Seen(
        "any input", kind, plant, noise, seed, covered, numbers, [f.code for f in fit.flags]
    )


def joined(kind: str, plant: str, noise: float, seed: int) -> Seen:
    """One fit of three records behind moving inputs."""
    delay = float(np.random.default_rng([seed, 8]).uniform(5, 12))
    cases = [driven_case(kind, noise, 3 * seed + i, samples=600, delay=delay) for i in range(3)]
    with quietly():
        fit = cr.fit_output_error([case.record for case in cases]).fit
    truth = delay * DRIVEN_DT
    reach = 1.96 * fit.std_given_structure
    near = (fit.dead_time - reach, fit.dead_time + reach)
    covered = {
        "fit_output_error, three records of moving input: interval": inside(fit.interval, truth),
        "fit_output_error, three records of moving input: -+ 1.96 std": inside(near, truth),
    }
    flags = [flag.code for flag in fit.flags]
    return Seen("joined", kind, plant, noise, seed, covered, {}, flags)


def controller() -> ct.StateSpace:
    return ct.ss(ct.tf([1.0, -0.97], [1.0, -1.0], DRIVEN_DT))


def multisine(kind: str, noise: float, seed: int) -> tuple[DrivenCase, cr.MeasuredFRF]:
    """One record of eight periods and one more before them, and its frequency response."""
    rng = np.random.default_rng([seed, 3])
    lines = np.unique(np.round(np.geomspace(1, 120, 45)).astype(int))
    k = np.arange(PERIOD)
    phases = rng.uniform(0, 2 * np.pi, lines.size)
    one = np.cos(2 * np.pi * np.outer(k, lines) / PERIOD + phases).sum(axis=1)
    case = driven_case(kind, noise, seed, signal=np.tile(one, 9))
    return case, cr.spectral_frf(case.record, period=PERIOD)


def responses(kind: str, plant: str, noise: float, seed: int) -> Seen:
    """The points of a response from eight periods, and the margins of a loop with it."""
    with quietly():
        case, frf = multisine(kind, noise, seed)
        margins = cr.design.margins(frf, controller())
    covered = {"spectral_frf, 8 periods: circles of the points": frf_coverage(frf, case.plant)}
    exact = cr.design.margins(case.plant, controller())
    for name, ends in margins.intervals.items():
        covered[f"margins of a measured response: {name}"] = inside(ends, getattr(exact, name))
    return Seen("responses", kind, plant, noise, seed, covered)


def response_fits(kind: str, plant: str, noise: float, seed: int) -> Seen:
    """The fit of a response from eight periods."""
    with quietly():
        case, frf = multisine(kind, noise, seed)
        fit = cr.fit_frf(frf, dt=DRIVEN_DT, hold="zoh").fit
    truth = case.delay * DRIVEN_DT
    reach = 1.96 * fit.std_given_structure
    near = (fit.dead_time - reach, fit.dead_time + reach)
    covered = {
        "fit_frf: interval": inside(fit.interval, truth),
        "fit_frf: -+ 1.96 std": inside(near, truth),
    }
    if fit.order == 2:
        # the first is the slow one, of both
        found = np.abs(np.asarray(fit.poles) / (-2 * np.pi) - LAGS_HZ) * 2 * np.pi
        for name, off, std in zip(("slow", "fast"), found, fit.pole_std, strict=True):
            covered[f"fit_frf, {name} pole where two are found: -+ 1.96 std"] = float(
                off <= 1.96 * std
            )
    flags = [flag.code for flag in fit.flags]
    return Seen("response fits", kind, plant, noise, seed, covered, flags=flags)


def frf_coverage(
    frf: cr.MeasuredFRF, exact: cr.DelayedStateSpace, lines: slice = slice(None)
) -> float:
    """Part of the points whose circle of 95 % holds the plant."""
    z = np.exp(2j * np.pi * np.asarray(frf.frequency_hz) * DRIVEN_DT)
    off = np.abs(np.ravel(frf.complex) - np.ravel(exact(z)))
    return float(np.mean((off <= np.ravel(frf.circle()))[lines]))


def noise_spectra(kind: str, plant: str, noise: float, seed: int) -> Seen:
    """Circles of a response from Welch's method on random input."""
    rng = np.random.default_rng([seed, 4])
    case = driven_case(kind, noise, seed, signal=rng.standard_normal(12_000))
    with quietly():
        frf = cr.spectral_frf(case.record, segment=1024, delay=round(case.delay))
    found = frf_coverage(frf, case.plant, slice(2, 300))
    covered = {"spectral_frf, segments: circles of the points": found}
    return Seen("noise spectra", kind, plant, noise, seed, covered)


def sines(kind: str, plant: str, noise: float, seed: int) -> Seen:
    """Circles of a stepped-sine response, from five repeats and from the misfit of one."""
    rng = np.random.default_rng([seed, 6])
    exact = driven_case(kind, noise, seed).plant
    frequencies = np.geomspace(0.3, 20, 12)
    sweep = [[_sine(kind, exact, f, noise, rng) for _ in range(5)] for f in frequencies]
    covered = {}
    with quietly():
        for label, records in (("five repeats", sweep), ("no repeats", [s[:1] for s in sweep])):
            frf = cr.stepped_sine_frf(records, settle=0.0)
            covered[f"stepped_sine_frf, {label}: circles of the points"] = frf_coverage(frf, exact)
    return Seen("sines", kind, plant, noise, seed, covered)


def _sine(
    kind: str, plant: cr.DelayedStateSpace, hz: float, noise: float, rng: np.random.Generator
) -> cr.Record:
    """Steady sine through the plant; `noise` is a part of the output's span at low frequency."""
    k = np.arange(400)
    omega = 2 * np.pi * hz * DRIVEN_DT
    start = rng.uniform(0, 2 * np.pi)
    response = complex(np.ravel(plant(np.exp(1j * omega)))[0])
    y = abs(response) * np.sin(omega * k + start + np.angle(response))
    bent = y + 0.1 * y**2 if kind == "wrong structure" else y
    y = bent + 2 * noise * noise_of(kind, k.size, rng)
    y = rounded(y, 2.0) if kind == "quantised" else y
    return cr.Record(DRIVEN_DT * k, np.sin(omega * k + start), y)
