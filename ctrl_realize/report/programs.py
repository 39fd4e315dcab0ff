"""A result for programs: numbers with units, verdicts, and what may be done with the model."""

from __future__ import annotations

import json
import math
import pkgutil
from collections.abc import Sequence
from typing import Any

import numpy as np

from .._checks import check_type
from .._facts import version_of
from .._flags import in_doubt
from .._wording import ASSUMED
from ..data import Record
from ..delayed import DelayedStateSpace
from ..design.tuning.controller import PIDController
from ..design.tuning.forms import PIDForm
from ..errors import UnsuitableSystemError
from ..results import ModelFit

FORMAT = "ctrl_realize identification"
SCHEMA = 1
_ALLOWED = {"good": "yes", "with care": "with care", "no": "no"}
_QUESTIONS = {"dead_time": "dead time", "gain": "gain", "tuning": "tuning"}


def summary(
    system: DelayedStateSpace,
    records: Record | Sequence[Record] = (),
    *,
    warnings: Sequence[str] = (),
    controller: PIDController | None = None,
    form: PIDForm | None = None,
) -> dict[str, Any]:
    """Return the result of an identification as JSON content, after ``identification.schema.json``.

    Parameters
    ----------
    system : DelayedStateSpace
        The model, with its `fit`.
    records : Record or sequence of Record, optional
        Records that it was identified from.
    warnings : sequence of str, optional
        What was told while they were read.
    controller : PIDController, optional
        From `design.pid` for `system`.
    form : PIDForm, optional
        Its parameters as they are entered.

    Returns
    -------
    dict
        Times are in s; numbers that are not known are None. ``use`` tells for dead time, gain and
        tuning whether the model may be used for it: ``"yes"``, ``"with care"``, ``"no"``, or
        ``"not judged"`` where the method gives no verdict, with the reason.

    Raises
    ------
    UnsuitableSystemError
        `system` is not an identified model.

    Examples
    --------
    >>> import ctrl_realize as cr
    >>> record = cr.bench.valve().step_record(16, rng=5)
    >>> content = cr.report.summary(cr.identify(record, structures=[(3, 3)]), record)
    >>> content["use"]["tuning"]["allowed"], content["model"]["dead_time"]["unit"]
    ('yes', 's')
    """
    expected = "a model with dead time, as returned by identify"
    check_type(system, DelayedStateSpace, "system", expected, UnsuitableSystemError)
    fit = system.fit
    if fit is None:
        raise UnsuitableSystemError(f"{system.name!r} has no fit; expected {expected}")
    given = (records,) if isinstance(records, Record) else tuple(records)
    return {
        **_head("identified", warnings),
        "records": [_record(one) for one in given],
        "model": _model(system, fit),
        "verdicts": [
            {"question": one.question, "level": one.level, "because": one.sentence,
             "number": _number(one.number)}
            for one in fit.verdicts
        ],
        "use": _use(fit),
        "flags": [
            {"code": one.code, "kind": "warning" if in_doubt(one) else "note", "text": str(one)}
            for one in fit.flags
        ],
        "controller": None if controller is None else _controller(controller, form),
    }  # fmt: skip


def identification_schema() -> dict[str, Any]:
    """Return the JSON schema of `summary`, and of what ``identify --json`` writes.

    Returns
    -------
    dict

    Examples
    --------
    >>> import ctrl_realize as cr
    >>> cr.report.identification_schema()["properties"]["status"]
    {'enum': ['identified', 'refused']}
    """
    text = (pkgutil.get_data("ctrl_realize.report", "identification.schema.json") or b"").decode()
    content: dict[str, Any] = json.loads(text)
    return content


def refusal(error: Exception, message: str, warnings: Sequence[str] = ()) -> dict[str, Any]:
    """Return what is told of a record from which no model was identified."""
    why = {"allowed": "no", "because": message}
    return {
        **_head("refused", warnings),
        "error": {"kind": type(error).__name__, "text": message},
        "use": dict.fromkeys(_QUESTIONS, why),
    }


def _head(status: str, warnings: Sequence[str]) -> dict[str, Any]:
    return {
        "format": FORMAT, "schema": SCHEMA, "version": version_of("ctrl-realize"),
        "status": status, "warnings": list(warnings),
    }  # fmt: skip


def _record(record: Record) -> dict[str, Any]:
    def signals(labels: Sequence[str], units: Sequence[str]) -> list[dict[str, str]]:
        return [{"name": name, "unit": unit} for name, unit in zip(labels, units, strict=True)]

    return {
        "name": record.name,
        "samples": int(np.count_nonzero(record.seen)) if record.irregular else record.n_samples,
        "missing": 0 if record.irregular else record.n_missing,
        "sample_time": record.sample_time,
        "length": float(record.time[-1] - record.time[0]),
        "time_unit_assumed": record.units.get("time") == ASSUMED,
        "inputs": signals(record.input_labels, record.input_units),
        "outputs": signals(record.output_labels, record.output_units),
        "set_point": record.reference is not None,
    }


def _model(system: DelayedStateSpace, fit: ModelFit) -> dict[str, Any]:
    low, high = fit.interval or (None, None)
    return {
        "method": fit._method,
        "formula": fit.formula,
        "sample_time": float(system.dt),
        "order": int(system.delay_free.nstates),
        "dead_time": {
            "value": _number(fit.dead_time), "low": _number(low), "high": _number(high),
            "unit": "s", "interval": fit.interval_label,
        },
        "parameters": [
            {"name": one.name, "value": _number(one.value), "low": _number(one.low),
             "high": _number(one.high), "unit": one.unit}
            for one in fit.parameters
        ],
    }  # fmt: skip


def _use(fit: ModelFit) -> dict[str, dict[str, str]]:
    told = {one.question: one for one in fit.verdicts}
    return {
        key: {"allowed": _ALLOWED[told[question].level], "because": told[question].sentence}
        if question in told
        else {"allowed": "not judged", "because": "this method gives no verdict"}
        for key, question in _QUESTIONS.items()
    }


def _controller(pid: PIDController, form: PIDForm | None) -> dict[str, Any]:
    check, written = pid.check, pid.as_form() if form is None else form
    worst = None if check is None or check.worst is None else check.worst.ms
    return {
        "kind": pid.kind,
        "rule": pid.rule,
        "gain": {"value": pid.kp, "unit": pid.gain_unit},
        **{name: _number(getattr(pid, name)) for name in ("ti", "td", "tf")},
        "sample_time": float(pid.dt),
        "form": written.form,
        "enter": [
            {"name": one.name, "value": one.value, "unit": one.unit} for one in written.values
        ],
        "action": "direct" if written.reversed_action else "reverse",
        "ms": None if check is None else _number(check.margins.ms),
        "ms_at_worst": _number(worst),
        "stable_on_all": check is not None and check.stable and worst != math.inf,
        "flags": [] if check is None else [str(flag) for flag in check.flags],
    }


def _number(value: float | None) -> float | None:
    """A number that JSON has; None for infinite and unknown ones."""
    return None if value is None or not math.isfinite(value) else float(value)
