"""What both hosts of a session share: its lock, a process for long work, and static files."""

from __future__ import annotations

import functools
import threading
import time
from collections.abc import Mapping
from concurrent.futures import Future
from importlib import resources
from typing import Any

from joblib.externals.loky import BrokenProcessPool, ProcessPoolExecutor
from joblib.externals.loky.process_executor import ShutdownExecutorError

from .._facts import facts
from ..errors import DataError
from .drawing import JSON
from .session import Session, Task, after, done

PAGE = facts("interactive/page.toml")
"""Parts of the page, and headers."""
_TURN = 5e-4  # s in which another thread has its turn


@functools.cache
def page_part(name: str) -> tuple[str, str]:
    """Kind and text of a part of the page; the style is that of reports, and what they have not."""
    kind, *files = PAGE["files"][name]
    folder = resources.files("ctrl_realize")
    places = [folder / "interactive" / "static", folder / "report" / "templates"]
    found = [place / file for file in files for place in places if (place / file).is_file()]
    return kind, "".join(file.read_text(encoding="utf-8") for file in found)


class CancelledError(Exception):
    """A task that the user has stopped."""


class Host:
    """A session, and a process for its long work, which can be stopped while short commands go on.

    Parameters
    ----------
    session : Session
    """

    def __init__(self, session: Session) -> None:
        self.session = session
        self._asking, self._working, self._changing = (threading.Lock() for _ in range(3))
        self._start()

    def answer(self, command: Mapping[str, Any]) -> JSON:
        """Carry out a command; ``"cancel"`` stops the long work that is being done."""
        if command.get("do") == "cancel":
            self._cancel()
            return {"id": command.get("id")}
        while True:
            with self._asking:
                answer = self.session.attempt(command)
            if not isinstance(answer, Task):
                return answer
            try:
                with self._working:
                    result = self._result(answer)
            except CancelledError as error:
                return {"id": command.get("id"), "cancelled": True, "error": str(error)}
            with self._asking:
                self.session.store(answer, result)
            command = after(command)

    def close(self) -> None:
        """End the process."""
        self._pool.shutdown(wait=True, kill_workers=True)

    def _start(self) -> None:
        self._pool = ProcessPoolExecutor(max_workers=1, timeout=None)
        # What it needs is loaded before there is something to do.
        self._submit(Task("loading", "", dict, ()))

    def _submit(self, task: Task) -> Future[Any]:
        """Give the process a task.

        The thread of the pool raises a KeyError if the pool is shut down before it took the task.
        """
        doing: Future[Any] = self._pool.submit(done, task)
        while not (doing.running() or doing.done()):
            time.sleep(_TURN)
        self._doing = doing
        return doing

    def _cancel(self) -> None:
        with self._changing:
            if not self._doing.done():
                self.close()
                self._start()

    def _result(self, task: Task) -> Any:
        """Result of a task, or the error that it ended with."""
        try:
            with self._changing:
                doing = self._submit(task)
            return doing.result()
        except ShutdownExecutorError as error:
            raise CancelledError("cancelled; nothing was changed") from error
        except BrokenProcessPool:
            with self._changing:
                self._start()
            return DataError(f"{task.what}: the process ended, perhaps for lack of memory")
        except Exception as error:  # a defect is told as well, and the page goes on
            return DataError(f"{type(error).__name__}: {error}")
