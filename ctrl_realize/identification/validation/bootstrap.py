"""Bootstrap of a complete identification: how much it varies with the noise."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, TypeAlias

import numpy as np

from ..._checks import integer, numbers
from ..._flags import Flag, flagged
from ..._wording import in_time, interval_in_time, time_within
from ...data import Record
from ...data.given import as_records
from ...delayed import DelayedStateSpace
from ...errors import CtrlRealizeError, DataError, OptionError
from ...numerics.arrays import FloatArray
from ...numerics.blas_threads import single_threaded
from ...numerics.signals.noise import correlation_time, kept_in_blocks
from ...results import Result
from ..output_error.fit import fit_output_error

Estimator: TypeAlias = Callable[[Any], DelayedStateSpace]

_BLOCK_OVER_CORRELATION = 3
_FEW_RECORDS = 5
_LEAST_LEFT = 0.5
"""Least fraction of the noise variance for which its reduction is corrected."""


@dataclass(frozen=True, eq=False, repr=False)
class Bootstrap(Result):
    """Models from the same data with resampled noise.

    ``dead_times[b]`` belongs to ``systems[b]``, and ``interval`` spans the middle 95 % of the dead
    times. A bootstrap cannot detect bias: an error of the method that is common to all records
    shifts all models together, and so does quantisation coarser than the noise (flag
    ``"coarse_quantisation"``).

    Attributes
    ----------
    system : DelayedStateSpace
        Model of the original data.
    systems : tuple of DelayedStateSpace
        Models of the resampled data, without their fits.
    dead_times : ndarray, shape (B,)
        In s.
    kind : str
        ``"residuals"`` (blocks of the residual of one record) or ``"records"``.
    block : int
        Length of the blocks in samples; 0 if records were resampled.
    failed : int
        Number of draws for which the method raised an error.

    Examples
    --------
    >>> from functools import partial
    >>> import numpy as np
    >>> import ctrl_realize as cr
    >>> t = 0.01 * np.arange(300)
    >>> u = np.where(t < 0.5, 0.0, 2.0)
    >>> y = np.where(t < 0.625, 0.0, 6 * -np.expm1(-(t - 0.625) / 0.4))
    >>> record = cr.Record(t, u, y + 0.01 * np.random.default_rng(1).standard_normal(t.size))
    >>> one_lag = partial(cr.fit_output_error, structures=[(1, 1)])
    >>> again = cr.validation.bootstrap(record, one_lag, repeats=10)
    >>> print(f"{again.system.fit.dead_time:.4f} s, and {again.std:.4f} s of scatter")
    0.1250 s, and 0.0002 s of scatter
    """

    system: DelayedStateSpace
    systems: tuple[DelayedStateSpace, ...]
    dead_times: FloatArray
    kind: str
    block: int
    failed: int

    @property
    def interval(self) -> tuple[float, float]:
        """Middle 95 % of the dead times in s."""
        low, high = _middle(self.dead_times, 0.95)
        return float(low), float(high)

    @property
    def std(self) -> float:
        """Standard deviation of the dead times in s."""
        return float(self.dead_times.std(ddof=1))

    @property
    def gains(self) -> FloatArray:
        """Gain at zero frequency of every model, shape (B,)."""
        return np.array([float(np.real(np.squeeze(s.dcgain()))) for s in self.systems])

    @property
    def flags(self) -> tuple[Flag, ...]:
        """Warnings about failed draws, and about quantisation, which draws do not contain."""
        failed = [flagged("failed_draws", failed=self.failed)] if self.failed else []
        fitted = () if self.system.fit is None else self.system.fit.flags
        coarse = any(flag.code == "coarse_quantisation" for flag in fitted)
        return (*failed, *([flagged("coarse_quantisation.draws")] if coarse else []))

    def poles(self) -> list[Any]:
        """Poles of every model in the z-plane, without delays."""
        return [np.linalg.eigvals(s.delay_free.A) for s in self.systems]

    def step_band(self, samples: int, *, level: float = 0.95) -> tuple[FloatArray, FloatArray]:
        """Band of the unit step responses, shapes (samples,), at 0, dt, 2 dt, ..."""
        responses = np.array([np.cumsum(np.ravel(s.markov(samples))) for s in self.systems])
        return _band(responses, level)

    def magnitude_band(self, omega: Any, *, level: float = 0.95) -> tuple[FloatArray, FloatArray]:
        """Band of the gains at frequencies (K,) in rad/s."""
        return _band(np.abs(self._response(omega)), level)

    def phase_band(self, omega: Any, *, level: float = 0.95) -> tuple[FloatArray, FloatArray]:
        """Band of the phases at frequencies (K,) in rad/s; in rad, delays included."""
        phase = np.unwrap(np.angle(self._response(omega)), axis=1)
        # Unwrapping may start anywhere: whole turns are counted relative to the first model.
        turns = np.round((phase[:, :1] - phase[:1, :1]) / (2 * np.pi))
        return _band(phase - 2 * np.pi * turns, level)

    def _response(self, omega: Any) -> Any:
        z = np.exp(1j * numbers(omega, "omega") * float(self.system.dt))
        return np.array([np.ravel(s(z)) for s in self.systems])

    def __repr__(self) -> str:
        low, high = self.interval
        return f"<Bootstrap of {self.kind}: {len(self.systems)} models, {low:.4g}...{high:.4g} s>"

    def _title(self) -> str:
        return f"Bootstrap of {self.kind}: {len(self.systems)} models"

    def _rows(self) -> list[tuple[str, str]]:
        low, high = self.interval
        rows = [
            ("dead time", f"{time_within(float(np.median(self.dead_times)), low, high)} (median)"),
            ("middle 95 %", interval_in_time(low, high)),
            ("standard deviation", in_time(self.std)),
            ("gain", f"{self.gains.mean():.5g} +- {self.gains.std(ddof=1):.2g}"),
        ]
        if self.block:
            rows.append(("blocks", f"{self.block} samples of the residual each"))
        rows.append(("not included", "bias of the method, which is common to all records"))
        return rows


@single_threaded
def bootstrap(
    records: Record | Sequence[Record],
    estimator: Estimator = fit_output_error,
    *,
    repeats: int = 200,
    seed: int = 0,
    n_jobs: int = 1,
) -> Bootstrap:
    """Identify repeatedly with resampled noise.

    With five records or more the records are resampled, with replacement; with fewer, blocks of the
    residual are resampled and added to the response of the model.

    Parameters
    ----------
    records : Record or sequence of Record
        Argument of `estimator`.
    estimator : callable, optional
        Any method that returns a `DelayedStateSpace`: `fit_output_error`, or for example
        ``functools.partial(identify, method="scan")``.
    repeats : int, optional
        Number of draws.
    seed : int, optional
        Seed or generator; the draws do not depend on `n_jobs`.
    n_jobs : int, optional
        Number of processes (joblib); -1 for all cores.

    Returns
    -------
    Bootstrap

    Raises
    ------
    OptionError, DataError
        Invalid options, or fewer than two draws that could be identified.

    Notes
    -----
    A residual is smaller than the noise, because the model has fitted part of it, and separate
    blocks lose the correlation between them. Both reduce slow noise, and the residual is scaled up
    accordingly: with N samples and the correlation time T there are n = N / T independent ones, p
    parameters (poles, gain, dead time, offset and slope) leave ``(n - p) / n`` of the variance, and
    blocks of L samples keep ``1 - k / L`` of the autocorrelation at lag k.

    Blocks of the residual follow [1]_, whole records [2]_.

    References
    ----------
    .. [1] H. R. Kunsch, The jackknife and the bootstrap for general stationary observations, Ann.
       Statist. 17 (1989) 1217-1241, doi:10.1214/aos/1176347265.
    .. [2] B. Efron and R. J. Tibshirani, An Introduction to the Bootstrap, Chapman and Hall 1993,
       chapters 6 and 8, doi:10.1201/9780429246593.

    Examples
    --------
    >>> import numpy as np
    >>> import ctrl_realize as cr
    >>> from functools import partial
    >>> t = 0.01 * np.arange(300)
    >>> u = np.where(t < 0.5, 0.0, 2.0)
    >>> y = np.where(t < 0.625, 0.0, 6 * -np.expm1(-(t - 0.625) / 0.4))
    >>> record = cr.Record(t, u, y + 0.01 * np.random.default_rng(1).standard_normal(t.size))
    >>> lag = partial(cr.fit_output_error, structures=[(1, 1)])
    >>> again = bootstrap(record, lag, repeats=10)
    >>> print(f"{again.interval[0]:.4f} to {again.interval[1]:.4f} s")
    0.1245 to 0.1253 s
    """
    count = integer(repeats, "repeats", 2)
    integer(seed, "seed", 0)
    if not callable(estimator):
        raise OptionError(f"estimator={estimator!r}; expected a function of the records")
    several = as_records(records)
    system = estimator(records)
    draws: list[Any]
    streams = [np.random.default_rng(s) for s in np.random.SeedSequence(seed).spawn(count)]
    if len(several) >= _FEW_RECORDS:
        length, kind = 0, "records"
        draws = [[several[i] for i in rng.integers(len(several), size=len(several))]
                 for rng in streams]  # fmt: skip
    else:
        kind = "residuals"
        parts = [_model_and_residual(system, record) for record in several]
        length = _block(parts)
        parts = _scaled(parts, length, system)
        draws = [
            [
                _redrawn(record, *part, length, rng)
                for record, part in zip(several, parts, strict=True)
            ]
            for rng in streams
        ]
        if isinstance(records, Record):
            draws = [draw[0] for draw in draws]
    from joblib import Parallel, delayed

    models = Parallel(n_jobs=n_jobs)(delayed(_identified)(estimator, draw) for draw in draws)
    found = tuple(model for model in models if model is not None)
    if len(found) < 2:
        raise DataError(f"the estimator raised an error for {count - len(found)} of {count} draws")
    return Bootstrap(
        system,
        tuple(model for model, _ in found),
        np.array([dead_time for _, dead_time in found]),
        kind,
        length,
        count - len(found),
    )


def _band(values: FloatArray, level: float) -> tuple[FloatArray, FloatArray]:
    """Middle part of the values (B, K), at every K."""
    if not 0 < level < 1:
        raise OptionError(f"level={level!r}; expected a value above 0 and below 1")
    return _middle(values, level)


def _middle(values: FloatArray, level: float) -> tuple[FloatArray, FloatArray]:
    """Interval that contains a further draw with probability `level`, along the other axes.

    Of B draws the k-th has k / (B + 1) of the distribution below it. Quantiles of the draws
    themselves would be too narrow: for 50 draws they contain 91 % instead of 95 %.
    """
    ends = [(1 - level) / 2, (1 + level) / 2]
    low, high = np.quantile(values, ends, axis=0, method="weibull")
    return np.asarray(low), np.asarray(high)


def _identified(estimator: Estimator, draw: Any) -> tuple[DelayedStateSpace, float] | None:
    try:
        system = estimator(draw)
    except CtrlRealizeError:
        return None
    dead_time = None if system.fit is None else system.fit.dead_time
    if dead_time is None:
        dead_time = float(system.dead_time)
    return system.replace(fit=None), dead_time


def _model_and_residual(system: DelayedStateSpace, record: Record) -> tuple[FloatArray, FloatArray]:
    """Response of the model with the best offset and slope, and the residual."""
    signal, output = np.ravel(record.input), np.ravel(record.output)
    response = np.ravel(system.simulate(signal - signal[0]))
    index = np.arange(output.size, dtype=np.float64)
    columns = np.stack([np.ones_like(index), index / index.size], axis=1)
    line = columns @ np.linalg.lstsq(columns, output - response, rcond=None)[0]
    model = response + line
    return model, output - model


def _block(parts: list[tuple[FloatArray, FloatArray]]) -> int:
    """Length of the blocks in samples, so that coloured noise stays coloured."""
    shortest = min(residual.size for _, residual in parts)
    time = max(correlation_time(residual) for _, residual in parts)
    return int(np.clip(round(_BLOCK_OVER_CORRELATION * time), 1, max(shortest // 4, 1)))


def _scaled(
    parts: list[tuple[FloatArray, FloatArray]], length: int, system: DelayedStateSpace
) -> list[tuple[FloatArray, FloatArray]]:
    """Scale the residuals up for what model and blocks have removed."""
    samples = sum(residual.size / correlation_time(residual) for _, residual in parts)
    parameters = int(system.delay_free.nstates) + 2 + 2 * len(parts)
    # With as many parameters as samples there would be nothing to scale.
    left = max(1 - parameters / samples, _LEAST_LEFT)
    return [
        (model, residual / np.sqrt(left * max(kept_in_blocks(residual, length), _LEAST_LEFT)))
        for model, residual in parts
    ]


def _redrawn(
    record: Record, model: FloatArray, residual: FloatArray, length: int, rng: np.random.Generator
) -> Record:
    """Add blocks of the residual, drawn circularly, to the model's response."""
    n = residual.size
    starts = rng.integers(n, size=-(-n // length))
    index = (starts[:, None] + np.arange(length)).ravel()[:n] % n
    return record.__replace__(output=model + residual[index])
