"""What leaves a session: lines of Python, report, model, numbers, code, the plan of a test."""

from __future__ import annotations

import base64
import tempfile
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

from .. import export, plots
from .._checks import one_of
from .._parameters import SECONDS
from .._wording import in_time
from ..delayed import DelayedStateSpace
from ..design import PIDController
from ..design.tuning.layouts import LAYOUTS
from ..design.tuning.pid import RULES
from ..design.tuning.rules import kinds_of
from ..experiment import ExperimentPlan
from ..identification import OutputErrorFit
from ..numerics.constants import Z_95
from ..report import write_identification
from ..report.sketches import fit_sketches, frf_sketches, sketch
from ..validation import analyse_residuals
from . import loops
from .drawing import JSON, axis, line, panel, time_axis
from .models import fit_of_lags
from .records import python_lines
from .state import FACTS

CHOICES: JSON = {
    "rules": {rule: list(kinds_of(rule)) for rule in RULES}, "speeds": list(loops.SPEEDS),
    "forms": {name: layout.title for name, layout in LAYOUTS.items()},
    "time_units": list(SECONDS), "want": FACTS["want"],
}  # fmt: skip
"""What a page offers."""
CODE: dict[str, tuple[str, Callable[..., Any]]] = {
    "st": ("controller.st", export.to_structured_text), "c": ("controller.c", export.to_c),
    "python": ("controller.py", export.to_python), "matlab": ("controller.m", export.to_matlab),
}  # fmt: skip


def written(name: str, text: str) -> JSON:
    """A file for the page to save."""
    return {"name": name, "content": base64.b64encode(text.encode()).decode()}


def script(state: Mapping[str, Any], known: Mapping[str, Any], tuned: Sequence[str]) -> str:
    """Lines of Python that give the same model and controller."""
    used = [row for row in state["records"] if row["used"]]
    names = ["record"] if len(used) == 1 else [f"record_{k + 1}" for k in range(len(used))]
    body = [text for row, name in zip(used, names, strict=True) for text in python_lines(row, name)]
    given = names[0] if len(names) == 1 else f"[{', '.join(names)}]"
    structure = state["model"]["structure"]
    if known:
        prescribed = f"{known['name']!r}, fixed={dict(known['fixed'])!r}"
        body.append(f"known = cr.identification.ProcessStructure({prescribed})")
        given += ", structures=known"
    elif structure is not None:
        given += f", structures=[{tuple(structure)!r}]"
    if used:
        body += [f"system = cr.identify({given})", "print(system.fit.report())", *tuned]
    imports = ["import numpy as np"] * any("np." in text for text in body)
    return "\n".join([*imports, "import ctrl_realize as cr", "", *body]) + "\n"


def controller_lines(settings: Mapping[str, Any], system: DelayedStateSpace) -> list[str]:
    """Lines that tune the controller and print what to enter."""
    options = loops.rule_options(settings, system)
    words = "".join(f", {key}={value!r}" for key, value in options.items())
    ranges = "".join(f", {k}={v!r}" for k, v in loops.form_ranges(settings).items())
    told = f"print(pid.as_form({settings['form']!r}{ranges}).report())"
    return ["", f"pid = cr.design.pid(system{words})", told]


def report(
    system: DelayedStateSpace, frf: Any, lines: str, controller: PIDController,
    settings: Mapping[str, Any],
) -> str:  # fmt: skip
    """HTML of the report of a model and its controller."""
    assert system.fit is not None
    form = controller.as_form(settings["form"], **loops.form_ranges(settings))
    with tempfile.TemporaryDirectory() as folder:
        path, record = Path(folder) / "report.html", system.fit.records[0]
        write_identification(
            path, system, record, frf=frf, calls=[("In Python", lines)], controller=controller,
            form=form,
        )  # fmt: skip
        return path.read_text(encoding="utf-8")


def code(what: str, controller: PIDController, limits: Sequence[float] | None) -> JSON:
    """The controller as code, with its limits."""
    name, export_to = CODE[one_of(what, "what", tuple(CODE))]
    given: JSON = {} if limits is None else {"output_limits": tuple(limits)}
    with tempfile.TemporaryDirectory() as folder:
        path = export_to(controller.algorithm(**given), Path(folder) / name)
        parts = [one for one in (path.with_suffix(".h"), path) if one.exists()]
        return written(name, "\n".join(one.read_text(encoding="utf-8") for one in parts))


def figures(system: DelayedStateSpace, frf: Any) -> list[JSON]:
    """The figures of a report about residuals, frequency response and plausible models."""
    fit = system.fit
    assert fit is not None
    record, sketches = fit.records[0], []
    if not isinstance(fit, OutputErrorFit):
        sketches += fit_sketches(system, None)
    elif not record.n_missing:  # correlations need every sample
        check = analyse_residuals(system, record)
        sketches.append(sketch("residuals", plots.residual_plot, check, size=(6.2, 5.4)))
    if (models := fit.plausible_models) is not None:
        sketches.append(sketch("plausible", plots.plausible_plot, models, size=(6.2, 6.4)))
    sketches += frf_sketches([system], frf)
    shown = ("key", "title", "caption", "svg")
    return [{name: str(getattr(one, name)) for name in shown} for one in sketches]


def plan_view(plan: ExperimentPlan, system: DelayedStateSpace) -> JSON:
    """The planned input, and the interval that its record will give."""
    factor, across = time_axis(plan.time)
    drawn = [line(factor * plan.time, plan.command, "input", "command")]
    command = panel("plan", f"Next test: {plan.kind}", across, axis("input"), drawn, short=True)
    seen: JSON = {"panels": [command], "rows": plan._rows(), "interval": None}
    fit = fit_of_lags(system)
    if plan.want == "dead_time" and fit is not None:
        half, at = Z_95 * plan.chosen.together, fit.dead_time
        text = f"predicted after this test: ± {in_time(half)}"
        seen["interval"] = {"low": max(at - half, 0.0), "high": at + half, "text": text}
    return seen


def plan_file(plan: ExperimentPlan) -> str:
    """The command as CSV."""
    with tempfile.TemporaryDirectory() as folder:
        return plan.to_csv(Path(folder) / "test.csv").read_text(encoding="utf-8")
