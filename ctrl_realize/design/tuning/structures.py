"""Ideal, series and parallel form of one PID controller, derivative filter included."""

from __future__ import annotations

import numpy as np

from ...errors import OptionError
from .layouts import Layout

Ideal = tuple[float, float, float, float]
"""kp, ti, td, tf of the ideal form; times in s."""
INF = float("inf")


def structured(ideal: Ideal, layout: Layout) -> Ideal:
    """Gain, integral, derivative and filter of the structure; times in s."""
    kp, ti, td, tf = ideal
    if layout.structure == "parallel":
        return kp, kp / ti, kp * td, tf
    if layout.structure == "ideal" or td == 0:
        return kp, ti, td, tf
    ratio = layout.filter_ratio
    # Zeros of the controller, -1/T1 and -1/T2. With the filter given: T1 + T2 = ti + tf and
    # T1 T2 = ti (td + tf). With tf = ratio T2: T2^2 - ti T2 + ti td / (1 - ratio) = 0.
    fixed = layout.filter_kind == "fixed"
    total = ti if fixed else ti + tf
    product = td / (1 - ratio) if fixed else td + tf
    if ti == INF:
        lead = product
    else:
        inside = total**2 - 4 * ti * product
        if inside < 0:
            longest = ti * (1 - ratio) / 4 if fixed else (ti + tf) ** 2 / (4 * ti) - tf
            raise OptionError(
                f"this controller has no series form, since its zeros are complex: ti={ti:g} s, "
                f"td={td:g} s; expected td of at most {longest:.4g} s. Choose an ideal form, or a "
                f"rule for the series form: design.pid(sys, 'simc', 'PID')"
            )
        # The smaller root without cancellation.
        lead = 2 * ti * product / (total + float(np.sqrt(inside)))
    if fixed:
        tf = ratio * lead
    first = ti + tf - lead
    gain = kp if ti == INF else kp * first / ti
    return gain, first, lead - tf if layout.added else lead, tf


def ideal_of_series(kc: float, first: float, lead: float, tf: float) -> Ideal:
    """Ideal form of ``kc (1 + 1/(first s)) (lead s + 1)/(tf s + 1)``."""
    if first == INF:
        return kc, INF, lead - tf, tf
    ti = first + lead - tf
    return kc * ti / first, ti, first * lead / ti - tf, tf
