"""Predicted and achieved standard errors of a planned test, side by side."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from .._checks import check_type
from .._wording import interval_in_time, plainly
from ..data import Record
from ..data.given import as_record
from ..identification import OutputErrorFit
from ..identification.bound import Bound, Experiment
from ..numerics.constants import Z_95
from ..results import Result
from .first import fitted, known_from_fit
from .result import WORDS, ExperimentPlan, amount


@dataclass(frozen=True, eq=False, repr=False)
class Achieved(Result):
    """What a planned test has told, made by `achieved`.

    Attributes
    ----------
    plan : ExperimentPlan
    fit : OutputErrorFit
        Of the record.
    std : float
        Standard error for the structure of the fit, from its model, the input as recorded, and the
        noise of the residual; of a fit as of a loop that of the fit itself, if it is larger.
    by_noise : float
        Factor of the prediction that is due to the noise: that of the plan's model and input in the
        noise of the record, over the prediction.

    Examples
    --------
    >>> import numpy as np
    >>> import ctrl_realize as cr
    >>> flow = cr.design.ProcessModel(gain=1.2, lag=3.0, dead_time=2.0)
    >>> plan = cr.experiment.plan(flow, time=60, amplitude=5, rate=5, noise=0.1)
    >>> moved = flow.system(plan.dt).simulate(plan.command)
    >>> noise = 0.1 * np.random.default_rng(1).standard_normal(moved.size)
    >>> found = cr.experiment.achieved(plan, plan.record(moved + noise), structures="P1D")
    >>> bool(found.std < plan.step.std / 2)
    True
    >>> found
    <Achieved: dead time, standard error 0.87 times the planned 8.21 ms>
    """

    plan: ExperimentPlan
    fit: OutputErrorFit
    std: float
    by_noise: float

    @property
    def predicted(self) -> float:
        """Standard error by the plan."""
        return self.plan.std

    @property
    def ratio(self) -> float:
        """Achieved over predicted standard error."""
        return self.std / self.predicted

    @property
    def std_of_all(self) -> float | None:
        """Half width of the 95 % interval over 1.96, structures not ruled out included.

        None for a phase or Ms, which have no interval.
        """
        ends = {"dead_time": self.fit.interval, "gain": self.fit.gain_interval}
        low, high = ends.get(self.plan.want, (0.0, 0.0))
        return (high - low) / (2 * Z_95) if self.plan.want in ends else None

    def __repr__(self) -> str:
        of = f"{self.ratio:.2f} times the planned {amount(self.plan.want, self.predicted)}"
        return f"<Achieved: {WORDS[self.plan.want]}, standard error {of}>"

    def _title(self) -> str:
        return f"Planned and achieved: {WORDS[self.plan.want]}"

    def _rows(self) -> list[tuple[str, str]]:
        want, every = self.plan.want, self.std_of_all
        rows = [
            ("predicted standard error", amount(want, self.predicted)),
            ("achieved, structure given", f"{amount(want, self.std)}, {self.ratio:.2f} times"),
            ("due to the noise", f"{self.by_noise:.2f} times"),
            ("due to model, input and missing samples", f"{self.ratio / self.by_noise:.2f} times"),
        ]
        if every is not None:
            rows.append(("structures not ruled out included", amount(want, every)))
        if want == "dead_time":
            rows.append((self.fit.interval_label, interval_in_time(*self.fit.interval)))
        model = f"order {self.fit.order}, residual {plainly(self.fit.residual, 3)}"
        return [*rows, ("model", model)]


def achieved(plan: ExperimentPlan, record: Record, **options: Any) -> Achieved:
    """Compare the standard error that a test has with the one that was planned.

    Parameters
    ----------
    plan : ExperimentPlan
    record : Record
        Of this test.
    **options
        Of `identify`.

    Returns
    -------
    Achieved

    Raises
    ------
    UnsuitableSystemError
        Options for another kind of fit, or a plant that was found to be unstable.
    CtrlRealizeError
        As for `identify`.

    Examples
    --------
    >>> import numpy as np
    >>> import ctrl_realize as cr
    >>> flow = cr.design.ProcessModel(gain=1.2, lag=3.0, dead_time=2.0)
    >>> plan = cr.experiment.plan(flow, time=60, amplitude=5, rate=5, noise=0.1)
    >>> moved = flow.system(plan.dt).simulate(plan.command)
    >>> noise = 0.1 * np.random.default_rng(1).standard_normal(moved.size)
    >>> result = cr.experiment.achieved(plan, plan.record(moved + noise), structures="P1D")
    >>> 0.8 < result.ratio < 1.2
    True
    """
    check_type(plan, ExperimentPlan, "plan", "an ExperimentPlan of experiment.plan")
    fit = fitted(as_record(record), options)
    known = known_from_fit(fit)
    own, before = Bound(known.model, fit.dt), Bound(plan.model, plan.dt)
    std = float(own.errors(known.tests, own.gradient([plan.want]))[0])
    if fit.estimate.averaged:  # as of a loop, which is not efficient
        errors = {"dead_time": fit.std_given_structure, "gain": fit.gain_std_given_structure}
        std = max(std, errors.get(plan.want) or 0.0)
    as_planned = [Experiment(plan.chosen.input, test.noise) for test in known.tests]
    noisy = before.errors(as_planned, before.gradient([plan.want]))[0]
    return Achieved(plan, fit, std, float(noisy) / plan.std)
