"""One system twice: as `DelayedStateSpace`, and as python-control's own class.

Only what python-control answers well of the augmented matrices is compared. The chain is a Jordan
block: zeros, polynomials, canonical forms and eigenvalues of what mixes it with the core are
rounding (a zero at -2.3e16 with one BLAS kernel, none with another), and so are default grids,
which hang on them. Those are compared without a delay, or have oracles of their own in
`tests/test_delayed.py` and `tests/design`.
"""

import warnings
from typing import Any

import control as ct
import numpy as np
from numpy.testing import assert_allclose

import ctrl_realize as cr

DELAYS = [0, 37]
DT = 0.05


def _stable(n: int, p: int, m: int, seed: int, direct: bool) -> ct.StateSpace:
    rng = np.random.default_rng(seed)
    A = rng.standard_normal((n, n))
    A *= 0.9 / np.abs(np.linalg.eigvals(A)).max()
    D = rng.standard_normal((p, m)) if direct else np.zeros((p, m))
    return ct.ss(A, rng.standard_normal((n, m)), rng.standard_normal((p, n)), D, DT)


CORES = {
    "siso": _stable(3, 1, 1, 0, direct=False),
    "mimo": _stable(4, 2, 2, 2, direct=True),
    "wide": _stable(3, 2, 3, 3, direct=False),
}
LOOPS = ("loop", "loop of channels")  # around the cores so named: their delays are internal ones
KINDS = cr.DelaySystem, cr.DelayedStateSpace
OTHER = _stable(2, 1, 1, 5, direct=True)
OTHER_TF = ct.tf([0.5, 0.1], [1, -0.4], DT)
OTHER_MIMO = _stable(3, 2, 2, 6, direct=True)


def pair(core: str, delay: int) -> tuple[cr.DelayedStateSpace, ct.StateSpace]:
    """Ours, and python-control's with the same matrices, names and labels."""
    plant = CORES.get(core, CORES["mimo" if "channels" in core else "siso"])
    before = [delay // (k + 1) for k in range(plant.ninputs)]  # channels with delays of their own
    behind = [delay * k // 9 for k in range(plant.noutputs)]
    ours = cr.delayed_ss(plant, before, output_delay=behind)
    if core in LOOPS:
        back = OTHER if ours.issiso() else cr.delayed_ss(OTHER_MIMO, [2, 5])
        ours = ct.feedback(0.1 * ours, back)
    ours.update_names(name="plant")
    theirs = ct.StateSpace(
        *(np.array(M) for M in (ours.A, ours.B, ours.C, ours.D)),
        ours.dt,
        name="plant",
        inputs=ours.input_labels,
        outputs=ours.output_labels,
        states=ours.state_labels,
        remove_useless_states=False,
    )
    return ours, theirs


GRID = np.geomspace(0.05, 0.98 * np.pi / DT, 12)


def answers(result: Any) -> list[Any]:
    """Flatten any result of python-control to arrays and plain values that can be compared.

    Systems are compared by what they do: two realizations of one system are both right.
    """
    if isinstance(result, ct.StateSpace | ct.TransferFunction):
        z = np.exp(1j * GRID * DT) if result.isdtime(strict=True) else 1j * GRID
        return [result.dt, (result.ninputs, result.noutputs), result.horner(z)]
    if isinstance(result, ct.FrequencyResponseData):
        # not the labels: ours go through products, python-control's do not
        return [result.frdata, result.omega, result.dt]
    if isinstance(result, ct.TimeResponseData):
        parts = [result.t, result.y, result.x, result.u, np.asarray(result.outputs)]
        labels = [result.output_labels, result.input_labels, result.state_labels, result.sysname]
        # an impulse response has array(None) for its input
        arrays = [np.asarray(part) for part in parts if np.asarray(part).dtype.kind in "fc"]
        return [*arrays, len(arrays), *labels]
    if isinstance(result, dict):
        return [entry for key in sorted(result, key=str) for entry in (key, *answers(result[key]))]
    if isinstance(result, list | tuple):
        return [entry for part in result for entry in answers(part)]
    return [result]


def assert_same(ours: Any, theirs: Any, rtol: float = 1e-9, atol: float = 1e-10) -> None:
    """Compare two results, part by part.

    The default tolerance is what python-control's own solves with the augmented matrices leave
    near Nyquist; ours go through the core.
    """
    if isinstance(theirs, ct.StateSpace):
        assert ours.nstates <= theirs.nstates  # delays that meet merge
    left, right = answers(ours), answers(theirs)
    assert len(left) == len(right)
    for a, b in zip(left, right, strict=True):
        if isinstance(b, np.ndarray | float | complex | np.number):
            assert np.shape(a) == np.shape(b)
            assert_allclose(a, b, rtol=rtol, atol=atol, equal_nan=True)
        else:
            assert a == b, (a, b)


def quietly(operation: Any, system: Any) -> Any:
    """Call python-control without its own warnings, which are not what is compared."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        return operation(system)
