"""Which columns are time, input and output: as requested, or by their names."""

from __future__ import annotations

import math
import re
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from itertools import product

import numpy as np

from ..._facts import facts
from ...errors import DataError, OptionError, warn_caller
from ...numerics.arrays import FloatArray
from ...numerics.signals.jumps import moves_in_steps
from ..cells import kind_of
from ..columns import (
    Selector,
    ambiguous,
    family,
    find_column,
    find_columns,
    has_header,
    holds_numbers,
    named,
    plain_name,
)
from ..tables import Column, Table
from ..units import TIME_UNITS, is_no_time, plain_unit, sample_time_unit, split_unit, to_seconds

NAMES = {key: frozenset(words) for key, words in facts("io/words.toml")["columns"].items()}
"""Names of columns by what they hold, and the last parts of tags, such as ``TIC101_PV``."""
MODES = facts("io/words.toml")["modes"]
"""Words of a controller's mode."""
_SAME = 1 - 1e-4  # correlation: all but a hundredth, as of rounded values


@dataclass(frozen=True)
class Parts:
    """Positions of the columns.

    ``dt`` is used if there is no time column; ``date`` is the date of a time of day. `references`
    are the set points of the outputs, if there are any, and `mode` the mode of their controller.
    """

    time: int | None
    date: int | None
    dt: float
    inputs: list[int]
    outputs: list[int]
    references: Sequence[int] = ()
    mode: int | None = None


def choose_columns(
    table: Table,
    time: str | int | None,
    input: Selector | None,
    output: Selector | None,
    dt: float | None,
    taken: Sequence[int] = (),
    reference: Selector | None = None,
    mode: str | int | None = None,
) -> Parts:
    """Assign columns to signals; `taken` are those with another meaning.

    Raises
    ------
    OptionError
        A requested column does not exist, or the names do not tell; the columns are listed.
    """
    if time is not None and dt is not None:
        raise OptionError("expected time= or dt=, got both")
    inputs = [] if input is None else find_columns(table, input, "input")
    outputs = [] if output is None else find_columns(table, output, "output")
    references = [] if reference is None else find_columns(table, reference, "reference")
    modes = _modes(table, taken) if mode is None else [find_column(table, mode, "mode")]
    taken = [*taken, *modes, *references]
    clock, step = None if time is None else find_column(table, time, "time"), dt
    if clock is None and dt is None:
        clock, step = _guessed_clock(table, [*inputs, *outputs, *taken])
    # with dt= given, a time column in the file is still not a signal
    clocks = clocks_of(table, taken, every=True) if clock is None else [clock]
    clocks += dates_of(table, clock, taken)
    known = [*clocks, *taken, *clocks_of(table, [*clocks, *inputs, *outputs, *taken], every=True)]
    setpoints = named(table, NAMES["setpoint"]) + _tagged(table, NAMES["setpoint_tag"], known)
    others = [k for k in range(len(table.columns)) if k not in (*known, *setpoints)]
    loop = bool(setpoints) and sum(holds_numbers(table, k) for k in others) > 1
    inputs = inputs or _signals(table, "input", [*known, *outputs], loop)
    outputs = outputs or _signals(table, "output", [*known, *inputs], loop)
    rest = [
        k
        for k in range(len(table.columns))
        if k not in (*known, *inputs, *outputs) and holds_numbers(table, k)
    ]
    if not inputs and not outputs and not has_header(table) and len(rest) == 2:
        inputs, outputs, rest = rest[:1], rest[1:], []
    if not inputs and len(rest) == (not outputs):  # words of a switch, such as ON and OFF
        unread = set(range(len(table.columns))) - {*known, *outputs, *rest}
        rest += [k for k in sorted(unread) if _moves(table, k)]
    if len(rest) > 1:
        rest = [k for k in rest if k not in setpoints and _moves(table, k)]
    if not inputs and len(rest) > 1:
        stepping = moves_in_steps([_values(table, k) for k in rest])
        inputs = [] if stepping is None else [rest.pop(stepping)]
        if inputs and (outputs or len(rest) == 1):
            outputs = outputs or rest
            warn_caller(
                f"{table.at(inputs[0])} is taken as input, since it moves in "
                f"steps, and {table.title(outputs[0])} as output; input= and output= say otherwise"
            )
    elif len(rest) == 1 and bool(inputs) != bool(outputs):
        inputs, outputs = inputs or rest, outputs or rest
    for signal, found in (("input", inputs), ("output", outputs)):
        if not found:
            raise OptionError(
                f"{table.path}: cannot tell which column is the {signal}; give {signal}=name or "
                f"number; it has {table.listing()}"
            )
    used = [*inputs, *outputs] + ([] if clock is None else [clock])
    if len(set(used)) != len(used):
        raise OptionError("a column is selected twice among time=, input= and output=")
    if reference is None:
        free = {k for k in setpoints if k not in (*used, *taken) and holds_numbers(table, k)}
        references = sorted(free) if len(free) == len(outputs) else []
        _no_cascade(table, inputs, references)
    elif len(references) != len(outputs):
        raise OptionError(
            f"reference={reference!r} selects {len(references)} columns; expected one for each of "
            f"{len(outputs)} outputs"
        )
    date = next((k for k in clocks if k != clock), None) if clock is not None else None
    step = math.nan if step is None else step
    return Parts(clock, date, step, inputs, outputs, references, modes[0] if modes else None)


