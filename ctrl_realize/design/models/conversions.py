"""Conversions with exact dead time: transfer function, continuous, discrete."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import control as ct
import numpy as np

from ..._checks import positive
from ..._wording import in_time
from ...delayed import DelayedStateSpace, DelaySystem, delayed_ss
from ...delayed.inside.conversions import check_logarithm
from ...delayed.operands import plain
from ...delayed.parts import matrices_of, signals_of
from ...errors import OptionError, UnsuitableSystemError
from ...numerics.arrays import FloatArray
from ...numerics.blas_threads import single_threaded
from ...numerics.internal_delays.form import DelayForm, delayed_ends
from ...numerics.state_space.sampling import continuous_ends
from ...results import Result
from ..siso import delayed_system, proper_ss

_ROUNDING = 1e-9
"""Part of a sample by which delays differ that are the same."""


def to_tf(system: Any) -> ct.TransferFunction:
    """Convert a discrete system with dead time to a transfer function, exactly.

    Only the polynomials of the core are computed, den from its poles and num from den times the
    Markov parameters, so that the relative degree is preserved; the delay is d further poles at
    zero.

    Parameters
    ----------
    system : DelayedStateSpace
        Any number of channels; any discrete system.

    Returns
    -------
    control.TransferFunction
        With the names of the system.

    Examples
    --------
    >>> import control as ct
    >>> import ctrl_realize as cr
    >>> lag = cr.delayed_ss(ct.ss([[0.9]], [[1.0]], [[0.1]], [[0.0]], 0.1), 3)
    >>> tf = cr.design.to_tf(lag)
    >>> print(tf.num[0][0], tf.den[0][0])
    [0.1] [ 1.  -0.9  0.   0.   0. ]
    """
    return delayed_system(system, "to_tf", siso=False).to_tf()


@dataclass(frozen=True, eq=False, repr=False)
class ContinuousModel(Result):
    """Continuous core and its dead time; unpacks as ``core, dead_time = model``.

    Sampled with a zero-order hold at `dt`, ``to_discrete(model)``, it is the original discrete
    system.

    Attributes
    ----------
    core : control.StateSpace
        Continuous.
    input_delays, output_delays : tuple of float
        In s; not necessarily whole samples.
    dt : float
        Sample time in s of the discrete system.
    time_unit : str
        In which cards write times: min, h or day of the discrete system, otherwise s.

    Examples
    --------
    >>> import control as ct
    >>> import ctrl_realize as cr
    >>> plant = cr.delayed_ss(ct.tf([2], [0.08, 1]), dead_time=0.0289, dt=0.001)
    >>> model = cr.design.to_continuous(plant)
    >>> print(f"{model.dead_time:.4f} s", model.core.poles().real.round(6))
    0.0289 s [-12.5]
    >>> ct.feedback(model.system)
    <DelaySystem: u -> y, order 1, internal delay 0.0289 s, continuous>
    """

    core: ct.StateSpace
    input_delays: tuple[float, ...]
    output_delays: tuple[float, ...]
    dt: float
    time_unit: str = "s"

    @property
    def dead_time(self) -> Any:
        """Dead time in s: a float, or an array (outputs, inputs) if channels differ."""
        total = np.add.outer(self.output_delays, self.input_delays)
        return float(total[0, 0]) if np.ptp(total) <= _ROUNDING * self.dt else total

    def __iter__(self) -> Iterator[Any]:
        return iter((self.core, self.dead_time))

    def __reduce__(self) -> tuple[Any, ...]:
        # python-control's systems cannot be pickled.
        core = self.core
        names = {"name": core.name, **signals_of(core)}
        rest = self.input_delays, self.output_delays, self.dt, self.time_unit
        return _rebuild_model, (matrices_of(core), names, *rest)

    @property
    def system(self) -> DelaySystem:
        """Core and dead time as one continuous system, exact in loops; see `DelaySystem`."""
        core = self.core
        form = delayed_ends(DelayForm(*matrices_of(core)), self.input_delays, self.output_delays)
        names = {"name": core.name, **signals_of(core), "time_unit": self.time_unit}
        return DelaySystem(plain(form, 0), form.delays, **names)

    def pade(self, order: int = 5) -> ct.StateSpace:
        """Continuous system with each dead time as a Pade approximant, see `pade_ss`."""
        return self.system.pade(order) if np.any(self.dead_time) else self.core

    def _title(self) -> str:
        generic = self.core.name.startswith("sys[")
        return "Continuous model" if generic else f"Continuous model {self.core.name}"

    def _rows(self) -> list[tuple[str, str]]:
        poles = ", ".join(
            f"{p.real:.4g}" + (f" ± {p.imag:.4g}j" if p.imag > 0 else "")
            for p in self.core.poles()
            if p.imag >= 0
        )
        delays = ", ".join(
            f"{in_time(tau, 5)} ({tau / self.dt:.4g} samples)"
            for tau in dict.fromkeys(np.ravel(self.dead_time).tolist())
        )
        return [("dead time", delays), ("poles", f"{poles} rad/s" if poles else "none")]

    def __repr__(self) -> str:
        delays = ", ".join(f"{tau:.6g}" for tau in dict.fromkeys(np.ravel(self.dead_time).tolist()))
        return f"<ContinuousModel order {self.core.nstates}, dead time {delays} s>"


def _rebuild_model(
    matrices: tuple[FloatArray, ...], names: dict[str, Any], *settings: Any
) -> ContinuousModel:
    return ContinuousModel(ct.StateSpace(*matrices, 0, **names), *settings)


@single_threaded
def to_continuous(system: DelayedStateSpace) -> ContinuousModel:
    """Convert the core to continuous time (inverse zero-order hold), with a separate dead time.

    Exact if it exists: every pole of the core needs a logarithm. Of the many continuous models with
    the same samples, the one with all poles below the Nyquist frequency is given. The feedthrough
    of an input or output with a delay is converted to a fraction of a sample if that explains it
    (see `delayed_ss`).

    Parameters
    ----------
    system : DelayedStateSpace
        Inputs and outputs may have delays of their own.

    Returns
    -------
    ContinuousModel
        ``core, dead_time = to_continuous(system)``.

    Raises
    ------
    UnsuitableSystemError
        A pole at z = 0 or on the negative real axis: no continuous system of the same order has
        these samples. A system that is already continuous, or has delays in parallel paths
        (`DelaySystem.to_continuous` converts it) or in loops.

    Notes
    -----
    The matrix ``[[A, B], [0, I]]`` of the samples is the exponential of that of the continuous
    model; its principal logarithm is taken [1]_, [2]_.

    References
    ----------
    .. [1] N. J. Higham, Functions of Matrices, SIAM 2008, chapter 11 (Matrix logarithm),
       doi:10.1137/1.9780898717778.
    .. [2] A. H. Al-Mohy and N. J. Higham, Improved inverse scaling and squaring algorithms for the
       matrix logarithm, SIAM J. Sci. Comput. 34 (2012) C153-C169, doi:10.1137/110852553.

    Examples
    --------
    >>> import control as ct
    >>> import ctrl_realize as cr
    >>> plant = cr.delayed_ss(ct.tf([2], [0.08, 1]), dead_time=0.0289, dt=0.001)
    >>> core, dead_time = cr.design.to_continuous(plant)
    >>> print(core.poles().real.round(6), round(float(core.dcgain()), 9), round(dead_time, 9))
    [-12.5] 2.0 0.0289
    """
    plant = delayed_system(system, "to_continuous", siso=False)
    core, dt = plant.delay_free, float(plant.dt)
    check_logarithm(core.A)
    ends = plant.input_delays, plant.output_delays
    matrices, before, behind = continuous_ends(matrices_of(core), dt, *ends)
    names = {"name": f"{plant.name}_continuous", **signals_of(plant)}
    continuous = ct.StateSpace(*matrices, 0, remove_useless_states=False, **names)
    return ContinuousModel(continuous, before, behind, dt, plant.time_unit)


def held_fraction(plant: DelayedStateSpace) -> float:
    """Time in s by which the delay of one input and output exceeds the dead time.

    A dead time of (d + f) samples is represented by the delay d + 1 and a feedthrough. An
    identified one is known to all digits; that of another model is found as by `to_continuous`.
    """
    over = _over(plant, None if plant.fit is None else plant.fit.dead_time)
    if over or not (plant.delay and np.any(plant.delay_free.D)):
        return over
    try:
        return _over(plant, to_continuous(plant).dead_time)
    except UnsuitableSystemError:
        return 0.0


def _over(plant: DelayedStateSpace, dead_time: float | None) -> float:
    over = 0.0 if dead_time is None else float(plant.dead_time) - float(dead_time)
    return over if 0 < over < plant.dt else 0.0


def to_discrete(
    core: Any, dead_time: float | None = None, dt: float | None = None, **names: Any
) -> DelayedStateSpace:
    """Sample a continuous model with a zero-order hold, with any dead time exactly.

    Parameters
    ----------
    core : control.StateSpace, control.TransferFunction, ContinuousModel or DelaySystem
    dead_time : float, optional
        In s; default: that of a `ContinuousModel`, else 0. To replace the dead time of a model,
        give `dt` as well.
    dt : float, optional
        Sample time in s; default: that of a `ContinuousModel`.
    **names
        ``name``, ``inputs``, ``outputs``, ``time_unit``.

    Returns
    -------
    DelayedStateSpace

    Notes
    -----
    Sampling with a hold and a dead time of any length follows [1]_.

    References
    ----------
    .. [1] K. J. Astrom and B. Wittenmark, Computer-Controlled Systems, 3rd ed., Prentice Hall 1997,
       section 2.3.

    Examples
    --------
    >>> import control as ct
    >>> import ctrl_realize as cr
    >>> cr.design.to_discrete(ct.tf([1], [0.08, 1]), 0.0289, 0.01)
    <DelayedStateSpace: u -> y, order 1, z^-3 (0.03 s), dt = 0.01 s>
    """
    if isinstance(core, ContinuousModel):
        if dead_time is not None and dt is None:
            # Otherwise to_discrete(model, 0.05), with 0.05 meant as a sample time, would replace
            # the dead time by 0.05 s and keep the sample time.
            raise OptionError(
                f"the model already has a dead time, {core.dead_time:.6g} s; give dt=... for "
                "another sample time, or dead_time= and dt= to replace both"
            )
        dt = core.dt if dt is None else dt
        names = {"time_unit": core.time_unit, **names}
        several = dead_time is None and not isinstance(core.dead_time, float)
        dead_time = core.dead_time if dead_time is None and not several else dead_time
        core = core.system if several else core.core
    if isinstance(core, DelaySystem):
        if dead_time:
            raise OptionError(
                f"dead_time={dead_time!r} with a system that already has one; multiply it by "
                "delay(dead_time)"
            )
        sampled = core.to_discrete(positive(dt, "dt", "sample time in s"))
        if not isinstance(sampled, DelayedStateSpace):
            raise UnsuitableSystemError(
                f"{core.name!r} has internal delays; sys.to_discrete(dt) returns a DelaySystem"
            )
        return sampled.replace(**names)
    step = positive(dt, "dt", "sample time in s")
    system = proper_ss(core, "to_discrete")
    if system.isdtime(strict=True):
        raise UnsuitableSystemError(
            f"{system.name!r} is already discrete (dt={system.dt!r}); add a delay with "
            "delayed_ss(system, delay), or resample it with "
            "to_discrete(to_continuous(system), dt=...)"
        )
    return delayed_ss(system, dead_time=0.0 if dead_time is None else dead_time, dt=step, **names)
