r"""State-space systems that carry a dead time: z^-d beside a delay-free core.

This folder is the one place that knows how python-control works inside. A `DelayedStateSpace` is a
`control.StateSpace` whose matrices hold the delay as a chain of shift registers at the input,
so every function of python-control accepts it. Where the matrices would be slow or inexact
(frequency response, poles, zeros, products) the methods below use core and delay instead.

The chain is attached last and never mixed with the core's states: after any dense similarity
transform its d poles at 0 drift out to |z| = eps^(1/d), 0.37 for d = 37.
"""

from __future__ import annotations

import html
import warnings
from collections.abc import Sequence
from typing import Any

import control as ct
import numpy as np
from numpy.typing import ArrayLike
from scipy.optimize import brentq

from ..checks import real, whole
from ..errors import DataError, DelayRangeError, UnsuitableSystemError
from ..numerics import state_space
from ..numerics.arrays import ComplexArray, FloatArray, IntArray, read_only
from .chains import augment, chain_labels, common, later, parse_delays, powers

MAX_STATES = 20_000
"""The augmented A is dense, as python-control needs it: 20 000 states are 3 GB."""


class DelayedStateSpace(ct.StateSpace):  # type: ignore[misc]  # control is untyped
    """Discrete state-space system with dead time: core(z) z^-d.

    It is a `control.StateSpace` with the states ``[core; u[k-1] ... u[k-d]]`` and goes into every
    function of python-control. The delay survives negation, products with numbers, matrices and
    systems, powers, copies, pickling and renaming; sums, feedback, append and indexing give a
    plain `control.StateSpace`, still right. ``ct.ss(sys)`` strips to a plain one at any time.

    Matrices are read-only: core and chain must stay in step.

    Parameters
    ----------
    core : control.StateSpace
        Discrete system without the delay; its sample time must be a number.
    delay : int or sequence of int
        Whole samples, the same for all inputs or one for each.
    output_delay : int or sequence of int, optional
        Whole samples behind the core, the same for all outputs or one for each.
    fit : optional
        How the model was found; any result of this toolbox.
    name, inputs, outputs : optional
        Names, as for `control.ss`. Signals are named as those of `core`, or ``u`` and ``y``.

    Attributes
    ----------
    delay : int, or ndarray of int with shape (outputs, inputs) where channels differ
        Dead time in samples.
    dead_time : float, or ndarray
        ``delay * dt`` in s.
    delay_free : control.StateSpace
        The core.
    input_delays, output_delays : tuple of int
    fit : object or None

    Notes
    -----
    ``sys(z) == sys.delay_free(z) * z**-sys.delay`` to rounding, whatever the delay.

    ``tf * sys`` is the one product that python-control decides alone: it makes a transfer
    function of the augmented matrices, which is wrong from d = 50 or so on. Write ``sys * tf``
    or ``ct.ss(tf) * sys``.

    Raises
    ------
    UnsuitableSystemError
        A core that is not a discrete state-space system with a sample time.
    DelayRangeError
        Delays that are negative, no whole numbers, or not one for each signal.

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
        fit: Any = None,
        name: str | None = None,
        inputs: str | Sequence[str] | None = None,
        outputs: str | Sequence[str] | None = None,
    ) -> None:
        check_core(core)
        before = parse_delays(delay, core.ninputs, "delay", "input")
        behind = parse_delays(output_delay, core.noutputs, "output_delay", "output")
        if isinstance(core, DelayedStateSpace):
            before = tuple(a + b for a, b in zip(before, core.input_delays, strict=True))
            behind = tuple(a + b for a, b in zip(behind, core.output_delays, strict=True))
            core = core.delay_free
        if core.issiso():
            before, behind = (before[0] + behind[0],), (0,)
        size = core.nstates + sum(before) + sum(behind)
        if size > MAX_STATES:
            raise DelayRangeError(
                f"the delays {before + behind} make {size} states, and a dense matrix of "
                f"{8 * size**2 / 1e9:.0f} GB; at most {MAX_STATES} states are allowed. "
                "Use a longer sample time, or keep core and delay apart"
            )
        input_names = _signal_names(inputs, core.input_labels, "u")
        output_names = _signal_names(outputs, core.output_labels, "y")
        chain = chain_labels(input_names, output_names, before, behind)
        core_states = [f"x[{i}]" for i in range(core.nstates)]
        self._locked = False
        super().__init__(
            *(read_only(M) for M in augment((core.A, core.B, core.C, core.D), before, behind)),
            core.dt,
            inputs=input_names,
            outputs=output_names,
            states=core_states + chain,
            remove_useless_states=False,
            **({} if name is None else {"name": name}),
        )
        self._core = ct.StateSpace(
            *(read_only(M) for M in (core.A, core.B, core.C, core.D)),
            core.dt,
            inputs=input_names,
            outputs=output_names,
            states=core_states,
            name=f"{self.name}_core",
            remove_useless_states=False,
        )
        self.input_delays: tuple[int, ...] = before
        self.output_delays: tuple[int, ...] = behind
        self.fit = fit
        self._schur: tuple[ComplexArray, ComplexArray] | None = None
        for M in (self.A, self.B, self.C, self.D):
            M.flags.writeable = False
        for M in (self._core.A, self._core.B, self._core.C, self._core.D):
            M.flags.writeable = False
        self._locked = True

    def __setattr__(self, attribute: str, value: Any) -> None:
        # Core and chain would fall out of step, and python-control's `append` is known to do it.
        if attribute in ("A", "B", "C", "D", "dt") and self.__dict__.get("_locked", False):
            raise AttributeError(
                f"{attribute} of a DelayedStateSpace is fixed; build a new one with delayed_ss, "
                "or take a plain copy with ct.ss(sys)"
            )
        super().__setattr__(attribute, value)

    # -- what it is made of ------------------------------------------------------------------

    @property
    def delay_free(self) -> ct.StateSpace:
        """The core, a plain `control.StateSpace`."""
        return self._core

    @property
    def delay(self) -> Any:
        """Dead time in samples: an int, or an array (outputs, inputs) where channels differ."""
        total: IntArray = np.add.outer(
            np.array(self.output_delays, dtype=np.int64),
            np.array(self.input_delays, dtype=np.int64),
        )
        return int(total[0, 0]) if np.all(total == total[0, 0]) else total

    @property
    def dead_time(self) -> Any:
        """Dead time in s: ``delay * dt``."""
        return self.delay * self.dt

    def replace(self, **changes: Any) -> DelayedStateSpace:
        """Make the same system with another `delay`, `output_delay`, `fit`, `name` or labels."""
        settings: dict[str, Any] = {
            "delay": self.input_delays,
            "output_delay": self.output_delays,
            "fit": self.fit,
            "name": self.name,
            "inputs": self.input_labels,
            "outputs": self.output_labels,
        }
        unknown = set(changes) - set(settings)
        if unknown:
            raise TypeError(f"replace() takes {', '.join(settings)}; got {', '.join(unknown)}")
        settings.update(changes)
        return DelayedStateSpace(self._core, settings.pop("delay"), **settings)

    def __reduce__(self) -> tuple[Any, ...]:
        core = self._core
        return (
            _rebuild,
            (
                (core.A, core.B, core.C, core.D, core.dt),
                self.input_delays,
                self.output_delays,
                self.fit,
                self.name,
                tuple(self.input_labels),
                tuple(self.output_labels),
            ),
        )

    def __deepcopy__(self, memo: dict[int, Any]) -> DelayedStateSpace:
        # Everything inside is read-only, so a copy may share it; the closures of python-control
        # must not be shared, and a new object has its own.
        return self.replace()

    # -- responses, from core and delay -------------------------------------------------------

    def horner(self, x: ArrayLike, warn_infinite: bool = True) -> ComplexArray:
        """Evaluate the transfer matrix: core(x) x^-d, shape (outputs, inputs, K).

        See `control.StateSpace.horner`; the cost does not grow with the delay.
        """
        points = np.atleast_1d(np.asarray(x, dtype=np.complex128))
        if points.ndim > 1:
            raise ValueError("input list must be 1D")
        if self._schur is None:
            self._schur = state_space.schur_form(self._core.A)
        with np.errstate(divide="ignore", invalid="ignore"):
            out = state_space.frequency_response(
                self._schur, self._core.B, self._core.C, self._core.D, points
            )
            if any(self.input_delays):
                out = out * powers(points, self.input_delays)[None, :, :]
            if any(self.output_delays):
                out = out * powers(points, self.output_delays)[:, None, :]
        # The Schur form leaves rounding in the imaginary part, and dcgain() would be complex.
        on_axis = points.imag == 0
        out[..., on_axis] = out[..., on_axis].real
        lost = ~np.isfinite(out)
        if lost.any():
            if warn_infinite:
                # The class and words of python-control, whose callers look for them.
                warnings.warn("singular matrix in frequency response", RuntimeWarning, stacklevel=3)
            out[lost] = complex(np.inf, np.nan)
        return out

    def markov(self, count: int) -> FloatArray:
        """Compute the unit-pulse response, delay included.

        Returns
        -------
        ndarray, shape (count,) or (outputs, inputs, count)
        """
        return self._with_delay(state_space.markov, whole(count, "count", 1))

    def step(self, count: int) -> FloatArray:
        """Compute the response to a unit step on each input, delay included.

        The chain is not simulated, so the cost does not grow with the delay.

        Returns
        -------
        ndarray, shape (count,) or (outputs, inputs, count)
        """
        return self._with_delay(state_space.step_response, whole(count, "count", 1))

    def simulate(self, inputs: ArrayLike) -> FloatArray:
        """Compute the response from rest to any input, delay included.

        Parameters
        ----------
        inputs : array_like, shape (N,) or (inputs, N)

        Returns
        -------
        ndarray, shape (N,) or (outputs, N)
        """
        given = np.asarray(inputs, dtype=np.float64)
        rows = np.atleast_2d(given)
        if rows.ndim != 2 or rows.shape[0] != self.ninputs:
            raise DataError(
                f"inputs has shape {given.shape}; needed is ({self.ninputs}, N)"
                + (" or (N,)" if self.ninputs == 1 else "")
            )
        held = np.stack([later(u, d) for u, d in zip(rows, self.input_delays, strict=True)])
        core = self._core
        out = state_space.simulate(core.A, core.B, core.C, core.D, held)
        out = np.stack([later(y, q) for y, q in zip(out, self.output_delays, strict=True)])
        return out[0] if self.issiso() and given.ndim == 1 else out

    def _with_delay(self, response: Any, count: int) -> FloatArray:
        core = self._core
        free: FloatArray = response(core.A, core.B, core.C, core.D, count)
        out = np.zeros_like(free)
        for i, behind in enumerate(self.output_delays):
            for j, before in enumerate(self.input_delays):
                out[i, j] = later(free[i, j], before + behind)
        return np.asarray(out[0, 0] if self.issiso() else out, dtype=np.float64)

    def poles(self) -> ComplexArray:
        """Poles: those of the core, and exact zeros for the delay."""
        chain = np.zeros(sum(self.input_delays) + sum(self.output_delays), dtype=np.complex128)
        return np.concatenate([self._core.poles(), chain])

    def zeros(self) -> ComplexArray:
        """Finite zeros; for one input and output those of the core."""
        if self.issiso() or isinstance(self.delay, int):
            return np.asarray(self._core.zeros(), dtype=np.complex128)
        return np.asarray(super().zeros(), dtype=np.complex128)

    def damp(self) -> Any:
        """Natural frequency, damping and poles; delay poles have infinite frequency."""
        # log(0) of the poles at 0 is meant here, and python-control would warn of each.
        with np.errstate(divide="ignore", invalid="ignore"):
            return super().damp()

    def bandwidth(self, dbdrop: float = -3) -> float:
        """Lowest frequency in rad/s where the gain is `dbdrop` dB below that at 0.

        python-control 0.10.2 raises here for every discrete system: it looks for the crossing
        at G(jw) instead of G(exp(jw dt)).
        """
        if not self.issiso():
            raise TypeError("system should be a SISO system")
        drop = real(dbdrop, "dbdrop", "drop of the gain in dB, below 0")
        if drop >= 0:
            raise ValueError("expecting dbdrop be a negative scalar in dB")
        level = abs(complex(self(1.0, warn_infinite=False))) * 10 ** (drop / 20)
        if not np.isfinite(level):
            return float("nan")
        nyquist = np.pi / self.dt
        grid = np.concatenate(
            [np.geomspace(nyquist * 1e-7, nyquist, 2000), np.linspace(0, nyquist, 2000)[1:]]
        )
        grid.sort()
        gain = np.abs(self._core(np.exp(1j * grid * self.dt)))
        below = np.flatnonzero(gain < level)
        if below.size == 0:
            return float("inf")
        first = int(below[0])
        if first == 0:
            return float(grid[0])
        return float(
            brentq(
                lambda w: abs(complex(self._core(np.exp(1j * w * self.dt)))) - level,
                grid[first - 1],
                grid[first],
                xtol=1e-14 * nyquist,
            )
        )

    def minreal(self, tol: float = 0.0) -> DelayedStateSpace:
        """Minimal realization of the core; the chain stays as it is."""
        return self._around(self._core.minreal(tol))

    def to_tf(self, *args: Any, **kwargs: Any) -> ct.TransferFunction:
        """Transfer function: that of the core, with the delay as d zeros behind den.

        python-control's ``ct.tf(sys)`` goes through the polynomial of the augmented matrix,
        which is noise from d = 50 on. Several channels give a matrix of transfer functions.
        """
        core = ct.tf(self._core, *args, **kwargs)
        total = np.add.outer(self.output_delays, self.input_delays)
        den = [
            [np.concatenate([core.den[i][j], np.zeros(total[i, j])]) for j in range(core.ninputs)]
            for i in range(core.noutputs)
        ]
        return ct.TransferFunction(
            core.num, den, self.dt, inputs=self.input_labels, outputs=self.output_labels
        )

    # -- algebra ---------------------------------------------------------------------------------

    def _around(self, core: ct.StateSpace, **changes: Any) -> DelayedStateSpace:
        settings: dict[str, Any] = {
            "output_delay": self.output_delays,
            "inputs": self.input_labels,
            "outputs": self.output_labels,
        }
        settings.update(changes)
        return DelayedStateSpace(core, settings.pop("delay", self.input_delays), **settings)

    def _plain(self) -> ct.StateSpace:
        return ct.StateSpace(self)

    def __neg__(self) -> DelayedStateSpace:
        return self._around(-self._core)

    def __mul__(self, other: Any) -> Any:
        """Series: first `other`, then this system."""
        if _is_scalar(other):
            return self._around(self._core * other)
        if isinstance(other, ct.TransferFunction):
            other = ct.ss(other)
        if isinstance(other, np.ndarray):
            other = np.atleast_2d(other)
            if other.shape[0] == self.ninputs and common(self.input_delays) is not None:
                delays = (common(self.input_delays) or 0,) * other.shape[1]
                names = self.input_labels if other.shape[1] == self.ninputs else None
                return self._around(self._core * other, delay=delays, inputs=names)
            return self._plain() * other
        if type(other) is not ct.StateSpace and not isinstance(other, DelayedStateSpace):
            return self._plain() * other
        return _series(self, other)

    def __rmul__(self, other: Any) -> Any:
        """Series: first this system, then `other`."""
        if _is_scalar(other):
            return self._around(other * self._core)
        if isinstance(other, ct.TransferFunction):
            other = ct.ss(other)
        if isinstance(other, np.ndarray):
            other = np.atleast_2d(other)
            if other.shape[1] == self.noutputs and common(self.output_delays) is not None:
                delays = (common(self.output_delays) or 0,) * other.shape[0]
                names = self.output_labels if other.shape[0] == self.noutputs else None
                # A matrix times a 1x1 system promotes it in python-control; here it does not.
                core = ct.StateSpace(
                    self._core.A, self._core.B, other @ self._core.C, other @ self._core.D, self.dt
                )
                return self._around(core, output_delay=delays, outputs=names)
            return other * self._plain()
        if type(other) is not ct.StateSpace:
            return other * self._plain() if isinstance(other, ct.StateSpace) else NotImplemented
        return _series(other, self)

    def append(self, other: Any) -> ct.StateSpace:
        """Append `other`; a plain system, as python-control makes it."""
        # python-control's append writes to self.dt.
        return self._plain().append(other)

    # -- how it shows ----------------------------------------------------------------------------

    def _shift(self) -> str:
        if isinstance(self.delay, int):
            return f"z^-{self.delay} ({self.dead_time:.6g} s)"
        return f"input delays {self.input_delays}, output delays {self.output_delays}"

    def _fit_line(self) -> str:
        return "" if self.fit is None else f"{self.fit!r}"

    def __repr__(self) -> str:
        name = "" if self._generic_name_check() else f" {self.name!r}"
        signals = f"{', '.join(self.input_labels)} -> {', '.join(self.output_labels)}"
        fit = f", fit: {self._fit_line()}" if self.fit is not None else ""
        return (
            f"<DelayedStateSpace{name}: {signals}, order {self._core.nstates}, {self._shift()}, "
            f"dt = {self.dt:.6g} s{fit}>"
        )

    def __str__(self) -> str:
        lines = [repr(self), "", "core:"]
        for letter in "ABCD":
            lines.append(f"{letter} =")
            lines += [f"    {row}" for row in str(getattr(self._core, letter)).splitlines()]
        return "\n".join([*lines, f"times {self._shift()}"])

    def _repr_html_(self) -> str:
        core = self._core._repr_html_() or html.escape(f"core of order {self._core.nstates}")
        fit = f"<div>{html.escape(self._fit_line())}</div>" if self.fit is not None else ""
        title = "" if self._generic_name_check() else html.escape(f"{self.name}: ")
        return (
            f"<div><div>{title}core of order {self._core.nstates} times "
            f"<b>{html.escape(self._shift())}</b></div>{core}{fit}</div>"
        )

    def _repr_markdown_(self) -> None:
        return None


def _rebuild(
    matrices: tuple[Any, ...],
    input_delays: tuple[int, ...],
    output_delays: tuple[int, ...],
    fit: Any,
    name: str,
    inputs: tuple[str, ...],
    outputs: tuple[str, ...],
) -> DelayedStateSpace:
    return DelayedStateSpace(
        ct.StateSpace(*matrices, remove_useless_states=False),
        input_delays,
        output_delay=output_delays,
        fit=fit,
        name=name,
        inputs=inputs,
        outputs=outputs,
    )


def check_core(core: Any) -> None:
    """Refuse what is not a discrete state-space system with a sample time."""
    if not isinstance(core, ct.StateSpace):
        raise UnsuitableSystemError(
            f"core is a {type(core).__name__}; needed is a discrete control.StateSpace "
            "(delayed_ss also takes transfer functions)"
        )
    if core.dt is None or core.dt is True or not core.dt > 0:
        raise UnsuitableSystemError(
            f"the core's dt is {core.dt!r}; needed is a sample time in s "
            "(delayed_ss samples a continuous core)"
        )


def _signal_names(given: str | Sequence[str] | None, core: Sequence[str], letter: str) -> list[str]:
    if given is not None:
        return [given] if isinstance(given, str) else list(given)
    generic = [f"{letter}[{i}]" for i in range(len(core))]
    return [letter] if list(core) == generic and len(generic) == 1 else list(core)


def _series(second: ct.StateSpace, first: ct.StateSpace) -> ct.StateSpace:
    """Product second * first, with delays kept where the delays between them are common."""
    behind = getattr(first, "output_delays", (0,) * first.noutputs)
    before = getattr(second, "input_delays", (0,) * second.ninputs)
    fits = second.ninputs == first.noutputs
    between = common(tuple(a + b for a, b in zip(behind, before, strict=True))) if fits else None
    if between is None:
        return ct.StateSpace(second) * ct.StateSpace(first)
    core = getattr(second, "delay_free", second) * getattr(first, "delay_free", first)
    entry = getattr(first, "input_delays", (0,) * first.ninputs)
    return DelayedStateSpace(
        core,
        tuple(d + between for d in entry),
        output_delay=getattr(second, "output_delays", (0,) * second.noutputs),
        inputs=first.input_labels,
        outputs=second.output_labels,
    )


def _is_scalar(value: Any) -> bool:
    return isinstance(value, (int, float, np.number)) and not isinstance(value, np.complexfloating)
