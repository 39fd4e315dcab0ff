"""Operands of the operators: their forms, time bases and sizes."""

from __future__ import annotations

from collections.abc import Sequence
from functools import reduce
from typing import Any

import control as ct
import numpy as np

from ..data.shown_units import unit_among
from ..errors import OptionError, UnsuitableSystemError
from ..numerics.internal_delays import form as forms
from ..numerics.internal_delays.form import DelayForm
from ..numerics.internal_delays.merging import ends_apart
from ..numerics.state_space.sampling import state_units
from .deferred import DeferredMatrices
from .parts import check_entries, signals_of

Numbers, Linear = (int, float, np.number), (ct.StateSpace, ct.TransferFunction)


def plain(form: DelayForm, dt: float | None, states: Sequence[str] | None = None) -> ct.StateSpace:
    """Convert the core of a form to a system of python-control."""
    made = ct.StateSpace(form.A, form.B, form.C, form.D, dt, remove_useless_states=False)
    if states is not None and len(states) == made.nstates == len(set(states)):
        made.set_states(list(states))
    return made


def is_linear(system: Any) -> bool:
    """Whether an object can be converted to a form."""
    if isinstance(system, (np.ndarray, np.number)):
        return bool(np.isrealobj(system))
    return isinstance(system, (int, float, *Linear))


def form_of(system: Any) -> DelayForm:
    """Convert a linear system, a number or a matrix to a form.

    Raises
    ------
    UnsuitableSystemError
        Anything else, an improper transfer function, or entries that are not finite.
    """
    if isinstance(system, DeferredMatrices):
        return system._form()
    if not is_linear(system):
        raise UnsuitableSystemError(
            f"got a {type(system).__name__}; expected a control.StateSpace, a TransferFunction, a "
            "number or a matrix"
        )
    check_entries(system)
    if isinstance(system, ct.TransferFunction):
        check_proper(system, "an interconnection")
        system = in_state_space(system)
    if isinstance(system, ct.StateSpace):
        A, B, C, D = (np.asarray(M, np.float64) for M in (system.A, system.B, system.C, system.D))
        return DelayForm(A, B, C, D)
    return forms.static(np.atleast_2d(np.asarray(system, dtype=np.float64)))


def in_state_space(system: Any) -> ct.StateSpace:
    """Convert a linear system, a transfer function with all of its zeros.

    The conversion of SciPy leaves out leading coefficients of a numerator that are 1e-14 of the
    denominator's and less, as those of lags of hours are: the numerator is scaled, by a power of
    two, and the output matrices back.
    """
    if not isinstance(system, ct.TransferFunction) or not system.issiso():
        return ct.ss(system)
    num, den = (np.trim_zeros(part[0][0], "f") for part in (system.num, system.den))
    if not num.size:
        return ct.ss(system)
    scale = np.exp2(np.round(np.log2(np.abs(num[0] / den[0]))))
    names = {"name": system.name, **signals_of(system)}
    found = ct.ss(ct.TransferFunction(num / scale, den, system.dt, **names))
    units = state_units(found.A)
    found.A, found.B = found.A * units / units[:, None], found.B / units[:, None]
    found.C, found.D = scale * found.C * units, scale * found.D
    return found


def check_proper(system: ct.TransferFunction, purpose: str) -> None:
    """Check that no entry of a transfer function has more zeros than poles.

    Raises
    ------
    UnsuitableSystemError
    """
    for nums, dens in zip(system.num, system.den, strict=True):
        for num, den in zip(nums, dens, strict=True):
            if np.trim_zeros(num, "f").size > np.trim_zeros(den, "f").size:
                raise UnsuitableSystemError(
                    f"{purpose} needs a proper system; {system.name!r} has more zeros than "
                    "poles. Add a derivative filter"
                )


