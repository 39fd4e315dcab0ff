"""Fit of a process model of a prescribed form: a family of lags, by the engine.

Level, drift, gain and other terms that enter linearly are eliminated (variable projection [1]_).
Standard errors by the delta method [2]_.

References
----------
.. [1] G. Golub and V. Pereyra, Separable nonlinear least squares: the variable projection method
   and its applications, Inverse Problems 19 (2003) R1-R26, doi:10.1088/0266-5611/19/2/201.
.. [2] E. L. Lehmann and G. Casella, Theory of Point Estimation, 2nd ed., Springer 1998, section 1.8
   (the delta method), doi:10.1007/b98854.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from ..arrays import FloatArray
from ..constants import SMALLEST
from ..engine.eliminate import evaluate
from ..engine.problem import Bounds, Mapped, Problem
from ..engine.static_gain import INTEGRATOR, LocalErrors
from ..engine.structures import FASTEST, LEAST_DAMPING, Candidate, Scales
from .equal_lags import TANKS
from .physical import ProcessParameter
from .process_form import ProcessForm
from .shaped import LagFamily, lowest, paired

_INTEGRATOR = 1e-5
"""Pole of an integrator, over the length of the record. Its response bends by half of it: with 1e-4
records whose noise is that of a 16-bit converter ruled out the structure of their plant; with 1e-6
rounding reaches a part of 1e-10 of the cost."""
_AT_BOUND = 1e-4  # part of a parameter by which it may be away from a bound that it is at


@dataclass(frozen=True, eq=False)
class FormFamily(LagFamily):
    """Models of a form: dead time, logarithms of time constants and damping, lead over the rise."""

    form: ProcessForm
    scales: Scales
    at_bound: tuple[str, ...] = ()

    @property
    def varied(self) -> tuple[str, ...]:
        """Names of the parameters that are neither fixed nor at a bound; the gain comes last."""
        fixed = [*self.form.fixed, *self.at_bound, *([] if self.form.dead_time else ["dead_time"])]
        return tuple(name for name in (*self.names, "gain") if name not in fixed)

    @property
    def free(self) -> int:
        """Number of free parameters beside dead time and gain."""
        return len(self.varied) - 2

    def directions(self, problem: Problem, x: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Derivatives of model, and of `theta` and numerator, by the parameters that vary."""
        slopes, tangent = super().directions(problem, x)
        varied = [(*self.names, "gain").index(name) for name in self.varied]
        return slopes[:, varied], tangent[:, varied]

    def parameters(
        self, problem: Problem, x: FloatArray, variance: float
    ) -> tuple[ProcessParameter, ...]:
        """Values by name, with their standard errors: 0 where they are fixed, NaN at a bound."""
        x = self.ordered(x)
        values, sizes = self.values(x)
        values["gain"] = self.gain(problem, x)
        scale = dict(zip(self.names, sizes, strict=True)) | {"gain": 1.0}
        slopes, _ = self.directions(problem, x)
        gradient = np.diag([scale[name] for name in self.varied])
        errors = LocalErrors(slopes, slopes[:, :0]).std(gradient, variance)
        std = dict.fromkeys(self.form.fixed, 0.0) | dict.fromkeys(self.at_bound, float("nan"))
        std |= dict(zip(self.varied, map(float, errors), strict=True))
        return tuple(ProcessParameter(n, values[n], std[n]) for n in self.form.names if n in std)

    def ordered(self, x: FloatArray) -> FloatArray:
        """Parameters (k,) of the same model, the slowest lag first."""
        found, alike = x.copy(), [self.names.index(name) for name in self.form.free_lags]
        found[alike] = np.sort(x[alike])[::-1]
        return found

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the parameters x; the gain is not among them."""
        return self.form.names[1:]

    def mapped(self, parameters: FloatArray) -> Mapped:
        """Models at parameters (B, k), and their derivatives."""
        form, x, (count, k) = self.form, parameters, parameters.shape
        every = np.tile(np.eye(k), (count, 1, 1))
        lags = np.ones(form.lags, dtype=np.int64) if form.equal else np.arange(1, 1 + form.lags)
        rates, slopes = -x[:, lags], -every[:, lags]
        if form.equal:
            rates = rates + TANKS.rates(form.lags, TANKS.low)[0]
        growth, dgrowth = rates.sum(axis=1, keepdims=True), slopes.sum(axis=1, keepdims=True)
        if form.integrator:
            slowest = np.log(_INTEGRATOR / self.scales.length)
            rates = np.append(rates, np.full((count, 1), slowest), axis=1)
            slopes = np.append(slopes, np.zeros((count, 1, k)), axis=1)
        theta, dtheta = paired(rates, slopes)
        if form.pair:
            first, at = theta.shape[1] % 2, [form.lags + 1, form.lags + 2]
            sign = np.array([-1.0, 1.0])
            theta = np.insert(theta, [first, first], sign * x[:, at], axis=1)
            dtheta = np.insert(dtheta, [first, first], sign[:, None] * every[:, at], axis=1)
            growth, dgrowth = growth - 2 * x[:, at[:1]], dgrowth - 2 * every[:, at[:1]]
        # The numerator of a monic denominator.
        level = np.exp(growth)
        numerator, dnumerator = level, level[:, :, None] * dgrowth
        if form.lead:
            lead, by_lead = x[:, -1:] * self.scales.rise, every[:, -1:] * self.scales.rise
            second = lead[:, :, None] * dnumerator + level[:, :, None] * by_lead
            numerator = np.append(numerator, level * lead, axis=1)
            dnumerator = np.append(dnumerator, second, axis=1)
        theta, dtheta = np.append(x[:, :1], theta, axis=1), np.append(every[:, :1], dtheta, axis=1)
        return Mapped(theta, dtheta, numerator, dnumerator, self.gains)

    def coordinates(self, values: Mapping[str, float]) -> FloatArray:
        """Parameters x (k,) of values by name."""
        return np.array([_coordinate(name, values[name], self.scales) for name in self.names])

    def values(self, x: FloatArray) -> tuple[dict[str, float], FloatArray]:
        """Values by name, and their derivatives with respect to x (k,)."""
        unit = np.array([_unit(name, self.scales) for name in self.names])
        # The exponential of a dead time of hours in s overflows.
        value = np.exp(x, out=x * unit, where=unit == 0)
        slope = np.where(unit == 0, value, unit)
        return dict(zip(self.names, map(float, value), strict=True)), slope


def form_family(form: ProcessForm, scales: Scales) -> FormFamily:
    """Family of a form, with the bounds that were asked for, or wide ones."""
    wide = _limits(form, scales)
    low, high = (
        np.array([_coordinate(name, wide[name][end], scales) for name in form.names[1:]])
        for end in (0, 1)
    )
    structure = form.structure
    return FormFamily(
        structure.order, structure.relative_degree, Bounds(low, high), wide["gain"], form, scales
    )


def _limits(form: ProcessForm, scales: Scales) -> dict[str, tuple[float, float]]:
    # A lag at its limit counts as an integrator.
    lag = scales.dt / FASTEST, 2 * scales.length / INTEGRATOR
    lead = 1e3 * scales.length
    wide = {
        "gain": (-np.inf, np.inf),
        "dead_time": (scales.earliest, scales.latest) if form.dead_time else (0.0, 0.0),
        "pair_damping_1": (LEAST_DAMPING, 1.0),
        "lead_1": (-lead, lead),
    }
    limits = {}
    for name in form.names:
        low, high = wide.get(name, lag)
        if name in form.fixed:
            low = high = form.fixed[name]
        elif name in form.bounds:
            first, last = form.bounds[name]
            # Of a time that may be zero or endless as of one that has no bounds.
            logarithmic = name not in ("gain", "dead_time", "lead_1")
            low = low if logarithmic and first <= 0 else first
            high = high if not np.isfinite(last) and name != "gain" else last
        limits[name] = low, high
    return limits


def _unit(name: str, scales: Scales) -> float:
    """Size of the coordinate of a parameter in s; 0 for a logarithm."""
    return {"dead_time": 1.0, "lead_1": scales.rise}.get(name, 0.0)


def _coordinate(name: str, value: float, scales: Scales) -> float:
    unit = _unit(name, scales)
    return value / unit if unit else float(np.log(value))


def fit_form(
    problem: Problem, form: ProcessForm, scales: Scales, like: Sequence[Candidate]
) -> Candidate:
    """Fit a process model of a prescribed form, a `FormFamily`.

    Parameters
    ----------
    problem : Problem
    form : ProcessForm
    scales : Scales
    like : sequence of Candidate
        Models without the prescriptions, from which the search starts.
    """
    family = form_family(form, scales)
    suggested = [_start(problem, form, c, scales) for c in like]
    starts = [family.coordinates(one) for one in suggested]
    starts += [np.append(0.5 * x[0], x[1:]) for x in starts]
    if form.start:
        starts += [family.coordinates({**one, **form.start}) for one in suggested]
    best = lowest(problem, family, np.array(starts), scales.dt)
    x = family.ordered(best.parameters)
    values = family.values(x)[0] | {"gain": family.gain(problem, x)}
    limits = _limits(form, scales).items()
    ends = tuple(n for n, (low, high) in limits if low < high and _at_end(values[n], low, high))
    return Candidate(replace(family, at_bound=ends), x, best.cost)


def _start(
    problem: Problem, form: ProcessForm, like: Candidate, scales: Scales
) -> dict[str, float]:
    """Parameters of the form that are closest to a model without prescriptions."""
    poles = like.poles[np.abs(like.poles) * scales.length >= INTEGRATOR]
    lags = sorted((float(1.0 / abs(p)) for p in poles), reverse=True) or [scales.rise]
    if form.integrator and poles.size == like.poles.size:
        # a slow lag is taken for the integrator: K / (T s + 1) begins like (K / T) / s
        lags = lags[1:] or [0.3 * scales.rise]
    elif not form.integrator and poles.size < like.poles.size:
        lags = [3 * scales.length, *lags]
    needed = form.lags + 2 * form.pair
    lags = [*lags, *(0.2 * lags[-1] * 0.7**i for i in range(needed))][:needed]
    found = {"dead_time": like.dead_time, "lead_1": 0.1 * scales.rise}
    if form.lead and like.structure.zeros:
        numerator = evaluate(problem, like.structure, like.parameters[None]).numerator[0]
        found["lead_1"] = float(numerator[1] / (numerator[0] or SMALLEST))
    if form.pair:
        pair, lags = lags[:2], lags[2:]
        swinging = like.poles[like.poles.imag > 0]
        damping = float(-swinging[0].real / abs(swinging[0])) if swinging.size else 0.9
        found |= {"pair_time_1": float(np.sqrt(pair[0] * pair[1])), "pair_damping_1": damping}
    return found | {f"lag_{i}": lag for i, lag in enumerate(lags, 1)}


def _at_end(value: float, low: float, high: float) -> bool:
    size = _AT_BOUND * max(abs(value), abs(low) if np.isfinite(low) else 0.0, SMALLEST)
    return value - low <= size or high - value <= size
