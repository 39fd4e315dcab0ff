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

Change = Callable[[Any], Any]
"""Of what stands in a module: what stands there while the rule is off."""

NUMERICS = "ctrl_realize.numerics"
FITS = f"{NUMERICS}.output_error"
STEP = f"{FITS}.step_fit"
PUBLIC = "ctrl_realize.identification.output_error"


@dataclass(frozen=True)
class Switch:
    """A rule and what is put in its place; `of` are the kinds of records that it can touch."""

    name: str
    changes: dict[str, Change]
    of: tuple[str, ...] = ("lags", "disturbed", "wrong", "measured")

    @contextmanager
    def off(self) -> Iterator[None]:
        """Switch the rule off for a while."""
        with ExitStack() as stack:
            for path, change in self.changes.items():
                where, _, name = path.partition(":")
                owner: Any = import_module(where)
                *inner, last = name.split(".")
                for part in inner:
                    owner = getattr(owner, part)
                stack.enter_context(mock.patch.object(owner, last, change(getattr(owner, last))))
            yield


def value(new: Any) -> Change:
    """Put a value in its place."""
    return lambda _: new


def giving(answer: Any) -> Change:
    """Put a function in its place that gives the same answer whatever it is asked."""
    return lambda _: lambda *_args, **_kwargs: answer


def first(_: Any) -> Any:
    """Put a function in its place that returns its first argument."""
    return lambda given, *_args, **_kwargs: given


def _only(wanted: Callable[[Any], bool]) -> Change:
    """Explanations of what comes before a step, without some of them."""
    return lambda ways: lambda data: [way for way in ways(data) if wanted(way)] or [data]


def _without_view(key: str) -> Change:
    return lambda views: lambda *args: tuple(view for view in views(*args) if view[0] != key)


def _without_drift(make: Any) -> Any:
    def made(*args: Any) -> Any:
        data = make(*args)
        return replace(data, drift=0.0, relaxing=False)

    return made


def _least_squares(fit: Any) -> Any:
    return lambda *args, **kwargs: fit(*args, **{**kwargs, "huber": False})


def _best_alone(_: Any) -> Any:
    return lambda candidates, charged, variance, best, level: [best.structure]


VIEWS = ("onset", "one_lag_early", "two_lags_early", "model_of_rise", "model_of_record")

SWITCHES = (
    Switch("all rules on", {}, ("lags", "disturbed", "wrong", "measured", "driven")),
    Switch("Huber's loss", {f"{PUBLIC}.fit:fit_step_record": _least_squares}),
    Switch("noise made white", {f"{STEP}:in_coloured_noise": first}),
    Switch(
        "structures that are not ruled out (interval of the best alone)",
        {f"{FITS}.interval:plausible": _best_alone},
        ("lags", "disturbed", "wrong", "measured", "driven"),
    ),
    Switch(
        "charge for needless parameters",
        {
            f"{NUMERICS}.separable.structures:needless_parameters": giving(0.0),
            f"{FITS}.selection:needless_parameters": giving(0.0),
            f"{STEP}:needless_parameters": giving(0.0),
        },
        ("lags", "disturbed", "wrong", "measured", "driven"),
    ),
    Switch("chains of equal lags", {f"{FITS}.selection:fit_chains": giving([])}),
    Switch("chains that still improve", {f"{FITS}.interval:still_improving": giving(False)}),
    Switch("modes of diffusion", {f"{FITS}.selection:fit_diffusion": giving([])}),
    Switch("flows that disperse", {f"{FITS}.selection:fit_flows": giving([])}),
    Switch("long chains taken for flows", {f"{FITS}.interval:_like_a_flow": giving(False)}),
    Switch(
        "beginning that is open behind a zero",
        {f"{FITS}.interval:_opened": lambda _: lambda low, high, *_rest: (low, high)},
    ),
    Switch("views (the likelihood always)", {f"{STEP}:_is_noise": giving(True)}),
    Switch("likelihood (the views always)", {f"{STEP}:_is_noise": giving(False)}),
    *(
        Switch(f"view: {key.replace('_', ' ')}", {f"{STEP}:_views": _without_view(key)})
        for key in VIEWS
    ),
    Switch("noise that is louder after the step", {f"{STEP}:_LOUDER": value(1.0)}),
    Switch(
        "free response before the step",
        {f"{FITS}.step_data:StepData.explanations": _only(lambda way: not way.relaxing)},
    ),
    Switch(
        "drift that ends",
        {f"{FITS}.step_data:StepData.explanations": _only(lambda way: not way.ending)},
    ),
    Switch("drift", {f"{PUBLIC}.fit:step_data": _without_drift}),
    Switch("hum", {f"{FITS}.step_data:hum_frequencies": giving([])}),
    Switch(
        "rounding as noise of a coarse converter",
        {f"{FITS}.step_data:StepData.coarse": lambda _: property(lambda _data: False)},
    ),
    Switch(
        "checks that widen the interval",
        {
            f"{PUBLIC}.checks:_held_flags": giving(([], 0.0)),
            f"{PUBLIC}.checks:_white": giving(None),
        },
        ("disturbed", "wrong", "measured", "driven"),
    ),
    Switch(
        "modes beside lags",
        {"ctrl_realize.identification.methods:with_modes_judged": first},
        ("driven",),
    ),
    Switch("slow cosines", {f"{FITS}.input_fit:_CALMER": value(0.0)}, ("driven",)),
    Switch("fourth and fifth lag", {f"{FITS}.input_fit:MORE_LAGS": value(())}, ("driven",)),
    Switch(
        "correlation with the input as a start",
        {f"{FITS}.input_fit:_seen": giving([])},
        ("driven",),
    ),
)
