"""One BLAS thread while the library computes.

The matrices of this package have tens of rows. For these a second BLAS thread costs more time by
waiting than it computes: two threads took six times as long as one on a busy machine, and another
order of summation may change the last digits.
"""

from __future__ import annotations

import functools
import os
from collections.abc import Callable, Iterator
from contextlib import contextmanager, nullcontext
from threading import Lock
from typing import Any, ParamSpec, TypeVar

P = ParamSpec("P")
T = TypeVar("T")

# The setting is global: only one Python thread at a time may save and restore it, otherwise two
# overlapping ones could leave it at one. It is never waited for.
_LIMITING = Lock()
_OF_OPENMP = "KMP_DUPLICATE_LIB_OK"


@functools.cache
def _controller() -> Any:
    """BLAS libraries of NumPy and SciPy; finding them takes 15 ms and is done once."""
    import scipy.linalg  # noqa: F401 - brings its own BLAS

    # The import sets a variable of Intel's OpenMP, for this process and those that it starts.
    before = os.environ.get(_OF_OPENMP)
    from threadpoolctl import ThreadpoolController

    if before is None:
        os.environ.pop(_OF_OPENMP, None)
    return ThreadpoolController().select(user_api="blas")


@contextmanager
def one_blas_thread() -> Iterator[None]:
    """Limit BLAS to one thread in the block; the caller's setting is restored afterwards.

    Takes 30 to 60 us, 5 us if there is one thread already, 2 us inside another block. Other Python
    threads of the process have one BLAS thread meanwhile.
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
