"""One BLAS thread while the library computes.

The matrices of this package have tens of rows. For these a second BLAS thread costs more time by
waiting than it computes: two threads took six times as long as one on a busy machine, and another
order of summation may change the last digits.
"""

from __future__ import annotations

import functools
import os
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from threading import Lock
from typing import Any

# The setting is global: only one Python thread at a time may save and restore it, otherwise two
# overlapping ones could leave it at one. It is waited for only if both come at the same moment.
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


def _set(numbers: Sequence[int]) -> None:
    for library, number in zip(_controller().lib_controllers, numbers, strict=True):
        library.set_num_threads(number)


@contextmanager
def one_blas_thread() -> Iterator[None]:
    """Limit BLAS to one thread in the block; the caller's setting is restored afterwards.

    Takes 10 us, 2 us inside another block. Other Python threads of the process have one BLAS thread
    meanwhile.
    """
    if _LIMITING.locked():
        yield
        return
    with _LIMITING:
        before = [library.num_threads or 1 for library in _controller().lib_controllers]
        try:
            _set([1] * len(before))
            yield
        finally:
            try:
                _set(before)
            finally:  # an interruption between may have kept it from being restored
                _set(before)


single_threaded = one_blas_thread()
"""Decorator: run a function with one BLAS thread; see `one_blas_thread`."""
