"""Methods that judge an oscillating loop: index, limits, and what each of them says."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal, TypeAlias

import numpy as np

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

_SOURCES = {
    "acf_zeros": "Thornhill, Huang and Zhang 2003",
    "acf_decay": "Miao and Seborg 1999",
    "iae": "Hägglund 1995; Forsman and Stattin 1999",
    "cross_correlation": "Horch 1999",
    "curve_fit": "He et al. 2007",
    "relay_fit": "Rossi and Scali 2005",
    "movements": "Yamashita 2006",
    "stiction_fit": "Srinivasan et al. 2005; Jelali 2008",
}
_NAMES = {
    "acf_zeros": "zeros of the autocorrelation",
    "acf_decay": "decay of the autocorrelation",
    "iae": "areas between zeros (IAE)",
    "cross_correlation": "cross-correlation",
    "curve_fit": "curve fit: sine or triangle",
    "relay_fit": "relay fit",
    "movements": "movements of OP and flow",
    "stiction_fit": "fit of stiction (Hammerstein)",
}
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
    limits = (
        f"above {_ACF_REGULAR:g}",
        f"above {_ACF_DECAY:g}",
        f"from {_IAE_ALIKE:g}; none up to {_IAE_NOT_ALIKE:g}",
    )
    keys = ("acf_zeros", "acf_decay", "iae")
    if cycles is None:
        note = "no zeros, or too few samples"
        return [
            _method(key, signal, np.nan, limit, "not applicable", note=note)
            for key, limit in zip(keys, limits, strict=True)
        ]
    values = (cycles.regularity, cycles.decay_ratio, cycles.alike)
    least = ((_ACF_REGULAR, _ACF_REGULAR), (_ACF_DECAY, _ACF_DECAY), (_IAE_NOT_ALIKE, _IAE_ALIKE))
    found = []
    for key, limit, value, (low, high) in zip(keys, limits, values, least, strict=True):
        said: MethodVerdict = (
            "oscillation" if value > high or value == high < 1
            else "no oscillation" if value <= low else "cannot tell"
        )  # fmt: skip
        found.append(_method(key, signal, value, limit, said))
    return found


def horch(found: CrossCorrelation | None, process: LoopProcess, note: str) -> LoopMethod:
    """Judge by the cross-correlation function, which is odd for stiction."""
    limit = (
        f"stiction above {ODD_SHIFT:.2f} and {ODD_HEIGHT:.2f}, none below {EVEN_SHIFT:.2f} and "
        f"{EVEN_HEIGHT:.3f}"
    )
    if process == "integrating":
        note = "for self-regulating processes only"
    if found is None or process == "integrating" or np.isnan(found.shift):
        note = note or "the function has no zeros"
        return _method("cross_correlation", "OP, PV", np.nan, limit, "not applicable", note=note)
    said: MethodVerdict = "cannot tell"
    if found.shift > ODD_SHIFT and found.height > ODD_HEIGHT:
        said = "stiction"
    elif found.shift < EVEN_SHIFT and found.height < EVEN_HEIGHT:
        said = "no stiction"
    return _method("cross_correlation", "OP, PV", found.shift, limit, said, found.height)


def curve_fit(
    op: HalfCycles | None, pv: HalfCycles | None, process: LoopProcess, note: str
) -> LoopMethod:
    """Compare a triangle with a sine: in OP, or in PV of an integrating process."""
    limit = f"stiction from {_HE_STICTION:g}, none up to {_HE_NONE:g}"
    signal, halves = ("PV", pv) if process == "integrating" else ("OP", op)
    if halves is None:
        return _without_shape("curve_fit", signal, limit, note)
    sine, triangle = halves.errors["sine"], halves.errors["triangle"]
    index = sine / (sine + triangle) if sine + triangle > 0 else 0.5
    said: MethodVerdict = (
        "stiction" if index >= _HE_STICTION
        else "no stiction" if index <= _HE_NONE else "cannot tell"
    )  # fmt: skip
    return _method("curve_fit", signal, index, limit, said)


def relay_fit(halves: HalfCycles | None, note: str) -> LoopMethod:
    """Compare the response of a lag to a relay, or a triangle, with a sine: in PV."""
    limit = f"stiction above {_RELAY:g}, none below {-_RELAY:g}"
    if halves is None:
        return _without_shape("relay_fit", "PV", limit, note)
    sine = halves.errors["leaning sine"]
    other = min(halves.errors["relay"], halves.errors["triangle"])
    index = (sine - other) / (sine + other) if sine + other > 0 else 0.0
    said: MethodVerdict = (
        "stiction" if index > _RELAY else "no stiction" if index < -_RELAY else "cannot tell"
    )
    return _method("relay_fit", "PV", index, limit, said)


def movements(found: tuple[float, float] | None, process: LoopProcess, note: str) -> LoopMethod:
    """Judge by the time in which OP moves and the flow does not."""
    limit = f"stiction from {LIMIT:g} in both"
    if process != "flow":
        note = "for flows, or a measured position, only: process='flow'"
    if found is None or process != "flow":
        note = note or "nothing moves"
        return _method("movements", "OP, PV", np.nan, limit, "not applicable", note=note)
    said: MethodVerdict = "stiction" if min(found) >= LIMIT else "cannot tell"
    return _method("movements", "OP, PV", found[0], limit, said, found[1])


def stiction_fit(found: StictionFit | None, note: str) -> LoopMethod:
    """Judge by the stiction of a Hammerstein model, and by what it explains beyond a linear one."""
    limit = f"stiction from {_FIT_STICTION:g} and {Z_95:.2f}, none up to {_FIT_NONE:g}"
    if found is None:
        note = (
            note
            or f"no clear oscillation, fewer than {FEWEST_BLOCKS + 2} cycles, or no process fits"
        )
        return _method("stiction_fit", "OP, PV", np.nan, limit, "not applicable", note=note)
    index = found.S / found.swing
    said: MethodVerdict = "cannot tell"
    if index >= _FIT_STICTION and found.significance > Z_95:
        said = "stiction"
    elif index <= _FIT_NONE:
        said = "no stiction"
    return _method("stiction_fit", "OP, PV", index, limit, said, found.significance)


def _without_shape(key: str, signal: str, limit: str, note: str) -> LoopMethod:
    note = note or "too few half cycles, or samples in them"
    return _method(key, signal, np.nan, limit, "not applicable", note=note)


def _method(
    key: str,
    signal: str,
    index: float,
    limit: str,
    verdict: MethodVerdict,
    second_index: float = np.nan,
    note: str = "",
) -> LoopMethod:
    return LoopMethod(
        key, _NAMES[key], signal, float(index), float(second_index), limit, verdict, note,
        _SOURCES[key],
    )  # fmt: skip
