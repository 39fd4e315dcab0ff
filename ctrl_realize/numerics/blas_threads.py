"""One BLAS thread while the library computes.

The matrices of this package have tens of rows. For these a second BLAS thread costs more, waiting,
than it computes: two threads took six times as long as one on a machine with other work to do,
and another order of summation may round the last digits otherwise.
"""

from __future__ import annotations

import functools
from collections.abc import Callable, Iterator
from contextlib import contextmanager, nullcontext
from threading import Lock
from typing import Any, ParamSpec, TypeVar

from threadpoolctl import ThreadpoolController

P = ParamSpec("P")
T = TypeVar("T")

# The setting belongs to the whole process: only one Python thread at a time may save and restore
# it, or two that overlap would leave it at one for good. Held by whoever limits; never waited for.
_LIMITING = Lock()


@functools.cache
def _controller() -> Any:
    """BLAS libraries of NumPy and SciPy; to look for them takes 15 ms, so it is done once."""
    import scipy.linalg  # noqa: F401 - brings its own BLAS

    return ThreadpoolController().select(user_api="blas")


@contextmanager
def one_blas_thread() -> Iterator[None]:
    """Limit BLAS to one thread inside; the caller's setting is back afterwards.

    Costs 30 to 60 us, 5 us where there is one thread already, 2 us inside another one. What other
    Python threads of the process compute meanwhile has one BLAS thread too.
    """
    if not _LIMITING.acquire(blocking=False):
        yield
        return
    try:
        found = _controller()
        many = any((library.num_threads or 1) > 1 for library in found.lib_controllers)
        with found.limit(limits=1) if many else nullcontext():
            yield
    finally:
        _LIMITING.release()


def single_threaded(function: Callable[P, T]) -> Callable[P, T]:
    """Run a function with one BLAS thread; see `one_blas_thread`."""

    @functools.wraps(function)
    def limited(*args: P.args, **kwargs: P.kwargs) -> T:
        with one_blas_thread():
            return function(*args, **kwargs)

    return limited
