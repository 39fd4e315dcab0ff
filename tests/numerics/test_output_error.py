"""The rule of the output-error estimate, step by step, with fits that are by hand."""

from __future__ import annotations

from dataclasses import dataclass
from types import SimpleNamespace

import numpy as np
import pytest

from ctrl_realize.numerics import output_error as module
from ctrl_realize.numerics.first_motion import FirstMotion
from ctrl_realize.numerics.output_error import (
    _explained,
    _fit_until,
    _is_noise,
    _robust_fit,
    _views,
    fit_output_error,
)
from ctrl_realize.numerics.separable_fit import KnownFactor, Structure
from ctrl_realize.numerics.structure_search import (
    ALL_STRUCTURES,
    SIMPLE_STRUCTURES,
    Candidate,
    needless_charge,
)

ONE, TWO, THREE, ZERO = Structure(1, 1), Structure(2, 2), Structure(3, 3), Structure(2, 1)
KNOWN = KnownFactor(np.array([-3.0 + 0j]), np.array([3.0]))


@dataclass(frozen=True)
class Found:
    """What comes out, and of what."""

    by: str
    given: dict
    relaxing: bool = False


def record(*, relaxing=False, ways=()):
    motion = FirstMotion(12, 9.0, 0.0, 1.0, 1.0)
    made = SimpleNamespace(
        output=np.zeros(70), relaxing=relaxing, motion=motion, dt=0.5, name="record"
    )
    made.explanations = lambda: list(ways) or [made]
    return made


@pytest.fixture
def steps(monkeypatch):
    """Every step of the rule is recorded; the residual is noise, unless `noise` says no."""
    seen = SimpleNamespace(noise=True, fits=[], whitened=[], asked=[], views=[], explained=[])
    criterion = {s: 10.0 * s.order + s.zeros for s in ALL_STRUCTURES}
    candidates = {s: Candidate(s, np.array([1.0 * s.order]), 0.0) for s in criterion}
    seen.criterion = criterion
    seen.whole = SimpleNamespace(criterion=criterion, candidates=candidates, name="whole")
    seen.white = SimpleNamespace(criterion=criterion, candidates=candidates, name="white")

    def fit_until(data, stop, structures, latest, known, huber):
        seen.fits.append((data, stop, tuple(structures), latest, known, huber))
        return seen.whole

    def is_noise(data, whole):
        seen.asked.append((data, whole))
        return seen.noise

    def white(whole, data):
        seen.whitened.append((whole, data))
        return seen.white

    def explained(ways):
        seen.explained.append(ways)
        return ways[-1][0]

    def views(data, chosen, *rest):
        seen.views.append((data, chosen, *rest))
        return "views"

    monkeypatch.setattr(module, "_fit_until", fit_until)
    monkeypatch.setattr(module, "_is_noise", is_noise)
    monkeypatch.setattr(module, "in_coloured_noise", white)
    monkeypatch.setattr(module, "_explained", explained)
    monkeypatch.setattr(module, "chains_of", lambda whole: ["chains of", whole.name])
    monkeypatch.setattr(module, "flows_of", lambda whole, chains: ["flows of", whole.name, chains])
    monkeypatch.setattr(module, "_views", views)
    monkeypatch.setattr(
        module, "likelihood_fit", lambda whole, **given: Found("likelihood", given | {"of": whole})
    )
    monkeypatch.setattr(
        module,
        "_robust_fit",
        lambda whole, chosen, views: Found("views", {"of": whole, "at": chosen, "views": views}),
    )
    return seen


def test_all_structures_are_fitted_to_the_whole_record(steps):
    data = record()
    fit_output_error(data)
    (got, stop, structures, latest, known, huber), *others = steps.fits
    assert others == []
    assert (got, stop, structures) == (data, 70, tuple(ALL_STRUCTURES))
    assert (latest, huber) == (None, True)
    assert known.poles.size == 0
    assert known.numerator.tolist() == [1.0]
    fit_output_error(data, latest=3.0, known=KNOWN, huber=False)
    assert steps.fits[-1][3:] == (3.0, KNOWN, False)


