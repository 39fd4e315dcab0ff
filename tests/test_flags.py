"""A flag is raised in a world in which it is due, and in the world beside it is not.

The worlds are those of the honesty benchmark, which counts how often. Flags of
frequency responses and loops are tested beside them.
"""

import pytest

from benchmarks.honesty import runs

RESULTS = ("fit_output_error", "estimate_delay", "realize", "identify_campaign")
ELSEWHERE = {  # other tests raise them, on smaller records or beside what the flag is about
    "fit_output_error": """
        actuator_not_resolved amplitude_trend apparent_dead_time cancelled_pair
        coarse_quantisation coloured_residual cut dispersed_flow drift earlier_input
        feedback gain_not_resolved
        gains_differ held_output hum integrating inverse_response lags_differ many_lags
        marginal_decision no_common_gain no_delay_resolved no_rest not_at_rest not_linear
        not_settled onset_in_gap outliers outlying_records parameter_at_bound
        records_differ repeats_left_out structured_misfit structures_disagree
        stuck_output time_varying
    """,
    "identify_campaign": "amplitude_trend gains_differ lags_differ no_common_gain",
}
FIRST = {("fit_output_error", "noncausal"): 3}
"""First record of a world in which the flag is raised, where it is not that of seed 0."""
PLAIN = (
    "R1 to R4, white noise 0.1 to 2 %",
    "R1, noise 0.1 %",
    "max_delay=100, delay 30 to 45",
    "max_delay=40, delay 5 to 12",
    "one lag",
    "two lags, random levels, white noise 0.1 to 2 %",
    "input stored in time",
    "no such disturbance",
    "one lag asked for of R1",
    "rounded to half a noise std",
    "worlds: one_lag",
    "worlds: two_lags",
    "worlds: several_steps",
    "worlds: random_levels",
    "worlds: random_binary",
)
"""Worlds in which no flag at all is due: of every result the first one is run."""
QUIET_ELSEWHERE = ("fit_output_error, moving input", "plain")
"""tests/identification/output_error/test_any_input.py asks for no flag at all."""
CASES, QUIET, NOT_DUE = {}, {}, {}
for case in runs.FLAG_CASES:
    # steps come first; what raises a flag there looks at moving inputs as well
    result = case.result.split(",")[0]
    if result in RESULTS and case.result != "fit_output_error, moving inputs":
        if case.code not in ELSEWHERE.get(result, "").split():
            CASES.setdefault((result, case.code), case)
        world = case.result, "plain" if case.not_due in PLAIN else case.not_due
        if world != QUIET_ELSEWHERE:
            QUIET.setdefault(world, case)
        NOT_DUE.setdefault(world, set()).add(case.code)


@pytest.mark.parametrize("key", CASES, ids=": ".join)
def test_a_flag_is_raised_where_it_is_due(key):
    # a flag that is rarely due in its world is in one of eight records
    seeds = sorted(range(8), key=lambda seed: seed != FIRST.get(key, 0))
    assert any(key[1] in CASES[key].raising(seed) for seed in seeds), CASES[key].due


@pytest.mark.parametrize("world", QUIET, ids=": ".join)
def test_no_flag_is_raised_where_none_is_due(world):
    assert not NOT_DUE[world] & QUIET[world].quiet(0)
