"""One record of a campaign: its model, or the error that stopped it."""

from __future__ import annotations

import functools
import hashlib
import warnings
from collections.abc import Callable, Mapping
from contextlib import AbstractContextManager, nullcontext
from dataclasses import dataclass, field, replace
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

_LONGEST_ERROR = 1000  # characters; a longer text would fill table and report


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
    system : DelayedStateSpace or None
        The model; None if the record failed.
    error : str or None
        The error that stopped this record, in one line.
    flags : tuple of Flag
    warnings : tuple of str
        Warnings raised while it was identified.

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
    system: DelayedStateSpace | None = field(default=None, repr=False)
    error: str | None = None
    flags: tuple[Flag, ...] = ()
    warnings: tuple[str, ...] = ()

    @property
    def order(self) -> int | None:
        """Order of the model without its delay."""
        return None if self.system is None else int(self.system.delay_free.nstates)

    @property
    def dt(self) -> float:
        """Sample time of the model in s; NaN without one."""
        return float("nan") if self.system is None else float(self.system.dt)

    @property
    def delay_interval(self) -> tuple[float, float]:
        """Interval of the delay in samples; NaN without a model."""
        return self.interval[0] / self.dt, self.interval[1] / self.dt

    def __repr__(self) -> str:
        what = self.error if self.system is None else f"delay {self.delay:.4g} samples"
        return f"<CampaignRow {self.name!r}: {what}>"


class RowStore(Protocol):
    """Keeps finished rows, so that an interrupted run can be resumed (see `CampaignStore`)."""

    def load(self, key: str) -> CampaignRow | None:
        """Return the row stored under `key`; None if there is none."""
        ...

    def save(self, key: str, row: CampaignRow) -> CampaignRow:
        """Store a row; return it as `load` would."""
        ...

    def attempt(self, key: str) -> AbstractContextManager[None]:
        """Mark a record as being identified for the duration of the block.

        Raises
        ------
        DataError
            The process was killed over it too often before.
        """
        ...


def identify_row(
    source: RecordSource,
    position: int,
    method: Method,
    options: Mapping[str, Any],
    store: RowStore | None,
) -> CampaignRow:
    """Identify one record; an error becomes the row's error."""
    row = CampaignRow(source_name(source, position))
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
            key = fingerprint(record, method, options)
            kept = store.load(key) if store is not None else None
            if kept is not None:
                return replace(kept, name=row.name)
            with store.attempt(key) if store is not None else nullcontext():
                row = _with_model(row, identify(record, method=method, **options))
        except Exception as error:
            # Whatever the error is, also in a function of the caller that reads files, the other
            # records are still identified. It is tried again when the run is resumed.
            text = spelled_out(" ".join(str(error).split())[:_LONGEST_ERROR])
            row = replace(row, error=f"{type(error).__name__}: {text}")
    row = replace(row, warnings=tuple(dict.fromkeys(str(entry.message) for entry in caught)))
    if store is None or row.system is None:
        return row
    try:
        return store.save(key, row)
    except (CtrlRealizeError, OSError) as error:
        # A full disk, or labels that cannot be written: the result is kept in memory, and computed
        # again.
        text = spelled_out(f"not saved in the store: {error}"[:_LONGEST_ERROR])
        return replace(row, warnings=(*row.warnings, text))


def failed_row(source: RecordSource, position: int, error: str) -> CampaignRow:
    """Row of a record that could not be identified where it was sent."""
    text = spelled_out(" ".join(error.split())[:_LONGEST_ERROR])
    return CampaignRow(source_name(source, position), error=text)


def killed_row(source: RecordSource, position: int, how: str = "") -> CampaignRow:
    """Row of a record whose process was killed repeatedly."""
    return failed_row(
        source,
        position,
        f"the process that identified this record was killed by the system{how}, even when run "
        "alone; the usual cause is lack of memory",
    )


def read_source(source: RecordSource) -> Record:
    """Return the record of a source; a function is called to read it."""
    record = source if isinstance(source, Record) else source()
    if not isinstance(record, Record):
        raise DataError(f"the function returned a {type(record).__name__}; expected a Record")
    return record


def fingerprint(record: Record, method: str, options: Mapping[str, Any]) -> str:
    """SHA-256 of a record's samples, the settings and the versions."""
    digest = hashlib.sha256(repr(sorted(versions().items())).encode())
    for values in (record.time, record.input, record.output):
        digest.update(str(values.shape).encode())
        digest.update(np.ascontiguousarray(values).tobytes())
    settings = sorted((name, _exact(value)) for name, value in options.items())
    digest.update(repr((method, settings, record.input_labels, record.output_labels)).encode())
    return digest.hexdigest()


def versions() -> dict[str, str]:
    """Versions of the packages that the results depend on."""
    return {package: version_of(package) for package in ("ctrl-realize", "numpy", "scipy")}


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
        gain=_gain(system),
        gain_std=_or_nan(fit.gain_std_given_structure),
        total_delay=_or_nan(fit.total_delay),
        total_delay_interval=fit.total_delay_interval or (np.nan, np.nan),
        system=system,
        flags=fit.flags,
    )


def _unit_residual(fit: ModelFit, amplitude: float) -> float:
    """Residual for a unit step: a scan uses unit steps, a fit the raw record."""
    if isinstance(fit, DelayScan):
        return fit.least_iae
    return _or_nan(fit.residual_std) / (abs(amplitude) if np.isfinite(amplitude) else 1.0)


def _or_nan(value: float | None) -> float:
    return float("nan") if value is None else float(value)


def _gain(system: DelayedStateSpace) -> float:
    # The gain of an integrating plant is infinite; no warning is given.
    return complex(system(1.0, warn_infinite=False)).real


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
