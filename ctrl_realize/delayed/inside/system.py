r"""Systems with internal delays: in feedback loops, between parts, in one of several paths.

The model is a delay-free core, some of whose outputs are fed back to its inputs through pure
delays. Like a `DelayedStateSpace` it is a `control.StateSpace`, and it is the result of loops and
sums of those.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Any, Self

import control as ct
import numpy as np

from ..._checks import real
from ...numerics.arrays import Matrices
from ...numerics.internal_delays.form import DelayForm, through, without_zero_delays
from ...numerics.internal_delays.merging import ends_apart
from ..chains import past_of
from ..operands import plain, time_base
from ..operators import INSIDE, DelayOperators, solvable
from ..parts import (
    matrices_of,
    named,
    parts_of,
    selected,
    signal_names,
    signals_of,
    stand_in,
    with_core,
)
from .cards import InsideCards
from .checks import check_core, check_delays, not_rational
from .conversions import InsideConversions
from .responses import InsideResponses


class DelaySystem(InsideResponses, InsideConversions, InsideCards, DelayOperators, kind=INSIDE):
    """Linear system with internal dead times, exact: loops, sums and series of delayed systems.

    A delay-free core whose last q outputs are fed back to its last q inputs through pure delays. It
    is a `control.StateSpace`, for all functions of python-control that use frequency responses
    (Bode, Nyquist, Nichols, margins); interconnections of such systems are of this class again, as
    are loops around a `DelayedStateSpace`.

    Parameters
    ----------
    core : control.StateSpace
        With p + q outputs and m + q inputs; continuous, or discrete with a known sample time. A
        gain without delays may have the ``dt`` None, and adopts that of the other system.
    internal_delays : float or sequence of float, optional
        The q delays: whole samples for a discrete core, s for a continuous one. Those of 0 are
        closed at once.
    name, inputs, outputs : optional
        Names of the system, of its m inputs and of its p outputs, as for `control.ss`.
    time_unit : {"s", "ms", "min", "h", "day"}, optional
        In which plots and cards write times.

    Attributes
    ----------
    core : control.StateSpace
    internal_delays : tuple of float
        In samples (discrete time) or s (continuous time).

    Raises
    ------
    UnsuitableSystemError
        A core that is not a state-space system, discrete without a sample time, or with fewer
        signals than delays, or with delays of 0 that close an algebraic loop; also on access to the
        matrices of a continuous system.
    DelayRangeError
        Negative delays, or delays of a discrete core that are not whole samples.

    Notes
    -----
    With ``w_i(t) = z_i(t - tau_i)`` between the last outputs z and inputs w of the core, this is
    the linear fractional form of [1]_, called internal delays there.

    The matrices A, B, C, D of a discrete system are computed on demand, up to 20 000 states, with
    the delays as shift registers after the states of the core. ``sys(z)``, plots of frequency
    responses, ``sys.step_response``, ``sys.forced_response``, ``sys.dominant_poles`` and all
    interconnections do not need them.

    In continuous time there are no such matrices, and access to them raises an error.

    In ``K * sys`` with a transfer function K, and in ``ct.feedback(K, sys)`` and ``ct.append(K,
    sys)`` also with a plain system or a number, python-control uses the matrices: use ``sys * K``,
    ``cr.DelaySystem(ct.ss(K))`` instead of K, or `interconnect`. So do ``ct.step_response(sys)``
    and ``ct.step_info(sys)``; the methods of the same names do not. Warnings, in continuous time
    errors, name the alternative.

    References
    ----------
    .. [1] P. Gahinet and L. F. Shampine, Software for modeling and analysis of linear systems with
       delays, Proc. American Control Conf. 2004, 5600-5605, section 2,
       doi:10.23919/ACC.2004.1384746.

    Examples
    --------
    >>> import control as ct
    >>> import ctrl_realize as cr
    >>> plant = cr.delayed_ss(ct.tf([1], [0.08, 1]), dead_time=0.3, dt=0.001)
    >>> loop = ct.feedback(plant * 0.5)
    >>> loop
    <DelaySystem: u -> y, order 1, internal delay 300 samples, dt = 0.001 s>
    >>> print(round(loop.dcgain(), 6), loop.is_stable())
    0.333333 True
    """

    def __init__(
        self,
        core: ct.StateSpace,
        internal_delays: float | Sequence[float] = (),
        *,
        name: str | None = None,
        inputs: str | Sequence[str] | None = None,
        outputs: str | Sequence[str] | None = None,
        time_unit: str = "s",
    ) -> None:
        given = internal_delays if isinstance(internal_delays, Iterable) else (internal_delays,)
        delays = tuple(real(d, "internal_delays", "delays >= 0") for d in given)
        dt = check_core(core, delays)
        check_delays(delays, core, dt)
        if dt:
            delays = tuple(int(d) for d in delays)
        q = len(delays)
        input_names = signal_names(inputs, core.input_labels[: core.ninputs - q], "u")
        output_names = signal_names(outputs, core.output_labels[: core.noutputs - q], "y")
        if 0 in delays:
            with solvable("its delays of 0 s"):
                form = without_zero_delays(DelayForm(*matrices_of(core), delays))
            core, delays = plain(form, dt, core.state_labels), form.delays
            q = len(delays)
        states = core.nstates + (int(sum(delays)) if dt else 0)
        names = {"inputs": input_names, "outputs": output_names, "name": name}
        self._begin(core.nstates, states, dt, time_unit=time_unit, **names)
        into = [*input_names, *(f"w[{i}]" for i in range(q))]
        out = [*output_names, *(f"z[{i}]" for i in range(q))]
        self._core = named(core, into, out, core.state_labels, name=f"{self.name}_core")
        self.internal_delays = delays
        self._locked = True

    @property
    def core(self) -> ct.StateSpace:
        """The delay-free core, with the delays' inputs and outputs after the others."""
        return self._core

    def _form(self) -> DelayForm:
        return DelayForm(*matrices_of(self._core), self.internal_delays)

    def delay_apart(self) -> tuple[DelaySystem, float]:
        """Split a system with one input and one output into its core and the dead time before it.

        Returns
        -------
        rest : DelaySystem
            Without delays if all of them are before or behind it.
        delay : float
            In samples, or s in continuous time.
        """
        before, behind, rest = ends_apart(self._form())
        names = {**signals_of(self), "time_unit": self.time_unit}
        made = DelaySystem(plain(rest, self.dt), rest.delays, **names)
        return made, before[0] + behind[0]

    def _make_matrices(self) -> Matrices:
        if not self.dt and self.internal_delays:
            raise not_rational("A, B, C, D")
        return super()._make_matrices()

    def _name_states(self) -> list[str]:
        delays = self.internal_delays if self.dt else ()
        ends = [f"z[{i}]" for i in range(len(delays))]
        return [*self._core.state_labels, *past_of(ends, delays)]

    def _without_matrices(self) -> str:
        return (
            "sys(z), sys.step_response, sys.forced_response and sys.dominant_poles need no "
            "matrices; a longer sample time has fewer states"
        )

    def _isstatic(self) -> bool:
        return self._core.nstates == 0 and not self.internal_delays

    def __getitem__(self, key: Any) -> Self:
        """Select channels, by number or name."""
        chosen = selected(stand_in(self), key)
        left = np.eye(self.noutputs)[[self.output_index[name] for name in chosen.output_labels]]
        right = np.eye(self.ninputs)[:, [self.input_index[name] for name in chosen.input_labels]]
        form = through(self._form(), left, right)
        base = {"name": f"{self.name}$indexed", **time_base(self)}
        made: Self = self._joined(form, chosen.input_labels, chosen.output_labels, **base)
        return made

    def minreal(self, tol: float = 0.0) -> Any:
        """Return the system itself: its structure already has the fewest delays."""
        return self._joined(self._form(), self.input_labels, self.output_labels, **time_base(self))

    def _made_by(self) -> tuple[Any, ...]:
        names = {"name": self.name, **signals_of(self), "time_unit": self.time_unit}
        settings = {"internal_delays": self.internal_delays, **names}
        return with_core, (type(self), *parts_of(self._core)), settings
