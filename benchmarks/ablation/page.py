"""The table of rules, and what is told of one record."""

from __future__ import annotations

import platform
from collections.abc import Callable
from dataclasses import dataclass
from datetime import date

import numpy as np
import scipy

import ctrl_realize as cr

KINDS = ("lags", "wrong", "disturbed", "driven", "rare", "measured")


@dataclass(frozen=True)
class Seen:
    """One record with one rule off: times in samples, CPU time in s.

    `error` is signed, outside of the band; `held` tells whether the interval meets the band, and
    `doubted` whether a flag doubts the dead time. `touched` are the rules that touch the record.
    """

    rule: str
    name: str
    kind: str
    error: float = 0.0
    width: float = 0.0
    held: bool = False
    doubted: bool = False
    cpu: float = 0.0
    flags: tuple[str, ...] = ()
    interval: tuple[float, ...] = ()
    touched: tuple[str, ...] = ()
    refused: str = ""

    @property
    def silent(self) -> bool:
        """Whether the interval misses the truth, and no flag says so."""
        return not self.held and not self.doubted and not self.refused


def page(seen: list[Seen], rules: list[str], modes: str, *, all_rules: bool = True) -> list[str]:
    """Write the table, a rule in a row; all but `modes` are tried without it on driven records.

    Without `all_rules` those that were not tried are left out.
    """
    base = {one.name: one for one in seen if one.rule == rules[0]}
    counts = {kind: sum(one.kind == kind for one in base.values()) for kind in KINDS}
    many = ", ".join(f"{counts[kind]} {kind}" for kind in KINDS if counts[kind])
    lines = [
        f"*`python -m benchmarks.ablation`, {date.today().isoformat()}, ctrl_realize "
        f"{cr.__version__}, Python {platform.python_version()}, numpy {np.__version__}, scipy "
        f"{scipy.__version__}; {len(base)} records: {many}. All but the measured ones are "
        "simulated.*",
        "",
        "| without | touched | tried | changed: answer, flags alone | missed | silent | "
        "median width | median error | CPU |",
        "|---|---|---|---|---|---|---|---|---|",
    ]
    plain = base | {o.name: o for o in seen if o.rule == modes and o.kind == "driven"}
    for rule in rules[1:]:
        rows = [one for one in seen if one.rule == rule and one.name in base]
        touched = sum(rule in one.touched for one in base.values())
        if rows or (touched and all_rules):
            if not all_rules:
                touched = sum(rule in base[one.name].touched for one in rows)
            lines.append(_row(rule, touched, rows, base if rule == modes else plain))
    return [*lines, ""]


def _row(rule: str, touched: int, rows: list[Seen], base: dict[str, Seen]) -> str:
    changed = [one for one in rows if moved(one, base[one.name])]
    flags = [one for one in rows if one not in changed and one.flags != base[one.name].flags]
    before = [base[one.name] for one in changed]
    cells = [rule, str(touched), str(len(rows)), f"{len(changed)}, {len(flags)}"]

    def both(of: Callable[[list[Seen]], str]) -> str:
        return f"{of(before)} → {of(changed)}" if changed else "-"

    cells.append(both(lambda some: str(sum(not one.held for one in some))))
    cells.append(both(lambda some: str(sum(one.silent for one in some))))
    cells.append(both(lambda some: _median([one.width for one in some if not one.refused])))
    cells.append(both(lambda some: _median([abs(one.error) for one in some if not one.refused])))
    spent = sum(one.cpu for one in rows) / max(sum(base[one.name].cpu for one in rows), 1e-9)
    cells.append(f"{spent:.2f}" if rows else "-")
    return "| " + " | ".join(cells) + " |"


def _median(values: list[float]) -> str:
    return f"{np.median(values):.2g}" if values else "refused"


def moved(one: Seen, other: Seen) -> bool:
    """Tell whether a rule changes dead time or interval by more than a hundredth of a sample."""
    if one.refused or other.refused:
        return one.refused != other.refused
    here, there = (np.array([a.error, *a.interval]) for a in (one, other))
    return bool(np.any(np.abs(here - there) > 0.01 + 0.001 * np.abs(there)))
