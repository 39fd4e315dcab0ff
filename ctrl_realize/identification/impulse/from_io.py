"""Unit-pulse responses from records with any input."""

from __future__ import annotations

import warnings
from collections.abc import Sequence
from functools import partial
from itertools import product
from typing import Literal

import numpy as np

from ..._checks import integer, one_of
from ..._flags import Flag, flagged
from ...data import Record
from ...data.given import records_alike
from ...data.impulse_estimate import ImpulseEstimate
from ...errors import DataWarning
from ...numerics.blas_threads import single_threaded
from ...numerics.signals.onset import correlation_onset
from .estimator import Choice, choose_estimate
from .regression import PulseRegression, through_arx, with_prior, without_prior

Method = Literal["auto", "regularized", "least_squares", "okid"]
Kernel = Literal["auto", "TC", "SS"]
Start = Literal["unknown", "rest"]

SHORTEST, LONGEST = 100, 1 / 3
"""First length to try, in samples, and the longest, as a fraction of the longest record."""

MOST_UNKNOWNS = 400
"""Largest automatic number of lags of all inputs together; time grows with its cube."""

SURE = 0.999
"""Probability that an output seems to depend on an input although none does."""

TAIL = 0.05
"""Largest tail at the end of the window, relative to the largest Markov parameter."""


