"""Fit of a process model of a prescribed form.

Bounded nonlinear least squares [1]_; level, drift and other terms that enter linearly are
eliminated (variable projection [2]_).

References
----------
.. [1] M. A. Branch, T. F. Coleman and Y. Li, A subspace, interior, and conjugate gradient method
   for large-scale bound-constrained minimization problems, SIAM J. Sci. Comput. 21 (1999) 1-23,
   doi:10.1137/S1064827595289108.
.. [2] G. Golub and V. Pereyra, Separable nonlinear least squares: the variable projection method
   and its applications, Inverse Problems 19 (2003) R1-R26, doi:10.1088/0266-5611/19/2/201.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from scipy.optimize import least_squares

from ..arrays import ComplexArray, FloatArray
from ..constants import CHI2_95, SMALLEST, Z_95
from ..engine.poles import parameters_from_poles
from ..engine.profile import profile_curve, within_a_sample
from ..engine.static_gain import INTEGRATOR
from ..engine.structures import FASTEST, SLOWEST, Candidate, Scales
from ..engine.varpro import Problem, respond
from .physical import ProcessParameter
from .process_form import ProcessForm

_LEAST_DAMPING = 0.005  # as in `parameter_bounds`
_MOST_TURNS = 60  # of a search, each about the evaluations of a gradient
_STEP = 1e-6  # relative, for derivatives at the optimum
_AT_BOUND = 1e-4  # part of a parameter by which it may be away from a bound that it is at
_NEAR = np.array([-3, -1.7, -1.2, -0.9, 0.9, 1.2, 1.7, 3])  # in half intervals, for a profile
_FAR = 9  # points of a profile all over the range


@dataclass(frozen=True, eq=False)
class FormFit:
    """Best model of a form.

    `candidate` has its dead time and poles, `numerator` its numerator, `parameters` values and
    standard errors: 0 where they are fixed, NaN at a bound (``at_bound``). `profile` are dead times
    and the excess of the misfit there. `free` is the number of free parameters.
    """

    form: ProcessForm
    candidate: Candidate
    numerator: FloatArray
    parameters: tuple[ProcessParameter, ...]
    profile: tuple[FloatArray, FloatArray]
    at_bound: tuple[str, ...]
    total_std: float
    free: int


@dataclass(frozen=True, eq=False)
class FormSearch:
    """Least squares over some of the parameters; lags and times in logarithms."""

    problem: Problem
    form: ProcessForm
    scales: Scales
    gain_scale: float

    @cached_property
    def limits(self) -> dict[str, tuple[float, float]]:
        """Bounds of the parameters, those that were asked for or wide ones."""
        scales, form = self.scales, self.form
        lag = 1.0 / FASTEST * scales.dt, scales.length / INTEGRATOR
        wide = {
            "gain": (-np.inf, np.inf),
            "dead_time": (scales.earliest, scales.latest) if form.dead_time else (0.0, 0.0),
            "pair_time_1": lag,
            "pair_damping_1": (_LEAST_DAMPING, 1.0),
            "lead_1": (-1e3 * scales.length, 1e3 * scales.length),
        }
        wide |= {name: lag for name in form.names if name.startswith("lag_")}
        wide |= form.bounds
        wide |= {name: (value, value) for name, value in form.fixed.items()}
        return {name: wide[name] for name in form.names}

    def model(self, values: Mapping[str, float]) -> tuple[Candidate, FloatArray]:
        """Dead time and poles, and numerator."""
        form = self.form
        lags = [values[name] for name in form.names if name.startswith("lag_")]
        roots: list[complex] = [-1.0 / lag for lag in lags]
        if form.pair:
            size, damping = 1.0 / values["pair_time_1"], min(values["pair_damping_1"], 1.0)
            swing = size * np.sqrt(1.0 - damping**2)
            roots += [complex(-size * damping, swing), complex(-size * damping, -swing)]
        monic = values["gain"] * float(np.prod(-np.array(roots, dtype=np.complex128)).real)
        if form.integrator:
            roots.append(-SLOWEST / self.scales.length)
        numerator = np.array([monic, monic * values["lead_1"]] if form.lead else [monic])
        poles: ComplexArray = np.array(roots, dtype=np.complex128)
        theta = np.concatenate([[values["dead_time"]], parameters_from_poles(poles)])
        return Candidate(form.structure, theta, 0.0), numerator

    def residual(self, values: Mapping[str, float]) -> FloatArray:
        """Weighted residual (m,) without the terms that enter linearly."""
        return self._residual(values)[0]

    def _residual(self, values: Mapping[str, float]) -> tuple[FloatArray, float]:
        """Residual (m,), and the gain, which is the best one if it is not given."""
        candidate, numerator = self.model({"gain": 1.0, **values})
        problem = self.problem
        model = respond(problem.drive, problem.known, numerator, candidate.parameters)
        left = problem.weighted(np.stack([problem.data, model], axis=1))
        if problem.segments is not None:
            terms = problem.local_terms(candidate.poles[None])
            fixed = problem.weighted(problem.regressors)
            both = terms.without(np.concatenate([left, fixed], axis=1)[None])[0]
            left, basis = both[:, :2], np.linalg.qr(both[:, 2:])[0]
        else:
            basis = self._basis
        data, unit = (left - basis @ (basis.T @ left)).T
        if "gain" in values:
            return np.asarray(data - unit), values["gain"]
        gain = float(data @ unit / max(unit @ unit, SMALLEST))
        return np.asarray(data - gain * unit), gain

    @cached_property
    def _basis(self) -> FloatArray:
        return np.asarray(np.linalg.qr(self.problem.weighted(self.problem.regressors))[0])

    def coordinate(self, name: str, value: float) -> float:
        """Coordinate of the search for a parameter: logarithms of times, others scaled."""
        if name == "gain":
            return value / self.gain_scale
        if name in ("dead_time", "lead_1"):
            return value / self.scales.rise
        return float(np.log(value)) if value > 0 else -np.inf

    def value(self, name: str, coordinate: float) -> float:
        """Inverse of `coordinate`."""
        if name == "gain":
            return float(coordinate * self.gain_scale)
        if name in ("dead_time", "lead_1"):
            return float(coordinate * self.scales.rise)
        return float(np.exp(coordinate))

    def solve(
        self,
        start: Mapping[str, float],
        fixed: Mapping[str, float] | None = None,
        exact: float = 1e-12,
    ) -> tuple[dict[str, float], float]:
        """Best values from a start, and their sum of squares, `exact` to a part of it.

        `fixed` ones stay.
        """
        held = {name: low for name, (low, high) in self.limits.items() if low == high}
        held |= fixed or {}
        names = [name for name in self.form.names if name not in held]
        if not np.isfinite(self.limits["gain"]).any():
            names.remove("gain")  # enters linearly
        if not names:
            return self._with_gain(held)
        low, high = (
            np.array([self.coordinate(name, self.limits[name][end]) for name in names])
            for end in (0, 1)
        )
        first = np.array([self.coordinate(name, start[name]) for name in names])
        margin = 1e-9 * np.maximum(np.abs(first), 1.0)
        first = np.clip(first, low + margin, np.maximum(high - margin, low + margin))

        def left(x: FloatArray) -> FloatArray:
            pairs = zip(names, x, strict=True)
            return self.residual(held | {name: self.value(name, at) for name, at in pairs})

        found = least_squares(
            left, first, bounds=(low, high), x_scale="jac", max_nfev=_MOST_TURNS,
            xtol=1e-10, ftol=exact, gtol=1e-12,
        )  # fmt: skip
        return self._with_gain(
            held | {name: self.value(name, at) for name, at in zip(names, found.x, strict=True)}
        )

    def _with_gain(self, values: dict[str, float]) -> tuple[dict[str, float], float]:
        """Add the gain, and the sum of squares."""
        left, gain = self._residual(values)
        return values | {"gain": gain}, float(left @ left)


def fit_form(
    problem: Problem,
    form: ProcessForm,
    scales: Scales,
    like: Sequence[Candidate],
    numerators: Sequence[FloatArray],
    variance: float,
) -> FormFit:
    """Fit a process model of a prescribed form.

    Parameters
    ----------
    problem : Problem
    form : ProcessForm
    scales : Scales
    like : sequence of Candidate
        Models without the prescriptions, from which the search starts.
    numerators : sequence of ndarray
        Of these.
    variance : float
        Of the noise, per sample.
    """
    gains = []
    for one, numerator in zip(like, numerators, strict=True):
        moving = one.poles[np.abs(one.poles) * scales.length >= INTEGRATOR]
        gains.append(float(numerator[0] / np.prod(-moving).real))
    search = FormSearch(problem, form, scales, max(abs(gains[0]), SMALLEST))
    starts = [_start(form, one, gain, scales) for one, gain in zip(like, gains, strict=True)]
    starts += [{**one, "dead_time": 0.5 * one["dead_time"]} for one in starts]
    tried = [search.solve({**one, **form.start}) for one in starts]
    values, cost = min(tried, key=lambda pair: pair[1])
    values, cost = search.solve(values)
    alike = form.free_lags
    values |= dict(zip(alike, sorted((values[name] for name in alike), reverse=True), strict=True))
    names = [
        name
        for name, (low, high) in search.limits.items()
        if low < high and not _at_end(values[name], low, high)
    ]
    at_bound = tuple(
        name for name, (low, high) in search.limits.items() if low < high and name not in names
    )
    covariance = _covariance(search, values, names, variance)
    std = {name: float(np.sqrt(covariance[i, i])) for i, name in enumerate(names)}
    std |= dict.fromkeys(form.fixed, 0.0)
    if not form.dead_time:
        std["dead_time"] = 0.0
    shown = [name for name in form.names if form.dead_time or name != "dead_time"]
    candidate, numerator = search.model(values)
    total = np.array([_in_total(name, values) for name in names])
    return FormFit(
        form=form,
        candidate=Candidate(form.structure, candidate.parameters, cost),
        numerator=numerator,
        parameters=tuple(
            ProcessParameter(name, values[name], std.get(name, float("nan"))) for name in shown
        ),
        profile=_profile(search, values, cost, std.get("dead_time", 0.0), variance),
        at_bound=at_bound,
        total_std=float(np.sqrt(total @ covariance @ total)),
        free=len(names),
    )


def _start(form: ProcessForm, like: Candidate, gain: float, scales: Scales) -> dict[str, float]:
    """Parameters of the form that are closest to a model without prescriptions."""
    poles = like.poles[np.abs(like.poles) * scales.length >= INTEGRATOR]
    lags = sorted((float(1.0 / abs(p)) for p in poles), reverse=True)
    lags = lags or [scales.rise]
    if form.integrator and poles.size == like.poles.size:
        # a slow lag is taken for the integrator: K / (T s + 1) begins like (K / T) / s
        gain, lags = gain / lags[0], lags[1:] or [0.3 * scales.rise]
    elif not form.integrator and poles.size < like.poles.size:
        gain, lags = gain * 3 * scales.length, [3 * scales.length, *lags]
    needed = form.lags + 2 * form.pair
    lags = [*lags, *(0.2 * lags[-1] * 0.7**i for i in range(needed))][:needed]
    found = {"gain": gain, "dead_time": like.dead_time, "lead_1": 0.1 * scales.rise}
    if form.pair:
        pair, lags = lags[:2], lags[2:]
        swinging = like.poles[like.poles.imag > 0]
        damping = float(-swinging[0].real / abs(swinging[0])) if swinging.size else 0.9
        found |= {"pair_time_1": float(np.sqrt(pair[0] * pair[1])), "pair_damping_1": damping}
    return found | {f"lag_{i}": lag for i, lag in enumerate(lags, 1)}


def _at_end(value: float, low: float, high: float) -> bool:
    size = _AT_BOUND * max(abs(value), abs(low) if np.isfinite(low) else 0.0, SMALLEST)
    return value - low <= size or high - value <= size


def _covariance(
    search: FormSearch, values: Mapping[str, float], names: Sequence[str], variance: float
) -> FloatArray:
    if not names:
        return np.zeros((0, 0))
    columns = []
    for name in names:
        step = _STEP * max(
            abs(values[name]),
            1e-3 * search.scales.rise if name in ("dead_time", "lead_1") else SMALLEST,
        )
        ahead, behind = (
            search.residual({**values, name: values[name] + way * step}) for way in (1, -1)
        )
        columns.append((behind - ahead) / (2 * step))
    jacobian = np.stack(columns, axis=1)
    size = np.linalg.norm(jacobian, axis=0)
    size[size == 0] = SMALLEST
    scaled = jacobian / size
    return np.asarray(variance * np.linalg.pinv(scaled.T @ scaled) / np.outer(size, size))


def _in_total(name: str, values: Mapping[str, float]) -> float:
    """Derivative of the total delay with respect to a parameter."""
    if name == "pair_time_1":
        return 2 * values["pair_damping_1"]
    if name == "pair_damping_1":
        return 2 * values["pair_time_1"]
    return {"gain": 0.0, "lead_1": -1.0}.get(name, 1.0)


def _profile(
    search: FormSearch, values: Mapping[str, float], cost: float, std: float, variance: float
) -> tuple[FloatArray, FloatArray]:
    """Misfit of the best model for each of a range of dead times, as in `dead_time_profile`."""
    low, high = search.limits["dead_time"]
    at = values["dead_time"]
    best = replace(search.model(values)[0], cost=cost)
    points = {at: best}
    if low < high:
        grid = np.concatenate([np.linspace(low, high, _FAR), within_a_sample(best, search.scales)])
        if np.isfinite(std) and std > 0:
            grid = np.concatenate([grid, at + Z_95 * std * _NEAR])
        ahead = sorted({float(x) for x in np.clip(grid, low, high) if x > at})
        behind = sorted({float(x) for x in np.clip(grid, low, high) if x < at}, reverse=True)
        for path in (ahead, behind):
            near = dict(values)
            for dead_time in path:
                near, there = search.solve(near, {"dead_time": dead_time})
                points[dead_time] = replace(search.model(near)[0], cost=there)
                if there > cost + 30 * CHI2_95 * variance:
                    break
    return profile_curve(points, best, max(variance, SMALLEST), search.scales)
