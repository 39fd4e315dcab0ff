"""Algebra of systems with delays: every interconnection is exact, and is again such a system."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from functools import wraps
from inspect import cleandoc
from typing import Any, ClassVar

import control as ct
import numpy as np

from .._checks import finite
from ..errors import OptionError, UnsuitableSystemError
from ..numerics.internal_delays import form as forms
from ..numerics.internal_delays.form import DelayForm
from ..numerics.internal_delays.merging import ends_apart, merged
from .deferred import DeferredMatrices
from .operands import (
    Numbers,
    check_divisor,
    common_dt,
    core_states,
    everywhere,
    form_of,
    improper_inverse,
    is_linear,
    is_single,
    labels_of,
    plain,
    product,
    shapes,
    time_base,
)
from .parts import signals_of

Call = Callable[..., Any]
ENDS, INSIDE = "ends", "inside"


class DelayOperators(DeferredMatrices):
    """Operators of python-control for core and delays.

    The result of an interconnection belongs to one of two classes, registered by ``kind=``: with
    delays at the ends only, or with internal delays.
    """

    _kinds: ClassVar[dict[str, Any]] = {}

    def __init_subclass__(cls, kind: str | None = None, **settings: Any) -> None:
        super().__init_subclass__(**settings)
        if kind is not None:
            DelayOperators._kinds[kind] = cls

    @classmethod
    def _joined(
        cls,
        form: DelayForm,
        inputs: Sequence[str] | None = None,
        outputs: Sequence[str] | None = None,
        states: Sequence[str] | None = None,
        *,
        dt: float | None,
        **names: Any,
    ) -> Any:
        """Make the system of a form, with the fewest delays; only unique names are kept.

        `states` are names for those of the core, `names` are settings of the system.
        """
        with solvable("its delays of 0 s"):
            form = merged(form)
        labels: dict[str, Any] = dict(names)
        if inputs is not None and len(inputs) == form.inputs == len(set(inputs)):
            labels["inputs"] = list(inputs)
        if outputs is not None and len(outputs) == form.outputs == len(set(outputs)):
            labels["outputs"] = list(outputs)
        if dt:
            before, behind, rest = ends_apart(form)
            if not rest.delays:
                core = plain(rest, dt, states)
                whole = [int(d) for d in before], [int(d) for d in behind]
                return cls._kinds[ENDS](core, whole[0], output_delay=whole[1], **labels)
        return cls._kinds[INSIDE](plain(form, dt, states), form.delays, **labels)

    def _other(self, other: Any) -> DelayForm | None:
        """Form of the other operand; None if it has its own operator, or is not a system."""
        if isinstance(other, (complex, np.complexfloating)):
            raise UnsuitableSystemError(f"got the complex number {other}; expected a real gain")
        return form_of(other) if is_linear(other) else None

    def _scaled(self, factor: float) -> Any:
        form, labels = self._form(), (self.input_labels, self.output_labels)
        scaled = forms.through(form, np.eye(form.outputs), factor * np.eye(form.inputs))
        return self._joined(scaled, *labels, core_states(self, form), **time_base(self))

    def __neg__(self) -> Any:
        return self._scaled(-1.0)

    def __add__(self, other: Any) -> Any:
        """Sum: parallel connection with the same input."""
        theirs, mine = self._other(other), self._form()
        if theirs is None:
            return NotImplemented
        # a system of one input and output is added to every entry, as in python-control
        if is_single(theirs) and not is_single(mine) and not isinstance(other, np.ndarray):
            theirs = everywhere(theirs, mine)
        elif is_single(mine) and not is_single(theirs):
            mine = everywhere(mine, theirs)
        if (mine.outputs, mine.inputs) != (theirs.outputs, theirs.inputs):
            raise OptionError(f"systems {shapes(mine, theirs)} cannot be added")
        total = forms.parallel(mine, theirs)
        return self._joined(total, self.input_labels, self.output_labels, **time_base(self, other))

    def __radd__(self, other: Any) -> Any:
        return self + other

    def __sub__(self, other: Any) -> Any:
        return self + (-other)

    def __rsub__(self, other: Any) -> Any:
        return -self + other

    def __mul__(self, other: Any) -> Any:
        """Series: first `other`, then this system."""
        return self._series(other, behind=False)

    def __rmul__(self, other: Any) -> Any:
        """Series: first this system, then `other`."""
        return self._series(other, behind=True)

    def _series(self, other: Any, *, behind: bool) -> Any:
        theirs = self._other(other)
        if theirs is None:
            return NotImplemented
        if isinstance(other, Numbers):
            return self._scaled(float(other))
        parts = [(theirs, other), (self._form(), self)]
        (first, before), (second, after) = parts[::-1] if behind else parts
        inputs = labels_of(before, "input_labels", self.input_labels)
        outputs = labels_of(after, "output_labels", self.output_labels)
        states = core_states(before, first) + core_states(after, second)
        total = product(second, first)
        return self._joined(total, inputs, outputs, states, **time_base(self, other))

    def __truediv__(self, other: Any) -> Any:
        """Series with the inverse of `other`, if that is proper."""
        if isinstance(other, DelayOperators):
            return self * other**-1
        check_divisor(other)
        return super().__truediv__(other)

    def __pow__(self, power: Any) -> Any:
        """Power; -1 is the inverse, if that is proper."""
        if power != -1 or isinstance(power, bool):
            return super().__pow__(power)
        try:
            form = forms.inverse(self._form())
        except np.linalg.LinAlgError:
            raise UnsuitableSystemError(improper_inverse(self.name)) from None
        return self._joined(form, self.output_labels, self.input_labels, **time_base(self))

    def feedback(self, other: Any = 1, sign: float = -1) -> Any:
        """Close the loop with `other` in the feedback path; see `control.feedback`.

        Raises
        ------
        UnsuitableSystemError
            The feedthroughs of both form an algebraic loop without a solution, or the time bases
            differ.
        """
        if isinstance(other, (list, tuple)):
            other = np.atleast_2d(finite(other, "other"))
        if not is_linear(other) and isinstance(other, ct.NonlinearIOSystem):
            return super().feedback(other, sign)
        if isinstance(other, Numbers) and np.isrealobj(other):
            other = float(other) * np.eye(self.ninputs, self.noutputs)
        forward, back = self._form(), form_of(other)
        if (back.inputs, back.outputs) != (forward.outputs, forward.inputs):
            raise ct.ControlDimension(
                f"feedback around {forward.outputs} outputs and {forward.inputs} inputs by a "
                f"system of {back.outputs} outputs and {back.inputs} inputs"
            )
        with solvable("the direct terms of both"):
            form = forms.feedback(forward, back, float(sign))
        return self._joined(form, self.input_labels, self.output_labels, **time_base(self, other))

    def append(self, other: Any) -> Any:
        """Append `other`; see `control.append`."""
        other_form = form_of(other)
        inputs = [*self.input_labels, *getattr(other, "input_labels", ["u"])]
        outputs = [*self.output_labels, *getattr(other, "output_labels", ["y"])]
        both = forms.append(self._form(), other_form)
        return self._joined(both, inputs, outputs, **time_base(self, other))

    def lft(self, other: Any, nu: int = -1, ny: int = -1) -> Any:
        """Close `other` between the last outputs and inputs; see `control.StateSpace.lft`."""
        upper, lower = self._form(), form_of(other)
        ny = min(lower.inputs, upper.outputs) if ny == -1 else ny
        nu = min(lower.outputs, upper.inputs) if nu == -1 else nu
        both = forms.append(upper, lower)
        gain = np.zeros((both.inputs, both.outputs))
        m, p = upper.inputs, upper.outputs
        gain[np.arange(m - nu, m), p + np.arange(nu)] = 1.0
        gain[m + np.arange(ny), np.arange(p - ny, p)] = 1.0
        rows = [*range(p - ny), *range(p + nu, both.outputs)]
        columns = [*range(m - nu), *range(m + ny, both.inputs)]
        with solvable("the direct terms of both"):
            form = forms.wired(both, gain, rows, columns)
        return self._joined(form, **time_base(self, other))


def left_to_the_other(original: Call) -> Call:
    """Leave a product or sum with a system that has delays to that system's operators."""

    @wraps(original)
    def operator(self: Any, other: Any) -> Any:
        if isinstance(other, DelayOperators) and not isinstance(self, DelayOperators):
            return NotImplemented  # Python asks the other operand then
        return original(self, other)

    return operator


