"""Metrics of a valve in words."""

from __future__ import annotations

import numpy as np

from .._wording import in_time, interval_in_time, number_within, numbers_alike, time_within
from .groups import Interval
from .metrics import Metric


def named_metric(one: Metric) -> str:
    """Name a metric with its steps."""
    return f"{one.definition.name} ({one.where})" if one.where else one.definition.name


def in_words(one: Interval, unit: str) -> tuple[str, str]:
    """Write a value and its interval.

    Examples
    --------
    >>> from ctrl_realize.valves.groups import Interval
    >>> from ctrl_realize.valves.words import in_words
    >>> in_words(Interval(0.2468, 0.241, 0.2531, 3), "s")
    ('247 ms', '(241 to 253 ms)')
    """
    if not one.is_known:
        return "unknown", ""
    if np.isinf(one.high):
        return f"{one.value:.4g} {unit}", f"(at least {one.low:.4g} {unit})"
    if not np.isfinite([one.low, one.high]).all():
        return (in_time(one.value) if unit == "s" else f"{one.value:.4g} {unit}"), ""
    ends = one.low, one.high
    if unit == "s":
        return time_within(one.value, *ends), f"({interval_in_time(*ends)})"
    said = " to ".join(numbers_alike(ends, *ends))
    return f"{number_within(one.value, *ends)} {unit}", f"({said} {unit})"


def where_in_words(one: Metric) -> str:
    """Steps behind a metric, and what its limit says."""
    told = [one.where, one.judgement and f"limit {limit_in_words(one)}: {one.judgement}"]
    return "; ".join(filter(None, told))


def limit_in_words(one: Metric) -> str:
    """Write a limit.

    Examples
    --------
    >>> from ctrl_realize.valves import DEFINITIONS, Metric
    >>> from ctrl_realize.valves.groups import Interval
    >>> from ctrl_realize.valves.words import limit_in_words
    >>> limit_in_words(Metric("gain", DEFINITIONS["gain"], Interval(), limit=(0.5, 2.0)))
    '0.5 to 2 %/%'
    """
    low, high = one.limit
    unit = one.definition.unit
    if low is None:
        return f"at most {high:g} {unit}"
    return f"at least {low:g} {unit}" if high is None else f"{low:g} to {high:g} {unit}"
