"""What reports an interval from other records: moving inputs, sines, frequency responses."""

from __future__ import annotations

import control as ct
import numpy as np

import ctrl_realize as cr

from .step_intervals import view_coverage
from .trial import Seen, inside, quietly
from .worlds import DRIVEN_DT, driven_case, noise_of, rounded

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
    """fit_delay and check_delay behind an input that moves all the time."""
    case = driven_case(kind, noise, seed)
    truth = case.delay * DRIVEN_DT
    with quietly():
        fit = cr.fit_delay(case.record).fit
        check = cr.check_delay(case.record)
    near = (fit.dead_time - 1.96 * fit.std, fit.dead_time + 1.96 * fit.std)
    covered = {
        "fit_delay, moving input: interval": inside(fit.interval, truth),
        "fit_delay, moving input: -+ 1.96 std": inside(near, truth),
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
        fit = cr.fit_delay([case.record for case in cases]).fit
    truth = delay * DRIVEN_DT
    near = (fit.dead_time - 1.96 * fit.std, fit.dead_time + 1.96 * fit.std)
    covered = {
        "fit_delay, three records of moving input: interval": inside(fit.interval, truth),
        "fit_delay, three records of moving input: -+ 1.96 std": inside(near, truth),
    }
    flags = [flag.code for flag in fit.flags]
    return Seen("joined", kind, plant, noise, seed, covered, {}, flags)


def controller() -> ct.StateSpace:
    return ct.ss(ct.tf([1.0, -0.97], [1.0, -1.0], DRIVEN_DT))


def responses(kind: str, plant: str, noise: float, seed: int) -> Seen:
    """One multisine record: its FRF, the fit of that, and the margins of a loop with it."""
    rng = np.random.default_rng([seed, 3])
    lines = np.unique(np.round(np.geomspace(1, 120, 45)).astype(int))
    k = np.arange(PERIOD)
    phases = rng.uniform(0, 2 * np.pi, lines.size)
    one = np.cos(2 * np.pi * np.outer(k, lines) / PERIOD + phases).sum(axis=1)
    case = driven_case(kind, noise, seed, signal=np.tile(one, 9))
    with quietly():
        frf = cr.spectral_frf(case.record, period=PERIOD)
        fit = cr.fit_frf(frf, dt=DRIVEN_DT, hold="zoh").fit
        margins = cr.design.margins(frf, controller())
    z = np.exp(2j * np.pi * np.asarray(frf.frequency_hz) * DRIVEN_DT)
    truth = case.delay * DRIVEN_DT
    near = (fit.dead_time - 1.96 * fit.std, fit.dead_time + 1.96 * fit.std)
    covered = {
        "spectral_frf, 8 periods: std of the points": frf_coverage(frf, np.ravel(case.plant(z))),
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
    exact = cr.design.margins(case.plant, controller())
    for name, ends in margins.intervals.items():
        covered[f"margins of a measured response: {name}"] = inside(ends, getattr(exact, name))
    return Seen("responses", kind, plant, noise, seed, covered, flags=[f.code for f in fit.flags])


def frf_coverage(frf: cr.MeasuredFRF, truth: np.ndarray) -> float:
    """Part of the points within the circle that holds 95 % of a complex normal error."""
    radius = np.sqrt(-np.log(0.05)) * np.ravel(frf.std)
    return float(np.mean(np.abs(np.ravel(frf.complex) - truth) <= radius))


def noise_spectra(kind: str, plant: str, noise: float, seed: int) -> Seen:
    """Std of a response from Welch's method on random input."""
    rng = np.random.default_rng([seed, 4])
    case = driven_case(kind, noise, seed, signal=rng.standard_normal(12_000))
    with quietly():
        frf = cr.spectral_frf(case.record, segment=1024, delay=round(case.delay))
    inner = slice(2, 300)
    z = np.exp(2j * np.pi * np.asarray(frf.frequency_hz) * DRIVEN_DT)
    part = cr.MeasuredFRF(
        np.ravel(frf.complex)[inner],
        np.asarray(frf.frequency_hz)[inner],
        std=np.ravel(frf.std)[inner],
    )
    covered = {
        "spectral_frf, segments: std of the points": frf_coverage(
            part, np.ravel(case.plant(z))[inner]
        )
    }
    return Seen("noise spectra", kind, plant, noise, seed, covered)


def sines(kind: str, plant: str, noise: float, seed: int) -> Seen:
    """Std of a stepped-sine response, from five repeats and from the misfit of one."""
    rng = np.random.default_rng([seed, 6])
    exact = driven_case(kind, noise, seed).plant
    frequencies = np.geomspace(0.3, 20, 12)
    sweep = [[_sine(kind, exact, f, noise, rng) for _ in range(5)] for f in frequencies]
    covered = {}
    with quietly():
        for label, records in (("five repeats", sweep), ("no repeats", [s[:1] for s in sweep])):
            frf = cr.stepped_sine_frf(records, settle=0.0)
            z = np.exp(2j * np.pi * np.asarray(frf.frequency_hz) * DRIVEN_DT)
            covered[f"stepped_sine_frf, {label}: std of the points"] = frf_coverage(
                frf, np.ravel(exact(z))
            )
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
