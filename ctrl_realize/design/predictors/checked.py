"""Controllers with a delay line that were checked on the plant that they were designed for."""

from __future__ import annotations

from typing import Any

from ..._shown import Card
from ...delayed import DelayedStateSpace
from ..delay_line import DelayLineController
from ..loops.delay_robustness_result import DelayRobustness
from ..loops.loop_check import LoopCheck


class CheckedController(DelayLineController):
    """Controller with a delay line, its plant model and the check of their closed loop.

    Attributes
    ----------
    model : DelayedStateSpace
        Plant model that the controller was designed for.
    check : LoopCheck or None
        Check of the closed loop with `model`.
    """

    def __init__(
        self,
        *arguments: Any,
        model: DelayedStateSpace,
        check: LoopCheck | None = None,
        **settings: Any,
    ) -> None:
        self.model = model
        self.check = check
        super().__init__(*arguments, **settings)

    @property
    def robustness(self) -> DelayRobustness | None:
        """Loop at the ends of the identified interval of the dead time; None without one."""
        return None if self.check is None else self.check.robustness

    def _design(self) -> dict[str, Any]:
        return {"model": self.model, "check": self.check}

    def _card(self) -> Card:
        card = super()._card()
        if self.check is None:
            return card
        rows = [*card.rows, *self.check.rows()]
        return Card(card.title, rows, flags=[str(flag) for flag in self.check.flags])