@single_threaded
def impulse_from_io(
    records: Record | Sequence[Record],
    length: int | None = None,
    *,
    method: Method = "auto",
    kernel: Kernel = "auto",
    start: Start = "unknown",
) -> ImpulseEstimate:
    """Estimate the unit-pulse response from input and output signals of any shape.

    Means are eliminated: every record has a free constant for each output. Missing samples
    (``Record(..., missing="keep")``) remove the equations that contain them.

    Parameters
    ----------
    records : Record or sequence of Record
        One or several experiments on the same plant, with the same sample time and signals.
    length : int, optional
        Number of Markov parameters; the response must have decayed within it. Default: 100, or
        twice the lag at which the last output begins to respond, doubled until the response has
        decayed, up to a third of the longest record and 400 divided by the number of inputs.
    method : {"auto", "regularized", "least_squares", "okid"}
        ``"regularized"`` uses a prior of exponential decay, tuned by its marginal likelihood.
        ``"least_squares"`` has no prior and needs an input that excites every lag. ``"okid"`` uses
        an ARX model of high order (up to 128, chosen by BIC), for plants whose response is longer
        than `length` free parameters can describe. ``"auto"``: ``"okid"`` if it halves the
        prediction error of ``"regularized"`` on the held-back last third of the data, otherwise
        ``"regularized"``.
    kernel : {"auto", "TC", "SS"}
        Prior of the regularized method. TC allows a jump at lag 0, SS is smooth; ``"auto"``:
        whichever has the larger marginal likelihood, for each output separately.
    start : {"unknown", "rest"}
        Input before the record: unknown (the first ``length - 1`` outputs, or as many as the order
        of the ARX model, are then only used as past values), or steady state at the first sample of
        the input, which uses every sample.

    Returns
    -------
    ImpulseEstimate
        For `realize`, `estimate_delay` and `scan_orders`, like any impulse response; with standard
        deviations `std`.

    Raises
    ------
    DataError
        Records that are too short, with different sample times or signals, or an input that does
        not excite the plant.
    OptionError
        Unknown method, kernel or start.

    Warns
    -----
    DataWarning
        The input does not excite some directions, which are determined by the prior alone.

    Notes
    -----
    The regularized method is that of [1]_ (kernel SS: [2]_), ``"okid"`` that of [3]_; its `std`
    contains the difference from an ARX model of twice the order, since noise of the output biases
    every order.

    The normal equations are summed by FFT, so 1e5 samples and 1000 lags take seconds. White noise
    is assumed: coloured noise does not bias the estimate, but `std` is then too small at
    frequencies where the noise is strong. The response is step-invariant: exact for a plant with a
    zero-order hold.

    References
    ----------
    .. [1] T. Chen, H. Ohlsson and L. Ljung, On the estimation of transfer functions,
       regularizations and Gaussian processes - revisited, Automatica 48 (2012) 1525-1535,
       doi:10.1016/j.automatica.2012.05.026.
    .. [2] G. Pillonetto and G. De Nicolao, A new kernel-based approach for linear system
       identification, Automatica 46 (2010) 81-93, doi:10.1016/j.automatica.2009.10.031.
    .. [3] J.-N. Juang, M. Phan, L. G. Horta and R. W. Longman, Identification of observer/Kalman
       filter Markov parameters: theory and experiments, J. Guidance 16 (1993) 320-329,
       doi:10.2514/3.21006.

    Examples
    --------
    >>> import control as ct
    >>> import numpy as np
    >>> import ctrl_realize as cr
    >>> rng = np.random.default_rng(1)
    >>> t, u = 0.1 * np.arange(800), rng.choice([-1.0, 1.0], 800)
    >>> plant = cr.DelayedStateSpace(ct.ss([[0.8]], [[1.0]], [[0.2]], [[0.0]], 0.1), 5)
    >>> y = 20 + plant.simulate(u) + 0.02 * rng.standard_normal(800)
    >>> g = cr.impulse_from_io(cr.Record(t, u, y), 60)
    >>> error = g.markov - plant.markov(60)
    >>> bool(np.abs(error).max() < 0.01)
    True
    """
    method = one_of(method, "method", ("auto", "regularized", "least_squares", "okid"))
    kernel = one_of(kernel, "kernel", ("auto", "TC", "SS"))
    start = one_of(start, "start", ("unknown", "rest"))
    group = tuple(records_alike(records))
    longest = max(record.n_samples for record in group)
    most = max(min(int(LONGEST * longest), MOST_UNKNOWNS // group[0].ninputs), 2)
    if length is None:
        # A window that ends before the response begins would show neither response nor tail.
        count = min(max(SHORTEST, 2 * _latest_onset(group, most)), most)
    else:
        count = integer(length, "length", 2)
    alike = (kernel,) * group[0].noutputs
    auto = method == "auto"
    chosen = choose_estimate(group, count, start) if auto else Choice(method, alike, "")
    kernels = chosen.kernels if kernel == "auto" else alike
    estimators = {"okid": through_arx, "least_squares": without_prior}
    estimate = estimators.get(chosen.method, partial(with_prior, kernels=kernels))
    while True:
        found = estimate(group, count, start)
        tail = _tail_flags(found)
        if length is not None or not tail or count == most:
            break
        count = min(2 * count, most)
    for flag in found.flags:
        if flag.code == "partly_excited":
            # one frame more: the limit of BLAS threads around this function
            warnings.warn(flag.message, DataWarning, stacklevel=3)
    siso = group[0].input.ndim == 1 and group[0].output.ndim == 1
    return ImpulseEstimate(
        found.markov[0, 0] if siso else found.markov,
        group[0].dt,
        std=found.std[0, 0] if siso else found.std,
        noise_std=found.noise_std,
        method=found.method,
        rows=found.rows,
        choices=(chosen.reason,) if chosen.reason else (),
        flags=found.flags + tail,
        name=group[0].name,
    )


def _latest_onset(group: tuple[Record, ...], lags: int) -> int:
    """Lag at which the last output begins to respond to an input; 0 if none responds."""
    record = max(group, key=lambda one: one.n_samples)
    if record.n_missing:
        return 0
    signals = np.atleast_2d(record.input), np.atleast_2d(record.output)
    moving = ([row for row in rows if np.ptp(row) > 0] for rows in signals)
    onsets = [correlation_onset(u, y, lags, SURE).onset for u, y in product(*moving)]
    return max([0, *onsets])


def _tail_flags(found: PulseRegression) -> tuple[Flag, ...]:
    """Flag responses that have not decayed at the end of the window."""
    count = found.markov.shape[-1]
    tail = slice(count - max(count // 10, 1), None)
    size = np.sqrt(np.mean(found.markov[..., tail] ** 2, axis=-1))
    noise = np.sqrt(np.mean(found.std[..., tail] ** 2, axis=-1))
    share = size / np.maximum(np.abs(found.markov).max(axis=-1), 1e-300)
    alive = (share > TAIL) & (size > 3 * noise)
    if not np.any(alive):
        return ()
    share = 100 * share[alive].max()
    return (flagged("not_died_away.impulse", samples=count, share=share),)
