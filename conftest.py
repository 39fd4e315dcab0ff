"""What doctests and tests share: no window opens, and no figure stays open."""

from __future__ import annotations

import os

# Tests run in as many processes as there are cores; threads of BLAS would be in each other's way.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import matplotlib as mpl
import pytest

mpl.use("Agg")


@pytest.fixture(autouse=True)
def _no_figure_left_open():
    yield
    import matplotlib.pyplot as plt

    plt.close("all")
