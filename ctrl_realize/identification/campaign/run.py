"""Identify the records of a campaign separately, in parallel if requested."""

from __future__ import annotations

import warnings
from collections.abc import Collection, Generator, Iterable, Iterator, Sized
from contextlib import closing, nullcontext
from dataclasses import replace
from functools import partial
from inspect import signature
from itertools import tee
from operator import attrgetter
from typing import Any

from ..._checks import check_type, one_of
from ...data import Record
from ...delayed import DelayedStateSpace
from ...errors import DataError, OptionError
from ..methods import METHODS, Method, identify
from .campaign import Campaign
from .rows import (
    CampaignRow,
    RecordSource,
    RowStore,
    identify_row,
    known_key,
    settings_of,
    source_name,
)
from .workers import Cluster, Here, Work, Workers

Rows = Generator[CampaignRow, None, None]

_COMPLETE = 1000
"""Number of rows of which a `Campaign` without a store keeps the complete fit, 50 to 80 kB each."""


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
        read gives a row with its error. A generator is consumed as records are identified.
    n_jobs : int, optional
        Number of processes (joblib; -1 for all cores). The result does not depend on it. A record
        whose process is killed by the system twice gives a row with that error. Not used with
        `client`.
    method : {"output_error", "scan", "paper"}, optional
    progress : bool, optional
        Show a progress bar; default: if the output is a terminal or a notebook.
    store : CampaignStore, optional
        File in which the result of each record is stored as soon as it is finished, for thousands
        of records: an interrupted run is resumed when it is called again with the same store. Only
        a summary of each fit is kept. Without a store, the first 1000 rows have their complete fit
        and the others the model alone.
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
        Its rows are in the order given. For more records than memory holds see `identify_each`.

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
    check_type(records, Iterable, "records", "several records")
    # what can be taken only once is kept as it is taken: the final model reads it again
    taken, kept = (records, records) if isinstance(records, Collection) else tee(records)
    with closing(identify_each(
        taken, n_jobs=n_jobs, method=method, progress=progress, store=store, client=client,
        **options,
    )) as found:  # fmt: skip
        rows = [row if row.position < _COMPLETE else _without_fit(row) for row in found]
    if not rows:
        raise DataError("there are no records to identify")
    rows.sort(key=attrgetter("position"))
    return Campaign(tuple(rows), tuple(kept), method, options)


def identify_each(
    records: Iterable[RecordSource],
    *,
    n_jobs: int = 1,
    method: Method = "output_error",
    progress: bool | None = None,
    store: RowStore | None = None,
    client: Any = None,
    **options: Any,
) -> Rows:
    """Identify records one after another, of which none is kept; memory does not grow.

    Parameters
    ----------
    records, n_jobs, method, progress, store, client, **options
        As for `identify_campaign`. Records are taken from a generator as rows are taken from this
        one: in this process one at a time, with `n_jobs` at most two for each process ahead, on a
        cluster at most 100 and two for each thread.

    Returns
    -------
    generator of CampaignRow
        In the order in which they finish; ``row.position`` is the place of the record, from 0. A
        row that was yielded is in the store. Its ``close()`` ends the run.

    Raises
    ------
    OptionError, DataError
        As for `identify_campaign`; no records give no rows.

    Examples
    --------
    >>> import ctrl_realize as cr
    >>> valve = cr.bench.valve()
    >>> records = (valve.step_record(16.0, seed) for seed in range(3))
    >>> for row in cr.identification.identify_each(records, method="paper"):
    ...     print(row.position, row.delay)
    0 53.0
    1 55.0
    2 59.0
    """
    check_type(records, Iterable, "records", "several records")
    method = one_of(method, "method", METHODS)
    if store is not None and not hasattr(store, "opened"):
        raise OptionError(f"store={store!r}; expected a ctrl_realize.io.CampaignStore(path)")
    known = set(signature(identify).parameters) - {"record", "method"}
    strange = sorted(set(options) - known)
    if strange:
        raise OptionError(f"{', '.join(strange)}: identify takes {', '.join(sorted(known))}")
    if type(n_jobs) is not int or not 0 < abs(n_jobs) <= 10_000:
        raise OptionError(f"n_jobs={n_jobs!r}; expected a number of processes, or -1 for all")
    work = partial(identify_row, method=method, options=options, store=store)
    workers = _workers(work, n_jobs, store, client)
    rows = _rows(records, workers, store, settings_of(method, options))
    return _with_bar(rows, len(records) if isinstance(records, Sized) else None, progress)


def _without_fit(row: CampaignRow) -> CampaignRow:
    """Keep of a row's model no fit, which takes most of its memory."""
    if isinstance(row._model, DelayedStateSpace):
        row = replace(row, _model=row._model.replace(fit=None))
    return row


def _workers(work: Work, n_jobs: int, store: RowStore | None, client: Any) -> Workers:
    """Who identifies the records."""
    from joblib import effective_n_jobs
    from joblib.parallel import get_active_backend

    client = client or getattr(get_active_backend()[0], "client", None)  # joblib's Dask backend
    if client is None:
        processes = effective_n_jobs(n_jobs)
        return Here(work, store) if processes == 1 else Workers(work, processes)
    if not hasattr(client, "nthreads") or client.asynchronous:
        raise OptionError(f"client={client!r}; expected a distributed.Client, not asynchronous")
    return Cluster(work, client)


def _with_bar(rows: Rows, total: int | None, progress: bool | None) -> Rows:
    with warnings.catch_warnings():
        # In a notebook without ipywidgets tqdm warns, and uses text instead.
        warnings.filterwarnings("ignore", message="IProgress not found")
        from tqdm.auto import tqdm
    # disable=None: no bar if the output is not a terminal.
    disable = None if progress is None else not progress
    # Closed before anything else happens: an interruption may come while a row is counted.
    with closing(rows):
        yield from tqdm(rows, total=total, desc="identify", unit="record", disable=disable)


def _rows(
    records: Iterable[RecordSource], workers: Workers, store: RowStore | None, settings: str
) -> Rows:
    """Identify records that the store does not have; store each row before it is yielded."""

    def taken(*, wait: bool) -> Iterator[CampaignRow]:
        done = workers.take(wait=wait)
        fresh = [(key, row) for key, row in done if key is not None]
        yield from (row for key, row in done if key is None)
        if store is not None and fresh:
            yield from store.save(fresh, settings)

    with closing(workers), nullcontext() if store is None else store.opened():
        for position, source in enumerate(records):
            if not isinstance(source, Record) and not callable(source):
                raise DataError(
                    f"records[{position}] is a {type(source).__name__}; expected a Record, or a "
                    "function that returns one (functools.partial(read_record, path))"
                )
            key = None if store is None else known_key(source, settings)
            kept = None if store is None or key is None else store.load(key)
            if kept is not None:
                name = source_name(source, position) if isinstance(source, Record) else kept.name
                yield replace(kept, name=name, position=position)
                continue
            workers.start((source, position, key))
            yield from taken(wait=False)
            while workers.full:
                yield from taken(wait=True)
        while workers.busy:
            yield from taken(wait=True)
