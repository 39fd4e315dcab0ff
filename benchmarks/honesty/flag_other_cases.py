"""Worlds for the flags of moving inputs, frequency responses, loops and residuals."""

from __future__ import annotations

import control as ct
import numpy as np

import ctrl_realize as cr
from tests import rigs

from .flag_case import Codes, FlagCase, Run, codes
from .worlds import DRIVEN_DT, NOISES, DrivenCase, driven_case, noise_of

LOW, HIGH = NOISES[:2], NOISES[2:]
FOUR_LAGS = rigs.lag(0.8) * rigs.lag(4) * rigs.lag(9) * rigs.lag(15)


def _noise(seed: int, levels: tuple[float, ...] = NOISES) -> float:
    return levels[seed % len(levels)]


def driven(seed: int, kind: str = "white", **options: object) -> DrivenCase:
    return driven_case(kind, _noise(seed), seed, **options)


def fit(case: DrivenCase, **options: object) -> Codes:
    return codes(cr.fit_output_error(case.record, **options).fit)


def ordinary(seed: int) -> Codes:
    return fit(driven(seed))


def together(seed: int, *, gains: tuple[float, ...] = (1.0, 1.0, 1.0)) -> Codes:
    """Fit three records of one plant, their outputs scaled."""
    cases = [driven(3 * seed + i, samples=700, delay=8.3) for i in range(len(gains))]
    records = [
        cr.Record(c.record.time, c.record.input, gain * np.ravel(c.record.output), name=f"r{i}")
        for i, (c, gain) in enumerate(zip(cases, gains, strict=True))
    ]
    return codes(cr.fit_output_error(records).fit)


def pulses(case: DrivenCase, length: int = 120) -> Codes:
    return codes(cr.impulse_from_io(case.record, length))


def channels(case: DrivenCase, orders: tuple[int, ...] = (1, 2, 3, 4, 5)) -> Codes:
    return codes(cr.fit_state_space(case.record, orders).fit)


def half_silent(seed: int) -> Codes:
    """Two outputs, one of which is nothing but noise."""
    case = driven(seed, held=3)
    noise = np.random.default_rng([seed, 36]).standard_normal(case.record.n_samples)
    both = np.stack([np.ravel(case.record.output), noise])
    return codes(cr.fit_state_space(cr.Record(case.record.time, case.record.input, both), 2).fit)


def unmoved(seed: int, method: str) -> Codes:
    """Output that is nothing but noise."""
    case = driven(seed, held=3)
    rng = np.random.default_rng([seed, 31])
    noise = rng.standard_normal(case.record.n_samples)
    record = cr.Record(case.record.time, case.record.input, noise)
    return codes(cr.impulse_from_io(record, 60, method=method))


def slow_input(seed: int) -> Codes:
    """Twenty sines that excite 40 of 120 lags."""
    rng = np.random.default_rng([seed, 32])
    k = np.arange(1500)
    waves = np.outer(np.arange(1, 21), k) * 2 * np.pi / 300 + rng.uniform(0, 6, (20, 1))
    return pulses(driven(seed, signal=np.cos(waves).sum(axis=0)))


def frf_of(
    plant: ct.TransferFunction,
    seed: int,
    noise: float,
    *,
    delay: float = 0.0289,
    band: tuple[float, float] = (0.1, 40.0),
    points: int = 60,
    bend: float = 0.0,
) -> cr.MeasuredFRF:
    """Response with an error of `noise` times its size, its std known; `bend` of a second mode."""
    rng = np.random.default_rng([seed, 33])
    f = np.geomspace(*band, points)
    s = 2j * np.pi * f
    clean = plant(s) * np.exp(-delay * s)
    clean = clean * (1 + bend * np.sin(3 * np.log(f)))
    std = noise * np.abs(clean)
    error = (rng.standard_normal(f.size) + 1j * rng.standard_normal(f.size)) / np.sqrt(2)
    return cr.MeasuredFRF(clean + std * error, f, std=std)


