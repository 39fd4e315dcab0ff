"""Cores of several channels: aligned with one A, or a model for each output or input."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import control as ct
import numpy as np

from ...data import ImpulseResponse
from ...delayed import DelayedStateSpace, fit_of
from ...delayed.parts import matrices_of
from ...errors import OrderError
from ...numerics.arrays import BoolArray, FloatArray, IntArray, Matrices
from ...numerics.hankel.delay_models import realize_at
from ...numerics.state_space.delay_split import aligned, joined_columns, joined_rows, least_known
from ...results import Flag
from ..realization.result import Realization
from .impulses import channels, check_samples
from .realize import realize

_ASIDE = 1e-6  # weight of an entry without response, of which nothing is to be seen beside others


@dataclass(frozen=True, eq=False)
class Assembly:
    """Core of all channels, with the delays outside it and the orders of its models."""

    core: Matrices
    inputs: tuple[int, ...]
    outputs: tuple[int, ...]
    orders: tuple[int, ...]
    flags: tuple[Flag, ...]

    @property
    def states(self) -> int:
        """States of the whole model, delays included."""
        return int(self.core[0].shape[0]) + sum(self.inputs) + sum(self.outputs)

    def system(self, dt: float, fit: Any = None) -> DelayedStateSpace:
        """Make the system with its delays."""
        core = ct.ss(*self.core, dt)
        return DelayedStateSpace(core, self.inputs, output_delay=self.outputs, fit=fit)


def channel_iae(pieces: Assembly, data: ImpulseResponse) -> FloatArray:
    """Return the IAE of every entry relative to its data."""
    markov = channels(data)
    model = np.reshape(pieces.system(data.dt).markov(data.n_samples), markov.shape)
    with np.errstate(over="ignore", invalid="ignore"):
        error = np.abs(model - markov).sum(axis=-1)
    sums = np.abs(markov).sum(axis=-1)
    error = np.where(np.isfinite(error), error, np.inf)
    share: FloatArray = np.divide(error, sums, out=np.zeros_like(sums), where=sums > 0)
    return share


def _realized(
    data: ImpulseResponse, markov: FloatArray, order: int, samples: int | None
) -> tuple[Matrices, tuple[Flag, ...]]:
    """Realize aligned data with at most `order` states."""
    moved: ImpulseResponse = ImpulseResponse(markov, data.dt, filter=data.filter, name=data.name)
    used = check_samples(moved, samples, order, 0, padded=False, what="delays")
    try:
        system = realize(moved, order, samples=samples)
    except OrderError:
        found = realize_at(markov, 0, used, order, padded=False).singular_values[:order]
        rank = int(np.count_nonzero(found))
        if rank == 0:
            p, m, _ = markov.shape
            return (np.zeros((0, 0)), np.zeros((0, m)), np.zeros((p, 0)), markov[:, :, 0]), ()
        system = realize(moved, rank, samples=samples)
    return matrices_of(system.delay_free), fit_of(system, Realization).flags


def channel_sizes(markov: FloatArray, known: BoolArray) -> tuple[FloatArray, FloatArray]:
    """Sizes of outputs (p,) and inputs (m,), in whose products the entries have similar peaks.

    Least squares of the logarithms, of the entries that respond. Where these leave two sizes apart,
    as of a diagonal plant, the noise of the others decides.
    """
    peak = np.abs(markov).max(axis=-1)
    row, column = np.nonzero(peak)
    weight = np.where(known, 1.0, _ASIDE)[row, column]
    outputs, inputs = map(np.eye, peak.shape)
    beside = np.concatenate([outputs[row], inputs[column]], axis=1) * weight[:, None]
    logs = np.linalg.lstsq(beside, weight * np.log(peak[row, column]), rcond=None)[0]
    return np.exp(logs[: len(peak)]), np.exp(logs[len(peak) :])


def aligned_core(
    data: ImpulseResponse, order: int, outputs: IntArray, inputs: IntArray, samples: int | None
) -> Assembly:
    """Align all channels by delays of inputs and outputs, and realize them with one A."""
    moved = aligned(channels(data), np.add.outer(outputs, inputs))
    core, flags = _realized(data, moved, order, samples)
    before, behind = (tuple(int(d) for d in share) for share in (inputs, outputs))
    return Assembly(core, before, behind, (core[0].shape[0],), flags)


def cores_one_by_one(
    data: ImpulseResponse, order: int, found: IntArray, samples: int | None, axis: int
) -> Assembly:
    """Realize every output (`axis` 0) or input (1) separately, with tapped delay lines."""
    markov = channels(data)
    first = least_known(found, found >= 0, axis)
    # a channel without response uses its delay line unchanged, and adds no tap
    full = np.where(found >= 0, found, np.expand_dims(first, axis))
    count = full.shape[axis]
    advanced = [aligned(markov.take([k], axis), full.take([k], axis)) for k in range(count)]
    realized = [_realized(data, part, order, samples) for part in advanced]
    parts = [core for core, _ in realized]
    join = joined_columns if axis else joined_rows
    core = join(parts, full - np.expand_dims(first, axis))
    taps, none = tuple(int(d) for d in first), (0,) * count
    flags = {flag.code: flag for _, notes in realized for flag in notes}  # one of each kind
    inputs, outputs = (none, taps) if axis else (taps, none)
    orders = tuple(part[0].shape[0] for part in parts)
    return Assembly(core, inputs, outputs, orders, tuple(flags.values()))
