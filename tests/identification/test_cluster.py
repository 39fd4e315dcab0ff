"""A campaign on a real Dask cluster, started here; a dead worker loses nothing."""

from __future__ import annotations

import functools
import os
import signal
import threading
import time

import joblib
import pytest
from numpy.testing import assert_array_equal

import ctrl_realize as cr
from tests.rigs import step_record

distributed = pytest.importorskip("distributed", reason="dask[distributed] is not installed")

# What a cluster says while it starts, stops and loses workers is not ours.
pytestmark = [pytest.mark.slow, pytest.mark.filterwarnings("ignore")]


def record(seed: int, wait: float = 0.0) -> cr.Record:
    time.sleep(wait)
    made = step_record(noise=1e-3, seed=seed, before=400, after=1300)
    return cr.Record(made.time, made.input, made.output, name=f"r{seed}")


@pytest.fixture
def client():
    with (
        distributed.LocalCluster(
            n_workers=2, threads_per_worker=1, dashboard_address=None, silence_logs=50
        ) as cluster,
        distributed.Client(cluster) as connected,
    ):
        yield connected


def test_a_cluster_gives_the_same_bits_even_when_a_worker_dies(client, tmp_path):
    sources = [functools.partial(record, seed, 0.2) for seed in range(16)]
    store = cr.io.CampaignStore(tmp_path)
    pids = list(client.run(os.getpid).values())

    def kill_one() -> None:
        while len(store) < 3:
            time.sleep(0.05)
        os.kill(pids[0], signal.SIGKILL)

    killer = threading.Thread(target=kill_one)
    killer.start()
    with joblib.parallel_config(backend="dask"):
        spread = cr.identify_campaign(sources, method="paper", n_jobs=-1, store=store)
    killer.join()
    serial = cr.identify_campaign([functools.partial(record, s) for s in range(16)], method="paper")
    assert spread.failed == ()
    assert spread.table().equals(serial.table())
    for a, b in zip(spread.good, serial.good, strict=True):
        assert_array_equal(a.system.A, b.system.A)
    # The killed worker is gone; the cluster's nanny starts another in its place.
    assert pids[0] not in client.run(os.getpid).values()
