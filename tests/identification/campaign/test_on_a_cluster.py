"""A campaign on a Dask cluster: the same bits, and a row for every record whatever befalls it."""

import contextlib
import functools
import itertools
import os
import signal
import subprocess
import sys

import joblib
import pytest
from numpy.testing import assert_array_equal

import ctrl_realize as cr
from tests.rigs import step_record

dask = pytest.importorskip("dask", reason="dask[distributed] is not installed")
distributed = pytest.importorskip("distributed", reason="dask[distributed] is not installed")

pytestmark = [
    pytest.mark.slow,
    # what a cluster says while it starts, stops and loses workers is not ours
    pytest.mark.filterwarnings("ignore"),
]
NO_WORKERS = "distributed.scheduler.no-workers-timeout"


def quick(seed: int) -> cr.Record:
    made = step_record(noise=1e-3, seed=seed, before=400, after=1300)
    return cr.Record(made.time, made.input, made.output, name=f"r{seed}")


def killing(seed: int) -> cr.Record:
    os.kill(os.getpid(), signal.SIGKILL)
    return quick(seed)


@contextlib.contextmanager
def connected(n_workers):
    with (
        distributed.LocalCluster(
            n_workers=n_workers, threads_per_worker=1, dashboard_address=None, silence_logs=50
        ) as cluster,
        distributed.Client(cluster) as client,
    ):
        yield client


@pytest.fixture(scope="module")
def client():
    """Of two workers; one of them is started again whenever it dies."""
    # forks of one process that has loaded what each of them would load for two seconds
    with dask.config.set(
        {
            "distributed.scheduler.allowed-failures": 1,
            "distributed.worker.multiprocessing-method": "forkserver",
        }
    ):
        distributed.utils.get_mp_context().set_forkserver_preload(["distributed", "control"])
        with connected(2) as shared:
            yield shared


def test_a_record_that_kills_its_worker_is_a_row_and_others_have_the_same_bits(client, tmp_path):
    # the arrays of the valve are sent, and must be as usable there as here
    sources = [functools.partial(quick, 0), functools.partial(killing, 1)]
    sources += [functools.partial(cr.bench.valve().step_record, 16.0, k) for k in range(2, 6)]
    pids = set(client.run(os.getpid).values())
    store = cr.io.CampaignStore(tmp_path / "rows.sqlite")
    with joblib.parallel_config(backend="dask"):  # means the same client
        spread = cr.identify_campaign(sources, method="paper", store=store)
    # A killed worker is gone; the cluster's nanny starts another in its place.
    assert pids - set(client.run(os.getpid).values())
    assert [row.error is None for row in spread.rows] == [k != 1 for k in range(6)]
    assert "was killed by the system, even when run alone" in spread.rows[1].error
    assert spread.rows[1].name == "1"
    del sources[1]
    serial = cr.identify_campaign(sources, method="paper")
    for a, b in zip(spread.good, serial.good, strict=True):
        assert (a.name, a.delay) == (b.name, b.delay)
        assert_array_equal(a.system.A, b.system.A)
        assert_array_equal(a.system.C, b.system.C)
        assert a.system.A.flags.aligned


def test_a_cluster_takes_a_bounded_number_of_records_ahead_and_needs_no_shared_store(
    client, tmp_path
):
    taken = []

    def endless():
        for seed in itertools.count():
            taken.append(seed)
            yield functools.partial(quick, seed % 7)

    store = cr.io.CampaignStore(tmp_path / "rows.sqlite")
    # workers do not write: where they are, the file may be out of reach
    options = {"method": "paper", "client": client, "store": store}
    rows = cr.identification.identify_each(endless(), **options)
    seen, different = [], set()
    while len(seen) < 20 or len(different) < 7:  # which of the seven come first, workers decide
        seen.append(next(rows).position)
        different.add(seen[-1] % 7)
    rows.close()
    assert len(set(seen)) == len(seen)
    # 100 records and two for each thread, of which there are two while no worker is started again
    assert max(seen) < len(taken) <= len(seen) + 100 + 2 * 2
    assert len(store) == 7


def test_without_any_worker_the_records_are_rows_with_that_error():
    with connected(0) as client, dask.config.set({NO_WORKERS: "1s"}):
        campaign = cr.identify_campaign([quick] * 3, client=client)
    assert {row.error for row in campaign.rows} == {"no worker in the Dask cluster for 1 s"}


def test_a_function_that_the_cluster_cannot_import_is_a_row_with_that_error(tmp_path, monkeypatch):
    (tmp_path / "only_here.py").write_text("def read():\n    pass\n", encoding="utf-8")
    monkeypatch.syspath_prepend(tmp_path)
    import only_here

    program = (
        "import distributed\n"
        "if __name__ == '__main__':\n"
        "    with distributed.LocalCluster(n_workers=1, threads_per_worker=1, processes=False,\n"
        "            protocol='tcp', dashboard_address=None, silence_logs=50) as cluster:\n"
        "        print(cluster.scheduler_address, flush=True)\n"
        "        input()\n"
    )
    elsewhere = tmp_path / "elsewhere"
    elsewhere.mkdir()
    (elsewhere / "cluster.py").write_text(program, encoding="utf-8")
    process = subprocess.Popen(
        [sys.executable, str(elsewhere / "cluster.py")], text=True,
        stdin=subprocess.PIPE, stdout=subprocess.PIPE,
    )  # fmt: skip
    with process, distributed.Client(process.stdout.readline().strip()) as client:
        campaign = cr.identify_campaign([quick(0), only_here.read], method="paper", client=client)
        process.stdin.close()
    assert campaign.rows[0].error is None
    assert "only_here" in campaign.rows[1].error


def test_a_client_that_cannot_be_waited_for_is_refused():
    with pytest.raises(cr.errors.OptionError, match=r"expected a distributed\.Client"):
        cr.identify_campaign([quick(0)], client="tcp://10.0.0.7:8786")
