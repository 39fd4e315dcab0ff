"""Diagnosis of an oscillating loop as a page."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Unpack

import numpy as np

from .. import plots
from .._checks import check_type
from .._wording import in_time
from ..valves.loops.result import LoopDiagnosis
from .build import About, write_report
from .page import Table, headed
from .sketches import Sketch, sketch
from .verdict import JUDGEMENTS, Level, Verdict

_LEVELS: dict[str, Level] = {"stiction": "poor", "no oscillation": "good"}


def write_loop_report(
    path: str | os.PathLike[str],
    diagnosis: LoopDiagnosis,
    *,
    title: str = "Oscillating loop",
    **about: Unpack[About],
) -> Path:
    """Write the diagnosis of a loop as a self-contained HTML file.

    Parameters
    ----------
    path : path-like
        File to write, atomically.
    diagnosis : LoopDiagnosis
        From `valves.diagnose_loop`.
    title : str, optional
    **about
        As for `write_identification`.

    Returns
    -------
    pathlib.Path

    Raises
    ------
    DataError
        `diagnosis` is not that of a loop.
    OSError
        The folder is missing or cannot be written.

    Examples
    --------
    >>> import tempfile
    >>> from pathlib import Path
    >>> import ctrl_realize as cr
    >>> from ctrl_realize import report
    >>> loop = cr.bench.valve_loop(cr.actuators.Stiction(5, 2), noise=0.1).simulate(1200.0, rng=1)
    >>> found = cr.valves.diagnose_loop(loop.record)
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     path = report.write_loop_report(Path(folder) / "loop.html", found, simulated=True)
    ...     print(path.read_text(encoding="utf-8").count("<svg "), "figures")
    4 figures
    """
    check_type(diagnosis, LoopDiagnosis, "diagnosis", "that of a loop")
    many = diagnosis.signals.op.size
    return write_report(
        path,
        title=title,
        subtitle=f"{many} samples of {in_time(diagnosis.signals.dt)}",
        verdict=_verdict(diagnosis),
        sketches=_sketches(diagnosis),
        tables=[_method_table(diagnosis)],
        records=[diagnosis.signals.record],
        **about,
    )


def _verdict(diagnosis: LoopDiagnosis) -> Verdict:
    level = _LEVELS.get(diagnosis.verdict, "caution")
    rows = [row for row in diagnosis._rows() if row[0] not in {"verdict", "because"}]
    names = {one.name for one in diagnosis.methods}
    facts = tuple(row for row in rows if row[0] not in names)
    reasons = (diagnosis.reason, *map(str, diagnosis.flags), *diagnosis.choices)
    sentence = diagnosis.verdict[0].upper() + diagnosis.verdict[1:] + "."
    return Verdict(level, sentence, facts, reasons, JUDGEMENTS["loop"][level])


def _sketches(diagnosis: LoopDiagnosis) -> list[Sketch]:
    panels = ("trend", "phase", "correlation", "shapes")
    return [sketch(one, plots.loop_diagnosis_plot, diagnosis, panel=one) for one in panels]


def _method_table(diagnosis: LoopDiagnosis) -> Table:
    rows = []
    for one in diagnosis.methods:
        known = [f"{each:.3g}" for each in (one.index, one.second_index) if np.isfinite(each)]
        said = f"{one.verdict}: {one.note}" if one.note else one.verdict
        rows.append((one.name, one.signal, ", ".join(known), one.limit, said, one.source))
    return headed("loop_methods", rows)
