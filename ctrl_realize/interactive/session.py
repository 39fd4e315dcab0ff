"""A session: its state, what was computed for it, and the view that a page draws."""

from __future__ import annotations

import base64
import hashlib
import json
from collections import OrderedDict
from collections.abc import Callable, Mapping
from contextlib import AbstractContextManager, suppress
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any, TypeVar

from .._checks import check_type, real
from .._wording import times_in
from ..data import Record
from ..data.shown_units import shown_time_unit
from ..errors import CtrlRealizeError, DataError, FileFormatError, OptionError
from ..experiment import plan as plan_test
from ..io.models import model_to_text
from . import loops, model_view, models, outputs, records, saving
from .data_view import Row, data_view
from .drawing import JSON
from .state import State, changed, empty

T = TypeVar("T")

_KEPT, _MOST_UNDONE = 48, 200
_REFUSED = (CtrlRealizeError, ArithmeticError, ValueError, KeyError)


@dataclass(frozen=True)
class Task:
    """Something that takes a while: what it is in words, its key, and the call."""

    what: str
    key: str
    call: Callable[..., Any]
    arguments: tuple[Any, ...]


class MissingError(Exception):
    """What was asked for needs a task that has not been done."""

    def __init__(self, task: Task) -> None:
        super().__init__(task.what)
        self.task = task


