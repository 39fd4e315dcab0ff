"""Result of a residual analysis."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..._wording import in_percent
from ...data import Record
from ...numerics.arrays import FloatArray
from ...results import Flag, Result


@dataclass(frozen=True, eq=False)
class ResidualAnalysis(Result):
    """Residual of a simulated model, with its correlations.

    ``residual == record.output - simulated``. The residual of a model that explains the whole
    effect of the input is not correlated with past inputs: ``|cross| <= cross_bound`` at lags > 0
    (and at 0 for a model with feedthrough), except for a fraction ``1 - confidence`` of them.
    Correlation at negative lags indicates feedback. An output-error model need not have a white
    residual: sensor noise may be coloured.

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
        Bound of the autocorrelation for white noise.
    cross_bound : ndarray, shape (p, m)
    whiteness : ndarray, shape (p,)
        P-value of the Ljung-Box test of whiteness.
    white, independent : bool
        Whether whiteness, or independence from the input, is not rejected at `confidence` over all
        lags together.
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
    ...     check = cr.validation.analyse_residuals(plant.replace(delay=delay), record)
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
        return f"Residual analysis of {self.record.name or 'a record'}"

    def _rows(self) -> list[tuple[str, str]]:
        level = f"{100 * self.confidence:g} %"
        rms = np.sqrt(np.mean(np.atleast_2d(self.residual) ** 2, axis=1))
        return [
            ("fit", in_percent(self.fit_percent)),
            ("residual (rms)", ", ".join(f"{r:.4g}" for r in rms)),
            ("white", f"{'yes' if self.white else 'no'} (at {level})"),
            ("uncorrelated with the input", f"{'yes' if self.independent else 'no'} (at {level})"),
        ]

    def __repr__(self) -> str:
        fit = ", ".join(f"{f:.1f}" for f in self.fit_percent)
        return (
            f"<ResidualAnalysis: fit {fit} %, white {self.white}, independent {self.independent}>"
        )
