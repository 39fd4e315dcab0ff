"""Measured frequency responses, as python-control frequency-response data."""

from __future__ import annotations

from collections.abc import Callable
from html import escape
from typing import Any

import control as ct
import numpy as np
from numpy.typing import ArrayLike

from .._checks import (
    check_finite,
    complex_numbers,
    finite,
    numbers,
    positive,
    real,
    system_name,
    system_names,
    within,
)
from .._shown import as_asked, as_code
from ..errors import DataError, OptionError
from ..numerics.arrays import ComplexArray, FloatArray, read_only
from ..numerics.statistics import circle_quantile
from .frf_algebra import FRFAlgebra
from .frf_operands import SAME
from .record_checks import check_size


class MeasuredFRF(FRFAlgebra):
    """Measured frequency response function.

    A `control.FrequencyResponseData` without a time base (``dt=None``), so that python-control
    draws and combines it with continuous and discrete systems alike.

    Parameters
    ----------
    response : array_like, shape (K,) or (p, m, K)
        Complex response.
    frequency_hz : array_like, shape (K,)
        Frequencies in Hz, in any order.
    coherence : array_like, same shape as `response`, optional
        Squared coherence, 0...1.
    std : array_like, same shape as `response`, optional
        Standard deviation of the complex response (root mean square of the error).
    repeats : float, optional
        Number of repeats, periods or independent segments from which `std` was estimated; above 1,
        not necessarily whole. Without it `std` counts as known.
    sample_time : float, optional
        Sample time in s of the records that the response was estimated from. The hold of the input
        is then part of the response, half a sample of delay, and `fit_frf`, `compare_frf` and
        `impulse_from_frf` account for it.
    name : str, optional
    inputs, outputs : str or sequence of str, optional
        Signal names. Dots become underscores, because python-control allows no dots.

    Attributes
    ----------
    frequency_hz : ndarray, shape (K,)
    complex : ndarray
        The complex response (python-control's attribute), sorted by frequency.
    coherence, std : ndarray or None
    repeats, sample_time : float or None

    Raises
    ------
    DataError
        Shapes that do not match, values that are not finite, negative frequencies, or an index that
        selects no input or output.

    Notes
    -----
    ``frf[output, input]`` selects channels by number, name or slice, with their coherence and
    standard deviation.

    A standard deviation from few repeats is itself uncertain: intervals of 1.96 std, or circles of
    ``sqrt(3) * std``, contain 95 % only for many repeats. `circle` and the intervals of
    `design.margins` account for `repeats`.

    Arithmetic propagates standard deviation, coherence, repeats and sample time. Exact systems and
    numbers scale the standard deviation; two measured responses are treated as independent, a
    response and itself are not. ``frf.feedback(K)`` accounts for the fact that the response occurs
    twice in ``frf / (1 + K frf)``. If coherence or hold of a result is unknown, a `DataWarning`
    reports that it is left out.

    Examples
    --------
    >>> import ctrl_realize as cr
    >>> frf = cr.MeasuredFRF([1.0, 0.5 - 0.5j, -0.1j], [0.1, 1.0, 10.0])
    >>> frf.between_hz(0.5, 20.0)
    <MeasuredFRF 'measured': 2 points, 1...10 Hz>
    >>> (2 * cr.MeasuredFRF([1.0], [0.1], std=[0.1], sample_time=0.01)).std
    array([0.2])
    """

    def __init__(
        self,
        response: ArrayLike,
        frequency_hz: ArrayLike,
        *,
        coherence: ArrayLike | None = None,
        std: ArrayLike | None = None,
        repeats: float | None = None,
        sample_time: float | None = None,
        name: str = "measured",
        inputs: Any = None,
        outputs: Any = None,
    ) -> None:
        values = complex_numbers(response, "response")
        grid = finite(frequency_hz, "frequency_hz")
        if grid.ndim != 1 or grid.size == 0:
            raise DataError(f"frequency_hz has shape {grid.shape}; expected (K,), K >= 1")
        if values.ndim not in (1, 3) or values.shape[-1] != grid.size:
            raise DataError(
                f"response has shape {values.shape}, frequency_hz has {grid.size} points; "
                "expected (K,) or (outputs, inputs, K)"
            )
        check_finite(values, "response")
        check_size(grid, "frequency_hz")
        # not the absolute value, which may overflow
        check_size(np.maximum(np.abs(values.real), np.abs(values.imag)), "response")
        if np.any(grid < 0):
            raise DataError(f"frequency_hz goes down to {grid.min():g} Hz; expected a value >= 0")
        order = np.argsort(grid, kind="stable")
        grid = grid[order]
        values = values[..., order]
        signals: dict[str, Any] = {
            key: system_names([names] if isinstance(names, str) else names)
            for key, names in (("inputs", inputs), ("outputs", outputs))
            if names
        }
        # Not smooth: python-control would draw interpolating splines far beyond the measured
        # band, where they diverge. Margins and products with systems do not need them.
        signals["name"] = system_name(str(name))
        super().__init__(values, 2 * np.pi * grid, dt=None, smooth=False, **signals)
        self._single = values.ndim == 1
        self.frequency_hz = read_only(grid)
        self.coherence = _beside(coherence, values, order, "coherence")
        self.std = _beside(std, values, order, "std")
        self.repeats = None if repeats is None else real(repeats, "repeats", "number above 1")
        if self.repeats is not None and self.repeats <= 1:
            raise OptionError(f"repeats={repeats!r}; a scatter needs more than one")
        self.sample_time = (
            None if sample_time is None else positive(sample_time, "sample_time", "time in s")
        )

    def __repr__(self) -> str:
        return as_asked(self)

    def _repr_eval_(self) -> str:
        response = self.frdata[0, 0] if self._single else self.frdata
        parts = [as_code(response), as_code(self.frequency_hz)]
        for name in ("coherence", "std", "repeats", "sample_time", "name"):
            if (value := getattr(self, name)) is not None:
                parts.append(f"{name}={as_code(value)}")
        parts.append(f"inputs={self.input_labels!r}, outputs={self.output_labels!r}")
        return f"MeasuredFRF({', '.join(parts)})"

    def _repr_info_(self, html: bool = False) -> str:
        line = f"<MeasuredFRF {self.name!r}: {self._points()}>"
        return escape(line) if html else line

    def _points(self) -> str:
        low, high = self.frequency_hz[[0, -1]]
        return f"{self.frequency_hz.size} points, {low:g}...{high:g} Hz"

    def __str__(self) -> str:
        # python-control's representation lists every point.
        return self._repr_info_()

    def _repr_html_(self) -> str | None:
        return None

    def eval(self, omega: Any, squeeze: bool | None = None) -> Any:
        """Return the response at measured frequencies, in rad/s.

        See `control.FrequencyResponseData.eval`. A frequency may differ from a measured one by
        rounding, such as 6.283185307179586 * f and 2 * (f * pi).
        """
        asked = numbers(omega, "omega")
        right = np.clip(np.searchsorted(self.omega, asked), 1, max(self.omega.size - 1, 1))
        near = [self.omega[np.minimum(at, self.omega.size - 1)] for at in (right - 1, right)]
        for own in near:
            asked = np.where(np.abs(own - asked) <= SAME * own, own, asked)
        return super().eval(asked, squeeze)

    def __getitem__(self, key: Any) -> Any:
        """Select channels as in python-control: by number, name or slice.

        Coherence and standard deviation are selected as well. A single channel has arrays of shape
        (K,).
        """
        taken = super().__getitem__(key)
        if not isinstance(taken, ct.FrequencyResponseData):
            return taken
        # python-control interprets the key, applied to an FRF whose values are the positions.
        p, m = self.noutputs, self.ninputs
        numbered = np.arange(p * m, dtype=np.complex128).reshape(p, m, 1)
        names = {"inputs": self.input_labels, "outputs": self.output_labels}
        places = ct.FrequencyResponseData(numbered, [1.0], **names)[key].frdata[:, :, 0]
        chosen = places.real.astype(int)
        if chosen.size == 0:
            raise DataError(
                f"[{key}] selects no channel of {p} outputs and {m} inputs (counted from 0)"
            )
        return self._part(lambda values: _channels(values, chosen), self.frequency_hz, taken)

    def circle(self, level: float = 0.95) -> FloatArray:
        r"""Radii of circles around the points that contain the true response, each with `level`.

        For a complex normal error. With the standard deviation *s* from *n* repeats the radius is
        :math:`s \sqrt{(n - 1) ((1 - level)^{-1 / (n - 1)} - 1)}`, which tends to :math:`s
        \sqrt{-\log(1 - level)}` for many repeats.

        Returns
        -------
        ndarray, same shape as the response

        Raises
        ------
        DataError
            There is no standard deviation.
        OptionError
            A `level` that is not between 0 and 1.

        Examples
        --------
        >>> import ctrl_realize as cr
        >>> for repeats in None, 5:
        ...     frf = cr.MeasuredFRF([1.0], [0.1], std=[0.1], repeats=repeats)
        ...     print(frf.circle().round(3))
        [0.173]
        [0.211]
        """
        if self.std is None:
            raise DataError("this FRF has no standard deviation, so its error is unknown")
        if not 0 < real(level, "level", "part between 0 and 1") < 1:
            raise OptionError(f"level={level!r}; expected a value above 0 and below 1")
        return np.asarray(self.std * circle_quantile(level, self.repeats))

    def between_hz(self, low: float, high: float) -> MeasuredFRF:
        """Return the points with low <= frequency <= high, in Hz."""
        low, high = numbers([low, high], "low and high")
        inside = (self.frequency_hz >= low) & (self.frequency_hz <= high)
        return self._select(inside, f"between {low:g} and {high:g} Hz")

    def trusted(self, min_coherence: float = 0.95) -> MeasuredFRF:
        """Return the points with a coherence of at least `min_coherence` (in every channel)."""
        if self.coherence is None:
            raise DataError(
                "this FRF has no coherence; choose a band with between_hz(low, high) instead"
            )
        within(min_coherence, "min_coherence", "coherence", 0, 1)
        good = self.coherence.reshape(-1, self.frequency_hz.size).min(axis=0) >= min_coherence
        return self._select(good, f"with a coherence of {min_coherence:g}")

    def _select(self, keep: np.ndarray[Any, np.dtype[np.bool_]], where: str) -> MeasuredFRF:
        if not keep.any():
            raise DataError(f"no point of the FRF lies {where}; it has {self._points()}")
        return self._part(lambda values: values[..., keep], self.frequency_hz[keep], self)

    def _part(
        self, take: Callable[[Any], Any], frequency_hz: FloatArray, named: ct.InputOutputSystem
    ) -> MeasuredFRF:
        """Make a response from the arrays that `take` returns, named as `named`."""
        response = self.frdata[0, 0] if self._single else self.frdata
        return MeasuredFRF(
            take(response),
            frequency_hz,
            coherence=None if self.coherence is None else take(self.coherence),
            std=None if self.std is None else take(self.std),
            repeats=self.repeats,
            sample_time=self.sample_time,
            name=named.name,
            inputs=named.input_labels,
            outputs=named.output_labels,
        )


def _channels(values: np.ndarray[Any, Any], places: np.ndarray[Any, Any]) -> np.ndarray[Any, Any]:
    """Return the entries at `places`, counted along rows; a single entry without its two axes."""
    taken = values.reshape(-1, values.shape[-1])[places]
    return np.asarray(taken[0, 0] if places.size == 1 else taken)


def _beside(
    values: ArrayLike | None, response: ComplexArray, order: np.ndarray[Any, Any], what: str
) -> FloatArray | None:
    if values is None:
        return None
    array = finite(values, what)
    if array.shape != response.shape:
        raise DataError(f"{what} has shape {array.shape}, response has {response.shape}")
    check_size(array, what)
    most, expected = (1 + 1e-9, "in 0...1") if what == "coherence" else (np.inf, ">= 0")
    if array.min() < 0 or array.max() > most:
        raise DataError(
            f"{what} runs from {array.min():g} to {array.max():g}; expected values {expected}"
        )
    return read_only(array[..., order])
