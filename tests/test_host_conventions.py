"""Where python-control has a word or a habit, records, models and controllers follow it."""

import control as ct
import numpy as np
import pytest

import ctrl_realize as cr

T = 0.01 * np.arange(400)
U = (T >= 1.0).astype(float)
PLANT = cr.DelayedStateSpace(ct.ss([[0.9]], [[1.0]], [[0.1]], [[0.0]], 0.01), 37, name="valve")
RECORD = cr.Record(T, U, PLANT.simulate(U))
PULSE = PLANT.markov(200)


def test_a_record_tells_its_shape_with_the_names_of_a_system():
    wide = cr.Record(T, np.stack([U, U]), U)
    assert (RECORD.ninputs, RECORD.noutputs, RECORD.issiso()) == (1, 1, True)
    assert (wide.ninputs, wide.noutputs, wide.issiso()) == (2, 1, False)
    assert RECORD.to_response().issiso is True


@pytest.mark.parametrize(
    "drawn",
    [RECORD, cr.unit_step(RECORD), cr.ImpulseResponse(PULSE, 0.01), PLANT],
    ids=lambda drawn: type(drawn).__name__,
)
def test_what_was_measured_and_models_have_a_plot(drawn):
    assert isinstance(drawn.plot(), ct.ControlPlot)


def test_the_plot_of_a_model_is_its_step_response_with_the_dead_time():
    (line, *_) = PLANT.plot(until=1.0).axes[0, 0].get_lines()
    time, response = line.get_data()
    np.testing.assert_array_equal(response, PLANT.step(101))
    assert time[np.flatnonzero(response)[0]] == pytest.approx(
        0.38
    )  # after the sample in which it sets in


def test_the_plot_of_a_model_with_several_channels_has_a_line_for_each():
    core = ct.ss([[0.9]], [[1.0, 2.0]], [[0.1], [0.2]], np.zeros((2, 2)), 0.01)
    wide = cr.DelayedStateSpace(core, [3, 8])
    lines = wide.plot().axes[0, 0].get_lines()
    count = lines[0].get_xdata().size
    expected = wide.step(count).reshape(4, count)
    np.testing.assert_array_equal([line.get_ydata() for line in lines], expected)


CASES = {
    "hankel": lambda case: cr.realize(PULSE, 1, delay=37, dt=0.01, hankel=case("padded")),
    "scan": lambda case: cr.estimate_delay(
        PULSE, 1, max_delay=50, dt=0.01, samples=100, hankel=case("padded")
    ),
    "difference": lambda case: cr.impulse_from_step(
        cr.unit_step(RECORD), cutoff_hz=None, difference=case("central")
    ),
    "kind and rule": lambda case: cr.design.pid(PLANT, rule=case("amigo"), kind=case("pid")),
    "reduction": lambda case: cr.design.reduce_fopdt(PLANT, method=case("half_rule")),
    "missing": lambda case: cr.Record(T, U, U, missing=case("keep")),
    "sampling": lambda case: cr.ImpulseResponse(PULSE, 0.01, sampling=case("impulse-invariant")),
    "start": lambda case: cr.validation.predict(PLANT, RECORD, 1, start=case("rest")),
    "comparison": lambda case: cr.design.compare_pid(PLANT, [case("simc")], [case("pi")]),
}


@pytest.mark.parametrize("name", CASES)
def test_strings_for_kinds_and_rules_are_taken_in_any_case(name):
    texts = [repr(CASES[name](case)) for case in (str.lower, str.upper, str.capitalize)]
    assert texts[0] == texts[1] == texts[2]
    result = CASES[name](str.upper)
    same = CASES[name](str.lower)
    for attribute in ("missing", "sampling", "hankel", "rule", "kind"):
        assert getattr(result, attribute, None) == getattr(same, attribute, None)


def test_another_word_is_still_refused():
    with pytest.raises(cr.errors.OptionError, match="choose one of 'square', 'padded'"):
        cr.realize(PULSE, 1, dt=0.01, hankel="squared")
