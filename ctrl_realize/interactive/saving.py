"""Work as one JSON file: state and files, with a checksum as in model files."""

from __future__ import annotations

import base64
import json
from collections.abc import Mapping

from ..errors import FileFormatError
from ..io.json_content import parsed
from ..io.models import checksum
from .drawing import JSON
from .state import State, checked

FORMAT, SCHEMA = "ctrl_realize work", 1


def is_work(content: bytes) -> bool:
    """Whether a file says that it is saved work."""
    return content[:1] == b"{" and FORMAT.encode() in content[:200]


def saved(state: State, files: Mapping[str, bytes]) -> str:
    """Text of a file with a state and the files that it uses."""
    used = {row["file"] for row in [*state["records"], *filter(None, [state["frf"]])]}
    coded = {key: base64.b64encode(files[key]).decode() for key in sorted(used)}
    content: JSON = {"format": FORMAT, "schema": SCHEMA, "state": state, "files": coded}
    return json.dumps(content | {"sha256": checksum(content)}, indent=1) + "\n"


def opened(text: str) -> tuple[State, dict[str, bytes]]:
    """State and files of saved work.

    Raises
    ------
    FileFormatError
        No such file, of a later version, edited or damaged.
    """
    try:
        content = parsed(text)
    except (ValueError, RecursionError) as error:
        raise FileFormatError(f"not a file of saved work, or truncated: {error}") from error
    if content.get("schema") != SCHEMA:
        raise FileFormatError(f"schema {content.get('schema')!r}; expected {SCHEMA}: update this")
    if content.get("sha256") != checksum(content):
        raise FileFormatError("the checksum does not match: the file was edited or damaged")
    files = {key: base64.b64decode(value) for key, value in content["files"].items()}
    return checked(content["state"], files), files
