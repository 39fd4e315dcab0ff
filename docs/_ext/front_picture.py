"""The picture of the front page: a record, and the best model for each dead time that one assumes.

Everything in it is computed when the page is built. A slider needs JavaScript; without it the
picture shows the identified model and the interval of its dead time.
"""

from __future__ import annotations

import json
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

import ctrl_realize as cr

WIDTH, HEIGHT = 640, 215
LEFT, BOTTOM, TOP, RIGHT = 52, 40, 12, 12


@dataclass(frozen=True, eq=False)
class Candidates:
    """Best model of three numbers of lags for each assumed dead time, in s and in degC."""

    time: NDArray[np.float64]
    measured: NDArray[np.float64]
    dead_times: list[float]
    curves: list[NDArray[np.float64]]
    misses: list[float]
    interval: tuple[float, float]
    estimate: float
    truth: float


def candidates(dead_times: NDArray[np.float64]) -> Candidates:
    """Identify a simulated heater, and fit it once more at each of these dead times."""
    heater = cr.bench.heater()
    record = heater.step_record(rng=3)
    sys = cr.identify(record)
    at = int(np.flatnonzero(np.diff(record.input))[0]) + 1
    window = slice(at - 15, at + 70)
    curves, misses = [], []
    for dead_time in dead_times:
        structures = [
            cr.identification.ProcessStructure(name, fixed={"dead_time": float(dead_time)})
            for name in ("P1D", "P2D", "P3D")
        ]
        model = cr.identify(record, structures=structures)
        response = model.simulate(record.input - record.input[0])
        level = float(np.mean(record.output - response))
        curves.append(level + response[window])
        misses.append(float(np.std(record.output - response)))
    return Candidates(
        time=record.time[window] - record.time[at],
        measured=record.output[window],
        dead_times=[float(each) for each in dead_times],
        curves=curves,
        misses=misses,
        interval=sys.fit.interval,
        estimate=sys.fit.dead_time,
        truth=heater.truth.dead_time,
    )


def html(found: Candidates) -> str:
    """Draw the picture as SVG, with a slider that chooses the curve."""
    low = float(min(found.measured.min(), min(curve.min() for curve in found.curves)))
    high = float(found.measured.max())
    span = found.time[-1] - found.time[0]

    def x(time: float) -> float:
        return LEFT + (time - found.time[0]) / span * (WIDTH - LEFT - RIGHT)

    def y(value: float) -> float:
        return HEIGHT - BOTTOM - (value - low) / (high - low) * (HEIGHT - BOTTOM - TOP)

    def path(curve: NDArray[np.float64]) -> str:
        return "M" + "L".join(
            f"{x(t):.1f},{y(v):.1f}" for t, v in zip(found.time, curve, strict=True)
        )

    best = int(np.argmin(np.abs(np.array(found.dead_times) - found.estimate)))
    begin, end = found.interval
    dots = "".join(
        f'<circle cx="{x(t):.1f}" cy="{y(v):.1f}" r="2.2"/>'
        for t, v in zip(found.time, found.measured, strict=True)
    )
    ticks = "".join(
        f'<line x1="{x(t):.1f}" x2="{x(t):.1f}" y1="{TOP}" y2="{HEIGHT - BOTTOM}" class="grid"/>'
        f'<text x="{x(t):.1f}" y="{HEIGHT - BOTTOM + 16}" text-anchor="middle">{t}</text>'
        for t in range(0, int(found.time[-1]) + 1, 20)
    ) + "".join(
        f'<text x="{LEFT - 6}" y="{y(v) + 4:.1f}" text-anchor="end">{v}</text>'
        for v in range(int(np.ceil(low)), int(high) + 1, 2)
    )
    stored = {
        "deadTimes": found.dead_times,
        "paths": [path(curve) for curve in found.curves],
        "misses": [f"{miss:.3f}" for miss in found.misses],
        "interval": found.interval,
        "x": [x(each) for each in found.dead_times],
    }
    words = (
        f"Step response of a simulated heater with the identified model: dead time "
        f"{found.estimate:.1f} s, interval {begin:.1f} to {end:.1f} s"
    )
    return f"""
<figure class="front-picture">
<svg viewBox="0 0 {WIDTH} {HEIGHT}" role="img" aria-label="{words}">
{ticks}
<rect x="{x(begin):.1f}" width="{x(end) - x(begin):.1f}" y="{TOP}"
 height="{HEIGHT - BOTTOM - TOP}" class="interval"/>
<g class="measured">{dots}</g>
<path class="model" d="{path(found.curves[best])}"/>
<line class="assumed" x1="{x(found.dead_times[best]):.1f}" x2="{x(found.dead_times[best]):.1f}"
 y1="{TOP}" y2="{HEIGHT - BOTTOM}"/>
<text x="{(LEFT + WIDTH - RIGHT) / 2}" y="{HEIGHT - 4}" text-anchor="middle">time after the step
 [s]</text>
<text x="14" y="{HEIGHT / 2}" text-anchor="middle"
 transform="rotate(-90 14 {HEIGHT / 2})">temperature [°C]</text>
</svg>
<label hidden>Assume another dead time:
<input type="range" min="0" max="{len(found.dead_times) - 1}" value="{best}"></label>
<figcaption>Simulated heater (dots; true dead time {found.truth:g} s), identified model (line), its
dead time <b>{found.estimate:.1f} s</b>, 95 % interval {begin:.1f} to {end:.1f} s (band).
<span class="said"></span></figcaption>
<script type="application/json">{json.dumps(stored)}</script>
</figure>"""