def with_delays(original: Call) -> Call:
    """Do an interconnection with a system that has delays as if this one had some, too."""

    @wraps(original)
    def method(self: Any, other: Any = 1, *more: Any, **settings: Any) -> Any:
        if isinstance(other, DelayOperators) and not isinstance(self, DelayOperators):
            return getattr(_delayed(self, other), original.__name__)(other, *more, **settings)
        return original(self, other, *more, **settings)

    # The text of python-control ends in two blank lines, at which the pages of the site stop.
    method.__doc__ = f"{cleandoc(original.__doc__ or '')}\n"
    return method


def _delayed(system: Any, beside: Any) -> Any:
    """Make a system with delays, of which it has none, so that its operators are exact."""
    names = {**signals_of(system), "name": system.name}
    form, sizes = form_of(system), (beside.ninputs, beside.noutputs)
    if form.states == 0 and is_single(form) and sizes != (1, 1):
        # the number 1 in ct.feedback(1, L), which python-control has made a system
        form, names = form_of(float(form.D[0, 0]) * np.eye(*sizes)), {}
    return DelayOperators._kinds[INSIDE](plain(form, common_dt(system, beside)), (), **names)


class BesideDelays(ct.StateSpace):  # type: ignore[misc]  # control is untyped
    """Controller that leaves operations with delayed systems to their operators."""

    __mul__ = left_to_the_other(ct.StateSpace.__mul__)
    __add__ = left_to_the_other(ct.StateSpace.__add__)
    __sub__ = left_to_the_other(ct.StateSpace.__sub__)
    feedback = with_delays(ct.StateSpace.feedback)


@contextmanager
def solvable(what: str) -> Iterator[None]:
    """Say what closes a loop without delay that has no solution, or many."""
    try:
        yield
    except np.linalg.LinAlgError:
        raise UnsuitableSystemError(
            f"{what} close an algebraic loop that has no solution, or many (I - D2 D1 is "
            "singular): the loop answers itself without any delay. Put a delay or a lag into it"
        ) from None
