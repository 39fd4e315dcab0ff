"""From records to a model in one call."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from functools import wraps
from inspect import signature
from typing import TYPE_CHECKING, Any, Literal, ParamSpec, TypeVar

import control as ct
import numpy as np

from .._checks import integer, one_of
from ..data import Record
from ..data.given import as_records
from ..data.shown_units import in_shown_units
from ..delayed import DelayedStateSpace, fit_of
from ..errors import DataError, OptionError
from ..numerics.blas_threads import single_threaded

if TYPE_CHECKING:
    from .output_error.actuated.alternatives import Asked
    from .process_structures import Structures

# Together the methods are 200 modules, a quarter of the time of importing python-control: each is
# imported by the first call that uses it.

Method = Literal["output_error", "scan", "paper"]

METHODS: tuple[str, ...] = ("output_error", "scan", "paper")
P = ParamSpec("P")
T = TypeVar("T")


def _of_records(function: Callable[P, T]) -> Callable[P, T]:
    """Say how arrays become a record if they are given in its place."""

    @wraps(function)
    def checked(*args: P.args, **kwargs: P.kwargs) -> T:
        if len(args) > 1:
            raise DataError(
                f"expected a Record or a list of them, got {len(args)} arguments; arrays become a "
                "record by Record(time, input, output), and options have names"
            )
        if args and isinstance(args[0], Iterator):  # is empty when it is looked at again
            args = (list(args[0]),)  # type: ignore[assignment]
        return function(*args, **kwargs)

    return checked


@_of_records
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
    focus: Literal["simulation", "prediction"] = "simulation",
    structures: Structures | None = None,
    include_known: bool = False,
    gains: Literal["common", "own"] = "common",
    actuator: Asked | None = None,
    cutoff_hz: float | Literal["auto"] | None = "auto",
    samples: int | None = None,
    feedthrough: bool | None = None,
    frf: ct.FrequencyResponseData | None = None,
    fastest_lag: float | None = None,
    dead_time: tuple[float, float] | None = None,
) -> DelayedStateSpace:
    """Identify a model with dead time from one record, or from several of one plant.

    Parameters
    ----------
    record : Record or sequence of Record
        The scan and the paper's method need one record with one output and a step in its one input.
        The output-error fit accepts several records, any input (see `fit_output_error`), and
        several inputs and outputs (see `fit_state_space`).
    method : {"output_error", "scan", "paper"}, optional
        ``"output_error"`` fits the raw record, ``"scan"`` and ``"paper"`` use realization. The fit
        has a continuous delay, is the most accurate, and the only one with a confidence interval.
        ``"scan"``: the realization scan with zero-phase filter and backward difference.
        ``"paper"``: the published method: central difference, causal filter at 50 Hz, order 3, 1000
        samples, delays 0...100.
    order : int, optional
        Order of the model without its delay; default: chosen from the data (``"paper"``: 3).
    max_delay : int, optional
        Largest delay in samples. Default: for ``"scan"`` the time at which the step response has
        reached half of its final value, for ``"paper"`` 100, for ``"output_error"`` see
        `fit_output_error`.
    known, loss, noise, focus, include_known : optional
        For ``"output_error"``, see `fit_output_error`.
    structures : optional
        Process model, such as P1D, P2DZ, FOPDT or SOPDT. For ``"output_error"``, which also takes
        (order, relative degree), see `fit_output_error`. For a record with several inputs and one
        output: of the model of each input, see `fit_several_inputs`.
    gains : {"common", "own"}, optional
        ``"own"``: each of several records has its own gain. For ``"output_error"``.
    actuator : {"auto", "slew_rate", "dead_band", "stiction", "resolution", "saturation", \
            "characteristic"}, optional
        Fit the limits of a valve or drive as well; ``"auto"``: choose by information criterion. For
        ``"output_error"``.
    cutoff_hz : float or None, optional
        For ``"scan"`` and ``"paper"``: cutoff of the filter in Hz. See `impulse_from_step`.
    samples : int, optional
        For ``"scan"`` and ``"paper"``: number of samples of the impulse response. See
        `estimate_delay`.
    feedthrough : bool, optional
        For ``"scan"``, ``"paper"`` and several channels, see `estimate_delay` and
        `fit_state_space`.
    frf : MeasuredFRF, optional
        Measured frequency response of the same plant, which is fitted together with the records;
        see `fit_joint`.
    fastest_lag : float, optional
        No lag of the plant is faster, in s. For ``"output_error"``, see `fit_output_error`.
    dead_time : (low, high), optional
        Range in s of the dead time. For ``"output_error"``, see `fit_output_error`.

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
    samples (`fit_state_space`) is fitted as well; also if it is so within the same sample alone, as
    of a feedthrough, unless later inputs show that a controller does it. It is chosen if its
    information criterion is smaller by 10 or more, on the same samples and with an autoregressive
    noise model for each. Its `fit` has `dead_time`, `interval` and `total_delay`; the interval
    spans the delays that are not ruled out at its order and the interval of the lag model
    (``fit.lags``), unless the residual of the latter is more than twice as large. If `order`,
    `structures` or `known` is given, or if samples are missing, no other model class is tried.

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
    options = {
        name: value
        for name, value in locals().items()
        if name in _DEFAULTS and not _is_default(value, _DEFAULTS[name])
    }
    models = frf is not None, structures is not None
    name, fit = _fit_of(one_of(method, "method", METHODS), record, *models)
    taken = signature(fit).parameters
    if "structures" in taken:
        options = _with_structures(**options)
    if others := options.keys() - taken.keys():
        raise OptionError(
            f"{', '.join(sorted(others))}: not an argument of {name}; expected order, "
            f"{', '.join(one for one in _DEFAULTS if one in taken and one != 'order')}"
        )
    system = fit(record, **options)
    if name != _OUTPUT_ERROR or known is not None:
        return system
    asked = any(one is not None for one in (order, structures, fastest_lag, dead_time))
    return _modes_judged(system, max_delay, asked=asked)


