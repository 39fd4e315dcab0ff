"""Unwrapped phase of systems and responses with dead time, correct on any grid."""

from __future__ import annotations

from typing import Any

import control as ct
import numpy as np
from numpy.typing import ArrayLike

from ..._checks import numbers, real
from ...delayed import DelaySystem
from ...delayed.parts import check_single
from ...errors import DataError, OptionError
from ...numerics.arrays import FloatArray
from ...numerics.loops.crossings import follow, frequency_grid
from ...numerics.rational.phase import dead_time_from_phase, unwrap_with_dead_time
from .loop import Loop, open_loop


def unwrapped_phase(
    system: Any,
    omega: ArrayLike | None = None,
    *,
    dead_time: float | None = None,
    deg: bool = False,
) -> FloatArray:
    """Unwrap the phase of a response with dead time.

    For a system the phase of the core is unwrapped on a sufficiently fine grid, and the delay's
    ``-omega tau`` is added: the result does not depend on the spacing of `omega`. It starts near
    ``-90 deg`` times the number of integrators (and 180 deg below that for a negative gain). For
    data the dead time is removed, the rest unwrapped, and the dead time added again.

    Parameters
    ----------
    system : system or FrequencyResponseData
        One input, one output.
    omega : array_like, shape (K,), optional
        Frequencies in rad/s, in any order; for a system only.
    dead_time : float, optional
        Dead time in s: of a continuous system, or of data if it is known. Otherwise the delay that
        gives the smoothest phase of the data is searched.
    deg : bool, optional
        Degrees instead of radians.

    Returns
    -------
    ndarray, shape (K,)

    Raises
    ------
    UnsuitableSystemError
        Several channels, or not a linear system.
    OptionError
        `omega` is given with data, or missing with a system.

    Notes
    -----
    `control.bode_plot` unwraps between neighbouring points; at d = 300 its phase is wrong by 39600
    degrees on its own grid.

    Examples
    --------
    >>> import control as ct
    >>> import ctrl_realize as cr
    >>> lag = cr.delayed_ss(ct.tf([1], [0.1, 1]), dead_time=0.3, dt=0.001)
    >>> print(cr.design.unwrapped_phase(lag, [1.0, 100.0, 1000.0], deg=True).round(1))
    [   -22.9  -1806.  -17306.9]
    """
    dead_time = None if dead_time is None else real(dead_time, "dead_time", "dead time in s")
    if isinstance(system, ct.FrequencyResponseData):
        if omega is not None:
            raise OptionError("omega is given, but the frequencies of data are fixed; omit it")
        phase = _of_data(system, dead_time)
    else:
        if omega is None:
            raise OptionError("omega is missing; for a system give the frequencies in rad/s")
        grid = numbers(omega, "omega")
        if grid.ndim != 1 or np.any(grid < 0) or not np.all(np.isfinite(grid)):
            raise DataError("omega must be a one-dimensional array of frequencies >= 0 in rad/s")
        wait = dead_time or 0.0
        loop = open_loop(system, dead_time=wait)
        if isinstance(system, DelaySystem) and not loop.dt:
            rest, own = system.delay_apart()
            loop = open_loop(rest, dead_time=wait + own)
        phase = _of_loop(loop, grid)
    return np.degrees(phase) if deg else phase


def _of_data(data: ct.FrequencyResponseData, dead_time: float | None) -> FloatArray:
    check_single(data, "a phase")
    omega = np.asarray(data.omega, dtype=np.float64)
    order = np.argsort(omega)
    values = np.asarray(data.frdata[0, 0], dtype=np.complex128)[order]
    dead_time = dead_time_from_phase(omega[order], values) if dead_time is None else dead_time
    phase = np.empty(omega.size)
    phase[order] = unwrap_with_dead_time(omega[order], values, dead_time)
    return phase


def _of_loop(loop: Loop, omega: FloatArray) -> FloatArray:
    # A few points per turn of the rest suffice: between them the phase is known modulo one turn.
    grid, top = loop.grid(), float(omega.max(initial=0.0))
    if not loop.dt and top > grid[-1]:
        features = np.concatenate([part.features for part in loop.factors])
        inside = loop.turn_time - loop.delay
        grid = np.append(grid[:-1], frequency_grid(float(grid[-1]), top, features, inside))
    nodes, values = follow(loop.delay_free, grid)
    course = np.unwrap(np.angle(values))
    expected = -np.pi / 2 * loop.integrators()
    # Between half a turn below and a quarter above: a negative gain starts 180 deg lower.
    course += 2 * np.pi * np.floor((expected + np.pi / 2 - course[0]) / (2 * np.pi))
    near = np.interp(omega, nodes, course)
    direct = np.angle(loop.delay_free(np.maximum(omega, nodes[0] * 1e-3)))
    exact = direct + 2 * np.pi * np.round((near - direct) / (2 * np.pi))
    return np.asarray(exact - omega * loop.delay, dtype=np.float64)
