"""Verdict at the top of a report: the model, its dead time, and whether to trust it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np

from .._checks import check_type
from .._facts import facts
from .._flags import Flag, in_doubt, marked
from .._wording import in_time, interval_in_time, number_within, time_within, times_in
from ..delayed import DelayedStateSpace
from ..errors import UnsuitableSystemError
from ..frequency.comparison import FRFComparison
from ..frequency.disagreement import CLOSE, FAR
from ..identification.campaign.campaign import Campaign
from ..identification.output_error.words import gain_scatter, sign_is_told
from ..identification.several_inputs_result import SeveralInputsFit
from ..plots.delays import estimate_of, interval_of
from .facts import INTEGRATING, disagreement, facts_of, formula_of, gain_of

_CONTRADICTED = "frf_disagrees"

Level = Literal["good", "caution", "poor"]

JUDGEMENTS: dict[str, dict[str, str]] = facts("report/verdicts.toml")


@dataclass(frozen=True)
class Verdict:
    """Judgement, headline, transfer function, further numbers and reasons."""

    level: Level
    headline: str
    facts: tuple[tuple[str, str], ...]
    reasons: tuple[str, ...]
    judgement: str
    formula: str = ""


def verdict_of(system: DelayedStateSpace, *, comparison: FRFComparison | None = None) -> Verdict:
    """Judge a model by the flags of its fit.

    Parameters
    ----------
    system : DelayedStateSpace
        Model with its `fit`.
    comparison : FRFComparison, optional
        Comparison of the model with a measured frequency response, with its flags.

    Returns
    -------
    Verdict
        Its ``level``, ``headline``, ``facts``, ``reasons`` and ``judgement``.

    Examples
    --------
    >>> import ctrl_realize as cr
    >>> from ctrl_realize import report
    >>> system = cr.identify(cr.bench.valve().step_record(16, rng=5), method="scan")
    >>> verdict = report.verdict_of(system)
    >>> print(verdict.level, "-", verdict.judgement)
    caution - Use with care: see the remarks below.
    """
    expected = "a model with dead time, as returned by identify"
    check_type(system, DelayedStateSpace, "system", expected, UnsuitableSystemError)
    flags = (*_flags_in(comparison), *_flags_of(system))
    return _verdict(system, flags, [*disagreement(comparison), *facts_of(system)])


def _verdict(
    system: DelayedStateSpace, flags: Sequence[Flag], facts: Sequence[tuple[str, str]]
) -> Verdict:
    codes = {flag.code for flag in flags}
    level: Level = "caution" if flags else "good"
    words = JUDGEMENTS["model"]
    judgement = words[level]
    answers = () if system.fit is None else system.fit.verdicts
    if answers:
        said = {one.question: one.level for one in answers}
        others = codes - {flag.code for flag in _flags_of(system)}
        level = "caution" if others or set(said.values()) != {"good"} else "good"
        if "no" in (said["dead time"], said["tuning"]):
            level = "poor"
        judgement = " ".join(f"{key[:1].upper()}{key[1:]}: {value}." for key, value in said.items())
        codes -= marked("wrong_dead_time")
    if codes & marked("wrong_model") or not _sign_is_told(system):
        level, judgement = "poor", words["contradicted" if _CONTRADICTED in codes else "wrong"]
    elif codes & marked("wrong_dead_time"):
        level, judgement = "poor", words["poor"]
    headline = headline_of(system)
    return Verdict(level, headline, tuple(facts), _reasons(flags), judgement, formula_of(system))


def campaign_verdict(campaign: Campaign, *, comparison: FRFComparison | None = None) -> Verdict:
    """Judge a campaign by its final model, and its flags."""
    system = campaign.system
    flags = (*_flags_in(comparison), *campaign.flags, *_flags_of(system))
    gains = np.array([row.gain for row in campaign.good], dtype=np.float64)
    facts = [*campaign._rows(), *gain_scatter(gains), *disagreement(comparison)]
    known = {label for label, _ in facts}
    facts += [fact for fact in facts_of(system) if fact[0] not in known]
    return _verdict(system, flags, facts)


def comparison_verdict(system: DelayedStateSpace, comparison: FRFComparison) -> Verdict:
    """Judge a model by its error in the trusted band."""
    error = comparison.rms_relative_error
    low, high = comparison.band_hz
    headline = (
        f"The model is within {100 * error:.3g} % (rms) of the measurement from {low:.4g} Hz to "
        f"{high:.4g} Hz."
    )
    flags = (*comparison.flags, *_flags_of(system))
    level: Level = "good" if error < CLOSE else "caution" if error < FAR else "poor"
    if level == "good" and flags:
        level = "caution"
    judgement = JUDGEMENTS["comparison"][level].format(close=100 * CLOSE, far=100 * FAR)
    return Verdict(
        level, headline, facts_of(system), _reasons(flags), judgement, formula_of(system)
    )


def _flags_in(comparison: FRFComparison | None) -> tuple[Flag, ...]:
    if comparison is None:
        return ()
    check_type(comparison, FRFComparison, "comparison", "that of compare_frf")
    return comparison.flags


def headline_of(system: DelayedStateSpace) -> str:
    """Describe the model in one sentence."""
    wait, fit, interval = estimate_of(system), system.fit, interval_of(system)
    if isinstance(fit, SeveralInputsFit):
        waits = [time_within(one.dead_time, *one.interval) for one in fit.fits]
        return f"Dead times {', '.join(map(' from '.join, zip(waits, fit.inputs, strict=True)))}."
    said, samples, within = in_time(wait, 4), f"{wait / system.dt:.4g}", ""
    if fit is not None and interval is not None:
        said = time_within(wait, *interval)
        samples = number_within(*(bound / system.dt for bound in (wait, *interval)))
        within = f", {fit.interval_label} {interval_in_time(*interval)}"
    apparent = any(flag.code == "apparent_dead_time" for flag in _flags_of(system))
    kind = "Apparent dead time" if apparent else "Dead time"
    with times_in("s"):  # as sample times are set
        step = in_time(system.dt, 6)
    sentence = f"{kind} {said} ({samples} samples of {step}){within}."
    if np.ndim(system.dead_time):  # one of a fit of all channels does not exist
        delays = "; ".join(", ".join(f"{one:g}" for one in row) for row in np.array(system.delay))
        sentence = f"Delays of {delays} samples of {step}, a row of inputs for each output."
    if formula_of(system) and _sign_is_told(system):
        return sentence
    gain = gain_of(system)
    behind = "integrating" if gain == INTEGRATING else f"gain {gain}"
    if not _sign_is_told(system):
        behind = "gain not determined"
    return f"{sentence} Model without the delay: order {system.delay_free.nstates}, {behind}."


def _sign_is_told(system: DelayedStateSpace) -> bool:
    flagged = any(flag.code == "gain_not_resolved" for flag in _flags_of(system))
    return not flagged or sign_is_told(None if system.fit is None else system.fit.gain_interval)


def _flags_of(system: DelayedStateSpace) -> tuple[Flag, ...]:
    if system.fit is None:
        return ()
    scanned = [Flag("", JUDGEMENTS["model"]["scanned"])] * (system.fit.interval_kind == "flatness")
    return (*system.fit.flags, *scanned)


def _reasons(flags: Sequence[Flag]) -> tuple[str, ...]:
    """List the flags, the worst first: those that go with wrong answers before notes."""
    wrong, late = marked("wrong_model"), marked("wrong_dead_time")

    def rank(flag: Flag) -> tuple[bool, ...]:
        code = flag.code
        return code != _CONTRADICTED, code not in wrong, not in_doubt(flag), code not in late

    ordered = sorted(flags, key=rank)
    return tuple(dict.fromkeys(_sentence(str(flag)) for flag in ordered))


def _sentence(text: str) -> str:
    return text[:1].upper() + text[1:] + ("" if text.endswith(".") else ".")
