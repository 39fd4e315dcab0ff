"""Open loops known only at measured frequencies."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Any

import control as ct
import numpy as np
from scipy.interpolate import PchipInterpolator

from ..._checks import integer, sample_time_of
from ..._flags import Flag, flagged
from ...data.frf_operands import same_time
from ...delayed.parts import check_entries
from ...errors import DataError
from ...frequency.points import MeasuredPoints, below_nyquist, measured_points, sampled_every
from ...numerics.arrays import ComplexArray, FloatArray
from ...numerics.loops.crossings import half_turns
from ...numerics.rational.phase import dead_time_from_phase, unwrap_with_dead_time
from ...numerics.rational.spectra import hold_response
from .loop import open_loop


@dataclass(frozen=True)
class DataLoop:
    """Loop response on a grid, interpolated in log magnitude and delay-free phase.

    ``course``, log gain and phase without ``dead_time``, is of monotone cubics over log omega that
    pass through the points without overshoot.
    """

    points: MeasuredPoints
    dead_time: float
    course: Any
    unstable_poles: int
    integrators: int
    left_out: tuple[Flag, ...] = ()

    def __call__(self, omega: FloatArray) -> ComplexArray:
        """Interpolated response."""
        log_gain, phase = self.course(np.log(omega)).T
        turn = phase - omega * self.dead_time
        return np.asarray(np.exp(log_gain + 1j * turn), dtype=np.complex128)

    def dense(self) -> tuple[FloatArray, ComplexArray]:
        """Grid with 8 points between neighbours, and more for a long delay."""
        omega = self.points.omega
        low, top = omega[0], omega[-1]
        ratios = np.log(omega[1:] / omega[:-1])
        share = np.arange(8) / 8
        inner = (omega[:-1, None] * np.exp(ratios[:, None] * share)).ravel()
        turns = int(16 * abs(self.dead_time) * top / (2 * np.pi)) + 2
        grid = np.unique(np.concatenate([inner, omega, np.linspace(low, top, turns)]))
        return grid, self(grid)

    def closed_loop_count(self) -> tuple[int, bool]:
        """Nyquist count between the first and the last point; for its assumptions see `flags`."""
        grid, values = self.dense()
        # With an integrator the curve would start 90 deg away from the real axis; with a stable
        # high-pass in its place it starts there.
        slow = (1j * grid / (1j * grid + 0.1 * grid[-1])) ** self.integrators
        turns = half_turns((1 + values) * slow)
        # Beyond the last point the loop gain is assumed to be small, and the curve to return to 1.
        turns -= float(np.angle(1 + values[-1]) + np.angle(slow[-1])) / np.pi
        count = self.unstable_poles - turns
        if round(count) < 0:
            raise DataError(
                f"unstable_poles={self.unstable_poles}, but the response goes counter-clockwise "
                f"about -1 as often as {round(turns)} unstable poles make it; give their number"
            )
        return round(count), abs(count - round(count)) > 0.25

    def flags(self) -> Iterator[Flag]:
        """Flag assumptions about the response outside of the band."""
        yield from self.left_out
        omega, (first, last) = self.points.omega, self.points.response[[0, -1]]
        if abs(last) > 0.9:
            yield flagged("band_ends_early", size=abs(last), omega=omega[-1])
        if self.integrators == 0 and abs(np.sin(np.angle(first))) > 0.5:
            yield flagged("band_starts_late", omega=omega[0], phase=np.degrees(np.angle(first)))


def data_loop(
    plant: Any, controller: Any, unstable_poles: int, integrators: int | None
) -> DataLoop:
    """Make a `DataLoop` from measured or computed responses, with systems on their grid.

    A discrete system acts on the plant through its hold, which a response of records with its
    sample time contains already.
    """
    data = plant if isinstance(plant, ct.FrequencyResponseData) else controller
    other = controller if data is plant else plant
    check_entries(data)
    points, held = _above_zero(data), sampled_every(data) or sample_time_of(data)
    system = None if isinstance(other, ct.FrequencyResponseData | None) else open_loop(other)
    points, left_out = below_nyquist(points, system.dt if system else None, "controller")
    _check_points(points)
    omega, known = points.omega, 0.0
    if other is not None:
        if system is None:
            beside = _on_grid(other, omega)
        else:
            known, count, beside = system.delay, system.integrators(), system(omega)
            if integrators is None and count:
                integrators = count + _read_integrators(omega, points.response)
            if system.dt and not (held and same_time(held, system.dt)):
                beside = beside * hold_response(omega, system.dt)
                beside = beside / hold_response(omega, held) if held else beside
        std = None if points.std is None else points.std * np.abs(beside)
        points = replace(points, response=points.response * beside, std=std)
    values = points.response
    # The known delay is removed before the rest is estimated.
    dead_time = known + dead_time_from_phase(omega, values * np.exp(1j * omega * known))
    phase = unwrap_with_dead_time(omega, values, dead_time) + omega * dead_time
    if integrators is None:
        integrators = _read_integrators(omega, values)
    counts = integer(unstable_poles, "unstable_poles", 0), integer(integrators, "integrators", 0)
    course = PchipInterpolator(np.log(omega), np.stack([np.log(np.abs(values)), phase], axis=1))
    return DataLoop(points, dead_time, course, *counts, left_out)


def _above_zero(data: ct.FrequencyResponseData) -> MeasuredPoints:
    points = measured_points(data)
    return points.only(points.frequency_hz > 0)


def _check_points(points: MeasuredPoints) -> None:
    """Refuse data that cannot be interpolated."""
    count = points.frequency_hz.size
    if count < 3 or np.any(np.diff(points.frequency_hz) <= 0):
        raise DataError(
            f"the response has {count} points above 0 rad/s, expected at least 3 distinct "
            "ones; average repeated frequencies first"
        )
    if np.any(points.response == 0):
        raise DataError("the response is 0 at some frequency; remove that point")


def _on_grid(other: ct.FrequencyResponseData, omega: FloatArray) -> ComplexArray:
    """Values of another response, of the same frequencies."""
    points = _above_zero(other)
    if not np.array_equal(points.omega, omega):
        raise DataError(
            "the two responses have different frequencies; interpolate one of them first"
        )
    return points.response


def _read_integrators(omega: FloatArray, values: ComplexArray) -> int:
    """Determine the number of integrators from the slope of the gain over the lowest octave.

    The phase alone is not sufficient: an unstable pole also starts at -180 deg.
    """
    lowest = np.flatnonzero((omega <= 2 * omega[0]) | (np.arange(omega.size) < 3))
    gain = np.abs(values[lowest])
    if np.median(gain) < 3:
        return 0
    slope = np.polyfit(np.log(omega[lowest]), np.log(gain), 1)[0]
    return int(np.clip(np.round(-slope), 0, 3))
