"""The metrics of a test from its groups and curves, and their limits."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from numbers import Real
from typing import Any, Literal

import numpy as np

from .._checks import check_type, positive, real
from ..errors import OptionError
from .definitions import DEFINITIONS, Definition
from .groups import Interval, SizeAndDirection

Judgement = Literal["met", "not met", "cannot tell", ""]

_TIMES = ("dead_time", "t63", "t86", "t98", "settling_time", "overshoot")
_BY_SIZE = (*_TIMES, "gain", "gain_scatter", "fitted_dead_time")
_SAME_RATE = 0.15
"""Relative difference of rates of two sizes up to which the valve moves at a limited rate."""


@dataclass(frozen=True)
class Metric:
    """One metric with its interval, and what a limit says about it.

    Attributes
    ----------
    key : str
        Key of `definition` in `DEFINITIONS`.
    definition : Definition
    interval : Interval
        Value and 95 % interval, in ``definition.unit``; unknown if the records cannot tell it.
    where : str
        Steps or range of the command from which it comes, such as ``"2 % closing"``.
    limit : tuple of (float or None, float or None)
        Smallest and largest permitted value.
    judgement : {"met", "not met", "cannot tell", ""}
        ``"met"`` if the whole interval is within the limit, ``"not met"`` if all of it is outside;
        empty without a limit.

    Examples
    --------
    >>> import ctrl_realize as cr
    >>> records = cr.bench.valve().step_campaign(1, amplitudes=(16.0, 4.0), repeats=3)
    >>> report = cr.valves.valve_report(
    ...     records, command_range=(4, 20), limits={"t86": 0.3}, fit=False
    ... )
    >>> report.metric("t86").judgement
    'met'
    """

    key: str
    definition: Definition
    interval: Interval
    where: str = ""
    limit: tuple[float | None, float | None] = (None, None)
    judgement: Judgement = ""

    def __repr__(self) -> str:
        one = self.interval
        return (
            f"<Metric {self.definition.name}: {one.value:.4g} ({one.low:.4g} to {one.high:.4g}) "
            f"{self.definition.unit}>"
        )


def collected(
    groups: Sequence[SizeAndDirection], statics: Mapping[str, tuple[Interval, str]]
) -> tuple[Metric, ...]:
    """Metrics of a report: of those that depend on the step, the worst size and direction."""
    steps = [one for one in groups if not one.stroke] or list(groups)
    followed = [one for one in steps if one.moved == one.count] or steps
    found = {}
    without = "; without full strokes" if len(steps) < len(groups) else ""
    for key in (*_TIMES, "fitted_dead_time"):
        # a response to a step that is lost in the dead band is a part of one
        own = steps if "dead_time" in key else followed
        found[key] = _largest([(one.estimates[key], words_of(one) + without) for one in own])
    gains = [(one.estimates["gain"], words_of(one)) for one in groups if one.moved]
    if gains:
        # that farthest from one
        found["gain"] = max(gains, key=lambda pair: abs(pair[0].value - 1))
    found["gain_scatter"] = _largest(
        [(one.estimates["gain_scatter"], words_of(one)) for one in groups]
    )
    for way in ("opening", "closing"):
        own = [one for one in groups if one.direction == way]
        found[f"slew_rate_{way}"] = _rate(own)
        strokes = [(one.estimates["t98"], words_of(one)) for one in own if one.stroke]
        found[f"stroke_time_{way}"] = _largest(strokes)
    found |= dict(statics)
    return tuple(
        Metric(key, definition, *found.get(key, (Interval(), "")))
        for key, definition in DEFINITIONS.items()
    )


def words_of(group: SizeAndDirection) -> str:
    """Name of a size and direction."""
    return f"{'stroke' if group.stroke else f'{group.size:.3g} %'} {group.direction}"


def _largest(found: list[tuple[Interval, str]]) -> tuple[Interval, str]:
    known = [pair for pair in found if pair[0].is_known]
    return max(known, key=lambda pair: pair[0].value) if known else (Interval(), "")


def _rate(groups: list[SizeAndDirection]) -> tuple[Interval, str]:
    """Largest rate: a lower bound, unless the rates of two sizes show that it is a limit."""
    known = [one for one in groups if one.estimates["slew_rate"].is_known]
    if not known:
        return Interval(), ""
    best = max(known, key=lambda one: one.estimates["slew_rate"].value)
    rate = best.estimates["slew_rate"]
    others = [one for one in known if one is not best and one.size >= 0.2 * best.size]
    limited = any(
        abs(one.estimates["slew_rate"].value - rate.value) <= _SAME_RATE * rate.value
        and abs(one.size - best.size) > 0.3 * best.size
        for one in others
    )
    if limited:
        return rate, f"{words_of(best)}; the rate is limited"
    return replace(rate, high=float("inf")), f"{words_of(best)}; the limit may be higher"


def check_limits(limits: Mapping[str, Any] | None) -> None:
    """Refuse limits that cannot be compared with a metric."""
    given = limits or {}
    check_type(given, Mapping, "limits", "metrics with their limits, {'t86': 0.4}", OptionError)
    unknown = sorted(set(given) - set(DEFINITIONS))
    if unknown:
        raise OptionError(
            f"limits has {', '.join(map(repr, unknown))}; expected some of {', '.join(DEFINITIONS)}"
        )
    for key, limit in given.items():
        if not isinstance(limit, Mapping):
            _limit(limit, key)
            continue
        if key not in _BY_SIZE:
            raise OptionError(
                f"limits[{key!r}] is by step size, of which this metric is independent; expected "
                "a number, or (smallest, largest)"
            )
        for size, one in limit.items():
            positive(size, f"limits[{key!r}]", "step size in %")
            _limit(one, key)


def judged(
    metrics: Sequence[Metric], groups: Sequence[SizeAndDirection], limits: Mapping[str, Any] | None
) -> tuple[Metric, ...]:
    """Compare metrics with limits; limits by size add a metric for each size and direction."""
    given = limits or {}
    sized = {key: limit for key, limit in given.items() if isinstance(limit, Mapping)}
    plain = given.keys() - sized.keys()
    found = [_with_limit(one, given[one.key]) if one.key in plain else one for one in metrics]
    for one in metrics:
        found += _of_sizes(one, groups, sized.get(one.key, {}))
    return tuple(found)


def _with_limit(one: Metric, given: Any) -> Metric:
    limit = _limit(given, one.key)
    return replace(one, limit=limit, judgement=_judgement(one.interval, *limit))


def _of_sizes(
    one: Metric, groups: Sequence[SizeAndDirection], limits: Mapping[Any, Any]
) -> list[Metric]:
    """Metrics of the sizes, in %, that have limits of their own."""
    found = []
    for size, limit in limits.items():
        wanted = float(size)
        own = [group for group in groups if abs(group.size - wanted) <= 0.15 * wanted]
        pairs = [(group.estimates[one.key], words_of(group)) for group in own]
        for pair in pairs or [(Interval(), f"{wanted:g} %: no such step")]:
            found.append(_with_limit(Metric(one.key, one.definition, *pair), limit))
    return found


def _limit(given: Any, key: str) -> tuple[float | None, float | None]:
    ends = (None, given) if isinstance(given, Real) else given
    good = isinstance(ends, tuple | list) and len(ends) == 2 and list(ends) != [None, None]
    if not good:
        raise OptionError(
            f"limits[{key!r}]={given!r}; expected the largest permitted value, or (smallest, "
            "largest) with None for none"
        )
    what = "limit, largest or (smallest, largest)"
    low, high = (None if end is None else real(end, f"limits[{key!r}]", what) for end in ends)
    if low is not None and high is not None and low > high:
        raise OptionError(f"limits[{key!r}]={given!r}; expected (smallest, largest) in this order")
    return low, high


def _judgement(one: Interval, low: float | None, high: float | None) -> Judgement:
    if not one.is_known:
        return "cannot tell"
    least, most = low if low is not None else -np.inf, high if high is not None else np.inf
    if least <= one.low and one.high <= most:
        return "met"
    return "not met" if one.high < least or one.low > most else "cannot tell"