def _signals(table: Table, kind: str, taken: Sequence[int], loop: bool) -> list[int]:
    """Columns of a signal by their names: whole names first, then the last part of a tag.

    What is called output in a `loop`, beside a set point, is that of the controller.
    """
    own = NAMES["controller_output"] if loop else frozenset()
    names = NAMES[kind] | own if kind == "input" else NAMES[kind] - own
    other = {"input": "output", "output": "input"}[kind]
    found = named(table, names, taken) or _tagged(table, NAMES[f"{kind}_tag"], taken)
    if not found and _tagged(table, NAMES[f"{other}_tag"], ()):
        found = _tagged(table, NAMES["either_tag"], taken)
    own_names = [table.columns[k].name for k in found]
    families = {family(name) for name in own_names}
    loops = {split_unit(name)[0].rpartition(".")[0] for name in own_names}
    # channels have one name with numbers; two different names of a loop are two candidates, and so
    # are equal ones of two loops
    if (len(families) > 1 or len(loops) > 1) and families & (
        NAMES["input_tag"] | NAMES["output_tag"]
    ):
        raise ambiguous(table, found, f"the {kind}", kind)
    return found


def _no_cascade(table: Table, inputs: Sequence[int], references: Sequence[int]) -> None:
    """Refuse the loops of a cascade as one plant: the one moves the set point of the other."""
    for k, r in product(inputs, references if len(references) > 1 else ()):
        both = np.stack([table.numbers(at, keep_missing=True) for at in (k, r)])
        both = both[:, np.isfinite(both).all(axis=0)]
        if (np.ptp(both, axis=1) > 0).all() and np.corrcoef(both)[0, 1] > _SAME:
            raise OptionError(
                f"{table.at(r)} follows {table.title(k)}, as the set point of an "
                "inner loop follows the controller of an outer one; read one loop at a time with "
                "input=, output= and reference="
            )


def _modes(table: Table, taken: Iterable[int]) -> list[int]:
    """Column of the mode of a controller, if one is so named and says what is known."""
    found = named(table, NAMES["mode"], taken) or _tagged(table, NAMES["mode_tag"], taken)
    return found if len(found) == 1 and not strange_modes(table, found[0]) else []


def strange_modes(table: Table, index: int) -> set[str]:
    """Cells of a column that are no mode of a controller."""
    known = {*MODES["manual"], *MODES["automatic"], ""}
    return {mode_word(cell) for cell in table.columns[index].cells.tolist()} - known


def mode_word(cell: object) -> str:
    """Mode in a cell, as it is compared: ``1.0 -> "1"``."""
    return str(cell).strip().casefold().removesuffix(".0")