def test_where_the_residual_is_noise_the_likelihood_tells(steps):
    data = record()
    found = fit_output_error(data)
    assert found.by == "likelihood"
    chains = ["chains of", "white"]
    assert found.given == {
        "of": steps.white,
        "adequate": True,
        "chains": chains,
        "flows": ["flows of", "white", chains],
        "onset": 4.5,
    }
    assert steps.whitened == [(steps.whole, data)]
    assert steps.asked == [(data, steps.whole)]
    # unless it is not to be made white
    assert fit_output_error(data, whiten=False).given["of"] is steps.whole


def test_where_it_is_not_five_views_are_taken_of_the_best_simple_structure(steps):
    steps.noise = False
    for s in SIMPLE_STRUCTURES:
        steps.criterion[s] = 50.0
    steps.criterion[TWO] = 40.0
    data = record()
    found = fit_output_error(data, latest=3.0, known=KNOWN, huber=False)
    assert found.by == "views"
    assert found.given == {"of": steps.whole, "at": steps.whole.candidates[TWO], "views": "views"}
    assert steps.views == [(data, steps.whole.candidates[TWO], 3.0, KNOWN, False)]
    assert steps.whitened == []


@pytest.mark.parametrize("noise", [True, False])
def test_structures_that_are_given_are_believed(steps, noise):
    steps.noise = noise
    found = fit_output_error(record(), structures=[TWO])
    assert found.given == {"of": steps.white if noise else steps.whole, "adequate": noise}
    assert steps.fits[0][2] == (TWO,)


def test_explanations_of_a_slope_are_weighed_with_simple_structures(steps):
    ways = record(), record(relaxing=True)
    found = fit_output_error(record(ways=ways), latest=3.0, known=KNOWN, huber=False)
    ((tried,),) = [steps.explained]
    assert [way for way, _ in tried] == list(ways)
    setting = (70, tuple(SIMPLE_STRUCTURES), 3.0, KNOWN, False)
    assert [fit[1:] for fit in steps.fits[:2]] == [setting, setting]
    assert [fit[0] for fit in steps.fits] == [*ways, ways[1]]
    assert found.relaxing
    assert steps.asked[0][0] is ways[1]
    # structures that are given are those
    steps.fits.clear()
    fit_output_error(record(ways=ways), structures=[ZERO])
    assert [fit[2] for fit in steps.fits] == [(ZERO,)] * 3
    steps.explained.clear()
    assert not fit_output_error(record()).relaxing
    assert steps.explained == []


# --- which explanation


@dataclass(frozen=True, eq=False)
class Way:
    """A fit with a residual, of which the model is not asked for."""

    error: np.ndarray
    structure: Structure = ONE
    sigma: float = 1.0
    variance: float = 2.0
    penalty: float = 5.0
    problem: str = "problem"

    @property
    def best(self):
        return Candidate(self.structure, np.zeros(1), 0.0)

    @property
    def window(self):
        def predict(problem, best):
            assert (problem, best.structure) == ("problem", self.structure)
            return np.full(self.error.size, 7.0)

        return SimpleNamespace(output=self.error + 7.0, predict=predict)


def way(squares=0.0, *, drift=0.0, relaxing=False, **changed):
    # a hundred samples, within three deviations
    error = np.full(100, np.sqrt(squares / 100))
    return SimpleNamespace(drift=drift, relaxing=relaxing), Way(error, **changed)


def chosen(*ways):
    data = _explained(list(ways))
    return next(i for i, (of, _) in enumerate(ways) if of is data)


def test_the_closer_explanation_is_chosen_where_both_cost_the_same():
    assert chosen(way(100), way(99)) == 1
    assert chosen(way(99), way(100)) == 0


