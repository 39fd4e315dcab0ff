"""Records of a campaign that are identified here, in processes or on a Dask cluster.

A bounded number is in flight, so that neither the records that wait nor the rows that nobody has
taken yet fill the memory. joblib's `Parallel` does not hold back while its caller is busy, and its
Dask backend (joblib 1.6) calls nobody back for a task that failed: records are therefore submitted
to joblib's process pool, or to the Dask client, themselves.

A process is killed if memory is exhausted or compiled code crashes. Which record caused it is
unknown: nothing new is started, and those that failed with it are identified once more, one at a
time. A record whose process is killed again gives a row with that error. Dask itself runs a task
again before, by default three times.

What is sent to Dask is pickled here and unpickled by the worker. Dask itself unpickles arrays in
place, often at addresses that are no multiple of eight, which functions of SciPy (1.17) refuse; and
its scheduler would have to import the modules of the caller.
"""

from __future__ import annotations

import pickle
import re
from collections.abc import Callable
from concurrent.futures import BrokenExecutor, Future
from concurrent.futures.process import BrokenProcessPool
from contextlib import suppress
from queue import Empty, SimpleQueue
from time import sleep
from typing import Any

from ..._checks import spelled_out
from .rows import LONGEST_ERROR, CampaignRow, RecordSource, RowStore, source_name

Done = tuple[str | None, CampaignRow]
"""Key in the store, or None, and row."""
Task = tuple[RecordSource, int, str | None]
"""Source, position and key of a record."""
Work = Callable[[RecordSource, int, str | None], Done]
"""How a record is identified."""
_EACH = 2
"""Records in flight for each process, as with joblib itself: one is identified, one waits for it.
More than the pool sends ahead would make its thread fail when it is ended (loky 3.6)."""
_AHEAD = 100
"""Records submitted beyond two for each thread of a cluster: enough for an adaptive cluster to add
workers, while the records of a long campaign are not all in the scheduler's memory."""
_IDLE = 300
"""Time in s after which idle processes end, as with joblib itself."""
_KILLED = (
    "the process that identified this record was killed by the system{}, even when run alone; "
    "the usual cause is lack of memory"
)
_NO_WORKERS = "5 minutes"
"""Time without a worker after which the records are given up, if Dask's own setting
``distributed.scheduler.no-workers-timeout`` is not set."""


class Workers:
    """Processes of this machine; the pool is replaced if one of them is killed."""

    _patience: float | None = None
    """Time in s after which it is asked whether anything will finish."""

    def __init__(self, work: Work, count: int) -> None:
        self._work, self._count = work, count
        self._running: dict[int, tuple[Task, Any]] = {}
        self._ended: SimpleQueue[int] = SimpleQueue()
        self._suspects: list[Task] = []
        self._alone = False
        """Whether the record that is identified is a suspect."""
        self._why_lost = ""

    @property
    def full(self) -> bool:
        """Whether rows have to be taken before the next record is started."""
        return bool(self._suspects) or self._alone or len(self._running) >= self._most()

    @property
    def busy(self) -> bool:
        """Whether there are records of which no row was taken."""
        return bool(self._running or self._suspects)

    def start(self, task: Task) -> None:
        """Identify a record, now or later."""
        try:
            future = self._submit(task)
        except Exception as error:  # no pickle can be made of it, the scheduler is lost
            future = Future()
            future.set_exception(error)
        self._running[task[1]] = task, future
        future.add_done_callback(lambda _: self._ended.put(task[1]))

    def take(self, *, wait: bool) -> list[Done]:
        """Return what has finished; with `wait`, wait for something that has."""
        if self._suspects and not self._running:
            self._alone = True
            self.start(self._suspects.pop())
        done: list[Done] = []
        while self._running:
            try:
                position = self._ended.get(wait and not done, self._patience)
            except Empty:
                if done or not wait:
                    break
                self._ask()
                continue
            done += self._result(*self._running.pop(position))
        return done

    def close(self) -> None:
        """Give up what is not finished."""
        if self._running:
            self._cancel([future for _, future in self._running.values()])

    def _result(self, task: Task, future: Any) -> list[Done]:
        """Row of a task that has ended; none yet if its process was killed and it is tried again.

        An error of the identification is in its row already. Any other is of what is around it: a
        module that the worker or the scheduler does not have, a scheduler that was lost.
        """
        alone, self._alone = self._alone, False
        try:
            done = future.result()
            return [pickle.loads(done) if isinstance(done, bytes) else done]
        except Exception as raised:
            error = raised
        cause = f"; {error.__cause__}" if error.__cause__ else ""
        text = self._why_lost or f"{type(error).__name__}: {error}{cause}"
        if isinstance(error, BrokenProcessPool) or type(error).__name__ == "KilledWorker":
            if not alone:
                self._suspects.append(task)
                return []
            codes = re.search(r"exit codes? of the workers? (?:are|is) \{(.*?)\}", str(error))
            text = _KILLED.format(f" ({codes[1]})" if codes else "")
        text = spelled_out(" ".join(text.split())[:LONGEST_ERROR])
        source, position, _ = task
        return [(None, CampaignRow(source_name(source, position), error=text, position=position))]

    def _most(self) -> int:
        """Number of records in flight."""
        return _EACH * self._count

    def _submit(self, task: Task) -> Any:
        """Identify a record; return its future."""
        from joblib.externals.loky import get_reusable_executor

        self._pool = get_reusable_executor(self._count, timeout=_IDLE)
        return self._pool.submit(self._work, *task)

    def _cancel(self, futures: list[Any]) -> None:
        sleep(0.05)  # until the last one is sent, for the same reason
        self._pool.shutdown(kill_workers=True)

    def _ask(self) -> None:
        """Cancel what runs if nothing will finish."""


