"""Systems with dead time in python-control's hands: products, names, texts, warnings."""

import copy
import pickle

import control as ct
import numpy as np
import pytest
from numpy.testing import assert_array_equal

import ctrl_realize as cr
from ctrl_realize.errors import ModelWarning
from tests.rigs import R3, TS

Z = np.exp(1j * np.geomspace(0.5, 0.9 * np.pi / TS, 30) * TS)
NAMED = ct.ss(np.diag([0.5, 0.2]), [[1], [1]], [[1, 1]], 0, TS, states=["position", "speed"])


def plant(delay: int) -> cr.DelayedStateSpace:
    return cr.delayed_ss(R3, delay, dt=TS)


FILTER = ct.tf([0.5], [1, -0.5], TS)
POLYNOMIALS = {
    "tf * sys": lambda S: FILTER * S,
    "tf + sys": lambda S: FILTER + S,
    "tf - sys": lambda S: FILTER - S,
    "feedback(tf, sys)": lambda S: ct.feedback(FILTER, S),
    "tf(sys)": ct.tf,
    "ss2tf": ct.ss2tf,
    "root locus": lambda S: ct.root_locus_map(S, gains=[0.1]),
}


# python-control has its own word on margins at times, and SciPy on the polynomial
@pytest.mark.filterwarnings("ignore:stability_margins")
@pytest.mark.filterwarnings("ignore::scipy.signal.BadCoefficients")
@pytest.mark.parametrize("asked", POLYNOMIALS)
def test_polynomials_of_a_long_chain_are_warned_of_with_the_right_call(asked):
    with pytest.warns(ModelWarning, match=r"50.*design\.margins.*to_tf.*sys \+ tf") as caught:
        POLYNOMIALS[asked](plant(60))
    # where the user wrote it, not inside python-control
    assert {warning.filename for warning in caught if warning.category is ModelWarning} == {
        __file__
    }


RENAMINGS = {
    "update_names": lambda S: S.update_names(inputs=["current"], outputs=["position"]),
    "set_inputs": lambda S: (S.set_inputs(["current"]), S.set_outputs(["position"])),
    "dictionaries": lambda S: (
        setattr(S, "input_index", {"current": 0}),
        setattr(S, "output_index", {"position": 0}),
    ),
}


@pytest.mark.parametrize("renaming", RENAMINGS)
def test_channels_are_chosen_by_the_names_that_python_control_gave(renaming):
    G = plant(3)
    RENAMINGS[renaming](G)
    part = G["position", "current"]
    assert isinstance(part, cr.DelayedStateSpace)
    assert (part.input_labels, part.output_labels, part.delay) == (["current"], ["position"], 3)
    assert_array_equal(part(Z), G(Z))
    assert G.state_labels[-1] == "current[k-3]"
    assert G.delay_free.input_labels == ["current"]
    assert G[0, 0].delay_free.output_labels == ["position"]
    with pytest.raises((ValueError, KeyError)):
        G["y", "u"]


SHOWN = {
    "system": lambda: cr.delayed_ss(NAMED, 4, name="valve"),
    "loop": lambda: cr.interconnect(
        [
            cr.delayed_ss(NAMED, 30, name="P", inputs="u", outputs="y"),
            ct.summing_junction(["r", "-y"], "u"),
        ],
        inputs="r",
        outputs="y",
        name="valve",
    ),
    "controller": lambda: cr.design.PIDController(0.3, dt=TS, name="valve"),
    "predictor": lambda: cr.design.smith_predictor(
        plant(5), ct.tf([0.5, -0.498], [1, -1], TS), name="valve"
    ),
    "response": lambda: cr.MeasuredFRF(
        [1.0, 1 / 3], [0.1, 0.2], coherence=[1.0, 0.9], std=[0.1, 0.2], repeats=3, name="valve"
    ),
}


@pytest.mark.parametrize("kind", ["system", "loop", "controller", "response"])
def test_the_text_that_can_be_loaded_makes_the_same_again(kind):
    shown = SHOWN[kind]()
    shown.repr_format = "eval"
    names = {
        "array": np.array,
        "StateSpace": ct.StateSpace,
        "DelayedStateSpace": cr.DelayedStateSpace,
        "DelaySystem": cr.DelaySystem,
        "PIDController": cr.design.PIDController,
        "MeasuredFRF": cr.MeasuredFRF,
    }
    again = eval(repr(shown), names)
    assert type(again) is type(shown)
    again.repr_format = "eval"
    assert repr(again) == repr(shown)
    assert (again.name, again.input_labels) == (shown.name, shown.input_labels)
    if kind == "response":
        assert_array_equal(again.frdata, shown.frdata)
    else:
        assert_array_equal(again.A, shown.A)
        assert again.state_labels == shown.state_labels


@pytest.mark.filterwarnings("ignore:stability_margins")
@pytest.mark.filterwarnings("ignore::scipy.signal.BadCoefficients")
@pytest.mark.parametrize("asked", POLYNOMIALS)
def test_polynomials_of_a_short_chain_are_not_warned_of(asked):
    POLYNOMIALS[asked](plant(5))


