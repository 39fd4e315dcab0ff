"""Unit-pulse responses, with the filter that they contain."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike
from scipy.signal import sosfreqz

from .._checks import finite, numbers, one_of, positive
from ..errors import DataError
from ..numerics.arrays import ComplexArray, FloatArray, read_only
from ..numerics.constants import LARGEST
from ..numerics.signals.filters import butterworth, butterworth_group_delay
from ..results import Drawable
from .step import StepResponse

Sampling = Literal["step-invariant", "impulse-invariant"]


@dataclass(frozen=True)
class FilterSpec:
    """Butterworth low-pass filter that was applied to a signal.

    Attributes
    ----------
    order : int
    cutoff_hz : float
        Frequency of -3 dB (-6 dB when `zero_phase`) in Hz.
    zero_phase : bool
        Run forward and backward: no delay, twice the attenuation.
    dt : float
        Sample time in s of the filtered signal.

    Examples
    --------
    >>> import numpy as np
    >>> import ctrl_realize as cr
    >>> low_pass = cr.data.FilterSpec(order=5, cutoff_hz=20.0, zero_phase=False, dt=0.001)
    >>> gain = abs(low_pass.response(np.array([2 * np.pi * 20.0])))
    >>> print(gain.round(3), f"{low_pass.group_delay:.1f} samples")
    [0.707] 25.7 samples
    """

    order: int
    cutoff_hz: float
    zero_phase: bool
    dt: float

    def response(self, omega: ArrayLike) -> ComplexArray:
        """Frequency response at `omega` in rad/s; divide a model's response by it to remove it."""
        points = np.atleast_1d(numbers(omega, "omega")) * self.dt
        sos = butterworth(self.order, self.cutoff_hz, self.dt)
        response = np.asarray(sosfreqz(sos, worN=points)[1], dtype=np.complex128)
        return (np.abs(response) ** 2).astype(np.complex128) if self.zero_phase else response

    @property
    def group_delay(self) -> float:
        """Delay of the filter at low frequency, in samples."""
        if self.zero_phase:
            return 0.0
        return butterworth_group_delay(self.order, self.cutoff_hz, self.dt)

    def __str__(self) -> str:
        way = "zero-phase" if self.zero_phase else "causal"
        return f"{way} Butterworth, order {self.order}, {self.cutoff_hz:.4g} Hz"


@dataclass(frozen=True, eq=False)
class ImpulseResponse(Drawable):
    """Response to a unit pulse: the Markov parameters G_0, G_1, ...

    The pulse has height 1 and lasts one sample, so these are D, CB, CAB, ... of a model, and their
    sum is the gain. ``density == markov / dt`` is the response to a pulse of unit area.

    Parameters
    ----------
    markov : array_like, shape (N,) or (p, m, N)
        Markov parameters; p outputs, m inputs.
    dt : float
        Sample time in s.
    filter : FilterSpec, optional
        Low-pass filter that the data contain.
    noise : array_like, shape (P,), optional
        Noise in `markov`: the samples before the step, processed in the same way.
    sampling : {"step-invariant", "impulse-invariant"}, optional
        Which model reproduces the data exactly: ``"step-invariant"``, that of a plant with a
        zero-order hold (backward difference, the default), or ``"impulse-invariant"``, samples of
        the continuous impulse response (central difference), half a sample earlier.
    name : str, optional
    step : StepResponse, optional
        Step response that it was computed from.

    Raises
    ------
    DataError
        Wrong shape or values that are not finite.

    Examples
    --------
    >>> import ctrl_realize as cr
    >>> g = cr.ImpulseResponse([0.0, 0.5, 0.25, 0.125], dt=0.1)
    >>> g.n_samples, float(g.density[1])
    (4, 5.0)
    """

    markov: FloatArray
    dt: float
    filter: FilterSpec | None = None
    noise: FloatArray | None = None
    sampling: Sampling = "step-invariant"
    name: str = ""
    step: StepResponse | None = None

    def __init__(
        self,
        markov: ArrayLike,
        dt: float,
        *,
        filter: FilterSpec | None = None,
        noise: ArrayLike | None = None,
        sampling: Sampling = "step-invariant",
        name: str = "",
        step: StepResponse | None = None,
    ) -> None:
        values = finite(markov, "markov")
        if values.ndim not in (1, 3) or values.shape[-1] < 2 or values.size == 0:
            raise DataError(
                f"markov has shape {values.shape}; expected (N,) or (outputs, inputs, N) with "
                "N >= 2"
            )
        # the quotient of the largest output and the smallest step of a record; its square is
        # finite
        if np.abs(values).max() > LARGEST**2:
            raise DataError(
                f"markov goes up to {np.abs(values).max():g}, which is not a plausible measurement"
            )
        seconds = positive(dt, "dt", "sample time in s")
        sampling = one_of(sampling, "sampling", ("step-invariant", "impulse-invariant"))
        vars(self).update(
            markov=read_only(values), dt=seconds, filter=filter, sampling=sampling,
            noise=None if noise is None else read_only(finite(noise, "noise")),
            name=str(name), step=step,
        )  # fmt: skip

    @property
    def n_samples(self) -> int:
        """Number of Markov parameters."""
        return int(self.markov.shape[-1])

    @property
    def ninputs(self) -> int:
        """Number of inputs."""
        return 1 if self.markov.ndim == 1 else int(self.markov.shape[1])

    @property
    def noutputs(self) -> int:
        """Number of outputs."""
        return 1 if self.markov.ndim == 1 else int(self.markov.shape[0])

    @property
    def density(self) -> FloatArray:
        """Response to an impulse of unit area: markov / dt."""
        return self.markov / self.dt

    @property
    def time(self) -> FloatArray:
        """Time of each Markov parameter in s, from 0."""
        return np.arange(self.n_samples, dtype=np.float64) * self.dt

    def __repr__(self) -> str:
        name = f" {self.name!r}" if self.name else ""
        channels = "" if self.markov.ndim == 1 else f", {self.noutputs} x {self.ninputs} channels"
        still = f", {self.filter}" if self.filter is not None else ""
        return (
            f"<ImpulseResponse{name}: {self.n_samples} samples of {self.dt:g} s{channels}{still}>"
        )
