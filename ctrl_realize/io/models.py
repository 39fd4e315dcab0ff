"""Models as JSON files: exact, verified on loading, and without code."""

from __future__ import annotations

import hashlib
import json
import os
import platform
from collections.abc import Mapping
from itertools import product
from typing import Any, TypeAlias

import control as ct
import numpy as np

from .._checks import check_type
from .._facts import version_of
from ..delayed import DelayedStateSpace, DelaySystem
from ..delayed.inside.pure import TransferDelay
from ..delayed.parts import signals_of
from ..errors import CtrlRealizeError, FileFormatError, OptionError, UnsuitableSystemError
from .atomic import write_text
from .checks import usable_file
from .json_content import field, finite_numbers, matrix, parsed, texts, whole_numbers
from .stored_fit import summary_from_json, summary_of, summary_to_json

FORMAT = "ctrl_realize model"
_HEAD = 200  # bytes, in which the format of a file stands
SCHEMA = 1
MAX_MODEL_BYTES = 64 * 2**20
_NO_MODEL = "not a model file; expected one that save_model or identify wrote"
Model: TypeAlias = DelayedStateSpace | DelaySystem
"""What a file may contain."""
_PACKAGES = ("ctrl-realize", "control", "numpy", "scipy")


def save_model(
    path: str | os.PathLike[str],
    system: ct.StateSpace,
    *,
    settings: Mapping[str, Any] | None = None,
    note: str = "",
) -> None:
    """Write a model to a JSON file.

    Core matrices, delays (internal ones, too), sample time, names and labels are stored exactly; of
    `system.fit` its report, flags and main numbers. Package versions and a SHA-256 checksum are
    included, so that a damaged or edited file is recognised. The file is written atomically.

    Parameters
    ----------
    path : path-like
        File to write; an existing one is replaced.
    system : DelayedStateSpace, DelaySystem or control.StateSpace
        A plain model is stored with delay 0; a discrete one needs a sample time. Of a controller
        the system is stored, without its tuning parameters.
    settings : mapping, optional
        Numbers, text and lists of them to store, such as how the model was found.
    note : str, optional
        Free text.

    Raises
    ------
    UnsuitableSystemError
        A system that is none of these.
    OptionError
        Settings other than plain numbers and text, or matrices that are not finite.
    OSError
        The folder is missing or cannot be written.

    Examples
    --------
    >>> import tempfile
    >>> from pathlib import Path
    >>> import control as ct
    >>> import ctrl_realize as cr
    >>> valve = cr.delayed_ss(ct.ss(0.9, 1, 0.1, 0, 0.01), 37, name="valve")
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     cr.save_model(Path(folder) / "valve.json", valve)
    ...     cr.load_model(Path(folder) / "valve.json")
    <DelayedStateSpace 'valve': u -> y, order 1, z^-37 (0.37 s), dt = 0.01 s>
    """
    write_text(path, model_to_text(system, settings=settings, note=note))


def load_model(path: str | os.PathLike[str]) -> Model:
    """Read a model that `save_model` wrote.

    No code from the file is executed. A file that is truncated, edited, of a later version or not a
    model is refused.

    Parameters
    ----------
    path : path-like
        A long delay in it takes no memory until a function of python-control needs the matrices,
        which grow with the square of the number of states, up to the limit of `DelayedStateSpace`.

    Returns
    -------
    DelayedStateSpace or DelaySystem
        As it was saved. If it had a `fit`, this is a `FitSummary` (report, flags and main numbers).

    Raises
    ------
    MissingFileError
        There is no such file, or no permission to read it.
    FileFormatError
        The file is not a model, damaged, edited, of a later version, or too large.

    Examples
    --------
    >>> import tempfile
    >>> from pathlib import Path
    >>> import control as ct
    >>> import ctrl_realize as cr
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     path = Path(folder) / "valve.json"
    ...     cr.save_model(path, cr.delayed_ss(ct.ss(0.9, 1, 0.1, 0, 0.01), 37, name="valve"))
    ...     valve = cr.load_model(path)
    >>> valve.delay, valve.name
    (37, 'valve')
    """
    file = usable_file(path, MAX_MODEL_BYTES)
    try:
        text = file.read_bytes().decode("utf-8")
    except ValueError as error:
        raise FileFormatError(f"{file}: {_NO_MODEL}") from error
    try:
        return model_from_text(text)
    except FileFormatError as error:
        raise FileFormatError(f"{file}: {error}") from error


def holds_model(path: str | os.PathLike[str]) -> bool:
    """Whether a file begins as those of `save_model` do, whatever its name is."""
    with open(path, "rb") as opened:
        return FORMAT.encode() in opened.read(_HEAD)


def model_to_text(
    system: ct.StateSpace, *, settings: Mapping[str, Any] | None = None, note: str = ""
) -> str:
    """Return a model as the text that `save_model` writes."""
    model: Model = system
    if not isinstance(system, DelayedStateSpace | DelaySystem):
        expected = "a state-space model, after the path of its file"
        check_type(system, ct.InputOutputSystem, "system", expected, UnsuitableSystemError)
        continuous = isinstance(system, ct.StateSpace) and not system.dt
        model = (DelaySystem if continuous else DelayedStateSpace)(system, name=system.name)
    fit = model.fit if isinstance(model, DelayedStateSpace) else None
    content = {
        "format": FORMAT,
        "schema": SCHEMA,
        "model": _model_content(model),
        "fit": summary_to_json(summary_of(fit)),
        "provenance": {
            "versions": {"python": platform.python_version()}
            | {package: version_of(package) for package in _PACKAGES},
            "note": note,
            "settings": dict(settings or {}),
        },
    }
    try:
        content["sha256"] = checksum(content)
        text = json.dumps(content, indent=1, allow_nan=False)
        # nothing is written that could not be read again
        _model_from(json.loads(text))
    except (TypeError, ValueError, RecursionError) as error:
        raise OptionError(f"the model cannot be stored as JSON: {error}") from error
    return text + "\n"


