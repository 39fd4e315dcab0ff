"""Plot of the delays of many records."""

from __future__ import annotations

from typing import Any

import control as ct
import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.lines import Line2D

from .._wording import in_time
from ..errors import DataError
from ..identification.campaign.campaign import Campaign
from ..identification.campaign.rows import CampaignRow
from ..identification.output_error.record_gains import RecordGains
from . import style
from .names import plain
from .shared_docs import documented

_MOST_NAMES = 24
_MOST_GROUPS = 8


@documented()
def campaign_plot(
    campaign: Campaign,
    *,
    trim: int | None = None,
    truth: float | None = None,
    ax: style.AxesLike = None,
    title: str | None = None,
    **kwargs: Any,
) -> ct.ControlPlot:
    """Draw the delay of every record with its interval, and their trimmed mean (Table 1).

    Records are grouped by the height of their step if several have the same one; otherwise, or if
    they are few, they are listed by name.

    Parameters
    ----------
    campaign : Campaign
    trim : int, optional
        Values left out at each end of the mean, see `Campaign.statistics`.
    truth : float, optional
        Known delay in samples, for simulated data.
    **kwargs
        Line properties of the points.

    Raises
    ------
    DataError
        No record was identified, or their sample times differ.

    Examples
    --------
    >>> import ctrl_realize as cr
    >>> valve = cr.bench.valve()
    >>> records = [valve.step_record(16.0, seed) for seed in range(4)]
    >>> cplt = cr.plots.campaign_plot(cr.identify_campaign(records, method="scan"), truth=37.0)
    >>> [text.get_text() for text in cplt.figure.axes[0].get_legend().get_texts()]
    ['trimmed mean 45.00 samples = 35.2 ms', 'truth 37 (simulated)']
    """
    dt = campaign.dt
    summary = campaign.statistics(trim)
    groups = _groups(campaign)
    looks = {"color": style.MEASURED, "marker": "o", "linestyle": "none", **kwargs}
    listed = groups is None
    size = (8.0, max(0.34 * len(campaign.good) + 1.8, 3.2) if listed else 4.8)
    name = f"{len(campaign.good)} records, method {campaign.method}"
    with style.canvas(ax, title=title, default_title=name, size=size) as (axes,):
        if groups is None:
            lines = _by_name(axes, campaign.good, dt, looks)
        else:
            lines = _by_amplitude(axes, groups, dt, looks)
        room = _room_for_legend(axes, 1 if truth is None else 2)
        along = axes.axvline if listed else axes.axhline
        band = axes.axvspan if listed else axes.axhspan
        # Lines across the names end below the legend; those across the heights pass beside it.
        reach = {"ymax": 1 - room} if listed else {}
        if np.isfinite(summary.std_error):
            band(*summary.interval, color=style.BAND, alpha=0.25, linewidth=0, **reach)
        mean = f"trimmed mean {summary.mean:.2f} samples = {in_time(summary.mean * dt)}"
        along(summary.mean, color=style.MODEL, label=mean, **reach)
        if truth is not None:
            known = f"truth {truth:.4g} (simulated)"
            along(truth, color=style.TRUTH, linestyle=":", label=known, **reach)
        return style.finished([axes], [lines], loc="upper left")


