"""Several models on one record: how much each follows, and what it leaves."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import control as ct
import numpy as np

from ..._wording import count_of, in_percent
from ...data import Record
from ...data.given import as_record
from ...delayed import DelayedStateSpace
from ...errors import DataError
from ...numerics.blas_threads import single_threaded
from ...results import Result
from ..output_error.repeatability import distinct
from .residuals import analyse_residuals
from .residuals_result import ResidualAnalysis

if TYPE_CHECKING:
    import pandas as pd


@dataclass(frozen=True, eq=False)
class ModelComparison(Result):
    """Models that were simulated with the input of one record.

    ``checks[i]`` is the residual analysis of the model ``names[i]``; ``best`` is the name of the
    one with the largest fit. `plot` draws all outputs, residuals, and their correlations with
    bands.

    Attributes
    ----------
    names : tuple of str
    checks : tuple of ResidualAnalysis
    estimation_data : tuple of bool
        Whether the record is one that the model was fitted to: its fit is no test of it then.
    record : Record

    Examples
    --------
    >>> import ctrl_realize as cr
    >>> valve = cr.bench.valve()
    >>> seen, unseen = (valve.step_record(16, rng=seed) for seed in (5, 6))
    >>> models = {
    ...     name: cr.fit_output_error(seen, structures=[pair])
    ...     for name, pair in {"one lag": (1, 1), "two lags": (2, 2)}.items()
    ... }
    >>> found = cr.compare(models, unseen)
    >>> found.best, found.estimation_data
    ('two lags', (False, False))
    """

    names: tuple[str, ...]
    checks: tuple[ResidualAnalysis, ...]
    estimation_data: tuple[bool, ...]
    record: Record

    @property
    def fit_percent(self) -> dict[str, float]:
        """Fit in per cent by name; the mean over the outputs."""
        pairs = zip(self.names, self.checks, strict=True)
        return {name: float(check.fit_percent.mean()) for name, check in pairs}

    @property
    def best(self) -> str:
        """Name of the model with the largest fit."""
        return max(self.fit_percent.items(), key=lambda pair: pair[1])[0]

    def table(self) -> pd.DataFrame:
        """List the models, best first.

        Returns
        -------
        pandas.DataFrame
            Index ``model``; columns ``fit_percent``, ``residual_rms`` (for several outputs their
            root mean square), ``white`` and ``independent`` (see `ResidualAnalysis`),
            ``estimation_data``.
        """
        import pandas as pd

        rows = {
            "fit_percent": list(self.fit_percent.values()),
            "residual_rms": [float(np.sqrt(np.mean(one.residual**2))) for one in self.checks],
            "white": [one.white for one in self.checks],
            "independent": [one.independent for one in self.checks],
            "estimation_data": list(self.estimation_data),
        }
        table = pd.DataFrame(rows, index=pd.Index(self.names, name="model"))
        return table.sort_values("fit_percent", ascending=False, kind="stable")

    def _title(self) -> str:
        count = count_of(len(self.names), "model")
        return f"Comparison of {count} on {self.record.name or 'a record'}"

    def _rows(self) -> list[tuple[str, str]]:
        rows = []
        for name, check, fitted in zip(self.names, self.checks, self.estimation_data, strict=True):
            said = [f"fit {in_percent(check.fit_percent)}"]
            said.append("residual white" if check.white else "residual not white")
            if not check.independent:
                said.append("correlated with the input")
            if fitted:
                said.append("fitted to this record")
            rows.append((name, ", ".join(said)))
        return rows

    def __repr__(self) -> str:
        fits = ", ".join(f"{name} {fit:.1f} %" for name, fit in self.fit_percent.items())
        return f"<ModelComparison: {fits}>"


@single_threaded
def compare(
    models: Mapping[str, ct.StateSpace] | Sequence[ct.StateSpace] | ct.StateSpace, record: Record
) -> ModelComparison:
    """Compare models with a record, best one that they were not fitted to.

    Parameters
    ----------
    models : dict of str to control.StateSpace, or sequence of them, or one
        Discrete models with the sample time of the record. Those of a sequence are called by their
        names, numbered where these are equal.
    record : Record

    Returns
    -------
    ModelComparison
        Fit in per cent of each, residuals with tests of whiteness and of independence from the
        input; ``.table()``, ``.plot()``.

    Raises
    ------
    DataError
        No models, or a record that does not match them.
    UnsuitableSystemError
        A continuous or unstable system.

    See Also
    --------
    ctrl_realize.validation.cross_validate : A table of the fits on several records.
    ctrl_realize.compare_frf : A model and a measured frequency response.

    Notes
    -----
    The fit is ``100 (1 - |y - ys| / |y - mean y|)`` of the simulated output ys [1]_.

    References
    ----------
    .. [1] L. Ljung, System Identification: Theory for the User, 2nd ed., Prentice Hall 1999,
       sections 16.5 (Model validation) and 16.6 (Residual analysis).

    Examples
    --------
    >>> import ctrl_realize as cr
    >>> valve = cr.bench.valve()
    >>> seen, unseen = (valve.step_record(16, rng=seed) for seed in (5, 6))
    >>> one, two = (cr.fit_output_error(seen, structures=[pair]) for pair in ((1, 1), (2, 2)))
    >>> found = cr.compare({"one lag": one, "two lags": two}, unseen)
    >>> print(found.table()["fit_percent"].round(1).to_dict())
    {'two lags': 99.6, 'one lag': 99.2}
    """
    given = as_record(record)
    if isinstance(models, Mapping):
        named: list[tuple[str, Any]] = [(str(name), model) for name, model in models.items()]
    else:
        several = list(models) if isinstance(models, list | tuple) else [models]
        names = distinct(str(getattr(model, "name", None) or "model") for model in several)
        named = list(zip(names, several, strict=True))
    if not named:
        raise DataError("no models; expected at least one, such as [model] or {'mine': model}")
    return ModelComparison(
        names=tuple(name for name, _ in named),
        checks=tuple(analyse_residuals(model, given) for _, model in named),
        estimation_data=tuple(_was_fitted(model, given) for _, model in named),
        record=given,
    )


def _was_fitted(model: Any, record: Record) -> bool:
    """Whether a record is among those that a model was fitted to."""
    fit = model.fit if isinstance(model, DelayedStateSpace) else None
    return fit is not None and any(
        one is record
        or (np.array_equal(one.input, record.input) and np.array_equal(one.output, record.output))
        for one in fit.records
    )
