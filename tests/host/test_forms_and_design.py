"""Forms, reductions, design, names, figures: the answers of `StateSpace`, for any delay.

What python-control refuses of its own class, for want of Slycot or of a controllable plant, it
refuses of ours with the same error.
"""

from __future__ import annotations

import contextlib
import io

import control as ct
import matplotlib.pyplot as plt
import numpy as np
import pytest

from tests.host.pairs import DELAYS, DT, GRID, OTHER, assert_same, pair, quietly

T = DT * np.arange(60)
Z = np.exp(1j * GRID * DT)
SLYCOT = ct.slycot_check()
CVXOPT = ct.cvxopt_check()


def form(made):
    """A canonical form: the system, and the transformation where it is told."""
    return [made[0].A, made[0].B, made[0].C, made[1]]


def drawn(plot):
    """The lines that a plot of python-control draws."""
    plt.figure()
    try:
        plot()
        figure = plt.gcf()
        lines = [line for axes in figure.axes for line in axes.lines]
        return [np.asarray(line.get_xydata(), dtype=float) for line in lines]
    finally:
        plt.close("all")


def weights(s):
    return np.eye(s.nstates), np.eye(s.ninputs)


def renamed(s):
    """Names given after the fact, on a copy."""
    named = s.copy()
    named.set_inputs([f"a{k}" for k in range(s.ninputs)])
    named.set_outputs([f"b{k}" for k in range(s.noutputs)])
    named.set_states([f"c{k}" for k in range(s.nstates)])
    return [named.input_labels, named.output_labels, named.state_labels, named(np.exp(0.3j))]


def updated(s):
    named = s.copy()
    named.update_names(name="other", inputs=[f"a{k}" for k in range(s.ninputs)])
    return [named.name, named.input_labels, named.output_labels]


def connections(system):
    said = io.StringIO()
    with contextlib.redirect_stdout(said):
        system.connection_table(show_names=True)
    return [said.getvalue()]


def regulator(s):
    """A state feedback as python-control wires it up, and what it does in the loop."""
    K = 0.01 * np.ones((s.ninputs, s.nstates))
    measured = ct.ss(s.A, s.B, np.eye(s.nstates), 0, s.dt, inputs=s.input_labels, name="all")
    controller, loop = ct.create_statefbk_iosystem(measured, K)
    return [controller.input_labels, loop(np.exp(0.3j))]


