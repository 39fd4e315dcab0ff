"""Flags of a campaign."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator

import numpy as np

from ..._flags import Flag, flagged
from ..._wording import in_time
from ...numerics.constants import Z_95
from ...numerics.validation.own_response import homogeneity
from ..output_error.repeat_flags import BY_CHANCE, NO_COMMON_GAIN, SAME, time_apart
from .rows import CampaignRow

Rows = tuple[CampaignRow, ...]

_NO_GAIN = {"not_died_away", "unstable"}
"""Flags of a row whose gain is not determined."""
_SAME_HEIGHT = 1e-6  # relative difference up to which heights count as equal


def campaign_flags(rows: Rows, good: Rows, failed: Rows, method: str) -> Iterator[Flag]:
    """List the flags of a campaign: of all its rows, of those identified, and of those not."""
    if failed:
        more = "" if len(failed) <= 5 else f" and {len(failed) - 5} more"
        names = ", ".join(row.name for row in failed[:5]) + more
        yield flagged("failed_records", failed=len(failed), records=len(rows), names=names)
    # a record that ends before its response does not tell the gain
    ended = tuple(row for row in good if _NO_GAIN.isdisjoint(flag.code for flag in row.flags))
    yield from _different_gains(ended)
    yield from _different_times(good)
    yield from _same_records(good)
    yield from _amplitude_trend(good, method)


def _different_gains(rows: Rows) -> Iterator[Flag]:
    """Test whether all records have the same gain, by chi-square if the errors are known."""
    gains = np.array([row.gain for row in rows])
    errors = np.array([row.gain_std for row in rows])
    known = np.isfinite(gains)
    gains, errors = gains[known], errors[known]
    if gains.size < 2 or not np.median(gains):
        return
    ratios = gains / float(np.median(gains))
    apart = float(np.max(np.abs(ratios - 1)))
    statistic, chance = homogeneity(gains, errors)
    differ = chance < BY_CHANCE and apart > SAME
    statistics = f"chi-square {statistic:.3g}, p = {chance:.2g}"
    if not np.isfinite(errors).any():
        # The error of a gain from a scan is unknown; noise causes a few percent.
        differ, statistics = apart > NO_COMMON_GAIN, "their errors are unknown"
    low, high = gains.min(), gains.max()
    if differ and apart > NO_COMMON_GAIN:
        yield flagged("no_common_gain.campaign", low=low, high=high)
    if differ:
        yield flagged("gains_differ.campaign", low=low, high=high, statistics=statistics)


def _different_times(rows: Rows) -> Iterator[Flag]:
    """Test dead times and total delays for equality, by chi-square about their weighted means."""
    dead_times = [(row.dead_time, *row.interval) for row in rows]
    totals = [(row.total_delay, *row.total_delay_interval) for row in rows]
    for times in (dead_times, totals):
        values, low, high = np.array(times).reshape(-1, 3).T
        with np.errstate(invalid="ignore"):
            errors = (high - low) / (2 * Z_95)
        # The interval of a scan has no confidence level, and gives no standard error.
        errors[~(errors > 0) | ~np.isfinite([row.gain_std for row in rows])] = np.inf
        statistic, chance = homogeneity(values, errors)
        known = values[np.isfinite(errors)]
        if chance < BY_CHANCE and np.ptp(known) > time_apart(float(np.median(known)), rows[0].dt):
            yield flagged(
                "records_differ.campaign" if times is dead_times else "lags_differ.campaign",
                low=in_time(values.min()),
                high=in_time(values.max()),
                chi_square=statistic,
                chance=chance,
            )


def _same_records(rows: Rows) -> Iterator[Flag]:
    """Find records whose results agree in every digit, which noise excludes."""
    alike: dict[tuple[float, ...], list[str]] = {}
    for row in rows:
        results = (row.delay, row.residual, row.gain, row.amplitude, *row.interval)
        alike.setdefault(results, []).append(row.name)
    twice = [names for names in alike.values() if len(names) > 1]
    if twice:
        yield flagged(
            "same_records.campaign",
            again=sum(len(names) - 1 for names in twice),
            records=len(rows),
            names=", ".join(twice[0][:4]) + (", ..." if len(twice[0]) > 4 else ""),
            more="" if len(twice) == 1 else f" (and {len(twice) - 1} more such groups)",
        )


def _amplitude_trend(rows: Rows, method: str) -> Iterator[Flag]:
    """Test whether the delay depends on the height of the step, by rank correlation."""
    from scipy.stats import pearsonr, spearmanr  # scipy.stats takes a while to import

    if rows and method != "output_error":
        # A realization of higher order gives a shorter delay: only equal orders are compared.
        orders = Counter(row.order for row in rows)
        rows = tuple(row for row in rows if row.order == orders.most_common(1)[0][0])
    heights = np.array([abs(row.amplitude) for row in rows])
    delays = np.array([row.delay for row in rows])
    known = np.isfinite(heights) & np.isfinite(delays)
    heights, delays = heights[known], delays[known]
    if heights.size < 8 or np.ptp(heights) <= _SAME_HEIGHT * heights.max() or np.ptp(delays) == 0:
        return
    correlation, chance = spearmanr(heights, delays)
    if heights.size < 10:
        # So few ranks may be in order by chance (1 in 35 campaigns of four and four records, where
        # Student's distribution gives 1 in 350): the delays themselves must be correlated, too.
        chance = max(chance, pearsonr(heights, delays).pvalue)
    # 1 %: one false alarm in a hundred campaigns of a linear plant.
    trend = abs(np.polyfit(heights, delays, 1)[0]) * np.ptp(heights)
    if not chance < 0.01 or trend <= time_apart(float(np.median(delays)), 1.0) / 2:
        return
    # Noise is larger relative to a smaller step: the bias of a scan grows, and a fit misses fast
    # lags.
    doubt = ""
    if method != "output_error":
        doubt = (
            "; or the bias of the scan, which grows with the noise: check with "
            "method='output_error'"
        )
    elif len({row.order for row in rows if np.isfinite(row.delay)}) > 1:
        doubt = "; or a lag that only large steps show above the noise, since the orders differ"
    way = "longer" if correlation > 0 else "shorter"
    yield flagged(
        "amplitude_trend.campaign", way=way, correlation=correlation, chance=chance, doubt=doubt
    )
