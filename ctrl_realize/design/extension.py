"""python-control's own functions and operators, exact for systems with dead time, on request."""

from __future__ import annotations

import sys
from functools import wraps
from threading import local
from typing import Any

import control as ct

from ..delayed import exp, interconnect
from ..delayed.operands import is_linear
from ..delayed.operators import Call, DelayOperators, left_to_the_other, with_delays
from .loops.gang_of_four import gang_of_four
from .loops.root_locus import root_locus


class ControlExtension:
    """What `extend_control` has changed in python-control; a context manager that undoes it.

    Examples
    --------
    >>> import control as ct
    >>> import ctrl_realize as cr
    >>> extension = cr.extend_control()
    >>> ct.append(ct.tf([1, 1], [1, 0]), ct.tf([1], [8, 1]) * cr.delay(2.0))
    <DelaySystem: u[0], u -> y[0], y, order 2, internal delay 2 s, continuous>
    >>> extension.undo()
    """

    def __init__(self) -> None:
        self._before: list[tuple[Any, str, Any]] = []
        for name, exact in _FUNCTIONS.items():
            original = getattr(ct, name)
            changed = _by_system(original, exact)
            # Where a module has imported the function, it has a name of its own for it.
            for module in [m for key, m in sys.modules.items() if _of_control(key)]:
                for held in [key for key, value in vars(module).items() if value is original]:
                    self._change(module, held, changed)
        for owner in (ct.TransferFunction, ct.StateSpace):
            for name in ("__mul__", "__add__", "__sub__", "__truediv__"):
                self._change(owner, name, left_to_the_other(vars(owner)[name]))
            for name in ("feedback", "append"):
                self._change(owner, name, with_delays(vars(owner)[name]))
        self._change(ct.TransferFunction, "exp", exp)
        self._change(ct, "exp", exp)

    def _change(self, owner: Any, name: str, value: Any) -> None:
        self._before.append((owner, name, vars(owner).get(name)))
        setattr(owner, name, value)

    def undo(self) -> None:
        """Make python-control as it was before; again, nothing happens."""
        while self._before:
            owner, name, value = self._before.pop()
            if value is None:
                delattr(owner, name)
            else:
                setattr(owner, name, value)

    def __enter__(self) -> ControlExtension:
        return self

    def __exit__(self, *error: object) -> None:
        self.undo()


def extend_control() -> ControlExtension:
    """Let python-control's own functions and operators be exact for systems with dead time.

    Python-control forms matrices with one state for each sample of dead time, or polynomials of
    that degree, and refuses dead times in continuous time. While the extension is in force,
    products, quotients, sums, ``feedback`` and ``append`` that begin with a plain system or a
    transfer function, ``ct.interconnect``, ``ct.step_response``, ``ct.impulse_response``,
    ``ct.initial_response``, ``ct.forced_response``, ``ct.step_info``, ``ct.root_locus_map``,
    ``ct.root_locus`` and ``ct.gangof4`` do for a `DelaySystem` or `DelayedStateSpace` what the
    methods and functions of this package do. ``ct.exp(-tau * s)`` and ``numpy.exp(-tau * s)`` are
    the dead time, see `exp`. For all other systems nothing changes.

    Returns
    -------
    ControlExtension
        As a context manager it ends with the block; otherwise with `ControlExtension.undo`.

    Notes
    -----
    The extension replaces functions in python-control's modules, and so is in force in all threads
    of the process. A function that was imported by name before keeps its old meaning there. Two
    extensions are undone in reverse order.

    Examples
    --------
    >>> import control as ct
    >>> import ctrl_realize as cr
    >>> s = ct.tf("s")
    >>> with cr.extend_control():
    ...     plant = 2 / (10 * s + 1) * ct.exp(-4.3 * s)
    ...     loop = ct.feedback((0.8 + 0.08 / s) * plant, 1)
    ...     found = ct.step_info(loop)
    >>> loop
    <DelaySystem: u -> y, order 2, internal delay 4.3 s, continuous>
    >>> round(found["Overshoot"], 1)
    19.5
    """
    return ControlExtension()


_inside = local()


def _by_system(original: Call, exact: Call) -> Call:
    """Call the exact function if the first argument is, or contains, a system with delays.

    Within an exact function python-control is as it is: methods of these systems call it.
    """

    @wraps(original)
    def chosen(*given: Any, **settings: Any) -> Any:
        first = given[0] if given else None
        some = first if isinstance(first, (list, tuple)) else given[:2]
        if getattr(_inside, "exact", False) or not any(isinstance(s, DelayOperators) for s in some):
            return original(*given, **settings)
        _inside.exact = True
        try:
            return exact(original, *given, **settings)
        finally:
            _inside.exact = False

    return chosen


def _response(original: Call, sysdata: Any, *given: Any, **settings: Any) -> Any:
    """Time responses and step characteristics: methods of the same name."""
    if isinstance(sysdata, (list, tuple)):
        some = [_response(original, system, *given, **settings) for system in sysdata]
        return some if original.__name__ == "step_info" else ct.TimeResponseList(some)
    exact = getattr(sysdata, original.__name__) if isinstance(sysdata, DelayOperators) else None
    names = {"T": "timepts", "X0": "initial_state", "U": "inputs"}
    said = {names.get(key, key): value for key, value in settings.items()}
    return original(sysdata, *given, **settings) if exact is None else exact(*given, **said)


def _locus(original: Call, sysdata: Any, gains: Any = None, *limits: Any, **more: Any) -> Any:
    if not isinstance(sysdata, (list, tuple)):
        return root_locus(sysdata, gains)
    from control.pzmap import PoleZeroList

    return PoleZeroList([root_locus(system, gains) for system in sysdata])


def _locus_plot(original: Call, sysdata: Any, gains: Any = None, **settings: Any) -> Any:
    return original(_locus(original, sysdata, gains), **settings)


def _gang(original: Call, P: Any, C: Any, *band: Any, **more: Any) -> Any:
    data = ct.frequency_response(gang_of_four(P, C), *band, **more)
    return ct.FrequencyResponseData(
        data.frdata, data.omega, outputs=["y", "u"], inputs=["r", "d"], plot_phase=False,
        title=f"Gang of Four for P={P.name}, C={C.name}", sysname=f"P={P.name}, C={C.name}",
    )  # fmt: skip


def _gang_plot(original: Call, *given: Any, **settings: Any) -> Any:
    own = {key: settings.pop(key) for key in _BAND if key in settings}
    return _gang(original, *given, **own).plot(**settings)


def _wired(original: Call, systems: Any, *given: Any, **settings: Any) -> Any:
    # summing junctions may be nonlinear systems; then python-control connects them all
    if not all(is_linear(system) for system in systems):
        return original(systems, *given, **settings)
    return interconnect(systems, *given, **settings)


def _of_control(module: str) -> bool:
    return module.partition(".")[0] == "control" and not module.startswith("control.tests")


_BAND = ("omega", "omega_limits", "omega_num", "Hz")
_FUNCTIONS: dict[str, Call] = {
    **dict.fromkeys(
        ("step_response", "impulse_response", "initial_response", "forced_response", "step_info"),
        _response,
    ),
    "interconnect": _wired,
    "root_locus_map": _locus,
    "root_locus_plot": _locus_plot,
    "gangof4_response": _gang,
    "gangof4_plot": _gang_plot,
}