def test_a_drift_costs_a_parameter_and_a_free_response_one_for_each_pole():
    # a penalty of 5 at a variance of 2
    assert chosen(way(100), way(90.1, drift=0.3)) == 0
    assert chosen(way(100), way(89.9, drift=0.3)) == 1
    for structure in (ONE, TWO, THREE):
        least = 10.0 * structure.order
        plain = way(100, structure=structure)
        assert chosen(plain, way(100.1 - least, relaxing=True, structure=structure)) == 0
        assert chosen(plain, way(99.9 - least, relaxing=True, structure=structure)) == 1


def test_poles_and_zeros_of_the_best_model_cost_what_they_are_charged():
    assert chosen(way(100), way(90.1, structure=TWO)) == 0
    assert chosen(way(100), way(89.9, structure=TWO)) == 1
    least = 2.0 * (2 * 5.0 + needless_charge(ZERO))
    assert chosen(way(100), way(100.1 - least, structure=ZERO)) == 0
    assert chosen(way(100), way(99.9 - least, structure=ZERO)) == 1


def test_the_fit_of_least_noise_sets_the_unit():
    # 10 of 100 less are worth a parameter with the variance of the closer one, not with the other's
    loud = way(100, sigma=1.2, variance=200.0, penalty=500.0)
    assert chosen(loud, way(90.1, drift=0.3)) == 0
    assert chosen(loud, way(89.9, drift=0.3)) == 1


@pytest.mark.parametrize("wildest", [-1e6, 1e6])
def test_wild_samples_count_as_three_deviations(wildest):
    wild = way(90)
    wild[1].error[0] = wildest
    # one sample of 3 instead of 0.95: 8.1 more; of 6 where the closer one leaves twice as much
    assert chosen(wild, way(90 + 8.0)) == 1
    assert chosen(wild, way(90 + 8.2)) == 0
    louder = way(90, sigma=2.0)
    louder[1].error[0] = wildest
    assert chosen(louder, way(90 + 35.0, sigma=2.1)) == 1
    assert chosen(louder, way(90 + 35.2, sigma=2.1)) == 0


# --- whether it is noise


@pytest.fixture
def residual(monkeypatch):
    """Sixty bins of one sample: rest, 20 in motion, and what comes when it has settled."""
    made = np.concatenate([np.full(10, 99.0), np.full(20, 1.0), np.full(15, 50.0), np.ones(15)])
    made[1::2] *= -1
    seen = SimpleNamespace(values=made, settled=30)

    def evaluate(problem, structure, parameters):
        assert (problem, structure) == ("problem", TWO)
        assert parameters.shape == (1, 2)
        return SimpleNamespace(residual=seen.values[None])

    monkeypatch.setattr(module, "evaluate", evaluate)
    monkeypatch.setattr(module, "settled_at", lambda data: data.edge - 10 + seen.settled)
    return seen


def is_noise(misfit, colour=1.0):
    bins = SimpleNamespace(first=np.arange(60))
    whole = SimpleNamespace(
        misfit=misfit,
        problem="problem",
        best=Candidate(TWO, np.zeros(2), 0.0),
        window=SimpleNamespace(bins=bins),
    )
    return _is_noise(SimpleNamespace(colour=colour, edge=10), whole)


def test_a_residual_of_the_noise_before_the_step_is_noise(residual):
    residual.values[10:30] = 9.0  # not asked for
    assert is_noise(1.3)
    assert not is_noise(1.31)
    assert is_noise(2.6, colour=2.0)
    assert not is_noise(2.61, colour=2.0)


