"""The commands with their options; what they do is loaded when one of them runs.

Loading python-control and its dependencies takes seconds, which ``--help``, ``--version`` and a
misspelt option need not wait for.
"""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

import typer

from . import options as o
from .files import check_files, given
from .loading import loading


def identify(
    files: o.Files,
    output: o.Folder,
    method: o.MethodOption = o.Method.output_error,
    order: o.Order = None,
    max_delay: o.MaxDelay = None,
    structures: o.Structures = None,
    samples: o.Samples = None,
    cutoff_hz: o.CutoffHz = None,
    frf: o.Frf = None,
    joint: o.Joint = False,
    gains: o.GainsOption = None,
    actuator: o.ActuatorOption = None,
    separate: o.Separate = False,
    by: o.By = None,
    split: o.Split = False,
    time: o.Time = None,
    input_column: o.Input = None,
    output_column: o.OutputColumn = None,
    dt: o.Dt = None,
    time_unit: o.TimeUnit = None,
    time_format: o.TimeFormat = None,
    start: o.From = None,
    stop: o.To = None,
    missing: o.MissingOption = None,
    na_values: o.NaValues = None,
    quality: o.Quality = None,
    good: o.Good = None,
    resample: o.Resample = False,
    rest: o.Rest = None,
    delimiter: o.Delimiter = None,
    decimal: o.Decimal = None,
    encoding: o.Encoding = None,
    comment: o.Comment = None,
    no_header: o.NoHeader = False,
    skip_rows: o.SkipRows = None,
    variable: o.Variable = None,
    max_bytes: o.MaxBytes = None,
    frequency: o.Frequency = None,
    magnitude: o.Magnitude = None,
    phase: o.Phase = None,
    real: o.Real = None,
    imag: o.Imag = None,
    frequency_unit: o.FrequencyUnit = None,
    magnitude_unit: o.MagnitudeUnit = None,
    phase_unit: o.PhaseUnit = None,
    jobs: o.Jobs = None,
    no_report: o.NoReport = False,
    overwrite: o.Overwrite = False,
) -> int:
    """Identify a model with dead time from one record, or from many of one plant.

    One record gives model.json, report.html and figures/. Several records of one plant are a
    campaign: the output also contains a table of their delays (records.csv), a model for each
    (models/) and a final model. A record that fails becomes a row of the table with its error. If a
    campaign is interrupted, the finished records are kept in rows/, and the same command resumes
    from there. With --joint, one model is fitted to all records together.

    \b
    Examples:
      ctrl-realize identify step.csv -o results
      ctrl-realize identify valve_*.csv -o valve --method scan --jobs 2
      ctrl-realize identify log.txt -o out --time 0 --input current --output-column position
      ctrl-realize identify historian.csv -o out --missing keep --from "2025-02-01 08:00"
      ctrl-realize identify tests.csv -o out --by test --joint --gains own
      ctrl-realize identify step.csv -o out --frf frf.csv --joint
    """  # noqa: D301  # \b keeps the lines of the examples apart
    check_files([*files, *([frf] if frf else [])])
    with loading():
        from .identify_command import run_identify

    any_file = given(
        delimiter=delimiter, decimal=decimal, encoding=encoding, comment=comment,
        no_header=no_header, skip_rows=skip_rows, variable=variable, max_bytes=max_bytes,
    )  # fmt: skip
    reading = given(
        time=time, input=input_column, output=output_column, dt=dt, time_unit=time_unit,
        time_format=time_format, start=start, stop=stop, missing=missing, na_values=na_values,
        quality=quality, good=good, resample=resample, rest=rest,
    )  # fmt: skip
    response = given(
        frequency=frequency, magnitude=magnitude, phase=phase, real=real, imag=imag,
        frequency_unit=frequency_unit, magnitude_unit=magnitude_unit, phase_unit=phase_unit,
    )  # fmt: skip
    return run_identify(
        files,
        output,
        method=method.value,
        choices=given(
            order=order,
            max_delay=max_delay,
            structures=structures,
            samples=samples,
            cutoff_hz=cutoff_hz,
            gains=gains,
            actuator=actuator,
        ),
        frf=frf,
        joint=joint or gains is not None,
        separate=separate,
        tests=given(by=by, split=split),
        reading=reading | any_file,
        response=response,
        jobs=jobs,
        report=not no_report,
        overwrite=overwrite,
    )


