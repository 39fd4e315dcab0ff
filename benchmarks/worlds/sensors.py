"""Worlds of step records of two lags: what sensors, historians and disturbances make of them."""

from __future__ import annotations

import numpy as np

from .simulation import (
    DT,
    Case,
    Plant,
    coloured,
    drawn,
    held,
    noisy,
    record,
    sampled,
    step,
    stepped,
)

Rng = np.random.Generator


def plain(rng: Rng) -> tuple[Plant, np.ndarray, np.ndarray]:
    """Draw two lags behind a dead time, a step, and the clean response."""
    plant, u = drawn(rng), step()
    return plant, u, stepped(rng, plant, u)


def dead_band_of_a_historian(rng: Rng) -> Case:
    """Values are stored when they differ from the last one by 2 to 6 % of the range."""
    plant, u, y = plain(rng)
    band = float(rng.uniform(0.02, 0.06)) * np.ptp(y)
    return plant.case(record(u, stored(noisy(rng, y), band)))


def stored(y: np.ndarray, band: float) -> np.ndarray:
    """Exception reporting: the last stored value stands until the next is `band` away."""
    out = y.copy()
    for k in range(1, y.size):
        out[k] = y[k] if abs(y[k] - out[k - 1]) > band else out[k - 1]
    return out


def swinging_door(rng: Rng) -> Case:
    """A historian keeps the corners of lines within 2 % and draws straight lines between them."""
    plant, u, y = plain(rng)
    y, tolerance = noisy(rng, y, 0.002), 0.02 * np.ptp(y)
    kept, k = [0], 1
    while k < y.size:
        j = kept[-1]
        line = np.interp(np.arange(j, k + 1), [j, k], [y[j], y[k]])
        if np.max(np.abs(line - y[j : k + 1])) > tolerance:
            kept.append(k - 1 if k - 1 > j else k)
        k += 1
    kept.append(y.size - 1)
    return plant.case(record(u, np.interp(np.arange(y.size), kept, y[kept])))


def analyser(rng: Rng) -> Case:
    """An analyser takes a sample every 8 to 20 records' samples and holds its result."""
    plant, u, y = plain(rng)
    return plant.case(record(u, every(noisy(rng, y), int(rng.integers(8, 21)), rng)))


def every(y: np.ndarray, period: int, rng: Rng) -> np.ndarray:
    """Hold every `period`-th value, from a random sample on."""
    index = np.arange(y.size)
    return y[np.clip(index - (index - int(rng.integers(0, period))) % period, 0, None)]


def slow_sine(rng: Rng) -> Case:
    """A sinusoidal disturbance of 4 % with a period of 1 to 4 s."""
    plant, u, y = plain(rng)
    wave = np.sin(2 * np.pi * DT * np.arange(u.size) / rng.uniform(1, 4) + rng.uniform(0, 6.28))
    return plant.case(record(u, noisy(rng, y) + 0.04 * np.ptp(y) * wave))


def aliased_hum(rng: Rng) -> Case:
    """50 Hz hum, sampled with 100 Hz and an offset of up to 3 %: a slow line of 3 %."""
    plant, u, y = plain(rng)
    beat = rng.uniform(0.2, 3.0)
    wave = np.sin(2 * np.pi * beat * DT * np.arange(u.size) + rng.uniform(0, 6.28))
    return plant.case(record(u, noisy(rng, y) + 0.03 * np.ptp(y) * wave))


def clipped(rng: Rng) -> Case:
    """The transmitter ends at 70 to 90 % of the way."""
    plant, u, y = plain(rng)
    return plant.case(record(u, np.minimum(noisy(rng, y), rng.uniform(0.7, 0.9) * y.max())))


def clipped_before_its_noise(rng: Rng) -> Case:
    """The output ends at 70 to 90 % of the way, and the noise is added behind that."""
    plant, u, y = plain(rng)
    return plant.case(record(u, noisy(rng, np.minimum(y, rng.uniform(0.7, 0.9) * y.max()))))


