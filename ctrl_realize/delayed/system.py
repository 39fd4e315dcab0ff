r"""State-space systems with dead time: z^-d and a delay-free core.

This folder is the only place that depends on the internals of python-control. A `DelayedStateSpace`
is a `control.StateSpace` whose matrices contain the delay as a shift register at the input, so that
every function of python-control accepts it. Where the matrices would be slow or inexact (frequency
response, poles, zeros, products) the methods use core and delay instead.

The shift register is attached last and never mixed with the core's states: a dense similarity
transformation would move its d poles at 0 to |z| = eps^(1/d), 0.37 for d = 37.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, TypeVar

import control as ct

from .._shown import shown_alike
from ..errors import DelayRangeError, OptionError, UnsuitableSystemError
from ..results import Drawable, ModelFit
from .algebra import DelayedAlgebra
from .analysis import DelayedAnalysis
from .cards import DelayedCards
from .chains import parse_delays
from .operators import ENDS
from .parts import MAX_DELAY, check_core, named, parts_of, signal_names, signals_of, with_core
from .responses import DelayedResponses

AnyFit = TypeVar("AnyFit", bound=ModelFit)


class DelayedStateSpace(
    DelayedAnalysis, DelayedResponses, DelayedAlgebra, DelayedCards, Drawable, kind=ENDS
):
    """Discrete state-space system with dead time: core(z) z^-d.

    A `control.StateSpace` with the states ``[core; u[k-1] ... u[k-d]]``, for every function of
    python-control. Negation, products with numbers, matrices and systems, powers, indexing,
    copying, pickling and renaming keep the delay; sums, feedback and append give a `DelaySystem`
    with internal delays. ``ct.ss(sys)`` converts to a plain system.

    Matrices are read-only, so that they remain consistent with core and delay.

    Parameters
    ----------
    core : control.StateSpace
        Discrete system without the delay, with a sample time.
    delay : int or sequence of int
        Whole samples, the same for all inputs or one for each.
    output_delay : int or sequence of int, optional
        Whole samples at the outputs, the same for all or one for each.
    fit : ModelFit, optional
        How the model was found: the result of an estimator.
    name, inputs, outputs : optional
        Names, as for `control.ss`. Default for signals: those of `core`, or ``u`` and ``y``. A dot,
        which python-control reserves for ``system.signal``, becomes an underscore: ``FIC101.OP`` of
        a record is ``FIC101_OP`` of its model.
    time_unit : {"s", "ms", "min", "h", "day"}, optional
        In which plots and cards write times; default: that of the fit. Products, sums, loops and
        channels keep it.

    Attributes
    ----------
    delay : int, or ndarray of int with shape (outputs, inputs) where channels differ
        Dead time in samples.
    dead_time : float, or ndarray
        ``delay * dt`` in s.
    delay_free : control.StateSpace
        The core.
    input_delays, output_delays : tuple of int
    fit : ModelFit or None

    Raises
    ------
    UnsuitableSystemError
        A core that is not a discrete state-space system with a sample time.
    OptionError
        A `fit` of the wrong type.
    DelayRangeError
        Delays that are negative, not whole numbers, not one for each signal, or more than ten
        million samples; or matrices of more than 20 000 states.

    Notes
    -----
    ``sys(z) == sys.delay_free(z) * z**-sys.delay`` to rounding, whatever the delay.

    Up to 20 000 states, the matrices A, B, C, D are computed on demand (A is dense: 3 GB). For
    longer delays, everything that needs no matrices still works: ``sys(z)`` and plots of frequency
    responses, `step`, `simulate`, `markov`, poles and products.
    ``cr.design.to_discrete(cr.design.to_continuous(sys), dt=dt)`` samples such a system slower.

    ``tf * sys``, ``tf + sys``, ``ct.feedback(tf, sys)`` and ``ct.tf(sys)`` are evaluated by
    python-control alone: it converts the augmented matrices to a transfer function, which has no
    correct digits from about d = 50 on. Beyond 20 samples a `ModelWarning` is given. Use
    ``sys * tf``, ``sys + tf``, ``ct.feedback(cr.DelaySystem(ct.ss(tf)), sys)`` and ``sys.to_tf()``
    instead. With a plain system or a number first, ``ct.feedback``, ``ct.append`` and
    ``ct.interconnect`` give a plain system with all states: use `DelaySystem` around it, too, and
    `interconnect`. ``ct.step_response(sys)`` multiplies by the matrices at every sample;
    ``sys.step_response()`` does not. A `ModelWarning` is given in both cases.
    ``ct.margin(sys)`` uses the exact response: a system of one input and one output unpacks as
    magnitude, phase and omega.

    ``repr(sys)`` is one line. A `repr_format` set on the system, or a setting other than "eval" in
    ``ct.config.defaults["iosys.repr_format"]``, is respected; "eval" gives core and delay as a
    call.

    Examples
    --------
    >>> import control as ct
    >>> import ctrl_realize as cr
    >>> core = ct.ss([[0.9]], [[1.0]], [[0.1]], [[0.0]], 0.01)
    >>> valve = cr.DelayedStateSpace(core, 37, name="valve")
    >>> valve.nstates, valve.delay, valve.dead_time
    (38, 37, 0.37)
    >>> valve * 2
    <DelayedStateSpace: u -> y, order 1, z^-37 (0.37 s), dt = 0.01 s>
    """

    def __init__(
        self,
        core: ct.StateSpace,
        delay: int | Sequence[int] = 0,
        *,
        output_delay: int | Sequence[int] = 0,
        fit: ModelFit | None = None,
        name: str | None = None,
        inputs: str | Sequence[str] | None = None,
        outputs: str | Sequence[str] | None = None,
        time_unit: str = "s",
    ) -> None:
        check_core(core)
        before = parse_delays(delay, core.ninputs, "delay", "input")
        behind = parse_delays(output_delay, core.noutputs, "output_delay", "output")
        if isinstance(core, DelayedStateSpace):
            before = tuple(a + b for a, b in zip(before, core.input_delays, strict=True))
            behind = tuple(a + b for a, b in zip(behind, core.output_delays, strict=True))
            time_unit = core.time_unit if time_unit == "s" else time_unit
            core = core.delay_free
        if core.issiso():
            before, behind = (before[0] + behind[0],), (0,)
        if sum(before) + sum(behind) > MAX_DELAY:
            raise DelayRangeError(
                f"the delays are {before + behind} samples; at most {MAX_DELAY} are allowed. "
                "Use a longer sample time, or keep core and delay separate"
            )
        if fit is not None and not isinstance(fit, ModelFit):
            raise OptionError(
                f"fit is a {type(fit).__name__}; expected None or the fit of a model, a ModelFit"
            )
        input_names = signal_names(inputs, core.input_labels, "u")
        output_names = signal_names(outputs, core.output_labels, "y")
        states = core.nstates + sum(before) + sum(behind)
        names = {"name": name, "inputs": input_names, "outputs": output_names}
        self._begin(core.nstates, states, core.dt, time_unit=time_unit, **names)
        self._core = named(core, input_names, output_names, core.state_labels, f"{self.name}_core")
        self.input_delays = before
        self.output_delays = behind
        self.fit: ModelFit | None = fit
        self._locked = True

    def replace(self, **changes: Any) -> DelayedStateSpace:
        """Copy the system with another `delay`, `output_delay`, `fit`, `name` or labels."""
        settings = self._settings()
        unknown = set(changes) - set(settings)
        if unknown:
            raise TypeError(f"replace() takes {', '.join(settings)}; got {', '.join(unknown)}")
        settings.update(changes)
        made = DelayedStateSpace(self.delay_free, settings.pop("delay"), **settings)
        copy: DelayedStateSpace = shown_alike(made, self._state_names, self._repr_format)
        return copy

    def _settings(self) -> dict[str, Any]:
        delays = {"delay": self.input_delays, "output_delay": self.output_delays}
        own = {"fit": self.fit, "name": self.name, "time_unit": self._time_unit}
        return {**delays, **own, **signals_of(self)}

    def _made_by(self) -> tuple[Any, ...]:
        return with_core, (type(self), *parts_of(self.delay_free)), self._settings()


def fit_of(system: DelayedStateSpace, kind: type[AnyFit]) -> AnyFit:
    """Return the fit of a system if it is of a certain type.

    Raises
    ------
    UnsuitableSystemError
        Another type of fit, or none.
    """
    if not isinstance(system.fit, kind):
        raise UnsuitableSystemError(
            f"the fit of {system.name!r} is {system.fit!r}; expected a {kind.__name__}"
        )
    return system.fit
