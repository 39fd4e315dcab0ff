"""The commands with their options; what they do is loaded when one of them runs.

Loading python-control and its dependencies takes seconds, which ``--help``, ``--version`` and a
misspelt option need not wait for. Each has the arguments of the function that is named beside it.
"""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from . import options as o
from .files import check_files, command
from .loading import loading


@command(".look_command", "run_look")
def look(
    file: Annotated[Path, typer.Argument(help="Record: CSV, TSV, LVM, .xlsx, .mat, .npz, ...")],
    *,
    record: o.Given,
) -> None:
    """Show which column of a file is taken as what, and the record that it gives.

    With the options of the other commands that say otherwise. What was guessed is told on stderr.

    \b
    Examples:
      ctrl-realize look log.csv
      ctrl-realize look log.csv --input valve --output-column level --time-unit ms
    """  # noqa: D301  # \b keeps the lines of the examples apart


@command(".identify_command", "run_identify")
def identify(
    files: o.Files,
    folder: o.Folder = None,
    *,
    frf: o.Frf = None,
    joint: o.Joint = False,
    separate: o.Separate = False,
    chosen: o.Given,
    tests: o.Given,
    record: o.Given,
    response: o.Given,
    jobs: o.Jobs = None,
    require: o.Require = None,
    tune: o.Tune = None,
    json: o.Json = None,
    written: o.Given,
) -> None:
    """Identify a model with dead time from one record, or from many of one plant.

    Model, verdicts and what leads to them are told; with --output, one record gives model.json,
    report.html and figures/. Several records of one plant are a campaign: the output also contains
    a table of their delays (records.csv), a model for each (models/) and a final model. A record
    that fails becomes a row of the table with its error. If a campaign is interrupted, the finished
    records are kept in rows.sqlite, and the same command resumes from there. With --joint, or
    --gains own, one model is fitted to all records together. With --tune, the report also has a
    controller, see the command tune. With --json -, a program reads the model, its verdicts and
    what may be done with it from stdout.

    \b
    Examples:
      ctrl-realize identify step.csv
      ctrl-realize identify step.csv -o results
      ctrl-realize identify valve_*.csv -o valve --method scan --jobs 2
      ctrl-realize identify log.txt -o out --time 0 --input current --output-column position
      ctrl-realize identify historian.csv -o out --missing keep --from "2025-02-01 08:00"
      ctrl-realize identify tests.csv -o out --by test --joint --gains own
      ctrl-realize identify step.csv -o out --frf frf.csv --joint
      ctrl-realize identify step.csv --json - --require tuning
    """  # noqa: D301  # \b keeps the lines of the examples apart


@command(".identify_command", "run_tune")
def tune(
    files: o.Files,
    folder: o.Folder = None,
    *,
    entered: o.Given,
    tuned: o.Given,
    chosen: o.Given,
    tests: o.Given,
    record: o.Given,
    require: o.Require = None,
    written: o.Given,
) -> None:
    """Tune a PID controller from records of its plant, and tell what to enter.

    One model is identified from all records, or was saved before (model.json). The controller is
    checked on it and on the models that fit the records as well; what would make the loop unstable
    is listed. With an output folder, the report shows the closed loop with the output of the
    controller for all of these models.

    \b
    Examples:
      ctrl-realize tune step.csv --form siemens_pid_compact
      ctrl-realize tune model.json --form siemens_pid_compact
      ctrl-realize tune step.csv --form emerson_deltav_series --measured-range 0 400 --kind PID
      ctrl-realize tune tests.csv -o out --by test --rule lambda --closed-loop-time 120
    """  # noqa: D301  # \b keeps the lines of the examples apart


@command(".compare_command", "run_compare")
def compare(
    model: Annotated[Path, typer.Argument(help="Model file written by identify: model.json.")],
    frf: Annotated[Path, typer.Argument(help="Measured frequency response: CSV, TSV, .mat, .npz.")],
    folder: o.Folder = None,
    *,
    compared: o.Given,
    response_file: o.Given,
    written: o.Given,
) -> None:
    """Compare a model with a measured frequency response.

    Gain and phase errors are those in the trusted band: by coherence, by standard deviation, or as
    given.

    \b
    Examples:
      ctrl-realize compare results/model.json frf.csv
      ctrl-realize compare results/model.json frf.csv -o frf --band 0.1 13
    """  # noqa: D301  # \b keeps the lines of the examples apart


@command(".valve.command", "run_valve")
def valve(
    files: o.Files,
    folder: o.Folder = None,
    *,
    measured: o.Given,
    limit: o.Limit = None,
    tests: o.Given,
    record: o.Given,
    written: o.Given,
) -> None:
    """Measure the metrics of a step test of a control valve.

    The input is the command, the output the position of the stem, or a process variable. Steps,
    staircases, full strokes and ramps are found in the command; dead time, T63, T86, T98,
    overshoot, gain, dead band, resolution, hysteresis, linearity and stroke times come with 95 %
    intervals, against step size and direction. What the records cannot tell is listed with the
    test that is missing. With --output, the folder has report.html, metrics.csv, sizes.csv,
    steps.csv and figures/.

    \b
    Examples:
      ctrl-realize valve test.csv -o valve --command-range 0 100 --travel-range 0 100
      ctrl-realize valve step_*.csv -o valve --command-range 4 20 --limit dead_band=1
      ctrl-realize valve test.csv -o valve --input command --output-column stem --limit t86@2=0.4
    """  # noqa: D301  # \b keeps the lines of the examples apart


@command(".valve.loop", "run_loop")
def loop(
    files: o.Files, folder: o.Folder = None, *, diagnosed: o.Given, trend: o.Given, written: o.Given
) -> None:
    """Tell from operating data whether the valve makes a control loop oscillate.

    The input is the controller output, the output the process value. Methods of the literature
    tell whether the loop oscillates, and whether its valve sticks; the verdict may be "cannot
    tell". With --output, the folder has report.html, methods.csv and figures/.

    \b
    Examples:
      ctrl-realize loop trend.csv
      ctrl-realize loop trend.csv -o loop --input op --output-column pv --process flow
    """  # noqa: D301  # \b keeps the lines of the examples apart


def app(files: o.MaybeFiles = None, *, no_browser: o.NoBrowser = False, port: o.Port = 0) -> None:
    """Open a page on this machine: drag dead time, lags and gain, and see the loop that they give.

    The page is served to this machine alone, under an address with a token; nothing is loaded from
    elsewhere, and nothing leaves the machine. Data are read, models fitted and controllers tuned by
    the functions behind the other commands; the page shows the lines of Python that do the same.

    \b
    Examples:
      ctrl-realize app
      ctrl-realize app step.csv frf.csv
      ctrl-realize app work.json --no-browser
    """  # noqa: D301  # \b keeps the lines of the examples apart
    paths = files or []
    check_files(paths)
    with loading():
        from ..interactive.server import serve
        from .terminal import say
    serve(paths, say=say, browser=not no_browser, port=port)
