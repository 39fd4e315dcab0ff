"""Regressions for `impulse_from_io`: with a prior, without one, and by an ARX model."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import partial, reduce
from operator import add

import numpy as np
from numpy.typing import NDArray
from scipy.special import fdtrc, ndtri

from ..._flags import Flag, flagged
from ...data import Record
from ...errors import DataError
from ...numerics.arrays import FloatArray
from ...numerics.regression.arx import (
    ArxFit,
    arx_equations,
    arx_markov,
    arx_markov_std,
    arx_state_space,
    excited_directions,
    least_squares,
    solve_arx,
)
from ...numerics.regression.fir import cautious_std, fit_kernel
from ...numerics.regression.normal_equations import NormalEquations, normal_equations

OKID_ORDERS = (2, 3, 4, 6, 8, 12, 16, 24, 32, 48, 64, 96, 128)
"""Candidate ARX orders for BIC."""
SILENT = 0.01
"""Significance level of the tests for a response: rate of false alarms."""

MOST_GROWTH = 60.0
"""Decades by which a pulse response may grow before its values are meaningless."""

RIDGE = 1e-9
"""Added to the Gram matrix of a noise-free output, relative to its diagonal."""


@dataclass(frozen=True, eq=False)
class PulseRegression:
    """Pulse responses (p, m, N) with std, noise of each output (p,), and how they were estimated.

    `kernels` are the priors of the outputs, `arx` is the ARX model, if there are any.
    """

    markov: FloatArray
    std: FloatArray
    noise_std: FloatArray
    rows: int
    method: str
    flags: tuple[Flag, ...] = ()
    kernels: tuple[str, ...] = ()
    arx: ArxFit | None = None


def without_prior(group: tuple[Record, ...], count: int, start: str) -> PulseRegression:
    """Estimate `count` free Markov parameters by least squares."""
    m = group[0].ninputs
    equations = _fir_equations(group, count, start, m * count + 1)
    excited, wanted = excited_directions(equations.gram), m * count
    if excited < wanted:
        raise DataError(
            _unexcited(excited, wanted)
            + (", method='regularized'" if excited > 2 * m else "")
            + " or a richer input"
        )
    solution = least_squares(equations)
    noise = np.diag(solution.noise)
    left = equations.freedom - wanted
    ratio = (np.diag(equations.power) / noise - left) / wanted
    return PulseRegression(
        markov=solution.coefficients.T.reshape(-1, m, count),
        std=solution.std.T.reshape(-1, m, count),
        noise_std=np.sqrt(noise),
        rows=equations.rows,
        method="least squares",
        flags=_silence(fdtrc(wanted, left, np.maximum(ratio, 0.0)) > SILENT),
    )


def with_prior(
    group: tuple[Record, ...], count: int, start: str, kernels: Sequence[str]
) -> PulseRegression:
    """Estimate Markov parameters with a decaying prior, for each output separately.

    `kernels` contains one name for each output.
    """
    m, p = group[0].ninputs, group[0].noutputs
    equations = _fir_equations(group, count, start, 2 * m + 8)
    excited, wanted = excited_directions(equations.gram), m * count
    if excited < min(wanted, 2 * m + 1):
        raise DataError(_unexcited(excited, wanted) + " or a richer input")
    flags: tuple[Flag, ...] = ()
    if excited < wanted:
        flags = (flagged("partly_excited", excited=excited, lags=wanted),)
    single = [
        replace(equations, cross=equations.cross[:, [a]], power=equations.power[[a]][:, [a]])
        for a in range(p)
    ]
    fits = [fit_kernel(one, count, kernel) for one, kernel in zip(single, kernels, strict=True)]
    spread = [cautious_std(one, count, fit) for one, fit in zip(single, fits, strict=True)]
    # Twice the log Bayes factor against no response; 6 is "strong" according to Kass and Raftery.
    nothing = -equations.freedom / 2 * np.log(np.diag(equations.power))
    silent = 2 * (np.array([fit.evidence for fit in fits]) - nothing) < 6
    return PulseRegression(
        markov=np.stack([fit.markov for fit in fits]),
        std=np.stack(spread),
        noise_std=np.sqrt([fit.noise_variance for fit in fits]),
        rows=equations.rows,
        method=f"{', '.join(dict.fromkeys(f.kernel for f in fits))} kernel, "
        f"{', '.join(f'{f.effective:.0f}' for f in fits)} free parameters",
        flags=flags + _silence(silent),
        kernels=tuple(f.kernel for f in fits),
    )


def through_arx(group: tuple[Record, ...], count: int, start: str) -> PulseRegression:
    """Estimate an ARX model of high order and expand it to `count` Markov parameters (OKID)."""
    m, p = group[0].ninputs, group[0].noutputs
    total = sum(record.n_samples for record in group)
    # At least five equations for each parameter, as the asymptotics of BIC require.
    most = min(count - 1, total // (5 * (m + p)) - 1)
    orders = tuple(q for q in OKID_ORDERS if q <= most) or (1,)
    while True:
        top = orders[-1]
        of_signals = partial(arx_equations, na=top, nb=top + 1)
        equations = _equations(group, top, start, (top + 1) * (m + p) + 1, of_signals)
        excited = excited_directions(equations.gram[top * p :, top * p :])
        if excited == m * (top + 1):
            break
        if len(orders) == 1:
            raise DataError(
                f"the input does not excite {m * (top + 1) - excited} of the {m * (top + 1)} lags "
                f"of an ARX model of order {top}; use a richer input, or method='regularized'"
            )
        orders = orders[:-1]
    if not np.all(np.diag(equations.gram) > 0):
        raise DataError("an output is constant: no ARX model can be estimated")
    if excited_directions(equations.gram) < equations.gram.shape[0]:
        # Without noise, many models of high order reproduce the output; any of them will do.
        ridge = np.diag(RIDGE * np.diag(equations.gram))
        equations = replace(equations, gram=equations.gram + ridge)
    fits = {}
    for order in orders:
        columns = [*range(order * p), *range(top * p, top * p + (order + 1) * m)]
        try:
            fit = solve_arx(equations.take(columns), order, order + 1)
        except np.linalg.LinAlgError:
            raise DataError(
                f"the equations of an ARX model of order {order} are dominated by rounding: "
                "the output moves too little compared with its level; subtract the level, or "
                "record more digits"
            ) from None
        prediction_error = equations.rows * np.linalg.slogdet(fit.solution.noise)[1]
        fits[prediction_error + p * len(columns) * np.log(equations.rows)] = (order, fit)
    order, fit = fits[min(fits)]
    growth = count * np.log10(np.abs(np.linalg.eigvals(arx_state_space(fit)[0])).max() + 1e-9)
    if growth > MOST_GROWTH:
        raise DataError(
            f"the ARX model of order {order} is unstable: its pulse response grows by "
            f"1e{growth:.0f} within {count} samples; use method='regularized'"
        )
    markov, std = arx_markov(fit, count), arx_markov_std(fit, count)
    # Largest of all parameters, in standard deviations, that is exceeded by chance in 1 % of cases.
    level = -float(ndtri(SILENT / 2 / (m * count)))
    silent = np.all(np.abs(markov) <= level * std, axis=(1, 2))
    # What a low order leaves out is no noise: with a feedthrough, a third of a band held.
    for longer in [found for n, found in fits.values() if n >= 2 * order][:1]:
        std = np.hypot(std, markov - arx_markov(longer, count))
    return PulseRegression(
        markov=markov,
        std=std,
        noise_std=np.sqrt(np.diag(fit.solution.noise)),
        rows=equations.rows,
        method=f"OKID, ARX order {order}",
        flags=_silence(silent),
        arx=fit,
    )


def _equations(
    group: tuple[Record, ...],
    past: int,
    start: str,
    needed: int,
    of_signals: Callable[[FloatArray, FloatArray], NormalEquations],
) -> NormalEquations:
    """Sum the equations of all records that are longer than the past that they need."""
    signals = [_signals(record, past, start) for record in group]
    parts = [of_signals(u, y) for u, y in signals if u.shape[1] > past]
    if sum(part.freedom for part in parts) < needed:
        raise DataError(
            f"only {sum(part.rows for part in parts)} samples have a complete past of {past + 1} "
            f"samples, at least {needed + len(parts)} are needed; choose a shorter "
            "length, use more records, or start='rest' if the plant was at rest before"
        )
    equations = reduce(add, parts)
    if not np.all(np.diag(equations.power) > 0):
        raise DataError("an output is constant: there is no response to estimate")
    return equations


def _fir_equations(
    group: tuple[Record, ...], count: int, start: str, needed: int
) -> NormalEquations:
    return _equations(group, count - 1, start, needed, partial(normal_equations, lags=count))


def _unexcited(excited: int, wanted: int) -> str:
    return (
        f"the input does not excite {wanted - excited} of the {wanted} requested lags (a "
        "constant excites none, a sine two); choose a shorter length"
    )


def _signals(record: Record, past: int, start: str) -> tuple[FloatArray, FloatArray]:
    """Return input and output as (signals, N), with a steady-state past prepended if requested."""
    u, y = np.atleast_2d(record.input), np.atleast_2d(record.output)
    if start == "rest":
        u, y = (np.concatenate([np.repeat(z[:, :1], past, axis=1), z], axis=1) for z in (u, y))
    return u, y


def _silence(silent: NDArray[np.bool_]) -> tuple[Flag, ...]:
    """Flag the outputs that do not respond to the input."""
    return tuple(flagged("no_response", output=a) for a in np.flatnonzero(silent))