@pytest.mark.parametrize("kind", SHOWN)
def test_the_form_of_the_text_is_the_one_that_python_control_was_told(kind):
    shown = SHOWN[kind]()
    line = repr(shown)
    assert "\n" not in line
    assert "valve" in line
    shown.repr_format = "info"
    assert repr(shown) == ct.iosys_repr(shown, format="info") == line
    assert ct.iosys_repr(shown, format="eval") != line
    shown.repr_format = "latex"
    assert repr(shown) == (shown._repr_html_() or line)
    shown.repr_format = "music"
    with pytest.raises(ValueError, match="music"):
        repr(shown)
    shown.repr_format = None
    with ct.config.defaults({"iosys.repr_format": "latex"}):
        assert repr(shown) == (shown._repr_html_() or line)


KEEPING = {
    "as made": lambda S: S,
    "negated": lambda S: -S,
    "scaled": lambda S: 2 * S * 0.5,
    "matrix": lambda S: np.array([[2.0]]) * S * np.array([[2.0]]),
    "indexed": lambda S: S[0, 0],
    "copied": copy.deepcopy,
    "pickled": lambda S: pickle.loads(pickle.dumps(S)),
    "renamed": lambda S: S.replace(name="other"),
    "delayed again": lambda S: cr.delayed_ss(S, 0),
}


@pytest.mark.parametrize("operation", KEEPING)
def test_the_names_of_the_core_s_states_are_kept(operation, tmp_path):
    S = KEEPING[operation](cr.delayed_ss(NAMED, 2))
    cr.save_model(tmp_path / "model.json", S)
    for one in (S, cr.load_model(tmp_path / "model.json")):
        assert one.state_labels == ["position", "speed", "u[k-1]", "u[k-2]"]
        assert one.delay_free.state_labels == ["position", "speed"]


def test_names_of_states_stay_apart_in_products_and_with_copies():
    S = cr.delayed_ss(NAMED, 2)
    integral = ct.ss(1, 1, 1, 0, TS, states=["sum"])
    assert (S * integral).delay_free.state_labels == ["sum", "position", "speed"]
    assert (integral * S).delay_free.state_labels == ["position", "speed", "sum"]
    assert (S * S).delay_free.state_labels == ["x[0]", "x[1]", "x[2]", "x[3]"]
    twice = cr.delayed_ss(ct.ss(S), 3)
    assert len(set(twice.state_labels)) == twice.nstates == 7
    S.set_states(["a", "b", "c", "d"])
    S.repr_format = "eval"
    for kept in (S, S.copy(), pickle.loads(pickle.dumps(S)), S.replace(name="b")):
        assert kept.state_labels == ["a", "b", "c", "d"]
        assert kept.delay_free.state_labels == ["a", "b"]
        assert kept.repr_format == "eval"
    assert S.replace(delay=1).state_labels == ["a", "b", "u[k-1]"]


def test_margin_counts_a_phase_of_180_degrees_at_an_end_of_the_axis():
    # at z = -1, and at z = 1 of a negative static gain: 91 of 176 were too large, or infinite
    rng, checked = np.random.default_rng(0), 0
    for _ in range(60):
        n = int(rng.integers(1, 4))
        A = rng.standard_normal((n, n))
        A *= rng.uniform(0.3, 0.95) / np.abs(np.linalg.eigvals(A)).max()
        core = ct.ss(A, rng.standard_normal((n, 1)), 0.2 * rng.standard_normal((1, n)), 0, 0.1)
        sys = cr.delayed_ss(core, int(rng.integers(0, 5)))
        found = cr.design.margins(sys)
        # a larger one is none that matters: the response is left out where the gain is below it
        if not (found.stable and found.gain_margin < 20):
            continue
        # it takes a cubic spline through points that are 0.1 rad apart
        margin = ct.margin(sys)[0]
        assert margin == pytest.approx(found.gain_margin, rel=1e-4)
        # the loop is on the border of stability there: a pole on the unit circle
        loop = ct.ss(sys.A, margin * sys.B, sys.C, margin * sys.D, 0.1).feedback()
        assert np.abs(np.abs(loop.poles()) - 1).min() < 1e-5
        checked += 1
    assert checked > 30


def test_margin_takes_a_pole_that_is_1_but_for_rounding_for_an_integrator():
    # as the bilinear transformation of python-control leaves that of many a PID
    plant = cr.delayed_ss(ct.tf([1], [1, 1]), 20, dt=0.01)
    exact, rounded = (ct.ss([[pole]], [[1.0]], [[0.02]], [[0.5]], 0.01) for pole in (1, 1 + 2**-52))
    # the spline of python-control is accurate to 1e-6
    assert ct.margin(plant * rounded) == pytest.approx(ct.margin(plant * exact), rel=1e-5)
