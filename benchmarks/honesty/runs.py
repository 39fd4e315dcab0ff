"""Run cases in parallel, keep each as it finishes, stop when the time is over."""

from __future__ import annotations

import json
import time
from collections.abc import Collection, Iterator
from dataclasses import dataclass
from itertools import islice
from pathlib import Path

from joblib import Parallel, delayed

import ctrl_realize as cr

from . import (
    driven_intervals,
    flag_other_cases,
    flag_record_cases,
    flag_step_cases,
    single,
    step_intervals,
)
from .flag_case import FlagCase
from .trial import Seen, Trial, quietly
from .worlds import KINDS, MORE_WRONG, NOISES, WRONG

Task = tuple[str, str, str, float, int]
"""Study, kind of noise, plant, noise level, seed; of a flag its world, and which side it is."""

FLAG_CASES: list[FlagCase] = [
    *flag_step_cases.CASES,
    *flag_other_cases.CASES,
    *flag_record_cases.CASES,
]


@dataclass(frozen=True)
class Study:
    """A trial, how many seeds it is given for one; `by_plant` draws the plant with the seed."""

    trial: Trial
    share: int = 1
    by_plant: bool = True


STUDIES: dict[str, Study] = {
    "given": Study(step_intervals.given, 4),
    "scans": Study(step_intervals.scans, 4),
    "views": Study(step_intervals.views),
    "several": Study(step_intervals.several),
    "tracked": Study(step_intervals.tracked, 4),
    "pulses": Study(driven_intervals.pulses, 4, by_plant=False),
    "any input": Study(driven_intervals.any_input, by_plant=False),
    "joined": Study(driven_intervals.joined, by_plant=False),
    "responses": Study(driven_intervals.responses, 4, by_plant=False),
    "response fits": Study(driven_intervals.response_fits, by_plant=False),
    "noise spectra": Study(driven_intervals.noise_spectra, 4, by_plant=False),
    "sines": Study(driven_intervals.sines, 4, by_plant=False),
}


def main_tasks(seeds: int) -> list[Task]:
    """Single fits, seed by seed, so that a run that is stopped has seen all worlds alike."""
    tasks = [("fit", kind, *single.cell(kind, k), k) for k in range(seeds) for kind in KINDS]
    # After the others, a sixth as often each, as every other plant of wrong structure.
    return tasks + [
        ("fit", "wrong structure", plant, NOISES[k % len(NOISES)], k)
        for k in range(seeds // len(WRONG))
        for plant in MORE_WRONG
    ]


def interval_tasks(seeds: int) -> list[Task]:
    """Other intervals; the noise level goes round with the seed, so that every case is its own."""
    tasks = []
    for k in range(max(study.share for study in STUDIES.values()) * seeds):
        for name, study in STUDIES.items():
            if k >= study.share * seeds:
                continue
            for kind in KINDS:
                plant, noise = single.cell(kind, k)
                if not study.by_plant:
                    plant, noise = "two lags", NOISES[k % len(NOISES)]
                tasks.append((name, kind, plant, noise, k))
    return tasks


def world(case: FlagCase, side: str) -> str:
    """Name of the world of a flag case; cases that share one share its runs."""
    return f"{case.result}: {case.due if side == 'due' else case.not_due}"


def _flag_worlds() -> dict[tuple[str, str], FlagCase]:
    found: dict[tuple[str, str], FlagCase] = {}
    for case in FLAG_CASES:
        for side in ("due", "not due"):
            found.setdefault((world(case, side), side), case)
    return found


FLAG_WORLDS = _flag_worlds()


def flag_tasks(seeds: int) -> list[Task]:
    """Worlds in which a flag is due, and worlds in which it is not."""
    return [("flag", name, side, 0.0, k) for k in range(seeds) for name, side in FLAG_WORLDS]


def family(task: Task) -> str:
    """Study of a case, or what reports the flag."""
    return FLAG_WORLDS[task[1], task[2]].result if task[0] == "flag" else task[0]


def run_task(task: Task) -> Seen:
    """Run one case; an error of the toolbox is an answer too."""
    study, kind, plant, noise, seed = task
    try:
        if study == "fit":
            return single.fit_once(kind, plant, noise, seed)
        if study == "flag":
            case = FLAG_WORLDS[kind, plant]
            with quietly():
                found = (case.raising if plant == "due" else case.quiet)(seed)
            return Seen(study, kind, plant, noise, seed, flags=sorted(found))
        with quietly():
            return STUDIES[study].trial(kind, plant, noise, seed)
    except cr.CtrlRealizeError as error:
        return Seen(study, kind, plant, noise, seed, failed=f"{type(error).__name__}: {error}")


class Store:
    """Cases that are finished, one line of JSON each."""

    def __init__(self, path: Path | None) -> None:
        self.path = path
        self.seen: dict[Task, Seen] = {}
        if path is not None and path.exists():
            for line in path.read_text(encoding="utf-8").splitlines():
                found = Seen(**json.loads(line))
                self.seen[found.key] = found

    def add(self, found: list[Seen]) -> None:
        self.seen |= {one.key: one for one in found}
        if self.path is not None:
            with self.path.open("a", encoding="utf-8") as file:
                file.writelines(json.dumps(one.as_dict()) + "\n" for one in found)


def _blocks(tasks: list[Task], size: int) -> Iterator[list[Task]]:
    rest = iter(tasks)
    while block := list(islice(rest, size)):
        yield block


def run(
    tasks: list[Task],
    store: Store,
    jobs: int,
    deadline: float = float("inf"),
    only: Collection[str] = (),
) -> list[Seen]:
    """Run what the store does not have yet, until `deadline` (of time.monotonic).

    With `only` nothing but these families is run; what the store has is returned in any case.
    """
    missing = [
        task for task in tasks if task not in store.seen and (not only or family(task) in only)
    ]
    with Parallel(n_jobs=jobs) as parallel:
        for block in _blocks(missing, 8 * jobs):
            if time.monotonic() > deadline:
                break
            store.add(parallel(delayed(run_task)(task) for task in block))
    return [store.seen[task] for task in tasks if task in store.seen]
