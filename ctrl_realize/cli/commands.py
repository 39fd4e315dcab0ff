"""The commands, and their exit codes."""

from __future__ import annotations

import functools
import signal
import traceback
import warnings
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from types import FrameType
from typing import Any

import typer
from threadpoolctl import threadpool_limits
from typer.main import get_command

from ..errors import CtrlRealizeError
from .loading import handled
from .signatures import app as app_command
from .signatures import compare, identify, look, loop, tune, valve
from .terminal import EXIT_CODES, complain, one_line, plain_warning

app = typer.Typer(
    name="ctrl-realize",
    help="Models with dead time from measured responses, as python-control state-space systems.",
    epilog=EXIT_CODES,
    add_completion=False,
    rich_markup_mode=None,
    context_settings={"help_option_names": ["-h", "--help"]},
)
for command in (look, identify, tune, compare, valve, loop, app_command):
    app.command(epilog=EXIT_CODES)(command)


def _version(asked: bool) -> None:
    if asked:
        from .._facts import version_of

        typer.echo(f"ctrl-realize {version_of('ctrl-realize')}")
        raise typer.Exit


@app.callback()
def _common(
    version: bool = typer.Option(
        False, "--version", callback=_version, is_eager=True, help="Show the version and exit."
    ),
) -> None:
    """Models with dead time from measured responses, as python-control state-space systems."""


DEFECT, INTERRUPTED = 3, 130
_SIGNALS = ("SIGTERM", "SIGHUP")


class Stopped(KeyboardInterrupt):
    """The system terminates the process: cleaned up as after Ctrl-C."""


@contextmanager
def stopped_by_signals() -> Iterator[list[int]]:
    """Raise `Stopped` on SIGTERM and SIGHUP in the block, once; handlers are restored afterwards.

    By default Python ends at once at these signals, without cleaning up: incomplete folders would
    remain, and workers would continue.
    """
    codes: list[int] = []
    # which there are depends on the operating system
    known = [getattr(signal, name) for name in _SIGNALS if hasattr(signal, name)]

    def stop(number: int, frame: FrameType | None) -> None:
        for one in known:
            signal.signal(one, signal.SIG_IGN)  # cleaning up takes a moment
        codes.append(128 + number)
        raise Stopped

    # a signal that is ignored (nohup), or handled by other code, is left unchanged
    with handled(known, signal.SIG_DFL, stop):
        yield codes


@functools.cache
def _command() -> Any:
    """Build the commands once, also if a program calls `main` repeatedly."""
    return get_command(app)


def run(words: Sequence[str]) -> int:
    """Run a command and return its exit code."""
    command = _command()
    # The matrices are small: on a busy machine, BLAS threads waiting for each other cost ten times
    # what they save. Use processes instead (--jobs).
    with threadpool_limits(limits=1), warnings.catch_warnings(), stopped_by_signals() as codes:
        warnings.showwarning = plain_warning
        try:
            code = command.main(list(words), prog_name="ctrl-realize", standalone_mode=False)
        except (KeyboardInterrupt, typer.Abort):
            code = INTERRUPTED
        except BrokenPipeError:
            return 1
        except (CtrlRealizeError, OSError) as error:
            complain(one_line(error))
            return 2
        except MemoryError as error:
            complain(f"out of memory: {one_line(error) or 'no details'}")
            return 2
        except Exception as error:
            # Typer's usage errors: the package that defines them depends on its version.
            if not hasattr(error, "format_message"):
                complain("".join(traceback.format_exception(error)))
                complain("this is a bug in the program; please report it with the lines above")
                return DEFECT
            complain(one_line(error.format_message()) + " (see --help)")
            return 2
    if code == INTERRUPTED:  # typer tells of it by an exception or by the code
        code = (codes or [INTERRUPTED])[0]
        how = "interrupted" if code == INTERRUPTED else "terminated"
        complain(f"{how}; unfinished results were not written")
    return code if isinstance(code, int) else 0
