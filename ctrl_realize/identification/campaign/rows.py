"""One record of a campaign: its model, or the error that stopped it."""

from __future__ import annotations

import functools
import hashlib
import os
import warnings
from collections.abc import Callable, Mapping, Sequence
from contextlib import AbstractContextManager
from dataclasses import dataclass, replace
from pathlib import Path
from types import FunctionType
from typing import Any, Protocol

import control as ct
import numpy as np

from ..._checks import spelled_out
from ..._facts import version_of
from ...data import Record
from ...delayed import DelayedStateSpace, fit_of
from ...errors import CtrlRealizeError, DataError
from ...results import Flag, ModelFit
from ..methods import Method, identify
from ..realization.delay_scan_result import DelayScan
from ..step.steps import detect_step

RecordSource = Record | Callable[[], Record]

_PACKAGE = "ctrl_realize."
LONGEST_ERROR = 1000  # characters; a longer text would fill table and report


@dataclass(frozen=True, eq=False)
class CampaignRow:
    """Result of one record.

    Exactly one of `system` and `error` is None; without a system all numbers are NaN.

    Attributes
    ----------
    name : str
    amplitude : float
        Height of the input step; NaN for other inputs.
    delay : float
        Estimated delay in samples.
    dead_time : float
        ``delay * dt`` in s.
    interval : tuple of float
        Interval of the dead time in s.
    residual : float
        Residual of the model, scaled to a unit step so that records can be compared.
    gain, gain_std : float
        Gain of the model at zero frequency, and its standard error for the chosen structure; NaN if
        the method gives none.
    total_delay : float
        Dead time plus lags in s; NaN if the method gives none.
    total_delay_interval : tuple of float
        95 % interval of the total delay, in s.
    order : int or None
        Order of the model without its delay.
    dt : float
        Sample time of the model in s.
    error : str or None
        The error that stopped this record, in one line.
    flags : tuple of Flag
    warnings : tuple of str
        Warnings raised while it was identified.
    position : int
        Place of the record in the order given, from 0.

    Examples
    --------
    >>> import ctrl_realize as cr
    >>> record = cr.bench.valve().step_record(16.0, 1)
    >>> silent = cr.Record(record.time, 0 * record.input, record.output, name="plug was out")
    >>> rows = cr.identify_campaign([record, silent], method="scan").rows
    >>> print(rows[0].name, rows[0].delay, "samples")
    valve_16mA 45.0 samples
    >>> print(rows[1].error)
    NoStepError: no step in the input of record 'plug was out': it is 0 throughout. ...
    """

    name: str
    amplitude: float = float("nan")
    delay: float = float("nan")
    dead_time: float = float("nan")
    interval: tuple[float, float] = (float("nan"), float("nan"))
    residual: float = float("nan")
    gain: float = float("nan")
    gain_std: float = float("nan")
    total_delay: float = float("nan")
    total_delay_interval: tuple[float, float] = (float("nan"), float("nan"))
    order: int | None = None
    dt: float = float("nan")
    error: str | None = None
    flags: tuple[Flag, ...] = ()
    warnings: tuple[str, ...] = ()
    position: int = 0
    _model: DelayedStateSpace | Callable[[], DelayedStateSpace] | None = None

    @property
    def system(self) -> DelayedStateSpace | None:
        """The model; None if the record failed. One of a store is made when it is asked for."""
        model = self._model
        return model if model is None or isinstance(model, DelayedStateSpace) else model()

    @property
    def delay_interval(self) -> tuple[float, float]:
        """Interval of the delay in samples; NaN without a model."""
        return self.interval[0] / self.dt, self.interval[1] / self.dt

    def __repr__(self) -> str:
        what = self.error if self.error is not None else f"delay {self.delay:.4g} samples"
        return f"<CampaignRow {self.name!r}: {what}>"


class RowStore(Protocol):
    """Keeps finished rows, so that an interrupted run can be resumed (see `CampaignStore`)."""

    path: Path

    def opened(self) -> AbstractContextManager[None]:
        """Keep the file open for the duration of a block, which is faster."""

    def load(self, key: str) -> CampaignRow | None:
        """Return the row stored under `key`; None if there is none."""

    def packed(self, row: CampaignRow) -> CampaignRow:
        """Reduce the model of a row to what is stored."""

    def save(self, rows: Sequence[tuple[str, CampaignRow]], settings: str) -> list[CampaignRow]:
        """Store packed rows under their keys, all or none; return them, with a warning if none."""


