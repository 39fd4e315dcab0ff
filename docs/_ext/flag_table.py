"""The table of all flags, read from the places in the source that raise them."""

from __future__ import annotations

import ast
from pathlib import Path

RAISED_BY = {
    "design/loops/data_loops": "design.margins",
    "design/loops/loop_check": "design.pid",
    "design/loops/margins": "design.margins",
    "frequency/compare": "compare_frf",
    "frequency/disagreement": "compare_frf",
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
    "identification/state_space_fit": "fit_state_space",
    "identification/validation/bootstrap": "validation.bootstrap",
    "identification/validation/delay_estimates": "validation.compare_delay_estimates",
    "identification/validation/residuals": "validation.analyse_residuals",
    "valves": "valves.valve_report",
    "valves/loops": "valves.diagnose_loop",
    "valves/plan": "valves.valve_test_plan",
}
"""File or folder of the source -> public function whose results carry the flag."""

COMPOSED = {
    "outliers": "… sample(s), the first at index …, are …, far from the others: if this value "
    "marks missing data, replace it by NaN before the fit",
    "outlying_records": "outlying records, excluded from the mean: …",
    "frf_contradicts_records": "records and frequency response have no common model (likelihood "
    "ratio …): the joint model is outside of the 95 % circles of … points of the frequency "
    "response, by most at …, mainly from … to …, and is up to … residuals of the records away from "
    "their own model, mainly at …. Neither another gain nor another dead time explains it: the "
    "dynamics differ. The interval spans those of each alone",
    "structured_misfit": "no model fits down to the noise level: the plant is nonlinear or has "
    "unmodelled dynamics; the dead time is the median of five delay estimates and the interval is "
    "their range; actuator='auto' also fits what a valve or drive does before or behind the lags",
    "gain_not_resolved": "structures that the data cannot rule out differ in gain or total delay, "
    "or the interval of the gain contains zero",
    "actuator_not_resolved": "S, J, or another parameter of an actuator, lies between … and …, and "
    "the records do not determine it more closely; … would",
    "output_at_limit": "… samples are at …, the output saturates there: they were left out of the "
    "fit, and what the plant does beyond is extrapolated; or gain and lags are those of the "
    "clipped signal",
    "estimates_disagree": "delay estimates far from their median: …",
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
                place = path.relative_to(package).with_suffix("").as_posix()
                by = RAISED_BY.get(place) or RAISED_BY[place.rpartition("/")[0]]
                found.add((code, by, _message(node.args[1], code)))
    return sorted(found)


def table(package: Path) -> str:
    """Write the flags as a Markdown table; … stands for what the data bring."""
    lines = ["| flag | of | what it says |", "|---|---|---|"]
    for code, by, message in flags(package):
        words = message.replace("|", r"\|").replace("<", r"\<").replace("$", r"\$")
        lines.append(f"| `{code}` | `{by}` | {words} |")
    return "\n".join(lines) + "\n"