def with_small_modes(seed: int, size: float = 0.02) -> cr.MeasuredFRF:
    """Two resonances, a lag and 2 ms, with three modes of a few per cent that may be no plant's."""
    rng = np.random.default_rng([seed, 5])
    f = np.linspace(10, 250, 50)
    s = 2j * np.pi * f

    def pair(hz: float, damping: float) -> np.ndarray:
        w = 2 * np.pi * hz
        return w**2 / (s * s + 2 * damping * w * s + w * w)

    small = sum(
        size * s * 0.08 / (2 * np.pi * hz) * pair(hz, 0.04)
        for hz in np.array([40, 130, 220]) * rng.uniform(0.9, 1.1, 3)
    )
    noise = 0.001 * (rng.standard_normal(50) + 1j * rng.standard_normal(50))
    plant = np.exp(-0.002 * s) / (s / (10 * np.pi) + 1) * pair(85, 0.3) * pair(180, 0.1)
    return cr.MeasuredFRF(plant * (1 + small + noise), f)


def frf_fit(frf: cr.MeasuredFRF, order: object = None, **options: object) -> Codes:
    return codes(cr.fit_frf(frf, order, **options).fit)


def ordinary_frf(seed: int) -> Codes:
    return frf_fit(frf_of(rigs.R2, seed, _noise(seed)))


def pulse_from(frf: cr.MeasuredFRF, dt: float, length: int) -> Codes:
    return codes(cr.impulse_from_frf(frf, dt, length))


def good_pulse(seed: int) -> Codes:
    """R2 from 0.1 to 60 Hz for 0.6 s in steps of 8 ms."""
    return pulse_from(frf_of(rigs.R2, seed, _noise(seed), band=(0.1, 60.0), points=150), 0.008, 240)


def loop(gain: float) -> ct.StateSpace:
    """R3 behind 37 samples under pure gain."""
    return gain * cr.delayed_ss(rigs.R3, delay=37, dt=rigs.TS)


def critical() -> float:
    return float(cr.design.margins(loop(1.0)).gain_margin)


def scaled_loop(low: float, high: float) -> Run:
    """Gain of the loop between these parts of the critical one."""

    def run(seed: int) -> Codes:
        share = np.random.default_rng([seed, 34]).uniform(low, high)
        return codes(cr.design.margins(loop(share * critical())))

    return run


def loop_data(low: float, high: float, *, unstable: float = 0.4) -> Run:
    """Margins from a measured loop over this band in Hz."""

    def run(seed: int) -> Codes:
        frf = frf_of(rigs.R3, seed, _noise(seed, LOW), band=(low, high), points=80)
        scale = unstable * critical()
        return codes(cr.design.margins(cr.MeasuredFRF(scale * frf.complex, frf.frequency_hz)))

    return run


def noisy_loop(share: float, noise: float) -> Run:
    """Margins of a measured loop at this part of the critical gain, its noise known."""

    def run(seed: int) -> Codes:
        frf = frf_of(rigs.R3, seed, noise, band=(0.05, 50.0), points=80)
        scale = share * critical()
        loop = cr.MeasuredFRF(scale * frf.complex, frf.frequency_hz, std=scale * frf.std)
        return codes(cr.design.margins(loop))

    return run


def residuals(seed: int, *, shift: int = 0, kind: str = "white") -> Codes:
    """Check the plant itself, its delay off by `shift` samples, on a record of its own."""
    case = driven(seed, kind)
    model = case.plant.replace(delay=case.plant.delay + shift)
    return codes(cr.validation.analyse_residuals(model, case.record))


