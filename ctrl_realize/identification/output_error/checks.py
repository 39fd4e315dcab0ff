"""Tests of a record against the model that was fitted to it.

They test the assumptions of the fit: one gain and one dead time, no feedback, and an output that is
measured at every sample.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from ..._flags import Flag, flagged
from ..._wording import chosen, interval_in_time
from ...numerics.arrays import FloatArray, IntArray
from ...numerics.constants import Z_95
from ...numerics.rules import Rule
from ...numerics.validation.innovations import RARE, REGRESSED, nonlinear_chance, past_inputs
from ...numerics.validation.parameter_change import ParameterChange, parameter_change
from .loop_flags import (
    coloured_flags,
    excitation_flags,
    feedback_flags,
    generalised_step,
    in_automatic,
    set_point_flags,
    unstable_flags,
)
from .repeat_flags import time_apart
from .result import OutputErrorFit
from .sensor_flags import held_output, sensor_flags, stored_output

# The following thresholds for flags are a matter of presentation.
_GAINS_APART = 0.1  # least relative difference between groups of samples for a flag
_EXPLAINED = 0.05
"""Fraction of the residual that products of inputs must explain for a flag."""
_REACHED = 1.5
"""Total delays covered by products of inputs, so that they do not replace missing lags."""
_MOST_SAMPLES = 20_000  # of a record that are tested, to limit the time


def checked(fit: OutputErrorFit, *, alone: bool = True) -> OutputErrorFit:
    """Add flags for violated assumptions, and widen the interval accordingly.

    It is widened by the hold time of the output and, if the residual is coloured, to contain the
    generalised least-squares estimate.

    Parameters
    ----------
    fit : OutputErrorFit
        Fit of one record, or of several.
    alone : bool, optional
        There are no known dynamics besides the model.

    Returns
    -------
    OutputErrorFit
        The same with further flags; `interval` may be wider.
    """
    codes = {flag.code for flag in fit.flags}
    flags: list[Flag] = []
    notes: list[str] = []
    low, high = fit.interval
    stepped = bool(np.isfinite(fit.onset))
    # Regressions on past samples need all of them.
    complete = tuple(record for record in fit.records if not record.n_missing)
    if complete and not stepped:
        flags += feedback_flags(complete, fit.delay_interval[1])
    in_loop = bool(flags)
    if not stepped:
        flags += excitation_flags(fit)
    if not complete and "closed_loop" not in codes and any(map(in_automatic, fit.records)):
        flags.append(flagged("feedback.gaps"))
    # A stable model that leaves noise excludes an unstable plant, unless noise took what it misses
    # or integrators imitate it.
    noise = fit.at_noise_level and not fit.estimate.averaged
    if complete and (fit.integrators or not noise):
        flags += unstable_flags(complete, fit.delay_interval[1], imitated=noise)
    flags += set_point_flags(fit)
    if len(fit.records) == 1:
        shown = _shown(fit)
        flags += sensor_flags(fit, shown.output, shown.fitted)
        spacing = fit.data.dt * shown.spacing
        coarse = "coarse_quantisation" in codes
        held = None if coarse else held_output(shown.output, shown.fitted, spacing, low)
        if held is None and ("held_output" in codes or not fit.at_noise_level):
            held = stored_output(shown.output, shown.drive, spacing, low)
        if held is not None and Rule.HELD_OUTPUT.on:
            low = held[0]
            flags.append(held[1])
        white = bool(fit.estimate.residual.noise_lags)
        # Neither do they hold for means over blocks of samples, nor beside loads.
        loaded = "load_disturbance" in codes and not stepped
        complete = complete if shown.rows is None and not loaded else ()
        # In a loop one step of generalised least squares is biased by the first estimate.
        coloured = (
            alone
            and complete
            and not fit.estimate.averaged
            and (white or "coloured_residual" in codes)
        )
        step = generalised_step(fit, shown.output, shown.drive) if coloured else None
        if step is not None:
            flags += coloured_flags(fit, step, shown.output, shown.drive)
        if step is not None and not white:
            form, half = fit.estimate.process.form, Z_95 * step.dead_time_error
            first, last = form.dead_time_ends if form else (0.0, np.inf)
            low = min(low, max(step.dead_time - half, first))
            high = max(high, min(step.dead_time + half, last))
        # Parts of one step are not several responses.
        if not (in_loop or fit.estimate.averaged) and not (stepped and _moves(shown.drive) < 2):
            changes, notes = against_one_model(shown, fit.dead_time / fit.data.dt)
            flags += changes
            if complete and not stepped and all(flag.code != "not_linear" for flag in flags):
                flags += nonlinear_flags(shown, fit.delay, fit.total_delay / fit.dt)
    known = [flag for flag in flags if flag.code not in codes]
    # What disturbances leave open of a gain is more than what the end of the record does.
    told = "not_settled" if any(flag.code == "gain_not_resolved" for flag in known) else ""
    before = [flag for flag in fit.flags if flag.code != told]
    if (low, high) != fit.interval:  # which they may name
        old, new = (f" {interval_in_time(*ends)}" for ends in (fit.interval, (low, high)))
        before = [replace(flag, message=flag.message.replace(old, new)) for flag in before]
    # That an output is recorded late is the cause of what its model misses.
    every = tuple(sorted((*before, *known), key=lambda flag: flag.code != "held_output"))
    estimate = replace(fit.estimate, low=low, high=high)
    return replace(fit, estimate=estimate, flags=every, choices=(*fit.choices, *notes))


@dataclass(frozen=True, eq=False)
class Shown:
    """Part of a record that was fitted: output and model (M,), and input (N,).

    `rows` (M,) are the samples at which there is an output; without them none is missing.
    """

    output: FloatArray
    fitted: FloatArray
    drive: FloatArray
    rows: IntArray | None = None

    @property
    def residual(self) -> FloatArray:
        """Measured minus simulated output."""
        return np.asarray(self.output - self.fitted)

    @property
    def spacing(self) -> float:
        """Mean distance of the outputs, in samples."""
        return 1.0 if self.rows is None else float(np.mean(np.diff(self.rows)))

    def earlier(self, samples: int) -> FloatArray:
        """Input so many samples before each output, shape (M,)."""
        rows = np.arange(self.output.size) if self.rows is None else self.rows
        return self.drive[np.clip(rows - samples, 0, None)]


def _shown(fit: OutputErrorFit) -> Shown:
    record = fit.records[0]
    count = min(fit.measured.size, _MOST_SAMPLES)
    rows = np.round((fit.time[:count] - record.time[0]) / record.dt).astype(np.int64)
    first, last = int(rows[0]), int(rows[-1]) + 1
    drive = np.ravel(record.input)[first:last]
    gaps = None if last - first == count else rows - first
    return Shown(fit.measured[:count], fit.fitted[:count], drive, gaps)


def _moves(drive: FloatArray) -> int:
    return int(np.count_nonzero(np.abs(np.diff(drive)) > 0.1 * np.ptp(drive)))


def against_one_model(shown: Shown, delay: float) -> tuple[list[Flag], list[str]]:
    """Test whether one gain and one dead time (in samples) hold for the whole record.

    Returns flags, and a note where the differences are too small to matter.
    """
    fitted, size = shown.fitted, shown.fitted.size

    def change(groups: IntArray) -> ParameterChange | None:
        return parameter_change(shown.residual, fitted, groups, shown.rows)

    between_thirds = change(np.minimum(3 * np.arange(size) // size, 2))
    flags = []
    if changes := _changes(between_thirds, delay):
        flags.append(flagged("time_varying", changes=changes))
    for what, groups in (
        ("level of the input", _thirds(shown.earlier(round(delay)))),
        ("level of the output", _thirds(fitted)),
        ("direction", (np.gradient(fitted) > 0).astype(np.int64)),
    ):
        if changes := _changes(change(groups), delay):
            flags.append(flagged("not_linear", what=what, changes=changes))
            break
    return flags, [] if flags else _small_changes(between_thirds)


def nonlinear_flags(shown: Shown, delay: float, total: float) -> tuple[Flag, ...]:
    """Test whether products of past inputs predict the output.

    Not for step records, in which such products are merely other functions of time, nor if the
    regression does not cover the response; `delay` and `total` are in samples.
    """
    output, drive = shown.output[:REGRESSED], shown.drive[:REGRESSED]
    past = min(2 * past_inputs(output.size, delay), output.size // 5)
    # Total delays beyond a tenth of the record have flags of their own.
    if past < _REACHED * min(total, output.size / 10):
        return ()
    chance, part = nonlinear_chance(output, drive, past)
    if chance >= RARE or part < _EXPLAINED:
        return ()
    return (flagged("not_linear.products", part=100 * part, chance=chance),)


def _thirds(values: FloatArray) -> IntArray:
    """Groups of low, middle and high values."""
    levels = np.unique(values)
    bounds = levels[1:] if levels.size <= 3 else np.quantile(values, [1 / 3, 2 / 3])
    return np.searchsorted(bounds, values, side="right").astype(np.int64)


def _changes(change: ParameterChange | None, delay: float) -> str:
    """Describe the differences of gains and delays; empty if they are small."""
    if change is None or change.chance >= RARE:
        return ""
    apart = np.ptp(change.shifts) > time_apart(delay, 1.0)
    if not apart and np.ptp(change.gains) <= _GAINS_APART:
        return ""
    gains = ", ".join(f"{100 * gain:+.2g}" for gain in change.gains)
    shifts = ", ".join(f"{shift:+.2g}" for shift in change.shifts)
    return (
        f"the gain deviates by {gains} % and the delay by {shifts} samples from the common "
        f"values (p = {change.chance:.1g})"
    )


def _small_changes(change: ParameterChange | None) -> list[str]:
    if change is None or change.chance >= RARE:
        return []
    gain, shift = 50 * np.ptp(change.gains), np.ptp(change.shifts) / 2
    return [chosen("records.thirds", gain=gain, shift=shift, chance=change.chance)]
