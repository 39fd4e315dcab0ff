"""Choose between a transfer function with dead time and a general state-space model.

A record of one input and one output is fitted by lags with a dead time first. If the residual is
correlated with the input, a state-space model is fitted as well (`fit_state_space`), and both are
compared on the same samples with autoregressive noise models whose orders are chosen by BIC.
Correlation with the input of the same sample alone is that of a feedthrough, which lags do not
have, or of a controller.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import control as ct
import numpy as np

from .._flags import Flag, flagged, marked
from .._wording import interval_in_time
from ..data import Record
from ..delayed import DelayedStateSpace, fit_of
from ..errors import DataError, OrderError, UnsuitableSystemError
from ..numerics.arrays import ComplexArray, FloatArray
from ..numerics.constants import VERY_STRONG
from ..numerics.engine.plausible_models import PlausibleModel
from ..numerics.output_error.any_input.data import MOST_SAMPLES
from ..numerics.rules import Rule
from ..numerics.signals.noise import correlation_time
from ..numerics.signals.noise_model import coloured_criterion
from ..numerics.validation.innovations import RARE, misfit_chance
from .long_records import lively_parts
from .output_error.checks import Shown, against_one_model, nonlinear_flags
from .output_error.loop_flags import answers_the_output, in_automatic
from .output_error.own_gains import at_model_gain
from .output_error.result import OutputErrorFit
from .output_error.words import FAR_APART
from .state_space_fit.starts import Outcome, from_starts
from .validation.residuals import analyse_residuals
from .validation.residuals_result import ResidualAnalysis
from .verdicts import verdicts_beside_lags

LAGS = 25
"""Lags after the dead time at which the correlation of residual and input is tested."""
MOST_STARTS = 3
"""Largest number of impulse-response estimates from which the state-space fit starts."""
HOPELESS = 2.0
"""Largest ratio of residuals, lags to state space, for which the lags' interval is included."""
_NOTHING = 0.5  # samples
_ROUNDING = 1e-12

Residuals = list[FloatArray]


def with_modes_judged(
    system: DelayedStateSpace, max_delay: int | None, *, asked: bool = False
) -> DelayedStateSpace:
    """Try a state-space model if the residual is correlated with the input; return the better one.

    With `asked`, the structure was requested: its residual is tested, but nothing else is tried;
    neither for records with gains of their own.
    """
    fit = fit_of(system, OutputErrorFit)
    if fit.estimate.averaged or any(in_automatic(record) for record in fit.records):
        # Coloured noise that a controller answers is correlated with the input.
        return system
    if any(flag.code == "no_common_gain" for flag in fit.flags):
        return system  # no model of one plant explains them
    records, cut = lively_parts(at_model_gain(fit))
    try:
        checks = _checks(system, records)
        follows, left = [not check.independent for check in checks], _residuals(checks)
        related = [bool(check.flags) for check in checks]
    except UnsuitableSystemError:  # an unstable model is not simulated
        related, follows, left = [True] * len(records), [True] * len(records), None
    if not Rule.MODES.on:
        return system
    why = "nothing else could be fitted"
    outlying = fit.repeatability is not None and fit.repeatability.outlying
    if not any(related):
        stepped = bool(np.isfinite(fit.onset))
        follows = [not (asked or stepped) and _follows(check) for check in checks]
        why = f"{interval_in_time(*fit.interval)} is not an interval of 95 %"
    elif asked:
        why = (
            "identify without order and structures, or fit_state_space, also tries "
            "state-space models"
        )
    elif fit.gains is not None:
        why = "no other model was tried with a gain for each record"
    elif outlying:
        why = "the records do not agree on one plant, so no other model was tried"
    else:
        try:
            found = from_starts(records, most_starts=MOST_STARTS, enough=MOST_SAMPLES)
            gain = _gain(fit, records, left, found)
            late = max_delay is not None and _delay(found.system) > max_delay
            # A feedthrough alone leaves nothing of the input in this residual, a controller does.
            loop = not any(follows) and any(c.flags for c in _checks(found.system, records))
            # In a loop it is that of the controller: u = K (r - y) explains the noise.
            if loop or (found.fit.feedthrough and answers_the_output(records)):
                return system  # coloured noise that a controller answers is correlated with it
            if gain > VERY_STRONG and not late:
                return _chosen(found, fit, sum(related), gain, cut)
            said = "starts after max_delay" if late else "(fit_state_space) is no better"
            why = f"a model of {found.fit.order} states {said}"
        except (DataError, OrderError) as refused:
            why = f"no state-space model: {refused}"
    if left is None or not any(follows):
        return system
    flag = flagged("input_in_residual.lags", count=sum(follows), records=len(follows), why=why)
    return system.replace(fit=replace(fit, flags=(*fit.flags, flag)))


