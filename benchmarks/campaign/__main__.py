"""Run the campaign, stop nothing for the corrupt ones, run it again from its store."""

from __future__ import annotations

import argparse
import functools
import platform
import resource
import tempfile
import time
from datetime import date
from pathlib import Path

import numpy as np
from joblib.externals.loky import get_reusable_executor

import ctrl_realize as cr
from tests.rigs import step_record

CORRUPT_EVERY = 100


def make(seed: int, folder: str) -> cr.Record:
    """Simulate one record, or read one that somebody has ruined."""
    if seed % CORRUPT_EVERY == 0:
        return cr.read_record(Path(folder) / f"corrupt-{seed % 500}.csv")
    rng = np.random.default_rng(seed)
    made = step_record(
        delay=float(rng.uniform(30, 45)), noise=1e-3, seed=seed, before=400, after=1400
    )
    return cr.Record(made.time, made.input, made.output, name=f"record {seed}")


def ruin_files(folder: Path) -> None:
    """Write five kinds of broken file."""
    text = "time,input,output\n" + "".join(f"{k * 0.01:g},{k > 50:d},0.5\n" for k in range(200))
    broken = {
        0: text.replace("1.2,", "spam,"),
        100: text[: len(text) // 3].rsplit(",", 1)[0] + ",nan\n",
        200: "",
        300: "\0\1\2\3" * 500,
        400: text.replace("1.2,", "0.2,"),
    }
    for number, content in broken.items():
        (folder / f"corrupt-{number}.csv").write_text(content, encoding="utf-8")


def peak_megabytes(who: int) -> float:
    # Children count once they have ended.
    get_reusable_executor().shutdown(wait=True)
    return resource.getrusage(who).ru_maxrss / 1024


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--records", type=int, default=10_000)
    parser.add_argument("--jobs", type=int, default=2)
    parser.add_argument("--method", default="paper")
    parser.add_argument("--output", type=Path)
    parser.add_argument("--store", type=Path, help="folder that keeps the rows, to go on from")
    arguments = parser.parse_args()
    lines = ["| what | figure |", "|---|---|"]
    with tempfile.TemporaryDirectory() as temporary:
        ruin_files(Path(temporary))
        store = cr.CampaignStore(arguments.store or Path(temporary) / "rows")
        found = len(store)
        sources = [functools.partial(make, seed, temporary) for seed in range(arguments.records)]

        def run(count: int) -> tuple[cr.Campaign, float]:
            start = time.perf_counter()
            campaign = cr.identify_campaign(
                sources[:count], method=arguments.method, n_jobs=arguments.jobs, store=store
            )
            return campaign, time.perf_counter() - start

        tenth = max(arguments.records // 10, 1)
        run(tenth)
        early = peak_megabytes(resource.RUSAGE_SELF), peak_megabytes(resource.RUSAGE_CHILDREN)
        campaign, first = run(arguments.records)
        late = peak_megabytes(resource.RUSAGE_SELF), peak_megabytes(resource.RUSAGE_CHILDREN)
        again, second = run(arguments.records)
        assert again.table().equals(campaign.table())
        kinds = sorted({str(row.error).split(":")[0] for row in campaign.failed})
        size = sum(path.stat().st_size for path in store.folder.iterdir()) / 2**20
        each = "" if found else f", {1e3 * first / (arguments.records - tenth):.1f} ms a record"
        there = f", {found} rows found in the store" if found else ""
        lines += [
            f"| records, processes, method | {arguments.records}, {arguments.jobs}, "
            f"{arguments.method} |",
            f"| identified / corrupt, told by name | {len(campaign.good)} / "
            f"{len(campaign.failed)} ({', '.join(kinds)}) |",
            f"| time of the last nine tenths{there} | {first:.0f} s{each} |",
            f"| the same again, from its store | {second:.0f} s, same table |",
            f"| peak memory of the main process after a tenth / all | {early[0]:.0f} MB / "
            f"{late[0]:.0f} MB |",
            f"| of the largest worker | {early[1]:.0f} MB / {late[1]:.0f} MB |",
            f"| store on disk | {size:.0f} MB |",
        ]
    lines.append(
        f"\nSimulated records of 1800 samples; made on {date.today()} with Python "
        f"{platform.python_version()}, ctrl_realize {cr.__version__}."
    )
    print("\n".join(lines))
    if arguments.output:
        arguments.output.parent.mkdir(parents=True, exist_ok=True)
        arguments.output.write_text("\n".join(lines) + "\n", encoding="utf-8")


main()
