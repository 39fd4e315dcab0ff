"""Ten defects that were seen in public tools for the same job, none of which is here.

Each test is the defect turned round, so that it would fail if we had it too.
"""

from __future__ import annotations

import ast
import os
import subprocess
import sys
from pathlib import Path

import control as ct
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_allclose, assert_array_equal

import ctrl_realize as cr
from tests.rigs import R1, R3, TS, lag, step_record

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


# 1. The default call on oversampled data gives an unstable model.


@pytest.mark.parametrize("noise", [1e-4, 5e-3])
def test_oversampled_data_give_a_stable_model_by_default(noise):
    # 100 samples within the fastest time constant
    data = step_record(R1, noise=noise, seed=1)
    for model in (cr.identify(data), cr.identify(data, method="scan", max_delay=60)):
        assert np.abs(model.delay_free.poles()).max() < 1
        assert_allclose(model.dcgain(), 1, rtol=0.1)


# 2. The delay is off by one.


@pytest.mark.parametrize("delay", [0, 1, 2, 37])
def test_the_delay_is_not_off_by_one(delay):
    plant = cr.delayed_ss(CORE, delay)
    g = plant.markov(300)
    # strictly proper: the first sample that is not zero is d + 1
    assert np.flatnonzero(g)[0] == delay + 1
    found = cr.estimate_delay(g, 2, max_delay=50, feedthrough=False, dt=0.1)
    assert found.delay == delay
    # Markov parameters of order 1, poles inside 0.9
    assert_allclose(found.markov(300), g, atol=1e-12)
    record = cr.Record(0.1 * np.arange(300), np.ones(300), plant.step(300))
    assert_allclose(found.simulate(record.input), record.output, atol=1e-11)


# 3. The direct term is scaled with the sample time.


@pytest.mark.parametrize("dt", [1e-6, 0.1, 1.0, 50.0])
@pytest.mark.parametrize("hankel", ["square", "padded"])
def test_the_direct_term_does_not_depend_on_the_sample_time(dt, hankel):
    g = np.concatenate([[3.0], 0.5 ** np.arange(60)])
    model = cr.realize(g, 1, dt=dt, hankel=hankel, feedthrough=True)
    assert model.D[0, 0] == 3.0
    # 0.5^60 is cut off
    assert_allclose(model.dcgain(), 5.0, rtol=1e-12)
    assert_allclose(model.markov(61), g, atol=1e-12)


# 4. The caller's arrays are changed.


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


def test_writing_into_the_callers_arrays_does_not_change_a_record():
    t, u, y = 0.1 * np.arange(50), np.ones(50), np.ones(50)
    mine = cr.Record(t, u, y)
    y[:] = 7.0
    assert mine.output.max() == 1.0


# 5. Something is printed, or asked at the keyboard.


def test_nothing_is_printed_and_nothing_asked(record, capsys, monkeypatch, tmp_path):
    class Nobody:
        def __getattr__(self, name):
            raise AssertionError(f"stdin.{name} was used")

    monkeypatch.setattr(sys, "stdin", Nobody())
    results = chain(record)
    cr.save_model(tmp_path / "m.json", results[-1])
    cr.load_model(tmp_path / "m.json")
    for result in results:
        assert repr(result)
    captured = capsys.readouterr()
    assert captured.out == ""
    assert captured.err == ""


# 6. The interpreter is left.


def test_no_code_leaves_the_interpreter_or_prints():
    banned = {"exit", "quit", "_exit", "abort", "breakpoint", "input", "print"}
    for file in PACKAGE.rglob("*.py"):
        if {"cli", "cli.py", "__main__.py"} & set(file.relative_to(PACKAGE).parts):
            continue
        for node in ast.walk(ast.parse(file.read_text())):
            if isinstance(node, ast.Call):
                name = getattr(node.func, "id", getattr(node.func, "attr", ""))
                owner = getattr(getattr(node.func, "value", None), "id", "")
                called = name in banned and (
                    isinstance(node.func, ast.Name) or owner in ("sys", "os")
                )
                assert not called, f"{file.name} line {node.lineno}: {name}()"
            if isinstance(node, ast.Raise):
                raised = getattr(node.exc, "id", getattr(getattr(node.exc, "func", None), "id", ""))
                assert raised not in ("SystemExit", "KeyboardInterrupt"), file


