r"""Arithmetic of measured frequency responses: propagation of errors, coherence and hold.

Errors are propagated to first order (JCGM 100:2008, GUM, section 5.1.2, for complex numbers with
circular errors): for a response *H* with standard deviation :math:`\sigma`, and *G* exact,

* :math:`G H` has :math:`|G| \sigma`, :math:`H + G` has :math:`\sigma`,
* :math:`1 / H` has :math:`\sigma / |H|^2`, :math:`H / (1 + K H)` has
  :math:`\sigma / |1 + K H|^2`,
* errors of two responses, and of different channels, are independent: variances are multiplied by
the
  square of the derivative and added.

Coherence is the share of the output's power that is explained by the input. It is not changed by an
exact factor or by inversion; that of sums and products of two responses depends on powers that are
not known.

If the input is held between the samples, the response contains one hold. It is kept by operations
that are linear in that response, cancels in a quotient of two, and occurs twice in a product.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import control as ct
import numpy as np

from .._checks import sample_time_of
from ..errors import DataError, warn_caller
from ..numerics.arrays import ComplexArray, FloatArray
from .frf_operands import (
    SAME,
    Operand,
    blocks,
    check_shapes,
    common_hold,
    last_axis,
    matmul,
    one_hold,
    power,
    same_time,
    warn_of_hold,
)


class FRFAlgebra(ct.FrequencyResponseData):  # type: ignore[misc]  # control is untyped
    """Operators of `MeasuredFRF`; names and channels are kept if the shape is."""

    coherence: FloatArray | None
    std: FloatArray | None
    repeats: float | None
    sample_time: float | None
    frequency_hz: FloatArray

    def _operand(self) -> Operand:
        shape = self.frdata.shape
        variance = None if self.std is None else self.std.reshape(shape) ** 2
        coherence = None if self.coherence is None else self.coherence.reshape(shape)
        known = variance, coherence, self.sample_time, self.repeats
        return Operand(self.frdata, *known, measured=True)

    def _other(self, other: Any) -> Operand | None:
        """Evaluate the other operand at the frequencies of this one; None if it is not a system."""
        if isinstance(other, ct.FrequencyResponseData):
            self._check_same_frequencies(other)
            measured = isinstance(other, FRFAlgebra)
            return other._operand() if measured else Operand(np.asarray(other.frdata))
        if isinstance(other, (ct.StateSpace, ct.TransferFunction)):
            dt = sample_time_of(other)
            points = np.exp(1j * self.omega * dt) if dt else 1j * self.omega
            return Operand(np.asarray(other(points, squeeze=False)))
        if isinstance(other, (int, float, complex, np.number)):
            return Operand(np.full((1, 1, 1), complex(other)))
        if isinstance(other, np.ndarray) and other.ndim <= 2 and other.dtype.kind in "biufc":
            return Operand(np.atleast_2d(other).astype(np.complex128)[:, :, None])
        return None

    def _needed(self, other: Any) -> Operand:
        two = self._other(other)
        if two is None:
            raise TypeError(f"{type(other).__name__} is not a system, number or matrix")
        return two

    def _check_same_frequencies(self, other: ct.FrequencyResponseData) -> None:
        one, two = self.omega, np.asarray(other.omega)
        if one.size != two.size or not np.allclose(one, two, rtol=SAME, atol=0):
            raise DataError(
                f"{self!r} and {other.name!r} have different frequencies ({two.size} points, "
                f"{two[0] / (2 * np.pi):g}...{two[-1] / (2 * np.pi):g} Hz); measure both at "
                "the same frequencies, or select common points"
            )

    def _made(
        self,
        what: str,
        values: ComplexArray,
        variance: FloatArray,
        sides: tuple[Operand, ...],
        hold: float | None,
        coherence: FloatArray | None = None,
    ) -> Any:
        """Build the result, and warn about what could not be propagated."""
        measured = [side for side in sides if side.measured]
        known = all(side.variance is not None for side in measured)
        lost = []
        if coherence is None and any(side.coherence is not None for side in measured):
            lost.append("coherence")
        if not known and any(side.variance is not None for side in measured):
            lost.append("standard deviation")
        if lost:
            warn_caller(f"{what} of measured responses has no known {' and '.join(lost)}; dropped")
        values = np.asarray(values + np.zeros(self.omega.size))
        single = values.shape[:2] == (1, 1) and self._single
        repeats = [side.repeats for side in measured if side.repeats is not None]
        names = {}
        if values.shape == self.frdata.shape:
            names = {"inputs": self.input_labels, "outputs": self.output_labels}

        def shaped(array: Any) -> Any:
            return np.broadcast_to(array, values.shape)[(0, 0) if single else ...]

        return type(self)(
            shaped(values),
            self.frequency_hz,
            coherence=None if coherence is None else shaped(coherence),
            std=shaped(np.sqrt(variance)) if known else None,
            # The smallest number: a lower bound of that of Welch and Satterthwaite's formula.
            repeats=min(repeats) if repeats and known else None,
            sample_time=hold,
            name=self.name,
            **names,
        )

    def __neg__(self) -> Any:
        return self * -1

    def __add__(self, other: Any) -> Any:
        """Parallel connection; errors of two measured responses are independent."""
        return self * 2 if other is self else self._sum(other, 1)

    def __radd__(self, other: Any) -> Any:
        return self + other

    def __sub__(self, other: Any) -> Any:
        return self * 0 if other is self else self._sum(other, -1)

    def _sum(self, other: Any, sign: int) -> Any:
        one, two = self._operand(), self._other(other)
        if two is None:
            return NotImplemented
        check_shapes(one, two, same=True)
        hold = common_hold(one, two, "a sum")
        values = one.values + sign * two.values
        return self._made("a sum", values, one.spread + two.spread, (one, two), hold)

    def __rsub__(self, other: Any) -> Any:
        return (self * -1) + other

    def __mul__(self, other: Any) -> Any:
        """Series: first `other`, then this response."""
        if other is self:
            return self**2
        two = self._other(other)
        return NotImplemented if two is None else self._product(self._operand(), two)

    def __rmul__(self, other: Any) -> Any:
        """Series: first this response, then `other`."""
        two = self._other(other)
        return NotImplemented if two is None else self._product(two, self._operand())

    def _product(self, one: Operand, two: Operand) -> Any:
        check_shapes(one, two, same=False)
        hold, coherence = one_hold(one, two), None
        for kept, exact in ((one, two), (two, one)):
            # A mixture of channels has another coherence; a gain of zero has none.
            if not exact.measured and exact.is_scalar and np.all(exact.values):
                coherence = kept.coherence
        spread = matmul(one.spread, power(two.values)) + matmul(power(one.values), two.spread)
        values = matmul(one.values, two.values)
        return self._made("a product", values, spread, (one, two), hold, coherence)

    def __truediv__(self, other: Any) -> Any:
        """Divide by one channel."""
        if other is self and self.issiso():
            return self**0
        two = self._other(other)
        return NotImplemented if two is None else self._quotient(self._operand(), two)

    def __rtruediv__(self, other: Any) -> Any:
        two = self._other(other)
        return NotImplemented if two is None else self._quotient(two, self._operand())

    def _quotient(self, one: Operand, two: Operand) -> Any:
        if not two.is_scalar:
            raise DataError(
                "the denominator of a quotient must have one channel; select it with "
                "frf[output, input]"
            )
        with np.errstate(divide="ignore", invalid="ignore"):
            values = one.values / two.values
            variance = (one.spread + power(values) * two.spread) / power(two.values)
        coherence = None
        if one.measured != two.measured and (one.measured or one.is_scalar):
            coherence = one.coherence if one.measured else two.coherence
        hold = one.hold if two.hold is None else None
        if two.hold is not None and (one.hold is None or not same_time(one.hold, two.hold)):
            warn_of_hold("a quotient", two.hold)
        return self._made("a quotient", values, variance, (one, two), hold, coherence)

    def __pow__(self, other: Any) -> Any:
        """Power of one channel, to a whole number."""
        if type(other) is not int:
            raise ValueError(f"exponent {other!r}; expected a whole number")
        if not self.issiso():
            raise DataError("a power needs one channel; select it with frf[output, input]")
        if other in (1, -1):
            return self * 1 if other == 1 else 1 / self
        one = self._operand()
        if other == 0:
            return self._made("", np.ones_like(one.values), np.zeros(1), (), None)
        if one.hold is not None:
            warn_of_hold("a power", one.hold)
        with np.errstate(divide="ignore", invalid="ignore"):
            slope = other * one.values ** (other - 1)
            values = one.values**other
        return self._made("a power", values, power(slope) * one.spread, (one,), None)

    def feedback(self, other: Any = 1, sign: float = -1) -> Any:
        """Close a loop around this response: ``H / (1 - sign other H)``.

        Parameters
        ----------
        other : number, matrix, system or measured response
            System in the feedback path.
        sign : float
            -1 for negative feedback.

        Returns
        -------
        MeasuredFRF
            Its standard deviation is that of the closed loop, unlike that of ``L / (1 + L)``, where
            the errors of both L are treated as independent.
        """
        one, two = self._operand(), self._needed(other)
        H = np.moveaxis(one.values, 2, 0)
        p, m = self.noutputs, self.ninputs
        if two.is_scalar and p == m:
            two = replace(two, values=two.values * np.eye(p)[:, :, None], coherence=None)
        if two.values.shape[:2] != (m, p):
            raise DataError(
                f"feedback of shape {two.values.shape[:2]} around {p} outputs and {m} inputs; "
                f"expected {(m, p)}"
            )
        K = sign * np.moveaxis(two.values, 2, 0)
        left, right = np.linalg.inv(np.eye(p) - H @ K), np.linalg.inv(np.eye(m) - K @ H)
        closed = np.moveaxis(H @ right, 0, 2)
        # dT = left dH right + T dK T
        spread = matmul(matmul(power(last_axis(left)), one.spread), power(last_axis(right)))
        spread = spread + matmul(matmul(power(closed), two.spread), power(closed))
        return self._made("a closed loop", closed, spread, (one, two), one_hold(one, two))

    def append(self, other: Any) -> Any:
        """Append another response; the cross terms are zero."""
        one, two = self._operand(), self._needed(other)
        hold = common_hold(one, two, "appended responses")
        values = blocks(one.values, two.values, self.omega.size)
        spread = blocks(one.spread, two.spread, self.omega.size)
        return self._made("appended responses", values, spread, (one, two), hold)
