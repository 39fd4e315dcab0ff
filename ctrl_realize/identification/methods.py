"""From records to a model in one call."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any, Literal, TypedDict

import control as ct
import numpy as np

from .._checks import integer, one_of
from ..data import Record
from ..data.given import as_records
from ..data.shown_units import in_shown_units
from ..delayed import DelayedStateSpace, fit_of
from ..errors import OptionError
from ..numerics.blas_threads import single_threaded

if TYPE_CHECKING:
    from .output_error.actuated.alternatives import Asked
    from .process_structures import Structures

# Together the methods are 200 modules, a quarter of the time of importing python-control: each is
# imported by the first call that uses it.

Method = Literal["output_error", "scan", "paper"]

METHODS: tuple[str, ...] = ("output_error", "scan", "paper")


class IdentifyOptions(TypedDict, total=False):
    """Arguments of `identify` except record and method, as taken by `identify_campaign`."""

    order: int | None
    max_delay: int | None
    known: ct.LTI | None
    loss: Literal["huber", "least_squares"]
    noise: Literal["auto", "white"]
    structures: Structures | None
    include_known: bool
    gains: Literal["common", "own"]
    actuator: Asked | None
    cutoff_hz: float | Literal["auto"] | None
    samples: int | None
    feedthrough: bool | None


@single_threaded
@in_shown_units
def identify(
    record: Record | Sequence[Record],
    *,
    method: Method = "output_error",
    order: int | None = None,
    max_delay: int | None = None,
    known: ct.LTI | None = None,
    loss: Literal["huber", "least_squares"] = "huber",
    noise: Literal["auto", "white"] = "auto",
    structures: Structures | None = None,
    include_known: bool = False,
    gains: Literal["common", "own"] = "common",
    actuator: Asked | None = None,
    cutoff_hz: float | Literal["auto"] | None = "auto",
    samples: int | None = None,
    feedthrough: bool | None = None,
    frf: ct.FrequencyResponseData | None = None,
) -> DelayedStateSpace:
    """Identify a model with dead time from one record, or from several of one plant.

    Parameters
    ----------
    record : Record or sequence of Record
        The scan and the paper's method need one record with one output and a step in its one input.
        The output-error fit accepts several records, any input (see `fit_output_error`), and
        several inputs and outputs (see `fit_state_space`).
    method : {"output_error", "scan", "paper"}, optional
        ``"output_error"``: fit of the raw record with a continuous delay; the most accurate, and
        the only one with a confidence interval. ``"scan"``: the realization scan with zero-phase
        filter and backward difference. ``"paper"``: the published method: central difference,
        causal filter at 50 Hz, order 3, 1000 samples, delays 0...100.
    order : int, optional
        Order of the model without its delay. Default: chosen from the data (``"paper"``: 3).
    max_delay : int, optional
        Largest delay in samples. Default: for ``"scan"`` the time at which the step response has
        reached half of its final value, for ``"paper"`` 100, for ``"output_error"`` see
        `fit_output_error`.
    known, loss, noise, structures, include_known, gains, actuator : optional
        For ``"output_error"``, see `fit_output_error`.
    cutoff_hz, samples, feedthrough : optional
        For ``"scan"`` and ``"paper"``, see `impulse_from_step` and `estimate_delay`.
    frf : MeasuredFRF, optional
        Measured frequency response of the same plant, which is fitted together with the records;
        see `fit_joint`.

    Returns
    -------
    DelayedStateSpace
        Its `.fit` is an `OutputErrorFit` or a `DelayScan`, or a `StateSpaceFit` for several
        channels and where a model of lags with dead time is not adequate (see Notes), or a
        `JointFit` if `frf` is given;
        `.fit.report()` states what was chosen and why. The preceding steps are kept:
        ``.fit.impulse.step.record`` for the scans, ``.fit.records`` for the fit.

    Raises
    ------
    OptionError
        An unknown method, or an argument that the method does not take.
    NoStepError, DataError, OrderError, DelayRangeError
        Data that the method cannot use.

    Notes
    -----
    A record with one input and one output whose input is not a step is fitted by lags with a dead
    time. If the residual is correlated with the input, a state-space model with a delay of whole
    samples (`fit_state_space`) is fitted as well. It is chosen if its information criterion is
    smaller by 10 or more, on the same samples and with an autoregressive noise model for each. Its
    `fit` has `dead_time`, `interval` and `total_delay`; the interval spans the delays that are not
    ruled out at its order and the interval of the lag model (``fit.lags``), unless the residual of
    the latter is more than twice as large. If `order`, `structures` or `known` is given, or if
    samples are missing, no other model class is tried.

    ``"paper"`` and ``"scan"`` are the method of [1]_; for the sources of the output-error fit see
    `fit_output_error`.

    References
    ----------
    .. [1] J. van Helvoirt, O. Bosgra, B. de Jager and M. Steinbuch, Approximate realization of
       valve dynamics with time delay, Proc. 16th IFAC World Congress, 2005, sections 2.1 and 3.2.

    Examples
    --------
    >>> import control as ct
    >>> import numpy as np
    >>> import ctrl_realize as cr
    >>> t = 0.01 * np.arange(900)
    >>> u = np.where(t < 1.0, 0.0, 2.0)
    >>> y = np.where(t < 1.125, 0.0, 6 * -np.expm1(-(t - 1.125) / 0.4))
    >>> rng = np.random.default_rng(1)
    >>> sys = cr.identify(cr.Record(t, u, y + 0.01 * rng.standard_normal(t.size)))
    >>> isinstance(sys, ct.StateSpace), round(sys.fit.dead_time, 3)
    (True, 0.125)
    """
    method = one_of(method, "method", METHODS)
    of_scan = _given(
        cutoff_hz=cutoff_hz != "auto", samples=samples is not None,
        feedthrough=feedthrough is not None,
    )  # fmt: skip
    of_fit = _given(
        known=known is not None, structures=structures is not None, loss=loss != "huber",
        noise=noise != "auto", include_known=include_known, gains=gains != "common",
        actuator=actuator is not None,
    )  # fmt: skip
    other_method = f"an argument of method={method!r}; see the documentation of identify"
    if method != "output_error":
        _refuse(of_fit + _given(frf=frf is not None), other_method)
        return _scanned(method, record, order, max_delay, cutoff_hz, samples, feedthrough)
    if frf is not None:
        _refuse(
            [name for name in of_scan + of_fit if name != "structures"],
            "an argument with frf; expected order, structures or max_delay; fit the records alone "
            "with the others",
        )
        from .joint.fit import fit_joint

        return fit_joint(record, frf, structures=_requested(order, structures), max_delay=max_delay)
    _refuse(of_scan, other_method)
    if any(one.ninputs * one.noutputs > 1 for one in as_records(record)):
        _refuse(
            of_fit + _given(max_delay=max_delay is not None),
            "an argument for records of several channels; see fit_state_space",
        )
        from .state_space_fit.fit import fit_state_space

        return fit_state_space(record, order)
    system = fit_records(
        record, order=order, max_delay=max_delay, known=known, loss=loss, noise=noise,
        structures=structures, include_known=include_known, gains=gains, actuator=actuator,
    )  # fmt: skip
    if known is not None:
        return system
    return _modes_judged(system, max_delay, asked=order is not None or structures is not None)


def _given(**used: bool) -> list[str]:
    """Names of the arguments that were used."""
    return [name for name, is_used in used.items() if is_used]


def _refuse(arguments: Sequence[str], what: str) -> None:
    if arguments:
        raise OptionError(f"{', '.join(arguments)}: not {what}")


def _scanned(method: str, record: object, *options: Any) -> DelayedStateSpace:
    """Identify one record by realization."""
    if not isinstance(record, Record):
        raise OptionError(
            f"method={method!r} takes one record; use method='output_error' for several "
            "records together, or identify_campaign for each on its own"
        )
    from .scan_methods import by_paper, by_scan

    return (by_paper if method == "paper" else by_scan)(record, *options)


def _modes_judged(
    system: DelayedStateSpace, max_delay: int | None, *, asked: bool
) -> DelayedStateSpace:
    """Compare a fit of complete records, none of them a step, with a model of any modes."""
    from .output_error.result import OutputErrorFit

    fit = fit_of(system, OutputErrorFit)
    missing = any(record.n_missing for record in fit.records)
    if fit.actuator is not None or np.isfinite(fit.onset) or missing:
        return system
    from .model_class import with_modes_judged

    return with_modes_judged(system, max_delay, asked=asked)


def fit_records(
    records: Record | Sequence[Record],
    *,
    order: int | None = None,
    structures: Structures | None = None,
    **options: Any,
) -> DelayedStateSpace:
    """Output-error fit with the arguments of `identify`; several records are fitted together."""
    from .output_error.fit import fit_output_error

    return fit_output_error(records, structures=_requested(order, structures), **options)


def _requested(order: int | None, structures: Structures | None) -> Structures | None:
    """Structures that are asked for, by themselves or by an order."""
    if order is None:
        return structures
    if structures is not None:
        raise OptionError("expected order or structures, got both")
    from .process_structures import MOST_ORDER

    order = integer(order, "order", 1, MOST_ORDER)
    return [(order, degree) for degree in range(1, order + 1)]
