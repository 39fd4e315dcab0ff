"""``ctrl-realize tune``, and ``identify --tune``: a PID controller for the identified model."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from ..delayed import DelayedStateSpace
from ..design import pid
from ..design.tuning.entered import Scaling
from ..design.tuning.pid import TuningOptions
from ..report.controller import unsafe_if
from .inputs import python_keywords
from .terminal import complain, say


@dataclass(frozen=True)
class Tuning:
    """How to tune, and how the numbers are entered: arguments of `design.pid` and `as_form`.

    If it is `optional`, a model without a controller is a result, too.
    """

    tuned: Mapping[str, Any]
    entered: Mapping[str, Any]
    optional: bool = False

    def __post_init__(self) -> None:
        """Check names and ranges before a model is identified."""
        ranges = {name: self.entered.get(name) for name in ("measured_range", "output_range")}
        Scaling(**ranges).of(self.entered.get("form", "ideal"))
        TuningOptions(**self.asked)

    @property
    def asked(self) -> dict[str, Any]:
        """Arguments of `design.pid`: without a rule, robust on all models that the data allow."""
        own = "rule" in self.tuned or "closed_loop_time" in self.tuned
        return {**({} if own else {"closed_loop_time": "robust"}), **self.tuned}

    def of(self, system: DelayedStateSpace) -> dict[str, Any]:
        """Tune, say what to enter, and return controller and form for the report."""
        controller = pid(system, **self.asked)
        form = controller.as_form(**self.entered)
        say(f"\n{controller.report()}\n\n{form.report()}\n\nIt would be unstable if")
        for reason in unsafe_if(system, controller):
            say(f"  - {reason}")
        if (kind := self.tuned.get("kind", controller.kind)) != controller.kind:
            complain(
                f"warning: --kind {kind} gave a {controller.kind}: the rule has a derivative for a "
                "second lag only, and this model has none; --rule amigo has one for any model"
            )
        for one in () if system.fit is None else system.fit.verdicts:
            if one.question == "tuning" and one.level != "good":
                complain(f"warning: verdict on {one}")
        return {"controller": controller, "form": form}

    def in_python(self) -> str:
        """The same as lines of Python."""
        entered = python_keywords(self.entered).removeprefix(", ")
        return (
            f"pid = cr.design.pid(sys{python_keywords(self.asked)})\n"
            f"print(pid, pid.as_form({entered}).report())"
        )
