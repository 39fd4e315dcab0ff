"""Algebra of systems with delays: every interconnection is exact, and is again such a system."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Sequence
from typing import Any, ClassVar

import control as ct
import numpy as np

from ..errors import DelayRangeError, OptionError, UnsuitableSystemError
from ..numerics.internal_delays import form as forms
from ..numerics.internal_delays.form import DelayForm
from ..numerics.internal_delays.merging import ends_apart, merged
from .deferred import DeferredMatrices
from .parts import check_entries

ENDS, INSIDE = "ends", "inside"

Numbers = (int, float, np.number)


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

    @abstractmethod
    def _form(self) -> DelayForm:
        """Return core and delays, with those at the ends as further channels."""

    def _joined(
        self,
        form: DelayForm,
        dt: float,
        inputs: Sequence[str] | None = None,
        outputs: Sequence[str] | None = None,
        **names: Any,
    ) -> Any:
        """Make the system of a form, with the fewest delays; only unique names are kept."""
        try:
            form = merged(form)
        except np.linalg.LinAlgError:
            raise _algebraic("its delays of 0 s") from None
        labels: dict[str, Any] = dict(names)
        if inputs is not None and len(inputs) == form.inputs == len(set(inputs)):
            labels["inputs"] = list(inputs)
        if outputs is not None and len(outputs) == form.outputs == len(set(outputs)):
            labels["outputs"] = list(outputs)
        if dt:
            before, behind, rest = ends_apart(form)
            if not rest.delays:
                core = plain(rest, dt)
                whole = [int(d) for d in before], [int(d) for d in behind]
                return self._kinds[ENDS](core, whole[0], output_delay=whole[1], **labels)
        return self._kinds[INSIDE](plain(form, dt), form.delays, **labels)

    def _other(self, other: Any) -> DelayForm | None:
        """Form of the other operand; None if it has its own operator, or is not a system."""
        if isinstance(other, ct.FrequencyResponseData) or not is_linear(other):
            return None
        return form_of(other)

    def __neg__(self) -> Any:
        form = self._form()
        gain = forms.through(form, -np.eye(form.outputs), np.eye(form.inputs))
        return self._joined(gain, self.dt, self.input_labels, self.output_labels)

    def __add__(self, other: Any) -> Any:
        """Sum: parallel connection with the same input."""
        theirs, mine = self._other(other), self._form()
        if theirs is None:
            return NotImplemented
        # a system of one input and output is added to every entry, as in python-control
        if _is_single(theirs) and not _is_single(mine) and not isinstance(other, np.ndarray):
            theirs = _everywhere(theirs, mine)
        elif _is_single(mine) and not _is_single(theirs):
            mine = _everywhere(mine, theirs)
        if (mine.outputs, mine.inputs) != (theirs.outputs, theirs.inputs):
            raise OptionError(f"systems {_shapes(mine, theirs)} cannot be added")
        total = forms.parallel(mine, theirs)
        dt = common_dt(self, other)
        return self._joined(total, dt, self.input_labels, self.output_labels)

    def __radd__(self, other: Any) -> Any:
        return self + other

    def __sub__(self, other: Any) -> Any:
        return self + (-other)

    def __rsub__(self, other: Any) -> Any:
        return -self + other

    def __mul__(self, other: Any) -> Any:
        """Series: first `other`, then this system."""
        theirs = self._other(other)
        if theirs is None:
            return NotImplemented
        labels = _labels(other, "input_labels", self.input_labels)
        product = _product(self._form(), theirs)
        return self._joined(product, common_dt(self, other), labels, self.output_labels)

    def __rmul__(self, other: Any) -> Any:
        """Series: first this system, then `other`."""
        theirs = self._other(other)
        if theirs is None:
            return NotImplemented
        labels = _labels(other, "output_labels", self.output_labels)
        product = _product(theirs, self._form())
        return self._joined(product, common_dt(self, other), self.input_labels, labels)

    def __pow__(self, power: Any) -> Any:
        """Power; -1 is the inverse, if that is proper."""
        if power != -1 or isinstance(power, bool):
            return super().__pow__(power)
        try:
            form = forms.inverse(self._form())
        except np.linalg.LinAlgError:
            raise UnsuitableSystemError(
                f"the inverse of {self.name!r} is not proper: nothing of the input is seen at the "
                "output at once. Close the loop with ct.feedback instead of dividing"
            ) from None
        return self._joined(form, self.dt, self.output_labels, self.input_labels)

    def feedback(self, other: Any = 1, sign: float = -1) -> Any:
        """Close the loop with `other` in the feedback path; see `control.feedback`.

        Raises
        ------
        UnsuitableSystemError
            The feedthroughs of both form an algebraic loop without a solution, or the time bases
            differ.
        """
        if isinstance(other, ct.FrequencyResponseData) or not is_linear(other):
            return super().feedback(other, sign)
        if isinstance(other, Numbers):
            other = float(other) * np.eye(self.ninputs, self.noutputs)
        forward, back = self._form(), form_of(other)
        if (back.inputs, back.outputs) != (forward.outputs, forward.inputs):
            raise ct.ControlDimension(
                f"feedback around {forward.outputs} outputs and {forward.inputs} inputs by a "
                f"system "
                f"of {back.outputs} outputs and {back.inputs} inputs"
            )
        try:
            form = merged(forms.feedback(forward, back, float(sign)))
        except np.linalg.LinAlgError:
            raise _algebraic("the direct terms of both") from None
        return self._joined(form, common_dt(self, other), self.input_labels, self.output_labels)

    def append(self, other: Any) -> Any:
        """Append `other`; see `control.append`."""
        other_form = form_of(other)
        inputs = [*self.input_labels, *getattr(other, "input_labels", ["u"])]
        outputs = [*self.output_labels, *getattr(other, "output_labels", ["y"])]
        both = forms.append(self._form(), other_form)
        return self._joined(both, common_dt(self, other), inputs, outputs)

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
        try:
            form = forms.closed(both, gain)
        except np.linalg.LinAlgError:
            raise _algebraic("the direct terms of both") from None
        chosen = forms.through(form, np.eye(both.outputs)[rows], np.eye(both.inputs)[:, columns])
        return self._joined(chosen, common_dt(self, other))


def plain(form: DelayForm, dt: float) -> ct.StateSpace:
    """Make the core of a form as a system of python-control."""
    return ct.StateSpace(form.A, form.B, form.C, form.D, dt, remove_useless_states=False)


def is_linear(system: Any) -> bool:
    """Whether an object can be converted to a form."""
    if isinstance(system, (np.ndarray, np.number)):
        return bool(np.isrealobj(system))
    return isinstance(system, (int, float, ct.StateSpace, ct.TransferFunction))


def form_of(system: Any) -> DelayForm:
    """Convert a linear system, a number or a matrix to a form.

    Raises
    ------
    UnsuitableSystemError
        Anything else, an improper transfer function, or entries that are not finite.
    """
    if isinstance(system, DelayOperators):
        return system._form()
    if not is_linear(system):
        raise UnsuitableSystemError(
            f"got a {type(system).__name__}; expected a control.StateSpace, a TransferFunction, a "
            "number or a matrix"
        )
    check_entries(system)
    if isinstance(system, ct.TransferFunction):
        _check_proper(system)
        system = ct.ss(system)
    if isinstance(system, ct.StateSpace):
        A, B, C, D = (np.asarray(M, np.float64) for M in _matrices(system))
        return DelayForm(A, B, C, D)
    return forms.static(np.atleast_2d(np.asarray(system, dtype=np.float64)))


def _matrices(system: ct.StateSpace) -> tuple[Any, ...]:
    return system.A, system.B, system.C, system.D


def _check_proper(system: ct.TransferFunction) -> None:
    for nums, dens in zip(system.num, system.den, strict=True):
        for num, den in zip(nums, dens, strict=True):
            if np.trim_zeros(num, "f").size > np.trim_zeros(den, "f").size:
                raise UnsuitableSystemError(
                    f"{system.name!r} has more zeros than poles; expected a proper system. Add a "
                    "derivative filter"
                )


def common_dt(first: Any, second: Any) -> float:
    """Common time base of two systems; numbers and systems without one adopt the other.

    Raises
    ------
    UnsuitableSystemError
        Continuous and discrete, or different sample times.
    """
    bases: list[Any] = [getattr(system, "dt", None) for system in (first, second)]
    for base, other in (bases, bases[::-1]):
        if base is None or (base is True and other not in (None, 0, 0.0)):
            return float(other)
    if bool(bases[0]) != bool(bases[1]) or not np.isclose(bases[0], bases[1], rtol=1e-6, atol=0.0):
        words = " and ".join(f"dt = {base:g} s" if base else "continuous" for base in bases)
        raise UnsuitableSystemError(
            f"the systems have different time bases: {words}. Sample the continuous one "
            "(sys.to_discrete(dt), design.to_discrete)"
        )
    return float(bases[0])


def _labels(system: Any, side: str, own: Sequence[str]) -> Sequence[str]:
    """Signal names of the other factor; our own if python-control has numbered those."""
    labels: list[str] = getattr(system, side, list(own))
    numbered = all(label.endswith(f"[{i}]") for i, label in enumerate(labels))
    return own if numbered and len(labels) == len(own) else labels


def _is_single(form: DelayForm) -> bool:
    return form.inputs == form.outputs == 1


def _everywhere(single: DelayForm, other: DelayForm) -> DelayForm:
    return forms.through(single, np.ones((other.outputs, 1)), np.ones((1, other.inputs)))


def _product(second: DelayForm, first: DelayForm) -> DelayForm:
    """Series; a system of one input and output is applied to each channel, as in python-control."""
    if _is_single(second) and first.outputs != 1:
        second = _repeated(second, first.outputs)
    elif _is_single(first) and second.inputs != 1:
        first = _repeated(first, second.inputs)
    if _is_single(second) and _is_single(first):
        return _single_product(second, first)
    if second.inputs != first.outputs:
        raise OptionError(f"systems {_shapes(second, first)} cannot be multiplied")
    return forms.series(second, first)


def _single_product(second: DelayForm, first: DelayForm) -> DelayForm:
    """Series of single channels: all delays, wherever they are, are moved to the input."""
    (before, behind, core), (entry, exit_, other) = ends_apart(first), ends_apart(second)
    total = before[0] + behind[0] + entry[0] + exit_[0]
    line = forms.delayed_ends(*forms.gain_matrices(1.0), (total,), (0.0,))
    return forms.series(forms.series(other, core), line)


def _repeated(single: DelayForm, count: int) -> DelayForm:
    form = single
    for _ in range(count - 1):
        form = forms.append(form, single)
    return form


def _shapes(left: DelayForm, right: DelayForm) -> str:
    one, other = (left.outputs, left.inputs), (right.outputs, right.inputs)
    return f"of (outputs, inputs) {one} and {other}"


def _algebraic(what: str) -> UnsuitableSystemError:
    return UnsuitableSystemError(
        f"{what} close an algebraic loop that has no solution, or many (I - D2 D1 is singular): "
        "the loop answers itself without any delay. Put a delay or a lag into it"
    )


def whole_samples(delays: Sequence[float], dt: float) -> None:
    """Refuse delays of a discrete system that are not whole samples.

    Raises
    ------
    DelayRangeError
    """
    for delay in delays:
        if delay != int(delay):
            raise DelayRangeError(
                f"a delay is {delay:g} samples of {dt:g} s; a discrete system needs whole samples. "
                "Make the system in continuous time and sample it, sys.to_discrete(dt)"
            )
