"""State of a session, and the commands that change it: JSON in, JSON out, nothing else."""

from __future__ import annotations

import copy
import json
from collections.abc import Callable, Mapping
from typing import Any, TypeAlias

from .._checks import band, integer, one_of, real, rising
from .._facts import facts
from .._parameters import SECONDS
from ..design.tuning.layouts import LAYOUTS
from ..design.tuning.pid import KINDS, RULES
from ..errors import FileFormatError, OptionError

State: TypeAlias = dict[str, Any]
Check: TypeAlias = Callable[[Any, str], Any]

FACTS = facts("interactive/state.toml")


def _maybe(check: Check) -> Check:
    return lambda value, name: None if value is None else check(value, name)


def _among(choices: tuple[str, ...]) -> Check:
    return lambda value, name: one_of(value, name, choices)


def _number(value: Any, name: str) -> float:
    return real(value, name, "number")


def _ends(value: Any, name: str) -> list[float]:
    return [*rising(value, name, "the lower one first")]


def _reading(value: Any, name: str) -> State:
    options = {key: one for key, one in dict(value).items() if one not in (None, "")}
    if unknown := sorted(options.keys() - set(FACTS["reading"])):
        raise OptionError(f"{name} has {', '.join(unknown)}; expected some of {FACTS['reading']}")
    return options


def _rest(value: Any, name: str) -> list[float | None]:
    signal, output, start = value
    return [_number(signal, name), _number(output, name), _maybe(_number)(start, name)]


def _structure(value: Any, name: str) -> list[int]:
    order, degree = band(value, name, "order and relative degree")
    return [int(order), int(degree)]


CHECKS: dict[str, dict[str, Check]] = {
    "record": {
        "used": lambda value, _: bool(value), "options": _reading, "range": _maybe(_ends),
        "rest": _maybe(_rest), "shift": _number,
        "struck": lambda value, name: [_ends(one, name) for one in value],
        "units": lambda value, _: {key: str(value[key])[:40] for key in ("input", "output")
                                   if key in value},
    },
    "model": {
        "structure": _maybe(_structure),
        "known": lambda value, _: {str(key): _number(one, key) for key, one in value.items()},
    },
    "loop": {
        "kind": _among(KINDS), "rule": _among(RULES), "form": _among(tuple(LAYOUTS)),
        "speed": _number, "setpoint": _number, "load": _number,
        "time_unit": _maybe(_among(tuple(SECONDS))),
        **dict.fromkeys(("measured_range", "output_range", "limits"), _maybe(_ends)),
    },
    "plan": {"want": _maybe(_among(tuple(FACTS["want"]))), "time": _maybe(_number)},
}  # fmt: skip


def begun(part: str) -> State:
    """Values of a part of the state with which it begins."""
    return {**dict.fromkeys(CHECKS[part]), **json.loads(json.dumps(FACTS[part]))}


def empty() -> State:
    """State of a session without data."""
    parts = {part: begun(part) for part in ("model", "loop", "plan")}
    return {"records": [], "frf": None, "selected": 0, **parts}


def changed(state: State, command: Mapping[str, Any]) -> State:
    """Return the state after a command; the one before is left as it was.

    Raises
    ------
    OptionError
        An unknown command, or a value that it does not take.
    """
    name = one_of(str(command.get("do")), "do", (*_CHANGES, *OTHERS))
    new = copy.deepcopy(state)
    try:
        _CHANGES[name](new, command)
    except (KeyError, TypeError, IndexError, AttributeError) as error:
        raise OptionError(f"{name}: {command!r} is incomplete ({error})") from error
    return new


def _add(state: State, command: Mapping[str, Any]) -> None:
    given = {key: command.get(key) for key in ("file", "name", "path", "given")}
    state["records"].append(begun("record") | given | {"options": command["options"]})
    state["selected"] = len(state["records"]) - 1


def _add_response(state: State, command: Mapping[str, Any]) -> None:
    state["frf"] = {key: command.get(key) for key in ("file", "name", "path")}


def _index(state: State, command: Mapping[str, Any]) -> int:
    return integer(command.get("index"), "index", 0, len(state["records"]) - 1)


def _remove(state: State, command: Mapping[str, Any]) -> None:
    del state["records"][_index(state, command)]
    state["selected"] = max(0, min(state["selected"], len(state["records"]) - 1))


def _select(state: State, command: Mapping[str, Any]) -> None:
    state["selected"] = _index(state, command)


def _set(state: State, command: Mapping[str, Any]) -> None:
    part = one_of(str(command["part"]), "part", tuple(CHECKS))
    held = state["records"][_index(state, command)] if part == "record" else state[part]
    for name, value in command["values"].items():
        held[one_of(name, "values", tuple(CHECKS[part]))] = CHECKS[part][name](value, name)


OTHERS = ("open", "undo", "redo", "view", "compute", "drag", "slide", "figures", "write")
"""Commands that do not change the state by themselves."""

_CHANGES: dict[str, Callable[[State, Mapping[str, Any]], None]] = {
    "add": _add, "add_response": _add_response, "remove": _remove, "select": _select, "set": _set,
}  # fmt: skip


def checked(state: Any, files: Mapping[str, bytes]) -> State:
    """Check a state that comes from a file.

    Raises
    ------
    FileFormatError
        It is not one, or a file of it is missing.
    """
    try:
        new = empty() | {"frf": state["frf"]}
        for part in ("model", "loop", "plan"):
            _set(new, {"part": part, "values": state[part]})
        for index, row in enumerate(state["records"]):
            _add(new, row)
            values = {name: row[name] for name in CHECKS["record"]}
            _set(new, {"part": "record", "index": index, "values": values})
        if new["records"]:
            _select(new, {"index": state["selected"]})
        missing = {row["file"] for row in [*new["records"], *filter(None, [new["frf"]])]}
    except (TypeError, KeyError, AttributeError, IndexError, ValueError) as error:
        raise FileFormatError(f"the saved work is incomplete: {error}") from error
    if missing - files.keys():
        raise FileFormatError("the saved work is incomplete: a file is missing")
    return new
