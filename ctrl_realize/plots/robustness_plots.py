"""Plots of robustness: to the dead time, to what the identification is unsure of."""

from __future__ import annotations

from typing import Any

import control as ct
import numpy as np

from ..design.delay_robustness import DelayRobustness
from ..design.robustness import RobustnessCheck, UncertaintyBound
from . import style

HERTZ = 2 * np.pi


def delay_robustness_plot(
    found: DelayRobustness, *, ax: style.AxesLike = None, title: str | None = None
) -> ct.ControlPlot:
    """Draw the modulus margin against the plant's dead time, with the interval shaded.

    Parameters
    ----------
    found : DelayRobustness
    ax : Axes or Figure, optional
    title : str, optional

    Returns
    -------
    control.ControlPlot
    """
    with style.context():
        (axes,) = style.axes_for(ax)
        times = found.dead_times
        factor, unit = style.time_unit(float(times.max()), axes)
        low, high = found.dead_time_interval
        axes.axvspan(low * factor, high * factor, color=style.BAND, alpha=0.2, label="interval")
        axes.axvline(
            (found.nominal * found.dt - found.held) * factor, color=style.INPUT, linewidth=1
        )
        lines = axes.plot(
            times * factor, found.modulus_margin, color=style.MODEL, marker="o", label="min |1 + L|"
        )
        bad = ~found.stable_at
        if bad.any():
            axes.plot(
                times[bad] * factor, np.zeros(bad.sum()), "x", color=style.INK, label="unstable"
            )
        axes.set(xlabel=f"dead time of the plant [{unit}]", ylabel="modulus margin")
        axes.set_ylim(bottom=0)
        return style.finished(
            [axes], [lines], title=title or "Robustness to the dead time", own_figure=ax is None
        )


def uncertainty_plot(
    found: UncertaintyBound, *, ax: style.AxesLike = None, title: str | None = None
) -> ct.ControlPlot:
    """Draw the multiplicative uncertainty and its two parts.

    Parameters
    ----------
    found : UncertaintyBound
    ax : Axes or Figure, optional
    title : str, optional

    Returns
    -------
    control.ControlPlot
    """
    with style.context():
        (axes,) = style.axes_for(ax)
        hertz = found.omega / HERTZ
        lines = _positive_loglog(axes, hertz, found.bound, color=style.MODEL, label="bound")
        lines += _positive_loglog(
            axes, hertz, found.spread, color=style.MEASURED, label="spread of the systems"
        )
        lines += _positive_loglog(
            axes, hertz, found.delay_part, color=style.BAND, label="unsure dead time"
        )
        axes.axhline(1, color=style.INPUT, linewidth=1)
        axes.set(xlabel="frequency [Hz]", ylabel="relative error")
        return style.finished(
            [axes], [lines], title=title or "Multiplicative uncertainty", own_figure=ax is None
        )


def robustness_plot(
    found: RobustnessCheck, *, ax: style.AxesLike = None, title: str | None = None
) -> ct.ControlPlot:
    """Draw ``|T|`` under the inverse of the uncertainty bound.

    Parameters
    ----------
    found : RobustnessCheck
    ax : Axes or Figure, optional
    title : str, optional

    Returns
    -------
    control.ControlPlot
    """
    with style.context():
        (axes,) = style.axes_for(ax)
        bound = found.uncertainty
        hertz = bound.omega / HERTZ
        lines = _positive_loglog(axes, hertz, found.complementary, color=style.MODEL, label="|T|")
        with np.errstate(divide="ignore"):
            ceiling = 1 / bound.bound
        keep = np.isfinite(ceiling)
        lines += _positive_loglog(
            axes, hertz[keep], ceiling[keep], color=style.BAND, label="1 / uncertainty"
        )
        at = found.omega_critical / HERTZ
        axes.axvline(at, color=style.INPUT, linewidth=1, label=f"margin {found.margin:.3g}")
        axes.set(xlabel="frequency [Hz]", ylabel="magnitude")
        axes.set_ylim(bottom=max(1e-4, float(found.complementary.min())))
        word = "Robustly stable" if found.robust else "Robust stability not guaranteed"
        return style.finished([axes], [lines], title=title or word, own_figure=ax is None)


def _positive_loglog(axes: Any, x: Any, y: Any, **style_: Any) -> list[Any]:
    keep = y > 0
    return list(axes.loglog(x[keep], y[keep], **style_)) if keep.any() else []