class Here(Workers):
    """The calling process, one record at a time.

    If there is a store, a file beside it has the position of the record meanwhile, so that one over
    which the process was killed is known when the run is resumed: it is identified in a process of
    its own.
    """

    def __init__(self, work: Work, store: RowStore | None) -> None:
        super().__init__(work, 1)
        self._mark = None if store is None else store.path.with_name(f"{store.path.name}-running")
        self._killers: set[str] = set()
        with suppress(OSError, ValueError):
            self._killers = set(self._mark.read_text("ascii").split() if self._mark else ())

    def close(self) -> None:
        """Give up what is not finished."""
        super().close()
        self._write()

    def _result(self, task: Task, future: Any) -> list[Done]:
        if not future.exception():
            self._killers.discard(str(task[1]))
        return super()._result(task, future)

    def _submit(self, task: Task) -> Any:
        if str(task[1]) in self._killers:
            return super()._submit(task)
        self._write(str(task[1]))
        future: Future[Done] = Future()
        future.set_result(self._work(*task))
        return future

    def _write(self, *running: str) -> None:
        with suppress(OSError):  # a full disk prevents the mark, not the result
            if self._mark is not None and (self._killers or running):
                self._mark.write_text(" ".join([*self._killers, *running]), encoding="ascii")
            elif self._mark is not None:
                self._mark.unlink(missing_ok=True)


class Cluster(Workers):
    """The workers of a Dask cluster."""

    def __init__(self, work: Work, client: Any) -> None:
        import dask
        from dask.utils import parse_timedelta

        super().__init__(work, 0)
        limit = dask.config.get("distributed.scheduler.no-workers-timeout", None) or _NO_WORKERS
        self._patience = parse_timedelta(limit)
        self._client = client

    def _most(self) -> int:
        threads: int = sum(self._client.nthreads().values())
        return _AHEAD + 2 * threads

    def _submit(self, task: Task) -> Any:
        import cloudpickle

        if self._why_lost:
            raise BrokenExecutor
        return self._client.submit(_identified, cloudpickle.dumps((self._work, task)), pure=False)

    def _cancel(self, futures: list[Any]) -> None:
        self._client.cancel(futures)

    def _ask(self) -> None:
        if not self._client.nthreads():
            self._why_lost = f"no worker in the Dask cluster for {self._patience:g} s"
            self.close()


def _identified(sent: bytes) -> bytes:
    """On a worker of Dask: identify a record."""
    work, task = pickle.loads(sent)
    return pickle.dumps(work(*task))
