"""Plot of the difference between a model and a measured frequency response."""

from __future__ import annotations

from typing import Any

import control as ct
import numpy as np

from ..frequency.comparison import FRFComparison
from ..numerics.arrays import FloatArray
from . import style
from .scales import frequency_axis


def comparison_plot(
    comparison: FRFComparison,
    *,
    ax: style.AxesLike = None,
    title: str | None = None,
    **kwargs: Any,
) -> ct.ControlPlot:
    """Draw how far a model's gain and phase are from the measured ones, and the trusted band.

    Parameters
    ----------
    comparison : FRFComparison
    ax : sequence of two Axes, or Figure, optional
    title : str, optional
        Default: the names of model and measurement, in a new figure.
    **kwargs
        Line properties of both curves.

    Returns
    -------
    control.ControlPlot

    Examples
    --------
    >>> import control as ct
    >>> import numpy as np
    >>> import ctrl_realize as cr
    >>> from ctrl_realize import plots
    >>> model = cr.delayed_ss(ct.tf([1], [0.08, 1]), dead_time=0.03, dt=0.001)
    >>> f = np.geomspace(0.1, 10, 40)
    >>> s = 2j * np.pi * f
    >>> frf = cr.MeasuredFRF(1.02 * np.exp(-0.03 * s) / (0.08 * s + 1), f)
    >>> cplt = plots.comparison_plot(cr.compare_frf(model, frf))
    >>> [axes.get_ylabel() for axes in cplt.figure.axes]
    ['gain error [dB]', 'phase error [deg]']
    """
    errors = (comparison.gain_error_db, comparison.phase_error_deg)
    spread: tuple[FloatArray | None, FloatArray | None] = (None, None)
    if comparison.std is not None:
        relative = comparison.std / np.abs(comparison.measured)
        # Of a complex error, half the power is in the gain and half in the phase.
        half = relative / np.sqrt(2)
        spread = (20 / np.log(10) * half, np.degrees(half))
    looks = {"color": style.MODEL, "linewidth": 1.5, "label": "model - measured", **kwargs}
    with style.canvas(ax, 2, title=title, default_title=comparison.name, size=(8.0, 5.2)) as axes:
        lines = []
        for one, error, std in zip(axes, errors, spread, strict=True):
            one.axvspan(*comparison.band_hz, color=style.TRUTH, alpha=0.10, linewidth=0,
                        label="trusted band")  # fmt: skip
            if std is not None:
                one.fill_between(
                    comparison.frequency_hz, -2 * std, 2 * std, color=style.NOISE, alpha=0.35,
                    linewidth=0, label="noise of the FRF (2 std)",
                )  # fmt: skip
            one.axhline(0.0, color=style.INK, linewidth=1.0)
            trusted = np.where(comparison.trusted, error, np.nan)
            one.plot(comparison.frequency_hz, error, **{**looks, "alpha": 0.3, "label": None})
            lines.append(list(one.plot(comparison.frequency_hz, trusted, **looks)))
            inside = np.abs(error[comparison.trusted])
            limit = 1.6 * max(float(inside.max()), 1e-9)
            one.set_ylim(-limit, limit)
        axes[0].set_ylabel("gain error [dB]")
        axes[1].set_ylabel("phase error [deg]")
        for one in axes:
            frequency_axis(one, label=one is axes[-1])
        return style.finished(axes, lines, loc="upper left")
