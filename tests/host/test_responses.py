"""Time and frequency responses: the answers of `StateSpace`, for any delay.

`gangof4_response` is left out: python-control 0.10.2 evaluates discrete systems at jw there.
"""

import control as ct
import numpy as np
import pytest

from tests.host.pairs import CORES, DELAYS, DT, GRID, KINDS, OTHER, assert_same, pair, quietly

N = 90
T = DT * np.arange(N)
U = np.sin(0.3 * np.arange(N)) + (np.arange(N) > 10)
NOISE = np.random.default_rng(0).standard_normal(N)  # fifty lags of anything smooth are alike


def rows(s):
    """An input for any number of channels."""
    return U if s.ninputs == 1 else np.stack([U * (k + 1) for k in range(s.ninputs)])


def state(s):
    return np.cos(np.arange(s.nstates))


ANY = {
    "step": lambda s: ct.step_response(s, T),
    "step to an end": lambda s: ct.step_response(s, 4.0),
    "step with states": lambda s: ct.step_response(s, T, return_states=True),
    "step of one channel": lambda s: ct.step_response(s, T, input_indices=0, output_indices=0),
    "step from a state": lambda s: ct.step_response(s, T, state(s)),
    "step, shorter than delays": lambda s: ct.step_response(s, T[:20]),
    "simulate": lambda s: (
        s.simulate(rows(s)) if isinstance(s, KINDS) else ct.forced_response(s, T, rows(s)).outputs
    ),
    "step, unsqueezed": lambda s: ct.step_response(s, T, squeeze=False),
    "step, squeezed": lambda s: ct.step_response(s, T, squeeze=True),
    "step, transposed": lambda s: ct.step_response(s, T, transpose=True).outputs,
    "step as a tuple": lambda s: tuple(ct.step_response(s, T)),
    "impulse": lambda s: ct.impulse_response(s, T),
    "impulse of one channel": lambda s: ct.impulse_response(s, T, input_indices=0),
    "initial": lambda s: ct.initial_response(s, T, state(s)),
    "initial of one output": lambda s: ct.initial_response(s, T, state(s), output_indices=0),
    "forced": lambda s: ct.forced_response(s, T, rows(s)),
    "forced from a state": lambda s: ct.forced_response(s, T, rows(s), state(s)),
    "forced with states": lambda s: ct.forced_response(s, T, rows(s), return_states=True),
    "forced without time": lambda s: ct.forced_response(s, inputs=rows(s)),
    "forced, single precision": lambda s: ct.forced_response(s, T, rows(s).astype("f4")),
    "input_output": lambda s: ct.input_output_response(s, T, rows(s)),
    "input_output from a state": lambda s: ct.input_output_response(s, T, rows(s), state(s)),
    "call of the response": lambda s: ct.step_response(s, T)(squeeze=False).outputs,
    "kinds of the response": lambda s: [
        (made.ntraces, made.trace_types)
        for made in (ct.step_response(s, T), ct.impulse_response(s, T))
    ],
    "labels of the response": lambda s: ct.forced_response(s, T, rows(s)).output_labels,
    "frequency response": lambda s: ct.frequency_response(s, GRID),
    "frequency response as a tuple": lambda s: tuple(ct.frequency_response(s, GRID)),
    "frequency response, Hz": lambda s: ct.frequency_response(s, GRID / 7, Hz=True),
    "frequency response, unsqueezed": lambda s: ct.frequency_response(s, GRID, squeeze=False).phase,
    "frequency response, method": lambda s: s.frequency_response(GRID),
    "frequency response, limits": lambda s: ct.frequency_response(
        s, omega_limits=[0.1, 9], omega_num=20
    ),
    "frequency response of two": lambda s: list(ct.frequency_response([s, 2 * s], GRID)),
    "singular values": lambda s: ct.singular_values_response(s, GRID).magnitude,
    "frd": lambda s: ct.frd(s, GRID),
    "frd, twice": lambda s: ct.frd(s, GRID) * 2,
    "frd plus number": lambda s: ct.frd(s, GRID) + 1,
    "frd, smooth": lambda s: ct.frd(s, GRID, smooth=True).eval(GRID[3] * 1.01),
}  # fmt: skip

SISO = {
    "step_info": lambda s: ct.step_info(s, timepts=DT * np.arange(300)),
    "bode": lambda s: ct.bode_plot(s, GRID, plot=False),
    "nyquist count": lambda s: ct.nyquist_response(0.05 * s, omega=GRID).count,
    "nyquist contour": lambda s: ct.nyquist_response(0.05 * s, omega=GRID).response,
    "frd times a system": lambda s: ct.frd(s, GRID) * OTHER,
    "system times frd": lambda s: s * ct.frd(OTHER, GRID),
    "frd over a system": lambda s: ct.frd(OTHER, GRID) / s,
    "frd in feedback": lambda s: ct.frd(0.1 * s, GRID).feedback(1),
    "phase, wrapped": lambda s: ct.frequency_response(s, GRID).phase,
    "disk margins": lambda s: ct.disk_margins(0.05 * s, GRID),
    "norm of the loop": lambda s: ct.norm(ct.feedback(0.1 * s, 1), 2),
    "eigensys_realization": lambda s: np.abs(
        ct.eigensys_realization(ct.impulse_response(s, T), 2, m=40, n=40)[1][:4]
    ),
    "markov": lambda s: ct.markov(ct.forced_response(s, T, NOISE), 50),
}  # fmt: skip

ALL = {
    **{f"any: {name}": operation for name, operation in ANY.items()},
    **{f"one channel: {name}": operation for name, operation in SISO.items()},
}
CASES = [
    (core, operation)
    for operation in ALL
    for core in CORES
    if operation.startswith("any") or core == "siso"
]

CASES = [(core, operation, delay) for core, operation in CASES for delay in DELAYS]
CASES += [("loop", operation, 37) for operation in ALL]
CASES += [("loop of channels", operation, 37) for operation in ALL if operation.startswith("any")]


@pytest.mark.parametrize(("core", "operation", "delay"), CASES)
def test_the_answer_is_that_of_state_space(core, operation, delay):
    ours, theirs = pair(core, delay)
    assert_same(quietly(ALL[operation], ours), quietly(ALL[operation], theirs))
