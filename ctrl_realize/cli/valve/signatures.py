"""``ctrl-realize loop`` with its options."""

from __future__ import annotations

from .. import options as o
from ..files import check_files, given
from ..loading import loading


def loop(
    files: o.Files,
    output: o.Folder,
    process: o.ProcessOption = o.LoopKind.self_regulating,
    set_point: o.SetPoint = None,
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
    """Tell from operating data whether the valve makes a control loop oscillate.

    The input is the controller output, the output the process value. Methods of the literature
    tell whether the loop oscillates, and whether its valve sticks; the verdict may be "cannot
    tell". The output contains report.html, methods.csv and figures/.

    \b
    Examples:
      ctrl-realize loop trend.csv -o loop
      ctrl-realize loop trend.csv -o loop --input op --output-column pv --process flow
    """  # noqa: D301  # \b keeps the lines of the examples apart
    check_files(files)
    with loading():
        from .loop import run_loop

    reading = given(
        time=time, input=input_column, output=output_column, dt=dt, time_unit=time_unit,
        time_format=time_format, start=start, stop=stop, na_values=na_values, quality=quality,
        good=good, resample=resample, delimiter=delimiter, decimal=decimal, encoding=encoding,
        comment=comment, no_header=no_header, skip_rows=skip_rows, variable=variable,
        max_bytes=max_bytes,
    )  # fmt: skip
    return run_loop(
        files, output, process=process.value, set_point=set_point, reading=reading,
        report=not no_report, overwrite=overwrite,
    )  # fmt: skip