_DEFAULTS = {
    name: one.default
    for name, one in signature(identify).parameters.items()
    if name not in ("record", "method")
}
"""Arguments that only some methods take."""
_OUTPUT_ERROR = "method='output_error'"


def _is_default(value: object, default: object) -> bool:
    return value is default or (isinstance(value, str) and value == default)


def _fit_of(
    method: str, record: object, with_frf: bool, with_structures: bool
) -> tuple[str, Callable[..., DelayedStateSpace]]:
    """Name and function of the fit; its signature has the arguments that it takes."""
    if method != "output_error":
        if not isinstance(record, Record):
            raise OptionError(
                f"method={method!r} takes one record; use method='output_error' for several "
                "records together, or identify_campaign for each on its own"
            )
        from .scan_methods import by_paper, by_scan

        return f"method={method!r}", by_paper if method == "paper" else by_scan
    if with_frf:
        from .joint.fit import fit_joint

        return "a fit with frf", fit_joint
    several = [one for one in as_records(record) if one.ninputs * one.noutputs > 1]
    if with_structures and several and max(one.noutputs for one in several) == 1:
        from .several_inputs import fit_several_inputs

        return "a fit of several inputs", fit_several_inputs
    if several:
        from .state_space_fit.fit import fit_state_space

        return "a fit of several channels", fit_state_space
    from .output_error.fit import fit_output_error

    return _OUTPUT_ERROR, fit_output_error


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


def fit_records(records: Record | Sequence[Record], **options: Any) -> DelayedStateSpace:
    """Output-error fit with the arguments of `identify`; several records are fitted together."""
    from .output_error.fit import fit_output_error

    return fit_output_error(records, **_with_structures(**options))


def _with_structures(
    order: int | None = None, structures: Structures | None = None, **options: Any
) -> dict[str, Any]:
    """Options with the structures that an order stands for."""
    if order is None:
        return options if structures is None else {"structures": structures, **options}
    if structures is not None:
        raise OptionError("expected order or structures, got both")
    from .process_structures import MOST_ORDER

    order = integer(order, "order", 1, MOST_ORDER)
    return {"structures": [(order, degree) for degree in range(1, order + 1)], **options}
