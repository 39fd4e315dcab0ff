"""Values, poles, algebra, indexing, conversion: the answers of `StateSpace`, for any delay."""

import copy
import pickle

import control as ct
import numpy as np
import pytest

import ctrl_realize as cr
from tests.host.pairs import (
    CORES,
    DELAYS,
    DT,
    GRID,
    KINDS,
    LOOPS,
    OTHER,
    OTHER_MIMO,
    OTHER_TF,
    assert_same,
    pair,
    quietly,
)

Z = np.exp(1j * GRID * DT)
PID = cr.design.PIDController(0.5, 0.2, dt=DT)
JOINED = ct.interconnect(
    [ct.ss(PID, name="P", inputs="e", outputs="v"), ct.ss(OTHER, name="F", inputs="v")],
    inplist="P.e",
    outlist="F.y[0]",
)

SLYCOT = ct.slycot_check()


def in_order(roots: np.ndarray) -> np.ndarray:
    """Sort roots so that rounding cannot swap the two of a conjugate pair."""
    return roots[np.lexsort((roots.imag, np.round(roots.real, 9)))]


def without_registers(system: ct.StateSpace) -> list:
    """What a choice of channels does; ours leaves out the delays of the other channels."""
    labels = [system.input_labels, system.output_labels, system.name]
    pulses = ct.impulse_response(system, DT * np.arange(60)).outputs
    return [system.dt, system.horner(Z), system(Z), pulses, *labels]


ANY = {
    "call": lambda s: s(Z),
    "call at one point": lambda s: s(0.3 + 0.4j),
    "call unsqueezed": lambda s: s(Z[:1], squeeze=False),
    "call squeezed": lambda s: s(Z[:1], squeeze=True),
    "horner": lambda s: s.horner(Z),
    "horner at one point": lambda s: s.horner(1j),
    # Slycot's routine wants states.
    "slow horner": lambda s: s.slycot_laub(Z) if SLYCOT and s.nstates else s.horner(Z),
    "evalfr": lambda s: ct.evalfr(s, 0.85),
    "dcgain": lambda s: s.dcgain(),
    "dcgain without warning": lambda s: ct.dcgain(s),
    "poles": lambda s: in_order(s.poles()),
    "ct.poles": lambda s: in_order(ct.poles(s)),
    "shapes": lambda s: [s.ninputs, s.noutputs, s.nstates, s.issiso()],
    "time base": lambda s: [s.dt, s.isdtime(), s.isdtime(strict=True), s.isctime(), ct.timebase(s)],
    "labels": lambda s: [s.input_labels, s.output_labels, s.state_labels, s.name],
    "find labels": lambda s: [s.find_input("u"), s.find_input("u[0]"), s.find_state("x[0]")],
    "matrices": lambda s: [s.A, s.B, s.C, s.D],
    "negated": lambda s: -s,
    "times a number": lambda s: 3 * s,
    "number behind": lambda s: s * -0.5,
    "times a NumPy number": lambda s: np.float64(2.0) * s,
    "divided": lambda s: s / 4,
    "plus a number": lambda s: s + 2.0,
    "number plus": lambda s: 2.0 + s,
    "minus a number": lambda s: s - 1.0,
    "number minus": lambda s: 1.0 - s,
    "plus itself": lambda s: s + s,
    "minus itself": lambda s: s - s,
    "ct.ss": lambda s: ct.ss(s),
    "StateSpace": lambda s: ct.StateSpace(s),
    "ssdata": lambda s: ct.ssdata(s),
    "copy": lambda s: s.copy(),
    "copy.copy": lambda s: copy.copy(s),
    "copy.deepcopy": lambda s: copy.deepcopy(s),
    # python-control's own class cannot be pickled
    "pickle": lambda s: pickle.loads(pickle.dumps(s)) if isinstance(s, KINDS) else s,
    "negate": lambda s: ct.negate(s),
    "append": lambda s: ct.append(s, s),
    "append method": lambda s: s.append(OTHER),
    "one channel": lambda s: without_registers(s[0, 0]),
    "a row of channels": lambda s: without_registers(s[0, :]),
    "returnScipySignalLTI": lambda s: [
        x.to_ss().A if hasattr(x, "to_ss") else x for row in s.returnScipySignalLTI() for x in row
    ],
    "dynamics": lambda s: s.dynamics(0, np.arange(s.nstates) / 9, np.arange(s.ninputs) + 1.0),
    "output": lambda s: s.output(0, np.arange(s.nstates) / 9, np.arange(s.ninputs) + 1.0),
    "ctrb": lambda s: ct.ctrb(s.A, s.B),
    "static": lambda s: s._isstatic(),
    "linearize": lambda s: s.linearize(np.zeros(s.nstates), np.zeros(s.ninputs)),
    "H2 norm": lambda s: ct.norm(s, 2),
    "negative feedback of gain": lambda s: ct.feedback(s, np.full((s.ninputs, s.noutputs), 0.02)),
    "positive feedback of gain": lambda s: s.feedback(
        np.full((s.ninputs, s.noutputs), 0.02), sign=1
    ),
}  # fmt: skip

