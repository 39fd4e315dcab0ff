"""Rational and sampled systems in place of a continuous one with dead time."""

from __future__ import annotations

from typing import Any

import control as ct
import numpy as np
from scipy.linalg import expm

from ..._checks import integer, positive
from ...errors import DelayRangeError, ModelWarning, OptionError, UnsuitableSystemError, warn_caller
from ...numerics.arrays import FloatArray
from ...numerics.internal_delays import form as forms
from ...numerics.internal_delays.form import DelayForm
from ...numerics.internal_delays.merging import ends_apart
from ...numerics.state_space.fractional_delay import pade_ladder
from ...numerics.state_space.sampling import sample_with_dead_time, split_dead_time
from ..operands import plain
from ..operators import DelayOperators

MAX_PADE_ORDER = 20

IN_BAND = 0.1
"""Fraction of the Nyquist frequency up to which the error of a sampled loop is reported."""


class InsideConversions(DelayOperators):
    """Conversions of continuous systems."""

    internal_delays: tuple[float, ...]

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
            opened = forms.closed(opened, gain)
            keep_in, keep_out = np.eye(m + q, opened.inputs), np.eye(p + q, opened.outputs)
            opened = forms.through(opened, keep_out, keep_in.T)
        ends = forms.through(opened, np.eye(p, p + q), np.eye(m, m + q).T)
        made = plain(ends, 0)
        made.update_names(inputs=self.input_labels, outputs=self.output_labels)
        return made

    def to_discrete(self, dt: float) -> Any:
        """Zero-order-hold equivalent.

        Exact for delays at the inputs, as in a plant with dead time, or at the outputs. The delay
        of a system with one input and one output need not be a whole number of samples. A loop
        with dead time has no exact sampled model of finite order: the signals at the inputs of its
        delays are interpolated linearly between samples, and a warning states the error.

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
            Delays in a loop or of several channels that are not whole samples.
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
        before, behind, rest = ends_apart(self._form())
        names = self.input_labels, self.output_labels
        if rest.inputs == rest.outputs == 1 and not rest.delays:
            return self._sampled_single(rest, before[0] + behind[0], step)
        rest = _held_apart(rest)
        whole_ones = [_samples(tau, step) for tau in (*before, *behind, *rest.delays)]
        inputs = rest.inputs
        entry, exit_ = whole_ones[:inputs], whole_ones[inputs : inputs + rest.outputs]
        inner = tuple(float(d) for d in whole_ones[inputs + rest.outputs :])
        held = [not np.any(row) for row in _not_held(rest)]
        core = _held(rest, step, held)
        ends = forms.delayed_ends(
            core.A, core.B, core.C, core.D,
            (*entry, *[0.0] * len(inner)), (*exit_, *[0.0] * len(inner)),
        )  # fmt: skip
        form = _closed_again(ends, inner)
        made = self._joined(form, step, *names)
        if not all(held):
            self._state_error(made, step)
        return made

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

    def _sampled_single(self, core: DelayForm, tau: float, step: float) -> Any:
        fraction = split_dead_time(tau, step)[1]
        if fraction and np.any(core.D):
            raise UnsuitableSystemError(
                f"with direct feedthrough, the output jumps between two samples: the delay is "
                f"{tau / step:.6g} samples of {step:g} s; choose dt so that it is a whole number"
            )
        A, B, C, D, samples = sample_with_dead_time(core.A, core.B, core.C, core.D, step, tau)
        form = forms.delayed_ends(A, B, C, D, (float(samples),), (0.0,))
        return self._joined(form, step, self.input_labels, self.output_labels)

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
    C, D = form.C.copy(), form.D.copy()
    C_more, D_more = np.zeros((len(split), form.states)), D[[p + i for i in split]].copy()
    D_more[:, m:] = 0.0
    for i in split:
        D[p + i, :m] = 0.0
    columns = [m + i for i in split]
    D = np.vstack([D, D_more])
    D = np.hstack([D, D[:, columns]])
    return DelayForm(
        form.A,
        np.hstack([form.B, form.B[:, columns]]),
        np.vstack([C, C_more]),
        D,
        (*form.delays, *(form.delays[i] for i in split)),
    )


def _not_held(form: DelayForm) -> FloatArray:
    """Inputs of each delay that are not held: states and outputs of other delays."""
    below = slice(form.outputs, None)
    return np.hstack([form.C[below], form.D[below, form.inputs :]])


def _held(form: DelayForm, step: float, held: list[bool]) -> DelayForm:
    """Sample a core with inputs held and outputs of delays linear between samples.

    With w(t) = w0 + (w1 - w0) t / h the state x - G2 w of the first-order hold moves w1 into C and
    D (Franklin, Powell and Workman, section 6.3.2).
    """
    n, m, q = form.states, form.inputs, len(form.delays)
    width = m + q
    M = np.zeros((n + 2 * width, n + 2 * width))
    M[:n, :n], M[:n, n : n + width] = form.A * step, form.B * step
    M[n : n + width, n + width :] = np.eye(width)
    E = _exponential(M)
    A, whole_step, ramp = E[:n, :n], E[:n, n : n + width], E[:n, n + width :]
    B = whole_step.copy()
    D = form.D.copy()
    late = ramp[:, m:] * ~np.array(held, dtype=bool)
    B[:, m:] = whole_step[:, m:] - late + A @ late
    D[:, m:] = D[:, m:] + form.C @ late
    return DelayForm(A, B, form.C, D, form.delays)


def _exponential(M: FloatArray) -> FloatArray:
    return np.asarray(expm(M), dtype=np.float64)


def _closed_again(form: DelayForm, inner: tuple[float, ...]) -> DelayForm:
    """Close the last inputs and outputs of a form through additional delays."""
    q = len(inner)
    m, p, own = form.inputs - q, form.outputs - q, len(form.delays)
    columns = [*range(m), *range(m + q, m + q + own), *range(m, m + q)]
    rows = [*range(p), *range(p + q, p + q + own), *range(p, p + q)]
    return DelayForm(
        form.A,
        form.B[:, columns],
        form.C[rows],
        form.D[np.ix_(rows, columns)],
        (*form.delays, *inner),
    )
