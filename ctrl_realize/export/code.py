"""Controllers, plants and inputs of tests as code: C, Python, Structured Text."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Any

from .._checks import one_of
from ..io.atomic import write_text
from .equations import program_of
from .languages import c_header, c_source, python_class, structured_text
from .names import ending


def to_c(system: Any, path: str | os.PathLike[str], *, name: str | None = None) -> Path:
    """Write a controller or plant as C code, a file ``.c`` and its header ``.h``.

    Parameters
    ----------
    system : PIDAlgorithm, PIDController, DelayedStateSpace or ExperimentPlan
        A discrete controller (`PIDController.algorithm` gives it limits and anti-windup), a
        discrete plant with its delays at inputs and outputs, or the input of a planned test.
    path : path-like
        File to write, ending in ``.c``; the header stands beside it.
    name : str, optional
        Prefix of the names in the code. Default: that of the system. It becomes an identifier of
        at most 48 letters and digits; a word of one of the languages gets ``_1``.

    Returns
    -------
    pathlib.Path

    Raises
    ------
    UnsuitableSystemError
        Another kind of system; a plant that responds within the same sample.
    OptionError
        A path that does not end in ``.c``.

    Notes
    -----
    ``NAME_init(&state)`` sets all to zero; ``NAME_step(&state, ...)`` is one sample. A plant takes
    the input as applied since the last call and returns its output at this call, so that in a loop
    the plant is called first, with the controller's last output. The code is C89, without
    allocation.

    Examples
    --------
    >>> import tempfile
    >>> from pathlib import Path
    >>> import ctrl_realize as cr
    >>> pi = cr.design.PIDController(2.0, 10.0, dt=0.5, name="level")
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     written = cr.export.to_c(pi.algorithm(output_limits=(0, 100)), Path(folder) / "pi.c")
    ...     print(written.name, written.with_suffix(".h").read_text().splitlines()[0])
    pi.c /* PID algorithm level, call every 0.5 s */
    """
    target = ending(path, ".c")
    program = program_of(system, name)
    header = target.with_suffix(".h")
    write_text(header, c_header(program))
    write_text(target, c_source(program, header.name))
    return target


def to_python(system: Any, path: str | os.PathLike[str], *, name: str | None = None) -> Path:
    """Write a controller or plant as a class in plain Python, without further packages.

    Parameters
    ----------
    system, name
        As for `to_c`; `name` is that of the class.
    path : path-like
        File to write, ending in ``.py``.

    Returns
    -------
    pathlib.Path

    Examples
    --------
    >>> import tempfile
    >>> from pathlib import Path
    >>> import ctrl_realize as cr
    >>> pi = cr.design.PIDController(2.0, 10.0, dt=0.5, name="level")
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     exec(cr.export.to_python(pi, Path(folder) / "pi.py").read_text())
    >>> level().step(setpoint=1.0, measured=0.0)
    2.05
    """
    target = ending(path, ".py")
    write_text(target, python_class(program_of(system, name)))
    return target


def to_structured_text(
    system: Any, path: str | os.PathLike[str], *, name: str | None = None, real: str = "LREAL"
) -> Path:
    r"""Write a controller or plant as a function block in Structured Text (IEC 61131-3).

    Parameters
    ----------
    system, name
        As for `to_c`; `name` is that of the function block.
    path : path-like
        File to write, usually ending in ``.st``.
    real : {"LREAL", "REAL"}
        Type of the numbers. Controllers without LREAL need REAL, of 32 bits and about 7 digits.

    Returns
    -------
    pathlib.Path

    Notes
    -----
    Only assignments, IF, numbers, booleans and arrays are used, without libraries. A plant as a
    function block replaces the process in tests of the program.

    Examples
    --------
    >>> import tempfile
    >>> from pathlib import Path
    >>> import ctrl_realize as cr
    >>> p = cr.design.PIDController(2.0, dt=0.5, name="level")
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     text = cr.export.to_structured_text(p, Path(folder) / "p.st").read_text()
    >>> print("\n".join(text.splitlines()[2:8]))
    FUNCTION_BLOCK level
    VAR_INPUT
        setpoint : LREAL; (* set-point *)
        measured : LREAL; (* measured value *)
        manual : BOOL; (* manual operation *)
        manual_output : LREAL; (* output in manual operation *)
    """
    one_of(real, "real", ("LREAL", "REAL"))
    target = Path(path)
    write_text(target, structured_text(program_of(system, name), real))
    return target
