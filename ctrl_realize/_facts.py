"""Tables of facts, which lie beside the code as TOML, and versions of packages."""

from __future__ import annotations

import pkgutil
import tomllib
from functools import cache
from importlib import metadata
from typing import Any


@cache
def facts(file: str) -> dict[str, Any]:
    """Read a table in a file of the package; lists become tuples.

    Examples
    --------
    >>> from ctrl_realize._facts import facts
    >>> facts("paper/errata.toml")["E1"]["place"]
    'section 2.1, step 4'
    """
    content: dict[str, Any] = _fixed(
        tomllib.loads((pkgutil.get_data("ctrl_realize", file) or b"").decode("utf-8"))
    )
    return content


def _fixed(value: Any) -> Any:
    if isinstance(value, dict):
        return {key: _fixed(part) for key, part in value.items()}
    return tuple(map(_fixed, value)) if isinstance(value, list) else value


@cache
def version_of(package: str) -> str:
    """Version of a package, determined once per process."""
    try:
        return metadata.version(package)
    except metadata.PackageNotFoundError:
        return "not installed"
