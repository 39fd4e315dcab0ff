"""What both hosts of a session share: its lock, a process for long work, and static files."""

from __future__ import annotations

import functools
import multiprocessing
import threading
from collections.abc import Mapping
from importlib import resources
from multiprocessing.connection import Connection
from typing import Any, Self

from ..errors import CtrlRealizeError, DataError
from .drawing import JSON
from .session import Session, Task


@functools.cache
def static(name: str) -> str:
    """Text of a file of the page."""
    folder = resources.files("ctrl_realize.interactive") / "static"
    return (folder / name).read_text(encoding="utf-8")


@functools.cache
def page_style() -> str:
    """Style of the page: that of reports, and what they have not."""
    folder = resources.files("ctrl_realize.report") / "templates"
    return (folder / "report.css").read_text(encoding="utf-8") + static("app.css")


class Worker:
    """A process that does one thing at a time, and can be stopped."""

    def __init__(self) -> None:
        self._context = multiprocessing.get_context("spawn")
        self._changing = threading.Lock()
        self._running = self._stopped = False
        self._start()

    def _start(self) -> None:
        self._pipe, theirs = self._context.Pipe()
        self._process = self._context.Process(target=_work, args=(theirs,), daemon=True)
        self._process.start()
        theirs.close()  # so that its end is seen here

    def run(self, task: Task) -> Any:
        """Do a task and return its result, or the error that it ended with."""
        with self._changing:
            self._running, self._stopped = True, False
            pipe = self._pipe
        try:
            pipe.send((task.call, task.arguments))
            return pipe.recv()
        except (EOFError, OSError):
            if self._stopped:
                return CancelledError("cancelled; nothing was changed")
            with self._changing:
                self._start()
            return DataError(f"{task.what}: the process ended, perhaps for lack of memory")
        finally:
            self._running = False

    def cancel(self) -> None:
        """Stop what is being done, if anything; the next task has a new process."""
        with self._changing:
            if self._running:
                self._stopped = True
                self._end()
                self._start()

    def _end(self) -> None:
        self._process.terminate()
        self._process.join()

    def close(self) -> None:
        """End the process."""
        self._end()
        self._pipe.close()


class CancelledError(Exception):
    """A task that the user has stopped."""


def _work(pipe: Connection) -> None:
    """Do what comes through a pipe until it is closed."""
    while True:
        try:
            call, arguments = pipe.recv()
        except (EOFError, KeyboardInterrupt):
            return
        try:
            result = call(*arguments)
        except (CtrlRealizeError, ArithmeticError) as error:
            result = error
        except Exception as error:  # a defect is told as well, and the page goes on
            result = DataError(f"{type(error).__name__}: {error}")
        pipe.send(result)


class Host:
    """A session with a worker: long parts of commands can be cancelled, short ones go on."""

    def __init__(self, session: Session) -> None:
        self.session = session
        self._lock = threading.Lock()
        self._long = threading.Lock()
        self._worker = Worker()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self._worker.close()

    def answer(self, command: Mapping[str, Any]) -> JSON:
        """Carry out a command."""
        with self._lock:
            task = self.session.task(command)
        if task is not None:
            with self._long:
                result = self._worker.run(task)
            if isinstance(result, CancelledError):
                return {"id": command.get("id"), "cancelled": True, "error": str(result)}
            with self._lock:
                self.session.store(task, result)
        with self._lock:
            return self.session.apply(command)

    def cancel(self) -> None:
        """Stop the long work that is being done."""
        self._worker.cancel()
