"""Actuators as numbers and text, for files."""

from __future__ import annotations

import inspect
from dataclasses import fields
from typing import TypeAlias

from .base import Actuator
from .characteristic import Characteristic
from .limits import Backlash, DeadZone, Resolution, Saturation, SlewRateLimit
from .stiction import KanoStiction, Stiction

Plain: TypeAlias = "float | int | str | bool | tuple[Plain, ...] | None"

_MODELS: dict[str, type[Actuator]] = {
    model.__name__: model
    for model in (
        Backlash, Characteristic, DeadZone, KanoStiction, Resolution, Saturation,
        SlewRateLimit, Stiction,
    )
}  # fmt: skip
_INFINITE = {str(number): number for number in (float("inf"), float("-inf"))}


def to_plain(model: Actuator) -> tuple[Plain, ...]:
    """Name of the model and its parameters in their order."""
    assert type(model).__name__ in _MODELS
    return (type(model).__name__, *(getattr(model, field.name) for field in fields(model)))  # type: ignore[arg-type]


def from_plain(stored: Plain) -> Actuator:
    """Make the model that `to_plain` was given; unknown content is a ValueError."""
    match stored:
        case (str(name), *values) if name in _MODELS:
            numbers = [_INFINITE.get(one, one) if isinstance(one, str) else one for one in values]
            if len(numbers) == len(inspect.signature(_MODELS[name]).parameters):
                return _MODELS[name](*numbers)
    raise ValueError(f"got {stored!r:.80}; expected the name of an actuator and its parameters")
