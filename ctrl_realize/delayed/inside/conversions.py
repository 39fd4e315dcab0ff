"""Rational and sampled systems in place of a continuous one with dead time."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import control as ct
import numpy as np
from scipy.linalg import expm

from ..._checks import integer, positive
from ...errors import DelayRangeError, ModelWarning, OptionError, UnsuitableSystemError, warn_caller
from ...numerics.arrays import BoolArray, FloatArray
from ...numerics.internal_delays import form as forms
from ...numerics.internal_delays.form import DelayForm
from ...numerics.internal_delays.merging import Paths, ends_apart, paths_apart
from ...numerics.state_space.pade import pade_ladder
from ...numerics.state_space.sampling import continuous_ends, sample_ends, split_dead_time
from ..operands import plain
from ..operators import DelayOperators
from ..parts import matrices_of

MAX_PADE_ORDER = 20

IN_BAND = 0.1
"""Fraction of the Nyquist frequency up to which the error of a sampled loop is reported."""


class InsideConversions(DelayOperators):
    """Conversions of continuous systems."""

    def pade(self, order: int = 5) -> ct.StateSpace:
        """Replace each delay by its diagonal Pade approximant.

        Parameters
        ----------
        order : int, optional
            1...20, for each delay; see `design.pade_ss`.

        Returns
        -------
        control.StateSpace
            Continuous, with the names of this system.

        Raises
        ------
        UnsuitableSystemError
            A discrete system.
        """
        if self.dt:
            raise UnsuitableSystemError(
                f"{self.name!r} is discrete; ct.ss(sys) represents its delays exactly, as states"
            )
        count = integer(order, "order", 1, MAX_PADE_ORDER)
        form = self._form()
        opened = DelayForm(form.A, form.B, form.C, form.D)
        m, p, q = form.inputs, form.outputs, len(form.delays)
        for i, tau in enumerate(form.delays):
            opened = forms.append(opened, DelayForm(*pade_ladder(tau, count)))
            # z_i goes into the approximant, whose output is w_i
            gain = np.zeros((opened.inputs, opened.outputs))
            gain[-1, p + i] = gain[m + i, -1] = 1.0
            opened = forms.wired(opened, gain, slice(p + q), slice(m + q))
        made = plain(forms.through(opened, np.eye(p, p + q), np.eye(m, m + q).T), 0)
        made.update_names(inputs=self.input_labels, outputs=self.output_labels)
        return made

    def to_discrete(self, dt: float) -> Any:
        """Zero-order-hold equivalent.

        Exact for delays at the inputs, as in a plant with dead time, at the outputs, or in parallel
        paths, each of its own and not necessarily of whole samples; fractions of a sample may be
        left at inputs or at outputs. A loop with dead time has no exact sampled model of finite
        order: the signals at the inputs of its delays are interpolated linearly between samples,
        and a warning states the error.

        Parameters
        ----------
        dt : float
            Sample time in s.

        Returns
        -------
        DelayedStateSpace or DelaySystem

        Raises
        ------
        DelayRangeError
            Delays in a loop that are not whole samples, or different fractions of a sample at
            several inputs as well as several outputs.
        UnsuitableSystemError
            A discrete system, or a fractional delay with direct feedthrough.

        Warns
        -----
        ModelWarning
            Delays in a loop.

        Examples
        --------
        >>> import control as ct
        >>> import ctrl_realize as cr
        >>> plant = ct.tf([1], [0.08, 1]) * cr.delay(0.025)
        >>> plant.to_discrete(0.01)
        <DelayedStateSpace: u -> y, order 1, z^-3 (0.03 s), dt = 0.01 s>
        """
        if self.dt:
            raise UnsuitableSystemError(f"{self.name!r} is already discrete")
        step = positive(dt, "dt", "sample time in s")
        names = self.input_labels, self.output_labels
        base: dict[str, Any] = {"dt": step, "time_unit": self.time_unit}
        if (paths := paths_apart(self._form())) is not None:
            return self._joined(_paths_sampled(paths, step), *names, **base)
        before, behind, rest = ends_apart(self._form())
        rest = _held_apart(rest)
        ends = before, behind, rest.delays
        entry, exit_, inner = ([_samples(tau, step) for tau in end] for end in ends)
        # not driven by states or by outputs of other delays
        below = slice(rest.outputs, None)
        driven = np.hstack([rest.C[below], rest.D[below, rest.inputs :]])
        held = np.asarray(~driven.any(axis=1))
        core = _held(rest, step, held)
        form = forms.delayed_ends(replace(core, delays=tuple(map(float, inner))), entry, exit_)
        made = self._joined(form, *names, **base)
        if not held.all():
            self._state_error(made, step)
        return made

    def to_continuous(self) -> Any:
        """Invert `to_discrete`, for a discrete system without delays in loops.

        Each delay in a path of its own is converted with the core, see `design.to_continuous`,
        which is for systems with delays at inputs and outputs alone.

        Returns
        -------
        DelaySystem
            Continuous; sampled with its hold it is this system.

        Raises
        ------
        UnsuitableSystemError
            A continuous system, or one with a delay in a loop: what is between the samples of a
            loop that is closed in discrete time no continuous system has. A pole at z = 0 or on the
            negative real axis.

        Examples
        --------
        >>> import control as ct
        >>> import ctrl_realize as cr
        >>> plant = ct.tf([1], [0.08, 1]) * cr.delay(0.02) + ct.tf([2], [0.3, 1]) * cr.delay(0.055)
        >>> plant.to_discrete(0.01).to_continuous()
        <DelaySystem: u -> y, order 2, internal delays 0.02, 0.055 s, continuous>
        """
        if not self.dt:
            raise UnsuitableSystemError(f"{self.name!r} is already continuous")
        return continuous(self)

    def sample(
        self, Ts: float, method: str = "zoh", *, name: str | None = None, **settings: Any
    ) -> Any:
        """Sample with a zero-order hold, for `control.sample_system`; see `to_discrete`.

        Raises
        ------
        OptionError
            Another method: poles of a bilinear transformation are no samples of a dead time.
        """
        if method != "zoh":
            raise OptionError(
                f"method={method!r}; expected 'zoh': the response of a dead time is sampled exactly"
            )
        made = self.to_discrete(Ts)
        made.update_names(name=name or f"{self.name}$sampled")
        return made

    def _state_error(self, made: Any, step: float) -> None:
        omega = np.linspace(0, IN_BAND * np.pi / step, 60)[1:]
        ours = self.horner(1j * omega, warn_infinite=False)
        # frequency response of the hold alone
        hold = -np.expm1(-1j * omega * step) / (1j * omega * step)
        theirs = made.horner(np.exp(1j * omega * step), warn_infinite=False)
        error = np.abs(theirs - ours * hold).max(initial=0.0)
        warn_caller(
            f"a loop with dead time has no exact sampled model: up to a tenth of the Nyquist "
            f"frequency ({omega[-1]:.3g} rad/s) the error of the response is at most {error:.2g}, "
            f"for a largest value of {np.abs(ours).max(initial=0.0):.3g}; use a shorter dt, or, "
            "for a discrete controller, sample the plant and close the loop in discrete time",
            ModelWarning,
        )


def continuous(system: DelayOperators) -> Any:
    """Invert the hold of a discrete system whose delays are in paths of their own."""
    if (paths := paths_apart(system._form())) is None:
        raise UnsuitableSystemError(
            f"{system.name!r} has delays in a loop that is closed in discrete time, which no "
            "continuous system has; convert the plant, cr.design.to_continuous(plant).system, "
            "and close the loop around it"
        )
    core, before, behind, left, right = paths
    check_logarithm(core.A)
    whole = [[int(tau) for tau in end] for end in (before, behind)]
    found, entry, exit_ = continuous_ends(matrices_of(core), float(system.dt), *whole)
    made = forms.through(forms.delayed_ends(DelayForm(*found), entry, exit_), left, right)
    base: dict[str, Any] = {"dt": 0.0, "time_unit": system.time_unit}
    return system._joined(made, system.input_labels, system.output_labels, **base)


def check_logarithm(A: FloatArray) -> None:
    """Refuse a sampled core whose poles no continuous one has.

    Raises
    ------
    UnsuitableSystemError
    """
    poles = np.linalg.eigvals(A)
    # Rounding may move a negative real pole slightly off the axis.
    bad = poles[(np.abs(poles) < 1e-12) | ((np.abs(poles.imag) < 1e-9) & (poles.real < 0))]
    if bad.size:
        raise UnsuitableSystemError(
            f"the core has a pole at z = {complex(bad[0]):.6g}, which no continuous system of "
            "this order has with a zero-order hold. A lower order often has none "
            "(design.reduce), and so has a fit of dead time and lags (design.reduce_fopdt "
            "with method='optimal')"
        )


def _paths_sampled(paths: Paths, step: float) -> DelayForm:
    """Sample a core with a delay at each end, between gains."""
    core, before, behind, left, right = paths
    shares = [np.array([split_dead_time(tau, step)[1] for tau in end]) for end in (before, behind)]
    if behind.size == 1 or (shares[0].any() and shares[1].any()):
        # what all outputs, or inputs, have in common may stand at the other end
        common = shares[1][0] * step if np.allclose(shares[1], shares[1][0]) else 0.0
        common = float(behind[0]) if behind.size == 1 else common
        if not common and np.allclose(shares[0], shares[0][0]):
            common = -shares[0][0] * step
        before, behind = before + common, behind - common
    shares = [np.array([split_dead_time(tau, step)[1] for tau in end]) for end in (before, behind)]
    if shares[0].any() and shares[1].any():
        raise DelayRangeError(
            f"delays of {before} s at the inputs and {behind} s at the outputs are different "
            f"fractions of a sample of {step:g} s at both ends; choose dt so that it divides "
            "those of one end"
        )
    jumps = (core.D != 0) & ((shares[0] > 0) | (shares[1] > 0)[:, None])
    if jumps.any():
        i, j = np.argwhere(jumps)[0]
        raise UnsuitableSystemError(
            f"with direct feedthrough, the output jumps between two samples: the delay is "
            f"{(before[j] + behind[i]) / step:.6g} samples of {step:g} s; choose dt so that it is "
            "a whole number"
        )
    sampled, *whole = sample_ends(matrices_of(core), step, before, behind)
    ends = (tuple(map(float, end)) for end in whole)
    return forms.through(forms.delayed_ends(DelayForm(*sampled), *ends), left, right)


def _samples(tau: float, step: float) -> int:
    samples, fraction = split_dead_time(tau, step)
    if fraction:
        raise DelayRangeError(
            f"a delay of {tau:g} s is {tau / step:.6g} samples of {step:g} s; several channels and "
            "loops need whole samples: choose dt so that it divides all delays"
        )
    return samples


def _held_apart(form: DelayForm) -> DelayForm:
    """Split delays driven by inputs: a signal held before a delay is also held after it."""
    m, p, q = form.inputs, form.outputs, len(form.delays)
    split = [i for i in range(q) if np.any(form.D[p + i, :m]) and np.any(form.C[p + i])]
    wide = form.channels([*range(q), *split])
    wide.D[[p + i for i in split], :m] = 0.0
    wide.C[p + q :], wide.D[p + q :, m:] = 0.0, 0.0
    return wide


def _held(form: DelayForm, step: float, held: BoolArray) -> DelayForm:
    """Sample a core with inputs held and outputs of delays linear between samples.

    With w(t) = w0 + (w1 - w0) t / h the state x - G2 w of the first-order hold moves w1 into C and
    D (Franklin, Powell and Workman, section 6.3.2).
    """
    n, m, q = form.states, form.inputs, len(form.delays)
    width = m + q
    M = np.zeros((n + 2 * width, n + 2 * width))
    M[:n, :n], M[:n, n : n + width] = form.A * step, form.B * step
    M[n : n + width, n + width :] = np.eye(width)
    E = np.asarray(expm(M), dtype=np.float64)
    A, whole_step, ramp = E[:n, :n], E[:n, n : n + width], E[:n, n + width :]
    B = whole_step.copy()
    D = form.D.copy()
    late = ramp[:, m:] * ~held
    B[:, m:] = whole_step[:, m:] - late + A @ late
    D[:, m:] = D[:, m:] + form.C @ late
    return DelayForm(A, B, form.C, D, form.delays)
