"""Make the tables of rules: ``python -m benchmarks.ablation``.

Every rule is switched off by itself, and the records that it touches (those on which it is asked
for) are identified again, at most `MOST` of each kind. CPU time is that of `identify`, over that
with all rules on, on the same records. With `--made-for` each of the rules for rare records is
tried on records of its own world alone: what it does where it is needed.
"""

from __future__ import annotations

import argparse
import json
import time
from collections.abc import Iterator
from dataclasses import asdict, replace
from itertools import zip_longest
from pathlib import Path

import numpy as np

import ctrl_realize as cr
from benchmarks.honesty.trial import quietly
from benchmarks.worlds.judge import DELAY
from ctrl_realize.numerics.rules import Rule, asked, without

from . import rare
from .cases import Case, cases, of_world
from .page import KINDS, Seen, page

DOCS = Path(__file__).parents[2] / "docs" / "tables"
PAGE, OWN_WORLDS = DOCS / "ablation_table.md", DOCS / "ablation_worlds_table.md"
MOST, FEW = 6, 12
"""Records of a kind on which a rule is tried, evenly among those that it touches; where these are
few, all of them."""
BASE = "all rules on"


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seeds", type=int, default=1, help="records of each simulated kind")
    parser.add_argument("--only", nargs="+", help="rules whose name contains one of these")
    parser.add_argument("--kinds", nargs="+", choices=KINDS, help="kinds of records, not all")
    parser.add_argument("--store", type=Path, help="file of finished records, one line each")
    parser.add_argument("--made-for", type=int, metavar="N", help="N records of each rule's world")
    parser.add_argument("--output", type=Path, help="Markdown file to write, instead of the page")
    given = parser.parse_args()
    seen = stored(given.store)
    rules = [
        rule for rule in Rule if not given.only or any(word in rule.value for word in given.only)
    ]

    def keep(one: Seen) -> None:
        seen[one.rule, one.name] = one
        if given.store is not None:
            with given.store.open("a", encoding="utf-8") as file:
                file.write(json.dumps(asdict(one)) + "\n")

    if given.made_for:
        own = in_own_worlds(rules, given.made_for)
        for rule, case in own:
            if (BASE, case.name) not in seen:
                keep(judged(case))
            if (rule.value, case.name) not in seen:
                keep(judged(case, rule))
        wanted = {(one, case.name) for rule, case in own for one in (BASE, rule.value)}
        found = [one for key, one in seen.items() if key in wanted]
        write(found, given.output or OWN_WORLDS, all_rules=False)
        return
    every = tuple(
        case for case in cases(given.seeds) if not given.kinds or case.kind in given.kinds
    )
    for case in in_turn(every):
        if (BASE, case.name) not in seen:
            keep(judged(case))
    # Without modes first: that is what other rules are compared with where inputs are no steps.
    for case in every:
        touched = seen[BASE, case.name].touched
        if Rule.MODES.value in touched and (Rule.MODES.value, case.name) not in seen:
            keep(judged(case, Rule.MODES))
    for case, rule in pairs(every, rules, seen):
        if (rule.value, case.name) not in seen:
            keep(judged(case, rule))
    names = {case.name for case in every}
    wanted = [BASE, *(rule.value for rule in rules)]
    found = [one for one in seen.values() if one.name in names and one.rule in wanted]
    write(found, given.output or PAGE, all_rules=not given.only)


def write(seen: list[Seen], output: Path, *, all_rules: bool = True) -> None:
    """Write the table of what was judged."""
    names = [BASE, *(rule.value for rule in Rule)]
    lines = page(seen, names, Rule.MODES.value, all_rules=all_rules)
    output.write_text("\n".join(lines), encoding="utf-8")


def in_own_worlds(rules: list[Rule], count: int) -> list[tuple[Rule, Case]]:
    """Rules for rare records, with some records of the world that each was made for."""
    return [
        (rule, of_world("rare", rare.MADE_FOR[rule], seed))
        for rule in rules
        if rule in rare.MADE_FOR
        for seed in range(count)
    ]


def in_turn(every: tuple[Case, ...]) -> Iterator[Case]:
    """Take the kinds in turn, so that a run that is stopped has seen some of each."""
    kinds = [[case for case in every if case.kind == kind] for kind in KINDS]
    for some in zip_longest(*kinds):
        yield from (case for case in some if case is not None)


def pairs(
    every: tuple[Case, ...], rules: list[Rule], seen: dict[tuple[str, str], Seen]
) -> Iterator[tuple[Case, Rule]]:
    """Records and the rules that are tried on them."""
    tried: dict[str, list[Rule]] = {case.name: [] for case in every}
    for rule in rules:
        for kind in KINDS:
            touched = [
                case.name
                for case in every
                if case.kind == kind and rule.value in seen[BASE, case.name].touched
            ]
            count = len(touched) if len(touched) <= FEW else MOST
            for i in np.linspace(0, len(touched) - 1, count).round().astype(int):
                tried[touched[i]].append(rule)
    for case in in_turn(every):
        yield from ((case, rule) for rule in tried[case.name])


def stored(path: Path | None) -> dict[tuple[str, str], Seen]:
    """Read what was judged before."""
    if path is None or not path.exists():
        return {}
    lines = [json.loads(line) for line in path.read_text(encoding="utf-8").splitlines()]
    found = [
        Seen(**{k: tuple(v) if isinstance(v, list) else v for k, v in a.items()}) for a in lines
    ]
    return {(one.rule, one.name): one for one in found}


def judged(case: Case, rule: Rule | None = None) -> Seen:
    """Identify a record with a rule off; with all rules on, see which of them touch it."""
    low, high = case.band
    off = set() if rule is None else {rule}
    if off and case.kind == "driven":
        off.add(Rule.MODES)
    one = Seen(BASE if rule is None else rule.value, case.name, case.kind)
    fit = None
    with quietly(), without(*off), asked() as rules:
        start = time.process_time()
        try:
            fit = cr.identify(case.records).fit
        except cr.CtrlRealizeError as error:
            one = replace(one, refused=str(error))
        except Exception as error:  # what stands on a rule may break without it
            if not off:
                raise
            one = replace(one, refused=f"breaks: {error!r}")
        cpu = time.process_time() - start
    if not off:
        one = replace(one, touched=tuple(sorted(each.value for each in rules)))
    if fit is None:
        return one
    outside = min(fit.dead_time - low, 0.0) + max(fit.dead_time - high, 0.0)
    first, last = fit.interval
    slack = 1e-9 * last
    codes = {flag.code for flag in fit.flags}
    return replace(
        one,
        error=outside / case.dt,
        width=(last - first) / case.dt,
        held=bool(first - slack <= high and low <= last + slack),
        doubted=bool(codes & DELAY),
        cpu=cpu,
        flags=tuple(sorted(codes)),
        interval=(first / case.dt, last / case.dt),
    )


if __name__ == "__main__":
    main()
