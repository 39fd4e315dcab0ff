"""State of a session, and the commands that change it: JSON in, JSON out, nothing else."""

from __future__ import annotations

import copy
from collections.abc import Callable, Mapping
from typing import Any, TypeAlias

from .._checks import one_of, real
from .._parameters import SECONDS
from ..design.tuning.layouts import LAYOUTS
from ..design.tuning.pid import KINDS, RULES
from ..errors import FileFormatError, OptionError
from .records import NEW

State: TypeAlias = dict[str, Any]
Change: TypeAlias = Callable[[State, Mapping[str, Any]], None]

EMPTY: State = {
    "records": [],
    "frf": None,
    "selected": 0,
    "model": {"structure": None, "known": {}},
    "loop": {
        "kind": "PI", "rule": "simc", "speed": 0.5, "form": "ideal", "time_unit": None,
        "measured_range": None, "output_range": None, "limits": None,
        "setpoint": 1.0, "load": 1.0,
    },
    "plan": None,
}  # fmt: skip
READING = (
    "time", "input", "output", "dt", "time_unit", "missing", "resample", "delimiter", "decimal",
    "skip_rows", "header", "variable", "time_zone", "na_values", "wrap",
)  # fmt: skip
"""Arguments of `read_record` that a page may give."""
WANTED = ("dead_time", "gain", "phase", "Ms")


def changed(state: State, command: Mapping[str, Any]) -> State:
    """Return the state after a command; the one before is left as it was.

    Raises
    ------
    OptionError
        An unknown command, or a value that it does not take.
    """
    name = one_of(str(command.get("do")), "do", tuple(CHANGES))
    new = copy.deepcopy(state)
    CHANGES[name](new, command)
    return new


def checked(state: Any, files: Mapping[str, bytes]) -> State:
    """Check a state that comes from a file.

    Raises
    ------
    FileFormatError
        It is not one, or a file of it is missing.
    """
    try:
        rows = [*state["records"], *([state["frf"]] if state["frf"] else [])]
        names = all(set(row) >= {"file", "name"} for row in rows)
        whole = all(set(row) >= NEW.keys() and set(row["options"]) <= set(READING)
                    for row in state["records"])  # fmt: skip
        same = state.keys() == EMPTY.keys() and state["loop"].keys() == EMPTY["loop"].keys()
        if not (names and whole and same and all(row["file"] in files for row in rows)):
            raise KeyError("records")
    except (TypeError, KeyError, AttributeError) as error:
        raise FileFormatError(f"the saved work is incomplete: {error}") from error
    found: State = state
    return found


def _row(state: State, command: Mapping[str, Any]) -> State:
    index, rows = command.get("index", state["selected"]), state["records"]
    if not (type(index) is int and 0 <= index < len(rows)):
        raise OptionError(f"index={index!r}; expected a record, 0...{len(rows) - 1}")
    row: State = rows[index]
    return row


def _pair(command: Mapping[str, Any], low: str, high: str) -> list[float]:
    first = real(command.get(low), low, "number")
    last = real(command.get(high), high, "number")
    return [min(first, last), max(first, last)]


def _add(state: State, command: Mapping[str, Any]) -> None:
    row = copy.deepcopy(NEW) | {key: command[key] for key in ("file", "name", "options")}
    row |= {key: command[key] for key in ("path", "given") if command.get(key)}
    state["records"].append(row)
    state["selected"] = len(state["records"]) - 1


def _add_response(state: State, command: Mapping[str, Any]) -> None:
    state["frf"] = {key: command.get(key) for key in ("file", "name", "path")}


def _remove(state: State, command: Mapping[str, Any]) -> None:
    state["records"].remove(_row(state, command))
    state["selected"] = max(0, min(state["selected"], len(state["records"]) - 1))


def _select(state: State, command: Mapping[str, Any]) -> None:
    _row(state, command)
    state["selected"] = command["index"]


def _use(state: State, command: Mapping[str, Any]) -> None:
    _row(state, command)["used"] = bool(command.get("used"))


def _read(state: State, command: Mapping[str, Any]) -> None:
    options = {
        key: value for key, value in command.get("options", {}).items() if value not in (None, "")
    }
    if unknown := sorted(options.keys() - set(READING)):
        raise OptionError(f"options has {', '.join(unknown)}; expected some of {READING}")
    _row(state, command)["options"] = options


def _units(state: State, command: Mapping[str, Any]) -> None:
    given = {key: str(command[key])[:40] for key in ("input", "output") if key in command}
    _row(state, command)["units"] |= given


def _range(state: State, command: Mapping[str, Any]) -> None:
    _row(state, command)["range"] = _pair(command, "start", "stop")


def _rest(state: State, command: Mapping[str, Any]) -> None:
    start = command.get("start")
    _row(state, command)["rest"] = [
        real(command.get("input"), "input", "level at rest"),
        real(command.get("output"), "output", "level at rest"),
        None if start is None else real(start, "start", "time in s"),
    ]


def _shift(state: State, command: Mapping[str, Any]) -> None:
    _row(state, command)["shift"] = real(command.get("shift"), "shift", "time in s")


def _strike(state: State, command: Mapping[str, Any]) -> None:
    _row(state, command)["struck"].append(_pair(command, "start", "stop"))


def _restore(state: State, command: Mapping[str, Any]) -> None:
    row = _row(state, command)
    kept = ("file", "name", "path", "given", "options", "used", "units")
    row |= copy.deepcopy({key: value for key, value in NEW.items() if key not in kept})


def _structure(state: State, command: Mapping[str, Any]) -> None:
    given = command.get("structure")
    if given is not None:
        order, degree = (int(one) for one in given)
        given = [order, degree]
    state["model"] = {"structure": given, "known": {}}


def _known(state: State, command: Mapping[str, Any]) -> None:
    name, value = str(command.get("name")), command.get("value")
    known = state["model"]["known"]
    if value is None:
        known.pop(name, None)
    else:
        known[name] = real(value, name, "value of a parameter")


def _tune(state: State, command: Mapping[str, Any]) -> None:
    loop = state["loop"]
    given = {key: value for key, value in command.items() if key in loop}
    one_of(given.get("kind", loop["kind"]), "kind", KINDS)
    one_of(given.get("rule", loop["rule"]), "rule", RULES)
    one_of(given.get("form", loop["form"]), "form", tuple(LAYOUTS))
    if given.get("time_unit") is not None:
        one_of(given["time_unit"], "time_unit", tuple(SECONDS))
    for key in ("speed", "setpoint", "load"):
        if given.get(key) is not None:
            given[key] = real(given[key], key, "number")
    for key in ("measured_range", "output_range", "limits"):
        if given.get(key) is not None:
            low, high = (real(end, key, "end of a range") for end in given[key])
            if not low < high:
                raise OptionError(f"{key} is {low:g} to {high:g}; expected the lower end first")
            given[key] = [low, high]
    loop |= given


def _plan(state: State, command: Mapping[str, Any]) -> None:
    if command.get("want") is None:
        state["plan"] = None
        return
    time = command.get("time")
    state["plan"] = {
        "want": one_of(command["want"], "want", WANTED),
        "time": None if time is None else real(time, "time", "length of the test in s"),
    }


CHANGES: dict[str, Change] = {
    "add": _add, "add_response": _add_response, "remove": _remove, "select": _select, "use": _use,
    "read": _read, "units": _units, "range": _range, "rest": _rest, "shift": _shift,
    "strike": _strike, "restore": _restore, "structure": _structure, "known": _known,
    "tune": _tune, "plan": _plan,
}  # fmt: skip
