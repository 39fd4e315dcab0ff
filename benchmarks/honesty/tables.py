"""Tables of what was seen, each rate with Wilson's interval."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterable, Sequence

import numpy as np

from .runs import FLAG_CASES, world
from .single import DOUBTS
from .trial import Seen
from .worlds import KINDS, NOISES


def wilson(hits: float, runs: int, z: float = 1.96) -> tuple[float, float]:
    """Return Wilson's 95 % interval of a rate.

    Examples
    --------
    >>> low, high = wilson(95, 100)
    >>> print(f"{low:.3f} {high:.3f}")
    0.888 0.978
    """
    if runs == 0:
        return 0.0, 1.0
    rate = hits / runs
    centre = rate + z**2 / (2 * runs)
    half = z * np.sqrt(rate * (1 - rate) / runs + z**2 / (4 * runs**2))
    scale = 1 + z**2 / runs
    low, high = float((centre - half) / scale), float((centre + half) / scale)
    # Of none and of all the end is exact; rounding makes it 1e-16.
    return max(low, 0.0) if hits else 0.0, min(high, 1.0) if hits < runs else 1.0


def rate(hits: float, runs: int) -> str:
    """Write a rate with Wilson's interval, in percent."""
    if runs == 0:
        return "no run"
    low, high = wilson(hits, runs)
    return f"{_percent(hits / runs)} ({_percent(low)}–{_percent(high)}) %"


def _percent(share: float) -> str:
    return f"{100 * share:.3g}" if share >= 0.0995 or share == 0 else f"{100 * share:.2g}"


def _line(cells: Iterable[object]) -> str:
    return "| " + " | ".join(str(cell).replace("|", r"\|") for cell in cells) + " |"


def _head(*titles: str) -> list[str]:
    return [_line(titles), "|" + "---|" * len(titles)]


def _covered(group: Sequence[Seen], name: str) -> tuple[float, int]:
    values = [one.covered[name] for one in group if name in one.covered]
    return float(np.sum(values)), len(values)


def _numbers(group: Sequence[Seen], name: str) -> np.ndarray:
    return np.array([one.numbers[name] for one in group if name in one.numbers])


def _groups(seen: Iterable[Seen], *names: str) -> dict[tuple[object, ...], list[Seen]]:
    found: dict[tuple[object, ...], list[Seen]] = defaultdict(list)
    for one in seen:
        found[tuple(getattr(one, name) for name in names)].append(one)
    return found


FIT_TITLES = (
    "records",
    "interval",
    "missed early, late",
    "missed without a word",
    "dead time ∓ 1.96 std",
    "interval of the true structure",
    "median width",
    "median error",
    "at noise level",
)


def _fit_cells(group: list[Seen]) -> list[str]:
    """Cells of one row of the main study."""
    answered = [one for one in group if not one.failed]
    if not answered:
        return [f"{len(group)}, none answered", *[""] * (len(FIT_TITLES) - 1)]
    count = len(answered)
    own = rate(*_covered(answered, "own structure"))
    sides = [100 * _numbers(answered, name).mean() for name in ("late", "early")]
    return [
        f"{count}" if count == len(group) else f"{count} of {len(group)}",
        rate(*_covered(answered, "interval")),
        f"{sides[0]:.2g}, {sides[1]:.2g} %",
        rate(float(_numbers(answered, "silent miss").sum()), count),
        rate(*_covered(answered, "std")),
        "" if own == "no run" else own,
        f"{np.median(_numbers(answered, 'width')):.3g}",
        f"{np.median(np.abs(_numbers(answered, 'error'))):.2g}",
        f"{100 * _numbers(answered, 'noise level').mean():.0f} %",
    ]


def fit_tables(seen: list[Seen]) -> list[str]:
    """Coverage of fit_output_error by world and noise level, then by plant."""
    lines = _head("world", "noise", *FIT_TITLES)
    by_noise, by_plant = _groups(seen, "kind", "noise"), _groups(seen, "kind", "plant")
    for kind in KINDS:
        for noise in NOISES:
            if (kind, noise) in by_noise:
                lines.append(
                    _line([kind, f"{100 * noise:g} %", *_fit_cells(by_noise[kind, noise])])
                )
    lines += ["", "The same records by plant:", "", *_head("world", "plant", *FIT_TITLES)]
    for kind in KINDS:
        for (which, plant), group in by_plant.items():
            if which == kind:
                lines.append(_line([kind, plant, *_fit_cells(group)]))
    return lines


def fit_flag_table(seen: list[Seen]) -> list[str]:
    """How often each flag of fit_output_error came up in the worlds of the main study."""
    groups = {kind: [s for s in seen if s.kind == kind and not s.failed] for kind in KINDS}
    codes = sorted({code for one in seen for code in one.flags})
    lines = _head("flag of fit_output_error", *KINDS)
    for code in codes:
        cells = [rate(sum(code in s.flags for s in g), len(g)) for g in groups.values()]
        lines.append(_line([f"`{code}`", *cells]))
    return lines


def interval_table(seen: list[Seen]) -> list[str]:
    """Coverage of all other intervals: noise levels beside each other."""
    seen = [one for one in seen if not one.failed]
    names = list(dict.fromkeys(name for one in seen for name in one.covered))
    groups = _groups(seen, "kind", "noise")
    lines = _head("interval", "world", *(f"{100 * n:g} %" for n in NOISES), "all", "records")
    for name in names:
        for kind in KINDS:
            found = [_covered(groups.get((kind, noise), []), name) for noise in NOISES]
            total, runs = sum(f[0] for f in found), sum(f[1] for f in found)
            if not runs:
                continue
            cells = [f"{100 * hits / n:.0f} %" if n else "" for hits, n in found]
            lines.append(_line([name, kind, *cells, rate(total, runs), runs]))
    return lines


def refusal_table(seen: list[Seen]) -> list[str]:
    """Cases in which an error came instead of an answer."""
    groups = _groups([one for one in seen if one.failed], "study", "kind")
    if not groups:
        return ["No case was refused."]
    runs = _groups(seen, "study", "kind")
    lines = _head("study", "world", "refused", "for example")
    for key, group in groups.items():
        lines.append(_line([*key, f"{len(group)} of {len(runs[key])}", group[0].failed[:120]]))
    return lines


def flag_table(seen: list[Seen]) -> list[str]:
    """Misses and false alarms of every flag."""
    groups = _groups(seen, "kind", "plant")
    lines = _head("flag", "of", "due", "missed", "not due", "false alarms", "seeds")
    for case in FLAG_CASES:
        due = groups.get((world(case, "due"), "due"), [])
        quiet = groups.get((world(case, "not due"), "not due"), [])
        if not due:
            continue
        missed = sum(case.code not in one.flags for one in due)
        alarms = sum(case.code in one.flags for one in quiet)
        cells = [rate(missed, len(due)), case.not_due, rate(alarms, len(quiet))]
        lines.append(_line([f"`{case.code}`", case.result, case.due, *cells, len(due)]))
    return lines


def explanation() -> str:
    """Say what the columns of the main table mean."""
    doubts = ", ".join(f"`{code}`" for code in DOUBTS)
    return (
        "Nominal is 95 %. A miss is *early* where the interval ends before the truth, *late* "
        "where it begins after it, and *without a word* where none of the flags "
        f"{doubts} was raised. Widths and errors in samples."
    )
