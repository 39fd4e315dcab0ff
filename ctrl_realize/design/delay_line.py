"""Controllers that remember their own last outputs in a delay line.

Smith predictors and predictor state feedback share one structure: a few inner states and the
outputs u[k-1] ... u[k-d] that they have sent into the dead time.
"""

from __future__ import annotations

from html import escape
from typing import Any

import control as ct
import numpy as np
from numpy.typing import ArrayLike

from ..delayed import DelayedStateSpace
from ..numerics.arrays import ComplexArray, FloatArray, read_only
from ..numerics.state_space import frequency_response, schur_form
from ..results import as_asked, html_card
from ..wording import in_time

CHUNK = 2048
"""Frequencies that are evaluated together; bounds the memory of the powers z^-1 ... z^-d."""


class DelayLineController(ct.StateSpace):  # type: ignore[misc]  # control is untyped
    """Discrete controller with a line of its own past outputs; a `control.StateSpace`.

    States ``[x; u[k-1] ... u[k-d]]``; with v the line::

        x[k+1] = A x + B e + E v
        u[k]   = C x + D e + h v

    The frequency response is computed from this structure, so it stays exact and fast at any d.

    Parameters
    ----------
    A, B, C, D : ndarray, shapes (n, n), (n, 1), (1, n), (1, 1)
    E, h : ndarray, shapes (n, d), (1, d)
    dt : float
        Sample time in s.
    name : str
    inputs, outputs : str
    notes : dict
        What the designing function wants to keep with the controller: read-only attributes.

    Attributes
    ----------
    line_length : int
        d.
    inner_poles : ndarray, shape (n,)
        Eigenvalues of A. They are not the controller's poles: the line closes a loop around them.

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
        notes: dict[str, Any] | None = None,
    ) -> None:
        n, d = E.shape
        full_A = np.zeros((n + d, n + d))
        full_A[:n, :n], full_A[:n, n:] = A, E
        full_B, full_C = np.zeros((n + d, 1)), np.hstack([C, h])
        full_B[:n] = B
        if d:
            full_A[n, :n], full_A[n, n:], full_B[n] = C[0], h[0], D[0]
            full_A[np.arange(n + 1, n + d), np.arange(n, n + d - 1)] = 1.0
        super().__init__(
            full_A,
            full_B,
            full_C,
            D,
            float(dt),
            name=name,
            inputs=[inputs],
            outputs=[outputs],
            states=[f"x[{i}]" for i in range(n)] + [f"{outputs}[k-{i}]" for i in range(1, d + 1)],
            remove_useless_states=False,
        )
        for M in (self.A, self.B, self.C, self.D):
            M.flags.writeable = False
        self._parts = tuple(read_only(M) for M in (A, B, C, D, E, h))
        self._form = schur_form(self._parts[0])
        self._taps = _low_rank(np.vstack([E, h]))
        self.line_length = d
        self.inner_poles: ComplexArray = np.diag(self._form[0]).copy()
        self.notes: dict[str, Any] = dict(notes or {})

    def __getattr__(self, attribute: str) -> Any:
        notes = self.__dict__.get("notes", {})
        if attribute in notes:
            return notes[attribute]
        raise AttributeError(f"{type(self).__name__} has no attribute {attribute!r}")

    def __mul__(self, other: Any) -> Any:
        """Series: first `other`, then the controller. A plant with dead time keeps it."""
        return NotImplemented if isinstance(other, DelayedStateSpace) else super().__mul__(other)

    def __repr__(self) -> str:
        return as_asked(self)

    def _repr_info_(self, html: bool = False) -> str:
        line = self._line()
        return escape(line) if html else line

    def _line(self) -> str:
        # python-control's lists every matrix, of as many states as the line is long.
        return (
            f"<{type(self).__name__} {self.name!r}: order {self.inner_poles.size}, line of "
            f"{self.line_length} samples, dt = {self.dt:.6g} s>"
        )

    def __str__(self) -> str:
        return self._line()

    def _repr_html_(self) -> str:
        largest = float(np.abs(self.inner_poles).max(initial=0.0))
        rows = [
            ("signals", f"{self.input_labels[0]} → {self.output_labels[0]}"),
            ("inner states", f"{self.inner_poles.size}, the slowest with |z| = {largest:.4g}"),
            (
                "line of past outputs",
                f"{self.line_length} samples = {in_time(self.line_length * self.dt, 4)}",
            ),
            ("sample time", in_time(self.dt, 6)),
        ]
        return html_card(f"Controller {self.name} with a delay line", rows)

    def _repr_markdown_(self) -> None:
        return None

    def __reduce__(self) -> tuple[Any, ...]:
        return (
            _rebuild,
            (
                type(self),
                self._parts,
                self.dt,
                self.name,
                self.input_labels[0],
                self.output_labels[0],
                self.notes,
            ),
        )

    def __deepcopy__(self, memo: dict[int, Any]) -> DelayLineController:
        build, arguments = self.__reduce__()
        copy: DelayLineController = build(*arguments)
        return copy

    def paths(self, z: ComplexArray) -> tuple[ComplexArray, ComplexArray]:
        """Split the response into forward / back; the zeros of `back` are the controller's poles.

        Returns
        -------
        forward, back : ndarray, shape (K,)
        """
        A, B, C, D, _, _ = self._parts
        n = A.shape[0]
        mix, rows_of_line = self._taps
        forward = np.empty(z.size, dtype=np.complex128)
        back = np.empty(z.size, dtype=np.complex128)
        eye = np.eye(n)
        for start in range(0, z.size, CHUNK):
            part = slice(start, start + CHUNK)
            points = z[part]
            line = mix @ _in_powers(rows_of_line, 1 / points)
            # At an inner pole (z = 1 with a PI) both paths are infinite.
            with np.errstate(divide="ignore", invalid="ignore"):
                rows = frequency_response(
                    self._form, np.hstack([B, eye]), C, np.hstack([D, np.zeros((1, n))]), points
                )[0]
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


def _low_rank(rows: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Write rows = mix @ few; all rows of a predictor come from one or two taps of its line."""
    if rows.size == 0:
        return np.zeros((rows.shape[0], 0)), np.zeros((0, rows.shape[1]))
    U, s, V = np.linalg.svd(rows, full_matrices=False)
    rank = int(np.sum(s > 1e-15 * s[0])) if s[0] > 0 else 0
    return U[:, :rank] * s[:rank], V[:rank]


def _in_powers(rows: FloatArray, x: ComplexArray) -> ComplexArray:
    """Sum rows[:, i] x^(i+1) by Horner's rule, shape (rows, K)."""
    total = np.zeros((rows.shape[0], x.size), dtype=np.complex128)
    for column in rows.T[::-1]:
        total += column[:, None]
        total *= x
    return total


def _rebuild(
    kind: type[DelayLineController],
    parts: tuple[FloatArray, ...],
    dt: float,
    name: str,
    inputs: str,
    outputs: str,
    notes: dict[str, Any],
) -> DelayLineController:
    A, B, C, D, E, h = parts
    return kind(A, B, C, D, E, h, dt, name=name, inputs=inputs, outputs=outputs, notes=notes)
