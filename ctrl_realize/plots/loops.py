"""Plots of loops: margins and time responses."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import control as ct
import numpy as np
from matplotlib.axes import Axes

from .._checks import check_type, positive
from .._wording import in_time
from ..delayed import DelayedStateSpace
from ..design.loops.margin_result import Margins
from ..design.loops.margins import margins
from ..design.loops.performance import lasting, loop_times, settled_responses, step_responses
from ..design.siso import delayed_system
from ..design.tuning.algorithm import PIDAlgorithm
from ..design.tuning.controller import PIDController
from ..design.tuning.simulated import simulate_loop
from ..errors import OptionError
from ..numerics.arrays import FloatArray
from . import style
from .names import plain, with_unit
from .shared_docs import documented
from .style import HERTZ, axis_time_unit, decibel

NYQUIST_SPAN = 2.5
"""Half width of the Nyquist plot, in units of the distance from 0 to -1."""
LOWEST_GAIN = -60.0
"""Gain in dB below which nothing is shown."""


@documented("sequence of three Axes")
def margins_plot(
    result: Margins, *, ax: style.AxesLike = None, title: str | None = None
) -> ct.ControlPlot:
    """Draw gain, phase and Nyquist curve of a loop with its margins marked.

    The phase is that of the curve along the Nyquist count: correctly unwrapped at any delay.

    Parameters
    ----------
    result : Margins

    Examples
    --------
    >>> import ctrl_realize as cr
    >>> plant = cr.design.ProcessModel(gain=1.0, lag=0.08, dead_time=0.029).system(0.001)
    >>> cplt = cr.plots.margins_plot(cr.design.margins(plant, cr.design.pid(plant)))
    >>> [axes.get_title() or axes.get_ylabel() for axes in cplt.figure.axes]
    ['loop gain [dB]', 'loop phase [deg]', 'imaginary part']
    """
    expected = "the margins of a loop, such as design.margins(plant, controller)"
    check_type(result, Margins, "result", expected)
    omega, values = result.response
    frequency = omega / HERTZ
    gain = decibel(np.abs(values))
    phase = np.degrees(np.unwrap(np.angle(values)))
    verdict = "stable" if result.stable else "UNSTABLE"
    with style.canvas(
        ax, 3, beside=True, size=(9.6, 5.4), title=title, default_title=f"Closed loop {verdict}"
    ) as (gain_ax, phase_ax, nyquist):
        drawn = [gain_ax.semilogx(frequency, gain, color=style.MODEL)]
        drawn.append(phase_ax.semilogx(frequency, phase, color=style.MODEL))
        gain_ax.axhline(0, color=style.INPUT, linewidth=1)
        _mark_gain_margin(gain_ax, result)
        _mark_phase_margin(phase_ax, result, frequency, phase)
        drawn.append(_nyquist(nyquist, result, values))
        gain_ax.set(xlabel="frequency [Hz]", ylabel="loop gain [dB]")
        phase_ax.set(xlabel="frequency [Hz]", ylabel="loop phase [deg]")
        low, high = _shown_band(result)
        for axes in (gain_ax, phase_ax):
            axes.set_xlim(low / HERTZ, high / HERTZ)
        gain_ax.set_ylim(bottom=max(LOWEST_GAIN, float(gain.min())))
        shown = phase[omega <= high]
        phase_ax.set_ylim(float(shown.min()) - 20, float(shown.max()) + 20)
        return style.finished(
            [gain_ax, phase_ax, nyquist], drawn, columns=3, legends=(0, 1, 2), loc="lower left"
        )


def _shown_band(result: Margins) -> tuple[float, float]:
    """Choose the frequencies to show in rad/s.

    Far above the crossovers the phase of the delay keeps turning, which is left out.
    """
    omega = result.response[0]
    ends = np.array([result.gain_crossover, result.phase_crossover, result.modulus_crossover])
    ends = ends[np.isfinite(ends) & (ends > 0)]
    top = 4 * float(ends.max()) if ends.size else float(omega[-1])
    return max(float(omega[0]), top / 1e4), min(top, float(omega[-1]))


def _mark_gain_margin(axes: Any, result: Margins) -> None:
    if np.isfinite(result.phase_crossover) and result.phase_crossover > 0:
        at = result.phase_crossover / HERTZ
        level = float(decibel(np.array([1 / result.gain_margin]))[0])
        label = f"gain margin {result.gain_margin:.3g}"
        axes.plot([at, at], [0, level], color=style.TRUTH, marker="o", label=label)


def _mark_phase_margin(axes: Any, result: Margins, frequency: Any, phase: Any) -> None:
    if not np.isfinite(result.gain_crossover):
        return
    at = result.gain_crossover / HERTZ
    here = float(np.interp(at, frequency, phase))
    level = here - result.phase_margin
    label = f"phase margin {result.phase_margin:.3g}°"
    if np.isfinite(result.delay_margin):
        label += f"\ndelay margin {in_time(result.delay_margin)}"
    axes.axhline(level, color=style.INPUT, linewidth=1)
    axes.plot([at, at], [level, here], color=style.TRUTH, marker="o", label=label)


def _nyquist(axes: Any, result: Margins, values: Any) -> Any:
    lines = axes.plot(values.real, values.imag, color=style.MODEL)
    axes.plot(values.real, -values.imag, color=style.MODEL, alpha=0.35, linewidth=1)
    axes.plot([-1], [0], marker="+", markersize=12, color=style.INK, linestyle="none")
    circle = -1 + result.modulus_margin * np.exp(1j * np.linspace(0, 2 * np.pi, 200))
    label = f"modulus margin {result.modulus_margin:.3g}"
    looks = {"color": style.TRUTH, "linestyle": style.DASHES[1], "label": label}
    axes.plot(circle.real, circle.imag, **looks)
    axes.set(xlabel="real part", ylabel="imaginary part")
    axes.set(xlim=(-NYQUIST_SPAN, NYQUIST_SPAN - 1), ylim=(0.5 - NYQUIST_SPAN, NYQUIST_SPAN - 0.5))
    axes.set_aspect("equal", adjustable="box")
    return lines


@documented("sequence of four Axes")
def closed_loop_plot(
    plant: DelayedStateSpace,
    controllers: Mapping[str, Any],
    *,
    span: float | None = None,
    setpoint_step: float = 1.0,
    load_step: float = 1.0,
    output_limits: tuple[float, float] | None = None,
    noise_std: float = 0.0,
    plants: Sequence[DelayedStateSpace] = (),
    ax: style.AxesLike = None,
    title: str | None = None,
) -> ct.ControlPlot:
    """Draw the response to a step of set-point and of load, above the output of the controller.

    With limits or noise, the loops are simulated by `design.simulate_loop`; otherwise the responses
    are those of the linear loops.

    Parameters
    ----------
    plant : DelayedStateSpace
    controllers : mapping of str to system
        Name -> controller with the plant's sample time; each must give a stable loop. A
        `PIDAlgorithm` is simulated with its set-point weights and limits.
    span : float, optional
        Time to show in s. Default: 1.25 times the time until all responses stay within 2 % of their
        final values.
    setpoint_step, load_step : float, optional
        Heights of the steps.
    output_limits : tuple of float, optional
        Lower and upper limit of the controller's output, relative to its value before the step.
    noise_std : float, optional
        Standard deviation of the noise of the measured value, to see what of it arrives at the
        actuator.
    plants : sequence of DelayedStateSpace, optional
        Other plants, such as ``sys.fit.plausible_models.systems``: the band of their responses with
        the first controller, without limits; those that it does not stabilize are lines.

    Raises
    ------
    UnsuitableSystemError
        A continuous plant; without `span`, a loop that is not stable.
    OptionError
        No controllers.

    Examples
    --------
    >>> import ctrl_realize as cr
    >>> plant = cr.design.ProcessModel(gain=1.0, lag=0.08, dead_time=0.029).system(0.001)
    >>> loops = {rule: cr.design.pid(plant, rule) for rule in ("simc", "amigo")}
    >>> cplt = cr.plots.closed_loop_plot(plant, loops, output_limits=(-0.5, 1.5))
    >>> [axes.get_ylabel() for axes in cplt.figure.axes]
    ['measured value', '', 'controller output', '']
    """
    plant = delayed_system(plant, "closed_loop_plot")
    if not controllers:
        raise OptionError("controllers is empty; expected a mapping of names to controllers")
    linear = {name: _linear(controller) for name, controller in controllers.items()}
    if span is None:
        span = _span(plant, linear)
    count = int(np.ceil(positive(span, "span", "time in s") / plant.dt)) + 1
    drawn: list[list[Any]] = [[], [], [], []]
    with style.canvas(
        ax, 2, columns=2, title=title, default_title="Set-point step", size=(10.5, 6.5)
    ) as axes:
        factor, unit = axis_time_unit(span, axes[2])
        time = np.arange(count) * plant.dt * factor
        if plants:
            first = next(iter(linear.values()))
            _draw_others(axes, time, plants, first, (setpoint_step, load_step))
        for number, (name, controller) in enumerate(controllers.items()):
            if noise_std or output_limits or isinstance(controller, PIDAlgorithm):
                settings = {"noise_std": noise_std, "output_limits": output_limits}
                signals = _simulated(plant, controller, count, (setpoint_step, load_step), settings)
            else:
                signals = _linear_signals(plant, controller, count, (setpoint_step, load_step))
            for where, signal in enumerate(signals):
                looks = style.model_looks(number) | ({} if number else {"linestyle": "-"})
                looks["drawstyle"] = "steps-post" if where > 1 else "default"
                drawn[where] += axes[where].plot(time, signal, label=plain(name), **looks)
        axes[0].axhline(setpoint_step, color=style.INPUT, linewidth=1)
        axes[1].axhline(0, color=style.INPUT, linewidth=1)
        for limit in _drawn_limits(controllers, output_limits):
            for each in axes[2:]:
                each.axhline(limit, color=style.TRUTH, linestyle=style.DASHES[1], linewidth=1)
        if ax is None:
            axes[1].set_title("Load step", loc="left")
        known = None if plant.fit is None or not plant.fit.records else plant.fit.records[0]
        measured, driven = (known.output_units[0], known.input_units[0]) if known else ("", "")
        axes[0].set_ylabel(with_unit("measured value", measured))
        axes[2].set(ylabel=with_unit("controller output", driven), xlabel=f"time [{unit}]")
        axes[3].set_xlabel(f"time [{unit}]")
        # The corner below the end of the set-point response is free; a given figure may be small.
        where, loc = (0, "lower right") if ax is None else (1, "above")
        return style.finished(axes, drawn, columns=2, legends=(where,), loc=loc)


def _draw_others(
    axes: Sequence[Axes],
    time: FloatArray,
    plants: Sequence[DelayedStateSpace],
    controller: Any,
    steps: tuple[float, float],
) -> None:
    """Draw the band of the responses of stable loops, and the others as lines within its scale."""
    stable = [one for one in plants if margins(one, controller).stable]
    inside = [_linear_signals(one, controller, time.size, steps) for one in stable]
    for one in plants:
        if one not in stable:
            signals = _simulated(one, controller, time.size, steps, {})
            for where, signal in zip(axes, signals, strict=True):
                where.plot(time, signal, color=style.TRUTH, lw=0.8, scaley=not inside)
    if inside:
        looks: dict[str, Any] = {"color": style.BAND, "alpha": 0.35, "lw": 0}
        for where, low, high in zip(axes, np.min(inside, 0), np.max(inside, 0), strict=True):
            where.fill_between(time, low, high, label="models that fit as well", **looks)


def _linear(controller: Any) -> Any:
    """Controller without limits and weights, which do not move the poles of the loop."""
    if not isinstance(controller, PIDAlgorithm):
        return controller
    c = controller
    return PIDController(c.kp, c.ti, c.td, c.tf, dt=c.dt, method=c.method, name=c.name)


def _linear_signals(
    plant: DelayedStateSpace, controller: Any, count: int, steps: tuple[float, float]
) -> list[FloatArray]:
    """Measured value after both steps, then the controller's output after both."""
    # Twice the span is computed: circular wrap-around shows at the end.
    length = 2 ** int(np.ceil(np.log2(2 * count)))
    measured = step_responses(plant, controller, length)
    driven = step_responses(plant, controller, length, of_controller=True)
    signals = (*measured, *driven)
    return [height * y[:count] for height, y in zip(steps * 2, signals, strict=True)]


