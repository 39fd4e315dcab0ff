"""Stream without a store, with one, on Dask with a worker killed; then resume 1e5 rows.

Each part is a process of its own, whose peak memory counts.
"""

from __future__ import annotations

import argparse
import functools
import itertools
import json
import os
import platform
import resource
import signal
import sqlite3
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from contextlib import closing
from datetime import date
from pathlib import Path
from typing import Any

import numpy as np

import ctrl_realize as cr
from ctrl_realize.identification.campaign.rows import CampaignRow, known_key, settings_of

CORRUPT_EVERY = 100
SAMPLES = 200
METHOD, OPTIONS = "scan", {"order": 1, "max_delay": 16}
ASKED: dict[str, Any] = {"method": METHOD, **OPTIONS, "progress": False}
Part = dict[str, Any]


def file_of(folder: Path, number: int) -> Path:
    return folder / "records" / f"{number:06d}.npz"


def write_files(folder: Path, count: int) -> None:
    """Simulate steps of a first-order lag behind 0.5 to 1.2 s; ruin one file in a hundred."""
    (folder / "records").mkdir(parents=True)
    t = 0.1 * np.arange(SAMPLES)
    broken = [b"", b"\0\1\2\3" * 500, b"time,input,output\n0,0,spam\n"]
    for number in range(count):
        path = file_of(folder, number)
        if number % CORRUPT_EVERY == 0:
            path.write_bytes(broken[number // CORRUPT_EVERY % len(broken)])
            continue
        rng = np.random.default_rng(number)
        moved = np.clip(t - 5.0 - rng.uniform(0.5, 1.2), 0, None)
        y = 1.5 * (1 - np.exp(-moved / 1.5)) + 4e-3 * rng.standard_normal(SAMPLES)
        np.savez(path, time=t, input=np.where(t >= 5.0, 1.0, 0.0), output=y)


def sources(folder: Path, count: int) -> Iterator[functools.partial[cr.Record]]:
    """Functions that read the files, made one at a time."""
    for number in range(count):
        yield functools.partial(cr.read_record, file_of(folder, number))


def megabytes() -> float:
    """Peak memory of this process so far."""
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024


def followed(rows: Iterator[CampaignRow], count: int) -> Part:
    """Take all rows; note the time, and the peak memory after a tenth, a half and all."""
    peaks, seen, errors, start = [], bytearray(count), 0, time.perf_counter()
    for number, row in enumerate(rows, start=1):
        assert not seen[row.position], "a row came twice"
        seen[row.position] = 1
        errors += row.error is not None
        if number in {count // 10, count // 2, count}:
            peaks.append(megabytes())
    seconds = time.perf_counter() - start
    return {"rows": sum(seen), "errors": errors, "seconds": seconds, "peaks": peaks}


def stored(path: Path) -> Part:
    with closing(sqlite3.connect(path)) as database:
        query = "SELECT count(*), count(DISTINCT key), count(DISTINCT name) FROM rows"
        rows, keys, names = database.execute(query).fetchone()
    return {"stored": rows, "keys": keys, "names": names, "bytes": path.stat().st_size}


def stream(folder: Path, count: int) -> Part:
    """Two processes, no store."""
    rows = cr.identification.identify_each(sources(folder, count), n_jobs=2, **ASKED)
    return followed(rows, count)


def store(folder: Path, count: int) -> Part:
    """Two processes, with a store."""
    kept = cr.io.CampaignStore(folder / "processes.sqlite")
    rows = cr.identification.identify_each(sources(folder, count), n_jobs=2, store=kept, **ASKED)
    return followed(rows, count) | stored(kept.path)


def dask(folder: Path, count: int) -> Part:
    """Two Dask workers, of which one is killed half-way; its nanny starts another."""
    import distributed

    kept = cr.io.CampaignStore(folder / "dask.sqlite")
    cluster = distributed.LocalCluster(
        n_workers=2, threads_per_worker=1, dashboard_address=None, silence_logs=50
    )
    with cluster, distributed.Client(cluster) as client:
        pids = list(client.run(os.getpid).values())
        rows = cr.identification.identify_each(
            sources(folder, count), client=client, store=kept, **ASKED
        )

        def killing() -> Iterator[CampaignRow]:
            for number, row in enumerate(rows):
                if number == count // 2:
                    os.kill(pids[0], signal.SIGKILL)
                yield row

        found = followed(killing(), count) | stored(kept.path)
        assert pids[0] not in client.run(os.getpid).values()
    with (
        closing(sqlite3.connect(folder / "processes.sqlite")) as one,
        closing(sqlite3.connect(kept.path)) as other,
    ):
        query = "SELECT * FROM rows ORDER BY key"
        same = one.execute(query).fetchall() == other.execute(query).fetchall()
    return found | {"same": same}


def campaign(folder: Path, count: int) -> Part:
    """The rows of the store as a `Campaign`, with its table."""
    kept = cr.io.CampaignStore(folder / "processes.sqlite")
    before, start = megabytes(), time.perf_counter()
    found = cr.identify_campaign(sources(folder, count), store=kept, **ASKED)
    table = found.table()
    seconds = time.perf_counter() - start
    return {"rows": len(table), "seconds": seconds, "grown": megabytes() - before}


def resume(folder: Path, count: int) -> Part:
    """Ten rows for each of the store, for as many names of its files; then resume."""
    kept = cr.io.CampaignStore(folder / "resumed.sqlite")
    settings, links = settings_of(METHOD, OPTIONS), folder / "links"
    links.mkdir()
    good = [number for number in range(count) if number % CORRUPT_EVERY]

    def again() -> Iterator[functools.partial[cr.Record]]:
        for number in good:
            for copy in range(10):
                yield functools.partial(cr.read_record, links / f"{number:06d}-{copy}.npz")

    names = again()
    old = cr.io.CampaignStore(folder / "processes.sqlite")
    with old.opened(), kept.opened():
        for number in good:
            source = functools.partial(cr.read_record, file_of(folder, number))
            row = old.load(known_key(source, settings) or "")
            assert row is not None
            for copy in range(10):
                os.link(file_of(folder, number), links / f"{number:06d}-{copy}.npz")
            copies = itertools.islice(names, 10)
            kept.save([(known_key(one, settings) or "", row) for one in copies], settings)
    rows = cr.identification.identify_each(again(), store=kept, **ASKED)
    found = followed(rows, 10 * len(good)) | stored(kept.path)
    before, start = megabytes(), time.perf_counter()
    whole = cr.identify_campaign(again(), store=kept, **ASKED)
    found["campaign_seconds"] = time.perf_counter() - start
    found["campaign_grown"] = megabytes() - before
    assert len(whole.good) == len(kept) == 10 * len(good)
    return found


PARTS = {part.__name__: part for part in (stream, store, dask, campaign, resume)}


def table(parts: dict[str, Part], count: int) -> list[str]:
    """Write the figures as a Markdown table."""

    def peaks(part: str) -> str:
        return " / ".join(f"{peak:.0f}" for peak in parts[part]["peaks"])

    def row(name: str, part: str) -> str:
        found = parts[part]
        kept = f"{found['stored']}, none twice" if "stored" in found else "no store"
        assert "stored" not in found or found["stored"] == found["keys"]
        return (
            f"| {name} | {found['rows']} / {found['errors']} | {kept} | {found['seconds']:.0f} s | "
            f"{1e3 * found['seconds'] / found['rows']:.1f} ms | {peaks(part)} MB |"
        )

    again, rows, on_disk = parts["resume"], parts["campaign"], parts["store"]
    assert parts["dask"]["same"]
    return [
        "| run | rows / with an error | in the store | time | a record | memory of the calling "
        f"process after {count // 10} / {count // 2} / {count} |",
        "|---|---|---|---|---|---|",
        row("`identify_each`, two processes", "stream"),
        row("the same, with a store", "store"),
        row("two Dask workers, one killed half-way", "dask"),
        "",
        "| what | figure |",
        "|---|---|",
        "| rows of the Dask run and of the two processes, all columns | equal |",
        f"| store | {on_disk['bytes'] / on_disk['stored'] / 1e3:.1f} kB a row |",
        f"| the {rows['rows']} records again, as a `Campaign` with its table; those with an error "
        f"are read again | {rows['seconds']:.1f} s |",
        f"| {again['rows']} rows resumed as a stream (ten names for each file, its row repeated) | "
        f"{again['seconds']:.1f} s, {1e6 * again['seconds'] / again['rows']:.0f} us a row, memory "
        f"{peaks('resume')} MB after a tenth / half / all |",
        f"| the same as a `Campaign` | {again['campaign_seconds']:.1f} s, "
        f"{1e3 * again['campaign_grown'] / again['rows']:.1f} kB of memory a row |",
    ]


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--records", type=int, default=10_000)
    parser.add_argument("--output", type=Path)
    parser.add_argument("--folder", type=Path, help="keeps files and finished parts, to go on from")
    parser.add_argument("--part", choices=PARTS, help="one part, in such a folder")
    asked = parser.parse_args()
    if asked.part:
        found = PARTS[asked.part](asked.folder, asked.records)
        (asked.folder / f"{asked.part}.json").write_text(json.dumps(found), encoding="utf-8")
        return
    parts = {}
    with tempfile.TemporaryDirectory() as temporary:
        folder = asked.folder or Path(temporary)
        if not (folder / "records").exists():
            write_files(folder, asked.records)
        for name in PARTS:
            result = folder / f"{name}.json"
            command = [sys.executable, "-m", "benchmarks.campaign", "--part", name]
            command += ["--folder", str(folder), "--records", str(asked.records)]
            if not result.exists():
                subprocess.run(command, check=True)
            parts[name] = json.loads(result.read_text(encoding="utf-8"))
    lines = table(parts, asked.records)
    lines.append(
        f"\nSimulated records of {SAMPLES} samples in npz files, one in {CORRUPT_EVERY} corrupt, "
        f"`method={METHOD!r}, order=1`; made on {date.today()} with Python "
        f"{platform.python_version()}, ctrl_realize {cr.__version__}, on two processors that did "
        "other work as well."
    )
    print("\n".join(lines))
    if asked.output:
        asked.output.parent.mkdir(parents=True, exist_ok=True)
        asked.output.write_text("\n".join(lines) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
