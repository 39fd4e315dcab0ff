"""Controllers with a delay line of their own past outputs.

Smith predictors and predictor state feedback share one structure: a few inner states and the last
outputs u[k-1] ... u[k-d], which have not yet acted on the plant.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from .._shown import Card, ShownSystem
from .._wording import in_time
from ..data.shown_units import in_shown_units
from ..delayed.chains import past_of
from ..delayed.operators import DelayOperators
from ..numerics.arrays import ComplexArray, FloatArray, read_only
from ..numerics.internal_delays.form import DelayForm
from ..numerics.state_space.line_sums import CHUNK, LineSum
from ..numerics.state_space.responses import frequency_response, schur_form

Pulses = tuple[FloatArray, FloatArray, FloatArray]
"""A (n, n), B (n, 1) and C (rows, n) of a pulse response."""

DIES_OUT = 0.999999
"""Largest pole of a response that may be computed as the difference of two infinite ones."""


class DelayLineController(ShownSystem, DelayOperators):
    """Discrete controller with a delay line of its past outputs; a `control.StateSpace`.

    States ``[x; u[k-1] ... u[k-d]]``; with v the line::

        x[k+1] = A x + B e + E v
        u[k]   = C x + D e + h v

    The frequency response is computed from this structure, so it is exact and fast at any d. The
    matrices with all states are computed on demand, up to 20 000 states.

    Parameters
    ----------
    A, B, C, D : ndarray, shapes (n, n), (n, 1), (1, n), (1, 1)
    E, h : ndarray, shapes (n, d), (1, d)
    dt : float
        Sample time in s.
    name : str
    inputs, outputs : str
    pulses : tuple of ndarray, optional
        ``(A_p, B_p, C_p)`` where column i of ``[E; h]`` is ``C_p A_p^(i-1) B_p`` for all but the
        last, as for predictors: long delay lines are then evaluated in closed form.

    Attributes
    ----------
    line_length : int
        d.
    inner_poles : ndarray, shape (n,)
        Eigenvalues of A. They are not the controller's poles, because the delay line closes a loop.

    Raises
    ------
    DelayRangeError
        A, B, C or D with more than 20 000 states.

    Examples
    --------
    >>> import control as ct
    >>> import ctrl_realize as cr
    >>> plant = cr.delayed_ss(ct.tf([1], [0.08, 1]), dead_time=0.1, dt=0.01)
    >>> predictor = cr.design.smith_predictor(plant, ct.tf([2.0, -1.8], [1, -1], 0.01))
    >>> print(predictor.line_length, predictor.inner_poles.real.round(4))
    10 [1.     0.8825]
    """

    def __init__(
        self,
        A: FloatArray,
        B: FloatArray,
        C: FloatArray,
        D: FloatArray,
        E: FloatArray,
        h: FloatArray,
        dt: float,
        *,
        name: str,
        inputs: str = "e",
        outputs: str = "u",
        pulses: Pulses | None = None,
    ) -> None:
        n, d = E.shape
        self._begin(n, n + d, float(dt), name=name, inputs=[inputs], outputs=[outputs])
        self._parts = tuple(read_only(M) for M in (A, B, C, D, E, h))
        self._pulses = None if pulses is None else tuple(read_only(M) for M in pulses)
        self._schur = schur_form(self._parts[0])
        self._taps = LineSum(np.vstack([E, h]), pulses)
        self.line_length = d
        self.inner_poles: ComplexArray = np.diag(self._schur[0]).copy()
        self._locked = True

    def _make_matrices(self) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
        A, B, C, D, E, h = self._parts
        n, d = E.shape
        full_A = np.zeros((n + d, n + d))
        full_A[:n, :n], full_A[:n, n:] = A, E
        full_B, full_C = np.zeros((n + d, 1)), np.hstack([C, h])
        full_B[:n] = B
        if d:
            full_A[n, :n], full_A[n, n:], full_B[n] = C[0], h[0], D[0]
            full_A[np.arange(n + 1, n + d), np.arange(n, n + d - 1)] = 1.0
        return full_A, full_B, full_C, D.copy()

    def _name_states(self) -> list[str]:
        inner = [f"x[{i}]" for i in range(self.inner_poles.size)]
        return inner + past_of(self.output_labels, [self.line_length])

    def _without_matrices(self) -> str:
        return (
            "The controller's frequency response, design.margins, design.performance and "
            "design.delay_robustness need no matrices, given plant and controller one by one. "
            "cr.design.to_discrete(cr.design.to_continuous(plant), dt=...) samples the plant "
            "more slowly, for a controller with a shorter line"
        )

    def _form(self) -> DelayForm:
        """Core and delay: one delay if the line is the truncated response of stable modes.

        ``sum_i C_p A_p^(i-1) B_p u[k-i]`` over the line is the response of these modes to u, less
        what is left of it d samples later.
        """
        A, B, C, D, E, h = self._parts
        n, d = E.shape
        if d == 0 or self._pulses is None or _radius(self._pulses[0]) > DIES_OUT:
            return DelayForm(*self._make_matrices())
        A_p, B_p, C_p = self._pulses
        taps = np.vstack([E, h])
        power = np.linalg.matrix_power(A_p, d - 1) @ B_p
        last = taps[:, -1:] - C_p @ power
        r = A_p.shape[0]
        # states [x; x_p], inputs [e; w], outputs [u; z] with z = u and w = u[k-d]
        row = np.hstack([C, C_p[n:]]), np.hstack([D, last[n:]])
        full_A = np.block([[A, C_p[:n]], [np.zeros((r, n)), A_p]])
        full_B = np.block([[B, last[:n]], [np.zeros((r, 1)), -A_p @ power]])
        full_A[n:] += B_p @ row[0]
        full_B[n:] += B_p @ row[1]
        return DelayForm(full_A, full_B, np.vstack([row[0]] * 2), np.vstack([row[1]] * 2), (d,))

    def _line(self) -> str:
        return (
            f"<{type(self).__name__} {self.name!r}: order {self.inner_poles.size}, line of "
            f"{self.line_length} samples, dt = {self.dt:.6g} s>"
        )

    @in_shown_units
    def _card(self) -> Card:
        largest = float(np.abs(self.inner_poles).max(initial=0.0))
        line = f"{self.line_length} samples = {in_time(self.line_length * self.dt, 4)}"
        rows = [
            ("signals", f"{self.input_labels[0]} → {self.output_labels[0]}"),
            ("inner states", f"{self.inner_poles.size}, the slowest with |z| = {largest:.4g}"),
            ("line of past outputs", line),
            ("sample time", in_time(self.dt, 6)),
        ]
        return Card(f"Controller {self.name} with a delay line", rows)

    def report(self) -> str:
        """Describe the controller and its closed loop as plain text."""
        return self._card().text()

    def _made_by(self) -> tuple[Any, ...]:
        signals = {"inputs": self.input_labels[0], "outputs": self.output_labels[0]}
        settings = {"name": self.name, "pulses": self._pulses, **signals}
        return type(self), (*self._parts, self.dt), settings

    def paths(self, z: ComplexArray) -> tuple[ComplexArray, ComplexArray]:
        """Split the response into forward / back; the zeros of `back` are the controller's poles.

        Returns
        -------
        tuple of ndarray, shapes (K,), (K,)
            Forward, back.
        """
        A, B, C, D, _, _ = self._parts
        n = A.shape[0]
        forward, back = np.empty((2, z.size), dtype=np.complex128)
        inputs, direct = np.hstack([B, np.eye(n)]), np.hstack([D, np.zeros((1, n))])
        for start in range(0, z.size, CHUNK):
            part = slice(start, start + CHUNK)
            points = z[part]
            line = self._taps(points)
            # At an inner pole (z = 1 with a PI controller) both are infinite.
            with np.errstate(divide="ignore", invalid="ignore"):
                rows = frequency_response(self._schur, inputs, C, direct, points)[0]
                forward[part] = rows[0]
                back[part] = 1 - line[-1] - np.sum(rows[1:] * line[:-1], axis=0)
        return forward, back

    def horner(self, x: ArrayLike, warn_infinite: bool = True) -> ComplexArray:
        """Evaluate the controller at points of the z-plane, shape (1, 1, K)."""
        points = np.atleast_1d(np.asarray(x, dtype=np.complex128))
        with np.errstate(divide="ignore", invalid="ignore"):
            forward, back = self.paths(points)
            out = forward / back
        out[~np.isfinite(out)] = complex(np.inf, np.nan)
        return np.asarray(out[None, None, :], dtype=np.complex128)


def _radius(A: FloatArray) -> float:
    return float(np.abs(np.linalg.eigvals(A)).max(initial=0.0))