def test_a_louder_one_is_noise_if_it_goes_on_when_the_response_has_settled(residual):
    # the later half of what comes then is 1, whatever the earlier is
    assert is_noise(5.2)
    assert not is_noise(5.21)
    assert is_noise(10.4, colour=2.0)
    assert not is_noise(10.41, colour=2.0)
    residual.values[10:30] *= 1.29
    assert is_noise(5.0)
    residual.values[10:30] *= 1.31 / 1.29
    assert not is_noise(5.0)
    # the sample at which the input moves is in motion
    residual.values[10:30] = np.where(np.arange(20) == 0, 9.0, 1.0)
    assert not is_noise(5.0)
    residual.values[10:30] = 1.31
    # of both, the mean squares count
    residual.values[45:60] *= 1.1
    assert is_noise(5.0)


def test_of_fewer_than_sixteen_bins_nothing_is_concluded(residual):
    residual.values[:] = 1.0
    residual.settled = 44
    assert is_noise(5.0)
    residual.settled = 45
    assert not is_noise(5.0)


# --- views


def test_the_delay_is_the_median_of_five_views_and_the_interval_leaves_the_lowest_out(monkeypatch):
    monkeypatch.setattr(module, "profile_of", lambda *of: ("profile", *of))
    monkeypatch.setattr(module, "assembled", lambda *given: given)
    views = tuple((str(at), at) for at in (3.0, 9.0, 1.0, 4.0, 7.0, 2.0))
    best = Candidate(TWO, np.zeros(2), 0.0)
    whole = SimpleNamespace(at_delay=lambda candidate, delay: (candidate, delay))
    of, model, adequate, kept, profiles, interval, profile = _robust_fit(whole, best, views)
    assert of is whole
    assert model == (best, 4.0)
    assert adequate is False
    assert kept == views
    assert profiles == {TWO: ("profile", whole, best)}
    assert profile == ("profile", whole, best)
    assert interval == (2.0, 9.0, pytest.approx(7 / 3.92))


def test_views_are_of_the_beginning_the_rise_and_all_of_it(monkeypatch):
    calls = []

    def fit_until(data, stop, structures, latest, known, huber):
        calls.append((data, stop, tuple(structures), latest, known, huber))
        candidates = {s: Candidate(s, np.array([stop + s.order]), 0.0) for s in structures}
        return SimpleNamespace(
            candidates=candidates, best=Candidate(TWO, np.array([stop + 0.5]), 0.0)
        )

    monkeypatch.setattr(module, "_fit_until", fit_until)
    data, best = record(), Candidate(TWO, np.array([8.0]), 0.0)
    monkeypatch.setattr(module, "stop_at", lambda of, part: 100 * part if of is data else None)
    found = _views(data, best, None, KNOWN, True)
    assert found == (
        ("first motion", 4.5),
        ("first-order lag, first 15 %", 16.0),
        ("second-order lag, first 15 %", 17.0),
        ("best model of the first 63 %", 63.5),
        ("best model of the whole record", 8.0),
        ("third-order lag, first 15 %", 18.0),
    )
    assert calls == [
        (data, 15.0, (ONE, TWO, THREE), None, KNOWN, True),
        (data, 63.0, tuple(SIMPLE_STRUCTURES), None, KNOWN, True),
    ]
    # no view is later than the longest delay
    assert _views(data, best, 3.0, KNOWN, False)[0] == ("first motion", 3.0)
    assert _views(data, best, 5.0, KNOWN, False)[0] == ("first motion", 4.5)
    assert [call[3:] for call in calls[2:4]] == [(3.0, KNOWN, False)] * 2


def test_a_fit_is_of_a_window_with_its_scales_and_noise(monkeypatch):
    monkeypatch.setattr(module, "window", lambda *given: ("window", *given))
    monkeypatch.setattr(module, "step_scales", lambda *given: ("scales", *given))
    monkeypatch.setattr(module, "fit_window", lambda *given: given)
    data = SimpleNamespace(sigma=0.3, quantum=0.7)
    assert _fit_until(data, 55, (ONE,), 3.0, KNOWN, False) == (
        ("window", data, 55, KNOWN),
        (ONE,),
        ("scales", data, 55, 3.0),
        (0.3, 0.7),
        False,
    )
