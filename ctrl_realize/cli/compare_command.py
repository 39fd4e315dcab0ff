"""``ctrl-realize compare``: a model and a measured frequency response."""

from __future__ import annotations

from enum import Enum
from pathlib import Path
from typing import Annotated

import typer

from ..frequency import compare_frf
from ..io import load_model, read_frf
from ..io.text.csv_files import write_csv
from ..report import write_comparison
from .inputs import check_files, typed_call
from .manifest import Run
from .results import told_if_it_fails
from .staging import appearing
from .terminal import printable, say

_OPTION = typer.Option


class Hold(str, Enum):  # noqa: UP042  # typer shows the values of a plain str Enum
    """Treatment of the model's zero-order hold."""

    auto = "auto"
    zoh = "zoh"
    none = "none"


def compare(
    model: Annotated[Path, typer.Argument(help="Model file written by identify: model.json.")],
    frf: Annotated[Path, typer.Argument(help="Measured frequency response: CSV, TSV, .mat, .npz.")],
    output: Annotated[
        Path | None, _OPTION("--output", "-o", help="Output folder for table, report and figures.")
    ] = None,
    min_coherence: Annotated[
        float | None, _OPTION(help="Smallest coherence of a trusted point. Default: 0.95.")
    ] = None,
    band: Annotated[
        tuple[float, float] | None, _OPTION(metavar="LOW HIGH", help="Compare in this band, in Hz.")
    ] = None,
    hold: Annotated[
        Hold,
        _OPTION(
            help=(
                "zoh divides the zero-order hold out of the model; auto does so for sampled models."
            )
        ),
    ] = Hold.auto,
    frequency_unit: Annotated[str | None, _OPTION(help="Hz, kHz, MHz or rad/s.")] = None,
    magnitude_unit: Annotated[str | None, _OPTION(help="abs or dB.")] = None,
    phase_unit: Annotated[str | None, _OPTION(help="deg or rad.")] = None,
    overwrite: Annotated[
        bool, _OPTION("--overwrite", help="Overwrite the results of another run in the folder.")
    ] = False,
) -> int:
    """Compare a model with a measured frequency response.

    Gain and phase errors are those in the trusted band: by coherence, by standard deviation, or as
    given.

    \b
    Examples:
      ctrl-realize compare results/model.json frf.csv
      ctrl-realize compare results/model.json frf.csv -o frf --band 0.1 13
    """  # noqa: D301  # \b keeps the lines of the examples apart
    check_files([model, frf])
    system = load_model(model)
    measured = read_frf(
        frf,
        frequency_unit="auto" if frequency_unit is None else frequency_unit,
        magnitude_unit="auto" if magnitude_unit is None else magnitude_unit,
        phase_unit="auto" if phase_unit is None else phase_unit,
    )
    comparison = compare_frf(
        system,
        measured,
        min_coherence=min_coherence,
        band_hz=band,
        hold=None if hold is Hold.none else hold.value,
    )
    if output is not None:
        words = [str(model), str(frf)]
        if min_coherence is not None:
            words += ["--min-coherence", f"{min_coherence:g}"]
        if band is not None:
            words += ["--band", *(f"{edge:.12g}" for edge in band)]
        if hold is not Hold.auto:
            words += ["--hold", hold.value]
        for option, unit in (
            ("--frequency-unit", frequency_unit),
            ("--magnitude-unit", magnitude_unit),
            ("--phase-unit", phase_unit),
        ):
            if unit is not None:
                words += [option, unit]
        run = Run(typed_call("compare", words), (model, frf), overwrite)
        words += ["--output", str(output)]
        with appearing(output, run) as folder:
            write_csv(folder / "frf_comparison.csv", comparison.table(), index=False)
            with told_if_it_fails(folder, "the comparison") as written:
                write_comparison(
                    folder / "report.html",
                    system,
                    measured,
                    comparison,
                    files=[model, frf],
                    calls=[("In a terminal", typed_call("compare", words))],
                    figures=folder / "figures",
                )
                written.append("report.html, figures/")
    say(printable(f"{model}: {system!r}"))
    say(comparison.report())
    if output is not None:
        names = ", ".join(["frf_comparison.csv", *written])
        say(f"\nwritten to {printable(str(output))}: {names}")
    return 0 if output is None or written else 1
