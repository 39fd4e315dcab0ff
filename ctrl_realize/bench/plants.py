"""Simulated plants beside the valve: a heater, a tank, a flow."""

from __future__ import annotations

import numpy as np

from .._checks import not_negative, positive, real
from ..errors import OptionError
from .linear import chain, integrator, lag
from .plant import Plant
from .truth import PlantTruth


def heater(
    *,
    gain: float = 0.9,
    lag_time: float = 140.0,
    sensor_lag: float = 12.0,
    dead_time: float = 20.0,
    noise: float = 0.05,
    disturbance: float = 0.05,
    disturbance_time: float = 600.0,
    resolution: float | None = 0.1,
    dt: float = 1.0,
    pre_step_time: float = 120.0,
    hold: float = 900.0,
) -> Plant:
    """Set up a simulated heater: two lags, transport dead time, a changing ambient temperature.

    Gain and lags are those of the Temperature Control Lab, see `datasets.load("tclab")`, which has
    a coarser sensor (0.32 degC); the dead time is that of a flow between heater and sensor.

    Parameters
    ----------
    gain : float, default 0.9
        In degC per % of the heater's power.
    lag_time, sensor_lag : float
        Time constants in s of what is heated, and of the sensor.
    dead_time : float, default 20
        Transport delay in s. Need not be a multiple of `dt`.
    noise : float, default 0.05
        Standard deviation of the sensor's noise in degC.
    disturbance, disturbance_time : float
        Standard deviation in degC and time constant in s of the ambient temperature.
    resolution : float or None, default 0.1
        Of the sensor, in degC; None does not round.
    dt : float, default 1
        Sample time in s.
    pre_step_time, hold : float
        Time in s before and after a step.

    Returns
    -------
    Plant
        Power in %, temperature in degC.

    Raises
    ------
    OptionError
        An invalid argument.

    See Also
    --------
    tank : An integrating plant.
    flow_loop : A fast and noisy plant.

    Examples
    --------
    >>> import ctrl_realize as cr
    >>> print(cr.bench.heater().truth.report())
    Simulated heater: truth
      gain               0.9 degC/%
      poles              0.0011368 Hz, 0.013263 Hz
      dead time          20 s = 20 samples
      total delay at DC  172 s
    """
    return _plant("heater", **locals())


def tank(
    *,
    rate: float = 0.01,
    sensor_lag: float = 4.0,
    dead_time: float = 12.0,
    noise: float = 0.05,
    disturbance: float = 0.05,
    disturbance_time: float = 2.0,
    resolution: float | None = 0.05,
    dt: float = 1.0,
    pre_step_time: float = 60.0,
    hold: float = 200.0,
) -> Plant:
    """Set up a simulated tank: the level integrates the inflow, which arrives late.

    The outflow is constant, so that the level stands still at the input of the steady state.

    Parameters
    ----------
    rate : float, default 0.01
        Slope of the level in % per s, for 1 % of the valve.
    sensor_lag : float, default 4
        Time constant of the level measurement in s.
    dead_time : float, default 12
        Transport delay in s, of a pipe. Need not be a multiple of `dt`.
    noise : float, default 0.05
        Standard deviation of the sensor's noise in %.
    disturbance, disturbance_time : float
        Standard deviation in % and time constant in s of the waves.
    resolution : float or None, default 0.05
        Of the sensor, in %; None does not round.
    dt : float, default 1
        Sample time in s.
    pre_step_time, hold : float
        Time in s before and after a step.

    Returns
    -------
    Plant
        Valve in %, level in %.

    Raises
    ------
    OptionError
        An invalid argument.

    See Also
    --------
    heater : A slow plant that settles.
    flow_loop : A fast and noisy plant.

    Examples
    --------
    >>> import ctrl_realize as cr
    >>> print(cr.bench.tank().truth.report())
    Simulated tank: truth
      integrating        0.01 %/% per s
      poles              0 Hz, 0.039789 Hz
      dead time          12 s = 12 samples
      total delay at DC  16 s
    """
    return _plant("tank", **locals())


