"""Cases of another library's tests of delay systems, evaluated with python-control's names.

The cases are those of ``lib/ControlSystemsBase/test/test_delayed_systems.jl`` of ControlSystems.jl
(commit 154f41b7): expressions, and the frequency responses or errors that are expected of them.
What is a property of the other language, such as types, is left out.
"""

from __future__ import annotations

import platform
import warnings
from collections.abc import Callable
from datetime import date
from pathlib import Path
from typing import Any

import control as ct
import numpy as np

import ctrl_realize as cr

S = ct.tf("s")
ORDERS = dict(enumerate((0.05, 1e-3, 1e-5, 1e-7, 1e-11, *[1e-14] * 5), start=1))
"""Order of an approximation of a dead time of 0.8 s, and its error at 1 rad/s that is allowed."""
TABLE = Path(__file__).resolve().parents[2] / "docs" / "tables" / "textbook_table.md"
Expected = Callable[[np.ndarray], Any]
Case = tuple[Callable[[], Any], Expected, np.ndarray, float]
"""System, its response, the points s or z where they are compared, and the largest difference."""

AXIS = 1j * np.arange(9.0)
CLOSE = 1e-12


def e(tau: float) -> Expected:
    """Response of a dead time."""
    return lambda s: np.exp(-tau * s)


def p1(s: Any) -> Any:
    """One lag, of a transfer function or of numbers."""
    return 1 / (s + 1)


def p2(s: Any) -> Any:
    """A lag with feedthrough."""
    return (s + 1) / (s + 2)


def placed(system: Any, row: int, column: int) -> Any:
    """Put a system into one entry of two rows and columns."""
    return np.eye(2)[:, [row]] * system * np.eye(2)[[column]]


def square(entries: list[list[Any]]) -> Any:
    """Make a system of two rows and columns."""
    parts = [placed(entries[i][j], i, j) for i in (0, 1) for j in (0, 1)]
    return parts[0] + parts[1] + parts[2] + parts[3]


def distillation() -> Any:
    """The column of Wood and Berry."""
    gains, lags = [[12.8, -18.9], [6.6, -19.4]], [[16.7, 21.0], [10.9, 14.4]]
    delays = [[1.0, 3.0], [7.0, 3.0]]
    return square(
        [
            [ct.tf([gains[i][j]], [lags[i][j], 1]) * cr.delay(delays[i][j]) for j in (0, 1)]
            for i in (0, 1)
        ]
    )


def lossless(s: np.ndarray) -> np.ndarray:
    return np.ones_like(s)


def two(s: Any) -> Any:
    """Half at once and half after 2 s."""
    return 0.5 + 0.5 * np.exp(-2 * s)


def three(s: Any) -> Any:
    return 1 + np.exp(-2 * s) + np.exp(-3 * s)