def compare(
    model: Annotated[Path, typer.Argument(help="Model file written by identify: model.json.")],
    frf: Annotated[Path, typer.Argument(help="Measured frequency response: CSV, TSV, .mat, .npz.")],
    output: o.MaybeFolder = None,
    min_coherence: o.MinCoherence = None,
    band: o.Band = None,
    hold: o.HoldOption = o.Hold.auto,
    frequency: o.Frequency = None,
    magnitude: o.Magnitude = None,
    phase: o.Phase = None,
    real: o.Real = None,
    imag: o.Imag = None,
    frequency_unit: o.FrequencyUnit = None,
    magnitude_unit: o.MagnitudeUnit = None,
    phase_unit: o.PhaseUnit = None,
    delimiter: o.Delimiter = None,
    decimal: o.Decimal = None,
    encoding: o.Encoding = None,
    comment: o.Comment = None,
    no_header: o.NoHeader = False,
    skip_rows: o.SkipRows = None,
    variable: o.Variable = None,
    max_bytes: o.MaxBytes = None,
    no_report: o.NoReport = False,
    overwrite: o.Overwrite = False,
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
    with loading():
        from .compare_command import run_compare

    reading = given(
        frequency=frequency, magnitude=magnitude, phase=phase, real=real, imag=imag,
        frequency_unit=frequency_unit, magnitude_unit=magnitude_unit, phase_unit=phase_unit,
        delimiter=delimiter, decimal=decimal, encoding=encoding, comment=comment,
        no_header=no_header, skip_rows=skip_rows, variable=variable, max_bytes=max_bytes,
    )  # fmt: skip
    choices: dict[str, Any] = {"min_coherence": min_coherence, "band_hz": band, "hold": hold.value}
    return run_compare(
        model, frf, output,
        choices=choices, reading=reading, report=not no_report, overwrite=overwrite,
    )  # fmt: skip


def valve(
    files: o.Files,
    output: o.Folder,
    command_range: o.CommandRange = None,
    travel_range: o.TravelRange = None,
    limit: o.Limit = None,
    no_fit: o.NoFit = False,
    by: o.By = None,
    split: o.Split = False,
    time: o.Time = None,
    input_column: o.Input = None,
    output_column: o.OutputColumn = None,
    dt: o.Dt = None,
    time_unit: o.TimeUnit = None,
    time_format: o.TimeFormat = None,
    start: o.From = None,
    stop: o.To = None,
    na_values: o.NaValues = None,
    quality: o.Quality = None,
    good: o.Good = None,
    resample: o.Resample = False,
    rest: o.Rest = None,
    delimiter: o.Delimiter = None,
    decimal: o.Decimal = None,
    encoding: o.Encoding = None,
    comment: o.Comment = None,
    no_header: o.NoHeader = False,
    skip_rows: o.SkipRows = None,
    variable: o.Variable = None,
    max_bytes: o.MaxBytes = None,
    no_report: o.NoReport = False,
    overwrite: o.Overwrite = False,
) -> int:
    """Measure the metrics of a step test of a control valve.

    The input is the command, the output the position of the stem, or a process variable. Steps,
    staircases, full strokes and ramps are found in the command; dead time, T63, T86, T98,
    overshoot, gain, dead band, resolution, hysteresis, linearity and stroke times come with 95 %
    intervals, against step size and direction. What the records cannot tell is listed with the
    test that is missing. The output contains report.html, metrics.csv, sizes.csv, steps.csv and
    figures/.

    \b
    Examples:
      ctrl-realize valve test.csv -o valve --command-range 0 100 --travel-range 0 100
      ctrl-realize valve step_*.csv -o valve --command-range 4 20 --limit dead_band=1
      ctrl-realize valve test.csv -o valve --input command --output-column stem --limit t86@2=0.4
    """  # noqa: D301  # \b keeps the lines of the examples apart
    check_files(files)
    with loading():
        from .valve.command import run_valve

    reading = given(
        time=time, input=input_column, output=output_column, dt=dt, time_unit=time_unit,
        time_format=time_format, start=start, stop=stop, na_values=na_values, quality=quality,
        good=good, resample=resample, rest=rest, delimiter=delimiter, decimal=decimal,
        encoding=encoding, comment=comment, no_header=no_header, skip_rows=skip_rows,
        variable=variable, max_bytes=max_bytes,
    )  # fmt: skip
    choices: dict[str, Any] = given(command_range=command_range, travel_range=travel_range)
    return run_valve(
        files, output, choices=choices | ({"fit": False} if no_fit else {}), limits=limit or (),
        tests=given(by=by, split=split), reading=reading, report=not no_report,
        overwrite=overwrite,
    )  # fmt: skip


def demo(
    output: o.Folder,
    seed: Annotated[int, typer.Option(min=0, help="Seed of the random numbers.")] = 1,
    jobs: Annotated[int, typer.Option(help="Number of processes; -1: all cores.")] = 1,
    no_report: o.NoReport = False,
    overwrite: o.Overwrite = False,
) -> int:
    """Reproduce the paper from start to end, on simulated data.

    Forty steps and a stepped sine of 500 x 5 points are simulated on a valve with a known dead time
    of 16.1 samples, on which the paper's method finds the 37 samples of the paper. It gives
    Table 1, Figs. 2-8 and its final model; the output-error fit of one record gives a better one.
    The output contains report.html, model.json, table_1.csv, figures/ and more.

    \b
    Examples:
      ctrl-realize demo -o demo
      ctrl-realize demo -o demo --seed 7 --jobs 2
    """  # noqa: D301  # \b keeps the lines of the examples apart
    with loading():
        from .demo_command import run_demo_command

    return run_demo_command(output, seed, jobs, report=not no_report, overwrite=overwrite)
