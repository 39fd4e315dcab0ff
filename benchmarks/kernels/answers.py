"""What `identify` answers, in numbers that do not depend on units, and what of it differs."""

from __future__ import annotations

import time
import warnings
from collections.abc import Iterable, Mapping
from typing import Any

import control as ct

import ctrl_realize as cr

CLOSE = 1e-6
"""Part of the dead time, or of the sample time where that is longer, to which times are equal."""

Answer = dict[str, Any]


def answer(record: cr.Record) -> Answer:
    """Identify a record: structure, flags, and times in samples; or the class of the error."""
    begun = time.process_time()
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            system = cr.identify(record)
    except cr.errors.CtrlRealizeError as error:
        return {"structure": type(error).__name__, "flags": [], "times": []}
    fit = system.fit
    kind = "lags" if isinstance(fit, cr.identification.OutputErrorFit) else "modes"
    shape = (
        [fit.order, fit.relative_degree] if kind == "lags" else [fit.order, bool(fit.feedthrough)]
    )
    return {
        "structure": " ".join(map(str, [kind, *shape])),
        "flags": sorted(flag.code for flag in fit.flags),
        "times": [fit.dead_time / record.dt, *(end / record.dt for end in fit.interval)],
        "gain": float(abs(ct.dcgain(system))),
        "seconds": time.process_time() - begun,
    }


def differences(one: Answer, other: Answer) -> list[str]:
    """Name what differs between two answers to the same record."""
    found = [key for key in ("structure", "flags") if one[key] != other[key]]
    if len(one["times"]) != len(other["times"]):
        return found
    for name, a, b in zip(("dead time", "low", "high"), one["times"], other["times"], strict=True):
        if abs(a - b) > CLOSE * max(one["times"][0], 1.0):
            found.append(name)
    return found


def shown(answer: Answer) -> str:
    """Show an answer in a line."""
    if not answer["times"]:
        return str(answer["structure"])
    delay, low, high = answer["times"]
    return (
        f"{answer['structure']}, {delay:.8g} ({low:.8g} to {high:.8g}), "
        f"{', '.join(answer['flags']) or 'no flag'}"
    )


def compared(
    answers: Mapping[str, Mapping[str, Answer]], reference: str
) -> dict[str, dict[str, list[str]]]:
    """For every way but the reference, the records that are answered otherwise, and in what."""
    found: dict[str, dict[str, list[str]]] = {}
    for way, mine in answers.items():
        if way == reference:
            continue
        apart = {name: differences(answers[reference][name], mine[name]) for name in mine}
        found[way] = {name: what for name, what in apart.items() if what}
    return found


def names(found: Iterable[Mapping[str, list[str]]]) -> list[str]:
    """Records that differ in any way, each once, in the order in which they were met."""
    return list(dict.fromkeys(name for apart in found for name in apart))
