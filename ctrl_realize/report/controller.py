"""The controller in a report: what to enter, its loop, and what would make it unsafe."""

from __future__ import annotations

import numpy as np

from .. import plots
from .._checks import check_type
from .._wording import in_time, times_in
from ..data.shown_units import in_shown_units
from ..delayed import DelayedStateSpace
from ..design.tuning.controller import PIDController
from ..design.tuning.forms import PIDForm
from ..errors import UnsuitableSystemError
from ..plots.delays import estimate_of
from .page import Column, Controller, Row, Table
from .sketches import Sketch, sketch
from .verdict import Level


@in_shown_units
def unsafe_if(system: DelayedStateSpace, pid: PIDController) -> tuple[str, ...]:
    r"""List what would make a loop unstable, and what does on models that the data do not rule out.

    Parameters
    ----------
    system : DelayedStateSpace
        Model that the controller was tuned for.
    pid : PIDController
        From `design.pid`, with its `check`.

    Examples
    --------
    >>> import ctrl_realize as cr
    >>> from ctrl_realize.report.controller import unsafe_if
    >>> plant = cr.design.ProcessModel(gain=1.0, lag=0.08, dead_time=0.029).system(0.001)
    >>> print(*unsafe_if(plant, cr.design.pid(plant)), sep="\n")
    the gain of the plant, or of the controller, is 3.1 times as large
    63.2 ms of delay come in addition to the 29 ms of the model: a longer dead time, a filter, a
    slower cycle than 1 ms
    """
    check = pid.check
    if check is None:
        return ()
    told = []
    found = check.margins
    if np.isfinite(found.gain_margin):
        word = "as large" if found.gain_margin > 1 else "what it is"
        told.append(
            f"the gain of the plant, or of the controller, is {found.gain_margin:.2g} times {word}"
        )
    if np.isfinite(found.delay_margin):
        others = "longer dead time, a filter"
        if system.dt:
            with times_in("s"):  # as cycle times are set
                others += f", a slower cycle than {in_time(float(system.dt), 4)}"
        told.append(
            f"{in_time(found.delay_margin)} of delay come in addition to the "
            f"{in_time(estimate_of(system))} of the model: a {others}"
        )
    unstable = sum(not np.isfinite(corner.ms) for corner in check.corners)
    if unstable:
        told.append(
            f"the plant is one of {unstable} of {len(check.corners)} models that fit the record "
            "as well: their loops are unstable"
        )
    return tuple(told)


def controller_of(
    system: DelayedStateSpace, pid: PIDController | None, form: PIDForm | None = None
) -> Controller | None:
    """Make the part of a report about a controller, if there is one.

    Parameters
    ----------
    system : DelayedStateSpace
    pid : PIDController or None
        Tuned for `system`.
    form : PIDForm, optional
        Its parameters as they are entered; default: the ideal form.
    """
    if pid is None:
        return None
    check_type(pid, PIDController, "controller", "that of design.pid", UnsuitableSystemError)
    written = pid.as_form() if form is None else form
    rows = [Row((name, value)) for name, value in written._rows()]
    entered = Table(
        written.title, tuple(rows), (Column("enter"), Column("value", "number")),
        note="; ".join([*written.notes, *written.choices]),
    )  # fmt: skip
    left_out = {"type", "rule", "sample time", "next"}
    told = tuple(row for row in pid._card().rows if row[0] not in left_out)
    unstable = pid.check is not None and any(np.isinf(one.ms) for one in pid.check.corners)
    flags = () if pid.check is None else pid.check.flags
    doubted = any(_doubts(system)) or any(flags)
    level: Level = "poor" if unstable else "caution" if doubted else "good"
    return Controller(
        title=f"{pid.kind} controller by {pid.rule}",
        level=level,
        judgement=_judgement(system, pid),
        entered=entered,
        facts=told,
        unsafe=unsafe_if(system, pid),
        figure=loop_sketch(system, pid),
    )


def _judgement(system: DelayedStateSpace, pid: PIDController) -> str:
    """How robust the loop is, on the model and on all that the record leaves open."""
    check = pid.check
    if check is None:
        return "Not checked with a model."
    said = f"Ms {check.margins.ms:.3g} on the model"
    if check.worst is not None and np.isfinite(check.worst.ms):
        said += f", at most {check.worst.ms:.3g} with what the record leaves open"
    words = [f"{said}.", *[f"{flag}." for flag in check.flags], *_doubts(system)]
    return " ".join(f"{one[:1].upper()}{one[1:]}" for one in words)


def _doubts(system: DelayedStateSpace) -> list[str]:
    """What the verdict of the fit says against tuning."""
    verdicts = () if system.fit is None else system.fit.verdicts
    return [f"{one}." for one in verdicts if one.question == "tuning" and one.level != "good"]


def loop_sketch(system: DelayedStateSpace, pid: PIDController) -> Sketch:
    """Draw the closed loop with the output of the controller, on all plausible models."""
    models = None if system.fit is None else system.fit.plausible_models
    plants = () if models is None else models.systems
    key = "closed_loop" if plants else "closed_loop.alone"
    return sketch(
        key, plots.closed_loop_plot, system, {"model": pid}, plants=plants, size=(7.6, 6.0)
    )
