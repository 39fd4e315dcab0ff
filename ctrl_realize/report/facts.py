"""Numbers of a report: transfer function, and what stands beside it."""

from __future__ import annotations

from itertools import product

import control as ct
import numpy as np

from .._parameters import Parameter, formula
from .._wording import in_time, poles_in_words, times_in
from ..delayed import DelayedStateSpace
from ..design.models.conversions import to_continuous
from ..errors import CtrlRealizeError
from ..frequency.comparison import FRFComparison
from ..numerics.engine.static_gain import INTEGRATOR
from ..numerics.families.physical import process_parameters

FACTS = frozenset(
    {
        "fit", "residual", "gains of the records", "visible onset", "total delay",
        "total delay at DC", "verdict: dead time", "verdict: gain", "verdict: tuning",
    }
)  # fmt: skip
"""Rows of a fit that stand at the top of a report."""

INTEGRATING = "none: the model integrates"

_EVER = 1e8
"""Length in s of a record in which a pole would not look like an integrator, for models alone."""
_REAL, _AT_ONE = 1e-12, 1e-9
"""Imaginary part of a z-plane pole that counts as rounding, and distance to 1 of an integrator."""
_VANISHING = 1e-9  # part of the coefficients of a numerator that is rounding


def facts_of(system: DelayedStateSpace) -> tuple[tuple[str, str], ...]:
    """List the main numbers of a model, those that are not in its transfer function."""
    fit = system.fit
    facts = [] if fit is None else [row for row in fit._rows() if row[0] in FACTS]
    if fit is None or not fit.parameters:
        facts.append(("order (without the delay)", str(system.delay_free.nstates)))
        if not formula_of(system):
            facts += [("gain", gain_of(system)), ("poles", poles_of(system))]
    with times_in("s"):  # as sample times are set
        return (*facts, ("sample time", in_time(system.dt, 6)))


def poles_of(system: DelayedStateSpace) -> str:
    """Write the core's poles as continuous ones if possible, otherwise as poles of z."""
    poles = np.asarray(system.delay_free.poles(), dtype=np.complex128)
    alternating = (np.abs(poles.imag) <= _REAL) & (poles.real <= 0)
    plant = np.log(poles[~alternating]) / system.dt
    plant[np.abs(poles[~alternating] - 1) < _AT_ONE] = 0.0
    real = np.abs(poles[~alternating].imag) <= _REAL
    plant[real] = plant[real].real
    words = [poles_in_words(plant)] if plant.size else []
    words += [f"z = {pole.real:.3g}" for pole in sorted(poles[alternating], key=lambda z: -abs(z))]
    return ", ".join(words) or "none"


def gain_of(system: DelayedStateSpace) -> str:
    """Write the gain at zero frequency, of each channel, or that there is none."""
    core = system.delay_free
    # one by one: python-control has no zeros where inputs are not as many as outputs
    channels = product(range(core.noutputs), range(core.ninputs))
    gains = [float(np.real(core[i, j].dcgain())) for i, j in channels]
    return ", ".join(f"{gain:.4g}" for gain in gains) if np.isfinite(gains).all() else INTEGRATING


def disagreement(comparison: FRFComparison | None) -> list[tuple[str, str]]:
    """State how far a model is from a measured frequency response."""
    if comparison is None:
        return []
    low, high = comparison.band_hz
    error = 100 * comparison.rms_relative_error
    return [("from the measured response", f"{error:.3g} % rms, {low:.3g} to {high:.3g} Hz")]


def formula_of(system: DelayedStateSpace) -> str:
    """Transfer function in one line: that of the fit, or of the equivalent continuous model.

    Empty for several channels, and if no continuous model has the same samples.
    """
    if system.fit is not None and system.fit.formula:
        return system.fit.formula
    if not system.issiso():
        return ""
    try:
        core, wait = to_continuous(system)
        transfer = ct.ss2tf(core)
    except CtrlRealizeError:
        return ""
    above, below = (np.real(part[0][0]) for part in (transfer.num, transfer.den))
    poles = np.roots(below).astype(np.complex128)
    moving = np.abs(poles[np.abs(poles) * _EVER >= INTEGRATOR])
    pace = float(np.exp(np.mean(np.log(moving)))) if moving.size else 1.0
    numerator = np.asarray(above[::-1] / below[0], dtype=np.float64)
    # Powers of s that are rounding would be zeros far away.
    size = np.abs(numerator) * pace ** np.arange(numerator.size)
    kept = np.flatnonzero(size > _VANISHING * size.max(initial=0.0))
    if not kept.size or kept[0] > 0:
        return ""
    numerator = numerator[: kept[-1] + 1]
    found = process_parameters(poles, numerator, wait, _EVER)
    unit = "s" if system.fit is None else system.fit.time_unit
    integrators = int(np.sum(np.abs(poles) * _EVER < INTEGRATOR))
    shown = [Parameter(one.name, one.value, times=1) for one in found]  # times are told by name
    return formula(shown, integrators, unit)
