"""The realization scan of a step record, and the same with the settings of the paper."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any, Literal

import numpy as np

from ..data import Record, StepResponse
from ..delayed import DelayedStateSpace, fit_of
from ..delayed.parts import signals_of
from ..errors import DelayRangeError, OptionError
from ..numerics.arrays import FloatArray
from ..paper import SETTINGS
from .realization.delay_scan import estimate_delay
from .realization.delay_scan_result import DelayScan
from .realization.order_scan import scan_orders
from .step.impulse import impulse_from_step
from .step.steps import unit_step

SCANNED_ORDERS = range(1, 6)
"""Orders considered by the scan; above 5 the realization models noise, or the delay."""


def by_scan(
    record: Record,
    order: int | None = None,
    max_delay: int | None = None,
    cutoff_hz: float | Literal["auto"] | None = "auto",
    samples: int | None = None,
    feedthrough: bool | None = None,
) -> DelayedStateSpace:
    """Zero-phase filter, backward difference, one realization for every delay."""
    step = unit_step(record)
    impulse = impulse_from_step(step, cutoff_hz=cutoff_hz)
    choices = [
        "backward difference: step-invariant, the model reproduces the sampled step response "
        "of plant and zero-order hold"
    ]
    if impulse.filter is None:
        choices.append("no filter: the rise takes few samples, or none was requested")
    else:
        choices.append(f"filter: {impulse.filter} (13 times the bandwidth where automatic)")
    reach = _half_risen(step) if max_delay is None else max_delay
    if max_delay is None:
        choices.append(
            f"delays up to {reach} samples were tried: by then the step response has reached "
            "half of its final value"
        )
    options: dict[str, Any] = {"samples": samples, "feedthrough": feedthrough}
    if order is None:
        # A Hankel matrix of few samples allows few orders.
        room = (impulse.n_samples - 1 - reach) // 2
        tried = [n for n in SCANNED_ORDERS if n <= room] or [1]
        orders = scan_orders(impulse, tried, max_delay=reach, **options)
        choices.append(f"order {orders.order}: its last singular value is {_against_noise(orders)}")
        system = orders.system()
    else:
        system = estimate_delay(impulse, order, max_delay=reach, **options)
    return _named(system, choices, step)


def by_paper(
    record: Record,
    order: int | None = None,
    max_delay: int | None = None,
    cutoff_hz: float | Literal["auto"] | None = "auto",
    samples: int | None = None,
    feedthrough: bool | None = None,
) -> DelayedStateSpace:
    """Settings of the paper: central difference, causal filter, order 3."""
    step = unit_step(record)
    reach = SETTINGS.max_delay if max_delay is None else max_delay
    behind = SETTINGS.samples if samples is None else samples
    if reach + behind + 1 > step.n_samples:
        raise DelayRangeError(
            f"the settings of the paper need {reach + behind + 1} samples after the step "
            f"(samples={behind}, max_delay={reach}), the record has {step.n_samples}; give "
            "samples= and max_delay=, or use method='scan', which adapts them to the record"
        )
    cutoff = SETTINGS.cutoff_hz if cutoff_hz == "auto" else cutoff_hz
    if cutoff_hz == "auto" and SETTINGS.cutoff_hz >= 0.5 / step.dt:
        raise OptionError(
            f"the settings of the paper filter at {cutoff:g} Hz, the record has {1 / step.dt:g} "
            "samples per s; give cutoff_hz= below half of that, or use method='scan', which adapts "
            "it to the record"
        )
    impulse = impulse_from_step(step, cutoff_hz=cutoff, zero_phase=False, difference="central")
    n = SETTINGS.order if order is None else order
    direct = True if feedthrough is None else feedthrough
    system = estimate_delay(impulse, n, max_delay=reach, samples=behind, feedthrough=direct)
    found = fit_of(system, DelayScan)
    choices = [
        "as in the paper: five-point central difference (half a sample early in a step "
        f"response), {impulse.filter or 'no filter'}, order {found.order}, {behind} "
        f"samples, delays 0...{reach}"
    ]
    return _named(system, choices, step)


def _named(
    system: DelayedStateSpace, choices: Sequence[str], step: StepResponse
) -> DelayedStateSpace:
    names: dict[str, Any] = {"fit": replace(fit_of(system, DelayScan), choices=tuple(choices))}
    record = step.record
    if record is not None:
        names |= signals_of(record)
        if record.name:
            names["name"] = record.name
    return system.replace(**names)


def _half_risen(step: StepResponse) -> int:
    """Sample at which the step response reaches half of its final value; the delay is shorter."""
    final = float(np.median(step.output[-max(step.n_samples // 10, 3) :]))
    risen: FloatArray = step.output / final if final else np.abs(step.output)
    crossing = np.flatnonzero(risen >= 0.5 * (1.0 if final else float(risen.max()) or 1.0))
    half = int(crossing[0]) if crossing.size else step.n_samples // 2
    # Some samples must remain after the largest delay.
    return max(1, min(half, step.n_samples - max(step.n_samples // 4, 12)))


def _against_noise(orders: Any) -> str:
    value = orders.last_singular_value(orders.order)
    if orders.noise_floor:
        return f"{value / orders.noise_floor:.1f} times that of the noise before the step"
    return (
        f"{value:.3g}, and no higher order fits better by 10 % (the noise before the step is "
        "unknown)"
    )