def closed_loop(seed: int, *, integral: float) -> Codes:
    """A plant whose noise comes back through a controller, in the same sample."""
    rng = np.random.default_rng([seed, 35])
    n, pole, gain, total = 3000, 0.9, 1.0, 0.0
    u, y, state = np.zeros(n), np.zeros(n), 0.0
    noise = 0.3 * rng.standard_normal(n)
    target = np.repeat(rng.choice([-1.0, 1.0], n // 30 + 1), 30)[:n]
    for k in range(n):
        state = pole * state + (1 - pole) * (u[k - 3] if k > 3 else 0.0)
        y[k] = state + noise[k]
        total += integral * (target[k] - y[k])
        u[k] = gain * (target[k] - y[k]) + total
    record = cr.Record(DRIVEN_DT * np.arange(n), u, y)
    core = ct.ss([[pole]], [[1 - pole]], [[pole]], [[1 - pole]], DRIVEN_DT)
    return codes(cr.validation.analyse_residuals(cr.DelayedStateSpace(core, 3), record))


def check(seed: int, **options: object) -> Codes:
    return codes(cr.validation.compare_delay_estimates(driven(seed).record, **options))


def unrelated(seed: int) -> Codes:
    """Output that knows nothing of the input."""
    case = driven(seed)
    rng = np.random.default_rng([seed, 36])
    noise = noise_of("white", case.record.n_samples, rng)
    return codes(
        cr.validation.compare_delay_estimates(cr.Record(case.record.time, case.record.input, noise))
    )


def hardly_moving(seed: int) -> Codes:
    """A step at the end of which the output has just begun to move."""
    made = rigs.step_record(rigs.R3, noise=0.01, seed=seed, before=20, after=30, delay=40)
    frf = frf_of(rigs.R2, seed, _noise(seed))
    return codes(cr.validation.compare_delay_estimates(made, frf=frf))


def few_lines(seed: int) -> Codes:
    frf = frf_of(rigs.R1, seed, _noise(seed), points=3)
    return codes(cr.validation.compare_delay_estimates(driven(seed).record, frf=frf))


def many_lines(seed: int) -> Codes:
    return codes(
        cr.validation.compare_delay_estimates(
            driven(seed).record, frf=frf_of(rigs.R2, seed, _noise(seed))
        )
    )


def compared(highest: float) -> Run:
    def run(seed: int) -> Codes:
        frf = frf_of(rigs.R3, seed, _noise(seed), band=(0.1, highest))
        return codes(cr.compare_frf(cr.delayed_ss(rigs.R3, delay=37, dt=rigs.TS), frf))

    return run


def off(gain: float) -> Run:
    """Compare R3 with a response of more gain."""

    def run(seed: int) -> Codes:
        frf = frf_of(gain * rigs.R3, seed, _noise(seed), band=(0.1, 40.0))
        return codes(cr.compare_frf(cr.delayed_ss(rigs.R3, delay=37, dt=rigs.TS), frf))

    return run


DRIVEN = "two lags, random levels, white noise 0.1 to 2 %"
FRF = "R2, 0.1 to 40 Hz, noise 0.1 to 2 %"


def _driven(
    code: str, due: str, raising: Run, not_due: str = DRIVEN, quiet: Run = ordinary
) -> FlagCase:
    return FlagCase("fit_output_error, moving input", code, due, raising, not_due, quiet)


def _fit_frf(
    code: str, due: str, raising: Run, not_due: str = FRF, quiet: Run = ordinary_frf
) -> FlagCase:
    return FlagCase("fit_frf", code, due, raising, not_due, quiet)


def _pulse(code: str, due: str, raising: Run) -> FlagCase:
    return FlagCase("impulse_from_frf", code, due, raising, "R2, 0.1 to 60 Hz, long enough",
                    good_pulse)  # fmt: skip


def _check(code: str, due: str, raising: Run, not_due: str, quiet: Run) -> FlagCase:
    return FlagCase("compare_delay_estimates", code, due, raising, not_due, quiet)


def _r2(seed: int, noise: float, **options: object) -> cr.MeasuredFRF:
    return frf_of(rigs.R2, seed, noise, **options)


CASES: list[FlagCase] = [
    _driven("coloured_residual", "AR(1) noise", lambda s: fit(driven(s, "coloured"))),
    _driven("coloured_residual", "quadratic sensor", lambda s: fit(driven(s, "wrong structure"))),
    _driven("delay_at_bound", "max_delay=3, delay 5 to 12", lambda s: fit(driven(s), max_delay=3),
            "max_delay=40, delay 5 to 12", lambda s: fit(driven(s), max_delay=40)),
    _driven("no_delay_resolved", "no delay", lambda s: fit(driven(s, delay=0.0))),
    _driven("structures_disagree",
            "four lags 2 samples late, noise 2 %: an interval of half the dead time or more",
            lambda s: fit(driven_case("white", 0.02, s, core=FOUR_LAGS, delay=2.0)),
            "one lag", lambda s: fit(driven(s, core=rigs.lag(0.8)))),
    _driven("integrating", "integrator behind a lag",
            lambda s: fit(driven(s, core=rigs.lag(4.0) * ct.tf([1], [1, 1e-6])))),
    _driven("not_settled", "lag of 15 s in a record of 15 s",
            lambda s: fit(driven(s, core=rigs.lag(4.0) * ct.tf([1], [15, 1])))),
    _driven("inverse_response", "zero at +1 Hz",
            lambda s: fit(driven(s, core=rigs.lag(0.8) * rigs.lag(4.0)
                                 * ct.tf([-1 / (2 * np.pi), 1], [1])))),
    FlagCase("fit_output_error, moving inputs", "gains_differ",
             "gains of three records 0.9, 1 and 1.1",
             lambda s: together(s, gains=(0.9, 1.0, 1.1)), "three records alike", together),
    FlagCase("fit_output_error, moving input", "cut", "12 000 samples of a response of 1600",
             lambda s: fit(driven(s, samples=12_000, core=rigs.lag(0.1) * rigs.lag(4.0))),
             DRIVEN, ordinary),
    FlagCase("impulse_from_io", "not_died_away", "30 lags of a response of 100",
             lambda s: pulses(driven(s, held=3), 30), "120 lags",
             lambda s: pulses(driven(s, held=3))),
    FlagCase("impulse_from_io", "partly_excited", "20 sines for 120 lags", slow_input,
             "random levels", lambda s: pulses(driven(s, held=3))),
    *(FlagCase("impulse_from_io", "no_response", f"output of noise alone, {method}",
               lambda s, method=method: unmoved(s, method),
               "noise 0.1 to 2 %",
               lambda s, method=method: codes(
                   cr.impulse_from_io(driven(s, held=3).record, 60, method=method)))
      for method in ("regularized", "least_squares", "okid")),
    FlagCase("fit_state_space", "highest_order", "orders 1 and 2 of four lags",
             lambda s: channels(driven(s, core=FOUR_LAGS, held=3), (1, 2)),
             "orders 1 to 5 of one lag", lambda s: channels(driven(s, core=rigs.lag(0.8)))),
    FlagCase("fit_state_space", "coloured_residual", "AR(1) noise",
             lambda s: channels(driven(s, "coloured", held=3)), DRIVEN,
             lambda s: channels(driven(s, held=3))),
    FlagCase("fit_state_space", "no_response", "one output of two is noise", half_silent, DRIVEN,
             lambda s: channels(driven(s, held=3))),
    _fit_frf("structured_misfit", "R3 with 10 % ripple, noise 0.1 and 0.5 %",
             lambda s: frf_fit(frf_of(rigs.R3, s, _noise(s, LOW), bend=0.1))),
    _fit_frf("structured_misfit", "order 1 of R3, noise 1 and 2 %",
             lambda s: frf_fit(frf_of(rigs.R3, s, _noise(s, HIGH)), 1)),
    _fit_frf("dead_time_rounded", "relative degree 0",
             lambda s: frf_fit(_r2(s, _noise(s)), 2, relative_degree=0, dt=0.002)),
    _fit_frf("delay_at_bound", "max_dead_time 20 ms, delay 28.9 ms",
             lambda s: frf_fit(_r2(s, _noise(s)), max_dead_time=0.02)),
    _fit_frf("phase_leads", "0.2 s of lead",
             lambda s: frf_fit(_r2(s, _noise(s), delay=-0.2))),
    _fit_frf("systematic_error", "order 5 or 10, three modes of 2 %",
             lambda s: frf_fit(with_small_modes(s), (5, 10))),
    _fit_frf("structures_disagree", "R4 to 5 Hz, noise 1 and 2 %",
             lambda s: frf_fit(frf_of(rigs.R4, s, _noise(s, HIGH), band=(0.1, 5.0))),
             "R1 to 40 Hz, noise 0.1 %", lambda s: frf_fit(frf_of(rigs.R1, s, 0.001))),
    _pulse("unexplained", "noise of half the response",
           lambda s: pulse_from(_r2(s, 0.5, band=(0.1, 60.0), points=150), 0.008, 240)),
    _pulse("ends_early", "band ends at 3 Hz, steps of 8 ms",
           lambda s: pulse_from(_r2(s, _noise(s), band=(0.1, 3.0), points=150), 0.008, 240)),
    _pulse("starts_late", "band starts at 4 Hz",
           lambda s: pulse_from(_r2(s, _noise(s), band=(4.0, 60.0), points=150), 0.008, 240)),
    _pulse("cut_off", "0.1 s of a response of 0.4 s",
           lambda s: pulse_from(_r2(s, _noise(s), band=(0.1, 60.0), points=150), 0.008, 12)),
    FlagCase("compare_frf", "beyond_nyquist", "points to 1000 Hz, Nyquist 640 Hz", compared(1000.0),
             "points to 100 Hz", compared(100.0)),
    FlagCase("compare_frf", "frf_differs", "gain 10 % more", off(1.1), "the plant's own", off(1.0)),
    FlagCase("compare_frf", "frf_disagrees", "gain 50 % more", off(1.5), "10 % more", off(1.1)),
    FlagCase("margins", "unstable", "gain 1.02 to 2 times the critical one",
             scaled_loop(1.02, 2.0), "gain 0.2 to 0.98 of it", scaled_loop(0.2, 0.98)),
    FlagCase("margins", "marginal", "gain within 1e-9 of the critical one",
             scaled_loop(1 - 1e-10, 1 + 1e-10), "gain 0.2 to 0.98 of it", scaled_loop(0.2, 0.98)),
    FlagCase("margins of data", "band_ends_early", "band ends at 1 Hz, |L| above 1",
             loop_data(0.05, 1.0), "0.05 to 50 Hz", loop_data(0.05, 50.0)),
    FlagCase("margins of data", "band_starts_late", "band starts at 1.5 Hz",
             loop_data(1.5, 50.0), "0.05 to 50 Hz", loop_data(0.05, 50.0)),
    FlagCase("margins of data", "within_noise", "0.98 of the critical gain, noise 2 %",
             noisy_loop(0.98, 0.02), "0.7 of it, noise 2 %", noisy_loop(0.7, 0.02)),
    FlagCase("analyse_residuals", "input_in_residual", "delay two samples off",
             lambda s: residuals(s, shift=2), DRIVEN, residuals),
    FlagCase("analyse_residuals", "input_in_residual", "delay two samples off",
             lambda s: residuals(s, shift=2),
             "two lags, AR(1) noise", lambda s: residuals(s, kind="coloured")),
    FlagCase("analyse_residuals", "feedback", "noise comes back through a PI controller",
             lambda s: closed_loop(s, integral=0.1), DRIVEN, residuals),
    FlagCase("analyse_residuals", "feedback", "noise comes back through gain alone",
             lambda s: closed_loop(s, integral=0.0), "two lags, AR(1) noise",
             lambda s: residuals(s, kind="coloured")),
    _check("no_correlation", "output that knows nothing of the input", unrelated, DRIVEN, check),
    _check("no_frf_fit", "response of three lines", few_lines, "60 lines", many_lines),
    _check("no_phase_slope", "response of three lines", few_lines, "60 lines", many_lines),
    _check("no_output_error", "a step whose answer is cut off, beside a good FRF", hardly_moving,
           DRIVEN, check),
    _check("no_scan", "order 400 of a record of 1500", lambda s: check(s, order=400),
           DRIVEN, check),
]  # fmt: skip
