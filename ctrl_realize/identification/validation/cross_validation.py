"""Fits of several models on several records."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from ...data import Record
from ...data.given import as_records
from ...delayed.simulation import simulate_record
from ...errors import DataError
from ...numerics.blas_threads import single_threaded
from ...numerics.signals.correlation import fit_percent
from ..output_error.repeatability import distinct

if TYPE_CHECKING:
    import control as ct
    import pandas as pd


@single_threaded
def cross_validate(
    systems: Mapping[str, Any] | ct.StateSpace, records: Record | Sequence[Record]
) -> pd.DataFrame:
    """Tabulate the fit in percent of several models on several records.

    Parameters
    ----------
    systems : dict of str to control.StateSpace, or control.StateSpace
        Models by name, or a single one; any that `analyse_residuals` accepts.
    records : Record or sequence of Record
        Preferably records that no model was fitted to. Equal names are numbered.

    Returns
    -------
    pandas.DataFrame
        One row per model, one column per record; the mean over the outputs.

    Raises
    ------
    DataError
        No records or models, or something else among them.

    Notes
    -----
    The fit percentage is ``100 (1 - |y - ys| / |y - mean y|)`` of the simulated output ys [1]_.

    References
    ----------
    .. [1] L. Ljung, System Identification: Theory for the User, 2nd ed., Prentice Hall 1999,
       section 16.5 (Model validation).

    Examples
    --------
    >>> import control as ct
    >>> import numpy as np
    >>> import ctrl_realize as cr
    >>> fast, slow = (ct.ss([[a]], [[1 - a]], [[1.0]], [[0.0]], 1.0) for a in (0.5, 0.8))
    >>> u = np.random.default_rng(0).standard_normal(200)
    >>> y = cr.DelayedStateSpace(slow).simulate(u)
    >>> table = cr.validation.cross_validate(
    ...     {"fast": fast, "slow": slow}, [cr.Record(np.arange(200.0), u, y, name="day 2")]
    ... )
    >>> print(table["day 2"].round(1).to_dict())
    {'fast': 2.4, 'slow': 100.0}
    """
    import pandas as pd

    several = as_records(records)
    # systems of python-control have a name, a model of the caller may have none
    name = str(getattr(systems, "name", None) or "model")
    models = systems if isinstance(systems, Mapping) else {name: systems}
    if not models:
        raise DataError("no models; expected at least one, such as {'mine': model}")

    def mean_fit(system: Any, record: Record) -> float:
        simulated = simulate_record(system, record, "estimate", gaps=True)
        measured = np.atleast_2d(record.output)
        return float(fit_percent(measured[:, record.seen], simulated[:, record.seen]).mean())

    fits = [[mean_fit(system, record) for record in several] for system in models.values()]
    names = distinct(record.name for record in several)
    return pd.DataFrame(fits, index=list(models), columns=list(names))
