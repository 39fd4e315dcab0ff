"""A session: its state, what was computed for it, and the view that a page draws."""

from __future__ import annotations

import base64
import hashlib
import json
from collections import OrderedDict
from collections.abc import Callable, Mapping
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from .._wording import times_in
from ..data import Record
from ..data.shown_units import shown_time_unit
from ..delayed import DelayedStateSpace
from ..errors import CtrlRealizeError, DataError, FileFormatError, OptionError
from . import loops, models, outputs, records
from .data_view import Row, data_view
from .drawing import JSON
from .state import EMPTY, State, changed, checked

FORMAT, SCHEMA = "ctrl_realize work", 1
MOST_BYTES = 512 * 2**20
_KEPT, _MOST_UNDONE = 48, 200
_NOT_UNDONE = ("select",)
"""Commands that are no step for `undo`."""


@dataclass(frozen=True)
class Task:
    """Something that takes a while: what it is in words, its key, and the call."""

    what: str
    key: str
    call: Callable[..., Any]
    arguments: tuple[Any, ...]


class Session:
    """Work on records, a model and its loop, steered by commands.

    A command is a dictionary with the name of what to do under ``"do"``, see `state.CHANGES`; there
    are also ``"open"`` (a file), ``"compute"``, ``"drag"``, ``"slide"``, ``"undo"``, ``"redo"``,
    ``"figures"``, ``"write"`` and ``"view"``. `apply` answers with JSON: the ``"view"``, or
    ``"drag"``, ``"slide"``, ``"figures"`` or ``"written"``, and ``"error"``, a sentence, if there
    is one. The same commands give the same answers.

    Examples
    --------
    >>> import ctrl_realize as cr
    >>> from ctrl_realize.interactive.session import Session
    >>> session = Session()
    >>> session.add_record(cr.bench.valve(noise=0.01).step_record(16, rng=5))
    >>> answer = session.apply({"do": "structure", "structure": [1, 1]})
    >>> answer["view"]["pending"]
    ['fitting all structures', 'fitting one structure']
    """

    def __init__(self) -> None:
        self.state: State = json.loads(json.dumps(EMPTY))
        self.files: dict[str, bytes] = {}
        self._undo: list[State] = []
        self._redo: list[State] = []
        self._results: OrderedDict[str, Any] = OrderedDict()

    def add_file(self, path: str | Path) -> JSON:
        """Open a file of this machine, as the command ``"open"`` does with its content."""
        file = Path(path)
        content = base64.b64encode(file.read_bytes()).decode()
        return self.apply({"do": "open", "name": file.name, "content": content, "path": str(path)})

    def add_record(self, record: Record) -> None:
        """Take a record that there is already."""
        content = records.given_content(records.checked_siso(record))
        name = record.name or "record"
        self._change(
            {"do": "add", "file": self._stored(content), "name": name, "options": {}, "given": True}
        )

    def apply(self, command: Mapping[str, Any]) -> JSON:
        """Carry out a command and answer with JSON."""
        done: JSON = {"id": command.get("id")}
        try:
            done |= self._applied(command)
        except (CtrlRealizeError, OSError) as error:
            done |= {"error": str(error)}
        if not {"drag", "slide", "figures", "written"} & done.keys():
            done["view"] = self.view()
        return done

    def task(self, command: Mapping[str, Any]) -> Task | None:
        """The long part of a command, to be done elsewhere and given to `store` before `apply`."""
        name, task = command.get("do"), None
        with suppress(CtrlRealizeError, ArithmeticError):  # `apply` says it
            if name == "compute":
                task = next(iter(self._pending()), None)
            elif name == "figures":
                task = self._figures()
            elif name == "write" and command.get("what") == "report":
                task = self._report()
        return None if task is None or task.key in self._results else task

    def store(self, task: Task, result: Any) -> None:
        """Keep the result of a task, or the error that it ended with."""
        self._results[task.key] = result
        self._results.move_to_end(task.key)
        while len(self._results) > _KEPT:
            self._results.popitem(last=False)

    def saved(self) -> str:
        """The work as text: files, state, and a checksum as in model files."""
        content = {
            "format": FORMAT, "schema": SCHEMA, "state": self.state,
            "files": {key: base64.b64encode(self.files[key]).decode() for key in self._used()},
        }  # fmt: skip
        return json.dumps(content | {"sha256": _digest(content)}, indent=1) + "\n"

    def open_saved(self, text: str) -> None:
        """Take up work that was saved.

        Raises
        ------
        FileFormatError
            No such file, of a later version, edited or damaged.
        """
        try:
            content = json.loads(text)
        except (ValueError, RecursionError) as error:
            raise FileFormatError(f"not a file of saved work, or truncated: {error}") from error
        if not isinstance(content, dict) or content.get("format") != FORMAT:
            raise FileFormatError(f"not a file of saved work; expected the format {FORMAT!r}")
        if content.get("schema") != SCHEMA:
            raise FileFormatError(
                f"schema {content.get('schema')!r}; this version reads {SCHEMA}; update it"
            )
        if content.pop("sha256", None) != _digest(content):
            raise FileFormatError("the checksum does not match: the file was edited or damaged")
        files = {key: base64.b64decode(value) for key, value in content["files"].items()}
        before, self.state = self.state, checked(content["state"], files)
        self.files |= files
        self._undo.append(before)
        self._redo.clear()

    # -- commands ---------------------------------------------------------------------------------

    def _applied(self, command: Mapping[str, Any]) -> JSON:
        name = command.get("do")
        if name == "view":
            return {}
        if name == "compute":
            task = next(iter(self._pending()), None)
            if task is not None:
                self._result(task)
            return {}
        if name == "drag":
            return {"drag": self._drag(command.get("values", {}))}
        if name == "slide":
            return {"slide": self._slide(float(command["speed"]))}
        if name == "figures":
            return {"figures": self._result(self._figures())}
        if name == "write":
            return {"written": self._write(command)}
        if name == "open":
            self._open(command)
        elif name in ("undo", "redo"):
            self._back(name)
        else:
            self._change(command)
        return {}

    def _change(self, command: Mapping[str, Any]) -> None:
        new = changed(self.state, command)
        before, self.state = self.state, new
        try:
            self._check(command)
        except CtrlRealizeError:
            self.state = before
            raise
        if command["do"] not in _NOT_UNDONE and new != before:
            self._undo = [*self._undo[-_MOST_UNDONE:], before]
            self._redo.clear()

    def _check(self, command: Mapping[str, Any]) -> None:
        """Refuse what cannot be done with the data or the model, before it is part of the state."""
        if command["do"] in ("range", "rest", "shift", "strike", "units"):
            self._record(command.get("index", self.state["selected"]))
        if command["do"] == "known" and self.state["model"]["known"]:
            fit = models.fit_of_lags(self._free())
            if fit is None:
                raise OptionError("a parameter can be known in a model of lags with dead time only")
            models.with_known(fit, self.state["model"]["known"])

    def _back(self, name: str) -> None:
        taken, given = (self._undo, self._redo) if name == "undo" else (self._redo, self._undo)
        if taken:
            given.append(self.state)
            self.state = taken.pop()

    def _open(self, command: Mapping[str, Any]) -> None:
        name = str(command.get("name") or "file")
        content = base64.b64decode(command.get("content", ""))
        if len(content) > MOST_BYTES:
            raise FileFormatError(f"{name} has {len(content)} bytes; expected {MOST_BYTES} at most")
        if content[:1] == b"{" and FORMAT.encode() in content[:200]:
            self.open_saved(content.decode("utf-8", "replace"))
            return
        options, reason = records.first_reading(content, name)
        given = {"file": self._stored(content), "name": name, "path": command.get("path")}
        if reason:
            try:
                records.read_response(content, name)
            except CtrlRealizeError:
                columns = records.preview(content, {"name": name, "options": {}})["columns"]
                if not columns:
                    raise FileFormatError(reason) from None
                # a table of which the columns are not known yet: the page asks for them
            else:
                self._change({"do": "add_response", **given})
                return
        self._change({"do": "add", "options": options, **given})

    def _drag(self, values: Mapping[str, Any]) -> JSON:
        fit, free = (models.fit_of_lags(one) for one in (self._model(), self._free()))
        if fit is None or free is None:
            raise OptionError("this model has no parameters to drag")
        with self._units():
            return models.drag(fit, free, {str(k): float(v) for k, v in values.items()})

    def _slide(self, speed: float) -> JSON:
        settings = self.state["loop"] | {"speed": speed}
        system = self._model()
        with self._units():
            loop = loops.sketched_loop(system, settings)
            numbers = loops.numbers_to_enter(loop.controller, settings)
            return loops.drawn(system, loop, settings, all_plants=False) | {"numbers": numbers}

    def _write(self, command: Mapping[str, Any]) -> JSON:
        what = str(command.get("what"))
        if what == "work":
            return outputs.written("work.json", self.saved())
        if what == "script":
            return outputs.written("identify.py", self.script())
        if what == "report":
            return outputs.written("report.html", self._result(self._report()))
        if what == "plan":
            return outputs.plan_file(self._result(self._plan()))
        task = self._loop_task()
        return outputs.model_or_code(what, self._model(), lambda: self._result(task).controller,
                                     self.state["loop"])  # fmt: skip

    # -- what is computed -------------------------------------------------------------------------

    def _stored(self, content: bytes) -> str:
        key = hashlib.sha256(content).hexdigest()
        self.files[key] = content
        return key

    def _used(self) -> list[str]:
        rows = [*self.state["records"], *([self.state["frf"]] if self.state["frf"] else [])]
        return sorted({row["file"] for row in rows})

    def _result(self, task: Task) -> Any:
        if task.key not in self._results:
            try:
                self.store(task, task.call(*task.arguments))
            except (CtrlRealizeError, ArithmeticError) as error:
                self.store(task, error)
        self._results.move_to_end(task.key)
        found = self._results[task.key]
        if isinstance(found, Exception):
            raise found
        return found

    def _memo(self, what: str, given: Any, call: Callable[..., Any], *arguments: Any) -> Any:
        return self._result(Task(what, _key(what, given), call, arguments))

    def _raw(self, index: int) -> tuple[Record, list[str]]:
        row = self.state["records"][index]
        given = {key: row.get(key) for key in ("file", "options", "given", "name")}
        found: tuple[Record, list[str]] = self._memo(
            "reading", given, records.read, self.files[row["file"]], row
        )
        records.checked_siso(found[0])
        return found

    def _record(self, index: int) -> Record:
        row = self.state["records"][index]
        found: Record = self._memo("changing", row, records.edited, self._raw(index)[0], row)
        return found

    def _records(self) -> list[Record]:
        used = [k for k, row in enumerate(self.state["records"]) if row["used"]]
        if not used:
            raise DataError("no record is chosen; drop a file here, or choose one")
        return [self._record(k) for k in used]

    def _fit_task(self, structure: Any, known: JSON) -> Task:
        rows = [row for row in self.state["records"] if row["used"]]
        what = "with known parameters" if known else "one structure" if structure else (
            "all structures")  # fmt: skip
        return Task(
            f"fitting {what}", _key("fit", [rows, structure, known]), models.identified,
            (self._records(), structure, known),
        )  # fmt: skip

    def _table(self) -> DelayedStateSpace:
        found: DelayedStateSpace = self._result(self._fit_task(None, {}))
        return found

    def _free(self) -> DelayedStateSpace:
        found: DelayedStateSpace = self._result(
            self._fit_task(self.state["model"]["structure"], {})
        )
        return found

    def _model_task(self) -> Task:
        known = self.state["model"]["known"]
        fit = models.fit_of_lags(self._free()) if known else None
        wanted = {} if fit is None else models.with_known(fit, known)
        return self._fit_task(self.state["model"]["structure"], wanted)

    def _model(self) -> DelayedStateSpace:
        found: DelayedStateSpace = self._result(self._model_task())
        return found

    def _loop_task(self) -> Task:
        settings, fit = self.state["loop"], self._model_task()
        shown = {key: settings[key] for key in ("kind", "rule", "speed")}
        return Task("tuning", _key("loop", [fit.key, shown]), loops.tuned_loop,
                    (self._model(), settings))  # fmt: skip

    def _drawing_task(self) -> Task:
        settings, tuned = self.state["loop"], self._loop_task()
        shown = {key: settings[key] for key in ("limits", "setpoint", "load")}
        return Task("simulating the loop", _key("drawing", [tuned.key, shown]), loops.drawn,
                    (self._model(), self._result(tuned), settings))  # fmt: skip

    def _plan(self) -> Task:
        wanted = {key: value for key, value in (self.state["plan"] or {}).items() if value}
        fit = self._model_task()
        return Task("planning a test", _key("plan", [fit.key, wanted]), outputs.planned,
                    (self._model(), wanted))  # fmt: skip

    def _figures(self) -> Task:
        fit, frf = self._model_task(), self._frf()
        return Task("drawing", _key("figures", [fit.key, self.state["frf"]]), outputs.figures,
                    (self._model(), frf))  # fmt: skip

    def _report(self) -> Task:
        fit, script = self._model_task(), self.script()
        return Task("writing the report", _key("report", [fit.key, script]), outputs.report,
                    (self._model(), self._frf(), script))  # fmt: skip

    def _frf(self) -> Any:
        row = self.state["frf"]
        if row is None:
            return None
        return self._memo("reading", row, records.read_response, self.files[row["file"]],
                          row["name"])  # fmt: skip

    def _pending(self) -> list[Task]:
        """What the view needs and is not computed yet, in this order."""
        if not any(row["used"] for row in self.state["records"]):
            return []
        steps: list[Callable[[], Task]] = [
            lambda: self._fit_task(None, {}),
            lambda: self._fit_task(self.state["model"]["structure"], {}),
            self._model_task, self._loop_task, self._drawing_task,
        ]  # fmt: skip
        if self.state["plan"]:
            steps.append(self._plan)
        found: dict[str, Task] = {}
        for number, step in enumerate(steps):
            if found and number > 1:
                break  # what follows needs these
            try:
                task = step()
            except (CtrlRealizeError, ArithmeticError):
                continue  # the view says it
            if task.key not in self._results:
                found[task.key] = task
        return list(found.values())

    # -- the view ---------------------------------------------------------------------------------

    def _units(self) -> Any:
        """Write times in the unit of the records."""
        try:
            return times_in(shown_time_unit(self._records()))
        except CtrlRealizeError:
            return times_in("s")

    def view(self) -> JSON:
        """All that a page shows of this state."""
        with self._units():
            pending = self._pending()
            seen: JSON = {
                "state": self.state,
                "can": {"undo": bool(self._undo), "redo": bool(self._redo)},
                "pending": [one.what for one in pending],
                "data": self._data(),
                "choices": outputs.CHOICES,
                "script": self.script(),
            }
            fitted = not any(one.what.startswith("fitting") for one in pending)
            simulated = fitted and not any("planning" not in one.what for one in pending)
            planned = simulated and not pending and self.state["plan"]
            seen["model"] = self._part(self._model_view) if fitted else None
            seen["loop"] = self._part(self._loop_view) if simulated else None
            seen["plan"] = self._part(self._plan_view) if planned else None
            return seen

    def _part(self, view: Callable[[], JSON]) -> JSON | None:
        if not any(row["used"] for row in self.state["records"]):
            return None
        try:
            return view()
        except (CtrlRealizeError, ArithmeticError) as error:
            return {"error": str(error)}

    def _data(self) -> JSON:
        rows: list[Row] = []
        for k, row in enumerate(self.state["records"]):
            try:
                rows.append((row, *self._raw(k), self._record(k)))
            except CtrlRealizeError as error:
                rows.append((row, None, [str(error)], None))
        selected = self.state["selected"]
        seen = self._memo("data view", [self.state["records"], selected], data_view, rows, selected)
        seen = dict(seen)
        if rows:
            row = self.state["records"][selected]
            key = {part: row.get(part) for part in ("file", "options", "given")}
            seen["preview"] = self._memo(
                "preview", key, records.preview, self.files[row["file"]], row
            )
        seen["frf"] = None if self.state["frf"] is None else self.state["frf"]["name"]
        return seen

    def _model_view(self) -> JSON:
        free, task, known = self._free(), self._model_task(), self.state["model"]["known"]
        system, given = self._model(), [task.key, self.state["model"]]
        seen: JSON = self._memo(
            "model view", given, models.view, system, free, self._table(), known
        )
        return seen

    def _loop_view(self) -> JSON:
        settings, loop = self.state["loop"], self._result(self._loop_task())
        numbers = loops.numbers_to_enter(loop.controller, settings)
        drawn: JSON = self._result(self._drawing_task())
        return drawn | {"numbers": numbers}

    def _plan_view(self) -> JSON:
        return outputs.plan_view(self._result(self._plan()), self._model())

    def script(self) -> str:
        """The lines of Python that do the same."""
        known = {}
        if self.state["model"]["known"]:
            with suppress(CtrlRealizeError):
                fit = models.fit_of_lags(self._free())
                known = {} if fit is None else models.with_known(fit, self.state["model"]["known"])
        system = None
        if not self._pending() and self.state["records"]:
            with suppress(CtrlRealizeError, ArithmeticError):
                self._result(self._loop_task())
                system = self._model()
        return outputs.script(self.state, known, system)


def _key(what: str, given: Any) -> str:
    return hashlib.sha256(json.dumps([what, given], sort_keys=True).encode()).hexdigest()


def _digest(content: Mapping[str, Any]) -> str:
    text = json.dumps(content, sort_keys=True, separators=(",", ":"))
    return hashlib.sha256(text.encode()).hexdigest()