@documented()
def gain_plot(
    gains: RecordGains, *, ax: style.AxesLike = None, title: str | None = None, **kwargs: Any
) -> ct.ControlPlot:
    """Draw the gain of every record with its interval over the operating point, and the schedule.

    Horizontal lines reach from the input before the step to that after it; records that are not in
    the fit are drawn as crosses.

    Parameters
    ----------
    gains : RecordGains
        ``sys.fit.gains`` of ``identify(records, gains="own")``.
    **kwargs
        Line properties of the points.

    Examples
    --------
    >>> import ctrl_realize as cr
    >>> valve = cr.bench.valve()
    >>> records = [valve.step_record(amplitude, rng=1) for amplitude in (8.0, 12.0, 16.0)]
    >>> sys = cr.fit_output_error(records, structures=[(3, 3)], gains="own")
    >>> cplt = cr.plots.gain_plot(sys.fit.gains)
    >>> cplt.figure.axes[0].get_xlabel()
    'input level [unit of the input]'
    """
    looks = {"color": style.MEASURED, "marker": "o", "linestyle": "none", **kwargs}
    name = f"{len(gains.names)} records, common dynamics"
    with style.canvas(ax, title=title, default_title=name) as (axes,):
        ends = zip(gains.low, gains.high, strict=True)
        for x, g, span, (low, high) in zip(
            gains.operating_points, gains.gains, gains.input_levels, ends, strict=True
        ):
            thin = {"color": looks["color"], "alpha": 0.45}
            if np.isfinite([low, high]).all():
                axes.plot([x, x], [low, high], linewidth=1.6, marker="_", markersize=12, **thin)
            if gains.scheduled_over == "input level":
                axes.plot(span, [g, g], linewidth=0.8, **thin)
        used = gains.kept
        lines = axes.plot(gains.operating_points[used], gains.gains[used], label="records", **looks)
        if not used.all():
            crosses = {**looks, "marker": "x", "label": "outlying"}
            lines += axes.plot(gains.operating_points[~used], gains.gains[~used], **crosses)
        line: dict[str, Any] = {"color": style.MODEL, "linestyle": style.DASHES[0]}
        points, values = gains.breakpoints
        if points.size > 1:
            shown = np.sort(np.r_[axes.get_xlim(), points])
            lines += axes.plot(shown, np.interp(shown, points, values), label="schedule", **line)
        else:
            lines.append(axes.axhline(gains.reference, label="model", **line))
        of_input, ratio = gains.input_unit or "unit of the input", gains.gain_unit
        axes.set_xlabel(f"{gains.scheduled_over} [{plain(of_input)}]")
        axes.set_ylabel(f"gain [{plain(ratio or 'output / input')}]")
        return style.finished([axes], [lines], loc="best")


def _groups(campaign: Campaign) -> dict[float, list[CampaignRow]] | None:
    """Group by step height; None if this shows less than the names."""
    if not campaign.good:
        raise DataError("no record of the campaign was identified; there is nothing to plot")
    groups: dict[float, list[CampaignRow]] = {}
    for row in campaign.good:
        groups.setdefault(float(f"{row.amplitude:.2g}"), []).append(row)
    shared = len(groups) <= _MOST_GROUPS and len(campaign.good) >= 2 * len(groups)
    if len(campaign.good) > _MOST_NAMES or (shared and len(campaign.good) > 12):
        return dict(sorted(groups.items(), key=lambda item: abs(item[0]))[:_MOST_GROUPS])
    return None


def _by_amplitude(
    axes: Axes, groups: dict[float, list[CampaignRow]], dt: float, looks: dict[str, Any]
) -> list[Line2D]:
    lines: list[Line2D] = []
    for position, rows in enumerate(groups.values()):
        at = position + 0.6 * (np.arange(len(rows)) / max(len(rows) - 1, 1) - 0.5 * (len(rows) > 1))
        low, high = np.array([row.interval for row in rows]).T / dt
        axes.vlines(at, low, high, color=looks["color"], linewidth=1.2, alpha=0.45)
        lines += axes.plot(at, [row.delay for row in rows], **looks)
    axes.set_xticks(range(len(groups)), [f"{height:g}" for height in groups])
    axes.set(xlabel="height of the step [unit of the input]", ylabel="delay [samples]")
    return lines


def _by_name(
    axes: Axes, rows: tuple[CampaignRow, ...], dt: float, looks: dict[str, Any]
) -> list[Line2D]:
    low, high = np.array([row.interval for row in rows]).T / dt
    axes.hlines(range(len(rows)), low, high, color=looks["color"], linewidth=1.6, alpha=0.45)
    names = [plain(row.name, 34) for row in rows]
    axes.set_yticks(range(len(rows)), names, fontsize=10)
    axes.set(ylim=(len(rows) - 0.5, -0.5), xlabel="delay [samples]")
    return list(axes.plot([row.delay for row in rows], range(len(rows)), **looks))


def _room_for_legend(axes: Axes, lines: int) -> float:
    """Reserve the top of the axes for the legend; return its fraction."""
    tall = axes.get_window_extent().height * 72 / axes.figure.dpi
    share = min(1.7 * mpl.rcParams["legend.fontsize"] * lines / max(tall, 1.0), 0.5)
    low, high = axes.get_ylim()  # names are listed downwards
    axes.set_ylim(low, high + (high - low) * share / (1 - share))
    return float(share)
