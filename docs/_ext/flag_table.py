"""The table of all flags: their words, and the functions in the source that raise them."""

from __future__ import annotations

import ast
import re
import tomllib
from pathlib import Path

RAISED_BY = {
    "_flags": "fit_output_error",
    "design/loops/data_loops": "design.margins",
    "design/loops/loop_check": "design.pid",
    "design/loops/margins": "design.margins",
    "frequency/compare": "compare_frf",
    "frequency/disagreement": "compare_frf",
    "frequency/points": "compare_frf",
    "frequency/from_frf": "impulse_from_frf",
    "frequency/frf_selection": "fit_frf",
    "identification/campaign": "identify_campaign",
    "identification/impulse": "impulse_from_io",
    "identification/joint": "identification.fit_joint",
    "identification/long_records": "fit_state_space",
    "identification/methods": "identify",
    "identification/model_class": "identify",
    "identification/output_error": "fit_output_error",
    "identification/output_error/actuated": "fit_output_error",
    "identification/realization": "realize",
    "identification/realization/scan_curve": "estimate_delay",
    "identification/several_inputs_result": "identification.fit_several_inputs",
    "identification/state_space_fit": "fit_state_space",
    "identification/validation/delay_estimates": "validation.compare_delay_estimates",
    "identification/validation/residuals": "validation.analyse_residuals",
    "valves": "valves.valve_report",
    "valves/loops": "valves.diagnose_loop",
    "valves/plan": "valves.valve_test_plan",
}
"""File or folder of the source -> public function whose results carry the flag."""


def keys(call: ast.Call) -> list[str]:
    """Keys of the table with which a flag may be made."""
    constants = [one for one in ast.walk(call.args[0]) if isinstance(one, ast.Constant)]
    return [one.value for one in constants if isinstance(one.value, str)]


def flags(package: Path) -> list[tuple[str, str, str]]:
    """List code, function and message of every flag, sorted by code."""
    words = tomllib.loads((package / "flags.toml").read_text(encoding="utf-8"))
    found = set()
    for path in package.rglob("*.py"):
        place = path.relative_to(package).with_suffix("").as_posix()
        source = path.read_text(encoding="utf-8")
        for node in ast.walk(ast.parse(source)) if "flagged(" in source else ():
            if isinstance(node, ast.Call) and getattr(node.func, "id", "") == "flagged":
                by = RAISED_BY.get(place) or RAISED_BY[place.rpartition("/")[0]]
                for code, _, case in (key.partition(".") for key in keys(node)):
                    said = re.sub(r"\{[^}]*\}", "…", words[code][case or "words"])
                    found.add((code, by, said))
    return sorted(found)


def table(package: Path) -> str:
    """Write the flags as a Markdown table; … stands for what the data bring."""
    lines = ["| flag | of | what it says |", "|---|---|---|"]
    for code, by, message in flags(package):
        words = message.replace("|", r"\|").replace("<", r"\<").replace("$", r"\$")
        lines.append(f"| `{code}` | `{by}` | {words} |")
    return "\n".join(lines) + "\n"
