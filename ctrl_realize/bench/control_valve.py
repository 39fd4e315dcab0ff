"""The valve set-up of the paper, simulated."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Literal, TypeAlias

import numpy as np
from numpy.typing import ArrayLike

from .. import paper
from ..checks import one_of, positive, real, whole
from ..errors import DataError, OptionError
from ..numerics.arrays import FloatArray
from ..signals import Record
from .imperfections import (
    band_limited_noise,
    converted,
    drive_spikes,
    slew_limited,
    with_play,
)
from .linear import (
    Core,
    butterworth,
    chain,
    lag,
    response_to_held_input,
    response_to_started_sine,
    second_order_lag,
)
from .truth import ValveTruth

Seed: TypeAlias = np.random.Generator | int | None

_STROKE_MM = 2.0
_REST_MM = 0.27
_OVERSAMPLING = 8
_AD_RANGE_V = 10.0
_VOLT_PER_MA = 0.25
_SINE_SAMPLES = 640
_SINE_MEAN_MA = 12.0


@dataclass(frozen=True, eq=False)
class Valve:
    """A simulated control valve with its instruments; made by `valve`.

    Every record is a simulation, and is named so. The linear part is simulated without
    integration error, also for dead times that are no multiple of the sample time. The input
    of a record is the current that was asked for, held over each sample, with small noise,
    the spikes of the drive and the rounding of the converter; the spikes are too short to move
    the valve. The output is the displacement that the LVDT shows. Attributes that are not listed
    here are the arguments of `valve`.

    Attributes
    ----------
    truth : ValveTruth
        The linear part: total frequency response, dead time, core.
    """

    truth: ValveTruth = field(repr=False)
    dt: float
    rest: float
    hold: float
    noise: float
    input_noise: float
    spikes: float
    bits: int | None
    anti_aliasing: Literal["linear-phase", "analog"] | None
    drift: float
    hum: float
    slew_limit: float | None
    hysteresis: float
    _before_stem: Core = field(repr=False)
    _after_stem: Core = field(repr=False)

    def __repr__(self) -> str:
        return (
            f"<Valve (simulated): dead time {self.truth.delay:g} samples of {self.dt:g} s, "
            f"noise {100 * self.noise:g} % of the stroke>"
        )

    def step_record(self, amplitude: float = 16.0, rng: Seed = None, *, name: str = "") -> Record:
        """Record one step of the drive current.

        Parameters
        ----------
        amplitude : float, default 16
            Step in mA, from 4 mA up; at most 16.
        rng : numpy.random.Generator or int, optional
            Generator or seed of everything random; without it, each call differs.
        name : str, optional
            Default: ``valve_16mA``, with the amplitude.

        Returns
        -------
        Record
            Current in mA, displacement in mm.

        Raises
        ------
        OptionError
            A step that is zero or leaves the range of 4-20 mA.

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
        n_rest = round(self.rest / self.dt)
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
            Records of each.

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
        whole(repeats, "repeats", 1)
        generator = np.random.default_rng(rng)
        return tuple(
            self.step_record(
                amplitude, generator, name=f"valve_{amplitude:g}mA_{k:02d}".replace(".", "p")
            )
            for amplitude in amplitudes
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
            Not a vector of finite numbers inside 0-25 mA.

        Examples
        --------
        >>> import numpy as np
        >>> import ctrl_realize as cr
        >>> bits = np.random.default_rng(0).integers(0, 2, 60)
        >>> cr.bench.valve().record(8 + 4 * np.repeat(bits, 64), rng=1, name="prbs")
        <Record 'prbs': 3840 samples of 0.00078125 s, 1 input, 1 output>
        """
        held = np.asarray(current)
        if held.ndim != 1 or held.size < 3 or held.dtype.kind not in "biuf":
            raise DataError(
                f"current has shape {held.shape} and type {held.dtype}; needed are N >= 3 real "
                "numbers"
            )
        held = held.astype(np.float64)
        if not np.all(np.isfinite(held)) or held.min() < 0 or held.max() > 25:
            raise DataError("current must be finite and in 0-25 mA in every sample")
        time = self.dt * np.arange(held.size, dtype=np.float64)
        if self.slew_limit is None and self.hysteresis == 0:
            moved = response_to_held_input(self.truth.matrices, held, self.dt, self.truth.dead_time)
        else:
            moved = self._with_friction(held)
        rest = _REST_MM - self.truth.gain * paper.SETUP.current_range[0]
        return self._recorded(time, held, moved + rest, np.random.default_rng(rng), name)

    def stepped_sine(
        self,
        rng: Seed = None,
        *,
        points: int = paper.STEPPED_SINE.points,
        repeats: int = paper.STEPPED_SINE.repeats,
        band_hz: tuple[float, float] = paper.STEPPED_SINE.band_hz,
        amplitude: float = 2.0,
        periods: float = 4.0,
        settle: float = 1.0,
        frequency_error_hz: float = paper.STEPPED_SINE.frequency_accuracy_hz,
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
        amplitude : float, default 2
            Amplitude of the current in mA, about 12 mA.
        periods : float, default 4
            Periods to record, at least.
        settle : float, default 1
            Time in s that is recorded before those periods; the sine starts at t = 0, so that
            the transient is in the record.
        frequency_error_hz : float, default 0.1
            Each frequency is off by up to this much, but by no more than 1 %: the printed
            0.1 Hz cannot hold at 0.1 Hz.

        Returns
        -------
        tuple of tuples of Record
            For each frequency its repeats, as `stepped_sine_frf` takes them. The analyser
            samples slow sines more slowly: all records have 640 samples.

        Raises
        ------
        OptionError
            Frequencies, counts or an amplitude that make no sense, or a valve with friction
            (`slew_limit`, `hysteresis`), which `record` simulates with any input.

        Examples
        --------
        >>> import ctrl_realize as cr
        >>> sweep = cr.bench.valve().stepped_sine(rng=1, points=3)
        >>> sweep[0][4]
        <Record 'valve_sine_001_5': 640 samples of 0.0640625 s, 1 input, 1 output>
        """
        if self.slew_limit is not None or self.hysteresis:
            raise OptionError(
                "stepped_sine simulates the linear valve; with slew_limit or hysteresis pass "
                "sines to record(...)"
            )
        whole(points, "points", 1)
        whole(repeats, "repeats", 1)
        positive(amplitude, "amplitude", "amplitude in mA")
        positive(periods, "periods", "number of periods")
        low, high = (positive(edge, "band_hz", "frequency in Hz") for edge in band_hz)
        generator = np.random.default_rng(rng)
        core, dead_time = self.truth.matrices, self.truth.dead_time
        mean_mm = _REST_MM + self.truth.gain * (_SINE_MEAN_MA - paper.SETUP.current_range[0])
        sweep = []
        for point, nominal in enumerate(np.geomspace(low, high, points), start=1):
            error = min(abs(frequency_error_hz), 0.01 * nominal)
            frequency_hz = nominal + generator.uniform(-error, error)
            wanted = (settle + periods / nominal) / (self.dt * _SINE_SAMPLES)
            dt = self.dt * max(1, int(np.ceil(wanted)))
            if frequency_hz > 0.4 / dt:
                raise OptionError(
                    f"{nominal:g} Hz with periods={periods:g} and settle={settle:g} s does not fit "
                    f"into {_SINE_SAMPLES} samples of {dt:g} s; ask for less"
                )
            time = dt * np.arange(_SINE_SAMPLES, dtype=np.float64)
            omega = 2 * np.pi * frequency_hz
            current = _SINE_MEAN_MA + amplitude * np.sin(omega * time)
            moved = amplitude * response_to_started_sine(core, omega, time, dead_time)
            sweep.append(
                tuple(
                    self._recorded(
                        time,
                        current,
                        mean_mm + moved,
                        generator,
                        f"valve_sine_{point:03d}_{repeat}",
                        spikes=False,
                    )
                    for repeat in range(1, repeats + 1)
                )
            )
        return tuple(sweep)

    def _with_friction(self, held: FloatArray) -> FloatArray:
        """Simulate with slew limit and play between actuator and LVDT, on a finer grid."""
        fine = self.dt / _OVERSAMPLING
        current = np.repeat(held, _OVERSAMPLING)
        stem = response_to_held_input(self._before_stem, current, fine, self.truth.dead_time)
        if self.slew_limit is not None:
            stem = slew_limited(stem, self.slew_limit * _STROKE_MM, fine)
        if self.hysteresis:
            stem = with_play(stem, self.hysteresis * _STROKE_MM)
        # Mean of neighbours: a held input with the area of the straight line between them.
        lines = np.append(0.5 * (stem[1:] + stem[:-1]), stem[-1])
        lines[0] = stem[0]
        return response_to_held_input(self._after_stem, lines, fine, 0.0)[::_OVERSAMPLING]

    def _recorded(
        self,
        time: FloatArray,
        current: FloatArray,
        displacement: FloatArray,
        rng: np.random.Generator,
        name: str,
        *,
        spikes: bool = True,
    ) -> Record:
        """Pass signals through sensor, converter and everything that disturbs them."""
        n = time.size
        limited = self.anti_aliasing is not None
        shown = displacement + band_limited_noise(n, self.noise * _STROKE_MM, rng, limited=limited)
        shown = shown + self.drift * _STROKE_MM * time
        if self.hum:
            phase = rng.uniform(0, 2 * np.pi)
            shown = shown + self.hum * _STROKE_MM * np.sin(2 * np.pi * 50.0 * time + phase)
        range_mm, per_volt = paper.SETUP.lvdt_range_mm, paper.SETUP.lvdt_sensitivity_mm_per_v
        shown = np.clip(shown, 0.0, range_mm)
        full_range = paper.SETUP.current_range[1] - paper.SETUP.current_range[0]
        asked = current + band_limited_noise(n, self.input_noise * full_range, rng, limited=limited)
        if spikes and self.spikes:
            asked = asked + drive_spikes(n, self.spikes, 0.4 * full_range, rng)
        return Record(
            time,
            converted(asked * _VOLT_PER_MA, self.bits, _AD_RANGE_V) / _VOLT_PER_MA,
            converted(shown / per_volt, self.bits, _AD_RANGE_V) * per_volt,
            name=name,
            input_labels=["current (simulated) [mA]"],
            output_labels=["displacement (simulated) [mm]"],
        )


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
    slew_limit: float | None = None,
    hysteresis: float = 0.0,
    dt: float = paper.SETTINGS.sample_time,
    rest: float = paper.SETUP.rest,
    hold: float = 2.0,
) -> Valve:
    """Set up the simulated valve of the paper's sections 2.2 and 3.1.

    Current converter (10 kHz), dead time, actuator (a real pole and a pair, -3 dB at 2.2 Hz),
    LVDT (30 Hz, 0.39 mm/V, range 2.54 mm), anti-aliasing filter at 1/2.56 of the sample rate,
    16-bit converters. The dynamics are ours: the paper prints only a bandwidth of about 2 Hz.

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
        Standard deviation of the output noise, as a fraction of the stroke of 2 mm (16 mA).
        With 4e-4 the printed method scatters as the paper's Table 1 does: variances of 1.2 to
        2.0 in four campaigns, printed is 2.
    input_noise : float, default 2e-4
        The same of the measured current, as a fraction of 16 mA.
    spikes : float, default 6
        Mean number of drive spikes in a record.
    bits : int or None, default 16
        Word length of the AD converters (-+10 V); None rounds nothing.
    anti_aliasing : {"linear-phase", "analog", None}
        "linear-phase": the digital filter of an FFT analyser, whose delay it takes out; the
        motion of the valve passes unchanged, the noise is band-limited. "analog": a
        fourth-order Butterworth filter on the output, whose lag of 1.06 samples is then
        part of the truth.
    drift : float, default 0
        Drift of the output per second, as a fraction of the stroke.
    hum : float, default 0
        Amplitude of 50 Hz hum, as a fraction of the stroke.
    slew_limit : float, optional
        Fastest motion of the stem, in strokes per second.
    hysteresis : float, default 0
        Play of the stem, as a fraction of the stroke.
    dt : float
        Sample time in s, 1/1280 by default.
    rest, hold : float
        Seconds before and after a step.

    Returns
    -------
    Valve

    Raises
    ------
    OptionError
        An argument that makes no sense.

    Examples
    --------
    >>> import ctrl_realize as cr
    >>> print(cr.bench.valve().truth.report())
    Simulated valve: truth
      gain               0.125 mm/mA
      poles              2.2 Hz, 8 Hz (damping 0.7), 30 Hz, 1e+04 Hz
      dead time          28.906 ms = 37 samples
      total delay at DC  134.42 ms
    """
    positive(dt, "dt", "sample time in s")
    if real(dead_time, "dead_time", "dead time in s") < 0:
        raise OptionError(f"dead_time={dead_time!r}; needed is >= 0 s")
    for value, argument in (
        (noise, "noise"),
        (input_noise, "input_noise"),
        (spikes, "spikes"),
        (hysteresis, "hysteresis"),
        (hum, "hum"),
    ):
        if real(value, argument, "a fraction or a count") < 0:
            raise OptionError(f"{argument}={value!r}; needed is >= 0")
    real(drift, "drift", "fraction of the stroke per second")
    positive(rest, "rest", "time in s")
    positive(hold, "hold", "time in s")
    if bits is not None:
        whole(bits, "bits", 2, 32)
    if slew_limit is not None:
        positive(slew_limit, "slew_limit", "speed in strokes per second")
    if anti_aliasing is not None:
        one_of(anti_aliasing, "anti_aliasing", ("linear-phase", "analog"))
    before = [
        lag(paper.SETUP.converter_cutoff_hz),
        lag(positive(lag_hz, "lag_hz", "frequency in Hz")),
        second_order_lag(
            positive(actuator_hz, "actuator_hz", "frequency in Hz"),
            positive(damping, "damping", "damping ratio"),
        ),
    ]
    after = []
    if lvdt_hz is not None:
        after.append(lag(positive(lvdt_hz, "lvdt_hz", "frequency in Hz")))
    if anti_aliasing == "analog":
        after += butterworth(4, 1 / (2.56 * dt))
    gain = _STROKE_MM / (paper.SETUP.current_range[1] - paper.SETUP.current_range[0])
    # An ideal sensor still needs a state; this one is beyond anything that is sampled.
    sensed = after or [lag(1e3 / dt)]
    return Valve(
        truth=ValveTruth(
            matrices=chain(before + after, gain), dead_time=float(dead_time), dt=float(dt)
        ),
        dt=float(dt),
        rest=float(rest),
        hold=float(hold),
        noise=float(noise),
        input_noise=float(input_noise),
        spikes=float(spikes),
        bits=bits,
        anti_aliasing=anti_aliasing,
        drift=float(drift),
        hum=float(hum),
        slew_limit=slew_limit,
        hysteresis=float(hysteresis),
        _before_stem=chain(before, gain),
        _after_stem=chain(sensed),
    )