SISO = {
    "times a system": lambda s: s * OTHER,
    "system times": lambda s: OTHER * s,
    "times a transfer function": lambda s: s * OTHER_TF,
    "times a PID controller": lambda s: s * PID,
    "PID controller times": lambda s: PID * s,
    "series with joined subsystems": lambda s: ct.series(JOINED, s),
    "feedback around a system of ours": lambda s: ct.feedback(cr.DelaySystem(OTHER), 0.1 * s),
    "plus a system": lambda s: s + OTHER,
    "system plus": lambda s: OTHER + s,
    "minus a system": lambda s: s - OTHER,
    "system minus": lambda s: OTHER - s,
    "quotient": lambda s: OTHER / (1 + 0.05 * s),
    "number over": lambda s: 1 / (1 + 0.05 * s),
    "plus a transfer function": lambda s: s + OTHER_TF,
    "squared": lambda s: s**2,
    "to the zeroth": lambda s: s**0,
    "series": lambda s: ct.series(s, OTHER),
    "series behind": lambda s: ct.series(OTHER, s, OTHER),
    "series with itself": lambda s: ct.series(s, s),
    "parallel": lambda s: ct.parallel(s, OTHER),
    "parallel behind": lambda s: ct.parallel(OTHER, s),
    "feedback": lambda s: ct.feedback(0.1 * s, 1),
    "feedback around a system": lambda s: ct.feedback(OTHER, 0.1 * s),
    "feedback with itself": lambda s: ct.feedback(0.1 * s, 0.1 * s),
    "feedback with a transfer function": lambda s: ct.feedback(0.1 * s, OTHER_TF),
    "unit feedback of one": lambda s: ct.feedback(1, 0.1 * s),
    "stacked by a matrix": lambda s: np.array([[1.0], [2.0]]) * s,
    "interconnect": lambda s: ct.interconnect(
        [s.copy(name="P"), OTHER.copy(name="K"), ct.summing_junction(["r", "-y"], "e", name="S")],
        connections=[["K", "S.e"], ["P", "K"], ["S.y", "P"]],
        inplist=["S.r"], outlist=["P"], inputs=["r"], outputs=["y"],
    ),
    "connect": lambda s: ct.connect(ct.append(s, OTHER), [[1, -2], [2, 1]], [1], [1]),
    "similar": lambda s: ct.similarity_transform(s, np.eye(s.nstates) * 2.0),
    "operating point": lambda s: ct.find_operating_point(s, np.zeros(s.nstates), [1.0])[0],
    "input chosen": lambda s: s[0:1, 0:1],
    "to a power": lambda s: s**3,
    "as an array": lambda s: np.array([[1.0]]) + s,
    "joined in parallel": lambda s: ct.parallel(s, s, -s),
    # of 78 states, each of which counts, Slycot keeps 76
    "minimal": lambda s: s.minreal()(Z) if SLYCOT else s(Z),
    "places of names": lambda s: [s.find_inputs(s.input_labels), s.find_states(s.state_labels[:1])],
}  # fmt: skip

