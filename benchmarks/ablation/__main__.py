"""Make the table of rules: ``python -m benchmarks.ablation``.

Every rule is switched off by itself and the same records are identified again. CPU time is that of
`identify` on the records of the row, over that with all rules on, on the same records.
"""

from __future__ import annotations

import argparse
import json
import platform
import time
from collections.abc import Iterable
from dataclasses import asdict, dataclass
from datetime import date
from pathlib import Path

import numpy as np
import scipy

import ctrl_realize as cr
from benchmarks.honesty.trial import quietly
from benchmarks.worlds.judge import DELAY

from .cases import Case, cases
from .switches import SWITCHES, Switch

PAGE = Path(__file__).parents[2] / "docs" / "ablation_table.md"
KINDS = ("lags", "disturbed", "wrong", "driven", "measured")


@dataclass(frozen=True)
class Seen:
    """One record with one rule off: times in samples, CPU time in s.

    `error` is signed, outside of the band; `held` tells whether the interval meets the band, and
    `doubted` whether a flag doubts the dead time.
    """

    rule: str
    name: str
    kind: str
    error: float
    width: float
    held: bool
    doubted: bool
    cpu: float
    failed: str = ""


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seeds", type=int, default=3, help="records of each simulated kind")
    parser.add_argument("--only", nargs="+", help="rules whose name contains one of these")
    parser.add_argument("--store", type=Path, help="file of finished records, one line each")
    parser.add_argument("--output", type=Path, default=PAGE, help="Markdown file to write")
    given = parser.parse_args()
    seen = stored(given.store)
    every = tuple(cases(given.seeds))
    for rule in SWITCHES:
        if given.only and not any(word in rule.name for word in given.only):
            continue
        for case in every:
            if case.kind in rule.of and (rule.name, case.name) not in seen:
                one = judged(rule, case)
                seen[rule.name, case.name] = one
                if given.store is not None:
                    with given.store.open("a", encoding="utf-8") as file:
                        file.write(json.dumps(asdict(one)) + "\n")
    text = "\n".join(page(list(seen.values())))
    given.output.write_text(text, encoding="utf-8")


def stored(path: Path | None) -> dict[tuple[str, str], Seen]:
    """Read what was judged before."""
    if path is None or not path.exists():
        return {}
    found = [Seen(**json.loads(line)) for line in path.read_text(encoding="utf-8").splitlines()]
    return {(one.rule, one.name): one for one in found}


def judged(rule: Switch, case: Case) -> Seen:
    """Identify a record with a rule off."""
    low, high = case.band
    with quietly(), rule.off():
        start = time.process_time()
        try:
            fit = cr.identify(case.records).fit
        except cr.CtrlRealizeError as error:
            return Seen(rule.name, case.name, case.kind, 0, 0, False, False, 0, str(error))
        cpu = time.process_time() - start
    outside = min(fit.dead_time - low, 0.0) + max(fit.dead_time - high, 0.0)
    first, last = fit.interval
    slack = 1e-9 * last
    return Seen(
        rule.name,
        case.name,
        case.kind,
        outside / case.dt,
        (last - first) / case.dt,
        bool(first - slack <= high and low <= last + slack),
        any(flag.code in DELAY for flag in fit.flags),
        cpu,
    )


def page(seen: list[Seen]) -> list[str]:
    """Write the table, one rule in a row."""
    base = {one.name: one for one in seen if one.rule == SWITCHES[0].name}
    counts = {kind: sum(one.kind == kind for one in base.values()) for kind in KINDS}
    many = ", ".join(f"{counts[kind]} {kind}" for kind in KINDS)
    lines = [
        f"*`python -m benchmarks.ablation`, {date.today().isoformat()}, ctrl_realize "
        f"{cr.__version__}, Python {platform.python_version()}, numpy {np.__version__}, scipy "
        f"{scipy.__version__}; records: {many}. All but the measured ones are simulated.*",
        "",
        "RMS: root mean square of the error of the dead time in samples, each error cut at 20; "
        "held: intervals that hold the truth, in percent; width: their median in samples; silent: "
        "records whose interval misses the truth and that no flag doubts; band: measured dead "
        "times in the band that is believed; met: intervals that meet it. A dash: the rule cannot "
        "touch these records, or changed none of them.",
        "",
        "| without | lags: RMS, held, width | disturbed: RMS, held, silent | wrong structure: RMS, "
        "held, silent | driven: RMS, held, width | measured: band, met, width | CPU |",
        "|---|---|---|---|---|---|---|",
    ]
    for rule in SWITCHES:
        rows = [one for one in seen if one.rule == rule.name]
        if rows:
            cells = [_cell(kind, [r for r in rows if r.kind == kind], base) for kind in KINDS]
            spent = sum(r.cpu for r in rows) / sum(base[r.name].cpu for r in rows)
            lines.append(f"| {rule.name} | " + " | ".join(cells) + f" | {spent:.2f} |")
    return [*lines, ""]


def _cell(kind: str, rows: list[Seen], base: dict[str, Seen]) -> str:
    changed = [one for one in rows if not _alike(one, base[one.name])]
    if not rows or (not changed and rows[0].rule != SWITCHES[0].name):
        return "-"
    found = [one for one in rows if not one.failed]
    width = f"{np.median([one.width for one in found]):.1f}"
    if kind == "measured":
        inside = sum(one.error == 0 for one in found)
        return f"{inside} of {len(rows)}, {sum(one.held for one in found)}, {width}"
    errors = np.clip([one.error for one in found], -20, 20)
    rms = f"{np.sqrt(np.mean(errors**2)):.2f}"
    held = f"{100 * np.mean([one.held for one in found]):.0f} %"
    silent = sum(not one.held and not one.doubted for one in found)
    last = f"{silent}" if kind in ("disturbed", "wrong") else width
    failed = f" ({len(rows) - len(found)} failed)" if len(found) < len(rows) else ""
    return f"{rms}, {held}, {last}{failed}"


def _alike(one: Seen, other: Seen) -> bool:
    """Tell whether a rule has made no difference to a record."""
    same = _close([one.error, one.width], [other.error, other.width])
    return same and one.doubted == other.doubted and one.failed == other.failed


def _close(some: Iterable[float], others: Iterable[float]) -> bool:
    return bool(np.allclose(list(some), list(others), rtol=1e-6, atol=1e-6))


if __name__ == "__main__":
    main()