def responses() -> dict[str, dict[str, Case]]:
    """Systems with the responses that they have, by group."""
    d, fb = cr.delay, ct.feedback
    P1, P2 = cr.DelaySystem(ct.ss(p1(S))), cr.DelaySystem(ct.ss(p2(S)))
    G2, G3 = 0.5 + 0.5 * d(2), 1 + d(2) + d(3)
    F1 = e(1)
    loops: dict[str, tuple[Callable[[], Any], Expected]] = {
        "feedback(1, P1)": (lambda: fb(1, P1), lambda s: 1 / (1 + p1(s))),
        "feedback(P1, 1)": (lambda: fb(P1, 1), lambda s: p1(s) / (1 + p1(s))),
        "feedback(P1, P1)": (lambda: fb(P1, P1), lambda s: p1(s) / (1 + p1(s) ** 2)),
        "feedback(1, 0.5)": (
            lambda: fb(1, cr.DelaySystem(ct.ss([], [], [], [[0.5]], 0))),
            lambda s: 2 / 3 + 0 * s,
        ),
        "feedback(1, P2)": (lambda: fb(1, P2), lambda s: 1 / (1 + p2(s))),
        "feedback(0.5, delay)": (lambda: fb(0.5, d(2)), lambda s: 0.5 / (1 + 0.5 * e(2)(s))),
        "feedback(delay, 0.5)": (lambda: fb(d(2), 0.5), lambda s: e(2)(s) / (1 + 0.5 * e(2)(s))),
        "feedback(P1, delay)": (lambda: fb(P1, d(1)), lambda s: p1(s) / (1 + F1(s) * p1(s))),
        "feedback(delay, P1)": (lambda: fb(d(1), P1), lambda s: F1(s) / (1 + F1(s) * p1(s))),
        "feedback(P1 delay, 1)": (
            lambda: fb(P1 * d(1), 1),
            lambda s: p1(s) * F1(s) / (1 + F1(s) * p1(s)),
        ),
        "feedback(1, P1 delay)": (lambda: fb(1, P1 * d(1)), lambda s: 1 / (1 + F1(s) * p1(s))),
        "feedback(1, P2 0.5 (1 + delay))": (
            lambda: fb(1, P2 * 0.5 * (1 + d(2))),
            lambda s: 1 / (1 + p2(s) * two(s)),
        ),
        "feedback(1, 0.5 P2 (1 + delay))": (
            lambda: fb(1, 0.5 * P2 * (1 + d(2))),
            lambda s: 1 / (1 + p2(s) * two(s)),
        ),
        "feedback(1, P1 (0.5 + 0.5 delay))": (
            lambda: fb(1, P1 * G2),
            lambda s: 1 / (1 + p1(s) * two(s)),
        ),
        "feedback(P1, 0.5 + 0.5 delay)": (
            lambda: fb(P1, G2),
            lambda s: p1(s) / (1 + p1(s) * two(s)),
        ),
        "feedback(P2, 0.5 + 0.5 delay)": (
            lambda: fb(P2, G2),
            lambda s: p2(s) / (1 + p2(s) * two(s)),
        ),
        "feedback(1, 1 + two delays)": (lambda: fb(1, G3), lambda s: 1 / (1 + three(s))),
        "feedback(1, P1 (two delays))": (
            lambda: fb(1, P1 * (d(2) + d(3))),
            lambda s: 1 / (1 + p1(s) * (e(2)(s) + e(3)(s))),
        ),
        "feedback(P1, G G P2 P2)": (
            lambda: fb(1.0 * P1, G3 * G3 * P2 * P2),
            lambda s: p1(s) / (1 + three(s) ** 2 * p1(s) * p2(s) ** 2),
        ),
    }
    sums: dict[str, tuple[Callable[[], Any], Expected]] = {
        "delay(1)": (lambda: d(1), F1),
        "delay(2.5)": (lambda: d(2.5), e(2.5)),
        "3.5 delay": (lambda: 3.5 * d(2.5), lambda s: 3.5 * e(2.5)(s)),
        "delay 1.5": (lambda: d(2.5) * 1.5, lambda s: 1.5 * e(2.5)(s)),
        "1 + delay": (lambda: 1 + d(1), lambda s: 1 + F1(s)),
        "1 - delay": (lambda: 1 - d(1), lambda s: 1 - F1(s)),
        "P1": (lambda: P1, p1),
        "P2": (lambda: P2, p2),
        "P1 + delay": (lambda: P1 + d(1), lambda s: p1(s) + F1(s)),
        "P1 - delay": (lambda: P1 - d(1), lambda s: p1(s) - F1(s)),
        "2 delay": (lambda: 2 * d(1), lambda s: 2 * F1(s)),
        "2 (P1 delay)": (lambda: 2 * (P1 * d(1)), lambda s: 2 * p1(s) * F1(s)),
        "P1 delay": (lambda: P1 * d(1), lambda s: p1(s) * F1(s)),
        "delay P1": (lambda: d(1) * P1, lambda s: p1(s) * F1(s)),
        "P2 delay": (lambda: P2 * d(1), lambda s: p2(s) * F1(s)),
        "delay P2": (lambda: d(1) * P2, lambda s: p2(s) * F1(s)),
        "1 + delay(2)": (lambda: 1 + d(2), lambda s: 1 + e(2)(s)),
        "0.5 + 0.5 delay": (lambda: G2, two),
        "1 + delay + delay": (lambda: G3, three),
        "exp(-2 s)": (lambda: ct.exp(-2 * S), e(2)),
    }
    z = np.exp(0.5j * np.array([0.5, 1.0, 1.5, 2.0]))
    sampled: dict[str, tuple[Callable[[], Any], Expected]] = {
        "delay(1, 1)": (lambda: d(1, 1), lambda z: 1 / z),
        "delay(1, 0.2)": (lambda: d(1, 0.2), lambda z: z**-5.0),
        "delay(3.2, 0.4)": (lambda: d(3.2, 0.4), lambda z: z**-8.0),
        "c2d(feedback(1 / s, delay))": (
            lambda: ct.c2d(fb(ct.ss([0], [1], [1], [0]), d(1.5)), 0.5),
            lambda z: 0.5 / (z - 1 + 0.5 * z**-3.0),
        ),
        "c2d(feedback(delay, delay))": (
            lambda: ct.c2d(fb(d(1.5), d(1.0)), 0.5),
            lambda z: z**-3.0 / (1 + z**-5.0),
        ),
        "c2d(feedback(0.5, delay))": (
            lambda: ct.c2d(fb(0.5, d(1.5)), 0.5),
            lambda z: 0.5 / (1 + 0.5 * z**-3.0),
        ),
    }
    everywhere = np.array([0, 1j, 1, 1 + 1j])
    low, w = 1j * np.array([0, 0.1, 0.2]), 1j * 10 ** np.arange(-2, 2.01, 0.1)
    column = distillation()
    inner = [[fb(ct.ss(1 / S), d(1)), ct.ss(1 / S)], [P1, ct.ss(1 / (S + 10))]]
    several: dict[str, Case] = {
        "append(P1, P2)": (
            lambda: ct.append(P1, P2),
            lambda s: np.stack([[p1(s), 0 * s], [0 * s, p2(s)]]),
            AXIS,
            CLOSE,
        ),
        "[P1 0; 0 P2]": (
            lambda: placed(P1, 0, 0) + placed(P2, 1, 1),
            lambda s: np.stack([[p1(s), 0 * s], [0 * s, p2(s)]]),
            AXIS,
            CLOSE,
        ),
        "[2, -delay]": (
            lambda: np.array([[1.0, 0.0]]) * 2 + (-d(1)) * np.array([[0.0, 1.0]]),
            lambda s: np.stack([[2 + 0 * s, -F1(s)]]),
            AXIS,
            CLOSE,
        ),
        "a loop in a matrix": (
            lambda: square(inner)[0, 0],
            lambda s: 1 / (s + F1(s)),
            w,
            CLOSE,
        ),
        "two Pade terms of a column": (lambda: column.pade(2), lambda s: column(s), low, 0.02),
        "three Pade terms of a column": (lambda: column.pade(3), lambda s: column(s), low, 5e-4),
        "three Pade terms of its loop": (
            lambda: fb(1, column).pade(3),
            lambda s: fb(1, column)(s),
            low,
            1e-4,
        ),
    }
    approximated: dict[str, Case] = {
        "pade(1 s, 1)": (lambda: d(1).pade(1), ct.tf([-0.5, 1], [0.5, 1]), AXIS, CLOSE),
        "pade(1 s, 2)": (
            lambda: d(1).pade(2),
            ct.tf([1 / 12, -0.5, 1], [1 / 12, 0.5, 1]),
            AXIS,
            CLOSE,
        ),
        "pade of a loop": (
            lambda: fb(1, P1 * d(1)).pade(2),
            lambda s: fb(1, (P1 * d(1)).pade(2))(s),
            AXIS,
            CLOSE,
        ),
    }
    for order, error in ORDERS.items():
        made = d(0.8).pade(order)
        names = f"pade(0.8 s, {order})"
        approximated |= {
            f"{names} at 0": (lambda made=made: made, lossless, np.array([0j]), CLOSE),
            f"{names} at 2 rad/s": (
                lambda made=made: made,
                lambda s, made=made: made(s) / abs(made(s)),
                np.array([2j]),
                CLOSE,
            ),
            f"{names} at 1 rad/s": (lambda made=made: made, e(0.8), np.array([1j]), 10 * error),
        }
    return {
        "products and sums": {
            **{name: (*case, AXIS, CLOSE) for name, case in sums.items()},
            "delay(2) at any s": (lambda: d(2), e(2), everywhere, CLOSE),
        },
        "loops": {name: (*case, AXIS, CLOSE) for name, case in loops.items()},
        "several channels": several,
        "sampled": {name: (*case, z, CLOSE) for name, case in sampled.items()},
        "Pade approximations": approximated,
    }


