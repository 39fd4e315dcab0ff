"""Every number printed in the paper, with its place.

J. van Helvoirt et al., *Approximate realization of valve dynamics with time delay*, IFAC 2005. Each
name below is followed by the section, figure or table of its number. Misprints are listed in
`ERRATA`.

Examples
--------
>>> from ctrl_realize import paper
>>> paper.TABLE_1.shape, paper.SETTINGS.samples, paper.DELAY
((10, 4), 1000, 37)
>>> summary = paper.table_1_statistics()
>>> round(summary.mean), round(summary.variance)
(37, 2)
"""

from __future__ import annotations

from ..numerics.statistics import TrimmedStatistics, trimmed_statistics
from . import errata, table_1
from .errata import Erratum
from .settings import Settings, SetUp, SteppedSine

__all__ = [
    "DEAD_TIME", "DELAY", "DELAY_VARIANCE", "ERRATA", "FINAL_RECORD", "SETTINGS", "SETUP",
    "SHOWN_RECORD", "STEPPED_SINE", "TABLE_1", "TRUSTED_BAND_HZ", "Erratum", "SetUp", "Settings",
    "SteppedSine", "TrimmedStatistics", "table_1_statistics", "trimmed_statistics",
]  # fmt: skip


def __dir__() -> list[str]:
    return __all__


SETTINGS = Settings()
"""Section 3.2."""

SETUP = SetUp()
"""Sections 2.2 and 3.1."""

STEPPED_SINE = SteppedSine()
"""Section 3.1 and figure 2."""

DELAY = 37
"""Estimated delay in samples (section 3.2, under Table 1)."""

DELAY_VARIANCE = 2
"""Variance of the delay in samples squared (section 3.2, under Table 1)."""

DEAD_TIME = DELAY * SETTINGS.sample_time
"""The same delay in s: 28.9 ms."""

TRUSTED_BAND_HZ = (0.1, 13.0)
"""Band in which the model is good (section 3.2, figure 8); printed as 0.01-13 Hz, see `ERRATA`,
E13."""

SHOWN_RECORD = (16.0, 5)
"""Step size in mA and number of the record of figures 6 and 7."""

FINAL_RECORD = (16.0, 2)
"""Step size in mA and number of the record with the smallest IAE, which gave the final model."""

TABLE_1 = table_1.DELAYS
"""Estimated delays in samples: record 1-10 x step size 16, 12, 8, 4 mA (Table 1).

:meta hide-value:

Examples
--------
>>> from ctrl_realize import paper
>>> paper.TABLE_1[:2].tolist()
[[38.0, 37.0, 37.0, 37.0], [37.0, 34.0, 38.0, 38.0]]
"""

ERRATA = errata.ERRATA
"""Misprints and open points, each an `Erratum` with the reading that is implemented.

The page *The paper, claim by claim* shows them as a table.

:meta hide-value:

Examples
--------
>>> from ctrl_realize import paper
>>> [erratum.code for erratum in paper.ERRATA][:3]
['E1', 'E2', 'E3']
"""


def table_1_statistics(*, ddof: int = 1) -> TrimmedStatistics:
    """Summarize Table 1 as in section 3.2: without the three smallest and largest values.

    Parameters
    ----------
    ddof : int, default 1
        Divisor of the variance is the number of values minus this.

    Returns
    -------
    TrimmedStatistics
        Mean 36.68, which rounds to `DELAY`; variance 2.10 (2.04 with `ddof` 0), which rounds to
        `DELAY_VARIANCE`.

    References
    ----------
    .. [1] J. van Helvoirt, O. Bosgra, B. de Jager and M. Steinbuch, Approximate realization of
       valve dynamics with time delay, Proc. 16th IFAC World Congress, 2005, section 3.2 and Table
       1.

    Examples
    --------
    >>> from ctrl_realize import paper
    >>> print(f"{paper.table_1_statistics(ddof=0).variance:.3f}")
    2.042
    """
    return trimmed_statistics(TABLE_1, SETTINGS.trim, ddof=ddof)
