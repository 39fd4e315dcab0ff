"""Numbers that summary pages quote, read from the stored tables, so that they cannot go stale."""

from __future__ import annotations

import re
from pathlib import Path

Row = list[str]


def rows(text: str, header: str) -> list[Row]:
    """Cells of the first table of a Markdown text whose header line holds these words."""
    lines = text.splitlines()
    top = next(i for i, line in enumerate(lines) if line.startswith("|") and header in line)
    found = []
    for line in lines[top + 2 :]:
        if not line.startswith("|"):
            break
        found.append([cell.strip() for cell in line.strip("|").split("|")])
    return found


def _leading(cell: str) -> float:
    return float(cell.split()[0])


def numbers(docs: Path) -> dict[str, str]:
    """Return name -> text of every number that pages quote as `|name|`."""
    text = {
        name: (docs / "tables" / f"{name}_table.md").read_text(encoding="utf-8") for name in TABLES
    }
    single = next(
        row
        for row in rows(text["accuracy"], "rms error")
        if row[:3] == ["R3", "0.5 %", "output error"]
    )
    peers = {row[0].strip("*"): row for row in rows(text["peers"], "told beforehand")}
    column = 4  # noise of 0.5 %
    others = {
        name: _leading(row[column])
        for name, row in peers.items()
        if not name.startswith(("ctrl_realize", "Cramér")) and row[column][0] != "-"
    }
    best = min(others, key=others.__getitem__)
    step = rows(text["honesty"], "interval of the true structure")
    white = [row for row in step if row[0] == "white"]
    measured = {row[0]: _in_band(row) for row in rows(text["peers_measured"], "told beforehand")}
    rivals = {name: n for name, (n, _) in measured.items() if not name.startswith("ctrl_realize")}
    rival = max(rivals, key=rivals.__getitem__)
    worlds = re.search(
        r"Silent: (\d+) of (\d+) records \((.*?)\); missed at all: (\d+)", text["worlds"]
    )
    fuzz = [int(row[1].replace(" ", "")) for row in rows(text["fuzz"], "cases")]
    defects = rows(text["defects"], "what is wrong")
    scan = next(row for row in rows(text["performance"], "times faster") if "zero-phase" in row[0])
    long = next(
        row for row in rows(text["performance"], "times faster") if "identify, one step" in row[0]
    )
    stated = [row for row in rows(text["acceptance"], "over bound") if row[1] == "structure"]
    assert worlds
    return {
        "error": single[6],
        "error_records": single[3],
        "bound": single[7],
        "ours": peers["ctrl_realize: identify"][column].split()[0],
        "other": f"{others[best]:g}",
        "other_name": best,
        "measured_in": str(measured["ctrl_realize: identify"][0]),
        "measured_all": str(measured["ctrl_realize: identify"][1]),
        "rival_in": str(measured[rival][0]),
        "rival": rival,
        "coverage": f"{_mean(white, 3):.1f} %",
        "coverage_records": _spaced(sum(int(row[2]) for row in white)),
        "white_silent": f"{_mean(white, 5):.1f} %",
        "parameters_ratio": ", ".join(row[5].split()[0] for row in stated),
        "parameters_held": ", ".join(row[7].split()[0] for row in stated) + " %",
        "worlds_silent": worlds[1],
        "worlds_records": worlds[2],
        "worlds_missed": worlds[4],
        "fuzz_cases": _spaced(sum(fuzz)),
        "fuzz_targets": str(len(fuzz)),
        "defects_found": str(sum(row[3] == "found" for row in defects)),
        "defects": str(len(defects)),
        "scan_times": scan[3],
        "long": long[1],
    }


TABLES = ("accuracy", "peers", "peers_measured", "honesty", "worlds", "fuzz", "defects")
TABLES += ("performance", "acceptance")
"""Tables that the numbers are taken from."""


def _mean(chosen: list[Row], column: int) -> float:
    """Return the mean of a rate in percent, weighted by the number of records (column 2)."""
    counts = [int(row[2]) for row in chosen]
    rates = [_leading(row[column]) for row in chosen]
    return sum(n * rate for n, rate in zip(counts, rates, strict=True)) / sum(counts)


def _in_band(row: Row) -> tuple[int, int]:
    """Count the dead times in their band, of how many, over all measured plants of a row."""
    pairs = [(int(n), int(of)) for n, of in re.findall(r"(\d+) of (\d+) /", " ".join(row))]
    return sum(n for n, _ in pairs), sum(of for _, of in pairs)


def _spaced(count: int) -> str:
    return f"{count:,}".replace(",", "\u00a0")
