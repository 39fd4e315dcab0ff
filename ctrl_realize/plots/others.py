"""Plots of fitted frequency responses, tracked delays and simulated truth."""

from __future__ import annotations

from typing import Any

import control as ct
import numpy as np

from ..bench.truth import ValveTruth
from ..frequency.frf_fit import FRFFit
from ..identification.tracked import DelayTrack
from ..signals import MeasuredFRF
from . import style
from .frequencies import FITTED, frf_plot


def frf_fit_plot(fit: FRFFit, *, ax: style.AxesLike = None, **kwargs: Any) -> ct.ControlPlot:
    """Draw a fitted frequency response over the measured one.

    Parameters
    ----------
    fit : FRFFit
    ax : sequence of two Axes, or Figure, optional
    **kwargs
        Passed on to `frf_plot`.

    Returns
    -------
    control.ControlPlot

    Examples
    --------
    >>> import numpy as np
    >>> import ctrl_realize as cr
    >>> from ctrl_realize import plots
    >>> f = np.geomspace(0.1, 20, 80)
    >>> s = 2j * np.pi * f
    >>> frf = cr.MeasuredFRF(2 * np.exp(-0.0289 * s) / (0.08 * s + 1) ** 2, f)
    >>> cplt = plots.frf_fit_plot(cr.fit_frf(frf, 2, dt=0.001).fit)
    >>> [text.get_text() for text in cplt.figure.axes[0].get_legend().get_texts()]
    ['measured', 'fit, order 2']
    """
    omega = 2 * np.pi * fit.frequency_hz
    model = np.asarray(fit.core(1j * omega)).reshape(-1) * np.exp(-1j * omega * fit.dead_time)
    measured = MeasuredFRF(fit.measured, fit.frequency_hz, name=fit.name or "measured")
    fitted = MeasuredFRF(model, fit.frequency_hz, name=f"{FITTED} {fit.order}")
    return frf_plot([measured, fitted], ax=ax, dead_time=fit.dead_time, **kwargs)


def truth_plot(truth: ValveTruth, *, ax: style.AxesLike = None, **kwargs: Any) -> ct.ControlPlot:
    """Draw the frequency response of a simulated valve, without noise.

    Parameters
    ----------
    truth : ValveTruth
    ax : sequence of two Axes, or Figure, optional
    **kwargs
        Passed on to `frf_plot`.

    Returns
    -------
    control.ControlPlot

    Examples
    --------
    >>> import ctrl_realize as cr
    >>> from ctrl_realize import plots
    >>> cplt = plots.truth_plot(cr.bench.valve().truth)
    >>> [axes.get_ylabel() for axes in cplt.figure.axes]
    ['gain [dB]', 'phase [deg]']
    """
    frf = truth.frf(np.geomspace(0.1, 50.0, 500))
    return frf_plot(frf, ax=ax, dead_time=truth.dead_time, **kwargs)


def track_plot(
    track: DelayTrack, *, ax: style.AxesLike = None, title: str | None = None, **kwargs: Any
) -> ct.ControlPlot:
    """Draw the course of a tracked dead time and gain; where nothing is claimed, a gap.

    Parameters
    ----------
    track : DelayTrack
    ax : sequence of two Axes, or Figure, optional
    title : str, optional
    **kwargs
        Line properties of the dead time.

    Returns
    -------
    control.ControlPlot

    Examples
    --------
    >>> import control as ct
    >>> import numpy as np
    >>> import ctrl_realize as cr
    >>> from ctrl_realize import plots
    >>> core = ct.ss([[0.9]], [[1.0]], [[0.1]], [[0.0]], 0.01)
    >>> u = np.repeat(np.random.default_rng(0).choice([-1.0, 1.0], 40), 25)
    >>> record = cr.Record(0.01 * np.arange(u.size), u, cr.DelayedStateSpace(core, 7).simulate(u))
    >>> tracker = cr.DelayTracker(cr.DelayedStateSpace(core, 4), max_delay=20, memory=3.0)
    >>> cplt = plots.track_plot(tracker.run(record))
    >>> cplt.figure.axes[0].get_ylabel()
    'dead time [ms]'
    """
    with style.context():
        axes = style.axes_for(ax, 2, size=(8.0, 5.2), heights=(2.0, 1.0))
        factor, unit = style.time_unit(float(np.max(np.abs(track.time))), axes[1])
        time = factor * track.time
        told = np.asarray(track.tells, dtype=bool)
        scale, name = style.time_unit(float(np.nanmax(track.high)) * track.dt)
        looks = {"color": style.MODEL, "label": "dead time", **kwargs}
        axes[0].fill_between(
            time, scale * track.low * track.dt, scale * track.high * track.dt, where=told,
            color=style.BAND, alpha=0.3, linewidth=0, label="95 % interval",
        )  # fmt: skip
        upper = list(axes[0].plot(time, np.where(told, scale * track.dead_time, np.nan), **looks))
        gain = np.where(told, track.gain_ratio, np.nan)
        lower = list(axes[1].plot(time, gain, color=style.MEASURED))
        axes[0].set_ylabel(f"dead time [{name}]")
        axes[1].set_ylabel("gain over\nthe model's")
        axes[1].set_xlabel(f"time [{unit}]")
        return style.finished(axes, [upper, lower], title=title, own_figure=ax is None, loc="above")
