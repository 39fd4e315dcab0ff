"""The lane of coverage and alarms: every flag has its worlds, rates are right, runs go on."""

import math
import tomllib
from pathlib import Path

import numpy as np
import pytest

import ctrl_realize as cr
from benchmarks.honesty import runs, tables, worlds
from benchmarks.honesty.trial import Seen

WORDS = Path(cr.__file__).parent / "flags.toml"
FLAGS = set(tomllib.loads(WORDS.read_text(encoding="utf-8")))


def test_every_flag_of_the_package_has_a_world_in_which_it_is_due():
    elsewhere = {
        "may_be_at_limit",  # tests/identification/output_error/test_limits.py
        "actuator_not_resolved",  # tests/identification/output_error/test_actuated.py
        *("late_input", "not_exciting"),  # tests/identification/output_error/test_any_input.py
        "not_converged",  # tests/identification/test_several_inputs.py
        "swapped",  # tests/test_traps.py
        *("closed_loop", "small_set_point"),  # tests/identification/output_error/test_loops.py
        "sensitive",  # tests/design/test_loop_check.py
        "sensitive_within_interval",  # tests/design/test_loop_check.py
        "unstable_within_interval",  # tests/design/test_loop_check.py
        "frf_contradicts_records",  # tests/identification/joint/test_joint_fit.py
        # tests/valves/test_valve_tests.py
        *("dead_time_varies", "did_not_move", "no_valve_test", "operation_fit", "plan_incomplete"),
        "range_in_doubt",
        # tests/valves/test_loop_diagnosis.py
        *("constant_signal", "few_cycles", "few_samples_per_cycle", "filled_samples"),
        *("missing_samples", "saturated_output", "set_point_moves"),
    }
    assert FLAGS - {case.code for case in runs.FLAG_CASES} == elsewhere
    assert {case.code for case in runs.FLAG_CASES} <= FLAGS


@pytest.mark.parametrize(("hits", "total"), [(0, 20), (19, 20), (950, 1000), (7, 7)])
def test_the_interval_of_a_rate_is_the_set_of_rates_whose_score_test_passes(hits, total):
    low, high = tables.wilson(hits, total)
    for end in (low, high):
        if 0 < end < 1:
            score = abs(hits / total - end) / math.sqrt(end * (1 - end) / total)
            assert score == pytest.approx(1.96, rel=1e-9)
    assert low <= hits / total <= high


@pytest.mark.parametrize("name", worlds.WRONG + worlds.MORE_WRONG)
def test_wrong_structures_rest_until_the_delay_is_over_and_settle_at_one(name):
    time = worlds.DT * (np.arange(2000) - 100.0)
    step = worlds.wrong_step(name, time)
    assert np.abs(step[:100]).max() < 1e-9
    assert step[-1] == pytest.approx(1.0, abs=1e-3)


CHEAP = [
    ("tracked", "white", "R2", 0.005, 0),
    ("pulses", "coloured", "two lags", 0.01, 0),
    ("sines", "quantised", "two lags", 0.01, 0),
    ("noise spectra", "white", "two lags", 0.01, 0),
    next(task for task in runs.flag_tasks(1) if runs.family(task) == "analyse_residuals"),
]


def test_a_run_that_was_stopped_goes_on_with_the_same_result(tmp_path):
    path = tmp_path / "cases.jsonl"
    first = runs.run(CHEAP[:2], runs.Store(path), 1)
    assert len(path.read_text().splitlines()) == 2
    kept = path.read_text()
    again = runs.run(CHEAP, runs.Store(path), 1)
    assert path.read_text().startswith(kept)
    assert again[:2] == first
    assert [one.key for one in again] == CHEAP
    assert not any(one.failed for one in again)
    assert runs.run(CHEAP[2:4], runs.Store(None), 1) == again[2:4]


def test_tables_count_what_was_seen():
    hit = Seen("pulses", "white", "R1", 0.001, 0, {"band": 1.0})
    miss = Seen("pulses", "white", "R1", 0.001, 1, {"band": 0.0})
    refused = Seen("pulses", "white", "R1", 0.001, 2, failed="DataError: too | short")
    row = tables.interval_table([hit, miss, refused])[-1]
    assert row == "| band | white | 50 % |  |  |  | 50 (9.5–90.5) % | 2 |"
    assert r"1 of 3 | DataError: too \| short" in tables.refusal_table([hit, miss, refused])[-1]
    case = runs.FLAG_CASES[0]
    due, not_due = (runs.world(case, side) for side in ("due", "not due"))
    flags = [
        Seen("flag", due, "due", 0.0, 0, flags=[case.code]),
        Seen("flag", due, "due", 0.0, 1),
        Seen("flag", not_due, "not due", 0.0, 0),
    ]
    row = tables.flag_table(flags)[-1]
    assert "| 50 (9.5–90.5) % |" in row
    assert "| 0 (0–79.3) % | 2 |" in row


def test_the_row_of_single_fits_tells_side_and_silence_of_its_misses():
    def fit(seed: int, *, covers: float, late: float, silent: float) -> Seen:
        numbers = {"error": 1.0, "width": 4.0, "early": 1 - covers - late, "late": late}
        numbers |= {"noise level": 1.0, "silent miss": silent}
        covered = {"interval": covers, "std": covers}
        return Seen("fit", "white", "R1", 0.001, seed, covered, numbers)

    seen = [fit(k, covers=1.0, late=0.0, silent=0.0) for k in range(3)]
    row = tables.fit_tables([*seen, fit(3, covers=0.0, late=1.0, silent=1.0)])[2]
    assert row.startswith("| white | 0.1 % | 4 | 75 (30.1–95.4) % | ")
    assert "| 25 (4.6–69.9) % | 75 (30.1–95.4) % |" in row