OPERATIONS = {
    "reachable form": lambda s: form(ct.reachable_form(s)),
    "observable form": lambda s: form(ct.observable_form(s)),
    "modal form": lambda s: np.sort_complex(ct.modal_form(s)[0].poles()),
    "canonical form": lambda s: form(ct.canonical_form(s, "reachable")),
    "observability": lambda s: ct.obsv(s.A, s.C),
    "gramian": lambda s: ct.gram(s, "c"),
    "factor of a gramian": lambda s: ct.gram(s, "of"),
    "states kept": lambda s: ct.model_reduction(s, keep_states=[0], method="truncate"),
    # what they do: of 78 states, each of which counts, python-control keeps 76
    "minimal": lambda s: ct.minimal_realization(s)(Z),
    "minimal, method": lambda s: s.minreal()(Z),
    "ss2io": lambda s: ct.ss2io(s) if hasattr(ct, "ss2io") else s,
    # gain and cost; the closed loop's poles at and near 0 are a Jordan block's
    "LQR": lambda s: ct.lqr(s, *weights(s))[:2],
    "discrete LQR": lambda s: ct.dlqr(s, *weights(s))[:2],
    "LQE": lambda s: ct.dlqe(s, np.eye(s.ninputs), np.eye(s.noutputs))[:2],
    # of two inputs and 78 states it does not end
    "pole placement": lambda s: ct.place(
        s.A, s.B[:, :1], 0.1 + 0.8 * np.arange(s.nstates) / s.nstates
    ),
    "Ackermann": lambda s: ct.place_acker(s.A, s.B, 0.1 * np.ones(s.nstates)),
    "state feedback": regulator,
    "estimator": lambda s: (
        ct.create_estimator_iosystem(
            s, np.eye(s.ninputs), np.eye(s.noutputs), name="seen"
        ).state_labels
    ),
    "describing function": lambda s: (
        ct.describing_function_response(
            s, ct.saturation_nonlinearity(1.0), np.linspace(0.5, 4, 5), GRID, warn_nyquist=False
        ).N_vals
    ),
    "norm, largest gain": lambda s: ct.system_norm(s, "inf"),
    "passive": lambda s: bool(ct.ispassive(s)),
    "passive, method": lambda s: s.ispassive(),
    "weights on a plant": lambda s: ct.augw(s, w1=ct.tf([1], [1, -0.5], DT)),
    "common time base": lambda s: ct.common_timebase(s.dt, OTHER.dt),
    "is a system": lambda s: [ct.issys(s), isinstance(s, ct.InputOutputSystem)],
    "unwrapped phase": lambda s: ct.unwrap(np.angle(s(Z)).ravel()),
    "names given later": renamed,
    "names updated": updated,
    "places of names": lambda s: [
        s.find_inputs(s.input_labels[:1]),
        s.find_outputs(s.output_labels[-1:]),
        s.find_states(s.state_labels[:1]),
        s.find_output("none"),
        s.find_input("none"),
    ],
    "table of a response": lambda s: (
        ct.step_response(s, T).to_pandas().select_dtypes("number").to_numpy()
    ),
    "responses put together": lambda s: (
        ct.combine_time_responses([ct.step_response(s, T), ct.step_response(2 * s, T)]).outputs
    ),
    "connections": lambda s: connections(
        ct.interconnect([s.copy(name="P")], inplist="P", outlist="P")
    ),
    "feedback, several": lambda s: ct.feedback(0.02 * s, np.ones((s.ninputs, s.noutputs)), sign=1),
    "to a power": lambda s: s**3,
    "inverse": lambda s: s**-1,
    "divided by itself": lambda s: s / s,
    "number over it": lambda s: 1 / s,
    "as an array": lambda s: np.array([[1.0]]) + s,
    "joined in parallel": lambda s: ct.parallel(s, s, -s),
    "transposed response": lambda s: (
        ct.forced_response(
            s, T, np.ones((T.size, s.ninputs) if s.ninputs > 1 else T.size), transpose=True
        ).outputs
    ),
    "bode plot": lambda s: drawn(lambda: ct.bode_plot(s, GRID)),
    "step plot": lambda s: drawn(lambda: ct.step_response(s, T).plot()),
    "singular value plot": lambda s: drawn(lambda: ct.singular_values_plot(s, GRID)),
    "Nichols plot": lambda s: drawn(lambda: ct.nichols_plot(s, GRID)),
    "Nyquist plot": lambda s: drawn(lambda: ct.nyquist_plot(0.05 * s, GRID)),
}


def outcome(operation, system):
    """What an operation gives, or by which error it ends."""
    try:
        return quietly(operation, system)
    except Exception as error:
        # ours are kinds of the builtin ones
        kinds = type(error).__mro__
        return next(kind.__name__ for kind in kinds if kind.__module__ == "builtins")


NEEDS_SLYCOT = {"modal form", "gramian", "factor of a gramian", "minimal", "minimal, method"}
NEEDS_CVXOPT = {"passive", "passive, method"}
LEFT_OUT = (set() if SLYCOT else NEEDS_SLYCOT) | (set() if CVXOPT else NEEDS_CVXOPT)
NAMES = sorted(set(OPERATIONS) - LEFT_OUT)
# Without a direct term there is no proper inverse: python-control has a TypeError without a reason.
NO_INVERSE = {("inverse", "siso"), ("number over it", "siso")}
# They mix the chain with the core, or turn the powers of its Jordan block into a matrix.
WITHOUT_DELAY = {
    "reachable form", "observable form", "modal form", "canonical form", "pole placement",
    "Ackermann", "norm, largest gain",
}  # fmt: skip
CASES = [
    (name, core, delay)
    for name in NAMES
    for core in ("siso", "mimo")
    for delay in DELAYS
    # a picture of four channels takes a second, some of Slycot's routines minutes for 78 states
    if not (name.endswith("plot") or name in NEEDS_SLYCOT) or core == "siso"
    if not (name in WITHOUT_DELAY and delay)
    if (name, core) not in NO_INVERSE and not (name in ("inverse", "number over it") and delay)
]
# python-control halves an interval until this is left
LOOSE = {"norm, largest gain": 1e-5}


@pytest.mark.parametrize(("name", "core", "delay"), CASES)
def test_the_outcome_is_that_of_state_space(name, core, delay):
    ours, theirs = pair(core, delay)
    rtol = LOOSE.get(name, 1e-8)
    assert_same(outcome(OPERATIONS[name], ours), outcome(OPERATIONS[name], theirs), rtol=rtol)
