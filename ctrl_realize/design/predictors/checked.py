"""Controllers with a delay line that were checked on the plant that they were designed for."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Self

from ..._shown import Card
from ...data.shown_units import in_shown_units
from ...delayed import DelayedStateSpace
from ..delay_line import DelayLineController
from ..loops.delay_robustness_result import DelayRobustness
from ..loops.loop_check import LoopCheck, verified


class CheckedController(DelayLineController):
    """Controller with a delay line, its plant model and the check of their closed loop.

    Attributes
    ----------
    model : DelayedStateSpace
        Plant model that the controller was designed for.
    check : LoopCheck or None
        Check of the closed loop with `model`.
    """

    model: DelayedStateSpace
    check: LoopCheck | None = None

    def __init__(self, *arguments: Any, design: Mapping[str, Any], **settings: Any) -> None:
        # `design` has the attributes of the subclass, which a copy needs as well
        self._design = design
        self.__dict__.update(design)
        super().__init__(*arguments, **settings)

    def verified(self, what: str, to_stabilize: str, more_robust: str) -> Self:
        """Return the controller with the check of its loop; unstable loops are refused."""
        check = verified(self.model, self, what, to_stabilize, more_robust)
        make, arguments, settings = self._made_by()
        made: Self = make(*arguments, **settings | {"design": {**self._design, "check": check}})
        return made

    @property
    def time_unit(self) -> str:
        """Unit in which cards write times, that of the model."""
        return self.model.time_unit

    @property
    def robustness(self) -> DelayRobustness | None:
        """Loop at the ends of the identified interval of the dead time; None without one."""
        return None if self.check is None else self.check.robustness

    def _made_by(self) -> tuple[Any, ...]:
        make, arguments, settings = super()._made_by()
        return make, arguments, settings | {"design": self._design}

    @in_shown_units
    def _card(self) -> Card:
        card = super()._card()
        if self.check is None:
            return card
        rows = [*card.rows, *self.check._rows()]
        return Card(card.title, rows, flags=[str(flag) for flag in self.check.flags])
