"""Relay test of a simulated plant."""

from __future__ import annotations

import numpy as np

from .._checks import check_type, integer, not_negative, positive, real
from ..data import Record
from ..errors import OptionError
from ..numerics.loops.relay import relay_loop
from ..numerics.state_space.sampling import sample_with_dead_time
from .control_valve import Seed
from .plant import Plant, added_noise, recorded_plant, rounded_by

LONGEST = 20
"""Dead time and lags together, in each cycle, after which a relay that rests is given up."""


def relay_test(
    plant: Plant,
    amplitude: float | None = None,
    rng: Seed = None,
    *,
    hysteresis: float | None = None,
    bias: float = 0.0,
    cycles: int = 4,
    name: str = "",
) -> Record:
    """Simulate a relay test: the input switches between two levels whenever the output returns.

    As auto-tuners do it [1]_: after `Plant.pre_step_time` in the steady state the input is ``bias +
    amplitude`` above it until the output has risen above its level at rest by `hysteresis`, then
    ``bias - amplitude``, until it has fallen as far below. For a plant whose output falls, the two
    levels are exchanged. The relay sees the measured output, with its noise and rounding.

    Parameters
    ----------
    plant : Plant
        Made by `heater`, `tank` or `flow_loop`.
    amplitude : float, optional
        Of the relay in units of the input; default: half of `plant.amplitude`.
    rng : numpy.random.Generator or int, optional
        Generator or seed.
    hysteresis : float, optional
        In units of the output; default: three standard deviations of the noise.
    bias : float, default 0
        Mean of both levels over the input at rest. The relay is then up and down for different
        times, so that the record tells the gain as well.
    cycles : int, default 4
        Full cycles of the record.
    name : str, optional
        Default: the name of the plant.

    Returns
    -------
    Record

    Raises
    ------
    OptionError
        Levels beyond the range of the input, or a relay that does not switch, as with too large
        a bias, or a hysteresis that the output does not reach.

    References
    ----------
    .. [1] K. J. Astrom and T. Hagglund, Automatic tuning of simple regulators with specifications
       on phase and amplitude margins, Automatica 20 (1984) 645-651,
       doi:10.1016/0005-1098(84)90014-1.

    Examples
    --------
    >>> import ctrl_realize as cr
    >>> record = cr.bench.relay_test(cr.bench.heater(), 15, rng=1, bias=3)
    >>> record
    <Record 'heater': 638 samples of 1 s, 1 input, 1 output>
    >>> sorted(set(record.input.ravel().tolist()))
    [8.0, 20.0, 38.0]
    """
    check_type(plant, Plant, "plant", "a Plant, such as bench.heater()", OptionError)
    height = 0.5 * plant.amplitude if amplitude is None else amplitude
    size = positive(height, "amplitude", "height")
    width = 3 * plant.noise
    if hysteresis is not None:
        width = not_negative(hysteresis, "hysteresis", "in units of the output")
    middle = plant.steady_state[0] + real(bias, "bias", "in units of the input")
    integer(cycles, "cycles", 1)
    low, high = plant.input_range
    if not low <= middle - size < middle + size <= high:
        raise OptionError(
            f"the relay would switch between {middle - size:g} and {middle + size:g}; expected "
            f"levels within {low:g}-{high:g} {plant.truth.units[0]}"
        )
    truth, level = plant.truth, plant.steady_state[1]
    rest = round(plant.pre_step_time / plant.dt)
    n = rest + int(LONGEST * (cycles + 1) * (truth.total_delay / plant.dt + 1))
    noise = added_noise(plant, n, np.random.default_rng(rng))
    turn = float(np.sign(truth.gain))

    def seen(k: int, moved: float) -> float:
        shown = rounded_by(plant, np.array([level + noise[rest + k] + moved]))
        return float(shown[0]) - level

    sampled = sample_with_dead_time(*truth.matrices, plant.dt, truth.dead_time)
    levels = bias + turn * size, bias - turn * size
    drive, moved = relay_loop(sampled, n - rest, levels, width, seen, 2 * cycles + 1)
    if drive.size < n - rest:
        held = plant.steady_state[0] + np.concatenate([np.zeros(rest), drive])
        output = level + noise[: held.size]
        output[rest:] += moved
        return recorded_plant(plant, held, output, name)
    switches = np.count_nonzero(np.diff(drive))
    raise OptionError(
        f"the relay has switched {switches} times in {(n - rest) * plant.dt:g} s; expected "
        f"{2 * cycles + 1}: use a larger amplitude ({size:g}), or less bias ({bias:g}) or "
        f"hysteresis ({width:g})"
    )
