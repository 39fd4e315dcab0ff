"""Simulated plant with a measured output: lags, dead time, disturbance, noise, rounding."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import Protocol

import numpy as np
from numpy.typing import ArrayLike

from .._checks import real
from ..data import Record
from ..errors import OptionError
from ..numerics.arrays import FloatArray
from .control_valve import Seed
from .imperfections import band_limited_noise, slow_disturbance
from .instruments import held_input
from .linear import response_to_changes
from .truth import PlantTruth


class _Noise(Protocol):
    """What a plant takes from the noise model of a fit."""

    dt: float

    @property
    def sigma(self) -> float: ...

    def draw(self, n: int, rng: Seed = None) -> FloatArray: ...


@dataclass(frozen=True, eq=False)
class Plant:
    """A simulated plant in a steady state, made by `heater`, `tank` or `flow_loop`.

    Every record is a simulation, as its labels state. The linear part is simulated without
    integration error, for any dead time. The input of a record is held over each sample and
    recorded exactly, as the output of a controller is. The output is disturbed, noisy and rounded.

    Attributes
    ----------
    truth : PlantTruth
        The linear part: frequency response, dead time, core, gain or integrating rate.
    dt : float
        Sample time in s.
    pre_step_time, hold : float
        Time in s before and after a step.
    steady_state : tuple of float
        Input and output in the steady state before a record.
    amplitude : float
        Step of `step_record` if none is given.
    input_range : tuple of float
        Lowest and highest input.
    noise : float
        Standard deviation of the sensor's white noise, in units of the output.
    disturbance, disturbance_time : float
        Standard deviation and time constant in s of a disturbance of the output, white noise behind
        a lag.
    resolution : float or None
        Step of the sensor's converter, in units of the output; None does not round.
    drawn_noise : NoiseModel or None
        Noise of a measured record in place of `noise` and `disturbance`, see `disturbed_by`.

    Examples
    --------
    >>> import ctrl_realize as cr
    >>> heater = cr.bench.heater()
    >>> heater
    <Plant (simulated heater): dead time 20 s = 20 samples>
    >>> heater.step_record(rng=1)
    <Record 'heater': 1020 samples of 1 s, 1 input, 1 output>
    """

    truth: PlantTruth = field(repr=False)
    dt: float
    pre_step_time: float
    hold: float
    steady_state: tuple[float, float]
    amplitude: float
    input_range: tuple[float, float]
    noise: float
    disturbance: float
    disturbance_time: float
    resolution: float | None
    labels: tuple[str, str]
    drawn_noise: _Noise | None = None

    def __repr__(self) -> str:
        dead_time = f"{self.truth.dead_time:g} s = {self.truth.delay:g} samples"
        return f"<Plant (simulated {self.truth.plant}): dead time {dead_time}>"

    def disturbed_by(self, noise: _Noise) -> Plant:
        """Return the plant with the noise of a measured record in place of its own.

        Parameters
        ----------
        noise : NoiseModel
            As `fit.noise_model` of that record, of the sample time of the plant.

        Returns
        -------
        Plant

        Raises
        ------
        OptionError
            Another sample time.

        Examples
        --------
        >>> import ctrl_realize as cr
        >>> measured = cr.identify(cr.bench.heater().step_record(rng=1)).fit.noise_model
        >>> tank = cr.bench.tank().disturbed_by(measured)
        >>> tank.step_record(rng=2)
        <Record 'tank': 260 samples of 1 s, 1 input, 1 output>
        """
        if abs(noise.dt - self.dt) > 1e-6 * self.dt:
            raise OptionError(
                f"noise has a sample time of {noise.dt:g} s, the plant {self.dt:g} s; expected the "
                f"same: make the plant with dt={noise.dt:g}"
            )
        return replace(self, noise=noise.sigma, disturbance=0.0, drawn_noise=noise)

    def step_record(
        self, amplitude: float | None = None, rng: Seed = None, *, name: str = ""
    ) -> Record:
        """Record one step of the input from the steady state.

        Parameters
        ----------
        amplitude : float, optional
            Step in units of the input, upwards or downwards; default: `self.amplitude`.
        rng : numpy.random.Generator or int, optional
            Generator or seed; without it, each call differs.
        name : str, optional
            Default: the name of the plant.

        Returns
        -------
        Record

        Raises
        ------
        OptionError
            A step of zero, or one that leaves the range of the input.

        Examples
        --------
        >>> import ctrl_realize as cr
        >>> cr.bench.flow_loop().step_record(-10, rng=5, name="down")
        <Record 'down': 400 samples of 0.05 s, 1 input, 1 output>
        """
        step = self.amplitude if amplitude is None else real(amplitude, "amplitude", "step")
        low, high = self.input_range
        if step == 0 or not low <= self.steady_state[0] + step <= high:
            raise OptionError(
                f"amplitude={amplitude!r}; expected a step other than 0 that leads from "
                f"{self.steady_state[0]:g} to a value within {low:g}-{high:g} {self.truth.units[0]}"
            )
        n_rest = round(self.pre_step_time / self.dt)
        held = np.full(n_rest + round(self.hold / self.dt), self.steady_state[0])
        held[n_rest:] += step
        return self.record(held, rng, name=name)

    def record(self, input: ArrayLike, rng: Seed = None, *, name: str = "") -> Record:
        """Record the response to any input.

        Parameters
        ----------
        input : array_like, shape (N,)
            Input, held over each sample. The plant was in a steady state at its first value; for
            an integrating plant, that is the input at which its output stands still.
        rng : numpy.random.Generator or int, optional
            Generator or seed.
        name : str, optional
            Default: the name of the plant.

        Returns
        -------
        Record

        Raises
        ------
        DataError
            Not a vector of finite numbers within the range of the input.

        Examples
        --------
        >>> import numpy as np
        >>> import ctrl_realize as cr
        >>> bits = np.random.default_rng(0).integers(0, 2, 60)
        >>> cr.bench.tank().record(48 + 4 * np.repeat(bits, 30), rng=1, name="prbs")
        <Record 'prbs': 1800 samples of 1 s, 1 input, 1 output>
        """
        held = held_input(input, "input", self.input_range, self.truth.units[0])
        generator = np.random.default_rng(rng)
        truth = self.truth
        start = self.steady_state[1]
        if truth.integrating_rate is None:
            start += truth.gain * (held[0] - self.steady_state[0])
        output = start + response_to_changes(truth.matrices, held, self.dt, truth.dead_time)
        return recorded_plant(self, held, output + added_noise(self, held.size, generator), name)


def added_noise(plant: Plant, n_samples: int, rng: np.random.Generator) -> FloatArray:
    """Draw what is added to the output of a plant: disturbance and noise of the sensor."""
    if plant.drawn_noise is not None:
        return plant.drawn_noise.draw(n_samples, rng)
    slow = slow_disturbance(n_samples, plant.disturbance, plant.disturbance_time, plant.dt, rng)
    return slow + band_limited_noise(n_samples, plant.noise, rng, limited=False)


def rounded_by(plant: Plant, output: FloatArray) -> FloatArray:
    """Round an output to the resolution of the sensor."""
    step = plant.resolution
    return output if step is None else np.asarray(step * np.round(output / step))


def recorded_plant(plant: Plant, held: FloatArray, output: FloatArray, name: str) -> Record:
    """Record of a plant, rounded."""
    truth = plant.truth
    return Record(
        plant.dt * np.arange(held.size, dtype=np.float64),
        held,
        rounded_by(plant, output),
        name=name or truth.plant,
        input_labels=[f"{plant.labels[0]} (simulated) [{truth.units[0]}]"],
        output_labels=[f"{plant.labels[1]} (simulated) [{truth.units[1]}]"],
    )
