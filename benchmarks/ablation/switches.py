"""Rules of the output-error fits, and how each is switched off.

A rule is switched off by putting another function in its place while a benchmark runs; the package
has no options for it, for nobody should fit without them.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass, replace
from importlib import import_module
from typing import Any
from unittest import mock

import numpy as np

from ctrl_realize.numerics.constants import STRONG, VERY_STRONG
from ctrl_realize.numerics.engine.structures import choose, needless_parameters
from ctrl_realize.numerics.output_error.before_the_step import _dies_away
from ctrl_realize.numerics.output_error.selection import flows_of
from ctrl_realize.numerics.validation.innovations import _EXACTLY

Change = Callable[[Any], Any]
"""Of what stands in a module: what stands there while the rule is off."""

NUMERICS = "ctrl_realize.numerics"
FITS = f"{NUMERICS}.output_error"
STEP = f"{FITS}.step_fit"
BEFORE = f"{FITS}.before_the_step"
ENGINE = f"{NUMERICS}.engine"
FAMILIES = f"{NUMERICS}.families"
PUBLIC = "ctrl_realize.identification.output_error"


@dataclass(frozen=True)
class Switch:
    """A rule and what is put in its place.

    `asked` are the functions whose answers tell whether a record is touched by the rule: those
    that are changed, where none are named. With `called` their being called is enough, where to
    ask them twice would take long.
    """

    name: str
    changes: dict[str, Change]
    asked: tuple[str, ...] = ()
    called: bool = False

    @property
    def probes(self) -> tuple[str, ...]:
        """Paths of the functions that are asked."""
        return self.asked or tuple(self.changes)

    @contextmanager
    def off(self) -> Iterator[None]:
        """Switch the rule off for a while."""
        with ExitStack() as stack:
            for path, change in self.changes.items():
                owner, name = located(path)
                stack.enter_context(mock.patch.object(owner, name, change(getattr(owner, name))))
            yield


def located(path: str) -> tuple[Any, str]:
    """Module or class, and the name in it, of ``module:name`` or ``module:Class.name``."""
    where, _, name = path.partition(":")
    owner: Any = import_module(where)
    *inner, last = name.split(".")
    for part in inner:
        owner = getattr(owner, part)
    return owner, last


def value(new: Any) -> Change:
    """Put a value in its place."""
    return lambda _: new


def giving(answer: Any) -> Change:
    """Put a function in its place that gives the same answer whatever it is asked."""
    return lambda _: lambda *_args, **_kwargs: answer


def first(_: Any) -> Any:
    """Put a function in its place that returns its first argument."""
    return lambda given, *_args, **_kwargs: given


def _of_the_residual(whitening_filter: Any) -> Any:
    """Noise models of what is left, whatever the model has followed."""
    return lambda noise, lags, columns: whitening_filter(noise, lags)


def _with_the_present(chance: Any) -> Any:
    """Chances of predictions by past outputs alone are 1."""
    return lambda *signals, first=0: 1.0 if first else chance(*signals)


def _only(wanted: Callable[[Any], bool]) -> Change:
    """Explanations of what comes before a step, without some of them."""
    return lambda ways: lambda data: [way for way in ways(data) if wanted(way)] or [data]


def _view_amid(key: str) -> Change:
    """Put a view at the median of the others, where it decides nothing."""

    def change(views: Any) -> Any:
        def made(*args: Any) -> Any:
            found = views(*args)
            others = [at for name, at in found[:-1] if name != key]
            amid = float(np.median(others))
            return tuple((name, amid if name == key else at) for name, at in found)

        return made

    return change


def _constant_rest(noise: Any) -> Any:
    """Take a constant rest for one without noise."""

    def made(before: Any, record: Any, quantum: float, *rows: Any) -> Any:
        if before.size >= 8 and np.ptp(before) == 0:
            return quantum / np.sqrt(12), 0.0
        return noise(before, record, quantum, *rows)

    return made


def _without_drift(make: Any) -> Any:
    def made(*args: Any) -> Any:
        data = make(*args)
        return replace(data, drift=0.0, relaxing=False)

    return made


def _while_it_dies_away(_: Any) -> Any:
    return lambda data, whole: data.relaxing and not _dies_away(data, whole)


def _best_fit(_: Any) -> Any:
    return lambda whole, candidate, **_how: (candidate, whole.static(candidate))


def _least_squares(fit: Any) -> Any:
    return lambda data, requested: fit(data, replace(requested, huber=False))


def _best_alone(_: Any) -> Any:
    return lambda candidates, charged, variance, best, level, slack=0.0: [
        structure for structure, candidate in candidates.items() if candidate is best
    ]


def _by_criterion(_: Any) -> Any:
    def made(
        candidates: Any,
        criterion: Any,
        variance: float,
        chosen: Any,
        level: float,
        slack: float = 0,
    ) -> Any:
        limit = min(*criterion.values(), level) + VERY_STRONG + slack
        return [
            s
            for s, value in criterion.items()
            if value <= limit
            or value + needless_parameters(s) <= level + VERY_STRONG + slack
            or candidates[s] is chosen
        ]

    return made


def _alike_noise(levels: Any) -> Any:
    return lambda *args: np.full_like(found := levels(*args), found[0])


VIEWS = ("onset", "one_lag_early", "two_lags_early", "model_of_rise", "model_of_record")

MODES = Switch(
    "modes beside lags", {"ctrl_realize.identification.model_class:with_modes_judged": first}
)
"""Of records whose inputs are no steps the other rules are tried without it."""

SWITCHES = (
    Switch("all rules on", {}),
    Switch("Huber's loss", {f"{PUBLIC}.fit:fit_step_record": _least_squares}, called=True),
    Switch("noise made white", {f"{STEP}:in_coloured_noise": first}),
    Switch(
        "noise of a short rest made white",
        {f"{FITS}.coloured:whitening_filter": giving(np.ones(1))},
    ),
    Switch("louder noise that goes on", {f"{STEP}:continues": giving(False)}),
    Switch("first motion in slow noise", {f"{FITS}.step_data:_unseen_at_rest": giving(1.0)}),
    Switch(
        "unlike residual left alone",
        {f"{FITS}.coloured:_UNLIKE": value(float("inf"))},
        (f"{STEP}:in_coloured_noise",),
    ),
    Switch(
        "structures not ruled out",
        {f"{FITS}.interval:plausible": _best_alone},
    ),
    Switch(
        "simpler lags not ruled out",
        {f"{FITS}.interval:plausible": _by_criterion},
    ),
    Switch(
        "needless parameters",
        {
            f"{ENGINE}.structures:needless_parameters": giving(0.0),
            f"{FITS}.selection:needless_parameters": giving(0.0),
            f"{BEFORE}:needless_parameters": giving(0.0),
        },
        (f"{STEP}:fit_window", f"{FITS}.any_input.window:fit_window"),
        called=True,
    ),
    Switch(
        "least charge",
        {
            f"{ENGINE}.structures:LEAST_CHARGE": value(0.0),
            f"{FITS}.interval:LEAST_CHARGE": value(0.0),
            f"{FITS}.friction:LEAST_CHARGE": value(0.0),
        },
        (f"{ENGINE}.structures:charged", f"{FITS}.interval:charged"),
    ),
    Switch(
        "resolved gain first",
        {
            f"{ENGINE}.window_fit:WindowFit.best_of": lambda _: (
                lambda self, criterion: self.candidates[choose(criterion)]
            )
        },
    ),
    Switch(
        "slower poles beside zeros",
        {f"{ENGINE}.structures:SLOWER_WITH_ZEROS": value(40.0)},
        (f"{STEP}:fit_window", f"{FITS}.any_input.window:fit_window"),
        called=True,
    ),
    Switch(
        "integrator beside a lag of any ratio",
        {f"{ENGINE}.window_fit:RAMP": value(0.0)},
        (f"{STEP}:fit_window", f"{FITS}.any_input.window:fit_window"),
        called=True,
    ),
    Switch("chains of equal lags", {f"{FITS}.selection:fit_chains": giving([])}),
    Switch("chains that still improve", {f"{FITS}.interval:still_improving": giving(False)}),
    Switch("modes of diffusion", {f"{FITS}.selection:fit_diffusion": giving([])}),
    Switch(
        "charge for diffusion",
        {f"{FAMILIES}.equal_lags:_DIFFUSION_CHARGE": value(0.0)},
        (f"{FITS}.selection:fit_diffusion",),
    ),
    Switch("flows that disperse", {f"{FITS}.selection:fit_flows": giving([])}),
    Switch(
        "charge for a flow",
        {f"{FAMILIES}.flow:_CHARGE": value(0.0)},
        (f"{FITS}.selection:fit_flows",),
    ),
    Switch(
        "friction behind lags",
        {f"{FITS}.interval:latest_slip": giving(None)},
    ),
    Switch(
        "open beginning behind a zero",
        {f"{FITS}.interval:_opened": lambda _: lambda low, high, *_rest: (low, high)},
    ),
    Switch("views (the likelihood always)", {f"{STEP}:_is_noise": giving(True)}),
    Switch("likelihood (the views always)", {f"{STEP}:_is_noise": giving(False)}),
    *(
        Switch(f"view: {key.replace('_', ' ')}", {f"{STEP}:_views": _view_amid(key)})
        for key in VIEWS
    ),
    Switch("view: three lags early", {f"{STEP}:_views": _view_amid("three_lags_early")}),
    Switch(
        "louder noise after the step",
        {f"{STEP}:_LOUDER": value(1.0)},
        (f"{STEP}:_is_noise",),
    ),
    Switch(
        "free response before the step",
        {f"{FITS}.step_data:StepData.explanations": _only(lambda way: not way.relaxing)},
    ),
    Switch("exponential before the step", {f"{FITS}.step_data:relaxation": giving(None)}),
    Switch(
        "swing before the step",
        {f"{NUMERICS}.signals.baseline:_SMOOTH": value(np.inf)},
        (f"{FITS}.step_data:noise_about_a_motion",),
    ),
    Switch(
        "simple models alone",
        {f"{STEP}:_FAR_POORER": value(np.inf)},
        (f"{STEP}:_simple_ones_suffice",),
    ),
    Switch("time to move by the misfit", {f"{STEP}:_unseen": giving(0.0)}),
    Switch("bend before the step", {f"{FITS}.step_data:noise_about_a_motion": giving(0.0)}),
    Switch(
        "slope that was nothing",
        {f"{FITS}.step_data:StepData.explanations": _only(lambda way: way.drift or way.relaxing)},
    ),
    Switch(
        "strong evidence of a motion",
        {f"{BEFORE}:STRONG": value(0.0)},
        (f"{BEFORE}:_most_evident",),
    ),
    Switch(
        "very strong evidence of a drift",
        {f"{BEFORE}:VERY_STRONG": value(STRONG)},
        (f"{BEFORE}:_most_evident",),
    ),
    Switch("motion that takes the gain", {f"{BEFORE}:_takes_the_gain": _while_it_dies_away}),
    Switch(
        "least extrapolation",
        {
            f"{FITS}.{module}:least_extrapolating": _best_fit
            for module in ("interval", "step_fit", "flat_likelihood", "result")
        },
    ),
    Switch(
        "no chain beside a free response",
        {f"{FITS}.selection:_beside_own_terms": lambda _: lambda _whole, tanks: tanks},
    ),
    Switch(
        "no dispersion where rounding is coarse",
        {f"{STEP}:_flows": lambda _: lambda _data, whole, chains: flows_of(whole, chains)},
    ),
    Switch("likelihood of rounded data", {f"{STEP}:in_rounded_data": first}),
    Switch(
        "estimates against a pinned likelihood",
        {f"{STEP}:pinned": giving(2.0)},
        (f"{STEP}:moved",),
        called=True,
    ),
    Switch(
        "noise of a rest that is constant",
        {f"{FITS}.step_data:rest_noise": _constant_rest},
    ),
    Switch(
        "drift",
        {f"{PUBLIC}.{name}:step_data": _without_drift for name in ("arguments", "averaging")},
    ),
    Switch("load during the test", {f"{STEP}:load_of": giving(None)}),
    Switch("hum", {f"{FITS}.step_data:hum_frequencies": giving([])}),
    Switch("hum against slow noise", {f"{NUMERICS}.signals.noise:_is_line": giving(True)}),
    Switch("colour of the noise at rest", {f"{FITS}.step_data:colouring": giving(1.0)}),
    Switch(
        "coarse converter",
        {f"{FITS}.step_data:StepData.coarse": lambda _: property(lambda _data: False)},
    ),
    Switch(
        "noise that the model has taken",
        {f"{STEP}:with_noise_of_residual": lambda _: lambda fit: fit},
    ),
    Switch(
        "correlation in units of weight",
        {f"{ENGINE}.window_fit:weighted_correlation": lambda _: lambda time, _counted: time},
    ),
    Switch(
        "first motion in means",
        {f"{NUMERICS}.signals.onset:_SMOOTHINGS": value((1,))},
        (f"{FITS}.step_data:first_motion",),
    ),
    Switch(
        "start at the ringing",
        {f"{ENGINE}.window_fit:_ringing": giving(0.0)},
        called=True,
    ),
    Switch(
        "hopeless searches skipped",
        {f"{ENGINE}.structures:_worth_a_search": giving(True)},
    ),
    Switch(
        "pole tried anywhere",
        {f"{ENGINE}.compared_fits:_with_a_pole_more": giving([])},
    ),
    Switch(
        "profiles swept",
        {f"{ENGINE}.profile:_SWEEPS": value(0)},
        (f"{ENGINE}.profile:descend",),
        called=True,
    ),
    Switch(
        "profiles followed below a minimum",
        {f"{FITS}.interval:lower_minima": giving({})},
    ),
    Switch(
        "held output",
        {f"{PUBLIC}.checks:hold_time": giving(None)},
    ),
    Switch(
        "step of generalised least squares", {f"{PUBLIC}.checks:generalised_step": giving(None)}
    ),
    MODES,
    Switch(
        "coloured noise of any input",
        {f"{FITS}.any_input.stretch:in_coloured_noise": first},
        called=True,
    ),
    Switch(
        "noise that a model follows",
        {f"{FITS}.any_input.window:whitening_filter": _of_the_residual},
        called=True,
    ),
    Switch(
        "fourth and fifth lag",
        {f"{FITS}.any_input.fit:MORE_LAGS": value(())},
        (f"{FITS}.any_input.fit:extended",),
        called=True,
    ),
    Switch("start from the correlation", {f"{FITS}.any_input.window:_seen": giving([])}),
    Switch(
        "no pair at the Nyquist frequency",
        {f"{ENGINE}.window_fit:at_nyquist": giving(False)},
    ),
    Switch(
        "steps that are held",
        {f"{PUBLIC}.arguments:_MOVES": value(np.inf)},
        asked=(f"{PUBLIC}.arguments:_holds_between",),
    ),
    Switch("curves are no steps", {f"{PUBLIC}.arguments:_curved": giving(False)}),
    Switch(
        "spikes left out",
        {f"{NUMERICS}.signals.noise:FAR": value(np.inf)},
        (f"{PUBLIC}.actuated.limits:spikes",),
    ),
    Switch(
        "repeats left out",
        {
            f"{NUMERICS}.validation.held_output:_FEWEST_UPDATES": value(np.inf),
            f"{NUMERICS}.validation.held_output:_BAND": value(1.0),
        },
        (f"{PUBLIC}.actuated.limits:updates",),
    ),
    Switch(
        "loop without its set point",
        {f"{PUBLIC}.fit:answers_the_output": giving(False)},
    ),
    Switch(
        "past outputs tell a controller",
        {f"{NUMERICS}.validation.innovations:_answer_chance": _with_the_present},
        asked=(f"{PUBLIC}.fit:answers_the_output",),
    ),
    Switch(
        "first turn in slow noise",
        {f"{FITS}.any_input.lags:_SLOW": value(np.ones(1))},
        (f"{FITS}.any_input.lags:_unlikely",),
        called=True,
    ),
    Switch(
        "controller behind rounding",
        {f"{NUMERICS}.validation.innovations:_ROUNDED": value(_EXACTLY)},
        asked=(f"{PUBLIC}.fit:answers_the_output",),
    ),
    Switch(
        "records weighted by their noise",
        {f"{FITS}.any_input.window:_noise_levels": _alike_noise},
    ),
)
