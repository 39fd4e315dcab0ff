"""Worlds in which flags of step records are due, and worlds in which they are not."""

from __future__ import annotations

from dataclasses import replace
from functools import partial

import control as ct
import numpy as np
from scipy.special import gammainc

import ctrl_realize as cr
from tests import rigs

from .flag_case import Codes, FlagCase, Run, codes
from .worlds import BEFORE, DT, NOISES, PLANTS, step_case, unit_step, wrong_step

LOW, HIGH = NOISES[:2], NOISES[2:]


def _noise(seed: int, levels: tuple[float, ...] = NOISES) -> float:
    return levels[seed % len(levels)]


def _plant(seed: int) -> str:
    return tuple(PLANTS)[seed // 4 % 4]


def plain(seed: int, **options: object) -> cr.Record:
    """White noise of any level on any of the four plants."""
    return step_case("white", _plant(seed), _noise(seed), seed, **options).record


def changed(record: cr.Record, output: np.ndarray) -> cr.Record:
    return cr.Record(record.time, record.input, output)


def _span(record: cr.Record) -> float:
    y = np.ravel(record.output)
    return float(np.mean(y[-50:]) - np.mean(y[:50]))


def fit(record: cr.Record, **options: object) -> Codes:
    return codes(cr.fit_output_error(record, **options).fit)


def ordinary(seed: int) -> Codes:
    return fit(plain(seed))


def coloured(seed: int) -> Codes:
    return fit(step_case("coloured", _plant(seed), _noise(seed), seed).record)


def shaped(shape: np.ndarray, seed: int, noise: float) -> Codes:
    """Fit a step response of any shape."""
    rng = np.random.default_rng([seed, 21])
    k = np.arange(shape.size)
    u = 1.0 * (k >= BEFORE)
    return fit(cr.Record(k * DT, u, 5 + shape + noise * rng.standard_normal(k.size)))


def _clock(delay: float, after: int = 1000) -> np.ndarray:
    return (np.arange(BEFORE + after) - BEFORE - delay) * DT


def wrong(name: str, levels: tuple[float, ...]) -> Run:
    def run(seed: int) -> Codes:
        return shaped(wrong_step(name, _clock(30.0 + seed % 15)), seed, _noise(seed, levels))

    return run


def twelve_lags(seed: int) -> Codes:
    """More equal lags than chains of them are tried for."""
    t = np.clip(_clock(30.0 + seed % 15), 0, None)
    return shaped(gammainc(12, 2 * np.pi * 20.0 * t), seed, _noise(seed, LOW))


def integrating(seed: int) -> Codes:
    t = np.clip(_clock(37.0), 0, None)
    lag = 1 / (2 * np.pi * 5.0)
    return shaped(4 * (t + lag * np.expm1(-t / lag)), seed, _noise(seed))


def unsettled(seed: int) -> Codes:
    """One lag of 2 Hz whose record ends one time constant after the dead time."""
    return fit(step_case("white", "R1", _noise(seed), seed, after=140).record)


def inverse(seed: int) -> Codes:
    t = _clock(37.0)
    slope = np.gradient(rigs.exact_step(rigs.R2, t), DT)
    return shaped(rigs.exact_step(rigs.R2, t) - slope / (2 * np.pi * 5.0), seed, _noise(seed))


def short_rest(seed: int) -> Codes:
    return fit(plain(seed, before=5))


def drifting(seed: int) -> Codes:
    record = plain(seed)
    trend = 0.1 * _span(record) * np.asarray(record.time)
    return fit(changed(record, np.ravel(record.output) + trend))


def moving(seed: int) -> Codes:
    """A step as high came a quarter of a second before the record began."""
    record = step_case("white", _plant(seed), _noise(seed, LOW), seed).record
    earlier = np.asarray(record.time) + 0.25
    left = unit_step(_plant(seed), earlier) - 1
    return fit(changed(record, np.ravel(record.output) + _span(record) * left))


def humming(seed: int) -> Codes:
    """A line at 50 Hz with the amplitude of three standard deviations of the noise."""
    record = plain(seed)
    size = 3 * _noise(seed) * _span(record)
    line = size * np.sin(2 * np.pi * 50 * np.asarray(record.time) + seed)
    return fit(changed(record, np.ravel(record.output) + line))


def loaded(seed: int) -> Codes:
    """A load of 30 % of the step moves long after it, through a lag of 0.1 s."""
    record = plain(seed)
    time = np.asarray(record.time)
    since = np.maximum(time - time[0] - 0.75 * np.ptp(time), 0.0)
    other = -0.3 * _span(record) * np.expm1(-since / 0.1)
    return fit(changed(record, np.ravel(record.output) + other))


def coarse(seed: int) -> Codes:
    """Rounded to steps of five standard deviations of the noise."""
    record = plain(seed)
    quantum = 5 * _noise(seed) * abs(_span(record))
    return fit(changed(record, np.round(np.ravel(record.output) / quantum) * quantum))


def fine(seed: int) -> Codes:
    """Rounded to steps of half a standard deviation of the noise."""
    record = plain(seed)
    quantum = 0.5 * _noise(seed) * abs(_span(record))
    return fit(changed(record, np.round(np.ravel(record.output) / quantum) * quantum))


def spiked(seed: int) -> Codes:
    rng = np.random.default_rng([seed, 22])
    record = plain(seed)
    y = np.array(np.ravel(record.output))
    where = rng.random(y.size) < 0.02
    signs = rng.choice([-1.0, 1.0], int(where.sum()))
    y[where] += 10 * _noise(seed) * abs(_span(record)) * signs
    return fit(changed(record, y))


def repeats(
    seed: int, *, scatter: float = 0.0, trend: float = 0.0, strange: bool = False
) -> list[cr.Record]:
    """Six records of one plant, steps of 16 and 8; delays in samples."""
    rng = np.random.default_rng([seed, 23])
    noise = _noise(seed, LOW)
    records = []
    for i, height in enumerate((16.0, 16.0, 16.0, 8.0, 8.0, 8.0)):
        delay = 37 + scatter * rng.standard_normal() + trend * (height == 8.0)
        if strange and i == 4:
            delay += 25
        case = step_case(
            "white", _plant(seed), noise, 100 * seed + i, delay=delay, amplitude=height
        )
        y = np.ravel(case.record.output) / case.gain
        records.append(cr.Record(case.record.time, case.record.input, y, name=f"r{i}"))
    return records


def together(seed: int, **what: object) -> Codes:
    return codes(cr.fit_output_error(repeats(seed, **what)).fit)


def unlike(
    seed: int, *, gains: tuple[float, ...] = (1, 1, 1), lags: tuple[float, ...] = (1, 1, 1)
) -> list[cr.Record]:
    """Three records of steps of R1 with other gains and time constants."""
    t, records = _clock(37.0), []
    for i, (gain, lag) in enumerate(zip(gains, lags, strict=True)):
        rng = np.random.default_rng([seed, 24, i])
        y = gain * rigs.exact_step(rigs.R1, t / lag)
        noise = _noise(seed, LOW) * rng.standard_normal(t.size)
        k = np.arange(t.size)
        records.append(cr.Record(k * DT, 1.0 * (k >= BEFORE), y + noise, name=f"r{i}"))
    return records


def unlike_fit(seed: int, **what: tuple[float, ...]) -> Codes:
    return codes(cr.fit_output_error(unlike(seed, **what), structures=[(1, 1)]).fit)


def unlike_campaign(seed: int, **what: tuple[float, ...]) -> Codes:
    return codes(cr.identify_campaign(unlike(seed, **what), structures=[(1, 1)]))


def at_an_edge(seed: int) -> Codes:
    """A second lag just so long that one and two lags fit as well, found by bisection."""
    t, rng = np.maximum(_clock(37.0), 0.0), np.random.default_rng([seed, 25])
    noise = _noise(seed) * rng.standard_normal(t.size)
    k = np.arange(t.size)

    def fitted(part: float) -> cr.identification.OutputErrorFit:
        slow = 0.05
        fast = part * slow
        y = 1 - (slow * np.exp(-t / slow) - fast * np.exp(-t / fast)) / (slow - fast)
        record = cr.Record(k * DT, 1.0 * (k >= BEFORE), y + noise)
        return cr.fit_output_error(record, structures=[(1, 1), (2, 2)]).fit

    one, two = 0.001, 0.9
    for _ in range(21):  # to 4e-7, which moves BIC by less than a thousandth
        middle = (one + two) / 2
        one, two = (middle, two) if fitted(middle).order == 1 else (one, middle)
    return codes(fitted(one))


def washed_out(seed: int) -> Codes:
    """A response that dies away again: its gain is nothing."""
    t = np.maximum(_clock(37.0), 0.0)
    return shaped(np.exp(-2 * np.pi * 2.0 * t) - np.exp(-2 * np.pi * 8.0 * t), seed, _noise(seed))


def bounded(seed: int, high: float) -> Codes:
    """Fit two lags of which the slow one, 72 ms in truth, is bounded."""
    asked = cr.identification.ProcessStructure("P2D", bounds={"lag_1": (0.02, high)})
    return fit(step_case("white", "R2", _noise(seed), seed).record, structures=asked)


def forced(seed: int, plant: str, order: int = 1) -> Codes:
    """A number of lags, asked for."""
    # with three lags and less noise the data rule them out, with more the fourth does not show
    case = step_case("white", plant, _noise(seed, LOW) if order == 1 else 0.002, seed)
    return fit(case.record, structures=[(order, order)])


def scan(record: cr.Record, order: int | None = None, **options: object) -> Codes:
    return codes(cr.identify(record, method="scan", order=order, **options).fit)


def plain_scan(seed: int) -> Codes:
    return scan(plain(seed))


def scanned(plant: str, noise: float, order: int, **options: object) -> Run:
    def run(seed: int) -> Codes:
        return scan(step_case("white", plant, noise, seed).record, order, **options)

    return run


def undelayed(seed: int) -> cr.Record:
    return step_case("white", _plant(seed), _noise(seed, HIGH), seed, delay=0.0).record


def humming_scan(seed: int) -> Codes:
    record = plain(seed)
    line = 0.005 * _span(record) * np.sin(2 * np.pi * 50 * np.asarray(record.time) + seed)
    return scan(changed(record, np.ravel(record.output) + line), 8, cutoff_hz=None)


def filtered(zero_phase: bool) -> Run:
    def run(seed: int) -> Codes:
        step = cr.unit_step(plain(seed))
        impulse = cr.impulse_from_step(step, cutoff_hz=50.0, zero_phase=zero_phase)
        return codes(cr.realize(impulse, 1, delay=37).fit)

    return run


def realized(
    plant: ct.TransferFunction, order: int, noise: float, pulse: np.ndarray | None = None
) -> Run:
    """Realize a pulse response with white noise on it (a part of its largest value)."""

    def run(seed: int) -> Codes:
        rng = np.random.default_rng([seed, 24])
        clean = pulse
        if clean is None:
            clean = np.ravel(cr.delayed_ss(plant, delay=0, dt=8 * DT).markov(160))
        noisy = clean + noise * np.abs(clean).max() * rng.standard_normal(clean.size)
        return codes(cr.realize(cr.ImpulseResponse(noisy, 8 * DT), order).fit)

    return run


def alternating() -> np.ndarray:
    """Pulse response with a pole at z = -0.8."""
    k = np.arange(160)
    return np.concatenate([[0.0], 0.9**k + 0.3 * (-0.8) ** k])


def campaign(seed: int, *, broken: bool = False, twice: bool = False, trend: float = 0.0) -> Codes:
    noise = _noise(seed, LOW)
    plant = _plant(seed)
    records = []
    for i, height in enumerate((16.0, 8.0) * 6):
        case = step_case(
            "white",
            plant,
            noise,
            100 * seed + i,
            delay=37 + trend * (height == 8),
            amplitude=height,
        )
        records.append(case.record)
    if broken:
        flat = np.zeros(records[3].n_samples)
        records[3] = cr.Record(records[3].time, records[3].input, flat)
    if twice:
        records[7] = records[2]
    return codes(cr.identify_campaign(records, method="scan"))


_FIT = FlagCase("fit_output_error", "", "", ordinary, "R1 to R4, white noise 0.1 to 2 %", ordinary)


def _fit(code: str, due: str, raising: Run, **quiet: Run) -> FlagCase:
    return replace(_FIT, code=code, due=due, raising=raising, **quiet)


def _several(code: str, due: str, **what: object) -> FlagCase:
    return FlagCase(
        "fit_output_error, six records",
        code,
        due,
        lambda seed: together(seed, **what),
        "six records alike, white noise 0.1 and 0.5 %",
        together,
    )


def _scan(code: str, due: str, raising: Run, not_due: str, quiet: Run) -> FlagCase:
    return FlagCase("estimate_delay", code, due, raising, not_due, quiet)


ANY = "R1 to R4, white noise 0.1 to 2 %, defaults"

CASES: list[FlagCase] = [
    _fit("delay_at_bound", "max_delay=20, delay 30 to 45", lambda s: fit(plain(s), max_delay=20),
         not_due="max_delay=100, delay 30 to 45", quiet=lambda s: fit(plain(s), max_delay=100)),
    _fit("structured_misfit", "slew limit, noise 0.1 and 0.5 %", wrong("slew limit", LOW)),
    _fit("structured_misfit", "slew limit, noise 1 and 2 %", wrong("slew limit", HIGH),
         not_due="R1 to R4, coloured noise 0.1 to 2 %", quiet=coloured),
    _fit("structured_misfit", "static friction, noise 0.1 and 0.5 %",
         wrong("static friction", LOW)),
    _fit("marginal_decision", "a second lag for which BIC of one and of two lags is the same",
         at_an_edge),
    _fit("structures_disagree", "R4, noise 2 %: an interval of half the dead time or more",
         lambda s: fit(step_case("white", "R4", 0.02, s).record),
         not_due="R1, noise 0.1 %",
         quiet=lambda s: fit(step_case("white", "R1", 0.001, s).record)),
    _fit("no_delay_resolved", "no delay, noise 1 and 2 %", lambda s: fit(undelayed(s))),
    _fit("many_lags", "twelve equal lags of 20 Hz, noise 0.1 and 0.5 %", twelve_lags),
    _fit("dispersed_flow", "dispersion, noise 0.1 and 0.5 %", wrong("dispersion", LOW)),
    _fit("dispersed_flow", "dispersion, noise 1 and 2 %", wrong("dispersion", HIGH),
         not_due="R1 to R4, coloured noise 0.1 to 2 %", quiet=coloured),
    _fit("structures_disagree", "two paths, noise 0.1 and 0.5 %", wrong("two paths", LOW)),
    _fit("integrating", "integrator behind a lag of 5 Hz", integrating),
    _fit("not_settled", "record ends one time constant after the delay", unsettled),
    _fit("inverse_response", "R2 with a zero at +5 Hz", inverse),
    _fit("no_rest", "5 samples before the step", short_rest),
    _fit("drift", "10 % of the step per s", drifting),
    _fit("drift", "10 % of the step per s", drifting, not_due="R1 to R4, coloured noise 0.1 to 2 %",
         quiet=coloured),
    _fit("not_at_rest", "the same step 1/4 s before the record", moving),
    _fit("not_at_rest", "the same step 1/4 s before the record", moving,
         not_due="R1 to R4, coloured noise 0.1 to 2 %", quiet=coloured),
    _fit("hum", "50 Hz, three noise std high", humming),
    _fit("hum", "50 Hz, three noise std high", humming,
         not_due="R1 to R4, coloured noise 0.1 to 2 %",
         quiet=coloured),
    _fit("load_disturbance", "a load of 30 % long after the step", loaded),
    _fit("load_disturbance", "a load of 30 % long after the step", loaded,
         not_due="R1 to R4, coloured noise 0.1 to 2 %", quiet=coloured),
    _fit("coarse_quantisation", "rounded to five noise std", coarse,
         not_due="rounded to half a noise std", quiet=fine),
    _fit("outliers", "2 % of the samples off by ten noise std", spiked),
    _several("outlying_records", "one record of six 25 samples late", strange=True),
    _several("records_differ", "delays scatter by 2 samples", scatter=2.0),
    _several("amplitude_trend", "delay 3 samples longer at half the height", trend=3.0),
    *(
        FlagCase(f"{result}, three records", code, due, partial(run, **what),
                 "three records alike, white noise 0.1 and 0.5 %", run)
        for result, run in (
            ("fit_output_error", unlike_fit), ("identify_campaign", unlike_campaign)
        )
        for code, due, what in (
            ("gains_differ", "gains of 0.95, 1 and 1.05", {"gains": (0.95, 1.0, 1.05)}),
            ("no_common_gain", "gains of 1, 0.5 and 0.25", {"gains": (1.0, 0.5, 0.25)}),
            ("lags_differ", "lags of 0.8, 1 and 1.2", {"lags": (0.8, 1.0, 1.2)}),
        )
    ),
    FlagCase("fit_output_error", "parameter_at_bound", "the slow lag of R2 below 50 ms",
             partial(bounded, high=0.05), "below 100 ms", partial(bounded, high=0.1)),
    FlagCase("fit_output_error", "apparent_dead_time", "one lag asked for of R2",
             partial(forced, plant="R2"), "one lag asked for of R1", partial(forced, plant="R1")),
    FlagCase("fit_output_error", "structure_not_certain", "three lags asked for of R4",
             partial(forced, plant="R4", order=3),
             "one lag asked for of R1", partial(forced, plant="R1")),
    _fit("gain_not_resolved", "a response that dies away again", washed_out),
    _scan("delay_at_bound", "max_delay=20, delay 30 to 45", lambda s: scan(plain(s), max_delay=20),
          ANY, plain_scan),
    _scan("no_delay_resolved", "no delay, noise 1 and 2 %", lambda s: scan(undelayed(s)), ANY,
          plain_scan),
    _scan("several_minima", "order 8 of unfiltered data with hum", humming_scan, ANY, plain_scan),
    _scan("order_in_noise", "order 5 of R1, noise 1 %", scanned("R1", 0.01, 5),
          "order 1 of R1, noise 0.1 %", scanned("R1", 0.001, 1)),
    _scan("order_near_noise", "order 3 of R3, noise 0.2 %, filter at 50 Hz",
          scanned("R3", 0.002, 3, cutoff_hz=50.0),
          "order 1 of R1, noise 0.1 %", scanned("R1", 0.001, 1)),
    FlagCase("realize", "filter_delay", "causal filter at 50 Hz", filtered(False),
             "zero-phase filter at 50 Hz", filtered(True)),
    FlagCase("realize", "not_died_away", "integrator, noise 1 % of the pulse",
             realized(ct.tf([1], [1, 0]), 1, 0.01),
             "R3 of order 3, noise 1 %", realized(rigs.R3, 3, 0.01)),
    FlagCase("realize", "unstable", "a pole at z = 1.01, noise 1 %",
             realized(rigs.R1, 1, 0.01, 1.01 ** np.arange(160.0)),
             "R3 of order 3, noise 1 %", realized(rigs.R3, 3, 0.01)),
    FlagCase("realize", "negative_pole", "a pole at z = -0.8, noise 1 %",
             realized(rigs.R1, 2, 0.01, alternating()),
             "R3 of order 3, noise 1 %", realized(rigs.R3, 3, 0.01)),
    FlagCase("realize", "no_gap", "R1 of order 4, noise 1 %", realized(rigs.R1, 4, 0.01),
             "R2 of order 2, noise 0.1 %", realized(rigs.R2, 2, 0.001)),
    FlagCase("identify_campaign", "failed_records", "one flat record of twelve",
             lambda s: campaign(s, broken=True), "twelve records alike, by the scan", campaign),
    FlagCase("identify_campaign", "same_records", "one record of twelve given twice",
             lambda s: campaign(s, twice=True), "twelve records alike, by the scan", campaign),
    FlagCase("identify_campaign", "amplitude_trend", "delay 6 samples longer at half the height",
             lambda s: campaign(s, trend=6.0), "twelve records alike, by the scan", campaign),
]  # fmt: skip
