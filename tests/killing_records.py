"""Records that other processes identify, of which some kill them: little is imported there."""

import os
import signal
from functools import partial
from pathlib import Path

import numpy as np

import ctrl_realize as cr

OPTIONS = {"method": "scan", "order": 1, "max_delay": 40}
COUNT = 4


def record(seed: int) -> cr.Record:
    t = 0.1 * np.arange(150)
    y = np.where(t > 5.0, 1.5 * (1 - np.exp(-(t - 5.0) / 1.5)), 0.0)
    noise = 0.004 * np.random.default_rng(seed).normal(size=t.size)
    return cr.Record(t, (t >= 3.0).astype(float), y + noise, name=f"r{seed}")


def killed(seed: int) -> cr.Record:
    os.kill(os.getpid(), signal.SIGKILL)
    return record(seed)


def killed_here(killers: str, folder: str) -> list[str | None]:
    """Identify four records in this process, some of which kill it; return the errors."""
    sources = [partial(killed if str(k) in killers else record, k) for k in range(COUNT)]
    store = cr.io.CampaignStore(Path(folder) / "rows.sqlite")
    return [row.error for row in cr.identify_campaign(sources, store=store, **OPTIONS).rows]
