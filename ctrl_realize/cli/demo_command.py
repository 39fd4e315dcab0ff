"""``ctrl-realize demo``: the paper from start to end, on the simulated valve."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from ..delayed import fit_of
from ..results import ModelFit
from .demo_files import write_demo_files
from .demo_run import run_demo
from .demo_tables import outcome_table, table_1
from .inputs import typed_call
from .manifest import Run
from .staging import appearing
from .terminal import printable, say

_OPTION = typer.Option


def demo(
    output: Annotated[Path, _OPTION("--output", "-o", help="Output folder.")],
    seed: Annotated[int, _OPTION(min=0, help="Seed of the random numbers.")] = 1,
    jobs: Annotated[int, _OPTION(help="Number of processes; -1: all cores.")] = 1,
    overwrite: Annotated[
        bool, _OPTION("--overwrite", help="Overwrite the results of another run in the folder.")
    ] = False,
) -> int:
    """Reproduce the paper from start to end, on simulated data.

    Forty steps and a stepped sine of 500 x 5 points are simulated on a valve with a known dead time
    of 37 samples. The paper's method gives Table 1, Figs. 2-8 and its final model; the output-error
    fit of all records together gives a better one. The output contains report.html, model.json,
    table_1.csv, figures/ and more.

    \b
    Examples:
      ctrl-realize demo -o demo
      ctrl-realize demo -o demo --seed 7 --jobs 2
    """  # noqa: D301  # \b keeps the lines of the examples apart
    run = Run(typed_call("demo", ["--seed", str(seed)]), overwrite=overwrite)
    with appearing(output, run) as folder:
        result = run_demo(seed, jobs)
        names = write_demo_files(folder, result)
    say("All data are simulated; none are measured.\n")
    say("Table 1, delays in samples: simulated valve | as printed in the paper")
    say(table_1(result))
    say()
    say(outcome_table(result))
    say()
    say("Output-error fit of all records together")
    say(fit_of(result.fitted, ModelFit).report())
    say()
    say(result.comparisons["fitted"].report())
    say(f"\n{result.seconds:.1f} s to simulate and identify")
    say(f"written to {printable(str(output))}: {', '.join(names)}")
    return 0
