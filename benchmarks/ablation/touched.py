"""Which rules touch a record: asked while it is identified with all rules on.

A rule whose functions give the same answers without it, whenever they are asked, cannot change
what comes of a record: only where one differs the record is identified again without it.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass, field, fields, is_dataclass
from typing import Any
from unittest import mock

import numpy as np

from .switches import Switch, located


@dataclass
class Touched:
    """Names of the rules that touch a record, and the CPU time in s that asking took."""

    rules: set[str] = field(default_factory=set)
    spent: float = 0.0
    asking: bool = False

    @property
    def names(self) -> tuple[str, ...]:
        return tuple(sorted(self.rules))


@contextmanager
def watched(switches: Sequence[Switch]) -> Iterator[Touched]:
    """Ask the functions of all rules with and without them, as often as they are called."""
    found = Touched()
    by_path: dict[str, list[Switch]] = {}
    for switch in switches:
        for path in switch.probes:
            by_path.setdefault(path, []).append(switch)
    with ExitStack() as stack:
        for path, several in by_path.items():
            owner, name = located(path)
            original = getattr(owner, name)
            function = original.fget if isinstance(original, property) else original
            asked = _asking(function, path, several, found)
            put = property(asked) if isinstance(original, property) else asked
            stack.enter_context(mock.patch.object(owner, name, put))
        yield found


def _asking(
    function: Callable[..., Any], path: str, switches: Sequence[Switch], found: Touched
) -> Callable[..., Any]:
    owner, name = located(path)

    def asked(*args: Any, **kwargs: Any) -> Any:
        result = function(*args, **kwargs)
        if found.asking:
            return result
        found.asking = True
        start = time.process_time()
        for switch in switches:
            if switch.name in found.rules:
                continue
            if switch.called:
                found.rules.add(switch.name)
                continue
            with switch.off():
                other = getattr(owner, name)
                other = other.fget if isinstance(other, property) else other
                if not same(result, other(*args, **kwargs)):
                    found.rules.add(switch.name)
        found.spent += time.process_time() - start
        found.asking = False
        return result

    return asked


def same(one: Any, other: Any) -> bool:
    """Tell whether two answers are equal, arrays and data classes included."""
    if one is other:
        return True
    if type(one) is not type(other):
        return False
    if isinstance(one, np.ndarray):
        return bool(np.array_equal(one, other, equal_nan=True))
    if isinstance(one, list | tuple):
        return len(one) == len(other) and all(map(same, one, other))
    if is_dataclass(one):
        names = [part.name for part in fields(one)]
        return all(same(getattr(one, name), getattr(other, name)) for name in names)
    return bool(one == other)