def moving_average(rng: Rng) -> Case:
    """The transmitter sends means over 10 to 30 samples."""
    plant, u = drawn(rng), step()
    width = int(rng.integers(10, 31))
    fine = plant.respond(held(u))
    sums = np.cumsum(np.concatenate([np.full(width * 10, fine[0]), fine]))
    y = sampled((sums[width * 10 :] - sums[: -width * 10]) / (width * 10))
    return plant.case(record(u, noisy(rng, y)), total_delay=plant.total_delay + width * DT / 2)


def bent_sensor(rng: Rng) -> Case:
    """A sensor with a quadratic term of 10 to 25 % over the range."""
    plant, u, y = plain(rng)
    bend = float(rng.uniform(0.1, 0.25))
    bent = y + bend * y * (y / y[-1])
    return plant.case(record(u, noisy(rng, bent)), gain=plant.gain * (1 + bend), total_delay=np.nan)


def louder_when_high(rng: Rng) -> Case:
    """Noise in proportion to the output, up to 3 % of it."""
    plant, u, y = plain(rng)
    size = (0.03 * y + 0.001 * y[-1]) * rng.standard_normal(y.size)
    return plant.case(record(u, y + size))


def spikes(rng: Rng) -> Case:
    """Two samples of a hundred are off, by 30 % of the range."""
    plant, u, y = plain(rng)
    wild = 0.3 * np.ptp(y) * rng.standard_normal(y.size) * (rng.random(y.size) < 0.02)
    return plant.case(record(u, noisy(rng, y) + wild))


def jittering_clock(rng: Rng) -> Case:
    """Samples are taken up to one and a half samples off their time."""
    plant, u = drawn(rng), step()
    fine = plant.respond(held(u))
    index = np.arange(u.size) * 10 + rng.integers(-15, 16, u.size)
    return plant.case(record(u, noisy(rng, fine[np.clip(index, 0, fine.size - 1)])))


def lost_packets(rng: Rng) -> Case:
    """A quarter of the samples is lost, in runs; the last value stands."""
    plant, u, y = plain(rng)
    y, lost = noisy(rng, y), False
    for k in range(1, y.size):
        lost = rng.random() < (0.75 if lost else 0.08)
        if lost:
            y[k] = y[k - 1]
    return plant.case(record(u, y))


def load_step(rng: Rng) -> Case:
    """A load of 10 to 30 % of the step comes on during the response or long after it."""
    plant, u, y = plain(rng)
    load = float(rng.uniform(0.1, 0.3) * rng.choice([-1, 1])) * step(
        600, int(rng.integers(150, 500))
    )
    return plant.case(
        record(u, noisy(rng, y + stepped(rng, Plant(0.0, plant.lags, plant.gain), load)))
    )


def random_walk(rng: Rng) -> Case:
    """A disturbance without a level: a random walk of 5 % of the step in all."""
    plant, u, y = plain(rng)
    walk = np.cumsum(rng.standard_normal(u.size)) / np.sqrt(u.size)
    return plant.case(record(u, noisy(rng, y) + 0.05 * np.ptp(y) * walk))


def day_and_night(rng: Rng) -> Case:
    """Slow coloured noise of 3 % of the step, with a memory of a second."""
    plant, u, y = plain(rng)
    return plant.case(record(u, noisy(rng, y) + 0.03 * np.ptp(y) * coloured(rng, u.size, 0.99)))


def coarse(rng: Rng) -> Case:
    """A converter of 8 to 20 steps over the range, no noise to dither it."""
    plant, u, y = plain(rng)
    quantum = np.ptp(y) / float(rng.uniform(8, 20))
    return plant.case(record(u, np.round(noisy(rng, y, 0.001) / quantum + 0.3) * quantum))


WORLDS = (
    dead_band_of_a_historian,
    swinging_door,
    analyser,
    slow_sine,
    aliased_hum,
    clipped,
    clipped_before_its_noise,
    moving_average,
    bent_sensor,
    louder_when_high,
    spikes,
    jittering_clock,
    lost_packets,
    load_step,
    random_walk,
    day_and_night,
    coarse,
)
