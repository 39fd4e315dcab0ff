"""Entries of the reference show what a caller writes: no private field, no base without a page."""

from __future__ import annotations

import re
from typing import Any

from docutils import nodes

PRIVATE = re.compile(r", _\w+(=[^,()]*)?(?=[,)])")


def hide_private_fields(
    app: Any, what: str, name: str, obj: Any, options: Any, signature: str, returned: str
) -> tuple[str, str] | None:
    """Leave out fields of a dataclass that only the package itself passes on."""
    if what != "class" or not signature:
        return None
    return PRIVATE.sub("", signature), returned


def name_public_bases(app: Any, name: str, obj: type, options: Any, bases: list[Any]) -> None:
    """Replace each internal base by the nearest ancestors that a reader can look up."""
    public: list[Any] = []
    for base in bases:
        public += [each for each in _public(base) if each not in public]
    bases[:] = public or [object]


def _public(base: Any) -> list[Any]:
    home = str(getattr(base, "__module__", ""))
    if not home.startswith("ctrl_realize") or not _is_internal(base):
        return [base] if base is not object else []
    return [each for parent in base.__bases__ for each in _public(parent)]


def _is_internal(base: type) -> bool:
    import ctrl_realize
    from ctrl_realize import errors, results

    return not any(
        getattr(home, base.__name__, None) is base for home in (ctrl_realize, errors, results)
    )


def leave_out_object(app: Any, doctree: nodes.document) -> None:
    """Take away the line which says that a class is a class."""
    for line in list(doctree.findall(nodes.paragraph)):
        if line.astext() == "Bases: object":
            line.parent.remove(line)


def setup(app: Any) -> dict[str, bool]:
    app.connect("autodoc-process-signature", hide_private_fields)
    app.connect("autodoc-process-bases", name_public_bases)
    app.connect("doctree-read", leave_out_object)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
