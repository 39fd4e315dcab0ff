"""What the user states of a plant beforehand: no lag is faster, the dead time is within a range.

Both bound the parameters of the candidate models: the results hold if the statements do.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

from ..._checks import band, positive
from ..._flags import flagged
from ..._wording import in_time, interval_in_time, time_within
from ...errors import OptionError
from ...numerics.output_error.other_structures import Requested
from .flags import dead_time_of
from .result import OutputErrorFit
from .words import Stated, order_words


def checked_statements(fastest_lag: Any, dead_time: Any, **others: Any) -> Stated:
    """Check the statements; `others` are arguments beside which there is none.

    Raises
    ------
    OptionError
    """
    if given := [name for name, value in others.items() if value is not None]:
        raise OptionError(f"{given[0]} with fastest_lag or dead_time; expected one of them")
    if fastest_lag is not None:
        fastest_lag = positive(fastest_lag, "fastest_lag", "time in s")
    if dead_time is not None:
        low, high = dead_time = band(dead_time, "dead_time", "s")
        if not 0 <= low < high:
            raise OptionError(f"dead_time={dead_time!r}; expected 0 <= low < high, in s")
    return Stated(fastest_lag, dead_time)


def bounded(plain: Requested, stated: Stated) -> Requested:
    """Limit what is requested of a fit.

    Raises
    ------
    OptionError
        A process model whose lags or dead time have bounds of their own.
    """
    earliest, latest = stated.dead_time or (plain.earliest, plain.latest)
    for form in plain.forms:
        own = not form.dead_time or "dead_time" in {**form.fixed, **form.bounds}
        if stated.fastest_lag is not None or own:
            name = "dead_time" if stated.fastest_lag is None else "fastest_lag"
            raise OptionError(
                f"structures={form.name!r} with {name}; expected an order, or bounds of a "
                "ProcessStructure alone, such as {'lag_1': (2, inf)}"
            )
    return replace(plain, earliest=earliest, latest=latest, fastest=stated.fastest_lag)


def told(
    fit: OutputErrorFit, stated: Stated, again: Callable[[], OutputErrorFit]
) -> OutputErrorFit:
    """Add the statements to a fit; where they bind, compare with the fit without them."""
    flags, estimate = list(fit.flags), fit.estimate
    if stated.dead_time is not None:
        low, high = stated.dead_time
        # It was not max_delay that ended the search.
        flags = [flag for flag in flags if flag.code != "delay_at_bound"]
        estimate = replace(estimate, low=max(estimate.low, low), high=min(estimate.high, high))
        # Where the range ends the interval, the record may contradict it.
        if estimate.low == low or estimate.high == high:
            without = again().interval
            if without[0] > high or without[1] < low:
                said = interval_in_time(low, high), interval_in_time(*without)
                flags.append(flagged("parameter_at_bound.stated", stated=said[0], without=said[1]))
    if stated.fastest_lag is not None and fit.better is not None:
        said = time_within(fit.dead_time, *fit.interval), dead_time_of(fit.better)
        contradicted = flagged(
            "apparent_dead_time.stated",
            lag=in_time(stated.fastest_lag),
            dead_time=said[0],
            other=order_words(fit.better),
            other_dead_time=said[1],
        )
        flags = [contradicted if f.code == contradicted.code else f for f in flags]
    return replace(fit, estimate=estimate, flags=tuple(flags), stated=stated)
