"""What doctests and tests share: no window opens, and no figure stays open."""

from __future__ import annotations

import os

# Tests run in as many processes as there are cores; threads of BLAS would be in each other's way.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import matplotlib as mpl
import pytest

mpl.use("Agg")

collect_ignore = ["tests/oracles"]  # they hold no tests, and may need packages that are not there

NEEDED = {"ctrl_realize.interactive.widget.app": "anywidget"}
"""Optional packages of examples."""


@pytest.fixture(autouse=True)
def _optional_package_of_an_example(request):
    if request.node.name in NEEDED:
        pytest.importorskip(NEEDED[request.node.name])


@pytest.fixture(autouse=True)
def _no_figure_left_open():
    yield
    import matplotlib.pyplot as plt

    plt.close("all")