def _checks(system: DelayedStateSpace, records: Sequence[Record]) -> list[ResidualAnalysis]:
    """Test whether residuals are correlated with the input."""
    late = int(np.ceil(np.max(system.delay)))
    return [
        analyse_residuals(system, record, lags=min(late + LAGS, record.n_samples // 3))
        for record in records
    ]


def _follows(check: ResidualAnalysis) -> bool:
    """Whether the input explains the residual from further back than its correlation tells."""
    return misfit_chance(np.ravel(check.residual), np.ravel(check.record.input)) < RARE


def _residuals(checks: Sequence[ResidualAnalysis]) -> Residuals:
    return [np.ravel(check.residual) for check in checks]


def _delay(system: DelayedStateSpace) -> int:
    return int(system.input_delays[0] + system.output_delays[0])


def _gain(
    fit: OutputErrorFit, records: Sequence[Record], left: Residuals | None, found: Outcome
) -> float:
    """Difference of the information criteria, lags minus state space.

    Every record has a noise of its own, as in the fit of lags.
    """
    if left is None:
        return float("inf")
    modes = found.fit
    samples = sum(e.size for e in left)
    starts = len(records)
    # parameters, dead time, and the initial states
    lags = 2 * fit.order - fit.relative_degree + 2 + starts * fit.order
    other = 2 * modes.order + modes.feedthrough + 1 + starts * modes.order
    theirs = _residuals(_checks(found.system, records))
    fewer = (lags - other) * float(np.log(samples))
    better = (
        coloured_criterion([of_lags])[0] - coloured_criterion([of_states])[0]
        for of_lags, of_states in zip(left, theirs, strict=True)
    )
    return float(sum(better) + fewer)


def _chosen(
    found: Outcome, lags: OutputErrorFit, following: int, gain: float, cut: tuple[Flag, ...]
) -> DelayedStateSpace:
    """Return the state-space model with its dead time, the interval, and the reasons."""
    system = found.system
    modes = found.fit
    dt = lags.dt
    independent = max(correlation_time(np.ravel(c.residual)) for c in modes.checks)
    own = found.search.plausible(found.best, independent)
    low, high = dt * own[0], dt * own[1]
    if lags.residual <= HOPELESS * float(modes.noise_std[0]):
        low, high = min(low, lags.interval[0]), max(high, lags.interval[1])
    dead_time = dt * _delay(system)
    kept = [flag for flag in lags.flags if flag.code in marked("stays_with_states")]
    codes = {flag.code for flag in kept}
    own_flags = [flag for flag in modes.flags if flag.code not in codes]
    flags, notes = [*cut, *own_flags, *kept], list[str]()
    if len(modes.checks) == 1 and not {"feedback", "late_input"} & {flag.code for flag in flags}:
        check = modes.checks[0]
        output, drive = np.ravel(check.record.output), np.ravel(check.record.input)
        shown, total = Shown(output, np.ravel(check.simulated), drive), _total_delay(system)
        changes, notes = against_one_model(shown, _delay(system))
        flags += changes
        if total is not None and all(flag.code != "not_linear" for flag in flags):
            flags += nonlinear_flags(shown, _delay(system), total / dt)
    wide = high - low > max(FAR_APART * max(dead_time, dt), 2 * dt * (own[1] - own[0]))
    if own[0] <= _NOTHING or wide:
        ends = interval_in_time(low, high)
        if own[0] <= _NOTHING:
            flags.append(flagged("no_delay_resolved", interval=ends, known=""))
        else:
            flags.append(flagged("structures_disagree", interval=ends, known=""))
    reasons = (
        f"{modes.order} states (fit_state_space) instead of a transfer function of order "
        f"{lags.order} with dead time: the residual of the latter is correlated with the "
        f"input in {following} of {len(lags.records)} record(s), and on the same samples, "
        f"with autoregressive noise for both, BIC is {gain:.0f} smaller",
        "dead time: whole samples, sampled with a zero-order hold; interval: delays at which "
        "a model of this order is not ruled out, joined with the interval of the transfer "
        "function unless its residual is twice as large",
    )
    fit = replace(
        modes,
        dead_time=dead_time,
        interval=(low, high),
        total_delay=_total_delay(system),
        gain=float(np.real(system.dcgain())),
        lags=lags,
        choices=(*reasons, *modes.choices, *notes),
        flags=tuple(flags),
    )
    as_lags = PlausibleModel(lags.dead_time, lags._plain_poles, lags.estimate.numerator)

    def response(omega: FloatArray) -> ComplexArray:
        turn = np.exp(1j * omega * dt)
        return np.asarray(system(turn) * np.sqrt(turn))  # a hold is half a sample

    judged = verdicts_beside_lags(fit, lags, as_lags, response)
    return system.replace(fit=replace(fit, verdicts=judged))


def _total_delay(system: DelayedStateSpace) -> float | None:
    """Total delay in s: first moment of the pulse response, minus half a sample for the hold."""
    core: ct.StateSpace = system.delay_free
    inside = np.eye(core.nstates) - core.A
    states = np.linalg.solve(inside, core.B)
    total = float((core.D + core.C @ states)[0, 0])
    first = float((core.C @ np.linalg.solve(inside, states))[0, 0])
    # rounding error of a plant whose gain is zero
    nothing = _ROUNDING * float((np.abs(core.D) + np.abs(core.C) @ np.abs(states))[0, 0])
    if abs(total) <= nothing or not np.isfinite(first / total):
        return None
    return float((_delay(system) + first / total - 0.5) * system.dt)