class Session:
    """Work on records, a model and its loop, steered by commands.

    A command is a dictionary with what to do under ``"do"``: ``"open"`` a file, ``"set"`` values of
    a part (`state.CHECKS` lists them), ``"select"`` or ``"remove"`` a record, ``"undo"``,
    ``"redo"``, ``"compute"`` what the view lacks, ``"drag"``, ``"slide"``, ``"figures"``,
    ``"write"`` a file, ``"view"``. `apply` answers with JSON: the ``"view"``, or ``"drag"``,
    ``"slide"``, ``"figures"`` or ``"written"``; and ``"error"``, a sentence, if there is one. The
    same commands give the same answers.

    Examples
    --------
    >>> import ctrl_realize as cr
    >>> from ctrl_realize.interactive.session import Session
    >>> session = Session()
    >>> session.add_record(cr.bench.valve(noise=0.01).step_record(16, rng=5))
    >>> session.apply({"do": "set", "part": "model", "values": {"structure": [1, 1]}})["view"][
    ...     "pending"
    ... ]
    'fitting all structures'
    """

    def __init__(self) -> None:
        self.files: dict[str, bytes] = {}
        self._states, self._at = [empty()], 0
        self._results: OrderedDict[str, Any] = OrderedDict()

    @property
    def state(self) -> State:
        """What the page shows, as JSON."""
        return self._states[self._at]

    def add_file(self, path: str | Path) -> JSON:
        """Open a file of this machine, as the command ``"open"`` does with its content."""
        name, content = Path(path).name, base64.b64encode(Path(path).read_bytes()).decode()
        return self.apply({"do": "open", "name": name, "content": content, "path": str(path)})

    def add_record(self, record: Record) -> None:
        """Take a record that there is already."""
        file = self._stored(records.given_content(record))
        name = record.name or "record"
        self._change({"do": "add", "file": file, "name": name, "options": {}, "given": True})

    def apply(self, command: Mapping[str, Any]) -> JSON:
        """Carry out a command and answer with JSON."""
        while isinstance(answer := self.attempt(command), Task):
            self.store(answer, done(answer))
            command = after(command)
        return answer

    def attempt(self, command: object) -> JSON | Task:
        """Answer a command, or tell what has to be computed first, perhaps elsewhere.

        Its result is for `store`; then the command that `after` gives is the next one.
        """
        given = command if isinstance(command, Mapping) else {}
        answer: JSON = {"id": given.get("id")}
        try:
            answer |= self._answer(given)
        except MissingError as found:
            return found.task
        except (*_REFUSED, OSError) as error:
            answer["error"] = str(error)
        if answer.keys() <= {"id", "error"}:
            answer["view"] = self.view()
        return answer

    def store(self, task: Task, result: Any) -> None:
        """Keep the result of a task, or the error that it ended with."""
        self._results[task.key] = result
        while len(self._results) > _KEPT:
            self._results.popitem(last=False)

    def view(self) -> JSON:
        """All that a page shows of this state; what is not computed yet is None."""
        seen: JSON = {
            "state": self.state, "pending": "", "choices": outputs.CHOICES,
            "can": {"undo": self._at > 0, "redo": self._at + 1 < len(self._states)},
        }  # fmt: skip
        with self._units():
            seen["data"] = self._data()
            for name, part in self._parts().items():
                seen[name] = None
                try:
                    seen[name] = part()
                except MissingError as found:
                    seen["pending"] = seen["pending"] or found.task.what
                except _REFUSED as error:
                    seen[name] = {"error": str(error)}
            seen["script"] = self.script()
        return seen

    def script(self) -> str:
        """The lines of Python that do the same."""
        known: JSON = {}
        tuned: list[str] = []
        with suppress(MissingError, *_REFUSED):
            known = self._known()
            self._get(self._tuned())
            tuned = outputs.controller_lines(self.state["loop"], self._system())
        return outputs.script(self.state, known, tuned)

    # -- commands ---------------------------------------------------------------------------------

    def _answer(self, command: Mapping[str, Any]) -> JSON:
        name = command.get("do")
        if name in ("drag", "slide"):
            with self._units(), suppress(MissingError):  # there is nothing to drag yet
                return {name: (self._drag if name == "drag" else self._slide)(command)}
            return {name: None}
        if name == "compute":
            for part in self._parts().values():
                with suppress(*_REFUSED):
                    part()
        if name == "figures":
            return {"figures": self._get(self._figures())}
        if name == "write":
            return {"written": self._write(str(command.get("what")))}
        if name == "open":
            self._open(command)
        elif name in ("undo", "redo"):
            there = self._at + (1 if name == "redo" else -1)
            self._at = sorted((0, there, len(self._states) - 1))[1]
        elif name not in ("view", "compute"):
            self._change(command)
        return {}

    def _change(self, command: Mapping[str, Any]) -> None:
        before = [*self._states], self._at
        self._go_on(changed(self.state, command), kept=command["do"] != "select")
        try:
            with suppress(MissingError):
                # What cannot be done with the data or the model does not become part of the state.
                if command.get("part") == "record" and "options" not in command["values"]:
                    self._record(command["index"])
                if "known" in command.get("values", {}):
                    self._known()
        except CtrlRealizeError:
            self._states, self._at = before
            raise

    def _go_on(self, state: State, kept: bool = True) -> None:
        """Go to a new state, from which `undo` leads back to that before."""
        if kept and state != self.state:
            self._states = self._states[max(self._at - _MOST_UNDONE, 0) : self._at + 1]
            self._at = len(self._states)
            self._states.append(state)
        else:
            self._states[self._at] = state

    def _open(self, command: Mapping[str, Any]) -> None:
        name = str(command.get("name") or "file")
        content = base64.b64decode(str(command.get("content") or ""))
        if saving.is_work(content):
            state, files = saving.opened(content.decode("utf-8"))
            self.files |= files
            return self._go_on(state)
        key, path = self._stored(content), command.get("path")
        given: JSON = {"options": {}, "file": key, "name": name, "path": path}
        if reason := records.why_unreadable(content, name):
            with suppress(CtrlRealizeError):
                records.read_response(content, name)
                return self._change({"do": "add_response", **given})
            # The page asks for the columns of a table whose names do not tell them.
            if not records.preview(content, {"name": name, "options": {}})["columns"]:
                raise FileFormatError(reason)
        return self._change({"do": "add", **given})

    def _drag(self, command: Mapping[str, Any]) -> JSON:
        given: Any = command.get("values")
        check_type(given, Mapping, "values", "the parameters that are moved", OptionError)
        values = {str(key): real(value, str(key), "number") for key, value in given.items()}
        return models.drag(self._system(), self._free(), values)

    def _slide(self, command: Mapping[str, Any]) -> JSON:
        settings = self.state["loop"] | {"speed": real(command.get("speed"), "speed", "number")}
        loop = loops.tuned_loop(system := self._system(), settings, checked=False)
        numbers = loops.numbers_to_enter(loop.controller, settings)
        return loops.drawn(system, loop, settings, all_plants=False) | {"numbers": numbers}

    def _write(self, what: str) -> JSON:
        texts: dict[str, tuple[str, Callable[[], str]]] = {
            "work": ("work.json", lambda: saving.saved(self.state, self.files)),
            "script": ("identify.py", self.script),
            "report": ("report.html", lambda: str(self._get(self._report()))),
            "plan": ("test.csv", lambda: outputs.plan_file(self._get(self._planned()))),
            "model": ("model.json", lambda: model_to_text(self._system())),
        }
        if what in texts:
            name, text = texts[what]
            return outputs.written(name, text())
        loop = self._get(self._tuned())
        return outputs.code(what, loop.controller, self.state["loop"]["limits"])

    # -- what is computed -------------------------------------------------------------------------

    def _stored(self, content: bytes) -> str:
        key = hashlib.sha256(content).hexdigest()
        self.files[key] = content
        return key

    def _get(self, task: Task, *, at_once: bool = False) -> Any:
        """Result of a task; one that takes a while is not begun here."""
        if task.key not in self._results:
            if not at_once:
                raise MissingError(task)
            self.store(task, done(task))
        self._results.move_to_end(task.key)
        if isinstance(found := self._results[task.key], Exception):
            raise found
        return found

    def _now(self, what: str, given: Any, call: Callable[..., T], *arguments: Any) -> T:
        found: T = self._get(task_of(what, given, call, *arguments), at_once=True)
        return found

    def _raw(self, index: int) -> tuple[Record, list[str]]:
        row = self.state["records"][index]
        given = [row[key] for key in ("file", "options", "given", "name")]
        return self._now("reading", given, records.read, self.files[row["file"]], row)

    def _record(self, index: int) -> Record:
        raw, row = self._raw(index)[0], self.state["records"][index]
        return self._now("changing", row, records.edited, raw, row)

    def _records(self) -> list[Record]:
        used = [k for k, row in enumerate(self.state["records"]) if row["used"]]
        if not used:
            raise DataError("no record is chosen; drop a file here, or choose one")
        return [self._record(k) for k in used]

    def _fit(self, structure: Any, known: JSON | None = None) -> Task:
        kind = "known parameters" if known else "one structure" if structure else "all structures"
        rows = [row for row in self.state["records"] if row["used"]]
        given = self._records(), structure, known or {}
        return task_of(f"fitting {kind}", [rows, *given[1:]], models.identified, *given)

    def _free(self) -> Any:
        return self._get(self._fit(self.state["model"]["structure"]))

    def _known(self) -> JSON:
        known = self.state["model"]["known"]
        return models.with_known(self._free(), known) if known else {}

    def _fitted(self) -> Task:
        return self._fit(self.state["model"]["structure"], self._known())

    def _system(self) -> Any:
        return self._get(self._fitted())

    def _after_fit(self, what: str, given: Any, call: Callable[..., Any], *more: Any) -> Task:
        """Task with the model and what it is `given` besides, as JSON; `more` are arguments."""
        return task_of(what, [self._fitted().key, given], call, self._system(), *more)

    def _tuned(self) -> Task:
        settings = {key: self.state["loop"][key] for key in ("kind", "rule", "speed")}
        return self._after_fit("tuning", settings, loops.tuned_loop, settings)

    def _drawn(self) -> Task:
        tuned, settings = self._tuned(), self.state["loop"]
        given = [tuned.key, *(settings[key] for key in ("limits", "setpoint", "load"))]
        loop = self._get(tuned)
        return self._after_fit("simulating the loop", given, loops.drawn, loop, settings)

    def _planned(self) -> Task:
        wanted = {key: value for key, value in self.state["plan"].items() if value is not None}
        return self._after_fit("planning a test", wanted, partial(plan_test, **wanted))

    def _figures(self) -> Task:
        return self._after_fit("drawing", self.state["frf"], outputs.figures, self._frf())

    def _report(self) -> Task:
        lines, controller = self.script(), self._get(self._tuned()).controller
        more = self._frf(), lines, controller, self.state["loop"]
        return self._after_fit("writing the report", lines, outputs.report, *more)

    def _frf(self) -> Any:
        row = self.state["frf"]
        given = row and (self.files[row["file"]], row["name"])
        return row and self._now("reading", row, records.read_response, *given)

    # -- the view ---------------------------------------------------------------------------------

    def _units(self) -> AbstractContextManager[None]:
        """Write times in the unit of the records."""
        with suppress(CtrlRealizeError):
            return times_in(shown_time_unit(self._records()))
        return times_in("s")

    def _parts(self) -> dict[str, Callable[[], JSON | None]]:
        """Parts of the view that need computing, in this order."""
        return {"model": self._model, "loop": self._loop, "plan": self._plan}

    def _data(self) -> JSON:
        rows: list[Row] = []
        for k, row in enumerate(self.state["records"]):
            try:
                rows.append((row, *self._raw(k), self._record(k)))
            except CtrlRealizeError as error:
                rows.append((row, None, [str(error)], None))
        at = self.state["selected"]
        seen: JSON = dict(self._now("data view", [self.state["records"], at], data_view, rows, at))
        if rows and not rows[at][0]["given"]:
            row = self.state["records"][at]
            key, content = [row["file"], row["options"]], self.files[row["file"]]
            seen["preview"] = self._now("preview", key, records.preview, content, row)
        return seen | {"frf": self.state["frf"] and self.state["frf"]["name"]}

    def _model(self) -> JSON:
        table, free, known = self._get(self._fit(None)), self._free(), self.state["model"]["known"]
        task = self._after_fit(
            "drawing the model", known, model_view.model_view, free, table, known
        )
        seen: JSON = self._get(task, at_once=True)
        return seen

    def _loop(self) -> JSON:
        controller = self._get(self._tuned()).controller
        numbers = loops.numbers_to_enter(controller, self.state["loop"])
        return {**self._get(self._drawn()), "numbers": numbers}

    def _plan(self) -> JSON | None:
        if self.state["plan"]["want"] is None:
            return None
        return outputs.plan_view(self._get(self._planned()), self._system())


def done(task: Task) -> Any:
    """Do a task; its error is a result as well."""
    try:
        return task.call(*task.arguments)
    except _REFUSED as error:
        return error


def after(command: Mapping[str, Any]) -> Mapping[str, Any]:
    """What is left of a command when the task that it needed is done."""
    return {**command, "do": "view"} if command.get("do") == "compute" else command


def task_of(what: str, given: Any, call: Callable[..., Any], *arguments: Any) -> Task:
    """Task whose result is that of what it is `given`, as JSON."""
    key = hashlib.sha256(json.dumps([what, given], sort_keys=True).encode()).hexdigest()
    return Task(what, key, call, arguments)
