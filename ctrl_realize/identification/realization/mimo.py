"""Realization of several inputs and outputs with individual delays."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike

from ..._checks import integer, one_of, real
from ...data import ImpulseResponse
from ...data.impulse_estimate import ImpulseEstimate
from ...delayed import DelayedStateSpace
from ...errors import DataError, OptionError
from ...numerics.arrays import FloatArray, IntArray, locked, read_only
from ...numerics.blas_threads import single_threaded
from ...numerics.signals.edges import difference_noise
from ...numerics.state_space.delay_split import split_delays
from ...results import Flag, ModelFit
from .impulses import as_impulse, channels
from .mimo_cores import Assembly, aligned_core, channel_iae, channel_sizes, cores_one_by_one

Structure = Literal["auto", "common", "rows", "columns"]
NOISE_STDS = 5.0
"""Standard deviations for a significant Markov parameter: one of 2e6 by chance."""
ALIKE, EXACT = 1.5, 1e-9
"""Models whose errors are within this factor, or below this level, count as equally good."""


@dataclass(frozen=True, eq=False)
class MimoRealization(ModelFit):
    """Result of a MIMO realization.

    ``delays[i, j] == output_delays[i] + input_delays[j] + residual_delays[i, j]``, where
    `residual_delays` are inside the core; entries without response have the delay -1. Delays are
    those of `delay_matrix`, or one sample more where the fractions of dead times make D.
    `relative_iae` is the IAE of each entry divided by the sum of its absolute Markov parameters.

    Attributes
    ----------
    delays, residual_delays : ndarray of int, shape (p, m)
    output_delays, input_delays : tuple of int
    structure : str
        ``"common"``: one A for all channels. ``"rows"``: one model for each output with tapped
        input delay lines. ``"columns"``: one for each input with tapped output delay lines.
    orders : tuple of int
        Of the models that the core consists of.
    states : int
        Of the whole model, delays included.
    relative_iae : ndarray, shape (p, m)
    impulse : ImpulseResponse
    flags : tuple of Flag
    choices : tuple of str

    Examples
    --------
    >>> import numpy as np
    >>> import ctrl_realize as cr
    >>> pulse = np.r_[0.0, 0.8 ** np.arange(80)]
    >>> late = [np.r_[np.zeros(d), pulse][:60] for d in (3, 7)]
    >>> found = cr.identification.realize_mimo(np.array(late)[:, None, :], 1, dt=0.1).fit
    >>> found.structure, found.delays.ravel().tolist(), found.output_delays, found.input_delays
    ('common', [3, 7], (0, 4), (3,))
    """

    delays: IntArray
    residual_delays: IntArray
    output_delays: tuple[int, ...]
    input_delays: tuple[int, ...]
    structure: str
    orders: tuple[int, ...]
    states: int
    relative_iae: FloatArray
    impulse: ImpulseResponse
    flags: tuple[Flag, ...] = ()
    choices: tuple[str, ...] = ()
    dead_time = interval = delay = delay_interval = None
    records = ()

    @property
    def order(self) -> int:
        """Sum of the orders of all models that the core consists of."""
        return sum(self.orders)

    @property
    def sampling(self) -> str:
        """How the impulse response was sampled."""
        return self.impulse.sampling

    _method = "approximate realization of several channels"

    def _title(self) -> str:
        p, m = self.delays.shape
        return f"Realization of {p} x {m} channels"

    def _rows(self) -> list[tuple[str, str]]:
        return [
            ("delays", "; ".join(" ".join(map(str, row)) for row in self.delays) + " samples"),
            ("of the inputs", " ".join(map(str, self.input_delays))),
            ("of the outputs", " ".join(map(str, self.output_delays))),
            ("structure", f"{self.structure}, order {' + '.join(map(str, self.orders))}"),
            ("states in total", str(self.states)),
            ("largest relative error", f"{100 * float(self.relative_iae.max()):.3g} %"),
        ]

    def __repr__(self) -> str:
        p, m = self.delays.shape
        return f"<MimoRealization: {p} x {m}, {self.structure}, {self.states} states>"


def delay_matrix(
    impulse: ImpulseResponse | ArrayLike, *, level: float = 0.1, dt: float | None = None
) -> IntArray:
    """Find the delay of every input-output pair from the onset of its response.

    Parameters
    ----------
    impulse : ImpulseResponse, or array_like of shape (N,) or (p, m, N)
    level : float, default 0.1
        Threshold for a response, relative to the channel's largest Markov parameter. It must also
        exceed five standard deviations of the noise: those of `impulse_from_io`, or an estimate
        from the second half of the data.
    dt : float, optional
        Sample time in s, if `impulse` is an array.

    Returns
    -------
    ndarray of int, shape (p, m)
        Samples before the last Markov parameter below the threshold, so that ``D = 0`` after the
        delay: a pulse that starts at lag 6 has the delay 5. -1 if there is no response.

    Notes
    -----
    Differences between channels are reliable if their responses are similar; for a smooth onset the
    threshold delays the estimate, by more samples the higher the relative degree. Use
    `estimate_delay` for a channel if this matters.

    Examples
    --------
    >>> import numpy as np
    >>> import ctrl_realize as cr
    >>> pulse = 0.8 ** np.arange(60)
    >>> late = [np.r_[np.zeros(d + 1), pulse][:60] for d in (3, 7)]
    >>> cr.identification.delay_matrix(np.array(late)[:, None, :], dt=0.1)
    array([[3],
           [7]])
    """
    data = as_impulse(impulse, dt)
    share = real(level, "level", "part of the largest Markov parameter")
    if not 0 <= share < 1:
        raise OptionError(f"level={level!r}; expected a part of the largest value, 0 <= level < 1")
    size = np.abs(channels(data))
    top = size.max(axis=-1, keepdims=True)
    # Outputs, and inputs, have units of their own.
    rounding = 1e-12 * np.minimum(top.max(axis=0, keepdims=True), top.max(axis=1, keepdims=True))
    limit = np.maximum(share * top, rounding)
    if isinstance(data, ImpulseEstimate):
        noise = np.reshape(data.std, size.shape)
    else:
        # In the second half a response has become smooth.
        late = channels(data)[..., size.shape[-1] // 2 :]
        noise = np.apply_along_axis(difference_noise, -1, late)[..., None]
    limit = np.maximum(limit, NOISE_STDS * noise)
    seen = size > limit
    return np.where(seen.any(axis=-1), np.maximum(seen.argmax(axis=-1) - 1, 0), -1).astype(np.int64)


@single_threaded
def realize_mimo(
    impulse: ImpulseResponse | ArrayLike,
    order: int,
    *,
    level: float = 0.1,
    structure: Structure = "auto",
    samples: int | None = None,
    dt: float | None = None,
) -> DelayedStateSpace:
    """Realize a MIMO response with few states, and a delay for each input-output pair.

    The delays are split into those of inputs and of outputs, the data are aligned accordingly, and
    realized with one A. If no split aligns all channels, the result is compared with separate
    models for every output (or every input) with tapped delay lines: among those that explain the
    data about as well as the best, the one with the fewest states is returned. All delays are one
    sample longer where that explains them better: then the first values are a feedthrough D, as of
    dead times that are no whole numbers of samples.

    Parameters
    ----------
    impulse : ImpulseResponse, or array_like of shape (N,) or (p, m, N)
    order : int
        States of each model that the core consists of, without delays; fewer if the data have a
        lower rank.
    level : float, default 0.1
        For `delay_matrix`.
    structure : {"auto", "common", "rows", "columns"}
        ``"common"`` uses one A even if delays remain inside the core; they then count in `order`.
    samples : int, optional
        Markov parameters after the delays to use; default: as many as all channels have.
    dt : float, optional
        Sample time in s, if `impulse` is an array.

    Returns
    -------
    DelayedStateSpace
        With a delay for every input and output; its `fit` is a `MimoRealization`.

    Raises
    ------
    DataError
        No channel has a response.
    OrderError, OptionError
        As for `realize`.

    Notes
    -----
    Aligned responses are realized by Kung's algorithm [1]_ with the block Hankel matrix [2]_, in
    which the entries that respond have about the same size: units of channels do not matter. The
    split of the delays and the comparison of structures are our own.

    References
    ----------
    .. [1] S. Y. Kung, A new identification and model reduction algorithm via singular value
       decomposition, Proc. 12th Asilomar Conf. Circuits, Systems and Computers (1978) 705-714.
    .. [2] B. De Schutter, Minimal state-space realization in linear system theory: an overview, J.
       Comput. Appl. Math. 121 (2000) 331-354, doi:10.1016/S0377-0427(00)00341-1.

    Examples
    --------
    >>> import control as ct
    >>> import numpy as np
    >>> import ctrl_realize as cr
    >>> core = ct.ss(
    ...     [[0.8, 0.1], [0, 0.5]], [[1, 0], [1, 1]], [[1, 0], [1, 1]], np.zeros((2, 2)), 0.1
    ... )
    >>> plant = cr.DelayedStateSpace(core, (2, 5), output_delay=(0, 9))
    >>> sys = cr.identification.realize_mimo(plant.markov(200), 2, level=0, dt=0.1)
    >>> sys.input_delays, sys.output_delays
    ((2, 5), (0, 9))
    >>> bool(np.allclose(sys.markov(200), plant.markov(200)))
    True
    """
    data = as_impulse(impulse, dt)
    count = integer(order, "order", 1)
    choice = one_of(structure, "structure", ("auto", "common", "rows", "columns"))
    found = delay_matrix(data, level=level)
    known = found >= 0
    if not known.any():
        raise DataError("no channel has a response; check that the input is connected")
    outputs, inputs = channel_sizes(channels(data), known)
    each = outputs[:, None] * inputs
    even = ImpulseResponse(channels(data) / each[:, :, None], data.dt, filter=data.filter)
    way, pieces, errors = _assembled(even, count, found, choice, samples)
    later = np.where(known, found + 1, -1)
    if errors.sum() > EXACT * data.noutputs and later.max() + 2 * count < data.n_samples:
        # A dead time that is no whole number of samples has its fraction in B and D.
        direct = _assembled(even, count, later, choice, samples)
        if ALIKE * direct[2].sum() < errors.sum():
            found, (way, pieces, errors) = later, direct
    A, B, C, D = pieces.core
    pieces = replace(pieces, core=(A, B * inputs, C * outputs[:, None], D * each))
    apart = np.add.outer(pieces.outputs, pieces.inputs)
    fit = MimoRealization(
        delays=locked(found),
        residual_delays=locked(np.where(known, found - apart, 0)),
        output_delays=pieces.outputs,
        input_delays=pieces.inputs,
        structure=way,
        orders=pieces.orders,
        states=pieces.states,
        relative_iae=read_only(errors),
        impulse=data,
        flags=pieces.flags,
    )
    return pieces.system(data.dt, fit)


def _assembled(
    data: ImpulseResponse, count: int, found: IntArray, choice: Structure, samples: int | None
) -> tuple[str, Assembly, FloatArray]:
    """Structure, model and relative IAE (p, m) for the delays of all channels."""
    known = found >= 0
    splits = split_delays(found, known)
    if choice == "auto" and not np.any(known & (found != np.add.outer(*splits[0]))):
        choice = "common"
    models: dict[str, Assembly] = {}
    if choice in ("common", "auto"):
        candidates = [aligned_core(data, count, *split, samples) for split in splits]
        models["common"] = min(candidates, key=lambda c: float(channel_iae(c, data).sum()))
    for axis, way in enumerate(("rows", "columns")):
        if choice in (way, "auto"):
            models[way] = cores_one_by_one(data, count, found, samples, axis)
    errors = {way: channel_iae(pieces, data) for way, pieces in models.items()}
    # The fewest states among those that explain the data about as well as the best.
    enough = max(ALIKE * min(m.sum() for m in errors.values()), EXACT * data.noutputs)
    good = [way for way in models if errors[way].sum() <= enough]
    way = min(good, key=lambda one: models[one].states)
    return way, models[way], errors[way]
