"""The page of data sets, written from what the package stores of each."""

from __future__ import annotations

from ctrl_realize import datasets
from ctrl_realize.datasets import DataFile, DatasetInfo


def page() -> str:
    """Write a table of all sets and a section for each, as Markdown."""
    infos = [datasets.load(name).info for name in datasets.names()]
    lines = [
        "| name | plant | dead time | licence |",
        "|---|---|---|---|",
        *(
            f"| [`{info.name}`](#{info.name}) | {info.plant} | "
            f"{info.dead_time_text} | {info.licence} |"
            for info in infos
        ),
    ]
    for info in infos:
        lines += ["", *_section(info)]
    return "\n".join(lines) + "\n"


def _section(info: DatasetInfo) -> list[str]:
    kind = "Simulated" if info.simulated else "Measured"
    lines = [f"## {info.name}", "", f"{kind}: {info.plant}.", ""]
    lines += ["| file | signals | samples | read by |", "|---|---|---|---|"]
    lines += [_row(info, file) for file in info.files]
    lines += ["", f"* Dead time: {info.dead_time_text}.", *(f"* {_first(k)}." for k in info.facts)]
    lines += [
        f"* Origin: {info.origin}. Changes: {info.changes}.",
        f"* Licence: {info.licence}, {info.licence_note}.",
        f"* Citation: {info.citation}.",
    ]
    return lines


def _first(text: str) -> str:
    """Begin with a capital, unless the text begins with the name of a file."""
    return text if text.partition(":")[0].islower() and ":" in text else text[0].upper() + text[1:]


def _row(info: DatasetInfo, file: DataFile) -> str:
    signals = f"{', '.join(file.inputs)} → {', '.join(file.outputs)}"
    where = f'cr.datasets.path("{info.name}", "{file.name}")'
    if file.kind == "frf":
        return (
            f"| `{file.file}` | {signals} | {file.n_samples} frequencies | `cr.read_frf({where})` |"
        )
    options = "".join(f", {name}={value!r}" for name, value in file.reading.items())
    return (
        f"| `{file.file}` | {signals} | {file.n_samples} of {file.dt:.6g} s | "
        f"`cr.read_record({where}{options})` |"
    )