def flow_loop(
    *,
    gain: float = 1.2,
    lag_time: float = 0.8,
    sensor_lag: float = 0.25,
    dead_time: float = 0.4,
    noise: float = 0.2,
    disturbance: float = 0.1,
    disturbance_time: float = 0.1,
    resolution: float | None = 0.05,
    dt: float = 0.05,
    pre_step_time: float = 5.0,
    hold: float = 15.0,
) -> Plant:
    """Set up a simulated flow behind a control valve: fast, and noisy by turbulence.

    Parameters
    ----------
    gain : float, default 1.2
        In m3/h per % of the valve.
    lag_time, sensor_lag : float
        Time constants in s of valve and positioner, and of the transmitter.
    dead_time : float, default 0.4
        Of valve and transmitter, in s. Need not be a multiple of `dt`.
    noise : float, default 0.2
        Standard deviation of the sensor's noise in m3/h.
    disturbance, disturbance_time : float
        Standard deviation in m3/h and time constant in s of the turbulence.
    resolution : float or None, default 0.05
        Of the transmitter, in m3/h; None does not round.
    dt : float, default 0.05
        Sample time in s.
    pre_step_time, hold : float
        Time in s before and after a step.

    Returns
    -------
    Plant
        Valve in %, flow in m3/h.

    Raises
    ------
    OptionError
        An invalid argument.

    See Also
    --------
    heater : A slow plant.
    tank : An integrating plant.
    valve_loop : A loop in operation around a valve that sticks.

    Examples
    --------
    >>> import ctrl_realize as cr
    >>> record = cr.bench.flow_loop().step_record(10, rng=1)
    >>> print(f"{record.output[:100].mean():.0f} to {record.output[-100:].mean():.0f} m3/h")
    48 to 60 m3/h
    """
    return _plant("flow loop", **locals())


_KINDS = {
    "heater": (("power", "temperature"), ("%", "degC"), (20.0, 40.0), 30.0),
    "tank": (("valve", "level"), ("%", "%"), (50.0, 30.0), 10.0),
    "flow loop": (("valve", "flow"), ("%", "m3/h"), (40.0, 48.0), 10.0),
}
"""Input and output, their units, the steady state before a record, and the step from it."""


def _plant(
    name: str,
    *,
    sensor_lag: float,
    lag_time: float | None = None,
    gain: float = 1.0,
    rate: float | None = None,
    resolution: float | None,
    **sizes: float,
) -> Plant:
    """Set up a plant of a lag, or an integrator of `rate`, and a sensor."""
    for key, value in (("gain", gain), ("rate", 1.0 if rate is None else rate)):
        if real(value, key, "a number") == 0:
            raise OptionError(f"{key}={value!r}; expected a value other than 0")
    lags = {"lag_time": lag_time, "sensor_lag": sensor_lag}
    parts = [
        lag(1 / (2 * np.pi * positive(value, key, "time constant in s")))
        for key, value in lags.items()
        if value is not None
    ]
    parts += [] if rate is None else [integrator(rate)]
    for key in ("dead_time", "noise", "disturbance"):
        not_negative(sizes[key], key, "time in s, or standard deviation")
    for key in ("dt", "pre_step_time", "hold", "disturbance_time"):
        positive(sizes[key], key, "time in s")
    if resolution is not None:
        positive(resolution, "resolution", "step in units of the output, or None")
    labels, units, steady_state, amplitude = _KINDS[name]
    numbers = {key: float(value) for key, value in sizes.items()}
    dead_time = numbers.pop("dead_time")
    return Plant(
        truth=PlantTruth(chain(parts, gain), dead_time, numbers["dt"], units, name),
        labels=labels, steady_state=steady_state, amplitude=amplitude,
        input_range=(0.0, 100.0), resolution=resolution, drawn_noise=None, **numbers,
    )  # fmt: skip
