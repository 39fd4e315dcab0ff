"""Simulated control valve with its instruments."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Literal, TypeAlias

import numpy as np
from numpy.typing import ArrayLike

from .. import paper
from .._checks import integer, numbers, positive
from ..actuators import Actuator
from ..data import Record
from ..errors import OptionError
from ..numerics.arrays import FloatArray
from .instruments import STROKE_MM, held_input, recorded
from .motion import SINE_MEAN_MA, Motion
from .truth import ValveTruth

Seed: TypeAlias = np.random.Generator | int | None

_REST_MM = 0.27
"""Displacement at rest, at 4 mA."""
_MOST_MA = 25.0
"""Largest current of the drive."""
_STATIC_DECIMATION = 16
"""Sample time of the static test over that of the steps."""
_STATIC_HOLD = 2.0
"""Time in s at each of its levels."""
_SINE_SAMPLES = 640
_SINE_PERIODS = 4.0
"""Smallest number of periods of a sine that are recorded."""
_SINE_ERROR_HZ = paper.STEPPED_SINE.frequency_accuracy_hz
"""Largest error of its frequency, at most 1 %: the printed 0.1 Hz cannot apply at 0.1 Hz."""


@dataclass(frozen=True, eq=False)
class Valve:
    """A simulated control valve with its instruments; made by `valve`.

    Every record is a simulation, as its name states. The linear part is simulated without
    integration error, for any dead time. The input of a record is the set-point of the current,
    held over each sample, with small noise, the spikes of the drive and the rounding of the
    converter; the spikes are too short to move the valve. The output is the displacement measured
    by the LVDT. Further attributes are the arguments of `valve`.

    Attributes
    ----------
    truth : ValveTruth
        The linear part: total frequency response, dead time, core.

    Examples
    --------
    >>> import ctrl_realize as cr
    >>> valve = cr.bench.valve(noise=0.002)
    >>> record = valve.step_record(16, rng=5)
    >>> print(f"{valve.truth.dead_time:.5f} s, {record.output[-1]:.2f} mm")
    0.02891 s, 2.26 mm
    """

    truth: ValveTruth = field(repr=False)
    dt: float
    pre_step_time: float
    hold: float
    noise: float
    input_noise: float
    spikes: float
    bits: int | None
    anti_aliasing: Literal["linear-phase", "analog"] | None
    drift: float
    hum: float
    actuator: tuple[Actuator, ...]
    actuator_at: Literal["stem", "input"]
    dead_time_scatter: float
    scatter_shape: Literal["normal", "exponential"]
    sine_amplitude: float
    _motion: Motion = field(repr=False)

    def __repr__(self) -> str:
        return (
            f"<Valve (simulated): dead time {self.truth.delay:g} samples of {self.dt:g} s, "
            f"noise {100 * self.noise:g} % of the stroke>"
        )

    @property
    def travel_range(self) -> tuple[float, float]:
        """Displacement in mm at 4 and at 20 mA."""
        return _REST_MM, _REST_MM + STROKE_MM

    def step_record(self, amplitude: float = 16.0, rng: Seed = None, *, name: str = "") -> Record:
        """Record one step of the drive current.

        Parameters
        ----------
        amplitude : float, default 16
            Step in mA, from 4 mA up; at most 16.
        rng : numpy.random.Generator or int, optional
            Generator or seed; without it, each call differs.
        name : str, optional
            Default: ``valve_16mA``, with the amplitude.

        Returns
        -------
        Record
            Current in mA, displacement in mm.

        Raises
        ------
        OptionError
            A step that is zero or exceeds the range of 4-20 mA.

        Examples
        --------
        >>> import ctrl_realize as cr
        >>> cr.bench.valve().step_record(16, rng=5)
        <Record 'valve_16mA': 6400 samples of 0.00078125 s, 1 input, 1 output>
        """
        low, high = paper.SETUP.current_range
        positive(amplitude, "amplitude", f"step in mA, at most {high - low:g}")
        if amplitude > high - low:
            raise OptionError(
                f"amplitude={amplitude!r}; the valve's range is {low:g}-{high:g} mA, so a step "
                f"can have at most {high - low:g} mA"
            )
        n_rest = round(self.pre_step_time / self.dt)
        current = np.full(n_rest + round(self.hold / self.dt), low)
        current[n_rest:] += amplitude
        return self.record(current, rng, name=name or f"valve_{amplitude:g}mA".replace(".", "p"))

    def step_campaign(
        self,
        rng: Seed = None,
        *,
        amplitudes: Sequence[float] = paper.SETUP.step_sizes_ma,
        repeats: int = paper.SETUP.records_per_size,
    ) -> tuple[Record, ...]:
        """Record the paper's campaign: steps of 16, 12, 8 and 4 mA, ten of each.

        Parameters
        ----------
        rng : numpy.random.Generator or int, optional
            Generator or seed.
        amplitudes : sequence of float
            Steps in mA.
        repeats : int, default 10
            Number of records of each.

        Returns
        -------
        tuple of Record
            Named ``valve_16mA_01`` and so on.

        Examples
        --------
        >>> import ctrl_realize as cr
        >>> records = cr.bench.valve().step_campaign(rng=1)
        >>> len(records), records[4].name
        (40, 'valve_16mA_05')
        """
        integer(repeats, "repeats", 1)
        generator = np.random.default_rng(rng)
        return tuple(
            self.step_record(
                amplitude, generator, name=f"valve_{amplitude:g}mA_{k:02d}".replace(".", "p")
            )
            for amplitude in numbers(np.atleast_1d(amplitudes), "amplitudes").tolist()
            for k in range(1, repeats + 1)
        )

    def record(self, current: ArrayLike, rng: Seed = None, *, name: str = "valve") -> Record:
        """Record the response to any drive current.

        Parameters
        ----------
        current : array_like, shape (N,)
            Current in mA, held over each sample. The valve has settled at its first value.
        rng : numpy.random.Generator or int, optional
            Generator or seed.
        name : str, default "valve"
            Name of the record.

        Returns
        -------
        Record
            Current in mA, displacement in mm.

        Raises
        ------
        DataError
            Not a vector of finite numbers within 0-25 mA.

        Examples
        --------
        >>> import numpy as np
        >>> import ctrl_realize as cr
        >>> bits = np.random.default_rng(0).integers(0, 2, 60)
        >>> cr.bench.valve().record(8 + 4 * np.repeat(bits, 64), rng=1, name="prbs")
        <Record 'prbs': 3840 samples of 0.00078125 s, 1 input, 1 output>
        """
        held = held_input(current, "current", (0.0, _MOST_MA), "mA")
        return self._of_held(held, self.dt, np.random.default_rng(rng), name)

    def static_test(
        self, rng: Seed = None, *, levels: int = 11, cycles: int = 3, ramp: float | None = 120.0
    ) -> Record:
        """Record the test of linearity and hysteresis: levels and a ramp over the whole range.

        Section 2.2 of the paper reports that the static relation is linear and hysteresis
        negligible. Here the current rests at each level for 2 s, until the valve has settled, first
        from the lowest to the highest level, then back, and again; a slow ramp up and down follows.
        `ctrl_realize.valves.valve_report` evaluates the record: the steps between the levels give
        the lag along the ramp, and the ramp linearity, hysteresis and dead band.

        Parameters
        ----------
        rng : numpy.random.Generator or int, optional
            Generator or seed.
        levels : int, default 11
            Number of levels from 4 to 20 mA.
        cycles : int, default 3
            Number of times up and down.
        ramp : float or None, default 120
            Duration in s of the ramp in each direction; None for levels alone.

        Returns
        -------
        Record
            Current in mA, displacement in mm, at a 16th of the sample rate.

        Raises
        ------
        OptionError
            Less than three levels, no cycle, or a ramp that is not a positive time.

        Examples
        --------
        >>> import ctrl_realize as cr
        >>> cr.bench.valve().static_test(rng=1)
        <Record 'valve_static': 29440 samples of 0.0125 s, 1 input, 1 output>
        """
        integer(levels, "levels", 3)
        integer(cycles, "cycles", 1)
        dt = _STATIC_DECIMATION * self.dt
        each = round(_STATIC_HOLD / dt)
        up = np.linspace(*paper.SETUP.current_range, levels)
        once = np.concatenate([up[1:], up[-2::-1]])
        held = np.repeat(np.concatenate([up[:1], np.tile(once, cycles)]), each)
        if ramp is not None:
            n_ramp = round(positive(ramp, "ramp", "time in s") / dt)
            climb = np.linspace(*paper.SETUP.current_range, n_ramp)
            parts = [np.full(each, up[0]), climb, np.full(each, up[-1]), climb[::-1]]
            held = np.concatenate([held, *parts, np.full(each, up[0])])
        return self._of_held(held, dt, np.random.default_rng(rng), "valve_static", spikes=False)

    def stepped_sine(
        self,
        rng: Seed = None,
        *,
        points: int = paper.STEPPED_SINE.points,
        repeats: int = paper.STEPPED_SINE.repeats,
        band_hz: tuple[float, float] = paper.STEPPED_SINE.band_hz,
        settle: float = 1.0,
    ) -> tuple[tuple[Record, ...], ...]:
        """Record the paper's stepped sine: 500 frequencies from 0.1 to 50 Hz, 5 times each.

        Parameters
        ----------
        rng : numpy.random.Generator or int, optional
            Generator or seed.
        points, repeats : int
            Frequencies, spaced logarithmically, and records of each.
        band_hz : tuple of float
            Lowest and highest frequency.
        settle : float, default 1
            Time in s recorded before at least four periods; the sine starts at t = 0, so that the
            record contains the transient.

        Returns
        -------
        tuple of tuples of Record
            For each frequency its repeats, as for `stepped_sine_frf`. The analyser uses a lower
            sample rate for slow sines: all records have 640 samples.

        Raises
        ------
        OptionError
            Invalid frequencies or counts.

        Examples
        --------
        >>> import ctrl_realize as cr
        >>> sweep = cr.bench.valve().stepped_sine(rng=1, points=3)
        >>> sweep[0][4]
        <Record 'valve_sine_001_5': 640 samples of 0.0640625 s, 1 input, 1 output>
        """
        integer(points, "points", 1)
        integer(repeats, "repeats", 1)
        low, high = (positive(edge, "band_hz", "frequency in Hz") for edge in band_hz)
        generator = np.random.default_rng(rng)
        mean_mm = _REST_MM + self.truth.gain * (SINE_MEAN_MA - paper.SETUP.current_range[0])
        sweep = []
        for point, nominal in enumerate(np.geomspace(low, high, points), start=1):
            error = min(_SINE_ERROR_HZ, 0.01 * nominal)
            frequency_hz = nominal + generator.uniform(-error, error)
            time = self._sine_time(frequency_hz, settle + _SINE_PERIODS / nominal)
            omega = 2 * np.pi * frequency_hz
            current = SINE_MEAN_MA + self.sine_amplitude * np.sin(omega * time)
            differing = repeats if self.dead_time_scatter else 1
            dead_times = [self._dead_time(generator) for _ in range(differing)]
            moved = self._motion.of_sine(omega, self.sine_amplitude, time, dead_times)
            records = []
            for k in range(repeats):
                name, position = f"valve_sine_{point:03d}_{k + 1}", mean_mm + moved[k % differing]
                one = recorded(self, time, current, position, generator, name, spikes=False)
                records.append(one)
            sweep.append(tuple(records))
        return tuple(sweep)

    def _sine_time(self, frequency_hz: float, span: float) -> FloatArray:
        """Sample a sine at such a rate that the analyser's samples last for `span` s."""
        dt = self.dt * max(1, int(np.ceil(span / (self.dt * _SINE_SAMPLES))))
        if frequency_hz > 0.4 / dt:
            raise OptionError(
                f"{frequency_hz:.4g} Hz for {span:.4g} s does not fit into {_SINE_SAMPLES} "
                f"samples of {dt:g} s; use a shorter settle"
            )
        return dt * np.arange(_SINE_SAMPLES, dtype=np.float64)

    def _of_held(
        self, held: FloatArray, dt: float, rng: np.random.Generator, name: str, **options: bool
    ) -> Record:
        """Record the response to a current that is held over each sample."""
        time = dt * np.arange(held.size, dtype=np.float64)
        rest = _REST_MM - self.truth.gain * paper.SETUP.current_range[0]  # at zero current
        moved = self._motion.of_held(held, dt, self._dead_time(rng))
        return recorded(self, time, held, moved + rest, rng, name, **options)

    def _dead_time(self, generator: np.random.Generator) -> float:
        """Draw the dead time of one record."""
        if not self.dead_time_scatter:
            return self.truth.dead_time
        if self.scatter_shape == "exponential":
            drawn = 1.0 - generator.standard_exponential()
        else:
            drawn = generator.standard_normal()
        return max(0.0, self.truth.dead_time + self.dead_time_scatter * drawn)
