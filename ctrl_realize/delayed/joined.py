"""Connect systems with delays by signal names."""

from __future__ import annotations

from collections.abc import Sequence
from functools import reduce
from typing import Any

import control as ct
import numpy as np

from .._checks import check_type
from ..data.shown_units import unit_among
from ..errors import UnsuitableSystemError
from ..numerics.internal_delays import form as forms
from .inside.system import DelaySystem
from .operands import Linear, common_dt, core_states, form_of
from .operators import solvable
from .parts import stand_in


def interconnect(systems: Sequence[Any], *args: Any, **settings: Any) -> Any:
    """Connect systems by their signal names, with exact delays.

    `control.interconnect` makes matrices with the states of all systems, and does not allow dead
    time in continuous time. This function has the same arguments.

    Parameters
    ----------
    systems : sequence of control.StateSpace or control.TransferFunction
        Systems with signal names; also `control.summing_junction`.
    *args, **settings
        ``connections``, ``inplist``, ``outlist``, ``inputs``, ``outputs``, ``name`` etc., as for
        `control.interconnect`.

    Returns
    -------
    DelaySystem or DelayedStateSpace

    Raises
    ------
    UnsuitableSystemError
        Systems that are not linear, mixed time bases, or an algebraic loop without a solution.

    Examples
    --------
    >>> import control as ct
    >>> import ctrl_realize as cr
    >>> P = cr.delayed_ss(ct.tf([1], [0.08, 1]), dead_time=0.3, dt=0.01, name="P",
    ...                   inputs="u", outputs="y")
    >>> C = ct.ss([[1.0]], [[1.0]], [[0.02]], [[0.5]], 0.01, name="C", inputs="e", outputs="u")
    >>> loop = cr.interconnect(
    ...     [P, C, ct.summing_junction(["r", "-y"], "e")], inputs="r", outputs=["y", "u"])
    >>> loop
    <DelaySystem: r -> y, u, order 2, internal delay 30 samples, dt = 0.01 s>
    """
    check_type(systems, Sequence, "systems", "a list of systems", UnsuitableSystemError)
    for system in systems:
        check_type(system, Linear, "a system", "one with signal names", UnsuitableSystemError)
    dt = _time_base(systems)
    all_ = reduce(forms.append, map(form_of, systems))
    wired = ct.interconnect([*map(stand_in, systems)], *args, **settings)
    gain, into = np.asarray(wired.connect_map), np.asarray(wired.input_map)
    # selection of the outputs, and the inputs u = gain y + into r
    seen = np.asarray(wired.output_map)
    of_outputs, of_inputs = seen[:, : all_.outputs], seen[:, all_.outputs :]
    with solvable("the direct terms of the systems"):
        loop = forms.closed(all_, gain)
    loop = forms.through(loop, of_outputs + of_inputs @ gain, into)
    total = forms.parallel(loop, forms.static(of_inputs @ into))
    labels = wired.input_labels, wired.output_labels
    settings = {"dt": dt, "time_unit": unit_among(*systems), "name": wired.name}
    return DelaySystem._joined(total, *labels, _state_names(systems), **settings)


def _state_names(systems: Sequence[Any]) -> list[str]:
    """Names of the states of all cores, with those of their systems, as in python-control."""
    delimiter = ct.config.defaults["iosys.state_name_delim"]
    return [
        f"{system.name}{delimiter}{label}"
        for system in systems
        for label in core_states(system, form_of(system))
    ]


def _time_base(systems: Sequence[Any]) -> float:
    known = [system for system in systems if getattr(system, "dt", None) is not None]
    if not known:
        raise UnsuitableSystemError("none of the systems has a time base; give one a dt")
    for system in known[1:]:
        common_dt(known[0], system)
    return float(common_dt(known[0], known[-1]) or 0.0)
