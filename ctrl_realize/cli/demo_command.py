"""``ctrl-realize demo``: the paper from start to end, on the simulated valve."""

from __future__ import annotations

from pathlib import Path

from ..delayed import fit_of
from ..results import ModelFit
from .demo_files import write_demo_files
from .demo_run import SHOWN, DemoResult, run_demo
from .demo_tables import outcome_table, static_rows, table_1
from .inputs import typed_call
from .manifest import Run
from .staging import appearing
from .terminal import printable, say, working


def run_demo_command(output: Path, seed: int, jobs: int, *, report: bool, overwrite: bool) -> int:
    """Simulate, identify, write the results, and return the exit code."""
    run = Run(typed_call("demo", ["--seed", str(seed)]), overwrite=overwrite)
    with appearing(output, run) as folder:
        result = run_demo(seed, jobs)
        _say_result(result)
        with working("drawing the figures of the report" if report else "writing"):
            names = write_demo_files(folder, result, with_report=report)
    say(f"written to {printable(str(output))}: {', '.join(names)}")
    return 0


def _say_result(result: DemoResult) -> None:
    say("All data are simulated; none are measured.\n")
    say("Table 1, delays in samples: simulated valve | as printed in the paper")
    say(table_1(result))
    say()
    say(outcome_table(result))
    say()
    say("Static test of the valve (section 2.2), in % of the span")
    for name, found in static_rows(result):
        say(f"  {name:12} {found}")
    say()
    say(f"Output-error fit of {result.records[SHOWN].name}")
    say(fit_of(result.fitted, ModelFit).report())
    say()
    say(result.comparisons["fitted"].report())
    say(f"\n{result.seconds:.1f} s to simulate and identify")
