"""Which of several signals moves in steps, as the input of a test does.

Our own rule: an input jumps from one sample to the next and stays there; a response to it takes
several samples, and an outlier does not stay.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ..arrays import FloatArray

_FEWEST = 8  # samples
_JUMPS, _FOLLOWS = 0.3, 0.34
"""Part of its range by which an input jumps, and part of that by which an output does at most."""

_STILL = 0.05
"""Part of its range in which an input is still, with its noise."""


def moves_in_steps(signals: Sequence[FloatArray]) -> int | None:
    """Position of the one signal that jumps and holds while the others follow; None if unclear.

    Examples
    --------
    >>> import numpy as np
    >>> from ctrl_realize.numerics.signals.jumps import moves_in_steps
    >>> t = np.arange(100.0)
    >>> u, y = 1.0 * (t > 20), 1 - np.exp(-np.maximum(t - 25, 0) / 20)
    >>> moves_in_steps([y, u]), moves_in_steps([y, y])
    (1, None)
    """
    jumps = np.array([largest_jump(one) for one in signals])
    second, first = np.argsort(jumps)[-2:]
    clear = jumps[first] > _JUMPS and jumps[second] < _FOLLOWS * jumps[first]
    return int(first) if clear else None


def largest_jump(values: FloatArray) -> float:
    """Largest change within one sample that lasts, in parts of the range.

    Parameters
    ----------
    values : ndarray, shape (N,)
        Finite.

    Returns
    -------
    float
        0...1; 0 for a constant, or a few samples.

    Examples
    --------
    >>> import numpy as np
    >>> from ctrl_realize.numerics.signals.jumps import largest_jump
    >>> t = np.arange(100.0)
    >>> largest_jump(1.0 * (t > 20)), round(largest_jump(1 - np.exp(-t / 20)), 2)
    (1.0, 0.05)
    """
    reach = float(np.ptp(values)) if values.size >= _FEWEST else 0.0
    if not reach > 0:
        return 0.0
    one = np.abs(np.diff(values)[1:-1])
    lasting = np.abs(values[2:-1] + values[3:] - values[:-3] - values[1:-2]) / 2
    return float(np.minimum(one, lasting).max()) / reach


def swapped(input: FloatArray, output: FloatArray) -> bool:
    """Whether an output jumps first and its input follows, as if they were swapped.

    A valve that sticks jumps as well, but after its input has moved.

    Examples
    --------
    >>> import numpy as np
    >>> from ctrl_realize.numerics.signals.jumps import swapped
    >>> t = np.arange(100.0)
    >>> u, y = 1.0 * (t > 20), 1 - np.exp(-np.maximum(t - 25, 0) / 20)
    >>> swapped(y, u), swapped(u, y)
    (True, False)
    """
    if moves_in_steps([input, output]) != 1:
        return False
    steps = np.abs(np.diff(output))
    first = int(np.argmax(steps > steps.max() / 2))
    return bool(np.ptp(input[: first + 1]) <= _STILL * np.ptp(input))
