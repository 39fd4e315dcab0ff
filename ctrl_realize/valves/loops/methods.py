"""Methods that judge an oscillating loop: index, limits, and what each of them says."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal, TypeAlias

import numpy as np

from ..._facts import facts
from ...numerics.constants import Z_95
from ...numerics.oscillation.cross_correlation import (
    EVEN_HEIGHT,
    EVEN_SHIFT,
    ODD_HEIGHT,
    ODD_SHIFT,
    CrossCorrelation,
)
from ...numerics.oscillation.cycles import Cycles
from ...numerics.oscillation.half_cycles import HalfCycles
from ...numerics.oscillation.movements import LIMIT
from ...numerics.oscillation.stiction_fit import FEWEST_BLOCKS, StictionFit

LoopProcess: TypeAlias = Literal["self-regulating", "flow", "integrating"]
MethodVerdict: TypeAlias = Literal[
    "oscillation", "no oscillation", "stiction", "no stiction", "cannot tell", "not applicable",
]  # fmt: skip

_HE_STICTION, _HE_NONE = 0.6, 0.4
_RELAY = 0.21
_FIT_STICTION, _FIT_NONE = 0.4, 0.25
"""S over the swing of OP. A stem that sticks turns only after the output has changed by S, so that
a limit cycle swings by S or a little more; our own."""
_ACF_REGULAR, _ACF_DECAY, _IAE_ALIKE, _IAE_NOT_ALIKE = 1.0, 0.5, 0.8, 0.4

_METHODS = facts("valves/loops/methods.toml")
VOTERS = ("cross_correlation", "curve_fit", "relay_fit", "movements", "stiction_fit")
"""Methods that are counted in the verdict."""


@dataclass(frozen=True)
class LoopMethod:
    """What one method says about a loop.

    Attributes
    ----------
    key, name : str
        For programs, and in words.
    signal : str
        ``"PV"``, ``"OP"`` or both.
    index, second_index : float
        NaN if the method has none.
    limit : str
        Limits of the indices.
    verdict : str
        ``"oscillation"``, ``"no oscillation"``; ``"stiction"``, ``"no stiction"``;
        ``"cannot tell"`` or ``"not applicable"``.
    note : str
        Why a method is not applicable.
    source : str
        Authors and year, as on the page of references.

    Examples
    --------
    >>> import ctrl_realize as cr
    >>> loop = cr.bench.valve_loop(cr.actuators.Stiction(5, 2), noise=0.1).simulate(1200.0, rng=1)
    >>> method = cr.valves.diagnose_loop(loop.record).method("curve_fit")
    >>> method.verdict, method.limit
    ('stiction', 'stiction from 0.6, none up to 0.4')
    """

    key: str
    name: str
    signal: str
    index: float
    second_index: float
    limit: str
    verdict: MethodVerdict
    note: str
    source: str


def oscillation_methods(cycles: Cycles | None, signal: str) -> list[LoopMethod]:
    """Judge whether there is an oscillation at all, in PV or OP."""
    note = "" if cycles else "no zeros, or too few samples"
    regularity, decay, alike = (
        (cycles.regularity, cycles.decay_ratio, cycles.alike) if cycles else (np.nan,) * 3
    )
    most = f"from {_IAE_ALIKE:g}; none up to {_IAE_NOT_ALIKE:g}"
    words: tuple[MethodVerdict, MethodVerdict] = ("oscillation", "no oscillation")
    regular, decays = regularity > _ACF_REGULAR, decay > _ACF_DECAY
    return [
        _method(key, signal, limit, (index,), note, _verdict(yes, no, words))
        for key, limit, index, yes, no in (
            ("acf_zeros", f"above {_ACF_REGULAR:g}", regularity, regular, not regular),
            ("acf_decay", f"above {_ACF_DECAY:g}", decay, decays, not decays),
            ("iae", most, alike, alike >= _IAE_ALIKE, alike <= _IAE_NOT_ALIKE),
        )
    ]


def horch(found: CrossCorrelation | None, process: LoopProcess, note: str) -> LoopMethod:
    """Judge by the cross-correlation function, which is odd for stiction."""
    limit = (
        f"stiction above {ODD_SHIFT:.2f} and {ODD_HEIGHT:.2f}, none below {EVEN_SHIFT:.2f} and "
        f"{EVEN_HEIGHT:.3f}"
    )
    if process == "integrating":
        found, note = None, "for self-regulating processes only"
    shift, height = (found.shift, found.height) if found else (np.nan, np.nan)
    return _method(
        "cross_correlation", "OP, PV", limit, (shift, height), note or "the function has no zeros",
        _verdict(shift > ODD_SHIFT and height > ODD_HEIGHT,
                 shift < EVEN_SHIFT and height < EVEN_HEIGHT),
    )  # fmt: skip


def curve_fit(
    op: HalfCycles | None, pv: HalfCycles | None, process: LoopProcess, note: str
) -> LoopMethod:
    """Compare a triangle with a sine: in OP, or in PV of an integrating process."""
    limit = f"stiction from {_HE_STICTION:g}, none up to {_HE_NONE:g}"
    signal, halves = ("PV", pv) if process == "integrating" else ("OP", op)
    index = np.nan
    if halves is not None:
        sine, triangle = halves.errors["sine"], halves.errors["triangle"]
        index = sine / (sine + triangle) if sine + triangle > 0 else 0.5
    return _method(
        "curve_fit", signal, limit, (index,), note or _NO_SHAPE,
        _verdict(index >= _HE_STICTION, index <= _HE_NONE),
    )  # fmt: skip


def relay_fit(halves: HalfCycles | None, note: str) -> LoopMethod:
    """Compare the response of a lag to a relay, or a triangle, with a sine: in PV."""
    limit = f"stiction above {_RELAY:g}, none below {-_RELAY:g}"
    index = np.nan
    if halves is not None:
        sine = halves.errors["leaning sine"]
        other = min(halves.errors["relay"], halves.errors["triangle"])
        index = (sine - other) / (sine + other) if sine + other > 0 else 0.0
    said = _verdict(index > _RELAY, index < -_RELAY)
    return _method("relay_fit", "PV", limit, (index,), note or _NO_SHAPE, said)


def movements(found: tuple[float, float] | None, process: LoopProcess, note: str) -> LoopMethod:
    """Judge by the time in which OP moves and the flow does not."""
    limit = f"stiction from {LIMIT:g} in both"
    if process != "flow":
        found, note = None, "for flows, or a measured position, only: process='flow'"
    indices = found or (np.nan, np.nan)
    said = _verdict(min(indices) >= LIMIT, False)
    return _method("movements", "OP, PV", limit, indices, note or "nothing moves", said)


def stiction_fit(found: StictionFit | None, note: str) -> LoopMethod:
    """Judge by the stiction of a Hammerstein model, and by what it explains beyond a linear one."""
    limit = f"stiction from {_FIT_STICTION:g} and {Z_95:.2f}, none up to {_FIT_NONE:g}"
    none = f"no clear oscillation, fewer than {FEWEST_BLOCKS + 2} cycles, or no process fits"
    index, excess = (found.S / found.swing, found.significance) if found else (np.nan, np.nan)
    said = _verdict(index >= _FIT_STICTION and excess > Z_95, index <= _FIT_NONE)
    return _method("stiction_fit", "OP, PV", limit, (index, excess), note or none, said)


_NO_SHAPE = "too few half cycles, or samples in them"


def _verdict(
    yes: bool, no: bool, words: tuple[MethodVerdict, MethodVerdict] = ("stiction", "no stiction")
) -> MethodVerdict:
    return words[0] if yes else words[1] if no else "cannot tell"


def _method(
    key: str, signal: str, limit: str, indices: Sequence[float], note: str, verdict: MethodVerdict
) -> LoopMethod:
    """What a method says; if it has no index, the note says why."""
    known = not np.isnan(indices[0])
    first, second = (float(index) for index in (*indices, np.nan)[:2])
    said: MethodVerdict = verdict if known else "not applicable"
    why = "" if known else note
    return LoopMethod(
        key, signal=signal, index=first, second_index=second, limit=limit, verdict=said, note=why,
        **_METHODS[key],
    )  # fmt: skip