def model_from_text(text: str) -> Model:
    """Make a model from the text that `save_model` has written; see `load_model`."""
    if not text.lstrip().startswith("{"):
        raise FileFormatError(_NO_MODEL)
    try:
        content = parsed(text)
    except (ValueError, RecursionError) as error:
        raise FileFormatError(
            f"not a model file, or truncated; expected JSON that save_model has written: {error}"
        ) from error
    try:
        _check_origin(content)
        return _model_from(content)
    except FileFormatError:
        raise
    # TypeError, KeyError, ...: python-control's errors for invalid names and shapes
    except (CtrlRealizeError, ValueError, TypeError, OverflowError, RecursionError) as error:
        raise FileFormatError(str(error)) from error


def _model_content(model: Model) -> dict[str, Any]:
    delays: dict[str, Any]
    if isinstance(model, DelaySystem):
        core = model.core
        delays = {"internal_delays": list(model.internal_delays)}
        if isinstance(model, TransferDelay):
            delays["transfer_function"] = True
    else:
        core = model.delay_free
        delays = {end: list(getattr(model, end)) for end in ("input_delays", "output_delays")}
    states = core.state_labels
    named = states != [f"x[{i}]" for i in range(core.nstates)]
    return {
        "name": model.name,
        **signals_of(model),
        **({"states": states} if named else {}),
        **({"time_unit": model.time_unit} if model.time_unit != "s" else {}),
        "order": core.nstates,
        "dt": None if core.dt is None else float(core.dt),
        **delays,
        **{letter: np.asarray(getattr(core, letter)).tolist() for letter in "ABCD"},
    }


def _model_from(content: Mapping[str, Any]) -> Model:
    model = field(content, "model", dict)
    inputs, outputs = texts(model, "inputs"), texts(model, "outputs")
    if not inputs or not outputs:
        raise FileFormatError("the model has no inputs or outputs")
    name = field(model, "name", str)
    if any("." in one for one in (name, *inputs, *outputs)):
        raise FileFormatError("a name contains a dot, which is not allowed in names of models")
    names: dict[str, Any] = {"name": name, "inputs": inputs, "outputs": outputs}
    if "time_unit" in model:
        names["time_unit"] = field(model, "time_unit", str)
    inside = "internal_delays" in model
    if inside and model.get("dt", 0.0) is None:  # a gain of any time base
        core = _core(model, None, len(inputs), len(outputs))
        return DelaySystem(core, finite_numbers(model, "internal_delays"), **names)
    dt = float(field(model, "dt", int | float))
    if inside:
        if not 0 <= dt < float("inf"):
            raise FileFormatError(f"dt={dt} is neither a sample time nor 0 for continuous time")
        internal = finite_numbers(model, "internal_delays")
        core = _core(model, dt, len(inputs) + len(internal), len(outputs) + len(internal))
        kind = TransferDelay if model.get("transfer_function") is True else DelaySystem
        return kind(core, internal, **names)
    if not 0 < dt < float("inf"):
        raise FileFormatError(f"dt={dt} is not a sample time")
    before = whole_numbers(model, "input_delays", len(inputs))
    behind = whole_numbers(model, "output_delays", len(outputs))
    core = _core(model, dt, len(inputs), len(outputs))
    fit = summary_from_json(content.get("fit"))
    return DelayedStateSpace(core, before, output_delay=behind, fit=fit, **names)


def _core(model: Mapping[str, Any], dt: float | None, ninputs: int, noutputs: int) -> ct.StateSpace:
    order = field(model, "order", int)
    if order < 0:
        raise FileFormatError("the model has a negative order")
    states = texts(model, "states") if "states" in model else order
    if isinstance(states, list) and len(states) != order:
        raise FileFormatError(f"{len(states)} names for {order} states")
    shapes = product((order, noutputs), (order, ninputs))
    matrices = [matrix(model, *one) for one in zip("ABCD", shapes, strict=True)]
    return ct.StateSpace(*matrices, dt, states=states, remove_useless_states=False)


def _check_origin(content: object) -> None:
    """Refuse other, later and edited files, each with its reason."""
    if not isinstance(content, dict) or content.get("format") != FORMAT:
        raise FileFormatError(f"not a model file of ctrl_realize (expected the format {FORMAT!r})")
    schema = content.get("schema")
    if type(schema) is not int or schema < 1:
        raise FileFormatError(f"schema {schema!r} is not known")
    if schema > SCHEMA:
        raise FileFormatError(
            f"written by a later version: schema {schema}, this one reads up to {SCHEMA}; "
            "update ctrl_realize"
        )
    if content.get("sha256") != checksum(content):
        raise FileFormatError(
            "the checksum does not match the content: the file was edited or damaged"
        )


def checksum(content: Mapping[str, Any]) -> str:
    """SHA-256 of the content in a canonical form, without the checksum itself."""
    rest = {key: value for key, value in content.items() if key != "sha256"}
    canonical = json.dumps(rest, sort_keys=True, separators=(",", ":"), allow_nan=False)
    return hashlib.sha256(canonical.encode("ascii")).hexdigest()
