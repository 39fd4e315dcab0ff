"""What leaves a session: lines of Python, report, model, numbers, code, the plan of a test."""

from __future__ import annotations

import base64
import tempfile
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

from .. import export, plots
from .._wording import in_time
from ..delayed import DelayedStateSpace
from ..design.tuning.layouts import LAYOUTS
from ..design.tuning.pid import KINDS, RULES
from ..design.tuning.rules import kinds_of
from ..errors import DataError, OptionError
from ..experiment import ExperimentPlan
from ..experiment import plan as plan_test
from ..io.models import model_to_text
from ..numerics.constants import Z_95
from ..report import write_identification
from ..report.sketches import frf_sketches, sketch
from ..validation import analyse_residuals
from . import loops
from .drawing import JSON, axis, line, panel, time_axis
from .models import fit_of_lags
from .records import python_lines

CHOICES: JSON = {
    "kinds": list(KINDS),
    "rules": {rule: list(kinds_of(rule)) for rule in RULES},
    "forms": {name: layout.title for name, layout in LAYOUTS.items()},
    "speeds": list(loops.SPEEDS),
    "time_units": ["s", "ms", "min", "h", "day"],
    "want": {"dead_time": "dead time", "gain": "gain", "phase": "phase margin", "Ms": "Ms"},
}
"""What a page offers."""
CODE: dict[str, tuple[str, Callable[..., Any]]] = {
    "st": ("controller.st", export.to_structured_text),
    "c": ("controller.c", export.to_c),
    "python": ("controller.py", export.to_python),
    "matlab": ("controller.m", export.to_matlab),
}


def written(name: str, text: str) -> JSON:
    """A file for the page to save."""
    return {"name": name, "content": base64.b64encode(text.encode()).decode()}


def script(state: Mapping[str, Any], known: Mapping[str, Any], system: Any) -> str:
    """Lines of Python that give the same model and controller."""
    used = [row for row in state["records"] if row["used"]]
    if not used:
        return "import ctrl_realize as cr\n"
    names = ["record"] if len(used) == 1 else [f"record_{k + 1}" for k in range(len(used))]
    body = [text for row, name in zip(used, names, strict=True) for text in python_lines(row, name)]
    given = names[0] if len(names) == 1 else f"[{', '.join(names)}]"
    structure = state["model"]["structure"]
    if known:
        body.append(
            f"known = cr.identification.ProcessStructure({known['name']!r}, "
            f"fixed={dict(known['fixed'])!r})"
        )
        body.append(f"system = cr.identify({given}, structures=known)")
    elif structure is not None:
        body.append(f"system = cr.identify({given}, structures=[{tuple(structure)!r}])")
    else:
        body.append(f"system = cr.identify({given})")
    body.append("print(system.fit.report())")
    if system is not None:
        body += controller_lines(state["loop"], system)
    imports = ["import numpy as np"] * any("np." in text for text in body)
    lines = [*imports, "import ctrl_realize as cr", "", *body]
    return "\n".join(lines) + "\n"


def controller_lines(settings: Mapping[str, Any], system: DelayedStateSpace) -> list[str]:
    """Lines that tune the controller and print what to enter."""
    options = loops.rule_options(settings, loops.middle_time(system))
    rule, kind = options.pop("rule"), options.pop("kind")
    words = "".join(f", {key}={value!r}" for key, value in options.items())
    ranges = "".join(f", {k}={v!r}" for k, v in loops.form_ranges(settings).items())
    return [
        "",
        f"pid = cr.design.pid(system, {rule!r}, {kind!r}{words})",
        f"print(pid.as_form({settings['form']!r}{ranges}).report())",
    ]


def report(system: DelayedStateSpace, frf: Any, lines: str) -> str:
    """HTML of the report of a model."""
    if system.fit is None or not system.fit.records:
        raise DataError("the model has no record to report on")
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "report.html"
        calls = [("In Python", lines)]
        write_identification(path, system, system.fit.records[0], frf=frf, calls=calls)
        return path.read_text(encoding="utf-8")


def model_or_code(
    what: str, system: DelayedStateSpace, controller: Callable[[], Any], settings: Mapping[str, Any]
) -> JSON:
    """A model file, or the controller as code with its limits."""
    if what == "model":
        return written("model.json", model_to_text(system))
    if what not in CODE:
        raise OptionError(f"what={what!r}; expected work, script, report, model, {', '.join(CODE)}")
    name, export_to = CODE[what]
    limits = settings["limits"]
    given = {} if limits is None else {"output_limits": tuple(limits)}
    algorithm = controller().algorithm(**given)
    with tempfile.TemporaryDirectory() as folder:
        path = export_to(algorithm, Path(folder) / name)
        text = path.read_text(encoding="utf-8")
        header = path.with_suffix(".h")
        if header.exists():
            text = f"/* {header.name} */\n{header.read_text(encoding='utf-8')}\n{text}"
    return written(name, text)


def figures(system: DelayedStateSpace, frf: Any) -> list[JSON]:
    """The figures of a report about residuals, frequency response and plausible models."""
    record = system.fit.records[0] if system.fit is not None and system.fit.records else None
    sketches = []
    if record is not None and not record.n_missing:  # correlations need every sample
        check = analyse_residuals(system, record)
        sketches.append(sketch("residuals", plots.residual_plot, check, size=(6.2, 5.4)))
    models = loops.plausible(system)
    if models is not None:
        sketches.append(sketch("plausible", plots.plausible_plot, models, size=(6.2, 6.4)))
    sketches += frf_sketches([system], frf)
    pages = [one.on_page() for one in sketches]
    return [
        {"key": one.key, "title": one.title, "caption": one.caption, "svg": str(one.svg)}
        for one in pages
    ]


def planned(system: DelayedStateSpace, wanted: Mapping[str, Any]) -> ExperimentPlan:
    """Plan the next test."""
    return plan_test(system, **wanted)


def plan_view(plan: ExperimentPlan, system: DelayedStateSpace) -> JSON:
    """The planned input, and the interval that its record will give."""
    factor, across = time_axis(float(plan.time[-1]))
    command = panel(
        "plan", f"Next test: {plan.kind}", across, axis("input"),
        [line(factor * plan.time, plan.command, "input", "command")], short=True,
    )  # fmt: skip
    seen: JSON = {"panels": [command], "rows": plan._rows()}
    fit = fit_of_lags(system)
    if plan.want == "dead_time" and fit is not None:
        half = Z_95 * plan.chosen.together
        low, high = max(fit.dead_time - half, 0.0), fit.dead_time + half
        seen["interval"] = {
            "low": low, "high": high,
            "text": f"predicted after this test: ± {in_time(half)}",
        }  # fmt: skip
    return seen


def plan_file(plan: ExperimentPlan) -> JSON:
    """The command as CSV."""
    with tempfile.TemporaryDirectory() as folder:
        path = plan.to_csv(Path(folder) / "test.csv")
        return written(path.name, path.read_text(encoding="utf-8"))
