"""Prediction of an output from its past: a model, and an autoregressive model of the residual."""

from __future__ import annotations

from dataclasses import dataclass

import control as ct
import numpy as np

from ..._checks import integer
from ..._wording import in_percent
from ...data import Record
from ...delayed.simulation import Start, simulate_record
from ...numerics.arrays import FloatArray, read_only
from ...numerics.blas_threads import single_threaded
from ...numerics.signals.correlation import autoregression, fit_percent, predict_ahead
from ...results import Result

NOISE_ORDER = 20
"""Highest order of the autoregressive model of the residual."""


@dataclass(frozen=True, eq=False)
class Prediction(Result):
    """Output predicted `horizon` samples ahead.

    ``output[k]`` uses the input up to k and the measured output up to ``k - horizon``;
    `fit_percent` compares it with the record. The model is the system plus an autoregressive model
    of its residual, of order `noise_order` for each output.

    Attributes
    ----------
    output : ndarray, shape (N,) or (p, N)
    fit_percent : ndarray, shape (p,)
        ``100 (1 - |y - output| / |y - mean y|)`` of every output.
    horizon : int
        Prediction horizon in samples.
    noise_order : tuple of int
        Of every output; 0 for a white residual.
    record : Record

    Examples
    --------
    >>> import control as ct
    >>> import numpy as np
    >>> import ctrl_realize as cr
    >>> plant = cr.DelayedStateSpace(ct.ss([[0.8]], [[1.0]], [[0.2]], [[0.0]], 0.1), 5)
    >>> u, e = np.random.default_rng(0).standard_normal((2, 500))
    >>> slow = cr.DelayedStateSpace(ct.ss([[0.95]], [[1.0]], [[1.0]], [[1.0]], 0.1), 0)
    >>> y = plant.simulate(u) + slow.simulate(0.05 * e)
    >>> record = cr.Record(0.1 * np.arange(500), u, y)
    >>> for horizon in (1, 10):
    ...     print(horizon, cr.validation.predict(plant, record, horizon).fit_percent.round(0))
    1 [87.]
    10 [65.]
    """

    output: FloatArray
    fit_percent: FloatArray
    horizon: int
    noise_order: tuple[int, ...]
    record: Record

    def _title(self) -> str:
        return f"Prediction {self.horizon} samples ahead"

    def _rows(self) -> list[tuple[str, str]]:
        return [
            ("fit", in_percent(self.fit_percent)),
            ("order of the noise", ", ".join(map(str, self.noise_order))),
        ]

    def __repr__(self) -> str:
        fit = ", ".join(f"{f:.1f}" for f in self.fit_percent)
        return f"<Prediction {self.horizon} ahead: fit {fit} %>"


@single_threaded
def predict(
    system: ct.StateSpace, record: Record, horizon: int, *, start: Start = "estimate"
) -> Prediction:
    """Predict the output of a record `horizon` samples ahead.

    Parameters
    ----------
    system, record, start
        As for `analyse_residuals`.
    horizon : int
        Prediction horizon in samples, at least 1.

    Returns
    -------
    Prediction

    Raises
    ------
    DataError, UnsuitableSystemError, OptionError
        As for `analyse_residuals`; a horizon that is not a whole number >= 1.

    Notes
    -----
    The autoregressive model is fitted to the same record (order 0...20 by BIC), so `fit_percent`
    shows how well this record is described, not how well another one would be predicted. Compare
    models at the same `horizon`.

    The predictor is that of [1]_ for the model ``y = G u + v``, with the autoregression v.

    References
    ----------
    .. [1] L. Ljung, System Identification: Theory for the User, 2nd ed., Prentice Hall 1999,
       section 3.2 (Prediction).

    Examples
    --------
    >>> import control as ct
    >>> import numpy as np
    >>> import ctrl_realize as cr
    >>> plant = cr.DelayedStateSpace(ct.ss([[0.8]], [[1.0]], [[0.2]], [[0.0]], 0.1), 5)
    >>> rng = np.random.default_rng(0)
    >>> u, e = rng.standard_normal((2, 500))
    >>> slow = ct.ss([[0.95]], [[1.0]], [[1.0]], [[1.0]], 0.1)
    >>> noise = cr.DelayedStateSpace(slow, 0).simulate(0.05 * e)
    >>> record = cr.Record(0.1 * np.arange(500), u, plant.simulate(u) + noise)
    >>> for ahead in (1, 10):
    ...     print(ahead, cr.validation.predict(plant, record, ahead).fit_percent.round(0))
    1 [87.]
    10 [65.]
    """
    ahead = integer(horizon, "horizon", 1)
    simulated = simulate_record(system, record, start)
    y = np.atleast_2d(record.output)
    most = min(NOISE_ORDER, record.n_samples // 10)
    models = [autoregression(row, most) for row in y - simulated]
    output = simulated + np.stack(
        [predict_ahead(row, c, ahead) for row, c in zip(y - simulated, models, strict=True)]
    )
    return Prediction(
        output=read_only(output.reshape(record.output.shape)),
        fit_percent=read_only(fit_percent(y, output)),
        horizon=ahead,
        noise_order=tuple(c.size for c in models),
        record=record,
    )
