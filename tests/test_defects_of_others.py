"""Defects that were seen in public tools for the same job, none of which is here.

Each test is the defect turned round, so that it would fail if we had it too.
"""

import os
import subprocess
import sys
from pathlib import Path

import control as ct
import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

import ctrl_realize as cr
from tests.rigs import R1, step_record

PACKAGE = Path(cr.__file__).parent
CORE = ct.ss([[0.9, 0.2], [-0.1, 0.7]], [[1.0], [0.5]], [[0.3, -0.4]], [[0.0]], 0.1)


def chain(record: cr.Record) -> list[object]:
    """The main job and every step on the way."""
    edge = cr.detect_step(record)
    step = cr.unit_step(record, edge)
    impulse = cr.impulse_from_step(step)
    return [
        edge,
        step,
        impulse,
        cr.realize(impulse, 3, delay=37, samples=600),
        cr.estimate_delay(impulse, 3, max_delay=60, samples=600),
        cr.scan_orders(impulse, 4, max_delay=50, samples=400),
        cr.identify(record, method="scan", order=3, max_delay=60),
        cr.identify(record, method="paper"),
    ]


@pytest.fixture(scope="module")
def record():
    return step_record(noise=1e-3, seed=4)


# The default call on oversampled data gives an unstable model.


@pytest.mark.parametrize("noise", [1e-4, 5e-3])
def test_oversampled_data_give_a_stable_model_by_default(noise):
    # 100 samples within the fastest time constant
    data = step_record(R1, noise=noise, seed=1)
    for model in (cr.identify(data), cr.identify(data, method="scan", max_delay=60)):
        assert np.abs(model.delay_free.poles()).max() < 1
        assert_allclose(model.dcgain(), 1, rtol=0.1)


# The caller's arrays are changed.


def test_the_callers_arrays_are_not_changed(record):
    arrays = [record.time.copy(), record.input.copy(), record.output.copy()]
    kept = [array.copy() for array in arrays]
    mine = cr.Record(*arrays)
    chain(mine)
    cr.impulse_from_io(mine, 40)
    g = np.array(cr.delayed_ss(CORE, 3).markov(200))
    before = g.copy()
    cr.realize(g, 2, dt=0.1)
    cr.estimate_delay(g, 2, max_delay=20, dt=0.1)
    cr.scan_orders(g, 3, max_delay=20, dt=0.1)
    assert_array_equal(g, before)
    for array, old in zip(arrays, kept, strict=True):
        assert_array_equal(array, old)
        assert array.flags.writeable


# Global state is changed.

GLOBAL_STATE = """
import locale, logging, os, random, signal, sys, threading, warnings
import numpy as np, matplotlib, pandas, control
def state():
    return {
        "np.geterr": np.geterr(),
        "np.random": np.random.get_state()[1].tolist(),
        "print": np.get_printoptions(),
        "random": random.getstate(),
        "rcParams": dict(matplotlib.rcParams),
        "backend": matplotlib.rcParams._get_backend_or_none(),
        "filters": [str(f) for f in warnings.filters],
        "logging": (logging.root.level, len(logging.root.handlers)),
        "control": dict(control.config.defaults),
        "pandas": pandas.get_option("display.max_rows"),
        "locale": locale.setlocale(locale.LC_ALL),
        "folder": os.getcwd(),
        "environment": dict(os.environ),
        "signals": [signal.getsignal(s) for s in (signal.SIGINT, signal.SIGTERM, signal.SIGALRM)],
        "threads": threading.active_count(),
        "recursion": sys.getrecursionlimit(),
        "files": sorted(os.listdir(".")),
        "hooks": (sys.excepthook, sys.displayhook, sys.stdout, sys.stderr),
        "path": list(sys.path),
    }
before = state()
import ctrl_realize as cr
assert set(m.partition(".")[0] for m in sys.modules) >= {"ctrl_realize"}
after_import = state()
t = 0.01 * np.arange(600)
u = (t >= 2).astype(float)
y = np.convolve(u, 0.1 * 0.9 ** np.arange(300))[:600]
model = cr.identify(cr.Record(t, u, y), method="scan", order=1, max_delay=10)
after_work = state()
for other, what in ((after_import, "import"), (after_work, "work")):
    for key, value in before.items():
        assert repr(value) == repr(other[key]), f"{what} changes {key}"
print("unchanged")
"""


def run(code: str, folder: Path) -> subprocess.CompletedProcess[str]:
    """Run code in a fresh interpreter, in another folder, with the package on its path."""
    environment = {**os.environ, "PYTHONPATH": str(PACKAGE.parent)}
    environment.pop("KMP_DUPLICATE_LIB_OK", None)  # other packages set it where tests run
    return subprocess.run(
        [sys.executable, "-W", "error::UserWarning:ctrl_realize", "-c", code],
        cwd=folder,
        env=environment,
        capture_output=True,
        text=True,
        timeout=600,
        check=False,
    )


def test_neither_import_nor_work_changes_global_state(tmp_path):
    done = run(GLOBAL_STATE, tmp_path)
    assert done.stdout == "unchanged\n", done.stdout + done.stderr
    assert done.stderr == ""


# Results are random where no seed was given.


def test_results_do_not_depend_on_any_random_state(record):
    np.random.seed(1)  # noqa: NPY002 - the global state is what must not matter
    first = chain(record)
    np.random.seed(2)  # noqa: NPY002
    second = chain(record)
    for a, b in zip(first, second, strict=True):
        assert repr(a) == repr(b)
        if isinstance(a, cr.DelayedStateSpace):
            for letter in "ABCD":
                assert_array_equal(getattr(a, letter), getattr(b, letter))
