"""Run the campaign, stop nothing for the corrupt ones, run it again from its store."""

from __future__ import annotations

import argparse
import functools
import platform
import resource
import tempfile
import time
from dataclasses import dataclass
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


@dataclass(frozen=True)
class Measured:
    """What one campaign has taken; memory in MB, of the main process and of the largest worker."""

    campaign: cr.Campaign
    found: int
    first: float
    second: float
    early: tuple[float, float]
    late: tuple[float, float]
    on_disk: float


def peaks() -> tuple[float, float]:
    return peak_megabytes(resource.RUSAGE_SELF), peak_megabytes(resource.RUSAGE_CHILDREN)


def measure(records: int, jobs: int, method: str, folder: Path, store_folder: Path) -> Measured:
    """Run a tenth, then all, then all again from the store."""
    store = cr.io.CampaignStore(store_folder)
    found = len(store)
    sources = [functools.partial(make, seed, str(folder)) for seed in range(records)]

    def run(count: int) -> tuple[cr.Campaign, float]:
        start = time.perf_counter()
        campaign = cr.identify_campaign(sources[:count], method=method, n_jobs=jobs, store=store)
        return campaign, time.perf_counter() - start

    run(max(records // 10, 1))
    early = peaks()
    campaign, first = run(records)
    late = peaks()
    again, second = run(records)
    assert again.table().equals(campaign.table())
    on_disk = sum(path.stat().st_size for path in store.folder.iterdir()) / 2**20
    return Measured(campaign, found, first, second, early, late, on_disk)


def table(measured: Measured, jobs: int, method: str) -> list[str]:
    """Write the figures as a Markdown table."""
    campaign = measured.campaign
    records = len(campaign.rows)
    kinds = sorted({str(row.error).split(":")[0] for row in campaign.failed})
    fresh = records - max(records // 10, 1)
    each = "" if measured.found else f", {1e3 * measured.first / max(fresh, 1):.1f} ms a record"
    there = f", {measured.found} rows found in the store" if measured.found else ""
    return [
        "| what | figure |",
        "|---|---|",
        f"| records, processes, method | {records}, {jobs}, {method} |",
        f"| identified / corrupt, told by name | {len(campaign.good)} / "
        f"{len(campaign.failed)} ({', '.join(kinds)}) |",
        f"| time of the last nine tenths{there} | {measured.first:.0f} s{each} |",
        f"| the same again, from its store | {measured.second:.0f} s, same table |",
        f"| peak memory of the main process after a tenth / all | {measured.early[0]:.0f} MB / "
        f"{measured.late[0]:.0f} MB |",
        f"| of the largest worker | {measured.early[1]:.0f} MB / {measured.late[1]:.0f} MB |",
        f"| store on disk | {measured.on_disk:.0f} MB |",
    ]


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--records", type=int, default=10_000)
    parser.add_argument("--jobs", type=int, default=2)
    parser.add_argument("--method", default="paper")
    parser.add_argument("--output", type=Path)
    parser.add_argument("--store", type=Path, help="folder that keeps the rows, to go on from")
    asked = parser.parse_args()
    with tempfile.TemporaryDirectory() as temporary:
        folder = Path(temporary)
        ruin_files(folder)
        measured = measure(
            asked.records, asked.jobs, asked.method, folder, asked.store or folder / "rows"
        )
    lines = table(measured, asked.jobs, asked.method)
    lines.append(
        f"\nSimulated records of 1800 samples; made on {date.today()} with Python "
        f"{platform.python_version()}, ctrl_realize {cr.__version__}."
    )
    print("\n".join(lines))
    if asked.output:
        asked.output.parent.mkdir(parents=True, exist_ok=True)
        asked.output.write_text("\n".join(lines) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
