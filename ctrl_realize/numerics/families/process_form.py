"""Process models of a prescribed form, with fixed and bounded parameters.

The parameters are those of [1]_, as in MATLAB's `procest`.

References
----------
.. [1] D. E. Seborg, T. F. Edgar, D. A. Mellichamp and F. J. Doyle, Process Dynamics and Control,
   3rd ed., Wiley 2011, chapters 5 (first- and second-order processes) and 6 (zeros, dead time).
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

from ..engine.problem import Structure
from ..engine.static_gain import INTEGRATOR
from ..engine.structures import Candidate


@dataclass(frozen=True)
class ProcessForm:
    """Form of a process model: number of real lags, a pair, a lead, an integrator, a dead time.

    `fixed`, `bounds` and `start` are by the names of `ProcessParameter`; times are in s. The lags
    of an `equal` form have one time constant, as tanks in series.
    """

    name: str
    lags: int
    pair: bool = False
    lead: bool = False
    integrator: bool = False
    dead_time: bool = True
    fixed: Mapping[str, float] = field(default_factory=dict)
    bounds: Mapping[str, tuple[float, float]] = field(default_factory=dict)
    start: Mapping[str, float] = field(default_factory=dict)
    equal: bool = False

    @property
    def structure(self) -> Structure:
        """Order and relative degree."""
        order = self.lags + 2 * self.pair + self.integrator
        return Structure(order, order - self.lead)

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the parameters."""
        lags = tuple(f"lag_{i}" for i in range(1, 2 if self.equal else self.lags + 1))
        pair = ("pair_time_1", "pair_damping_1") if self.pair else ()
        return ("gain", "dead_time", *lags, *pair, *(("lead_1",) if self.lead else ()))

    @property
    def dead_time_ends(self) -> tuple[float, float]:
        """Range of the dead time in s."""
        at = self.fixed.get("dead_time", None if self.dead_time else 0.0)
        return self.bounds.get("dead_time", (0.0, np.inf)) if at is None else (at, at)

    @property
    def free_lags(self) -> tuple[str, ...]:
        """Lags that are neither fixed nor bounded, and are told apart by their order alone."""
        given = {*self.fixed, *self.bounds}
        return tuple(name for name in self.names if name.startswith("lag_") and name not in given)

    @property
    def prescribed(self) -> bool:
        """Whether parameters are fixed or bounded, or a start is given."""
        return bool(self.fixed or self.bounds or self.start)

    def admits(self, candidate: Candidate, length: float) -> bool:
        """Whether a model of the structure has the form, without an integrator.

        With one, the pole that stands for it is prescribed: the gain is known less closely if that
        is estimated as well.
        """
        poles = candidate.poles
        slow = np.abs(poles) * length < INTEGRATOR
        complex_pairs = np.count_nonzero(poles.imag > 0)
        return (
            not (self.prescribed or self.integrator)
            and self.dead_time
            and not slow.any()
            and complex_pairs == int(self.pair)
        )
