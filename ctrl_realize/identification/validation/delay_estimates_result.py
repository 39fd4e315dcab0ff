"""Comparison of delay estimates: a table, and whether they agree."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import combinations, product
from typing import TYPE_CHECKING, Literal, get_args

from ..._wording import interval_in_time, time_within
from ...results import Flag, Result

if TYPE_CHECKING:
    import pandas as pd

Kind = Literal["dead time", "upper bound"]


@dataclass(frozen=True)
class DelayEstimate:
    """One delay estimate, in s.

    ``low <= value <= high``. An estimate of kind ``"dead time"`` is one of the dead time itself; an
    ``"upper bound"`` contains the dead time and part of the lags: the dead time is not above
    `high`. An estimate with a `doubt` is not supported by its data or, for a scan, has no
    confidence interval; it is shown but does not count.

    Attributes
    ----------
    method : str
        Method, ``"output error"`` for example.
    source : str
        Data: ``"record"`` or ``"FRF"``.
    kind : {"dead time", "upper bound"}
    value, low, high : float
        Estimate and its interval.
    doubt : str
        Why the estimate does not count; empty if it does.

    Examples
    --------
    >>> import ctrl_realize as cr
    >>> view = cr.validation.DelayEstimate("fit", "sine sweep", "dead time", 0.0289, 0.0285, 0.0294)
    >>> view.low, view.value, view.high
    (0.0285, 0.0289, 0.0294)
    """

    method: str
    source: str
    kind: Kind
    value: float
    low: float
    high: float
    doubt: str = ""


@dataclass(frozen=True, eq=False)
class DelayComparison(Result):
    """Comparison of the delay estimates of several methods.

    `agree` is true if one dead time lies in the interval of every estimate that counts and not
    above any upper bound; `common` is then the interval of such dead times. Otherwise `common` is
    None and `conflicts` lists the pairs that exclude each other. If every estimate is in doubt,
    there is neither agreement nor conflict.

    Attributes
    ----------
    estimates : tuple of DelayEstimate
    agree : bool
    common : tuple of float or None
        In s.
    conflicts : tuple of (str, str)
    rely_on : str or None
        Method of the estimate to use: the narrowest interval among those that count. None if they
        do not agree, or none estimates the dead time itself.
    dt : float or None
        Sample time of the record in s.
    flags : tuple of Flag
        Methods that failed, with reasons.

    Examples
    --------
    >>> import numpy as np
    >>> import ctrl_realize as cr
    >>> f = np.geomspace(0.02, 5, 60)
    >>> s = 2j * np.pi * f
    >>> noise = 0.01 * np.random.default_rng(0).standard_normal(f.size)
    >>> frf = cr.MeasuredFRF(2 * np.exp(-0.125 * s) / (0.3 * s + 1) + noise, f)
    >>> check = cr.validation.compare_delay_estimates(frf=frf, order=1)
    >>> low, high = (1e3 * end for end in check.common)
    >>> print(f"{low:.0f} to {high:.0f} ms, take that of the {check.rely_on}")
    118 to 125 ms, take that of the FRF fit
    """

    estimates: tuple[DelayEstimate, ...]
    dt: float | None
    flags: tuple[Flag, ...] = ()

    @cached_property
    def common(self) -> tuple[float, float] | None:
        """Dead times in s that no estimate rules out; None if there is none."""
        known = counted(self.estimates)
        low = max((each.low for each in known if each.kind == "dead time"), default=0.0)
        high = min((each.high for each in known), default=-1.0)
        return (low, high) if low <= high else None

    @property
    def agree(self) -> bool:
        """Whether there are dead times that no estimate rules out."""
        return self.common is not None

    @property
    def conflicts(self) -> tuple[tuple[str, str], ...]:
        """Pairs of estimates that exclude each other, if all of them do not agree."""
        if self.agree:
            return ()
        known = counted(self.estimates)
        times, bounds = ([one for one in known if one.kind == kind] for kind in get_args(Kind))
        pairs = [*combinations(times, 2), *product(times, bounds)]
        return tuple((one.method, other.method) for one, other in pairs if _apart(one, other))

    @property
    def rely_on(self) -> str | None:
        """Method with the narrowest interval of the dead time among those that count."""
        times = [estimate for estimate in counted(self.estimates) if estimate.kind == "dead time"]
        if not self.agree or not times:
            return None
        return min(times, key=lambda estimate: estimate.high - estimate.low).method

    def table(self) -> pd.DataFrame:
        """Tabulate the estimates, one per row, in s and in samples."""
        import pandas as pd

        rows = pd.DataFrame([vars(estimate) for estimate in self.estimates]).set_index("method")
        if self.dt is not None:
            rows["samples"] = rows["value"] / self.dt
        return rows

    _heading = "Comparison of delay estimates"

    def _rows(self) -> list[tuple[str, str]]:
        rows = [(f"{one.method} ({one.source})", self._words(one)) for one in self.estimates]
        if self.common is not None:
            agreed = f"yes, on {interval_in_time(*self.common)}"
        elif self.conflicts:
            agreed = "no: " + "; ".join(f"{a} against {b}" for a, b in self.conflicts)
        else:
            agreed = "no: every estimate is in doubt"
        rows.append(("they agree", agreed))
        if self.rely_on is not None:
            why = "the narrowest interval among the reliable estimates"
            rows.append(("rely on", f"{self.rely_on}: {why}"))
        return rows + [(f"{one.method} in doubt", one.doubt) for one in self.estimates if one.doubt]

    def _words(self, estimate: DelayEstimate) -> str:
        samples = "" if self.dt is None else f" = {estimate.value / self.dt:.4g} samples"
        kind = "" if estimate.kind == "dead time" else ", upper bound"
        doubt = "; in doubt" if estimate.doubt else ""
        ends = interval_in_time(estimate.low, estimate.high)
        value = time_within(estimate.value, estimate.low, estimate.high)
        return f"{value}{samples} ({ends}{kind}{doubt})"

    def __repr__(self) -> str:
        verdict = "agree" if self.agree else "do not agree" if self.conflicts else "are in doubt"
        return f"<DelayComparison: {len(self.estimates)} estimates that {verdict}>"


def counted(estimates: Sequence[DelayEstimate]) -> list[DelayEstimate]:
    """Leave out the estimates in doubt."""
    return [estimate for estimate in estimates if not estimate.doubt]


def _apart(time: DelayEstimate, other: DelayEstimate) -> bool:
    """Whether two estimates exclude each other."""
    return time.low > other.high or (other.kind == "dead time" and other.low > time.high)
