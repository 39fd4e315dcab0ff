"""The PID algorithm as it runs in a controller: weights, limits, anti-windup, manual operation."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace
from numbers import Real
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from ..._checks import band, finite, not_negative, numbers, one_of, positive, real
from ..._wording import in_digits, in_time
from ...errors import DataError, OptionError
from ...numerics.arrays import FloatArray
from ...results import Result

DISCRETIZATIONS = ("tustin", "forward", "backward")
SHARES = {"forward": 0.0, "tustin": 0.5, "backward": 1.0}
"""Share of the newest error in the integral."""
INF = float("inf")


class Coefficients(NamedTuple):
    """Numbers of the difference equations; those of the exported code are the same.

    Attributes
    ----------
    p_setpoint, p_measured : float
        Of the proportional action.
    integral, newest : float
        ``kp dt / ti``, and the part of it that acts at once.
    pole, slope : float
        Of the filtered derivative.
    weight : float
        Of the set-point in the derivative.
    tracking : float
        ``dt / tracking_time``.
    bias, low, high : float
        Constant part and limits of the output.
    """

    p_setpoint: float
    p_measured: float
    integral: float
    newest: float
    pole: float
    slope: float
    weight: float
    tracking: float
    bias: float
    low: float
    high: float


@dataclass(frozen=True, repr=False)
class PIDAlgorithm(Result):
    r"""PID algorithm with set-point weights, output limits, anti-windup and manual operation.

    With :math:`e = r - y`, at each sample::

        P = kp (b r - y)
        D = pole D + slope ((c r - y) - (c r - y)_previous)
        v = bias + P + D + I + newest e
        u = v limited to the output limits; or the manual value
        I = I + integral e + (dt / tracking_time) (u - v)

    where pole = tf/(tf + dt), slope = kp td/(tf + dt), integral = kp dt/ti and newest is its share
    by the discretization (0, 1/2 or all of it). In manual operation I is such that the output
    continues without a bump. The first sample is taken to have lasted for long, without an error:
    D is 0, and I such that the output is `bias` at zero error whatever the set-point.

    The code of `ctrl_realize.export` does the same to rounding.

    Parameters
    ----------
    kp, ti, td, tf : float
        Ideal form; times in s.
    dt : float
        Sample time in s.
    method : {"tustin", "forward", "backward"}
    setpoint_weight, derivative_weight : float
        b and c, the weights of the set-point in the proportional and derivative action.
    output_limits : tuple of float
    tracking_time : float, optional
        Of the anti-windup, in s, at least `dt`. Default: ``sqrt(ti td)``, without a derivative
        `ti`.
    bias : float
        Output at the operating point, at zero error.
    name : str
    gain_unit, time_unit : str
        In which the card writes kp and times.

    Attributes
    ----------
    coefficients : Coefficients

    Notes
    -----
    The algorithm is that of [1]_ (set-point weighting, windup, digital implementation);
    back-calculation with tracking time ``sqrt(ti td)`` is its proposal.

    References
    ----------
    .. [1] K. J. Astrom and T. Hagglund, Advanced PID Control, ISA 2006, chapter 3.

    Examples
    --------
    >>> import ctrl_realize as cr
    >>> algorithm = cr.design.PIDController(2.0, 1.0, dt=0.1).algorithm(output_limits=(0, 3))
    >>> print(algorithm.simulate([1, 1, 1, 1, 1], [0, 0, 0, 0, 0]).round(3))
    [2.1 2.3 2.5 2.7 2.9]
    """

    kp: float
    ti: float = INF
    td: float = 0.0
    tf: float = 0.0
    dt: float = 1.0
    method: str = "tustin"
    setpoint_weight: float = 1.0
    derivative_weight: float = 0.0
    output_limits: tuple[float, float] = (-INF, INF)
    tracking_time: float | None = None
    bias: float = 0.0
    name: str = "PID"
    gain_unit: str = ""
    time_unit: str = "s"

    def __post_init__(self) -> None:
        positive(self.dt, "dt", "sample time in s")
        one_of(self.method, "method", DISCRETIZATIONS)
        for name in ("kp", "setpoint_weight", "derivative_weight", "bias"):
            real(getattr(self, name), name, "parameter of a PID")
        for name in ("td", "tf"):
            not_negative(getattr(self, name), name, "time in s")
        if self.ti != INF:
            positive(self.ti, "ti", "integral time in s")
        low, high = _limits(self.output_limits)
        if not low < high:
            raise OptionError(
                f"output_limits=({low:g}, {high:g}); expected the lower limit first, such as "
                "(0, 100)"
            )
        if not low <= self.bias <= high:
            raise OptionError(
                f"bias={self.bias:g} is outside of output_limits=({low:g}, {high:g}); expected the "
                "output at the operating point, in the units of the limits"
            )
        if self.ti == INF and self.setpoint_weight != 1:
            raise OptionError(
                f"setpoint_weight={self.setpoint_weight:g} without integral action; expected 1, "
                "since nothing removes the offset that a weight leaves"
            )
        if self.tracking_time is not None and not (
            positive(self.tracking_time, "tracking_time", "time in s") >= self.dt
        ):
            raise OptionError(
                f"tracking_time={self.tracking_time:g} s; expected at least the sample time, "
                f"{self.dt:g} s"
            )

    @property
    def coefficients(self) -> Coefficients:
        """Numbers of the difference equations."""
        integral = 0.0 if self.ti == INF else self.kp * self.dt / self.ti
        tracking = 0.0
        if integral:
            default = np.sqrt(self.ti * self.td) if self.td else self.ti
            time = max(self.dt, default) if self.tracking_time is None else self.tracking_time
            tracking = float(self.dt / time)
        low, high = self.output_limits
        return Coefficients(
            float(self.kp * self.setpoint_weight),
            float(self.kp),
            float(integral),
            float(integral * SHARES[self.method]),
            float(self.tf / (self.tf + self.dt)) if self.td else 0.0,
            float(self.kp * self.td / (self.tf + self.dt)),
            float(self.derivative_weight),
            tracking,
            float(self.bias),
            float(low),
            float(high),
        )

    def in_deviations(self) -> PIDAlgorithm:
        """The same algorithm for deviations from the operating point: limits relative to `bias`."""
        low, high = self.output_limits
        return replace(self, bias=0.0, output_limits=(low - self.bias, high - self.bias))

    def start(self) -> PIDRun:
        """Start a run, sample by sample."""
        return PIDRun(self.coefficients)

    def simulate(
        self, setpoint: ArrayLike, measured: ArrayLike, manual: ArrayLike | None = None
    ) -> FloatArray:
        """Compute the output for given signals.

        Parameters
        ----------
        setpoint, measured : array_like, shape (N,)
        manual : array_like, shape (N,), optional
            Output in manual operation; NaN where the controller is in automatic operation.

        Returns
        -------
        ndarray, shape (N,)
        """
        r, y = finite(setpoint, "the setpoint"), finite(measured, "the measured value")
        hand = np.full(y.shape, np.nan) if manual is None else numbers(manual, "manual")
        if r.ndim != 1 or not r.shape == y.shape == hand.shape:
            raise DataError(
                f"setpoint, measured and manual have shapes {r.shape}, {y.shape}, {hand.shape}; "
                "expected one and the same length"
            )
        run = self.start()
        return np.array([run.step(*sample) for sample in zip(r, y, hand, strict=True)])

    def _title(self) -> str:
        return f"PID algorithm {self.name}"

    def _rows(self) -> list[tuple[str, str]]:
        rows = [("kp", f"{in_digits(self.kp)} {self.gain_unit}".rstrip())]
        if self.ti < INF:
            rows.append(("ti", in_time(self.ti, 4)))
        if self.td:
            rows += [("td", in_time(self.td, 4)), ("tf", in_time(self.tf, 4))]
        low, high = self.output_limits
        weights = f"{self.setpoint_weight:g}, derivative {self.derivative_weight:g}"
        rows += [("set-point weights", weights), ("output limits", f"{low:g} to {high:g}")]
        if tracking := self.coefficients.tracking:
            rows.append(("tracking time", in_time(self.dt / tracking, 4)))
        return [*rows, ("sample time", f"{in_time(self.dt, 6)}, {self.method} rule")]

    def __repr__(self) -> str:
        return f"<PIDAlgorithm {self.name!r}: {', '.join(f'{n} {v}' for n, v in self._rows())}>"


class PIDRun:
    """One run of a `PIDAlgorithm`: `step` takes a sample and returns the output.

    Parameters
    ----------
    coefficients : Coefficients

    Examples
    --------
    >>> import ctrl_realize as cr
    >>> run = cr.design.PIDController(2.0, 1.0, dt=0.1).algorithm().start()
    >>> run.step(1.0, 0.0), run.step(1.0, 0.0)
    (2.1, 2.3)
    """

    def __init__(self, coefficients: Coefficients) -> None:
        self._c = coefficients
        self._integral = 0.0
        self._derivative = 0.0
        self._previous: float | None = None

    def step(self, setpoint: float, measured: float, manual: float = float("nan")) -> float:
        """Return the output for one sample; NaN for `manual` is automatic operation."""
        c = self._c
        error = setpoint - measured
        slope = c.weight * setpoint - measured
        if self._previous is None:
            self._previous = slope
            if c.integral != 0:
                self._integral = (c.p_measured - c.p_setpoint) * setpoint
        self._derivative = c.pole * self._derivative + c.slope * (slope - self._previous)
        self._previous = slope
        action = c.bias + (c.p_setpoint * setpoint - c.p_measured * measured) + self._derivative
        wanted = action + (self._integral + c.newest * error)
        hand = manual == manual  # not NaN
        output = min(max(manual if hand else wanted, c.low), c.high)
        if hand and c.integral != 0:
            self._integral = output - action - c.newest * error
        else:
            self._integral += c.integral * error + c.tracking * (output - wanted)
        return output


def _limits(value: Any) -> tuple[float, float]:
    ends = tuple(value) if isinstance(value, Iterable) else ()
    if len(ends) == 2 and all(isinstance(end, Real) for end in ends) and INF in map(abs, ends):
        return float(ends[0]), float(ends[1])
    return band(value, "output_limits", "limits of the output")
