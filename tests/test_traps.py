"""What a program is told of records that mislead, by ``identify --json -``."""

import json

import jsonschema
import pytest

import ctrl_realize as cr
from ctrl_realize.cli import main
from tests.traps import TRAPS

SCHEMA = cr.report.identification_schema()
FAST = ["--structures", "FOPDT", "--structures", "SOPDT"]
MISSED = set()
"""Traps that are not told today."""
CLOSE = {"dead_time": 0.35, "gain": 0.06}
"""Largest relative error of a number that a program is told to use."""


def faults(trap, content):
    """What is wrong with an answer."""
    if trap.refused:
        if content["status"] != "refused":
            return ["not refused"]
        return [] if trap.refused in content["error"]["text"] else [content["error"]["text"]]
    if content["status"] == "refused":
        return [content["error"]["text"]]
    allowed = {key: one["allowed"] for key, one in content["use"].items()}
    codes = {one["code"] for one in content["flags"]}
    assumed = content["records"][0]["time_unit_assumed"]
    told = " ".join([*content["warnings"], "assumed" * assumed])
    found = (
        [f"no flag of {trap.flags}, but {codes}"]
        if trap.flags and not codes & {*trap.flags}
        else []
    )
    found += [f"not told: {trap.told}"] if trap.told not in told else []
    found += [f"{key} is yes" for key in trap.not_yes if allowed[key] == "yes"]
    found += [f"{key} is {allowed[key]}" for key in trap.yes if allowed[key] != "yes"]
    if "dead_time" in trap.truth:
        value = content["model"]["dead_time"]["value"]
        if abs(value - trap.truth["dead_time"]) > CLOSE["dead_time"] * trap.truth["dead_time"]:
            found.append(f"dead time {value} s")
    return found


@pytest.mark.filterwarnings("default")  # they are part of the answer
@pytest.mark.parametrize("trap", TRAPS, ids=lambda trap: trap.name)
def test_a_program_is_told_of_a_trap(tmp_path, capsys, trap):
    file = tmp_path / "record.csv"
    trap.write(file)
    code = main(["identify", str(file), "--json", "-", *FAST, *trap.options])
    content = json.loads(capsys.readouterr().out)
    jsonschema.validate(content, SCHEMA)
    assert code == (2 if content["status"] == "refused" else 0)
    assert bool(faults(trap, content)) == (trap.name in MISSED), faults(trap, content)