def _tagged(table: Table, tags: Iterable[str], taken: Iterable[int]) -> list[int]:
    """The one column whose name ends in one of `tags`; none if there are several."""
    used = set(taken)
    found = [
        k
        for k, column in enumerate(table.columns)
        if k not in used and re.split(r"[ _./:\\-]+", plain_name(column.name))[-1] in tags
    ]
    return found if len(found) == 1 else []


def clocks_of(table: Table, taken: Iterable[int] = (), *, every: bool = False) -> list[int]:
    """Columns of time by their names or units: those with dates before others, and `every` one."""
    told = [k for k in named(table, NAMES["time"], taken) if not is_no_time(table.columns[k].unit)]
    found = [k for k in told if table.columns[k].name != "T" or _runs(table, k)] or [
        k
        for k, one in enumerate(table.columns)
        if k not in set(taken) and plain_unit(one.unit) in TIME_UNITS and _runs(table, k)
    ]
    if every or not found:
        return found
    found = [k for k in found if not holds_numbers(table, k)] or found
    first, *more = [table.columns[k] for k in found]
    # each signal may have its own column of the same time
    same = all(first.name == one.name and np.array_equal(first.cells, one.cells) for one in more)
    return found[:1] if same else found


def _runs(table: Table, index: int) -> bool:
    """Whether a column that may be a temperature increases as a time does."""
    steps = np.diff(_values(table, index))
    usual = float(np.median(steps)) if steps.size else 0.0
    return bool(usual > 0 and steps.min() >= 0 and steps.max() <= 3 * usual)


def _moves(table: Table, index: int) -> bool:
    """Whether a column may be a signal: it counts no rows, and is not constant."""
    told = {plain_name(table.columns[index].name), plain_unit(table.columns[index].unit)}
    steps = set(np.diff(_values(table, index)).tolist())
    counts = told & NAMES["counter"] or (steps == {1.0} and not table.columns[index].name)
    return not counts and steps not in (set(), {0.0})


def _shows_time(column: Column) -> bool:
    """Whether the first cells of a column are dates or times of day."""
    cells = [str(cell).strip() for cell in column.first(3)]
    return bool(cells) and all(kind_of(cell, ".") == "time" for cell in cells)


def _values(table: Table, index: int) -> FloatArray:
    """Numbers of a column without missing ones; none if it has other cells."""
    try:
        values: FloatArray = table.numbers(index, keep_missing=True)
    except DataError:
        return np.empty(0)
    return values[~np.isnan(values)]


def dates_of(table: Table, clock: int | None, taken: Iterable[int] = ()) -> list[int]:
    """Columns of dates beside that of time."""
    used = {*taken, *([] if clock is None else [clock])}
    return [k for k in named(table, NAMES["date"], used) if not holds_numbers(table, k)]


def _guessed_clock(table: Table, taken: Sequence[int]) -> tuple[int | None, float | None]:
    """Time column by name, otherwise the sample time in the file, otherwise the first column."""
    clocks = clocks_of(table, taken) or dates_of(table, None, taken)
    if not clocks:  # days of a spreadsheet
        dates = named(table, NAMES["date"], taken)
        clocks = [k for k in dates if np.all(np.diff(_values(table, k)) > 0)]
    if len(clocks) == 1:
        return clocks[0], None
    if len(clocks) > 1:
        raise ambiguous(table, clocks, "time", "time")
    for key, value in table.constants.items():
        plain = key.rpartition(".")[2].replace("_", " ").lower()
        unit = sample_time_unit(key)
        if unit or plain in NAMES["sample_time"] | NAMES["sample_rate"]:
            step = 1 / value if plain in NAMES["sample_rate"] and value else value
            step = float(to_seconds(np.asarray(step), unit or "s"))
            if not (math.isfinite(step) and step > 0):
                raise DataError(f"{table.path}: {key}={value} is not a sample time; give dt=")
            return None, step
    dated = [k for k, one in enumerate(table.columns) if k not in taken and _shows_time(one)]
    if len(dated) == 1:
        return dated[0], None
    if 0 not in taken and not has_header(table) and len(table.columns) >= 3:
        return 0, None
    raise OptionError(
        f"{table.path}: cannot tell which column is time; give time=name or number, or dt= in "
        f"s; it has {table.listing()}"
    )