MIMO = {
    "times a system": lambda s: s * OTHER_MIMO,
    "system times": lambda s: OTHER_MIMO * s,
    "times a matrix": lambda s: s * np.array([[1.0, 2.0], [0.5, -1.0]]),
    "matrix times": lambda s: np.array([[1.0, 2.0], [0.5, -1.0]]) * s,
    "plus a system": lambda s: s + OTHER_MIMO,
    "plus a matrix": lambda s: s + np.ones((2, 2)),
    "feedback": lambda s: ct.feedback(0.02 * s, OTHER_MIMO),
    "feedback of a system": lambda s: ct.feedback(0.02 * OTHER_MIMO, s),
    "a channel by name": lambda s: without_registers(s["y[1]", "u[0]"]),
    "channels by slice": lambda s: without_registers(s[::-1, 1:]),
    "channels by list": lambda s: without_registers(s[[1, 0], [0]]),
    "lft": lambda s: (0.05 * s).lft(0.1 * OTHER),
    "squared": lambda s: ct.series(s, s),
    "feedback of feedback": lambda s: ct.feedback(ct.feedback(0.02 * s, OTHER_MIMO), 0.01 * s),
    "loop times system": lambda s: ct.feedback(0.02 * s, OTHER_MIMO) * s + s,
    "matrix around": lambda s: np.diag([2.0, -1.0]) * ct.feedback(0.02 * s, s) * np.ones((2, 2)),
    "append a loop": lambda s: ct.append(s, ct.feedback(0.02 * s, OTHER_MIMO)),
    "singular values": lambda s: ct.singular_values_response(s, GRID),
    "inverse": lambda s: s**-1,
    "divided by itself": lambda s: s / s,
}  # fmt: skip

ALL = {
    **{f"any: {name}": operation for name, operation in ANY.items()},
    **{f"one channel: {name}": operation for name, operation in SISO.items()},
    **{f"channels: {name}": operation for name, operation in MIMO.items()},
}
CASES = [
    (core, operation)
    for operation in ALL
    for core in CORES
    if operation.startswith("any")
    or (operation.startswith("one channel") and core == "siso")
    or (operation.startswith("channels") and core == "mimo")
]

# Found by finite differences and by iteration, to what their steps and tolerances leave.
LOOSE = {"any: linearize", "one channel: interconnect", "one channel: operating point"}

# Matrices are asked for, or the other system is asked first; all else is a system with its delay.
PLAIN = {
    "any: ct.ss", "any: StateSpace", "any: linearize", "one channel: to the zeroth",
    "one channel: similar", "one channel: interconnect", "one channel: feedback around a system",
    "one channel: unit feedback of one", "channels: feedback of a system",
}  # fmt: skip

# python-control inverts the chain with the core, and where delays are mixed its poles are rounding
WITHOUT_DELAY = {"channels: inverse", "channels: divided by itself"}
MIXED = {"any: poles", "any: ct.poles"}  # compared in tests/test_delay_system.py

CASES = [
    (core, operation, delay)
    for core, operation in CASES
    for delay in DELAYS
    if not (delay and operation in WITHOUT_DELAY)
]
CASES += [("loop", name, 37) for name in ALL if not name.startswith("channels")]
CASES += [
    ("loop of channels", name, 37)
    for name in ALL
    if not (name.startswith("one channel") or name in WITHOUT_DELAY | MIXED)
]


@pytest.mark.parametrize(("core", "operation", "delay"), CASES)
def test_the_answer_is_that_of_state_space(core, operation, delay):
    ours, theirs = pair(core, delay)
    before = [M.copy() for M in (ours.A, ours.B, ours.C, ours.D)]
    rtol = 1e-6 if operation in LOOSE else 1e-9
    result, expected = (quietly(ALL[operation], system) for system in (ours, theirs))
    assert_same(result, expected, rtol=rtol)
    if isinstance(expected, ct.StateSpace):
        assert isinstance(result, KINDS) is (operation not in PLAIN)
        # the matrices that python-control asks for are those of the same system
        assert_same(ct.StateSpace(result, remove_useless_states=False), expected, rtol=rtol)
    for M, old in zip((ours.A, ours.B, ours.C, ours.D), before, strict=True):
        np.testing.assert_array_equal(M, old)
    assert isinstance(ours, cr.DelaySystem if core in LOOPS else cr.DelayedStateSpace)


@pytest.mark.parametrize("delay", DELAYS)
@pytest.mark.parametrize(
    "operation",
    ["call", "dcgain", "copy", "times a number", "plus itself", "one channel", "append"],
)
def test_a_core_without_states_is_answered_too(operation, delay):
    gain = cr.delayed_ss(ct.ss([], [], [], [[2.5]], DT), delay)
    plain = ct.StateSpace(gain, remove_useless_states=False)
    assert_same(quietly(ANY[operation], gain), quietly(ANY[operation], plain))
