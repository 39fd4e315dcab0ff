"""Where to read on from an entry of the reference: pages of the user guide, and neighbours.

`PAGES` is the one place that ties names to pages; a test asks that every entry has a page and that
every page exists. Neighbours are the public names that a docstring mentions, and those whose
docstrings mention it.
"""

from __future__ import annotations

import inspect
import re
from fnmatch import fnmatchcase
from functools import cache
from importlib import import_module

PAGES: dict[str, tuple[str, ...]] = {
    "identify": ("tutorial", "howto/trust_delay", "howto/choose_order"),
    "app": ("howto/app",),
    "identify_campaign": ("howto/several_records", "howto/cluster"),
    "identification.identify_each": ("howto/several_records", "howto/cluster"),
    "Campaign": ("howto/several_records",),
    "identification.CampaignRow": ("howto/several_records",),
    "identification.RecordGains": ("howto/several_records",),
    "identification.ActuatorFit": ("howto/actuator", "theory/actuators"),
    "fit_output_error": ("theory/output_error", "howto/process_models"),
    "identification.OutputErrorFit": ("howto/process_models", "howto/trust_delay"),
    "identification.NoiseModel": ("howto/noisy_data",),
    "identification.PlausibleModels": ("verdicts",),
    "identification.ProcessStructure": ("howto/process_models",),
    "fit_state_space": ("howto/several_channels", "howto/random_inputs"),
    "identification.*state_space": ("howto/several_channels",),
    "identification.*everal*nputs*": ("howto/several_channels",),
    "plots.several_inputs_plot": ("howto/several_channels",),
    "design.*eedforward": ("howto/several_channels", "howto/tune_pid"),
    "identification.StateSpaceFit": ("howto/several_channels",),
    "identification.*[mM]imo*": ("howto/several_channels",),
    "identification.delay_matrix": ("howto/several_channels",),
    "identification.fit_joint": ("howto/frequency_responses",),
    "identification.JointFit": ("howto/frequency_responses",),
    "DelayTracker": ("howto/on_line",),
    "identification.Track*": ("howto/on_line",),
    "estimate_delay": ("howto/check_the_delay", "theory/realization"),
    "realize": ("theory/realization",),
    "scan_orders": ("howto/choose_order",),
    "identification.*Scan": ("howto/choose_order",),
    "identification.Realization": ("theory/realization",),
    "read_record": ("howto/own_csv", "howto/historian"),
    "io.read_records": ("howto/several_tests", "howto/historian"),
    "read_frf": ("howto/frequency_responses",),
    "Record": ("howto/own_csv", "howto/units", "howto/missing_samples"),
    "MeasuredFRF": ("howto/frequency_responses",),
    "ImpulseResponse": ("howto/other_inputs",),
    "data.ImpulseEstimate": ("howto/other_inputs",),
    "data.StepEdge": ("howto/noisy_data",),
    "data.StepResponse": ("howto/noisy_data",),
    "data.FilterSpec": ("theory/filter_delay",),
    "detect_step": ("howto/noisy_data",),
    "unit_step": ("howto/noisy_data",),
    "impulse_from_step": ("theory/filter_delay",),
    "impulse_from_io": ("howto/other_inputs", "howto/random_inputs"),
    "impulse_from_frf": ("howto/frequency_responses",),
    "compare": ("howto/process_models",),
    "validation.ModelComparison": ("howto/process_models",),
    "validation.*elay*": ("howto/check_the_delay",),
    "validation.*": ("howto/random_inputs",),
    "compare_frf": ("howto/frequency_responses", "theory/frf_coherence"),
    "fit_frf": ("howto/frequency_responses",),
    "spectral_frf": ("howto/frequency_responses", "theory/frf_coherence"),
    "stepped_sine_frf": ("howto/frequency_responses", "theory/frf_coherence"),
    "frequency.*": ("howto/frequency_responses",),
    "delay": ("howto/dead_time",),
    "exp": ("howto/dead_time",),
    "extend_control": ("howto/dead_time", "python_control_notes"),
    "design.ControlExtension": ("howto/dead_time", "python_control_notes"),
    "delayed_ss": ("howto/dead_time", "howto/closed_loop"),
    "interconnect": ("howto/dead_time",),
    "DelayedStateSpace": ("howto/closed_loop", "howto/dead_time"),
    "DelaySystem": ("howto/dead_time",),
    "save_model": ("howto/export",),
    "load_model": ("howto/export",),
    "io.CampaignStore": ("howto/several_records", "howto/cluster"),
    "io.FitSummary": ("howto/export",),
    "design.*[pP][iI][dD]*": ("howto/tune_pid",),
    "design.*ltimate*": ("howto/relay_test", "howto/tune_pid"),
    "design.ProcessModel": ("howto/tune_pid",),
    "design.LoopCheck": ("howto/tune_pid",),
    "design.*oop*": ("howto/tune_pid", "howto/closed_loop"),
    "design.reduce_*": ("howto/tune_pid",),
    "design.reduce": ("howto/export",),
    "design.to_*": ("howto/export",),
    "design.ContinuousModel": ("howto/export",),
    "design.pade_ss": ("howto/export",),
    "design.hankel_singular_values": ("howto/export",),
    "design.BalancedReduction": ("howto/export",),
    "design.root_locus": ("howto/dead_time",),
    "design.*": ("howto/closed_loop",),
    "export.*": ("howto/export", "howto/tune_pid"),
    "experiment.*": ("howto/which_test",),
    "plots.experiment_*": ("howto/which_test",),
    "plots.loop_*": ("howto/oscillating_loop",),
    "plots.valve_*": ("howto/valve_test",),
    "plots.*": ("pictures", "gallery"),
    "actuators.*": ("theory/actuators", "howto/actuator"),
    "datasets.*": ("datasets",),
    "bench.valve_loop": ("howto/oscillating_loop", "theory/actuators"),
    "bench.*Loop*": ("howto/oscillating_loop", "theory/actuators"),
    "bench.relay_test": ("howto/relay_test", "howto/which_test"),
    "bench.*": ("howto/which_test", "course/index"),
    "valves.*oop*": ("howto/oscillating_loop",),
    "valves.*": ("howto/valve_test",),
    "report.summary": ("howto/scripts", "verdicts"),
    "report.identification_schema": ("howto/scripts",),
    "report.*": ("howto/export",),
    "paper.*": ("paper_map",),
    "errors.*": ("howto/own_csv", "flags"),
    "CtrlRealize*": ("howto/own_csv", "flags"),
    "results.*": ("flags", "howto/trust_delay"),
}
"""Pattern of a name below `ctrl_realize` -> pages, as paths in docs; the first that fits counts."""

