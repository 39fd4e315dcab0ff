"""Pages of the API reference, written from the package itself, so that no name is forgotten."""

from __future__ import annotations

import inspect
from importlib import import_module
from pathlib import Path
from types import ModuleType
from typing import Any, get_origin

GROUPS: dict[str, tuple[str, str, tuple[str, ...]]] = {
    "data": (
        "Data",
        "What was measured, and reading it from files.",
        ("ctrl_realize.data", "ctrl_realize.io.records", "ctrl_realize.io.frf"),
    ),
    "steps": (
        "From data to an impulse response",
        "Each step of the method is a plain function.",
        (
            "ctrl_realize.identification.step.steps",
            "ctrl_realize.identification.step.impulse",
            "ctrl_realize.identification.impulse.from_io",
            "ctrl_realize.data.impulse_estimate",
            "ctrl_realize.frequency.from_frf",
        ),
    ),
    "identification": (
        "Models and their dead time",
        "Functions return the model itself; how it was found is in its `.fit`.",
        ("ctrl_realize.identification", "ctrl_realize.numerics"),
    ),
    "validation": (
        "Validation",
        "How far a model is to be trusted.",
        ("ctrl_realize.identification.validation",),
    ),
    "systems": (
        "Systems with dead time",
        "A `control.StateSpace` that keeps its dead time beside the core; saving and loading.",
        ("ctrl_realize.delayed", "ctrl_realize.io"),
    ),
    "frequency": (
        "Frequency responses",
        "From records to a measured frequency response, and a model beside it.",
        ("ctrl_realize.frequency",),
    ),
    "errors": (
        "Results, flags and errors",
        "What all results share, and what can go wrong.",
        ("ctrl_realize.errors", "ctrl_realize.results"),
    ),
}
"""Page -> title, one line, and the modules whose names it lists (longest prefix wins)."""

PLACES = ("data", "identification", "validation", "frequency", "io", "errors", "results")
"""Public modules whose names are sorted into the pages above."""

DEFINING = ("errors", "results")
"""Those that offer what they define, and no more."""

SUBMODULES = {
    "design": "Controllers for plants with dead time.",
    "export": "Controllers and models for other programs: PLC, C, Python, MATLAB, FMI.",
    "plots": "What each of them draws is on [Pictures](../../pictures.md).",
    "actuators": "Models of stiction, backlash, slew limits and characteristics.",
    "datasets": "What is known of each set is on [Data sets](../../datasets.md).",
    "bench": "Simulated set-ups with known truth.",
    "experiment": "Which input tells most, and how closely; predicted and achieved errors.",
    "valves": "Step tests of control valves: metrics, report, test plan; oscillating loops.",
    "report": "HTML reports: one self-contained file, the verdict first.",
    "paper": "Every number that the paper prints.",
}


def public(module: ModuleType) -> dict[str, Any]:
    """Names that a user may write after the module's name, modules themselves left out."""
    # The package loads its names when they are asked for, so they are asked for one by one.
    every = {
        name: getattr(module, name) for name in sorted(getattr(module, "__all__", dir(module)))
    }
    return {
        name: value
        for name, value in every.items()
        if not name.startswith("_")
        and not inspect.ismodule(value)
        and name not in ("annotations", "import_module", "Any", "Literal", "dataclass")
        and _belongs(value, module)
    }


def _belongs(value: Any, module: ModuleType) -> bool:
    home = getattr(value, "__module__", None)
    if get_origin(value) is not None:  # aliases of types
        return False
    if home is None or not (inspect.isclass(value) or inspect.isroutine(value)):
        # Data: settings and tables of the module itself.
        return module.__name__ == "ctrl_realize.paper"
    return str(home).startswith("ctrl_realize")


def group_of(value: Any) -> str:
    home = str(getattr(value, "__module__", ""))
    fitting = {
        prefix: page
        for page, (_, _, prefixes) in GROUPS.items()
        for prefix in prefixes
        if home == prefix or home.startswith(prefix + ".")
    }
    return fitting[max(fitting, key=len)] if fitting else "errors"


def pages() -> dict[str, str]:
    """Name of each page -> its MyST text."""
    package = import_module("ctrl_realize")
    sorted_names: dict[str, list[str]] = {page: [] for page in GROUPS}
    for name, value in public(package).items():
        sorted_names[group_of(value)].append(f"ctrl_realize.{name}")
    # What is not at the top level stands under the module that offers it.
    for place in PLACES:
        module_name = f"ctrl_realize.{place}"
        for name, value in public(import_module(module_name)).items():
            at_home = place not in DEFINING or getattr(value, "__module__", "") == module_name
            if at_home and not hasattr(package, name):
                sorted_names[group_of(value)].append(f"{module_name}.{name}")
    texts = {
        page: _page(title, line, sorted_names[page]) for page, (title, line, _) in GROUPS.items()
    }
    for name, line in SUBMODULES.items():
        module = import_module(f"ctrl_realize.{name}")
        names = [f"ctrl_realize.{name}.{each}" for each in public(module)]
        texts[name] = _page(f"`{name}`", line, names, about=(module.__doc__ or "").split("\n")[0])
    return texts


def _page(title: str, line: str, names: list[str], about: str = "") -> str:
    ordered = sorted(names, key=lambda name: (_is_class(name), name.lower()))
    # The module's own first sentence often says the same, and more.
    lines = [about] if about.startswith(line.rstrip(".")) else [line, about]
    text = [f"# {title}", ""]
    text += [part for said in lines if said for part in (said, "")]
    text += ["```{eval-rst}", ".. autosummary::", "   :toctree: entries", "   :nosignatures:", ""]
    text += [f"   ~{name}" for name in ordered]
    return "\n".join([*text, "```", ""])


def _is_class(full: str) -> bool:
    module, _, name = full.rpartition(".")
    return inspect.isclass(getattr(import_module(module), name, None))


def write_pages(folder: Path) -> None:
    folder.mkdir(parents=True, exist_ok=True)
    for name, text in pages().items():
        path = folder / f"{name}.md"
        # Unchanged pages are not touched, so that a second build has nothing to do.
        if not path.exists() or path.read_text() != text:
            path.write_text(text)
    # Entries of names that are public no more.
    listed = "\n".join(pages().values()).replace("~", "").split()
    for entry in (folder / "entries").glob("*.rst"):
        if entry.stem not in listed:
            entry.unlink()
