"""Worlds of records that were made while a controller was at work."""

from __future__ import annotations

import numpy as np

from .simulation import DT, FINE, Case, H, Plant, coloured, drawn, levels, record

Rng = np.random.Generator


def run(
    plant: Plant,
    controller: object,
    target: np.ndarray,
    disturbance: np.ndarray,
    unstable: float = 0.0,
) -> tuple[np.ndarray, np.ndarray]:
    """Run a loop: the controller sees the disturbed output of every sample.

    With `unstable` the last lag has a pole at +1/lag instead, and its gain there.
    """
    n = target.size
    wait = round(plant.dead_time / H)
    fine = np.zeros(n * FINE + 1)
    poles = np.exp(-H / np.array(plant.lags))
    steer = 1 - poles
    if unstable:
        poles[-1] = np.exp(H / plant.lags[-1])
        steer[-1] = poles[-1] - 1
    state = np.zeros(len(plant.lags))
    u, y = np.zeros(n), np.zeros(n)
    for k in range(n):
        y[k] = plant.gain * state[-1] + disturbance[k]
        u[k] = controller(target[k] - y[k])  # type: ignore[operator]
        for j in range(FINE):
            i = k * FINE + j
            fine[i] = u[k]
            drive = fine[i - wait] if i >= wait else 0.0
            moved = np.concatenate([[drive], state[:-1]])
            state = poles * state + steer * moved
    return u, y


class PID:
    """PI or PID controller with a filtered derivative."""

    def __init__(self, gain: float, reset: float, rate: float = 0.0) -> None:
        self.gain, self.reset, self.rate = gain, reset, rate
        self.sum, self.last = 0.0, 0.0

    def __call__(self, error: float) -> float:
        self.sum += error * DT / self.reset
        slope = (error - self.last) / DT
        self.last = error
        return self.gain * (error + self.sum + self.rate * slope)


def relay(height: float, width: float) -> object:
    state = [height]

    def decide(error: float) -> float:
        if abs(error) > width:
            state[0] = height * float(np.sign(error))
        return state[0]

    return decide


def loop_plant(rng: Rng) -> Plant:
    return drawn(rng, ((0.1, 0.2), (0.4, 0.7)), (0.1, 0.25))


def tuned(plant: Plant, strength: float = 1.0) -> PID:
    """SIMC's PI rule with a closed-loop time constant of the dead time."""
    lag = max(plant.lags)
    delay = plant.dead_time + min(plant.lags) / 2
    reset = min(lag, 8 * delay)
    return PID(strength * lag / (plant.gain * 2 * delay), reset)


def set_points(rng: Rng) -> Case:
    """PI control, set-points every 2 s, coloured disturbance of half their size."""
    plant = loop_plant(rng)
    target = levels(rng, (0.0, 1.0, -1.0), 1000, 200)
    u, y = run(plant, tuned(plant), target, 0.5 * coloured(rng, 1000))
    return plant.case(record(u, y))


def regulation_alone(rng: Rng) -> Case:
    """PI control at one set-point: all that moves is a coloured disturbance."""
    plant = loop_plant(rng)
    u, y = run(plant, tuned(plant), np.zeros(1000), coloured(rng, 1000))
    return plant.case(record(u, y))


def with_derivative(rng: Rng) -> Case:
    """PID control, few set-points, a disturbance with the memory of a second."""
    plant = loop_plant(rng)
    controller = tuned(plant)
    controller.rate = min(plant.lags) / 2
    target = levels(rng, (0.0, 1.0), 1000, 250)
    u, y = run(plant, controller, target, 0.3 * coloured(rng, 1000, 0.99))
    return plant.case(record(u, y))


def relay_cycle(rng: Rng) -> Case:
    """A relay keeps the loop in its limit cycle, 0.5 % of noise."""
    plant = loop_plant(rng)
    noise = 0.005 * plant.gain * rng.standard_normal(1000)
    u, y = run(plant, relay(1.0, 0.03 * plant.gain), np.zeros(1000), noise)
    return plant.case(record(u, y))


def relay_with_load(rng: Rng) -> Case:
    """A relay with a slow disturbance of a quarter of its way."""
    plant = loop_plant(rng)
    load = 0.25 * plant.gain * coloured(
        rng, 1000, 0.995
    ) + 0.005 * plant.gain * rng.standard_normal(1000)
    u, y = run(plant, relay(1.0, 0.03 * plant.gain), np.zeros(1000), load)
    return plant.case(record(u, y))


def unstable(rng: Rng) -> Case:
    """A plant with a pole at +1/s to +2/s, held by a PD controller; set-points every 1.5 s."""
    plant = Plant(0.1, (0.1, float(rng.uniform(0.5, 1.0))), 1.0)
    controller = PID(2.0, 1e9, 0.1)
    target = levels(rng, (0.0, 1.0, -1.0), 900, 150)
    noise = 0.01 * rng.standard_normal(900)
    u, y = run(plant, controller, target, noise, unstable=1.0)
    return Case(record(u, y), plant.dead_time, -plant.gain)


def sticking_valve_in_a_loop(rng: Rng) -> Case:
    """A PI controller and a sticking valve drive each other round; the input is the demand."""
    plant = loop_plant(rng)
    controller, stem = tuned(plant, 0.8), [0.0]
    positions: list[float] = []

    def stuck(error: float) -> float:
        wanted = controller(error)
        positions.append(wanted)
        if abs(wanted - stem[0]) > 0.15 / plant.gain:
            stem[0] = wanted
        return stem[0]

    target = levels(rng, (0.0, 1.0, -1.0), 1000, 250)
    _, y = run(plant, stuck, target, 0.01 * rng.standard_normal(1000))
    return plant.case(record(np.array(positions), y), total_delay=np.nan)


WORLDS = (
    set_points,
    regulation_alone,
    with_derivative,
    relay_cycle,
    relay_with_load,
    unstable,
    sticking_valve_in_a_loop,
)
