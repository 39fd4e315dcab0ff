"""``--json``: the result for programs, on stdout or in a file."""

from __future__ import annotations

import json
import sys
import warnings
from collections.abc import Callable
from contextlib import nullcontext, redirect_stdout
from pathlib import Path
from typing import Any

from ..errors import CtrlRealizeError
from ..io.atomic import refuse_irregular, write_text
from ..report.programs import refusal, summary
from .terminal import one_line, say

Told = list[dict[str, Any]]
"""Arguments of `summary` for the model that was identified."""


def told_as_json(target: str, work: Callable[[Told], int]) -> int:
    """Run, and write the result or why there is none; with ``-`` other texts are on stderr."""
    if target != "-":
        refuse_irregular(Path(target))
    told: Told = []
    said: list[str] = []
    shown, failed, code = warnings.showwarning, None, 2

    def show(message: Warning | str, *rest: Any) -> None:
        said.append(one_line(message))
        shown(message, *rest)

    with redirect_stdout(sys.stderr) if target == "-" else nullcontext():
        warnings.showwarning = show  # type: ignore[assignment]
        try:
            code = work(told)
        except (CtrlRealizeError, OSError) as error:
            failed = error
        finally:
            warnings.showwarning = shown
    if failed is None:
        content = summary(**told[0], warnings=said)
    else:
        content = refusal(failed, one_line(failed), said)
    text = json.dumps(content, indent=1, ensure_ascii=False, allow_nan=False)
    if target == "-":
        say(text)
    else:
        Path(target).parent.mkdir(parents=True, exist_ok=True)
        write_text(Path(target), text + "\n")
    if failed is not None:
        raise failed
    return code
