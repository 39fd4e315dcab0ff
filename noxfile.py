#!/usr/bin/env -S uv run --script
# /// script
# dependencies = ["nox>=2025.2.9"]
# ///
"""The project's tasks for those who use nox; each is a call of the script that does it.

`tools/dev.py` and `tools/matrix.py` make their environments themselves and need nothing but Python,
so the sessions here have none. ``nox --list`` shows them; arguments after ``--`` go to the script.
"""

from __future__ import annotations

import sys

import nox

nox.needs_version = ">=2025.2.9"
nox.options.default_venv_backend = "none"


def script(session: nox.Session, name: str, *words: str) -> None:
    session.run(sys.executable, f"tools/{name}.py", *words, *session.posargs, external=True)


@nox.session
def lint(session: nox.Session) -> None:
    """Lint, types, spelling."""
    script(session, "dev", "lint")


@nox.session
def tests(session: nox.Session) -> None:
    """Lint, then all tests, examples and notebooks."""
    script(session, "dev", "test")


@nox.session(default=False)
def docs(session: nox.Session) -> None:
    """Build the site; warnings are errors."""
    script(session, "dev", "docs")


@nox.session(default=False)
def demo(session: nox.Session) -> None:
    """The simulated valve from end to end."""
    script(session, "dev", "demo")


@nox.session(default=False)
def matrix(session: nox.Session) -> None:
    """The tests against the wheel: Pythons, oldest and newest packages, kernels, users."""
    script(session, "matrix")


@nox.session(default=False)
def release(session: nox.Session) -> None:
    """Check what a release needs; publishes nothing."""
    script(session, "release")


if __name__ == "__main__":
    nox.main()
