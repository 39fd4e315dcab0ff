"""Worlds for the flags that a record raises against any model of it."""

from __future__ import annotations

import numpy as np

import ctrl_realize as cr

from ..worlds import described, driven, loops, sensors, steps
from ..worlds.simulation import World
from .flag_case import Codes, FlagCase, Run, codes


def fitted(world: World) -> Run:
    """Fit a record of a world, the seed being its own."""

    def run(seed: int) -> Codes:
        record = world(np.random.default_rng([seed, 41])).records
        return codes(cr.fit_output_error(record).fit)

    return run


def _case(code: str, due: World, not_due: World, result: str = "fit_output_error") -> FlagCase:
    names = [f"worlds: {world.__name__}" for world in (due, not_due)]
    return FlagCase(result, code, names[0], fitted(due), names[1], fitted(not_due))


MOVING = "fit_output_error, moving input"
CASES = [
    _case("gain_not_resolved", steps.ends_while_rising, described.one_lag),
    _case("not_settled", steps.ends_while_rising, described.two_lags),
    _case("held_output", sensors.analyser, described.fine_converter),
    _case("output_at_limit", sensors.clipped, described.one_lag),
    _case("earlier_input", steps.moved_before, described.two_lags),
    _case("not_linear", steps.fills_faster_than_it_empties, described.several_steps),
    _case("feedback", loops.set_points, described.random_binary, MOVING),
    _case("not_linear", driven.pipe_with_random_flows, described.random_levels, MOVING),
    _case("gain_not_resolved", driven.drawn_in, described.random_levels, MOVING),
    _case("cancelled_pair", driven.rocking, described.random_levels, MOVING),
    _case("time_varying", driven.ageing, described.random_levels, MOVING),
]
