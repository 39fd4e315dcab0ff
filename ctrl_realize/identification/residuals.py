"""How well a model explains a record, and what it leaves."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import control as ct
import numpy as np
from scipy.special import ndtri

from ..checks import real, whole
from ..delayed import DelayedStateSpace
from ..errors import DataError, OptionError
from ..numerics.arrays import FloatArray, read_only
from ..numerics.correlation import (
    correlation,
    cross_bound,
    fit_percent,
    whiteness,
)
from ..results import Flag, Result
from ..signals import Record
from ..signals.given import as_record
from ..wording import in_percent
from .record_simulation import Start, simulate_record

if TYPE_CHECKING:
    import pandas as pd

EXACT = 1e-8
"""Residual, as a part of the range of the output, below which a model counts as exact."""


@dataclass(frozen=True, eq=False)
class ResidualCheck(Result):
    """Residual of a simulated model against a record.

    ``residual == record.output - simulated``. A model that has taken all from the input leaves a
    residual that is not correlated with its past: ``|cross| <= cross_bound`` at lags > 0 (and at 0
    where the model has a direct term), but for a share ``1 - confidence`` of them. Correlation at
    the lags before is feedback. Whiteness asks
    more than an output-error model promises: sensor noise may well be coloured.

    Attributes
    ----------
    fit_percent : ndarray, shape (p,)
        ``100 (1 - |residual| / |y - mean y|)`` of every output (NRMSE fit).
    simulated, residual : ndarray, shape (N,) or (p, N)
    autocorrelation : ndarray, shape (p, L + 1)
        At lags 0...L.
    cross : ndarray, shape (p, m, 2 L + 1)
        Of ``residual[k + i]`` with ``u[k]`` at lags i = -L...L.
    bound : float
        Bound of the autocorrelation of white noise.
    cross_bound : ndarray, shape (p, m)
    whiteness : ndarray, shape (p,)
        Probability that white noise looks less white (Ljung-Box).
    white, independent : bool
        No doubt about whiteness, or about freedom from the input, at `confidence` over all lags
        together.
    confidence : float
    record : Record
    flags : tuple of Flag

    Examples
    --------
    >>> import control as ct
    >>> import numpy as np
    >>> import ctrl_realize as cr
    >>> plant = cr.DelayedStateSpace(ct.ss([[0.8]], [[1.0]], [[0.2]], [[0.0]], 0.1), 5)
    >>> u, noise = np.random.default_rng(0).standard_normal((2, 2000))
    >>> record = cr.Record(0.1 * np.arange(2000), u, plant.simulate(u) + 0.05 * noise)
    >>> for delay in (5, 4):
    ...     check = cr.check_residuals(plant.replace(delay=delay), record)
    ...     print(delay, check.fit_percent.round(1), "free of the input:", check.independent)
    5 [85.1] free of the input: True
    4 [35.] free of the input: False
    """

    fit_percent: FloatArray
    simulated: FloatArray
    residual: FloatArray
    autocorrelation: FloatArray
    cross: FloatArray
    bound: float
    cross_bound: FloatArray
    whiteness: FloatArray
    white: bool
    independent: bool
    confidence: float
    record: Record
    flags: tuple[Flag, ...] = ()

    @property
    def lags(self) -> FloatArray:
        """Lags of `cross` in samples."""
        L = self.autocorrelation.shape[-1] - 1
        return np.arange(-L, L + 1, dtype=np.float64)

    def _title(self) -> str:
        return f"Residual of {self.record.name or 'a record'}"

    def _rows(self) -> list[tuple[str, str]]:
        level = f"{100 * self.confidence:g} %"
        return [
            ("fit", in_percent(self.fit_percent)),
            ("residual rms", ", ".join(f"{r:.4g}" for r in _rms(self.residual))),
            ("white", f"{'yes' if self.white else 'no'} (at {level})"),
            ("free of the input", f"{'yes' if self.independent else 'no'} (at {level})"),
        ]

    def __repr__(self) -> str:
        fit = ", ".join(f"{f:.1f}" for f in self.fit_percent)
        return f"<ResidualCheck: fit {fit} %, white {self.white}, independent {self.independent}>"


def check_residuals(
    system: ct.StateSpace,
    record: Record,
    *,
    lags: int = 25,
    confidence: float = 0.99,
    start: Start = "estimate",
) -> ResidualCheck:
    """Simulate a model with the input of a record and look at what is left.

    On another record than the model was made from, this is its cross-validation.

    Parameters
    ----------
    system : control.StateSpace
        Discrete, with the sample time of the record; a `DelayedStateSpace` as well.
    record : Record
    lags : int, default 25
        Largest lag of the correlations.
    confidence : float, default 0.99
        Level of bounds and tests.
    start : {"estimate", "rest"}
        Where the simulation starts: with the offset, the state and the input within the dead
        time before the record that fit best (a long dead time in 16 pieces of constant input), or
        at rest with the first sample of the input and the offset that fits best.

    Returns
    -------
    ResidualCheck

    Raises
    ------
    DataError
        A record that does not fit the system, has missing samples, or is too short.
    UnsuitableSystemError
        A system that is continuous or unstable.

    Examples
    --------
    >>> import control as ct
    >>> import numpy as np
    >>> import ctrl_realize as cr
    >>> plant = cr.DelayedStateSpace(ct.ss([[0.8]], [[1.0]], [[0.2]], [[0.0]], 0.1), 5)
    >>> rng = np.random.default_rng(0)
    >>> u = rng.standard_normal(2000)
    >>> y = 7 + plant.simulate(u) + 0.05 * rng.standard_normal(2000)
    >>> record = cr.Record(0.1 * np.arange(2000), u, y)
    >>> cr.check_residuals(plant, record)
    <ResidualCheck: fit 85.1 %, white True, independent True>
    >>> cr.check_residuals(plant.replace(delay=4), record).independent
    False
    """
    count = whole(lags, "lags", 1)
    level = _level(confidence)
    simulated = simulate_record(system, as_record(record), start)
    y, u = np.atleast_2d(record.output), np.atleast_2d(record.input)
    if record.n_samples < 3 * count:
        raise DataError(
            f"lags={count} needs {3 * count} samples, the record has {record.n_samples}"
        )
    e = y - simulated
    # What rounding leaves says nothing about the model.
    e[np.abs(e).max(axis=1) <= EXACT * np.ptp(y, axis=1)] = 0.0
    own = np.stack([correlation(row, row, count) for row in e])
    cross = np.stack([[_two_sided(row, drive, count) for drive in u] for row in e])
    bounds = np.array([[cross_bound(row, drive, count, level) for drive in u] for row in e])
    probability = np.array([whiteness(rho[1:], record.n_samples) for rho in own])
    # One bound for all lags together: the chance of any alarm is 1 - confidence.
    family = 1 - (1 - level) / (2 * count + 1)
    wider = float(ndtri((1 - family) / 2) / ndtri((1 - level) / 2))
    outside = np.abs(cross) > wider * bounds[:, :, None]
    white = bool(np.all(probability > 1 - level))
    # What a plant without direct term shows at lag 0, a controller has put there.
    direct = _first_response(system) != 0
    later = outside[:, :, count:].copy()
    later[:, :, 0] &= direct
    earlier = outside[:, :, : count + 1].copy()
    earlier[:, :, -1] &= ~direct
    independent = not bool(later.any())
    flags = []
    if not independent:
        size = np.where(later, np.abs(cross[:, :, count:]), 0.0)
        _, _, lag = np.unravel_index(np.argmax(size), size.shape)
        flags.append(
            Flag(
                "input_in_residual",
                f"the residual still follows the input, most at lag {lag}: order or delay of the "
                "model are not right, or the plant is not linear",
            )
        )
    if earlier.any():
        flags.append(
            Flag(
                "feedback",
                "the input follows the residual: the record was made in closed loop, which moves "
                "estimates that take the input as free",
            )
        )
    return ResidualCheck(
        fit_percent=read_only(fit_percent(y, simulated)),
        simulated=read_only(simulated.reshape(record.output.shape)),
        residual=read_only(e.reshape(record.output.shape)),
        autocorrelation=read_only(own),
        cross=read_only(cross),
        bound=float(-ndtri((1 - level) / 2) / np.sqrt(record.n_samples)),
        cross_bound=read_only(bounds),
        whiteness=read_only(probability),
        white=white,
        independent=independent,
        confidence=level,
        record=record,
        flags=tuple(flags),
    )


def _first_response(system: ct.StateSpace) -> FloatArray:
    """Markov parameter at lag 0, shape (p, m); the chains of a delayed system are not formed."""
    if isinstance(system, DelayedStateSpace):
        first = np.asarray(system.markov(1), dtype=np.float64)
        return first.reshape(system.noutputs, system.ninputs)
    return np.asarray(system.D, dtype=np.float64)


def cross_validate(
    systems: dict[str, Any], records: Sequence[Record], *, start: Start = "estimate"
) -> pd.DataFrame:
    """Tabulate the fit in percent of several models on several records.

    Parameters
    ----------
    systems : dict of str to control.StateSpace
        Models by name; any that `check_residuals` takes.
    records : sequence of Record
        Best those that no model has seen.
    start : {"estimate", "rest"}
        As for `check_residuals`.

    Returns
    -------
    pandas.DataFrame
        One row a model, one column a record; the mean over the outputs.

    Examples
    --------
    >>> import control as ct
    >>> import numpy as np
    >>> import ctrl_realize as cr
    >>> fast, slow = (ct.ss([[a]], [[1 - a]], [[1.0]], [[0.0]], 1.0) for a in (0.5, 0.8))
    >>> u = np.random.default_rng(0).standard_normal(200)
    >>> y = cr.DelayedStateSpace(slow).simulate(u)
    >>> table = cr.cross_validate(
    ...     {"fast": fast, "slow": slow}, [cr.Record(np.arange(200.0), u, y, name="day 2")]
    ... )
    >>> print(table["day 2"].round(1).to_dict())
    {'fast': 2.4, 'slow': 100.0}
    """
    if not records:
        raise DataError("records is empty")
    import pandas as pd

    names = [record.name or f"record {i}" for i, record in enumerate(records)]
    return pd.DataFrame(
        {
            name: {
                label: float(
                    fit_percent(
                        np.atleast_2d(record.output), simulate_record(system, record, start)
                    ).mean()
                )
                for label, system in systems.items()
            }
            for name, record in zip(names, records, strict=True)
        }
    )


def _two_sided(residual: FloatArray, drive: FloatArray, lags: int) -> FloatArray:
    before = correlation(drive, residual, lags)[:0:-1]
    return np.concatenate([before, correlation(residual, drive, lags)])


def _level(confidence: float) -> float:
    level = real(confidence, "confidence", "a probability between 0 and 1")
    # beyond, 1 - confidence is lost among the digits, or the bound is zero
    if not 1e-12 <= level <= 1 - 1e-12:
        raise OptionError(f"confidence={confidence!r}; needed is a number between 0 and 1")
    return level


def _rms(residual: FloatArray) -> FloatArray:
    return np.asarray(np.sqrt(np.mean(np.atleast_2d(residual) ** 2, axis=1)))