REFUSED: dict[str, Callable[[], Any]] = {
    "delay(1, 0.3)": lambda: cr.delay(1, 0.3),
    "exp(-s^2 - 2 s)": lambda: ct.exp(-(S**2) - 2 * S),
    "exp(-2 s + 1)": lambda: ct.exp(-2 * S + 1),
    "exp of a vector": lambda: ct.exp([-2 * S, -S]),
    "exp(2 s)": lambda: ct.exp(2 * S),
    "1 / [P1 P1; P1 P1]": lambda: 1 / square([[p1(S)] * 2] * 2),
}
"""What is refused, with an error."""

DIFFERENT = {
    "c2d(feedback(1 / s, delay))": "the input of the delay moves between samples: theirs holds it, "
    "`to_discrete` interpolates it and says how far off that is",
}


def difference(case: Case) -> float:
    """Largest difference from what is expected."""
    system, expected, points, _ = case
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        return float(np.abs(system()(points) - expected(points)).max())


def refused(call: Callable[[], Any]) -> bool:
    """Whether a call is answered with an error."""
    try:
        call()
    except (ValueError, TypeError):
        return True
    return False


def table() -> str:
    """Count by groups what agrees."""
    lines = ["| cases | number | agree | differ |", "|---|---|---|---|"]
    for group, cases in responses().items():
        apart = [name for name, case in cases.items() if not difference(case) <= case[3]]
        told = "; ".join(f"`{name}`: {DIFFERENT.get(name, 'not explained')}" for name in apart)
        lines.append(f"| {group} | {len(cases)} | {len(cases) - len(apart)} | {told} |")
    right = sum(refused(call) for call in REFUSED.values())
    lines += [
        f"| refused with an error | {len(REFUSED)} | {right} |  |",
        "",
        f"Made on {date.today()} by `python -m benchmarks.loops.textbook` with Python "
        f"{platform.python_version()}, ctrl-realize {cr.__version__}, control {ct.__version__}, "
        f"numpy {np.__version__}.",
        "",
    ]
    return "\n".join(lines)


if __name__ == "__main__":
    with cr.extend_control():
        TABLE.write_text(table(), encoding="utf-8")