def _simulated(
    plant: DelayedStateSpace,
    controller: Any,
    count: int,
    steps: tuple[float, float],
    settings: dict[str, Any],
) -> list[FloatArray]:
    # The steps are at the second sample, which is time 0 here.
    loops = [
        simulate_loop(plant, controller, count + 1, setpoint_step=r, load_step=d, **settings)
        for r, d in ((steps[0], 0.0), (0.0, steps[1]))
    ]
    return [loop.measured[1:] for loop in loops] + [loop.output[1:] for loop in loops]


def _drawn_limits(controllers: Mapping[str, Any], given: tuple[float, float] | None) -> list[float]:
    """Limits to mark: the given ones, and those of the algorithms."""
    limits = set(given or ())
    for each in controllers.values():
        if isinstance(each, PIDAlgorithm):
            limits |= set(each.in_deviations().output_limits)
    return sorted(limit for limit in limits if np.isfinite(limit))


def _span(plant: DelayedStateSpace, controllers: Mapping[str, Any]) -> float:
    """1.25 times the time in s until the slowest loop has settled."""
    samples = 8
    for name, controller in controllers.items():
        slow, _ = loop_times(plant, controller, name)
        setpoint, load, _ = settled_responses(plant, controller, slow)
        samples = max(samples, lasting(setpoint, load))
    return 1.25 * samples * float(plant.dt)
