"""Methods of python-control systems, computed from core and delays.

``sys.step_response(...)`` and similar are methods of every linear system of python-control. The
functions of the same names use the matrices, which takes longer for longer delays; the methods here
simulate with delay lines.
"""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Mapping
from contextlib import suppress
from typing import Any

import control as ct
import numpy as np
from numpy.typing import ArrayLike

from .._checks import finite, not_negative
from ..errors import DataError, UnsuitableSystemError
from ..numerics.arrays import ComplexArray, FloatArray, IntArray
from ..numerics.internal_delays.equation import Signal
from ..numerics.internal_delays.form import DelayForm
from ..numerics.state_space.responses import Schur, schur_form
from .host_margins import HostMargins
from .parts import settled_values

PLAIN = frozenset({"squeeze", "transpose"})
"""Arguments of python-control's responses that need no states."""

FEWEST, MOST = 20, 5000
"""Samples of a response whose length is not given, as in python-control."""

LONGEST = 1_000_000
"""Samples of a step response whose rise and settling times are computed, at most."""

DOUBLINGS = 6
"""Lengths that are tried of a response that settles late."""

ON_CIRCLE = 1e-8
"""Distance of a pole to the unit circle below which it counts as on it, as in python-control."""


class HostResponses(HostMargins):
    """Time responses without matrices."""

    _core: ct.StateSpace
    _schur: Schur | None = None
    _stepped: tuple[DelayForm, IntArray] | None = None

    @abstractmethod
    def _values(self, schur: Schur, points: ComplexArray) -> ComplexArray:
        """Transfer matrix (p, m, K), with the Schur form of the core's A."""

    @abstractmethod
    def _simulated(self, inputs: FloatArray, state: FloatArray | None = None) -> FloatArray:
        """Compute the outputs (p, N) from zero initial state, or from a given one."""

    @abstractmethod
    def dominant_poles(self, count: int = 10) -> ComplexArray:
        """Compute the poles that decay most slowly, or grow fastest."""

    def _next_state(self, t: Any, x: Any, u: Any, params: Any) -> FloatArray:
        """Shift the delay lines, for `control.input_output_response` and interconnections."""
        if not self.dt:
            return super()._next_state(t, x, u, params)
        form, state, drive, first = self._driven(x, u)
        n, p = form.states, form.outputs
        out = np.empty(self.nstates)
        out[n + 1 :] = state[n:-1]
        out[first] = form.C[p:] @ state[:n] + form.D[p:] @ drive
        out[:n] = form.A @ state[:n] + form.B @ drive
        return out

    def _output(self, t: Any, x: Any, u: Any, params: Any) -> FloatArray:
        if not self.dt:
            return super()._output(t, x, u, params)
        form, state, drive, _ = self._driven(x, u)
        p = form.outputs
        return np.asarray(form.C[:p] @ state[: form.states] + form.D[:p] @ drive)

    def _driven(self, x: Any, u: Any) -> tuple[DelayForm, FloatArray, FloatArray, IntArray]:
        """Form, state, inputs of the core, and where the delay lines begin in the state."""
        if self._stepped is None:
            made = self._form()
            lengths = np.array(made.delays, dtype=np.int64)
            self._stepped = made, made.states + np.cumsum(lengths) - lengths
        form, first = self._stepped
        state = np.atleast_1d(np.asarray(x, dtype=np.float64))
        last = np.append(first[1:], self.nstates)[: first.size] - 1
        given = np.atleast_1d(np.asarray(u, dtype=np.float64))
        return form, state, np.concatenate([given, state[last]]), first

    def horner(self, x: ArrayLike, warn_infinite: bool = True) -> ComplexArray:
        """Evaluate the transfer matrix, shape (outputs, inputs, K).

        See `control.StateSpace.horner`; the cost does not grow with the delays.
        """
        points = np.atleast_1d(np.asarray(x, dtype=np.complex128))
        if points.ndim > 1:
            raise ValueError("input list must be 1D")
        if self._schur is None:
            self._schur = schur_form(self._core.A, self._core.B)
        values = self._values(self._schur, points)
        return settled_values(values, points, warn_infinite=warn_infinite)

    def simulate(self, inputs: ArrayLike) -> FloatArray:
        """Compute the response to any input from zero initial state, sample by sample.

        Parameters
        ----------
        inputs : array_like, shape (N,) or (inputs, N)

        Returns
        -------
        ndarray, shape (N,) or (outputs, N)

        Raises
        ------
        DataError
            A wrong number of inputs, or values that are not finite real numbers.
        UnsuitableSystemError
            A continuous system.
        """
        self._refuse_continuous("forced_response")
        given = finite(inputs, "inputs")
        rows = np.atleast_2d(given)
        if rows.ndim != 2 or rows.shape[0] != self.ninputs:
            raise DataError(
                f"inputs has shape {given.shape}; expected ({self.ninputs}, N)"
                + (" or (N,)" if self.ninputs == 1 else "")
            )
        out = self._simulated(rows)
        return out[0] if self.issiso() and given.ndim == 1 else out

    def _refuse_continuous(self, instead: str) -> None:
        if not self.dt:
            raise UnsuitableSystemError(
                f"{self.name!r} is continuous and has no samples; use sys.{instead}(timepts)"
            )

    def forced_response(
        self,
        timepts: ArrayLike | None = None,
        inputs: Any = 0.0,
        initial_state: ArrayLike = 0.0,
        **settings: Any,
    ) -> ct.TimeResponseData:
        """Compute the response to any input, see `control.forced_response`.

        Parameters
        ----------
        timepts : array_like
            Times in s, increasing from 0 (continuous time), or every sample.
        inputs : array_like or callable
            Values at these times, linear between them in continuous time; or a function of an
            array of K times that returns values of shape (inputs, K).
        initial_state : array_like, optional
            In discrete time of all states: those of the core, then the past samples, in the order
            of ``state_labels``; in continuous time of the core.
        **settings
            ``squeeze`` and ``transpose``, also of `inputs`; in discrete time those of
            `control.forced_response` (if the states are requested, python-control simulates with
            the matrices). In continuous time also ``history``, the constant input of each delay
            before time 0 (default 0); and ``tolerance``, the largest error relative to the largest
            output (1e-8).

        Returns
        -------
        control.TimeResponseData

        Notes
        -----
        In continuous time the delay differential equation is solved by the method of steps, with
        all breaking points; all steps are halved until the result no longer changes [1]_.

        References
        ----------
        .. [1] A. Bellen and M. Zennaro, Numerical Methods for Delay Differential Equations, Oxford
           University Press 2003, chapters 2 and 3, doi:10.1093/acprof:oso/9780198506546.001.0001.
        """
        return self._responded("forced", timepts, inputs, initial_state, settings)

    def initial_response(
        self,
        timepts: ArrayLike | float | None = None,
        initial_state: ArrayLike = 0.0,
        **settings: Any,
    ) -> ct.TimeResponseData:
        """Compute the response to an initial state, see `control.initial_response`.

        In discrete time of all states, as in `forced_response`; in continuous time of the core,
        with ``history`` and ``tolerance`` as in `forced_response`.
        """
        return self._responded("initial", timepts, 0.0, initial_state, settings)

    def step_response(
        self,
        timepts: ArrayLike | float | None = None,
        initial_state: ArrayLike = 0.0,
        **settings: Any,
    ) -> ct.TimeResponseData:
        """Compute the step responses, see `control.step_response`.

        Without `timepts` until the slowest pole has decayed; in discrete time to a thousandth, for
        5000 samples at most. In continuous time from zero initial state, at equal times that show
        the fastest of the dominant poles, and later at fewer ones where the slowest takes far
        longer; ``tolerance`` is accepted as in `forced_response`, and of the arguments of
        `control.step_response` ``timepts_num``, ``input_indices`` and ``output_indices``.
        """
        return self._responded("step", timepts, 1.0, initial_state, settings)

    def step_info(self, timepts: ArrayLike | float | None = None, **settings: Any) -> Any:
        """Compute rise time, settling time, overshoot and so on, see `control.step_info`.

        Parameters
        ----------
        timepts : array_like or float, optional
            Times of the step response, or its end. Default: until it has settled, and at least
            until the slowest pole has decayed.
        **settings
            ``SettlingTimeThreshold`` and ``RiseTimeLimits`` of `control.step_info`, and ``T``, its
            former name of `timepts`.

        Returns
        -------
        dict, or list of lists of dict for several channels

        Raises
        ------
        UnsuitableSystemError
            A system that is not stable; a response that ends before it has risen, or one that
            takes more than a million samples to settle.

        Examples
        --------
        >>> import control as ct
        >>> import ctrl_realize as cr
        >>> plant = cr.delayed_ss(ct.tf([1], [50, 1]), dead_time=1000, dt=1.0)
        >>> found = plant.step_info()
        >>> found["RiseTime"], found["SettlingTime"]
        (110.0, 1196.0)
        """
        timepts = settings.pop("T", timepts)
        if not self.issiso():
            rows, columns = range(self.noutputs), range(self.ninputs)
            return [[self[i, j].step_info(timepts, **settings) for j in columns] for i in rows]
        final = float(np.real(self.dcgain()))
        if not (np.isfinite(final) and self.is_stable()):
            raise UnsuitableSystemError(
                f"{self.name!r} is not stable, so its step response has no final value; expected "
                "a stable system. Look at sys.step_response(t)"
            )
        searched = timepts is None and final != 0
        chosen = np.ndim(timepts) == 0 and not self.dt and final != 0
        if timepts is None and self.dt:
            count = self._settling_samples(LONGEST)
            if count == LONGEST:
                raise UnsuitableSystemError(
                    f"{self.name!r} takes more than {LONGEST} samples to settle; give the end of "
                    "the response in s, sys.step_info(end), or use a longer sample time"
                )
            timepts = self._times(None, count)
        for _ in range(DOUBLINGS):
            response, found = self.step_response(timepts), None
            with suppress(IndexError), np.errstate(divide="ignore", invalid="ignore"):
                # divides by a final value of 0; a response that has not risen has no index
                found = ct.step_info(response.outputs, response.time, yfinal=final, **settings)
            settled = found is not None and np.isfinite(found["SettlingTime"])
            if settled or not searched or 2 * response.time.size > LONGEST:
                break
            # equal lags, or a zero, settle later than the slowest pole alone
            timepts = 2 * response.time[-1]
        if found is None:
            raise UnsuitableSystemError(
                f"the step response of {self.name!r} has not risen to its final value {final:.4g} "
                f"by {response.time[-1]:.6g} s; give a later end, sys.step_info(end)"
            )
        if chosen:  # behind a long dead time those of a plot are too far apart
            before = response.time[max(np.flatnonzero(response.outputs)[0] - 1, 0)]
            end = np.fmin(found["SettlingTime"], response.time[-1])
            times = np.union1d(response.time, np.linspace(before, end, MOST))
            outputs = self.step_response(times).outputs
            found = ct.step_info(outputs, times, yfinal=final, **settings)
        return found

    def impulse_response(
        self, timepts: ArrayLike | float | None = None, **settings: Any
    ) -> ct.TimeResponseData:
        """Compute the responses to pulses of height 1/dt, see `control.impulse_response`.

        In continuous time those to impulses, from zero initial state: the slope of the step
        response; impulses in the output are omitted. `timepts` as for `step_response`.
        """
        return self._responded("impulse", timepts, 1.0, 0.0, settings)

    def _responded(
        self, kind: str, timepts: Any, inputs: Any, state: ArrayLike, settings: dict[str, Any]
    ) -> ct.TimeResponseData:
        """Respond in discrete time; systems with internal delays do so in continuous time, too."""
        if set(settings) - PLAIN:
            given = {"forced": (inputs, state), "impulse": ()}.get(kind, (state,))
            return getattr(super(), f"{kind}_response")(timepts, *given, **settings)
        if kind == "forced":
            if callable(inputs):
                inputs = called(inputs, self.ninputs)(self._times(timepts, 0))
            inputs = laid_out(finite(inputs, "inputs"), settings)
            times = self._times(timepts, np.atleast_2d(inputs).shape[-1])
            rows = self._input_rows(inputs, times.size)
            outputs = self._simulated(rows, self._state(state))
            return self._data(times, outputs, inputs=rows, plot_inputs=True, **settings)
        times = self._all_times(timepts)
        if kind == "initial":
            rest = np.zeros((self.ninputs, times.size))
            return self._data(times, self._simulated(rest, self._state(state)), **settings)
        step, pulse = np.ones(times.size), np.eye(1, times.size)[0] / self.dt
        drive, outputs = self._one_by_one(step if kind == "step" else pulse, self._state(state))
        return self._unit_responses(times, outputs, drive, kind, **settings)

    def _one_by_one(
        self, signal: FloatArray, state: FloatArray | None = None
    ) -> tuple[FloatArray, FloatArray]:
        """Drive each input alone: inputs (inputs, trace, N) and outputs (outputs, trace, N)."""
        drive = np.eye(self.ninputs)[:, :, None] * signal
        every = [self._simulated(drive[:, j], state) for j in range(self.ninputs)]
        return drive, np.stack(every, axis=1)

    def _unit_responses(
        self, times: FloatArray, outputs: FloatArray, drive: FloatArray, kind: str, **settings: Any
    ) -> ct.TimeResponseData:
        """Response data, one trace for each input, as python-control makes them."""
        labels = [f"From {label}" for label in self.input_labels]
        traces = {"trace_labels": labels, "trace_types": [kind] * self.ninputs}
        inputs = drive if kind == "step" else None
        return self._data(times, outputs, inputs, plot_inputs=False, **traces, **settings)

    def _times(self, timepts: ArrayLike | None, count: int) -> FloatArray:
        """Check that times are all samples from 0, or make as many as there are inputs."""
        if timepts is None:
            return np.asarray(np.arange(count) * float(self.dt), dtype=np.float64)
        times = finite(timepts, "timepts")
        expected = np.arange(times.size) * float(self.dt)
        if times.ndim != 1 or not np.allclose(times, expected, rtol=0, atol=1e-6 * self.dt):
            raise DataError(
                f"timepts must be every sample from 0, each {self.dt:g} s; control.forced_response "
                "takes other times"
            )
        return times

    def _all_times(self, timepts: ArrayLike | float | None) -> FloatArray:
        """Check the given times, or make those up to an end or until the response has settled."""
        dt = float(self.dt)
        if timepts is None:
            count = self._settling_samples()
        elif np.size(timepts) == 1:
            end = not_negative(np.asarray(timepts).item(), "timepts", "time in s")
            count = int(end / dt) + 1
        else:
            return self._times(timepts, 0)
        return self._times(None, count)

    @abstractmethod
    def is_stable(self) -> bool:
        """Whether all poles are inside the stability region."""

    def _settling_samples(self, most: int = MOST) -> int:
        poles = self.dominant_poles(10)
        poles = poles[np.abs(poles) > ON_CIRCLE]
        rates = np.abs(np.log(np.abs(poles)))
        # an integrator, or an oscillation, is seen for five times as long as the rest
        lasting = rates < ON_CIRCLE
        slow = float(np.max(np.log(1000) / rates[~lasting], initial=0.0))
        delay = self.features()[1] / float(self.dt)
        count = (slow + delay) * (5 if lasting.any() else 1)
        return int(np.clip(np.ceil(count) + 1, FEWEST, most))

    def _state(self, given: ArrayLike) -> FloatArray | None:
        """Check an initial state; None if it is zero."""
        return spread(given, self.nstates, "initial_state") if np.any(given) else None

    def _input_rows(self, given: ArrayLike, count: int) -> FloatArray:
        """Check inputs for `count` times; one number is for all of them."""
        rows, shape = np.atleast_2d(finite(given, "inputs")), (self.ninputs, count)
        if rows.size != 1 and rows.shape != shape:
            raise DataError(f"inputs has shape {np.shape(given)}; expected {shape}")
        return np.ascontiguousarray(np.broadcast_to(rows, shape))

    def _data(
        self, times: FloatArray, outputs: FloatArray, inputs: FloatArray | None = None, **more: Any
    ) -> ct.TimeResponseData:
        """Response data with the names of this system."""
        return ct.TimeResponseData(
            times,
            outputs,
            inputs=inputs,
            issiso=self.issiso(),
            input_labels=None if inputs is None else self.input_labels,
            output_labels=self.output_labels,
            sysname=self.name,
            **more,
        )


def called(given: Signal, count: int) -> Signal:
    """Make the signal of a function, whose values may have another shape for one input."""
    return lambda t: np.asarray(given(t), dtype=np.float64).reshape(count, t.size)


def laid_out(inputs: Any, settings: Mapping[str, Any]) -> Any:
    """Inputs with a row for each signal; a response that is transposed has columns."""
    return np.transpose(inputs) if settings.get("transpose") else inputs


def spread(given: ArrayLike, count: int, name: str) -> FloatArray:
    """Return `count` values; one number is for all of them."""
    values = np.ravel(finite(given, name))
    if values.size not in (1, count):
        raise DataError(f"{name} has {values.size} values; expected {count}")
    return np.broadcast_to(values, count).astype(np.float64)
