"""The page of the benchmark of actuators, from its trials."""

from __future__ import annotations

from collections.abc import Sequence
from datetime import date
from typing import Any

import numpy as np

import ctrl_realize as cr

from ..honesty.tables import wilson
from .cases import ESTIMATED, LINEAR, WORLDS

WITHIN = 0.1  # relative error that is asked for


def page(rows: Sequence[dict[str, Any]], note: str = "") -> str:
    """Write the tables as Markdown, with a note on how the rows were made."""
    lines = [
        "*Simulated, as many seeds as there are trials. "
        f"`python -m benchmarks.actuators`, {date.today()}, ctrl_realize {cr.__version__}. "
        "In brackets: 95 % intervals of a share.*",
        *(["", note] if note else []),
        "",
        "**Parameters of the actuator**, noise of 0.5 % of the range. Errors of an end of the "
        "travel are parts of what it cuts off:",
        "",
        "| record | trials | parameter | found | within 10 % | interval holds the truth "
        "| median width | dead time held |",
        "|---|---|---|---|---|---|---|---|",
    ]
    for case, names in ESTIMATED.items():
        own = [row for row in rows if row["case"] == case.__name__ and "held" in row]
        for name in names:
            have = [row for row in own if name in row]
            near = sum(abs(row[name]) <= WITHIN for row in have)
            held = sum(row[f"{name} held"] for row in have)
            width = np.median([row[f"{name} width"] for row in have]) if have else np.nan
            lines.append(
                f"| {said(case)} | {len(own)} | {name.replace('_', ' ')} "
                f"| {share(len(have), len(own))} | {share(near, len(own))} "
                f"| {share(held, len(have))} | {100 * width:.2g} % "
                f"| {share(sum(row['held'] for row in own), len(own))} |"
            )
    lines += ["", "**Linear valves:**", "", "| record | trials | no actuator | dead time held |"]
    lines.append("|---|---|---|---|")
    for case in LINEAR:
        own = [row for row in rows if row["case"] == case.__name__ and "held" in row]
        none = sum(not row["kind"] for row in own)
        held = sum(row["held"] for row in own)
        lines.append(
            f"| {said(case)} | {len(own)} | {share(none, len(own))} | {share(held, len(own))} |"
        )
    lines += [
        "",
        '**Dead time** with `actuator="auto"`. A miss is silent if no flag concerns the dead time. '
        "Where an actuator sticks, the dead time lasts until it is pulled loose.",
        "",
        "| world | trials | interval holds | silent misses | actuator chosen | median width "
        "| seconds |",
        "|---|---|---|---|---|---|---|",
    ]
    for case in WORLDS:
        own = [row for row in rows if row["case"] == case.__name__ and "held" in row]
        if not own:
            continue
        lines.append(
            f"| {said(case)} | {len(own)} | {share(sum(row['held'] for row in own), len(own))} "
            f"| {share(sum(row['silent'] for row in own), len(own))} "
            f"| {share(sum(bool(row['kind']) for row in own), len(own))} "
            f"| {np.median([row['width'] for row in own]):.3g} samples "
            f"| {np.median([row['seconds'] for row in own]):.2g} |"
        )
    refused = [row for row in rows if "refused" in row]
    lines += ["", f"{len(refused)} of {len(rows)} records ended in an error.", ""]
    return "\n".join(lines)


def said(case: Any) -> str:
    """First line of the description of a case."""
    return (case.__doc__ or "").strip().splitlines()[0].rstrip(".")


def share(count: int, total: int) -> str:
    if not total:
        return "-"
    low, high = wilson(count, total)
    return f"{100 * count / total:.3g} ({100 * low:.3g}–{100 * high:.3g}) %"