# 7. Global state is changed.

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
    return subprocess.run(
        [sys.executable, "-W", "error::UserWarning:ctrl_realize", "-c", code],
        cwd=folder,
        env=environment,
        capture_output=True,
        text=True,
        timeout=120,
        check=False,
    )


def test_neither_import_nor_work_changes_global_state(tmp_path):
    done = run(GLOBAL_STATE, tmp_path)
    assert done.stdout == "unchanged\n", done.stdout + done.stderr
    assert done.stderr == ""


# 8. A file can only be imported from its own folder.

IMPORT_ALL = """
import importlib, pkgutil
import ctrl_realize
names = [m.name for m in pkgutil.walk_packages(ctrl_realize.__path__, "ctrl_realize.")]
for name in names:
    if not name.endswith("__main__"):
        importlib.import_module(name)
print(len(names))
"""


def test_every_module_imports_from_any_folder(tmp_path):
    done = run(IMPORT_ALL, tmp_path)
    assert done.returncode == 0, done.stderr
    assert int(done.stdout) > 40
    assert list(tmp_path.iterdir()) == []


# 9. Results are random where no seed was given.


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


# 10. A bound whose two sides scale differently.


@given(st.floats(-250, 250), st.integers(1, 5), st.integers(0, 30))
def test_both_sides_of_the_error_bound_scale_with_the_data(exponent, order, delay):
    scale = 2.0 ** round(exponent / 4)
    rng = np.random.default_rng(3)
    g = cr.delayed_ss(CORE, delay).markov(120) + 1e-3 * rng.standard_normal(120)
    one, other = (
        cr.realize(data, order, delay=delay, hankel="padded", dt=0.1) for data in (g, scale * g)
    )
    # a power of two changes no digit of the data
    assert_allclose(other.fit.error_bound, scale * one.fit.error_bound, rtol=1e-9)
    z = np.exp(1j * np.linspace(0, np.pi, 200))
    for model, data in ((one, g), (other, scale * g)):
        exact = np.polynomial.polynomial.polyval(1 / z, data)
        exact -= np.polynomial.polynomial.polyval(1 / z, data[:delay]) if delay else 0
        assert np.abs(model(z) - exact).max() <= model.fit.error_bound * (1 + 1e-9)


# And from the habits that others' tests taught.


@pytest.mark.parametrize(
    ("dead_time", "dt", "delay"),
    [(0.3, 0.1, 3), (1.0, 0.2, 5), (3.2, 0.4, 8), (0.7, 0.1, 7), (2.9, 0.1, 29), (1e-3, 1e-4, 10)],
)
def test_a_dead_time_of_whole_samples_is_known_as_one(dead_time, dt, delay):
    # 0.3 / 0.1 is 2.9999999999999996
    model = cr.delayed_ss(lag(1.0), dead_time=dead_time, dt=dt)
    assert model.delay == delay
    assert not model.D.any()


def test_exact_data_with_a_free_direct_term_fit_two_delays_and_the_convention_chooses():
    g = cr.delayed_ss(CORE, 5).markov(200)
    scan = cr.estimate_delay(g, 2, max_delay=12, feedthrough=True, dt=0.1).fit
    # G_5 = 0 is a direct term as good as G_6 is one of the next delay
    assert scan.iae[5] < 1e-9 * np.abs(g).sum()
    assert scan.iae[6] < 1e-9 * np.abs(g).sum()
    assert scan.iae[7] > 0.1
    low, high = scan.delay_interval
    assert low <= 5 < 6 <= high


def test_the_three_lines_of_the_readme_work():
    record = step_record(R3, noise=1e-3)
    sys = cr.identify(cr.Record(record.time, record.input, record.output))
    omega = np.geomspace(1, 100, 20)
    frf = cr.MeasuredFRF(sys(np.exp(1j * omega * TS)), omega / (2 * np.pi))
    assert isinstance(sys, ct.StateSpace)
    assert len(ct.bode_plot([sys, frf], omega).lines) == 2
