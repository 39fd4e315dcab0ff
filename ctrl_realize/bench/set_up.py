"""The valve set-up of the paper."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any, Literal

from .. import paper
from .._checks import integer, not_negative, one_of, positive, real
from ..actuators import Actuator, Backlash
from ..actuators.base import actuators_of
from .control_valve import Valve
from .instruments import MM_PER_MA
from .linear import butterworth, chain, lag, second_order_lag
from .motion import Motion
from .truth import ValveTruth


def valve(
    *,
    dead_time: float = paper.DEAD_TIME,
    lag_hz: float = 2.2,
    actuator_hz: float = 8.0,
    damping: float = 0.7,
    lvdt_hz: float | None = paper.SETUP.lvdt_cutoff_hz,
    noise: float = 1e-3,
    input_noise: float = 2e-4,
    spikes: float = 6.0,
    bits: int | None = 16,
    anti_aliasing: Literal["linear-phase", "analog"] | None = "linear-phase",
    drift: float = 0.0,
    hum: float = 0.0,
    actuator: Actuator | Sequence[Actuator] | None = None,
    actuator_at: Literal["stem", "input"] = "stem",
    dead_time_scatter: float = 0.0,
    scatter_shape: Literal["normal", "exponential"] = "normal",
    sine_amplitude: float = 2.0,
    dt: float = paper.SETTINGS.sample_time,
    pre_step_time: float = paper.SETUP.pre_step_time,
    hold: float = 2.0,
) -> Valve:
    """Set up the simulated valve of the paper's sections 2.2 and 3.1.

    Current converter (10 kHz), dead time, actuator (a real pole and a pair, -3 dB at 2.2 Hz), LVDT
    (30 Hz, 0.39 mm/V, range 2.54 mm), anti-aliasing filter at 1/2.56 of the sample rate, 16-bit
    converters. The dynamics are our choice: the paper only gives a bandwidth of about 2 Hz.

    Parameters
    ----------
    dead_time : float
        Transport delay in s; default 37 samples. Need not be a multiple of `dt`.
    lag_hz : float, default 2.2
        Real pole of the actuator.
    actuator_hz, damping : float
        Its pair of poles.
    lvdt_hz : float or None, default 30
        Cut-off of the displacement sensor; None for an ideal one.
    noise : float, default 1e-3
        Standard deviation of the output noise, as a fraction of the stroke of 2 mm (16 mA). With
        4e-4 the delays of the paper's method scatter as in its Table 1: variances of 1.2 to 2.0 in
        four campaigns, printed is 2.
    input_noise : float, default 2e-4
        The same of the measured current, as a fraction of 16 mA.
    spikes : float, default 6
        Mean number of drive spikes in a record.
    bits : int or None, default 16
        Word length of the AD converters (-+10 V); None does not round.
    anti_aliasing : {"linear-phase", "analog", None}
        "linear-phase": the digital filter of an FFT analyser, whose delay is compensated; the
        motion of the valve is not changed, the noise is band-limited. "analog": a fourth-order
        Butterworth filter on the output, whose lag of 1.06 samples is then part of the true
        dynamics.
    drift : float, default 0
        Drift of the output per second, as a fraction of the stroke.
    hum : float, default 0
        Amplitude of 50 Hz hum, as a fraction of the stroke.
    actuator : Actuator, or sequence of Actuator, optional
        Stiction, backlash, slew limits and so on of `ctrl_realize.actuators`, in % of the stroke (0
        % at 4 mA, 100 % at 20 mA).
    actuator_at : {"stem", "input"}
        Where they act: between the lags of the drive and the sensor, or before all dynamics.
    dead_time_scatter : float, default 0
        Standard deviation in s of the dead time between records, as for a pneumatic drive; `truth`
        contains the mean.
    scatter_shape : {"normal", "exponential"}
        Its distribution. "exponential": never later than the mean by more than one standard
        deviation, and sometimes much earlier, as the values of Table 1 of [1]_.
    sine_amplitude : float, default 2
        Amplitude of `Valve.stepped_sine` in mA.
    dt : float
        Sample time in s, 1/1280 by default.
    pre_step_time, hold : float
        Time in s before and after a step.

    Returns
    -------
    Valve

    Raises
    ------
    OptionError
        An invalid argument.

    References
    ----------
    .. [1] J. van Helvoirt, O. Bosgra, B. de Jager and M. Steinbuch, Approximate realization of
       valve dynamics with time delay, Proc. 16th IFAC World Congress, 2005, sections 2.2 and 3.1.

    Examples
    --------
    >>> import ctrl_realize as cr
    >>> print(cr.bench.valve().truth.report())
    Simulated valve: truth
      gain               0.125 mm/mA
      poles              2.2 Hz, 8 Hz (damping 0.7), 30 Hz, 10000 Hz
      dead time          28.906 ms = 37 samples
      total delay at DC  134.42 ms
    """
    given = {name: _checked(name, value) for name, value in locals().items()}
    parts = given["actuator"] = actuators_of(actuator)
    before = [
        lag(paper.SETUP.converter_cutoff_hz), lag(lag_hz), second_order_lag(actuator_hz, damping)
    ]  # fmt: skip
    after = [] if lvdt_hz is None else [lag(lvdt_hz)]
    if given["anti_aliasing"] == "analog":
        after += butterworth(4, 1 / (2.56 * dt))
    # An ideal sensor still needs a state; this one is faster than anything that is sampled.
    sensed = after or [lag(1e3 / dt)]
    whole = chain(before + after, MM_PER_MA)
    of_motion = ("dead_time", "lag_hz", "actuator_hz", "damping", "lvdt_hz")
    return Valve(
        truth=ValveTruth(matrices=whole, dead_time=float(dead_time), dt=float(dt)),
        _motion=Motion(
            whole=whole,
            before=chain(before, MM_PER_MA),
            after=chain(sensed),
            actuator=parts,
            place=given["actuator_at"],
        ),
        **{name: value for name, value in given.items() if name not in of_motion},
    )


_FRACTION, _TIME, _FREQUENCY = "a fraction or a count", "time in s", "frequency in Hz"
_CHECKS: dict[str, tuple[Callable[..., float], str]] = {
    "dt": (positive, _TIME), "pre_step_time": (positive, _TIME), "hold": (positive, _TIME),
    "dead_time": (not_negative, _TIME), "dead_time_scatter": (not_negative, _TIME),
    "lag_hz": (positive, _FREQUENCY), "actuator_hz": (positive, _FREQUENCY),
    "lvdt_hz": (positive, _FREQUENCY), "damping": (positive, "damping ratio"),
    "noise": (not_negative, _FRACTION), "input_noise": (not_negative, _FRACTION),
    "spikes": (not_negative, _FRACTION), "hum": (not_negative, _FRACTION),
    "drift": (real, "fraction of the stroke per second"),
    "sine_amplitude": (positive, "amplitude in mA"),
}  # fmt: skip
_CHOICES = {
    "anti_aliasing": ("linear-phase", "analog"), "actuator_at": ("stem", "input"),
    "scatter_shape": ("normal", "exponential"),
}  # fmt: skip
_MAY_BE_NONE = ("lvdt_hz", "bits", "anti_aliasing")


def _checked(name: str, value: Any) -> Any:
    """Check an argument of `valve`."""
    if value is None and name in _MAY_BE_NONE:
        return None
    if name in _CHOICES:
        return one_of(value, name, _CHOICES[name])
    if name == "bits":
        return integer(value, name, 2, 32)
    check, what = _CHECKS.get(name, (None, ""))
    return value if check is None else check(value, name, what)


def paper_valve() -> Valve:
    """Set up a valve on which the paper's method gives the paper's Table 1.

    The paper's records are not public. This is one valve of many that would have given them: the
    set-up of section 2.2, with the 30 Hz of the displacement sensor, about 2 Hz of bandwidth, and
    dead time, noise and friction chosen such that `identify_campaign` with ``method="paper"`` finds
    a trimmed mean of 37 samples and a variance of 2 in its forty records, as much at steps of 4 mA
    as at 16 mA, and that the coherence of the stepped sine falls from 13 Hz on.

    The causal filter of the method delays by 13 samples, and it counts the sensor as dead time:
    37 samples by its way are a transport delay of less than half, as `Valve.truth` says. The
    scatter is one of the dead time from record to record. Noise cannot explain it: with steps of
    4 mA it would be the largest. Nor can backlash be more than a few tenths of a percent, or these
    steps would be late.

    Returns
    -------
    Valve

    References
    ----------
    .. [1] J. van Helvoirt, O. Bosgra, B. de Jager and M. Steinbuch, Approximate realization of
       valve dynamics with time delay, Proc. 16th IFAC World Congress, 2005, Table 1 and Fig. 2.

    Examples
    --------
    >>> import ctrl_realize as cr
    >>> valve = cr.bench.paper_valve()
    >>> print(f"{valve.truth.delay:.1f} samples, found as 37")
    16.1 samples, found as 37
    """
    sample = paper.SETTINGS.sample_time
    return valve(
        dead_time=16.1 * sample,
        dead_time_scatter=1.8 * sample,
        scatter_shape="exponential",
        noise=3e-5,
        actuator=Backlash(0.01),
        sine_amplitude=0.12,
    )
