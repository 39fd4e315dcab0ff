"""Identify the records of a campaign separately, in parallel if requested."""

from __future__ import annotations

import warnings
from collections.abc import Iterable, Iterator, Mapping
from contextlib import closing
from inspect import signature
from typing import Any

from ..._checks import check_type, one_of
from ...data import Record
from ...errors import DataError, OptionError
from ..methods import METHODS, Method, identify
from .campaign import Campaign
from .cluster import identified_on_cluster
from .rows import CampaignRow, RecordSource, RowStore
from .workers import identified


def identify_campaign(
    records: Iterable[RecordSource],
    *,
    n_jobs: int = 1,
    method: Method = "output_error",
    progress: bool | None = None,
    store: RowStore | None = None,
    client: Any = None,
    **options: Any,
) -> Campaign:
    """Identify every record of a campaign; a bad record does not stop the others.

    Parameters
    ----------
    records : iterable of Record, or of functions that return one
        A function, such as ``functools.partial(cr.read_record, path)``, is called by the worker
        that identifies the record, so that files are read one at a time, and a file that cannot be
        read gives a row with its error.
    n_jobs : int, optional
        Number of processes (joblib; -1 for all cores). The result does not depend on it. A record
        whose process is killed by the system twice gives a row with that error. Not used with
        `client`.
    method : {"output_error", "scan", "paper"}, optional
    progress : bool, optional
        Show a progress bar; default: if the output is a terminal or a notebook.
    store : CampaignStore, optional
        Folder in which the result of each record is stored as soon as it is finished, for thousands
        of records: an interrupted run is resumed when it is called again with the same store. Only
        a summary of each fit is stored, so that memory does not grow.
    client : distributed.Client, optional
        Client of a Dask cluster, whose workers identify the records (extra ``cluster``). A record
        that the cluster gives up, since it kills its workers or no worker is left, gives a row with
        that error. Default: the client of joblib's ``parallel_config(backend="dask")``, if the call
        is inside one.
    **options
        Further arguments of `identify`, the same for all records.

    Returns
    -------
    Campaign

    Raises
    ------
    DataError
        `records` is empty.
    OptionError
        An argument that `identify` does not have, or a `client` that is asynchronous or none of
        Dask.

    Examples
    --------
    >>> import ctrl_realize as cr
    >>> valve = cr.bench.valve()
    >>> records = [valve.step_record(16.0, seed) for seed in range(3)]
    >>> campaign = cr.identify_campaign(records, method="paper")
    >>> campaign
    <Campaign: 3 records, method 'paper'>
    >>> campaign.delays
    array([53., 55., 59.])
    """
    method = one_of(method, "method", METHODS)
    _check_options(options)
    if type(n_jobs) is not int or not 0 < abs(n_jobs) <= 10_000:
        raise OptionError(f"n_jobs={n_jobs!r}; expected a number of processes, or -1 for all")
    check_type(records, Iterable, "records", "several records")
    sources = list(records)
    if not sources:
        raise DataError("there are no records to identify")
    for position, source in enumerate(sources):
        if not isinstance(source, Record) and not callable(source):
            raise DataError(
                f"records[{position}] is a {type(source).__name__}; expected a Record, or a "
                "function that returns one (functools.partial(read_record, path))"
            )
    client = client or _joblib_client()
    if client is None:
        found = identified(sources, n_jobs, method, options, store)
    else:
        if not hasattr(client, "nthreads") or client.asynchronous:
            raise OptionError(f"client={client!r}; expected a distributed.Client, not asynchronous")
        found = identified_on_cluster(client, sources, method, options, store)
    # Closed before anything else happens: an interruption may come while a row is counted.
    with closing(found):
        rows = dict(_with_bar(found, len(sources), progress))
    in_order = tuple(rows[position] for position in range(len(sources)))
    return Campaign(in_order, tuple(sources), method, options)


def _joblib_client() -> Any:
    """Client of joblib's Dask backend; None if another backend is active."""
    from joblib.parallel import get_active_backend

    backend, _ = get_active_backend()
    return getattr(backend, "client", None)


def _check_options(options: Mapping[str, Any]) -> None:
    known = set(signature(identify).parameters) - {"record", "method"}
    strange = sorted(set(options) - known)
    if strange:
        raise OptionError(f"{', '.join(strange)}: identify takes {', '.join(sorted(known))}")


def _with_bar(
    rows: Iterable[tuple[int, CampaignRow]], total: int, progress: bool | None
) -> Iterator[tuple[int, CampaignRow]]:
    with warnings.catch_warnings():
        # In a notebook without ipywidgets tqdm warns, and uses text instead.
        warnings.filterwarnings("ignore", message="IProgress not found")
        from tqdm.auto import tqdm
    # disable=None: no bar if the output is not a terminal.
    disable = None if progress is None else not progress
    yield from tqdm(rows, total=total, desc="identify", unit="record", disable=disable)
