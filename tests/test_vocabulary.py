"""One vocabulary: public names of attributes and arguments against the glossary."""

import dataclasses
import inspect
import re
import types
from collections import Counter, defaultdict
from pathlib import Path

import control as ct

import ctrl_realize as cr

GLOSSARY = (Path(__file__).parents[1] / "docs" / "glossary.md").read_text(encoding="utf-8")
TERMS = re.findall(r"^([A-Za-zé][^\n]*)\n  \S", GLOSSARY, re.M)
NAMES = re.findall(r"^\| `(\w+)` \|", GLOSSARY, re.M)

SHARED = 3  # classes and functions from which on a name must be explained

MODULES = [
    cr, cr.actuators, cr.bench, cr.data, cr.datasets, cr.design, cr.frequency, cr.identification,
    cr.io, cr.paper, cr.plots, cr.report, cr.validation, cr.valves,
]  # fmt: skip

# Words that meant several things, or that only the package used, and what stands for them.
RETIRED = {
    "beside": "other_models",
    "channel": "system, input or output",
    "direct": "feedthrough",
    "excess": "delta_bic",
    "found": "result",
    "held": "hold",
    "memory": "forgetting_time",
    "misfit": "normalized_rms, iae, relative_iae, weighted_rms",
    "n_inputs": "ninputs",
    "n_outputs": "noutputs",
    "place": "delay",
    "rest": "baseline, pre_step_time, residual_delays",
    "tau": "dead_time",
    "tells": "resolved",
    "told": "resolved",
    "views": "estimates",
    "wait": "dead_time",
    "way": "pair of input and output",
}
ALLOWED = {
    ("Erratum", "place"),  # of the paper: where it is printed
    ("read_record", "rest"),  # both levels of the steady state, as the option --rest
}


def public_names() -> dict[str, set[str]]:
    """Name of an attribute or argument -> public classes and functions that have it."""
    owners: dict[str, set[str]] = defaultdict(set)
    for module in MODULES:
        for name in dir(module):
            value = getattr(module, name)
            home = getattr(value, "__module__", None) or ""
            if isinstance(value, types.ModuleType) or not home.startswith("ctrl_realize"):
                continue
            for each in attributes_of(value) if inspect.isclass(value) else arguments_of(value):
                owners[each].add(name)
    # What a class inherits from a public class is one name, not two.
    for each in owners.values():
        each -= {name for name in each if each & PUBLIC_BASES.get(name, set())}
    return owners


def attributes_of(kind: type) -> set[str]:
    names = set(arguments_of(kind))
    for base in kind.__mro__:
        if base.__module__.startswith("ctrl_realize"):
            names |= set(vars(base))
            if dataclasses.is_dataclass(base):
                names |= {field.name for field in dataclasses.fields(base)}
            for name, member in vars(base).items():
                if not name.startswith("_"):
                    names |= set(arguments_of(getattr(member, "__func__", member)))
    return {name for name in names if not name.startswith("_")} - {"self", "cls"}


def arguments_of(value: object) -> list[str]:
    if not (inspect.isfunction(value) or inspect.isclass(value)):
        return []
    try:
        return list(inspect.signature(value).parameters)
    except ValueError:
        return []


PUBLIC_BASES = {
    kind.__name__: {base.__name__ for base in kind.__mro__[1:]}
    for place in (cr.design, cr.actuators)
    for kind in (getattr(place, name) for name in place.__all__)
    if inspect.isclass(kind)
}
OWNERS = public_names()
HOST = {
    name
    for member in [ct.StateSpace, *vars(ct.StateSpace).values(), ct.step_response]
    for name in (dir(member) if inspect.isclass(member) else arguments_of(member))
}  # python-control's own words


def test_the_glossary_lists_each_term_and_each_name_once():
    assert [term for term, count in Counter(map(str.lower, TERMS)).items() if count > 1] == []
    assert [name for name, count in Counter(NAMES).items() if count > 1] == []
    assert len(TERMS) > 30


def test_names_that_several_classes_share_are_in_the_glossary():
    shared = {name for name, owners in OWNERS.items() if len(owners) >= SHARED}
    assert sorted(shared - set(NAMES) - HOST - {"args", "state_index"}) == []


def test_the_glossary_lists_no_name_that_nobody_has():
    assert sorted(set(NAMES) - set(OWNERS)) == []


def test_no_public_name_uses_a_word_that_was_given_up():
    used = {
        (owner, name)
        for name, owners in OWNERS.items()
        for owner in owners
        for word in (name, *name.split("_"))
        if word in RETIRED
    }
    assert used - ALLOWED == set()