def identify_row(
    source: RecordSource,
    position: int,
    key: str | None,
    *,
    method: Method,
    options: Mapping[str, Any],
    store: RowStore | None,
) -> tuple[str | None, CampaignRow]:
    """Identify one record; an error becomes the row's error. With it its key, if it is to be saved.

    `key` is that of a record that the store does not have; None if it is known from its content.
    """
    row = CampaignRow(source_name(source, position), position=position)
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        try:
            record = read_source(source)
            if not record.issiso():
                raise DataError(
                    f"{record!r}: a campaign compares the delays of one input and one output; for "
                    "several channels see fit_state_space, which takes several records too"
                )
            row = replace(row, name=record.name or row.name, amplitude=_amplitude(record))
            if store is not None and key is None:
                key = fingerprint(record, settings_of(method, options))
                kept = store.load(key)
                if kept is not None:
                    return None, replace(kept, name=row.name, position=position)
            row = _with_model(row, identify(record, method=method, **options))
        except Exception as error:
            # Whatever the error is, also in a function of the caller that reads files, the other
            # records are still identified. It is tried again when the run is resumed.
            text = spelled_out(" ".join(str(error).split())[:LONGEST_ERROR])
            row = replace(row, error=f"{type(error).__name__}: {text}")
    row = replace(row, warnings=tuple(dict.fromkeys(str(entry.message) for entry in caught)))
    if store is None or row.error is not None:
        return None, row
    try:
        return key, store.packed(row)
    except CtrlRealizeError as error:
        # Labels that cannot be written: the result is kept in memory, and computed again.
        return None, unsaved(row, error)


def unsaved(row: CampaignRow, error: Exception) -> CampaignRow:
    """Add to a row why it is not in the store."""
    text = spelled_out(f"not saved in the store: {error}"[:LONGEST_ERROR])
    return replace(row, warnings=(*row.warnings, text))


def read_source(source: RecordSource) -> Record:
    """Return the record of a source; a function is called to read it."""
    record = source if isinstance(source, Record) else source()
    if not isinstance(record, Record):
        raise DataError(f"the function returned a {type(record).__name__}; expected a Record")
    return record


def settings_of(method: str, options: Mapping[str, Any]) -> str:
    """Write the settings and the versions that a result depends on, with all digits."""
    written = {name: _exact(value) for name, value in sorted(options.items())}
    versions = {name: version_of(name) for name in ("ctrl-realize", "numpy", "scipy")}
    return repr((method, written, versions))


def fingerprint(record: Record, settings: str) -> str:
    """SHA-256 of a record's samples and labels, the settings and the versions."""
    digest = hashlib.sha256(settings.encode())
    for values in (record.time, record.input, record.output):
        digest.update(str(values.shape).encode())
        digest.update(np.ascontiguousarray(values).tobytes())
    digest.update(repr((record.input_labels, record.output_labels)).encode())
    return digest.hexdigest()


def known_key(source: RecordSource, settings: str) -> str | None:
    """Key of a record that need not be read for it; None for others.

    A file that a function of this package reads is known by its path, size and time of change. Of
    a function of others it is unknown whether it is still the same.
    """
    if isinstance(source, Record):
        return fingerprint(source, settings)
    match source:
        case functools.partial(
            func=FunctionType(__module__=module, __qualname__=read),
            args=(str() | os.PathLike() as file, *others),
        ) if module.startswith(_PACKAGE) and os.path.isfile(file):
            known = (os.path.abspath(file), os.path.getsize(file), os.stat(file).st_mtime_ns)
            told = repr((settings, read, known, others, source.keywords))
            return hashlib.sha256(told.encode()).hexdigest()
    return None


def _exact(value: Any) -> str:
    """Write a setting with all digits; python-control shows eight, or only a system's name."""
    if isinstance(value, ct.StateSpace):
        matrices = [M.tolist() for M in (value.A, value.B, value.C, value.D)]
        return repr([*matrices, value.dt])
    if isinstance(value, ct.TransferFunction):
        sides = (value.num, value.den)
        return repr([[[p.tolist() for p in row] for row in side] for side in sides] + [value.dt])
    return repr(value)


def _with_model(row: CampaignRow, system: DelayedStateSpace) -> CampaignRow:
    fit = fit_of(system, ModelFit)
    low, high = fit.interval or (np.nan, np.nan)
    return replace(
        row,
        delay=_or_nan(fit.delay),
        dead_time=_or_nan(fit.dead_time),
        interval=(float(low), float(high)),
        residual=_unit_residual(fit, row.amplitude),
        gain=complex(system(1.0, warn_infinite=False)).real,  # infinite where it integrates
        gain_std=_or_nan(fit.gain_std_given_structure),
        total_delay=_or_nan(fit.total_delay),
        total_delay_interval=fit.total_delay_interval or (np.nan, np.nan),
        order=int(system.delay_free.nstates),
        dt=float(system.dt),
        flags=fit.flags,
        _model=system,
    )


def _unit_residual(fit: ModelFit, amplitude: float) -> float:
    """Residual for a unit step: a scan uses unit steps, a fit the raw record."""
    if isinstance(fit, DelayScan):
        return fit.least_iae
    return _or_nan(fit.residual_std) / (abs(amplitude) if np.isfinite(amplitude) else 1.0)


def _or_nan(value: float | None) -> float:
    return float("nan") if value is None else float(value)


def source_name(source: RecordSource, position: int) -> str:
    """Name of a record before it is read: the first argument of the function that reads it."""
    known = ""
    if isinstance(source, Record):
        known = source.name
    elif isinstance(source, functools.partial) and source.args:
        known = str(source.args[0])
    return spelled_out(known) or f"record {position}"


def _amplitude(record: Record) -> float:
    try:
        return detect_step(record).amplitude
    except CtrlRealizeError:
        return float("nan")
