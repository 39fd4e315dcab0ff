"""Settings and set-up of the paper."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal


@dataclass(frozen=True)
class Settings:
    """Settings of the method, as printed in section 3.2.

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
        The paper does not state it; False is the literal reading, "filtered through".
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
    pre_step_time : float
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
    pre_step_time: float = 3.0
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
