"""Dead times of simulated plants of very many lags, from frequency responses and beside records.

Each is fitted as users fit it, and once without chains of lags, diffusion and dispersion.
"""

from __future__ import annotations

import platform
from collections.abc import Callable, Sequence
from datetime import date
from functools import partial

import numpy as np

import ctrl_realize as cr
from ctrl_realize.numerics.rules import Rule, without

_OF_MANY = (Rule.CHAINS, Rule.DIFFUSION, Rule.FLOWS)
_SEEDS = range(500, 572)  # shared by the plants of a group
_PAIRS = range(500, 506)
_LENGTH = 600  # samples of a record at 1 s
_NODES = 24  # of the quadrature: errors of 1e-13
Response = Callable[[np.ndarray], np.ndarray]
Plant = Callable[[np.random.Generator], Response]


def isolated_wall(rng: np.random.Generator) -> Response:
    """Heat that comes through to the isolated side of a wall."""
    spread = rng.uniform(1, 8)
    return lambda s: 2 / (np.exp(-np.sqrt(spread * s)) + np.exp(np.sqrt(spread * s)))


def wall_between(rng: np.random.Generator) -> Response:
    """Heat flow through a wall between two temperatures."""
    spread = rng.uniform(1, 8)
    return lambda s: np.sqrt(spread * s) / np.sinh(np.sqrt(spread * s))


def wall_and_sensor(rng: np.random.Generator) -> Response:
    """An isolated wall in series with a lag."""
    wall, lag = isolated_wall(rng), rng.uniform(0.2, 2)
    return lambda s: wall(s) / (lag * s + 1)


def pipe(rng: np.random.Generator) -> Response:
    """Axial dispersion, Peclet numbers of 3 to 50."""
    mean, c = rng.uniform(1, 4), rng.uniform(0.2, 0.8)
    return lambda s: np.exp((1 - np.sqrt(1 + 2 * c**2 * mean * s)) / c**2)


def pipe_and_sensor(rng: np.random.Generator) -> Response:
    """A pipe in series with a lag."""
    flow, lag = pipe(rng), rng.uniform(0.2, 2)
    return lambda s: flow(s) / (lag * s + 1)


def few_lags(rng: np.random.Generator) -> Response:
    """One to four lags, which is what models are made of."""
    lags = rng.uniform(0.2, 2, int(rng.integers(1, 5)))
    return lambda s: 1 / np.prod(1 + np.multiply.outer(s, lags), axis=-1)


def equal_lags(rng: np.random.Generator) -> Response:
    """Five to twelve equal lags."""
    count, lag = int(rng.integers(5, 13)), rng.uniform(0.1, 0.5)
    return lambda s: 1 / (lag * s + 1) ** count


def several_lags(rng: np.random.Generator) -> Response:
    """Five to eight lags of any size."""
    lags = rng.uniform(0.1, 0.8, int(rng.integers(5, 9)))
    return lambda s: 1 / np.prod(1 + np.multiply.outer(s, lags), axis=-1)


GROUPS: dict[str, tuple[Plant, ...]] = {
    "wall, a third of them behind a lag": (isolated_wall, wall_between, wall_and_sensor),
    "pipe, half of them with a lag": (pipe, pipe_and_sensor),
    "five to twelve equal lags": (equal_lags,),
    "five to eight lags": (several_lags,),
    "one to four lags": (few_lags,),
}


def _points(
    plant: Response, hz: np.ndarray, dead_time: float, noise: float, rng: np.random.Generator
) -> cr.MeasuredFRF:
    """Measure the response at `hz` with errors in proportion to it, which are known."""
    s = 2j * np.pi * hz
    exact = plant(s) * np.exp(-dead_time * s)
    errors = noise / np.sqrt(2) * rng.standard_normal((hz.size, 2)) @ [1, 1j]
    return cr.MeasuredFRF(exact * (1 + errors), hz, std=noise * np.abs(exact))


def _responses(plants: Sequence[Plant], seeds: range) -> list[tuple[float, cr.MeasuredFRF]]:
    """Dead times and 60 points of the plants, 0.3 or 1 % of noise."""
    made = []
    for number, plant in enumerate(plants):
        for seed in seeds:
            rng = np.random.default_rng([seed, number])
            dead_time = rng.uniform(0.2, 2)
            hz = np.geomspace(0.002, rng.choice([0.5, 1.0, 2.0]), 60)
            noise = rng.choice([0.003, 0.01])
            made.append((dead_time, _points(plant(rng), hz, dead_time, noise, rng)))
    return made


def _step(plant: Response, t: np.ndarray) -> np.ndarray:
    """Sample the response to a step at 0, by a quadrature of its Laplace transform [1]_.

    References
    ----------
    .. [1] L. N. Trefethen, J. A. C. Weideman and T. Schmelzer, Talbot quadratures and rational
       approximations, BIT 46 (2006) 653-670, doi:10.1007/s10543-006-0077-9, equation 3.3.
    """
    theta = np.pi * np.arange(1, _NODES, 2) / _NODES
    angle = 0.6407 * theta
    path = _NODES * (0.5017 * theta / np.tan(angle) - 0.6122 + 0.2645j * theta)
    along = 0.5017 / np.tan(angle) - 0.5017 * angle / np.sin(angle) ** 2 + 0.2645j
    after = np.where(t > 0, t, 1.0)[:, None]
    values = 2 * (np.exp(path) / path * along * plant(path / after)).sum(axis=1).imag
    return np.where(t > 0, values, 0.0)


