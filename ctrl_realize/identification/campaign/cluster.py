"""Records of a campaign distributed over the workers of a Dask cluster.

The records are submitted to the client itself. joblib's Dask backend (joblib 1.6) calls nobody back
for a task that failed, so that a campaign would wait forever for a record that kills its workers.

What is sent is pickled here and unpickled by the worker. Dask itself unpickles arrays in place,
often at addresses that are no multiple of eight, which functions of SciPy (1.17) refuse; and the
scheduler would have to import the modules of the caller.

Dask runs a task whose worker was killed again, by default three times; after that also tasks that
were only assigned to the killed workers are given up. Each of these is therefore submitted once
more when nothing else is running.
"""

from __future__ import annotations

import functools
import pickle
from collections.abc import Generator, Mapping, Sequence
from queue import Empty, SimpleQueue
from typing import Any

from ..methods import Method
from .rows import CampaignRow, RecordSource, RowStore, failed_row, identify_row, killed_row

_AHEAD = 100
"""Records submitted beyond two for each thread of the cluster: enough for an adaptive cluster to
add workers, while the records of a long campaign are not all in the scheduler's memory."""

_NO_WORKERS = "5 minutes"
"""Time without a worker after which the records are given up, if Dask's own setting
``distributed.scheduler.no-workers-timeout`` is not set."""


def identified_on_cluster(
    client: Any,
    sources: Sequence[RecordSource],
    method: Method,
    options: Mapping[str, Any],
    store: RowStore | None,
) -> Generator[tuple[int, CampaignRow], None, None]:
    """Identify records on a cluster; yield position and row of each as it is finished."""
    import cloudpickle
    import dask
    from dask.utils import parse_timedelta

    limit = dask.config.get("distributed.scheduler.no-workers-timeout", None) or _NO_WORKERS
    patience = parse_timedelta(limit)
    waiting = list(reversed(range(len(sources))))
    suspects: list[int] = []
    running: dict[int, Any] = {}
    ended: SimpleQueue[int] = SimpleQueue()

    def submit(position: int) -> None:
        sent = cloudpickle.dumps((sources[position], position, method, options, store))
        running[position] = future = client.submit(_identified, sent, pure=False)
        future.add_done_callback(functools.partial(_put, ended, position))

    alone = False
    try:
        while waiting or running or suspects:
            if not waiting and not running:
                waiting, suspects, alone = suspects, [], True
            most = 1 if alone else _AHEAD + 2 * sum(client.nthreads().values())
            while waiting and len(running) < most:
                submit(waiting.pop())
            try:
                position = ended.get(timeout=patience)
            except Empty:
                if client.nthreads():
                    continue
                text = f"no worker in the Dask cluster for {patience:g} s"
                for position in (*running, *waiting, *suspects):
                    yield position, failed_row(sources[position], position, text)
                return
            row = _row(running.pop(position), sources[position], position)
            if row is not None:
                yield position, row
            elif alone:
                yield position, killed_row(sources[position], position)
            else:
                suspects.append(position)
    finally:
        client.cancel(list(running.values()))


def _identified(sent: bytes) -> bytes:
    """On a worker: identify a record."""
    return pickle.dumps(identify_row(*pickle.loads(sent)))


def _put(ended: SimpleQueue[int], position: int, _future: Any) -> None:
    ended.put(position)


def _row(future: Any, source: RecordSource, position: int) -> CampaignRow | None:
    """Row of a task that ended; None if its workers were killed."""
    try:
        row: CampaignRow = pickle.loads(future.result())
    except Exception as error:
        # not one of the identification, which is in its row already: a module that the worker or
        # the scheduler does not have, a scheduler that was lost
        if type(error).__name__ == "KilledWorker":
            return None
        why = f"; {error.__cause__}" if error.__cause__ else ""
        return failed_row(source, position, f"{type(error).__name__}: {error}{why}")
    return row
