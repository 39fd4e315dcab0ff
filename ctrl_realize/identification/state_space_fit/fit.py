"""Output-error fit of state-space models with several inputs and outputs."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import control as ct
import numpy as np
from numpy.typing import ArrayLike

from ..._checks import integers
from ..._wording import chosen, in_time
from ...data import Record
from ...data.given import as_records, check_inputs_move, records_alike
from ...data.shown_units import in_shown_units
from ...delayed import DelayedStateSpace, fit_of
from ...delayed.simulation import as_delayed
from ...errors import DataError, OptionError, UnsuitableSystemError
from ...numerics.blas_threads import single_threaded
from ...numerics.constants import SMALLEST
from ...numerics.state_space.section_fit import fit_sections
from ...numerics.state_space.sections import in_sections
from ..long_records import lively_parts
from .result import StateSpaceFit, fitted_system
from .search import Candidate, experiments
from .starts import from_starts


@single_threaded
@in_shown_units
def fit_state_space(
    records: Record | Sequence[Record],
    order: int | Sequence[int] | None = None,
    *,
    delays: ArrayLike | None = None,
    feedthrough: bool | None = None,
) -> DelayedStateSpace:
    """Fit a state-space model with delays to whole records: several channels, or many modes.

    The impulse response of `impulse_from_io` is realized at every order tried, and each of these
    initial models is refined until the simulated outputs fit the measured ones best, with white
    noise of unknown variance on every output (output error). Order, input and output delays, and
    feedthrough are chosen by BIC.

    Parameters
    ----------
    records : Record or sequence of Record
        One or several experiments on the same plant. Inputs without gaps; outputs may have missing
        samples.
    order : int or sequence of int, optional
        States without delays, or candidates. Default: from 1 up to 20, until three in a row bring
        no improvement.
    delays : array_like of int, shape (p, m), optional
        Delay of every channel, -1 if there is no response: it then follows from the others, and a
        response that the records show is fitted. Default: estimated.
    feedthrough : bool, optional
        Whether there is a feedthrough after the delays. Default: chosen by BIC.

    Returns
    -------
    DelayedStateSpace
        Stable, in balanced coordinates, with a delay for every input and output; its `fit` is a
        `StateSpaceFit`.

    Raises
    ------
    DataError
        Inputs that do not excite the plant, outputs that do not depend on them, too few samples.
    OrderError, DelayRangeError, OptionError
        Invalid arguments.

    See Also
    --------
    fit_output_error : One input and output, with a continuous delay and its interval.
    identification.refine_state_space : The last step alone, from any model.

    Notes
    -----
    Of records with more than 100 000 samples in total only that many are fitted, from where the
    inputs move (flag "cut").

    An output for whose drift there is very strong evidence has one that is estimated with the model
    (flag "drift"). The model is consistent for coloured noise as well, but BIC assumes white noise:
    with strongly correlated noise the order is too high, and gains at frequency zero may be wrong
    (flags "coloured_residual", "highest_order"). The delays are whole samples; delays that
    cannot be split into those of inputs and outputs are modelled by states.

    Models are stable. Where slow poles imitate an unstable plant, the flag "unstable" says so, if
    inputs have moved both ways. A record shorter than the slowest period or lag is fitted, but its
    gain and its slow poles are hardly known.

    References
    ----------
    .. [1] M. Verhaegen and V. Verdult, Filtering and System Identification, Cambridge 2007,
       chapter 7 (output error), here in second-order sections.

    Examples
    --------
    >>> import control as ct
    >>> import numpy as np
    >>> import ctrl_realize as cr
    >>> core = ct.ss(
    ...     [[0.8, 0.1], [0, 0.5]], [[1, 0], [1, 1]], [[1, 0], [1, 1]], np.zeros((2, 2)), 0.1
    ... )
    >>> plant = cr.DelayedStateSpace(core, (2, 5))
    >>> rng = np.random.default_rng(1)
    >>> u = rng.choice([-1.0, 1.0], (2, 300))
    >>> y = plant.simulate(u) + 0.1 * rng.standard_normal((2, 300))
    >>> sys = cr.fit_state_space(cr.Record(0.1 * np.arange(300), u, y), [1, 2, 3])
    >>> sys.fit.order, sys.fit.input_delays, sys.fit.output_delays
    (2, (2, 5), (0, 0))
    """
    given = as_records(records)
    group = tuple(records_alike([one.at_equal_distances() for one in given]))
    asked = None if order is None else integers(order, "order", 1)
    _check_signals(group, feedthrough)
    parts, cut = lively_parts(group)
    system = from_starts(parts, asked, delays, feedthrough).system
    fit = fit_of(system, StateSpaceFit)
    said = [chosen("sample_time.interpolated", usual=in_time(group[0].dt))]
    choices = (*fit.choices, *said * any(one.irregular for one in given))
    return system.replace(fit=replace(fit, flags=cut + fit.flags, choices=choices))


@single_threaded
def refine_state_space(
    system: ct.StateSpace, records: Record | Sequence[Record], *, feedthrough: bool | None = None
) -> DelayedStateSpace:
    """Fit all parameters of a model to records, with fixed order and delays.

    Parameters
    ----------
    system : control.StateSpace
        Discrete, with the sample time of the records, from `realize` for example; poles outside the
        unit circle are first moved inside.
    records : Record or sequence of Record
        As for `fit_state_space`.
    feedthrough : bool, optional
        Whether there is a feedthrough. Default: as in `system`.

    Returns
    -------
    DelayedStateSpace
        Its `fit` is a `StateSpaceFit`.

    Raises
    ------
    DataError, UnsuitableSystemError
        Records and a system that do not match.

    References
    ----------
    .. [1] M. Verhaegen and V. Verdult, Filtering and System Identification, Cambridge University
       Press 2007, chapter 7 (output error), doi:10.1017/CBO9780511618888.

    Examples
    --------
    >>> import control as ct
    >>> import numpy as np
    >>> import ctrl_realize as cr
    >>> fast, slow = (ct.ss([[a]], [[1.0]], [[1.0]], [[0.0]], 1.0) for a in (0.5, 0.8))
    >>> u = np.random.default_rng(0).choice([-1.0, 1.0], 400)
    >>> record = cr.Record(np.arange(400.0), u, cr.delayed_ss(slow, 3).simulate(u))
    >>> refined = cr.identification.refine_state_space(cr.delayed_ss(fast, 3), record)
    >>> print(refined.poles().real.max().round(6))
    0.8
    """
    everything = tuple(records_alike([one.at_equal_distances() for one in as_records(records)]))
    _check_signals(everything, feedthrough)
    group, cut = lively_parts(everything)
    model = as_delayed(system, group[0], stable=False)
    core = model.delay_free
    if core.nstates == 0:
        raise UnsuitableSystemError("the system is a pure gain without dynamics to refine")
    given = bool(np.any(core.D)) if feedthrough is None else bool(feedthrough)
    shares = model.input_delays, model.output_delays
    found = fit_sections(
        experiments(group, shares), in_sections(core.A, core.B, core.C, core.D), feedthrough=given
    )
    return fitted_system(Candidate(found, core.nstates, *shares, given, np.nan), group, {}, (), cut)


def _check_signals(group: Sequence[Record], feedthrough: bool | None) -> None:
    if feedthrough not in (None, True, False):
        raise OptionError(f"feedthrough={feedthrough!r}; expected True, False or None")
    for i, record in enumerate(group):
        if np.isnan(record.input).any():
            raise DataError(
                f"record {i} has missing samples in its input; use the parts between the gaps "
                "as records, or impulse_from_io"
            )
    check_inputs_move(group)
    for name in ("input", "output"):
        known = [np.atleast_2d(getattr(record, name)) for record in group]
        # Without a copy of a long record: the largest magnitude is at an end of the range.
        ends = [*(np.fmax.reduce(x, axis=1) for x in known)]
        ends += [-np.fmin.reduce(x, axis=1) for x in known]
        size = np.fmax.reduce(ends, axis=0)
        if np.any(size < SMALLEST):
            raise DataError(
                f"{name} {int(np.argmin(size))} stays below {SMALLEST:g}, where squares "
                "underflow; choose another unit, or check that it is connected"
            )
