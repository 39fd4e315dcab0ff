"""The app in a notebook."""

from __future__ import annotations

import threading
from collections.abc import Sequence
from functools import partial
from typing import Any

from ..data import Record
from ..errors import MissingPackageError
from .hosting import Host, page_part
from .session import Session


def app(record: Record | Sequence[Record] | None = None) -> Any:
    """Show data, model and loop in a notebook, to drag dead time, lags and gain with the mouse.

    The page is that of ``ctrl-realize app``; it needs the extra ``app`` (anywidget), which shows in
    Jupyter, VS Code, Colab and marimo.

    Parameters
    ----------
    record : Record or sequence of Record, optional
        With one input and one output; files can be dropped on the page as well.

    Returns
    -------
    anywidget.AnyWidget
        Its `session` has the state; ``session.script()`` returns lines of Python that do the same.

    Raises
    ------
    MissingPackageError
        anywidget is not installed.

    Examples
    --------
    >>> import ctrl_realize as cr
    >>> widget = cr.app(cr.bench.valve().step_record(16, rng=5))
    >>> widget.session.state["records"][0]["name"]
    'valve_16mA'
    >>> widget.close()
    """
    kind = _widget_kind()
    session = Session()
    given = [] if record is None else [record] if isinstance(record, Record) else list(record)
    for one in given:
        session.add_record(one)
    return kind(session)


def _widget_kind() -> Any:
    try:
        import anywidget
        import traitlets
    except ImportError as error:
        raise MissingPackageError(
            "cr.app shows a widget: pip install 'ctrl-realize[app]' (anywidget); the command "
            "ctrl-realize app needs nothing more"
        ) from error

    class App(anywidget.AnyWidget):
        """Session behind two traits: `command` is set by the page, `answer` by Python."""

        _esm = page_part("app.js")[1]
        style = traitlets.Unicode().tag(sync=True)
        command = traitlets.Dict().tag(sync=True)
        answer = traitlets.Dict().tag(sync=True)

        def __init__(self, session: Session) -> None:
            super().__init__(style=page_part("app.css")[1])
            self.session = session
            self._host: Host | None = None
            self.observe(self._commanded, "command")

        def _commanded(self, change: Any) -> None:
            command = change["new"]
            if self._host is None:
                self._host = Host(self.session)
            answer = partial(self._host.answer, command)
            if command.get("do") in ("compute", "figures", "write"):
                # The kernel stays free for other commands, and for cancelling this one.
                later = lambda: self.set_trait("answer", answer())  # noqa: E731
                threading.Thread(target=later, daemon=True).start()
            else:
                self.answer = answer()

        def close(self) -> None:
            if self._host is not None:
                self._host.close()
            super().close()

    return App
