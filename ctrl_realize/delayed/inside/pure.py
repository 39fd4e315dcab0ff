"""A dead time by itself, as a factor of transfer functions."""

from __future__ import annotations

from typing import Any

import control as ct
import numpy as np

from ..._checks import positive, real
from ...errors import DelayRangeError, UnsuitableSystemError
from ...numerics.state_space.sampling import split_dead_time
from ..operators import ENDS
from ..parts import signals_of
from .checks import not_rational
from .system import DelaySystem


class _InName(ct.TransferFunction):  # type: ignore[misc]  # control is untyped
    """A transfer function without polynomials."""

    def __init__(self, *args: Any, **settings: Any) -> None:
        ct.InputOutputSystem.__init__(self, *args, **settings)

    @property
    def num_array(self) -> Any:
        """Refused: a dead time has no polynomials."""
        raise not_rational("polynomials")

    den_array = num = den = num_list = den_list = num_array


class TransferDelay(DelaySystem, _InName):
    """Transfer function with dead time, such as ``ct.tf(...) * delay(0.3)``; see `delay`.

    A `DelaySystem` that is also a subclass of `control.TransferFunction`, since transfer functions
    of python-control leave ``C * P`` and ``C + P`` to no other class. Such a product or sum is a
    `DelaySystem`, which `control.margin` accepts.
    """

    def __mul__(self, other: Any) -> Any:
        return self._plant(super().__mul__(other), other)

    def __rmul__(self, other: Any) -> Any:
        return self._plant(super().__rmul__(other), other)

    def _plant(self, made: Any, other: Any) -> Any:
        """Keep the class of the product of a pure dead time and a transfer function."""
        if self._core.nstates or not isinstance(other, ct.TransferFunction):
            return made
        return type(self)(made.core, made.internal_delays, **signals_of(made))


def delay(dead_time: float, dt: float | None = None, *, name: str | None = None) -> Any:
    """Dead time ``exp(-tau s)``, to be multiplied with other systems.

    Parameters
    ----------
    dead_time : float
        In s, 0 or more.
    dt : float, optional
        Sample time in s; the delay is then z^-d with whole samples.
    name : str, optional

    Returns
    -------
    TransferDelay
        A continuous `DelaySystem`; a `DelayedStateSpace` if `dt` is given.

    Raises
    ------
    DelayRangeError
        A negative dead time, or one that is not a multiple of `dt`.

    Examples
    --------
    >>> import control as ct
    >>> import numpy as np
    >>> import ctrl_realize as cr
    >>> P = ct.tf([2], [1, 1]) * cr.delay(0.3)
    >>> P
    <TransferDelay: u -> y, order 1, internal delay 0.3 s, continuous>
    >>> bool(abs(P(2j) - 2 * np.exp(-0.6j) / (1 + 2j)) < 1e-15)
    True
    >>> loop = ct.feedback(P * 1.5)
    >>> loop.is_stable(), loop.dominant_poles(1).round(4)
    (True, array([-1.606+4.819j, -1.606-4.819j]))
    """
    tau = real(dead_time, "dead_time", "dead time in s, >= 0")
    if tau < 0:
        raise DelayRangeError(f"dead_time={tau:g} s; expected a value >= 0")
    names: dict[str, Any] = {"inputs": "u", "outputs": "y", "name": name}
    if dt is not None:
        step = positive(dt, "dt", "sample time in s")
        samples, fraction = split_dead_time(tau, step)
        if fraction:
            raise DelayRangeError(
                f"dead_time={tau:g} s is {tau / step:.6g} samples of {step:g} s; a discrete delay "
                "needs whole samples. Define the plant in continuous time and sample it: "
                "(ct.tf(...) * cr.delay(tau)).to_discrete(dt)"
            )
        return DelaySystem._kinds[ENDS](ct.ss([], [], [], 1.0, step), samples, **names)
    if tau == 0:
        return TransferDelay(ct.ss([], [], [], 1.0, 0), **names)
    core = ct.StateSpace([], [], [], np.array([[0.0, 1.0], [1.0, 0.0]]), 0)
    return TransferDelay(core, [tau], **names)


def exp(system: Any) -> Any:
    """Dead time as in a textbook: ``exp(-tau * s)`` with the transfer function ``s``.

    Parameters
    ----------
    system : control.TransferFunction
        -tau s, of one input and one output, in continuous time.

    Returns
    -------
    TransferDelay
        As `delay` makes it.

    Raises
    ------
    UnsuitableSystemError
        Anything else.
    DelayRangeError
        A lead: tau < 0.

    Examples
    --------
    >>> import control as ct
    >>> import ctrl_realize as cr
    >>> s = ct.tf("s")
    >>> 2 / (10 * s + 1) * cr.exp(-4.3 * s)
    <TransferDelay: u -> y, order 1, internal delay 4.3 s, continuous>
    """
    if isinstance(system, ct.TransferFunction) and system.issiso() and not system.dt:
        num, den = (np.trim_zeros(p[0][0], "f") for p in (system.num, system.den))
        if num.size in (0, 2) and den.size == 1 and not num[1:].any():
            return delay(-num[0] / den[0] if num.size else 0.0)
    raise UnsuitableSystemError(
        f"got exp of {system!r}; expected -tau * s with s = ct.tf('s') and a dead time tau in s, "
        "such as exp(-0.3 * s); in discrete time use delay(tau, dt)"
    )
