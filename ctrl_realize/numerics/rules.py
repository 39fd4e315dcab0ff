"""Rules of the output-error fits: each can be switched off, to measure its effect.

``benchmarks/ablation`` identifies records with and without each of them. There are no options for
them, because nobody should fit without them. Where they come from is said where they act; the list
is our own.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from enum import Enum


class Rule(Enum):
    """A rule, by the name that it has in the table of rules."""

    HUBER = "Huber's loss"
    WHITENED = "noise made white"
    SHORT_REST = "noise of a short rest made white"
    GOES_ON = "louder noise that goes on"
    SLOW_REST = "first motion in slow noise"
    UNLIKE = "unlike residual left alone"
    STRUCTURES = "structures not ruled out"
    SIMPLER = "simpler lags not ruled out"
    NEEDLESS = "needless parameters"
    LEAST_CHARGE = "least charge"
    RESOLVED = "resolved gain first"
    SLOWER = "slower poles beside zeros"
    INTEGRATOR = "integrator beside a lag of any ratio"
    CHAINS = "chains of equal lags"
    IMPROVING = "chains that still improve"
    DIFFUSION = "modes of diffusion"
    DIFFUSION_CHARGE = "charge for diffusion"
    FLOWS = "flows that disperse"
    FLOW_CHARGE = "charge for a flow"
    FRICTION = "friction behind lags"
    OPEN_START = "open beginning behind a zero"
    VIEWS = "views (the likelihood always)"
    LIKELIHOOD = "likelihood (the views always)"
    VIEW_ONSET = "view: onset"
    VIEW_ONE_LAG = "view: one lag early"
    VIEW_TWO_LAGS = "view: two lags early"
    VIEW_RISE = "view: model of rise"
    VIEW_RECORD = "view: model of record"
    VIEW_THREE_LAGS = "view: three lags early"
    LOUDER = "louder noise after the step"
    FREE_RESPONSE = "free response before the step"
    EXPONENTIAL = "exponential before the step"
    SWING = "swing before the step"
    SIMPLE = "simple models alone"
    MISFIT = "time to move by the misfit"
    BEND = "bend before the step"
    NO_SLOPE = "slope that was nothing"
    MOTION_EVIDENCE = "strong evidence of a motion"
    DRIFT_EVIDENCE = "very strong evidence of a drift"
    TAKES_GAIN = "motion that takes the gain"
    EXTRAPOLATION = "least extrapolation"
    NO_CHAIN = "no chain beside a free response"
    NO_DISPERSION = "no dispersion where rounding is coarse"
    ROUNDED = "likelihood of rounded data"
    PINNED = "estimates against a pinned likelihood"
    CONSTANT_REST = "noise of a rest that is constant"
    DRIFT = "drift"
    LOAD = "load during the test"
    HUM = "hum"
    HUM_IN_NOISE = "hum against slow noise"
    COLOUR = "colour of the noise at rest"
    COARSE = "coarse converter"
    TAKEN = "noise that the model has taken"
    WEIGHT = "correlation in units of weight"
    MEANS = "first motion in means"
    RINGING = "start at the ringing"
    HOPELESS = "hopeless searches skipped"
    POLE = "pole tried anywhere"
    SWEPT = "profiles swept"
    LOWER = "profiles followed below a minimum"
    HELD_OUTPUT = "held output"
    GENERALISED = "step of generalised least squares"
    MODES = "modes beside lags"
    COLOURED = "coloured noise of any input"
    FOLLOWED = "noise that a model follows"
    MORE_LAGS = "fourth and fifth lag"
    CORRELATION = "start from the correlation"
    FROM_REST = "fits from rest"
    SAMPLED_LOADS = "loads in records of any input"
    HELD_STEPS = "steps that are held"
    CURVES = "curves are no steps"
    SPIKES = "spikes left out"
    REPEATS = "repeats left out"
    HOLDS = "holds beneath noise"
    LOOP = "loop without its set point"
    PAST = "past outputs tell a controller"
    BRIEF_REST = "rest shorter than the response"
    SLOW_TURN = "first turn in slow noise"
    NOISE_ONSET = "onset that is noise"
    LOOP_ROUNDED = "controller behind rounding"
    RECORD_NOISE = "records weighted by their noise"

    @property
    def on(self) -> bool:
        """Whether the rule applies; asked where it would change something."""
        for seen in _ASKED.get():
            seen.add(self)
        return self not in _OFF.get()


_OFF = ContextVar("rules that are switched off", default=frozenset[Rule]())
_ASKED = ContextVar[tuple[set[Rule], ...]]("sets of the rules that are asked", default=())


@contextmanager
def without(*rules: Rule) -> Iterator[None]:
    """Switch rules off for a while, beside those that are off already."""
    token = _OFF.set(_OFF.get().union(rules))
    try:
        yield
    finally:
        _OFF.reset(token)


@contextmanager
def asked() -> Iterator[set[Rule]]:
    """Collect the rules that are asked for a while: those that touch what is computed."""
    seen: set[Rule] = set()
    token = _ASKED.set((*_ASKED.get(), seen))
    try:
        yield seen
    finally:
        _ASKED.reset(token)
