"""Every number that the paper prints, with its place.

J. van Helvoirt et al., *Approximate realization of
valve dynamics with time delay*, IFAC 2005. A name below is followed by the section, figure or
table where its number stands. Misprints are listed in `ERRATA`.

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

from dataclasses import dataclass
from typing import Literal

import numpy as np

from .numerics.arrays import FloatArray
from .numerics.statistics import TrimmedStatistics, trimmed_statistics


@dataclass(frozen=True)
class Settings:
    """Settings of the method, as section 3.2 prints them.

    Parameters
    ----------
    sample_time : float
        Sample time in s (section 3.1).
    difference : str
        "Third order central difference" with error O(Ts^4): the five-point stencil.
    filter_order : int
        Order of the Butterworth low-pass.
    cutoff_hz : float
        Its cut-off.
    zero_phase : bool
        The paper does not say; False is the literal reading, "filtered through".
    order : int
        Order rho of the realization, found by trial and error in `orders_tried`.
    samples : int
        Length n of the impulse response that is realized.
    max_delay : int
        Largest candidate delay.
    trim : int
        Values left out at each end of Table 1.
    orders_tried : tuple of int
        First and last order tried.
    hankel_rows : int
        r = floor(n / 2) (section 2.1, step 2).
    singular_values_shown : int
        Length of Fig. 5.

    Examples
    --------
    >>> from ctrl_realize import paper
    >>> paper.SETTINGS.order, paper.SETTINGS.samples, paper.SETTINGS.max_delay
    (3, 1000, 100)
    """

    sample_time: float = 7.8125e-4
    difference: Literal["central", "backward"] = "central"
    filter_order: int = 5
    cutoff_hz: float = 50.0
    zero_phase: bool = False
    order: int = 3
    samples: int = 1000
    max_delay: int = 100
    trim: int = 3
    orders_tried: tuple[int, int] = (1, 8)
    hankel_rows: int = 500
    singular_values_shown: int = 30


@dataclass(frozen=True)
class SetUp:
    """The experimental set-up (section 2.2) and the step tests (section 3.1).

    Parameters
    ----------
    valve : str
        Type of the control valve.
    current_range : tuple of float
        Range of the input in mA.
    lvdt_range_mm, lvdt_sensitivity_mm_per_v, lvdt_cutoff_hz : float
        Displacement sensor.
    converter_cutoff_hz : float
        The voltage-to-current converter is faster than this.
    bandwidth_hz : float
        Bandwidth of the valve, "around 2 Hz".
    rest : float
        The step comes just after this time in s.
    step_sizes_ma : tuple of float
        Step sizes, 100, 75, 50 and 25 % of the valve's range.
    records_per_size : int
        Records at each step size.
    alias_free_hz : float
        Printed as "Nyquist frequency"; it is the sample rate / 2.56 (see `ERRATA`, E6).

    Examples
    --------
    >>> from ctrl_realize import paper
    >>> paper.SETUP.step_sizes_ma, paper.SETUP.records_per_size
    ((16.0, 12.0, 8.0, 4.0), 10)
    """

    valve: str = "Varipack 28000"
    current_range: tuple[float, float] = (4.0, 20.0)
    lvdt_range_mm: float = 2.54
    lvdt_sensitivity_mm_per_v: float = 0.39
    lvdt_cutoff_hz: float = 30.0
    converter_cutoff_hz: float = 10e3
    bandwidth_hz: float = 2.0
    rest: float = 3.0
    step_sizes_ma: tuple[float, ...] = (16.0, 12.0, 8.0, 4.0)
    records_per_size: int = 10
    alias_free_hz: float = 500.0


@dataclass(frozen=True)
class SteppedSine:
    """The stepped-sine measurement of the FRF (section 3.1, figure 2).

    Parameters
    ----------
    points : int
        Number of frequencies, spaced logarithmically.
    band_hz : tuple of float
        Lowest and highest frequency.
    repeats : int
        Measurements averaged at each frequency.
    frequency_accuracy_hz : float
        Printed accuracy of the input frequency (see `ERRATA`, E14).

    Examples
    --------
    >>> from ctrl_realize import paper
    >>> paper.STEPPED_SINE.points, paper.STEPPED_SINE.band_hz, paper.STEPPED_SINE.repeats
    (500, (0.1, 50.0), 5)
    """

    points: int = 500
    band_hz: tuple[float, float] = (0.1, 50.0)
    repeats: int = 5
    frequency_accuracy_hz: float = 0.1


@dataclass(frozen=True)
class Erratum:
    """A misprint or an open point of the paper, and what this toolbox does about it.

    Parameters
    ----------
    code : str
        E1 ... E17.
    place : str
        Where it stands.
    printed : str
        What is printed, or left unsaid.
    read_as : str
        What is implemented.

    Examples
    --------
    >>> from ctrl_realize import paper
    >>> erratum = paper.ERRATA[0]
    >>> print(erratum.code, "-", erratum.place)
    E1 - section 2.1, step 4
    >>> print(erratum.read_as)
    r for rho: H_a = T(2:r+1,1:r), H_b = T(1:r,1), H_c = T(1,1:r)
    """

    code: str
    place: str
    printed: str
    read_as: str


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
"""Where the model is good (section 3.2, figure 8); printed as 0.01-13 Hz, see `ERRATA`, E13."""

SHOWN_RECORD = (16.0, 5)
"""Step size in mA and number of the record of figures 6 and 7."""

FINAL_RECORD = (16.0, 2)
"""Step size in mA and number of the record of least IAE, which gave the final model."""


def _table_1() -> FloatArray:
    table = np.array(
        [
            [38, 37, 37, 37],
            [37, 34, 38, 38],
            [38, 37, 38, 38],
            [36, 38, 38, 37],
            [37, 37, 35, 38],
            [34, 37, 32, 38],
            [34, 37, 38, 38],
            [33, 35, 38, 38],
            [36, 36, 34, 35],
            [38, 34, 33, 38],
        ],
        dtype=np.float64,
    )
    table.flags.writeable = False
    return table


TABLE_1 = _table_1()
"""Estimated delays in samples: record 1-10 x step size 16, 12, 8, 4 mA (Table 1)."""


def table_1_statistics(*, ddof: int = 1) -> TrimmedStatistics:
    """Summarize Table 1 as section 3.2 says: without the three smallest and highest values.

    Parameters
    ----------
    ddof : int, default 1
        Divisor of the variance is the number of values left minus this.

    Returns
    -------
    TrimmedStatistics
        Mean 36.68, which rounds to `DELAY`; variance 2.10 (2.04 with `ddof` 0), which rounds to
        `DELAY_VARIANCE`.

    Examples
    --------
    >>> from ctrl_realize import paper
    >>> print(f"{paper.table_1_statistics(ddof=0).variance:.3f}")
    2.042
    """
    return trimmed_statistics(TABLE_1, SETTINGS.trim, ddof=ddof)


ERRATA = (
    Erratum(
        "E1",
        "section 2.1, step 4",
        "H_a = T(2:rho+1,1:rho), H_b = T(1:rho,1), H_c = T(1,1:rho): too small for U_rho",
        "r for rho: H_a = T(2:r+1,1:r), H_b = T(1:r,1), H_c = T(1,1:r)",
    ),
    Erratum(
        "E2",
        "section 2.1, step 5",
        "V_rho^T in A and C, wrong by dimension",
        "V_rho",
    ),
    Erratum(
        "E3",
        "section 2.1, step 1",
        "T is built 'from the step response sequence', but contains G",
        "G_k = S_k - S_(k-1), G_0 = S_0; a Hankel matrix of S itself has the pole 1 in it",
    ),
    Erratum(
        "E4",
        "section 2.1, step 4",
        "H_d = S_0, also for the shifted sequences of the delay scan",
        "D = G_d for the candidate delay d",
    ),
    Erratum(
        "E5",
        "section 2.1, step 1",
        "T has zeros for i + j > n + 1",
        "they never enter with r = floor(n/2); hankel='padded' is the version that uses them",
    ),
    Erratum(
        "E6",
        "section 3.1",
        "Nyquist frequency of 500 Hz at Ts = 7.8125e-4 s",
        "Nyquist is 640 Hz; 500 Hz = 1280 Hz / 2.56 is the alias-free band of the analyser",
    ),
    Erratum(
        "E7",
        "section 3.2",
        "'third order central difference', error O(Ts^4)",
        "the five-point stencil, which is of order 4",
    ),
    Erratum(
        "E8",
        "section 3.2",
        "half a sample between difference and model is not mentioned",
        "backward difference = step-invariant; central = impulse-invariant, half a sample early",
    ),
    Erratum(
        "E9",
        "section 3.2",
        "'must be properly scaled'",
        "Markov parameter = Ts dS/dt / A_s, scaled once; the delay found does not depend on it",
    ),
    Erratum(
        "E10",
        "section 2.1",
        "samples over which the IAE is taken are not given",
        "one fixed window 0 ... n + max_delay for all candidates",
    ),
    Erratum(
        "E11",
        "section 3.2",
        "causal or zero-phase filter is not said",
        "zero-phase by default; causal for replication, its lag recorded and removable",
    ),
    Erratum(
        "E12",
        "section 3.2",
        "mean 'after removing the three smallest and highest values', population not given",
        "all 40 values pooled, 3 dropped at each end: 36.68 and 2.04 or 2.10",
    ),
    Erratum(
        "E13",
        "section 3.2",
        "good in the range of 0.01-13 Hz, measured from 0.1 Hz",
        "0.1-13 Hz",
    ),
    Erratum(
        "E14",
        "section 3.1",
        "frequency accuracy 0.1 Hz, with points from 0.1 Hz spaced 1.25 %",
        "every FRF carries its measured frequencies; they need not be monotone in the records",
    ),
    Erratum(
        "E15",
        "sections 2.1 and 3.2",
        "H_e and H_E; length n for a sequence of n + 1 samples",
        "one matrix; G_0 ... G_n with G_0 the feedthrough",
    ),
    Erratum(
        "E16",
        "section 2.2",
        "the 30 Hz of the LVDT is in both measurements and is not mentioned further",
        "it is in every 'valve' model: 5.3 ms or 6.8 samples of lag",
    ),
    Erratum(
        "E17",
        "section 3.2",
        "final model from the record of least IAE",
        "records are normalised first; averaging the records is the better way",
    ),
)
"""Misprints and open points, with the reading that is implemented."""