MOST = 6
"""Neighbours that an entry lists at most."""


def pages(entry: str) -> tuple[str, ...]:
    """Return the pages that belong to an entry, given by its full name."""
    name = entry.removeprefix("ctrl_realize.")
    return next((pages for pattern, pages in PAGES.items() if fnmatchcase(name, pattern)), ())


@cache
def _entries() -> dict[str, str]:
    """Short name, as docstrings write it, -> full name of every entry."""
    import public_names

    text = "\n".join(public_names.pages().values())
    full = re.findall(r"^   ~(ctrl_realize\.[\w.]+)$", text, re.M)
    short: dict[str, str] = {}
    for entry in full:
        parts = entry.split(".")
        for start in range(1, len(parts)):
            short.setdefault(".".join(parts[start:]), entry)
    return short


@cache
def _mentioned(entry: str) -> tuple[list[str], str]:
    """Return the entries that a docstring mentions, in their order, and its See Also section."""
    module, _, name = entry.rpartition(".")
    value = getattr(import_module(module), name)
    if not (inspect.isclass(value) or inspect.isroutine(value)):
        return [], ""
    words = inspect.cleandoc(value.__doc__ or "")
    above, _, listed = words.partition("\nSee Also\n")
    own = listed.partition("\n\n")[0]
    said = re.findall(r"(?<!`)`+(?:cr\.)?([\w.]+?)(?:\(.*?\))?`+", above + listed[len(own) :])
    said += re.findall(r"^    ?([A-Z]\w+)$", above, re.M)  # what is returned
    found = dict.fromkeys(_entries()[each] for each in said if each in _entries())
    return [each for each in found if each != entry], own


def neighbours(entry: str) -> list[str]:
    """Return the entries that a docstring mentions, then those that mention it."""
    near, own = _mentioned(entry)
    mentioning = [
        each
        for each in dict.fromkeys(_entries().values())
        if entry in _mentioned(each)[0] and ".plots." not in each
    ]
    every = dict.fromkeys([*near, *mentioning])
    return [each for each in every if each.rpartition(".")[2] not in own][:MOST]


def section(entry: str) -> str:
    """Write what stands below an entry, as reStructuredText."""
    documents = ", ".join(f":doc:`/{page}`" for page in pages(entry))
    lines = [f"Guide: {documents}"] if documents else []
    near = neighbours(entry)
    if near:
        lines.append("Names: " + ", ".join(f":py:obj:`~{each}`" for each in near))
    return "\n\n   ".join([".. seealso::", *lines]) if lines else ""


def sections() -> dict[str, str]:
    """Return full name -> what stands below it, for every entry; Sphinx can store no function."""
    return {entry: section(entry) for entry in dict.fromkeys(_entries().values())}
