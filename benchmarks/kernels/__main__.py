"""Identify the same records under every kernel: ``python -m benchmarks.kernels``.

OpenBLAS and NumPy choose their kernels by the processor, and each rounds in its own way. Every
kernel runs in a process of its own, and so do one-ulp noise on the output, another unit of time
and other units of the signals under the machine's own kernel. What differs is printed.
"""

from __future__ import annotations

import argparse
import json
import os
import platform
import subprocess
import sys
import tempfile
from collections.abc import Mapping
from dataclasses import dataclass, field
from datetime import date
from itertools import chain
from pathlib import Path

import ctrl_realize as cr

from .answers import CLOSE, Answer, answer, compared, names, shown
from .records import DATA, changed, measured, simulated

THREADS = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS")
NO_SIMD = "X86_V3 X86_V4 AVX512_ICL AVX512_SPR AVX2 FMA3 AVX512F AVX512CD AVX512_SKX"


@dataclass(frozen=True)
class Way:
    """One run: its environment beside one thread, and what is changed in the records."""

    name: str
    environment: Mapping[str, str] = field(default_factory=dict)
    change: str = ""


WAYS = (
    Way("own"),
    *(
        Way(core, {"OPENBLAS_CORETYPE": core})
        for core in ("Prescott", "Sandybridge", "Haswell", "SkylakeX", "Zen")
    ),
    Way("NumPy without SIMD", {"NPY_DISABLE_CPU_FEATURES": NO_SIMD}),
    Way("two threads", dict.fromkeys(THREADS, "2")),
    Way("one ulp", change="one ulp"),
    Way("milliseconds", change="milliseconds"),
    Way("scaled", change="scaled"),
)


def arguments() -> argparse.Namespace:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--ways", nargs="+", help="run only these, beside the first")
    parser.add_argument("--records", help="only records whose name contains this")
    parser.add_argument("--every", type=int, default=1, help="only every so-manieth of them")
    parser.add_argument("--store", type=Path, help="folder for the answers, kept between runs")
    parser.add_argument("--output", type=Path, help="Markdown file to write")
    parser.add_argument("--answer", type=Path, help=argparse.SUPPRESS)
    parser.add_argument("--change", default="", help=argparse.SUPPRESS)
    return parser.parse_args()


def main() -> None:
    given = arguments()
    if given.answer:
        _answer_all(given)
        return
    with tempfile.TemporaryDirectory() as folder:
        answers = _all_answers(given, given.store or Path(folder))
    text = table(answers)
    print(text)
    if given.output:
        given.output.write_text(text)


def _answer_all(given: argparse.Namespace) -> None:
    """Answer what is not answered yet, a line for every record."""
    done = _stored(given.answer)
    with given.answer.open("a", encoding="utf-8") as file:
        for name, record in _chosen(given):
            if name not in done:
                file.write(json.dumps([name, answer(changed(record, given.change))]) + "\n")
                file.flush()


def _chosen(given: argparse.Namespace) -> list[tuple[str, cr.Record]]:
    known = chain(measured(), simulated())
    named = [(name, record) for name, record in known if (given.records or "") in name]
    return named[:: given.every]


def _stored(path: Path) -> dict[str, Answer]:
    if not path.exists():
        return {}
    return dict(json.loads(line) for line in path.read_text(encoding="utf-8").splitlines())


def _all_answers(given: argparse.Namespace, store: Path) -> dict[str, dict[str, Answer]]:
    store.mkdir(parents=True, exist_ok=True)
    found = {}
    for way in WAYS:
        if given.ways and way is not WAYS[0] and way.name not in given.ways:
            continue
        path = store / f"{way.name}.jsonl"
        command = [sys.executable, "-m", "benchmarks.kernels", "--answer", str(path)]
        command += ["--change", way.change, "--every", str(given.every)]
        command += ["--records", given.records or ""]
        one = dict.fromkeys(THREADS, "1")
        environment = {**os.environ, **one, **way.environment, "PYTHONWARNINGS": "ignore"}
        subprocess.run(command, env=environment, check=True)
        found[way.name] = _stored(path)
        print(f"{way.name}: {len(found[way.name])} records", file=sys.stderr)
    return found


def table(answers: Mapping[str, Mapping[str, Answer]]) -> str:
    """Make the table in Markdown: how many records differ in what, and which."""
    reference = WAYS[0].name
    found = compared(answers, reference)
    total = len(answers[reference])
    lines = [
        "| run | records | structure | flags | dead time | interval | any | any, and not told |",
        "|---|---|---|---|---|---|---|---|",
    ]
    for way, apart in found.items():
        counts = [
            sum(any(key in what for key in keys) for what in apart.values())
            for keys in (("structure",), ("flags",), ("dead time",), ("low", "high"))
        ]
        quiet = [name for name in apart if not _told(answers, way, name)]
        counts += [len(apart), len(quiet)]
        lines.append(f"| {way} | {total} | " + " | ".join(map(str, counts)) + " |")
    lines += [
        "",
        f"How many records are answered otherwise than under the machine's own kernel: "
        f"{'measured and ' if DATA.is_dir() else ''}simulated records, times to {CLOSE:g} of the "
        f"dead time, or of the sample time where that is longer. Told: the flag "
        f"`marginal_decision` in either answer. Made on {date.today()} by "
        f"`python -m benchmarks.kernels` with Python {platform.python_version()}, {_versions()}.",
        "",
    ]
    for name in names(found.values()):
        lines.append(f"* {name}: {shown(answers[reference][name])}")
        lines += [
            f"    * {way}: {shown(answers[way][name])}"
            for way, apart in found.items()
            if name in apart
        ]
    return "\n".join([*lines, ""])


def _told(answers: Mapping[str, Mapping[str, Answer]], way: str, name: str) -> bool:
    """Tell whether either answer says that a decision stands on its edge."""
    pair = answers[WAYS[0].name][name], answers[way][name]
    return any("marginal_decision" in one["flags"] for one in pair)


def _versions() -> str:
    from importlib.metadata import version

    return ", ".join(f"{name} {version(name)}" for name in ("numpy", "scipy"))


if __name__ == "__main__":
    main()
