"""What else reports an interval from step records: scans, several records, campaigns."""

from __future__ import annotations

import control as ct
import numpy as np

import ctrl_realize as cr
from tests import rigs

from .single import STRUCTURES
from .trial import Seen, inside, quietly
from .worlds import DT, PLANTS, noise_of, rounded, step_case

SENSOR = rigs.lag(30.0)


def given(kind: str, plant: str, noise: float, seed: int) -> Seen:
    """Fit with the structure of the plant given, and with its sensor where it has one."""
    case = step_case(kind, plant, noise, seed)
    truth = case.delay * DT
    structure = STRUCTURES.get(plant, (3, 3))
    fit = cr.fit_output_error(case.record, structures=[structure]).fit
    reach = 1.96 * fit.std_given_structure
    near = (fit.dead_time - reach, fit.dead_time + reach)
    covered = {
        "fit_output_error, structure given: interval": inside(fit.interval, truth),
        "fit_output_error, structure given: -+ 1.96 std": inside(near, truth),
    }
    if plant in PLANTS:
        true = parameters_of(PLANTS[plant]) | {"gain": case.gain}
        for one in fit.parameters:
            if one.name in true:
                reach = 1.96 * one.std_given_structure
                key = f"fit_output_error, structure given: {one.name} of {plant} -+ 1.96 std"
                covered[key] = inside((one.value - reach, one.value + reach), true[one.name])
    if plant == "R4":
        fit = cr.fit_output_error(case.record, known=SENSOR).fit
        covered["fit_output_error, sensor known: interval"] = inside(fit.interval, truth)
    return Seen("given", kind, plant, noise, seed, covered)


def parameters_of(plant: ct.TransferFunction) -> dict[str, float]:
    """Lags, and time constant and damping of a pair, by their names in a fit."""
    poles = sorted(plant.poles(), key=abs)
    lags = [-1 / p.real for p in poles if abs(p.imag) < 1e-6 * abs(p)]
    found = {f"lag_{i}": float(lag) for i, lag in enumerate(lags, 1)}
    for p in poles:
        if p.imag > 1e-6 * abs(p):
            found |= {"pair_time_1": 1 / abs(p), "pair_damping_1": -p.real / abs(p)}
    return found


def scans(kind: str, plant: str, noise: float, seed: int) -> Seen:
    """Flat sets of the scan over delays, and of that over orders."""
    case = step_case(kind, plant, noise, seed)
    truth = case.delay * DT
    with quietly():
        fit = cr.identify(case.record, method="scan").fit
        orders = cr.scan_orders(fit.impulse, 5, max_delay=fit.max_delay)
    low, high = orders.delay_intervals[orders.orders.index(orders.order)]
    covered = {
        "identify(method='scan'): flat set": inside(fit.dead_time_interval, truth),
        "scan_orders: flat set of the suggested order": inside((low, high), case.delay),
    }
    return Seen("scans", kind, plant, noise, seed, covered, flags=[f.code for f in fit.flags])


def views(kind: str, plant: str, noise: float, seed: int) -> Seen:
    """Views of compare_delay_estimates on a step."""
    case = step_case(kind, plant, noise, seed)
    with quietly():
        check = cr.validation.compare_delay_estimates(case.record)
    return Seen(
        "views",
        kind,
        plant,
        noise,
        seed,
        view_coverage(check, case.delay * DT),
        {"disagree": float(not check.agree)},
    )


def view_coverage(check: cr.validation.DelayComparison, truth: float) -> dict[str, float]:
    """Whether each view, and what they have in common, holds the truth."""
    covered = {
        f"compare_delay_estimates: {view.method}": float(
            (view.kind == "upper bound" or view.low <= truth) and truth <= view.high
        )
        for view in check.estimates
        if view.method != "output error"
    }
    if check.common is not None:
        covered["compare_delay_estimates: what all views share"] = inside(check.common, truth)
    return covered


def several(kind: str, plant: str, noise: float, seed: int) -> Seen:
    """One fit of six records, and the mean of a campaign of them by the scan."""
    cases = [
        step_case(kind, plant, noise, 6 * seed + i, delay=_shared_delay(seed), amplitude=height)
        for i, height in enumerate((16.0, 16.0, 16.0, 8.0, 8.0, 8.0))
    ]
    # One plant: its gain is the first one's, the noise of each record its own.
    records = [
        cr.Record(c.record.time, c.record.input, np.ravel(c.record.output) / c.gain, name=f"r{i}")
        for i, c in enumerate(cases)
    ]
    truth = _shared_delay(seed) * DT
    with quietly():
        fit = cr.fit_output_error(records).fit
        campaign = cr.identify_campaign(records, method="scan")
    reach = 1.96 * fit.std_given_structure
    near = (fit.dead_time - reach, fit.dead_time + reach)
    repeats = fit.repeatability
    deviation = np.abs(repeats.delays - np.mean(repeats.delays)) / repeats.errors
    covered = {
        "fit_output_error, six records: interval": inside(fit.interval, truth),
        "fit_output_error, six records: -+ 1.96 std": inside(near, truth),
        "fit_output_error, six records: delay of each -+ 1.96 errors, about their mean": float(
            np.mean(deviation <= 1.96 * np.sqrt(5 / 6))
        ),
    }
    if repeats.trend_error > 0:
        covered["fit_output_error, six records: no trend within 1.96 errors"] = float(
            abs(repeats.trend) <= 1.96 * repeats.trend_error
        )
    if len(campaign.good) == 6:
        ends = campaign.statistics().interval
        covered["campaign by the scan: interval of the mean"] = inside(ends, _shared_delay(seed))
    return Seen("several", kind, plant, noise, seed, covered, flags=[f.code for f in fit.flags])


def _shared_delay(seed: int) -> float:
    return float(np.random.default_rng([seed, 77]).uniform(30, 45))


def tracked(kind: str, plant: str, noise: float, seed: int) -> Seen:
    """DelayTracker on a plant that stays, started 8 samples off."""
    rng = np.random.default_rng([seed, 5])
    coarse = 4 * DT
    delay = int(rng.integers(8, 13))
    lags = PLANTS.get(plant, PLANTS["R2"])
    exact = cr.delayed_ss(lags, delay=delay, dt=coarse)
    u = np.repeat(rng.choice([-1.0, 0.0, 1.0, 2.0], 50), 60).astype(float)
    y = np.ravel(exact.simulate(u - u[0]))
    y = _disturbed(kind, y, noise, rng)
    start = exact.replace(delay=3)
    tracker = cr.DelayTracker(start, max_delay=25, forgetting_time=1000 * coarse)
    for pair in zip(u, y, strict=True):
        tracker.update(float(pair[0]), float(pair[1]))
    told = tracker.estimate()
    if not told.resolved:
        return Seen("tracked", kind, plant, noise, seed, {}, {"untold": 1.0})
    near = (told.gain_ratio - 1.96 * told.gain_std, told.gain_ratio + 1.96 * told.gain_std)
    covered = {
        "DelayTracker: interval": inside(told.delay_interval, delay),
        "DelayTracker: gain -+ 1.96 std": inside(near, 1.0),
    }
    return Seen("tracked", kind, plant, noise, seed, covered, {"untold": 0.0})


def _disturbed(kind: str, y: np.ndarray, noise: float, rng: np.random.Generator) -> np.ndarray:
    span = float(np.ptp(y))
    bent = y + 0.1 * y**2 / span if kind == "wrong structure" else y
    noisy = bent + noise * span * noise_of(kind, y.size, rng)
    return rounded(noisy, span) if kind == "quantised" else noisy
