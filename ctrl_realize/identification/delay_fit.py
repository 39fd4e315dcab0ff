"""Dead time and model from raw records, by an output-error fit."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, Literal

import control as ct
import numpy as np

from ..checks import one_of, positive
from ..delayed import DelayedStateSpace, delayed_ss
from ..errors import DataError, OptionError, OrderError
from ..numerics.arrays import FloatArray
from ..numerics.output_error import OutputErrorFit, fit_output_error
from ..numerics.separable_fit import Structure
from ..numerics.step_problem import StepData, step_data
from ..signals import Record
from .delay_fit_result import DelayFit, StructureRow
from .fit_flags import INTEGRATOR, fit_flags
from .known_dynamics import known_factor
from .steps import detect_step

Loss = Literal["huber", "least_squares"]

MOST_ORDER = 8


def fit_delay(
    records: Record | Sequence[Record],
    *,
    structures: Sequence[tuple[int, int]] | None = None,
    max_delay: float | None = None,
    known: ct.LTI | None = None,
    loss: Loss = "huber",
    include_known: bool = False,
) -> DelayedStateSpace:
    """Fit a transfer function with dead time to raw step records.

    Parameters
    ----------
    records : Record or sequence of Record
        One input, one output. Several records of one plant are aligned at their steps,
        averaged, and fitted together.
    structures : sequence of (order, relative_degree), optional
        Models to try. Default: orders 1 to 5 with relative degrees 1 to the order. With
        structures given the delay is that of the best of them, adequate or not.
    max_delay : float, optional
        Largest dead time in samples. Default: the first lasting motion of the output, after
        which it cannot be.
    known : control.TransferFunction or control.StateSpace, optional
        Continuous dynamics that were measured along (sensor, anti-aliasing filter, converter).
        They are in the fit, but not in the model that is returned.
    loss : {"huber", "least_squares"}, optional
        Huber's loss (k = 1.345) costs 2 % of accuracy on clean data and is hardly moved by
        outliers.
    include_known : bool, optional
        Put the known dynamics into the model that is returned.

    Returns
    -------
    DelayedStateSpace
        Continuous model sampled exactly behind a hold, the fraction of a sample included; its
        `.fit` is a `DelayFit`.

    Raises
    ------
    NoStepError, DataError
        No step, several channels, an output that does not move.
    OrderError, OptionError, UnsuitableSystemError
        Unusable structures, options, or known dynamics.

    Notes
    -----
    Where the residual of the best structure is noise, the interval spans the 95 %
    profile-likelihood intervals of all structures within 10 of the best information criterion.
    Where it is not, no likelihood knows the error: the dead time is the median of five views
    (first motion, first- and second-order lag on the first 15 % of the excursion, best model of
    up to three poles on 63 % and on all of it) and the interval spans them but for the lowest.

    A dead time has no Fisher information in a model with more zeros than the plant: a superfluous
    zero imitates it. That is why the relative degree is chosen, not left free.

    Examples
    --------
    >>> import numpy as np
    >>> import ctrl_realize as cr
    >>> t = 0.01 * np.arange(900)
    >>> u = np.where(t < 1.0, 0.0, 2.0)
    >>> y = np.where(t < 1.125, 0.0, 6 * -np.expm1(-(t - 1.125) / 0.4))
    >>> rng = np.random.default_rng(1)
    >>> sys = cr.fit_delay(cr.Record(t, u, y + 0.01 * rng.standard_normal(t.size)))
    >>> sys.fit.structure, round(sys.fit.dead_time, 3), round(sys.fit.gain, 2)
    ((1, 1), 0.125, 3.0)
    """
    one_of(loss, "loss", ("huber", "least_squares"))
    tried = _structures(structures)
    limit = None if max_delay is None else positive(max_delay, "max_delay", "number of samples")
    factor = known_factor(known)
    several = _records(records)
    if len(several) > 1:
        raise DataError("one record at a time")
    record = several[0]
    data = _step_data(record)
    fit = fit_output_error(
        data,
        structures=tried,
        latest=None if limit is None else limit * data.dt,
        known=factor,
        huber=loss == "huber",
    )
    result = _delay_fit(data, fit, several, record.time, limit)
    return _system(result, fit, data, record, known if include_known else None)


def _records(records: Record | Sequence[Record]) -> tuple[Record, ...]:
    several = (records,) if isinstance(records, Record) else tuple(records)
    if not several or not all(isinstance(record, Record) for record in several):
        raise DataError("records is empty or holds something else; needed are Record objects")
    for record in several:
        if not record.issiso:
            raise DataError(
                f"record {record.name!r} has {record.n_inputs} inputs and {record.n_outputs} "
                "outputs; choose one of each when it is made"
            )
    return several


def _structures(structures: Sequence[tuple[int, int]] | None) -> tuple[Structure, ...] | None:
    if structures is None:
        return None
    chosen = []
    for pair in structures:
        try:
            n, r = (int(number) for number in pair)
        except (TypeError, ValueError):
            raise OptionError(f"structure {pair!r}; needed is (order, relative_degree)") from None
        if not (1 <= r <= n <= MOST_ORDER):
            raise OrderError(
                f"structure ({n}, {r}); needed is 1 <= relative degree <= order <= {MOST_ORDER}"
            )
        chosen.append(Structure(n, r))
    if not chosen:
        raise OptionError("structures is empty; give None for all of them")
    return tuple(dict.fromkeys(chosen))


def _step_data(record: Record) -> StepData:
    edge = detect_step(record)
    signal, output = np.ravel(record.input), np.ravel(record.output)
    data = step_data(output, signal, record.dt, [(e.index, e.samples) for e in edge.edges])
    if data.motion is None:
        raise DataError(
            f"the output of record {record.name!r} does not leave its rest level by 5 sigma "
            f"({5 * data.sigma:.3g}) for long after the step at {edge.time:.6g} s"
        )
    return data


def _delay_fit(
    data: StepData,
    fit: OutputErrorFit,
    records: tuple[Record, ...],
    time: FloatArray,
    max_delay: float | None,
) -> DelayFit:
    assert data.motion is not None
    lag = fit.delay + _lags(fit, data)
    return DelayFit(
        dead_time=fit.delay,
        std=fit.std,
        interval=(fit.low, fit.high),
        onset=data.motion.onset * data.dt,
        total_delay=lag,
        order=fit.structure.order,
        relative_degree=fit.structure.relative_degree,
        poles=_locked(np.sort_complex(_integrators_at_zero(fit, data))),
        zeros=_locked(_zeros(fit)),
        gain=_gain(fit, data),
        at_noise_level=fit.adequate,
        misfit=fit.misfit,
        noise=data.sigma,
        residual=fit.residual,
        correlation=fit.correlation,
        views=dict(fit.views),
        structures=tuple(
            StructureRow(
                line.structure.order,
                line.structure.relative_degree,
                line.delay,
                line.total_delay,
                line.excess,
                None if np.isnan(line.low) else (line.low, line.high),
            )
            for line in fit.structures
        ),
        profile_delay=_locked(fit.profile[0]),
        profile_excess=_locked(fit.profile[1]),
        time=time,
        measured=_locked(data.output),
        fitted=_locked(fit.fitted),
        dt=data.dt,
        records=records,
        choices=_choices(data, fit),
        flags=fit_flags(data, fit, max_delay),
    )


def _locked(values: Any) -> Any:
    values = np.array(values)
    values.flags.writeable = False
    return values


def _integrators_at_zero(fit: OutputErrorFit, data: StepData) -> Any:
    length = (data.output.size - data.edge) * data.dt
    return np.where(np.abs(fit.poles) < INTEGRATOR / length, 0.0, fit.poles)


def _zeros(fit: OutputErrorFit) -> Any:
    if fit.numerator.size == 1:
        return np.empty(0, dtype=np.complex128)
    return np.sort_complex(np.roots(fit.numerator[::-1]))


def _lags(fit: OutputErrorFit, data: StepData) -> float:
    poles = _integrators_at_zero(fit, data)
    lag = float(np.sum(-1.0 / poles[poles != 0]).real)
    if fit.numerator.size > 1 and fit.numerator[0] != 0:
        lag -= float(fit.numerator[1] / fit.numerator[0])
    return lag


def _gain(fit: OutputErrorFit, data: StepData) -> float:
    """Gain at zero frequency; for an integrating plant that of s G(s)."""
    poles = _integrators_at_zero(fit, data)
    return float(fit.numerator[0] / np.prod(-poles[poles != 0]).real)


def _choices(data: StepData, fit: OutputErrorFit) -> tuple[str, ...]:
    s = fit.structure
    reasons = [
        f"order {s.order}, relative degree {s.relative_degree}: lowest information criterion of "
        f"{len(fit.structures)} structures"
        + ("" if fit.adequate or not fit.views else " with up to three poles")
    ]
    if fit.views:
        reasons.append("dead time: median of five views, as no model leaves only noise")
    elif fit.adequate:
        plausible = [line for line in fit.structures if line.low == line.low]
        reasons.append(
            "interval: profile likelihood of the "
            f"{len(plausible)} structure(s) that the data cannot rule out"
        )
    if fit.correlation > 1:
        reasons.append(f"the residual is correlated: {fit.correlation:.3g} samples count as one")
    return tuple(reasons)


def _system(
    result: DelayFit,
    fit: OutputErrorFit,
    data: StepData,
    record: Record,
    known: ct.LTI | None,
) -> DelayedStateSpace:
    core = _core(fit.numerator, _integrators_at_zero(fit, data))
    if known is not None:
        core = ct.ss(known) * core
    return delayed_ss(
        core,
        dead_time=result.dead_time,
        dt=data.dt,
        fit=result,
        name=record.name.replace(".", "_") or None,
        inputs=list(record.input_labels),
        outputs=list(record.output_labels),
    )


def _core(numerator: FloatArray, poles: Any) -> ct.StateSpace:
    """Companion form of b(s)/a(s) in a time unit that makes its entries comparable."""
    n = poles.size
    unit = float(np.exp(np.mean(np.log(np.abs(poles[poles != 0]))))) if np.any(poles) else 1.0
    a = np.real(np.poly(poles / unit))[1:]
    b = np.zeros(n)
    b[: numerator.size] = numerator * unit ** np.arange(numerator.size) / unit**n
    matrix = np.eye(n, k=1)
    matrix[-1] = -a[::-1]
    last = np.zeros((n, 1))
    last[-1] = 1.0
    return ct.StateSpace(unit * matrix, unit * last, b[None], np.zeros((1, 1)))
