"""Result of planning a test: the candidates, the best input, and the error against test time."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING

from .._checks import one_of
from .._wording import in_time, plainly
from ..identification.bound import Experiment, Wanted
from ..identification.noise import NoiseModel
from ..numerics.arrays import FloatArray
from ..numerics.engine.plausible_models import PlausibleModel
from .command import PlannedInput, duration_in_words

if TYPE_CHECKING:
    import pandas as pd

WORDS: dict[Wanted, str] = {
    "dead_time": "dead time", "gain": "gain", "phase": "phase at the crossover", "Ms": "Ms",
}  # fmt: skip


def amount(wanted: Wanted, value: float) -> str:
    """Write a standard error with its unit."""
    if wanted == "dead_time":
        return in_time(value)
    return plainly(value, 3) + (" deg" if wanted == "phase" else "")


@dataclass(frozen=True, eq=False)
class PlannedTest:
    """One candidate of a plan.

    Attributes
    ----------
    kind : str
    detail : str
        The number that was chosen for it.
    input : ndarray, shape (N,)
        Deviation from the level at rest.
    std : float
        Predicted standard error of what is wanted.
    others : (float, float)
        Smallest and largest one on plausible models.
    together : float
        Standard error after the records that there are and this test; `std` without records.
    excursion : float
        Largest deviation of the output on any of the models.
    score : float
        Geometric mean of the errors on all models, by which candidates are ranked.

    Examples
    --------
    >>> import ctrl_realize as cr
    >>> flow = cr.design.ProcessModel(gain=1.2, lag=3.0, dead_time=2.0)
    >>> plan = cr.experiment.plan(flow, time=60, amplitude=5, rate=5, noise=0.1, want="gain")
    >>> plan.chosen.kind, plan.chosen.detail, round(plan.chosen.excursion, 1)
    ('steps', 'held 27 s', 6.0)
    """

    kind: str
    detail: str
    input: FloatArray
    std: float
    others: tuple[float, float]
    together: float
    excursion: float
    score: float


@dataclass(frozen=True, eq=False)
class ErrorCurve:
    """Standard errors against the length of a test.

    Attributes
    ----------
    time : ndarray, shape (K,)
        Length in s.
    best, step : ndarray, shape (K,)
        Of the best kind of a plan, and of one step (up and down, if the plant integrates).
    first : (float, float) or None
        Length and error of the records that there are.
    """

    time: FloatArray
    best: FloatArray
    step: FloatArray
    first: tuple[float, float] | None


@dataclass(frozen=True, eq=False, repr=False)
class ExperimentPlan(PlannedInput):
    """Input of a test that tells most of what is wanted, made by `plan`.

    Attributes
    ----------
    time : ndarray, shape (N,)
        In s, uniform.
    command : ndarray, shape (N,)
        Input of the best candidate with its level, held over each sample.
    want : {"dead_time", "gain", "phase", "Ms"}
    candidates : tuple of PlannedTest
        Best first: of those within 5 % of the least error the one that moves the output least,
        then the others by their error.
    curve : ErrorCurve
    level : float
        Input at rest.
    model : PlausibleModel
        By which the errors are predicted; a pole of an integrator is 0.
    noise : NoiseModel
        That the record will have.
    tests : tuple of Experiment
        Inputs and noise of the records that there are.
    kind : str
        Of the command: that of the best candidate, or the one chosen by `using`.
    choices : tuple of str
    time_unit : str
        Of plots: min, h or day of the first record, otherwise s.

    Examples
    --------
    >>> import ctrl_realize as cr
    >>> heater = cr.design.ProcessModel(gain=0.9, lag=140.0, second_lag=12.0, dead_time=20.0)
    >>> plan = cr.experiment.plan(heater, time=900.0, amplitude=20.0, rate=1.0, noise=0.05)
    >>> plan
    <ExperimentPlan: 15.0 min, 900 samples of 1 s>
    >>> plan.using("one step").command[[0, -1]]
    array([ 0., 20.])
    """

    want: Wanted
    candidates: tuple[PlannedTest, ...]
    curve: ErrorCurve
    level: float
    model: PlausibleModel
    noise: NoiseModel
    tests: tuple[Experiment, ...]
    kind: str
    choices: tuple[str, ...] = field(default=())
    time_unit: str = "s"

    @property
    def _afterwards(self) -> float:
        return self.level

    @property
    def chosen(self) -> PlannedTest:
        """The candidate that is the command."""
        return next(one for one in self.candidates if one.kind == self.kind)

    @property
    def std(self) -> float:
        """Predicted standard error of what is wanted, from a record of this test alone."""
        return self.chosen.std

    @property
    def step(self) -> PlannedTest:
        """The simplest candidate: one step, or up and down if the plant integrates."""
        return next(one for one in self.candidates if one.kind in ("one step", "up and down"))

    def using(self, kind: str) -> ExperimentPlan:
        """Return the plan with another candidate for its command.

        Raises
        ------
        OptionError
            There is none of this kind.
        """
        found = one_of(kind, "kind", tuple(one.kind for one in self.candidates))
        new = replace(self, kind=found)
        return replace(new, command=self.level + new.chosen.input)

    @property
    def table(self) -> pd.DataFrame:
        """The candidates, best first.

        Standard error, that on the plausible models, that together with the first records, times by
        which it is smaller than that of one step, and the largest deviation of the output.
        """
        import pandas as pd

        columns = ["test", "choice", "std", "low", "high", "together", "better than one step",
                   "output moves"]  # fmt: skip
        rows = [
            (one.kind, one.detail, one.std, *one.others, one.together, self.step.std / one.std,
             one.excursion)
            for one in self.candidates
        ]  # fmt: skip
        return pd.DataFrame(rows, columns=columns).set_index("test")

    def _title(self) -> str:
        return f"Plan of a test for the {WORDS[self.want]}: {self.kind}"

    def _rows(self) -> list[tuple[str, str]]:
        one, first = self.chosen, self.curve.first
        low, high = (amount(self.want, end) for end in one.others)
        rows = [
            ("test", f"{one.kind}, {one.detail}"),
            ("duration", duration_in_words(self.duration)),
            ("standard error", f"{amount(self.want, one.std)} ({low} to {high} on other models)"),
            ("better than one step", f"{self.step.std / one.std:.2f} times"),
            ("output moves by", plainly(one.excursion, 3)),
        ]
        if first is not None:
            words = f"{amount(self.want, first[1])} after {duration_in_words(first[0])}"
            rows += [("today", words), ("both together", amount(self.want, one.together))]
        return rows + [
            (f"candidate: {each.kind}", f"{amount(self.want, each.std)}, {each.detail}")
            for each in self.candidates
        ]