def _pairs(plants: Sequence[Plant], seeds: range) -> list[tuple[float, cr.Record, cr.MeasuredFRF]]:
    """Dead times, step records with 1 % of noise and 30 points with as much; times in 10 s."""
    made = []
    for number, plant in enumerate(plants):
        for seed in seeds:
            rng = np.random.default_rng([seed, number])
            dead_time, fast = rng.uniform(2, 20), plant(rng)
            slow: Response = lambda s, fast=fast: fast(10 * s)  # noqa: E731
            t = np.arange(-100.0, _LENGTH)
            y = _step(slow, t - dead_time) + 0.01 * rng.standard_normal(t.size)
            record = cr.Record(t, (t >= 0).astype(float), y)
            hz = np.geomspace(5e-4, 0.06, 30)
            made.append((dead_time, record, _points(slow, hz, dead_time, 0.01, rng)))
    return made


Case = tuple[float, cr.results.ModelFit]


def _row(name: str, cases: Callable[[], Sequence[Case]]) -> str:
    """Count dead times outside their intervals, and compare widths and errors."""
    outside, widths, errors = [], [], []
    for off in (_OF_MANY, ()):
        with without(*off):
            fits = cases()
        outside.append(sum(not fit.interval[0] <= true <= fit.interval[1] for true, fit in fits))
        widths.append(np.array([np.ptp(fit.interval) for _, fit in fits]))
        errors.append(1e3 * float(np.median([abs(fit.dead_time - true) for true, fit in fits])))
    wider = np.median(widths[1] / widths[0])
    counts, median = "{} | {}".format(*outside), "{:.0f} | {:.0f}".format(*errors)
    return f"| {name} | {len(fits)} | {counts} | {wider:.2f} | {median} |"


def _of_responses(plants: Sequence[Plant], seeds: range) -> list[Case]:
    return [(true, cr.fit_frf(frf).fit) for true, frf in _responses(plants, seeds)]


def _of_inputs(plants: Sequence[Plant], seeds: range) -> list[Case]:
    """1500 samples at 0.1 s from rest, random signs held for 1.5 s, 0.3 or 2 % of noise."""
    found = []
    for number, plant in enumerate(plants):
        for seed in seeds:
            rng = np.random.default_rng([seed, number])
            u = np.repeat(rng.choice([-1.0, 1.0], 100), 15)
            dead_time, t = rng.uniform(0.2, 2), 0.1 * np.arange(u.size)
            pulse = np.diff(_step(plant(rng), t - dead_time), prepend=0)
            y = np.convolve(u, pulse)[: u.size]
            y += rng.choice([0.003, 0.02]) * rng.standard_normal(u.size)
            found.append((dead_time, cr.identify(cr.Record(t, u, y)).fit))
    return found


def _of_pairs(plants: Sequence[Plant]) -> list[Case]:
    found = []
    for true, record, frf in _pairs(plants, _PAIRS):
        found.append((true, cr.identify(record, frf=frf).fit))
    return found


_HEAD = (
    "| simulated plant | cases | outside, lags and zeros alone | outside | interval, times "
    "wider (median) | error in ms, lags and zeros alone (median) | error in ms |",
    "|---|---|---|---|---|---|---|",
)


def table_of_inputs() -> str:
    """Make the table of records of random steps in Markdown."""
    lines = [*_HEAD]
    for name, plants in GROUPS.items():
        lines.append(_row(name, partial(_of_inputs, plants, _SEEDS[: 12 // len(plants)])))
    lines += [
        "",
        f"Made on {date.today()} by `python -m benchmarks.records lags_of_inputs` with Python "
        f"{platform.python_version()}, ctrl-realize {cr.__version__}, numpy {np.__version__}. Data "
        "are simulated: 1500 samples at 0.1 s, random signs held for 1.5 s, with 0.3 or 2 % of "
        "noise.",
        "",
    ]
    return "\n".join(lines)


def table() -> str:
    """Make the table in Markdown."""
    lines = [*_HEAD]
    for name, plants in GROUPS.items():
        seeds = _SEEDS[: len(_SEEDS) // len(plants)]
        made = partial(_of_responses, plants, seeds)
        lines.append(_row(f"frequency response: {name}", made))
    for name, plants in GROUPS.items():
        lines.append(_row(f"record and frequency response: {name}", partial(_of_pairs, plants)))
    lines += [
        "",
        f"Made on {date.today()} by `python -m benchmarks.records lags` with Python "
        f"{platform.python_version()}, ctrl-realize {cr.__version__}, numpy {np.__version__}. Data "
        "are simulated: dead times of 0.2 to 2 s, time constants of 0.2 to 8 s, 60 points with "
        "0.3 or 1 % of noise that is known; records ten times as slow, with 1 % of noise, beside "
        "30 points.",
        "",
    ]
    return "\n".join(lines)