def check_divisor(system: Any) -> None:
    """Check that a divisor without delay is not 0, and that its inverse is proper.

    Raises
    ------
    UnsuitableSystemError
    """
    lower = False
    if isinstance(system, Numbers) and not (np.isfinite(system) and system):
        raise UnsuitableSystemError(f"got the divisor {system}; expected a finite number, not 0")
    if isinstance(system, ct.TransferFunction) and system.issiso():
        num, den = (np.trim_zeros(part[0][0], "f") for part in (system.num, system.den))
        lower = num.size < den.size
    elif isinstance(system, ct.StateSpace) and not isinstance(system, DeferredMatrices):
        lower = np.linalg.matrix_rank(system.D) < len(system.D)
    if lower:
        raise UnsuitableSystemError(improper_inverse(system.name))


def improper_inverse(name: str) -> str:
    """Message about a system whose inverse no state-space model has."""
    return (
        f"the inverse of {name!r} is not proper: nothing of the input is seen at the output at "
        "once. Close the loop with ct.feedback instead of dividing"
    )


def common_dt(first: Any, second: Any) -> float | None:
    """Common time base of two systems; numbers and systems without one adopt the other.

    Raises
    ------
    UnsuitableSystemError
        Continuous and discrete, or different sample times.
    """
    bases: list[Any] = [getattr(system, "dt", None) for system in (first, second)]
    for base, other in (bases, bases[::-1]):
        if base is None or (base is True and other not in (None, 0, 0.0)):
            return None if other is None else float(other)
    if bool(bases[0]) != bool(bases[1]) or not np.isclose(bases[0], bases[1], rtol=1e-6, atol=0.0):
        words = " and ".join(f"dt = {base:g} s" if base else "continuous" for base in bases)
        raise UnsuitableSystemError(
            f"the systems have different time bases: {words}. Sample the continuous one "
            "(sys.to_discrete(dt), design.to_discrete)"
        )
    return float(bases[0])


def time_base(first: Any, second: Any = None) -> dict[str, Any]:
    """Sample time of a connection, and the unit in which its times are written."""
    return {"dt": common_dt(first, second), "time_unit": unit_among(first, second)}


def core_states(system: Any, form: DelayForm) -> list[str]:
    """Names of the states of a system's core; python-control's for a transfer function."""
    core = getattr(system, "delay_free", getattr(system, "core", system))
    labels, count = getattr(core, "state_labels", None) or [], form.states
    return list(labels) if len(labels) == count else [f"x[{i}]" for i in range(count)]


def labels_of(system: Any, side: str, own: Sequence[str]) -> Sequence[str]:
    """Signal names of the other factor; our own if python-control has numbered those."""
    labels: list[str] = getattr(system, side, list(own))
    numbered = all(label.endswith(f"[{i}]") for i, label in enumerate(labels))
    return own if numbered and len(labels) == len(own) else labels


def is_single(form: DelayForm) -> bool:
    """Whether a system has one input and one output."""
    return form.inputs == form.outputs == 1


def everywhere(single: DelayForm, other: DelayForm) -> DelayForm:
    """Repeat a system with one input and one output in every entry of the size of another."""
    return forms.through(single, np.ones((other.outputs, 1)), np.ones((1, other.inputs)))


def product(second: DelayForm, first: DelayForm) -> DelayForm:
    """Series; a system of one input and output is applied to each channel, as in python-control."""
    if is_single(second) and first.outputs != 1:
        second = reduce(forms.append, [second] * first.outputs)
    elif is_single(first) and second.inputs != 1:
        first = reduce(forms.append, [first] * second.inputs)
    if second.inputs != first.outputs:
        raise OptionError(f"systems {shapes(second, first)} cannot be multiplied")
    (before, behind, core), (entry, exit_, other) = ends_apart(first), ends_apart(second)
    between = {a + b for a, b in zip(behind, entry, strict=True)}
    if len(between) > 1:
        return forms.series(second, first)
    # a delay that all signals between have in common is one of all inputs
    joined, late = forms.series(other, core), between.pop()
    if is_single(joined):
        late, exit_ = late + exit_[0], (0.0,)
    return forms.delayed_ends(joined, [delay + late for delay in before], exit_)


def shapes(left: DelayForm, right: DelayForm) -> str:
    """Text with the sizes of two systems, for error messages."""
    one, other = (left.outputs, left.inputs), (right.outputs, right.inputs)
    return f"of (outputs, inputs) {one} and {other}"
