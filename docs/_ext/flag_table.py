"""The table of all flags, read from the places in the source that raise them."""

from __future__ import annotations

import ast
from pathlib import Path

RAISED_BY = {
    "any_input_fit": "fit_output_error",
    "bootstrap": "bootstrap",
    "campaign_flags": "identify_campaign",
    "channel_fit": "fit_state_space",
    "channel_fit_result": "fit_state_space",
    "compare": "compare_frf",
    "cross_check": "compare_delay_estimates",
    "data_loops": "design.margins",
    "disagreement": "compare_frf",
    "fit_flags": "fit_output_error",
    "from_frf": "impulse_from_frf",
    "from_io": "impulse_from_io",
    "frf_selection": "fit_frf",
    "identify": "identify",
    "impulses": "realize",
    "loop_check": "design.pid",
    "margins": "design.margins",
    "long_records": "fit_state_space",
    "mode_choice": "identify",
    "model_checks": "fit_output_error",
    "model_flags": "fit_output_error",
    "pulse_regression": "impulse_from_io",
    "realization": "realize",
    "repeat_flags": "fit_output_error",
    "residuals": "analyse_residuals",
    "scan_curve": "estimate_delay",
}
"""File of the source -> public function whose results carry the flag."""

COMPOSED = {
    "outliers": "… sample(s), the first at index …, are …, far beyond the others: if that stands "
    "for a missing value, interpolate there before the fit, which they spoil",
    "outlying_records": "left out of the mean: …",
    "structured_misfit": "no model leaves only noise: the plant is not linear or has more dynamics "
    "than the model; the dead time is the median of several views and the interval spans them",
    "views_disagree": "far from the median lie: …",
}
"""Messages that are put together from parts."""


def _message(node: ast.expr, code: str) -> str:
    if isinstance(node, ast.Constant):
        return str(node.value)
    if isinstance(node, ast.JoinedStr):
        parts = (v.value if isinstance(v, ast.Constant) else "…" for v in node.values)
        return "".join(map(str, parts)).replace("……", "…")
    return COMPOSED.get(code, "…")


def flags(package: Path) -> list[tuple[str, str, str]]:
    """List code, function and message of every flag, sorted by code."""
    found = set()
    for path in package.rglob("*.py"):
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            if not (isinstance(node, ast.Call) and getattr(node.func, "id", "") == "Flag"):
                continue
            if len(node.args) > 1 and isinstance(node.args[0], ast.Constant):
                code = str(node.args[0].value)
                by = RAISED_BY.get(path.stem, path.stem)
                found.add((code, by, _message(node.args[1], code)))
    return sorted(found)


def table(package: Path) -> str:
    """Write the flags as a Markdown table; … stands for what the data bring."""
    lines = ["| flag | of | what it says |", "|---|---|---|"]
    for code, by, message in flags(package):
        words = message.replace("|", r"\|").replace("<", r"\<").replace("$", r"\$")
        lines.append(f"| `{code}` | `{by}` | {words} |")
    return "\n".join(lines) + "\n"
