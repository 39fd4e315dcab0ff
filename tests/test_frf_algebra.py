"""Arithmetic of measured responses: deviations by derivatives, coherence and hold by laws."""

import contextlib

import control as ct
import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

import ctrl_realize as cr
from ctrl_realize.errors import DataError, DataWarning, UnsuitableSystemError

HZ = np.array([0.5, 2.0, 8.0])
OMEGA = 2 * np.pi * HZ
DT = 0.01
PLANT = 1 / (1 + 0.05j * OMEGA) * np.exp(-0.1j * OMEGA)
SECOND = 2 / (1 + 0.2j * OMEGA)
STD = np.array([0.01, 0.02, 0.005])
CONTROLLER = ct.tf([1.0, -0.9], [1.0, -1.0], DT)
K = CONTROLLER(np.exp(1j * OMEGA * DT))
LEAD = ct.tf([0.1, 1], [0.01, 1])


def measured(values=PLANT, std=STD, **more) -> cr.MeasuredFRF:
    given = {"coherence": [0.99, 0.9, 0.8], "repeats": 5, "sample_time": DT, **more}
    return cr.MeasuredFRF(values, HZ, std=std, **given)


def bare(values=PLANT, std=STD) -> cr.MeasuredFRF:
    return cr.MeasuredFRF(values, HZ, std=std)


ALONE = {
    "-H": (lambda H: -H, lambda h: -h),
    "3 H": (lambda H: 3 * H, lambda h: 3 * h),
    "NumPy number * H": (lambda H: np.float64(3) * H, lambda h: 3 * h),
    "H / 2j": (lambda H: H / 2j, lambda h: h / 2j),
    "H * discrete": (lambda H: H * CONTROLLER, lambda h: h * K),
    "discrete * H": (lambda H: CONTROLLER * H, lambda h: h * K),
    "state space * H": (lambda H: ct.ss(CONTROLLER) * H, lambda h: h * K),
    "delayed * H": (
        lambda H: cr.delayed_ss(CONTROLLER, 7) * H,
        lambda h: h * K * np.exp(-7j * OMEGA * DT),
    ),
    "continuous * H": (lambda H: LEAD * H, lambda h: h * LEAD(1j * OMEGA)),
    "matrix of one * H": (lambda H: np.array([[2.0]]) * H, lambda h: 2 * h),
    "H / system": (lambda H: H / CONTROLLER, lambda h: h / K),
    "H + 1": (lambda H: H + 1, lambda h: h + 1),
    "1 - H": (lambda H: 1 - H, lambda h: 1 - h),
    "H - system": (lambda H: H - LEAD, lambda h: h - LEAD(1j * OMEGA)),
    "system - H": (lambda H: LEAD - H, lambda h: LEAD(1j * OMEGA) - h),
    "system + H": (lambda H: CONTROLLER + H, lambda h: K + h),
    "1 / H": (lambda H: 1 / H, lambda h: 1 / h),
    "system / H": (lambda H: ct.ss(LEAD) / H, lambda h: LEAD(1j * OMEGA) / h),
    "H ** 2": (lambda H: H**2, lambda h: h**2),
    "H ** -2": (lambda H: H**-2, lambda h: h**-2),
    "H * H": (lambda H: H * H, lambda h: h * h),
    "H + H": (lambda H: H + H, lambda h: h + h),
    "H - H": (lambda H: H - H, lambda h: h - h),
    "H / H": (lambda H: H / H, lambda h: h / h),
    "H ** 0": (lambda H: H**0, lambda h: h**0),
    "feedback": (lambda H: H.feedback(CONTROLLER), lambda h: h / (1 + h * K)),
    "positive feedback": (lambda H: ct.feedback(H, 0.5, 1), lambda h: h / (1 - 0.5 * h)),
}


TWO = {
    "sum": (lambda a, b: a + b, lambda a, b: a + b),
    "difference": (lambda a, b: a - b, lambda a, b: a - b),
    "product": (lambda a, b: a * b, lambda a, b: a * b),
    "quotient": (lambda a, b: a / b, lambda a, b: a / b),
    "feedback of two": (lambda a, b: a.feedback(b), lambda a, b: a / (1 + a * b)),
}


@pytest.mark.parametrize("operation", [*ALONE, *TWO])
def test_the_deviation_is_the_derivative_times_that_of_each_independent_response(operation):
    frf, plain = (ALONE | TWO)[operation]
    single = operation in ALONE
    values, std = ([PLANT], [STD]) if single else ([PLANT, SECOND], [STD, 2 * STD])
    made = frf(*(bare(*each) for each in zip(values, std, strict=True)))
    assert type(made) is cr.MeasuredFRF
    assert made.std.shape == (3,)
    assert_allclose(made.complex, plain(*values), rtol=1e-12, atol=1e-14)
    # All of these are analytic functions: a difference quotient along one direction will do.
    step, squares = 1e-6, 0.0
    for i, own in enumerate(std):
        ahead, behind = (
            plain(*(value + h * (k == i) for k, value in enumerate(values))) for h in (step, -step)
        )
        squares = squares + np.abs((ahead - behind) / (2 * step) * own) ** 2
    assert_allclose(made.std, np.sqrt(squares), rtol=1e-7, atol=1e-12)
    assert made.name == "measured" or not single


@pytest.mark.parametrize(
    ("operation", "second", "hold", "warned"),
    [
        ("sum", DT, DT, False),
        ("sum", None, None, True),
        ("sum", 2 * DT, None, True),
        ("product", None, DT, False),
        ("product", DT, None, True),
        ("quotient", DT, None, False),  # it cancels
        ("quotient", None, DT, False),
        ("quotient", 2 * DT, None, True),
    ],
)
def test_the_hold_of_two_responses_is_told_or_warned_of(operation, second, hold, warned, recwarn):
    first = measured(coherence=None)
    other = measured(SECOND, coherence=None, repeats=9, sample_time=second)
    made = TWO[operation][0](first, other)
    assert made.sample_time == hold
    assert [w.category for w in recwarn] == [DataWarning] * warned
    assert made.repeats == 5


def test_channels_are_multiplied_as_matrices():
    rng = np.random.default_rng(1)
    H = rng.standard_normal((2, 3, 3)) + 1j * rng.standard_normal((2, 3, 3))
    std = rng.uniform(0.1, 0.2, (2, 3, 3))
    frf = cr.MeasuredFRF(H, HZ, std=std, outputs=["a", "b"], inputs=["p", "q", "r"])
    M = rng.standard_normal((2, 2))
    left = M * frf
    assert_allclose(left.frdata, np.einsum("ij,jkw->ikw", M, H))
    assert_allclose(left.std**2, np.einsum("ij,jkw->ikw", M**2, std**2))
    assert (left.input_labels, left.output_labels) == (["p", "q", "r"], ["a", "b"])
    assert_allclose((frf * CONTROLLER).frdata, H * K)
    assert_allclose((frf * CONTROLLER).std, std * np.abs(K))
    back = rng.standard_normal((3, 2))
    closed = frf.feedback(back)
    for k in range(3):
        h = H[:, :, k]
        assert_allclose(closed.frdata[:, :, k], np.linalg.solve(np.eye(2) + h @ back, h))
    # one entry moved alone, the sum of squares over all of them
    total = np.zeros((2, 3, 3))
    for i, j in np.ndindex(2, 3):
        moved = H.copy()
        moved[i, j] += 1e-6
        change = cr.MeasuredFRF(moved, HZ).feedback(back).frdata - closed.frdata
        total += np.abs(change / 1e-6) ** 2 * std[i, j] ** 2
    assert_allclose(closed.std, np.sqrt(total), rtol=1e-4)


UNSORTED_HZ = np.array([3.0, 1.0, 2.0])
LABELS = {"inputs": ["a", "b", "c"], "outputs": ["x", "y"]}
RNG = np.random.default_rng(0)
RESPONSE = RNG.standard_normal((2, 3, 3)) + 1j * RNG.standard_normal((2, 3, 3))
COHERENCE, SPREADS = RNG.uniform(size=(2, 3, 3)), RNG.uniform(size=(2, 3, 3))


@pytest.fixture
def frf():
    return cr.MeasuredFRF(
        RESPONSE, UNSORTED_HZ, coherence=COHERENCE, std=SPREADS, repeats=7, name="rig", **LABELS
    )


@pytest.mark.parametrize(
    ("key", "rows", "columns"),
    [
        ((slice(None), 0), [0, 1], [0]),
        ((1, slice(1, 3)), [1], [1, 2]),
        (([0, 1], ["a", "c"]), [0, 1], [0, 2]),
        ((slice(None), slice(None)), [0, 1], [0, 1, 2]),
    ],
)
def test_coherence_and_deviation_go_with_the_channels(frf, key, rows, columns):
    part = frf[key]
    assert isinstance(part, cr.MeasuredFRF)
    rising = np.argsort(UNSORTED_HZ)
    for name, values in (("frdata", RESPONSE), ("coherence", COHERENCE), ("std", SPREADS)):
        assert_array_equal(getattr(part, name), values[np.ix_(rows, columns, rising)])
    assert_array_equal(part.frequency_hz, [1.0, 2.0, 3.0])
    assert part.repeats == part.between_hz(1.0, 2.0).repeats == 7


@pytest.mark.parametrize("operation", [*TWO, "plus number", "inverse"])
def test_the_warning_stands_where_the_user_wrote_the_operation(operation):
    frf = {"plus number": lambda a, b: 1 + a, "inverse": lambda a, b: 1 / a}
    with pytest.warns(DataWarning) as caught:
        TWO.get(operation, (frf.get(operation),))[0](measured(), measured(SECOND))
    assert {warning.filename for warning in caught} == {__file__}


@pytest.mark.parametrize("factor", [1 - 2.3e-16, 1 + 1e-12])
def test_frequencies_may_differ_in_their_last_bits(factor):
    hz = np.geomspace(0.1, 13, 50)
    model = cr.delayed_ss(ct.tf([1], [0.08, 1]), 37, dt=7.8125e-4)
    frf = cr.MeasuredFRF(model(np.exp(2j * np.pi * hz * model.dt)), hz)
    asked = frf.omega * factor
    assert np.any(asked != frf.omega)
    assert_array_equal(frf.frequency_response(asked).complex, frf.complex)
    assert_array_equal((frf * cr.MeasuredFRF(frf.complex, hz * factor)).complex, frf.complex**2)
    with pytest.raises(ValueError, match="not all frequencies"):
        frf.frequency_response(frf.omega * 1.001)


@pytest.mark.parametrize(
    ("operation", "lost", "words"),
    [
        *(
            (name, None, None)
            for name in ("-H", "3 H", "H * discrete", "delayed * H", "H / system")
        ),
        *(
            (name, "coherence", "no known coherence")
            for name in ("H + 1", "H - system", "feedback")
        ),
        ("1 / H", "sample_time", r"exactly one hold of 0\.01 s"),
    ],
)
def test_what_an_operation_does_not_know_is_left_out_with_a_word_and_all_else_stays(
    operation, lost, words
):
    with pytest.warns(DataWarning, match=words) if words else contextlib.nullcontext():
        made = ALONE[operation][0](measured())
    expected = {"coherence": [0.99, 0.9, 0.8], "repeats": 5, "sample_time": DT}
    if lost:
        assert getattr(made, lost) is None
        del expected[lost]
    for name, value in expected.items():
        assert_array_equal(getattr(made, name), value, err_msg=name)


def test_a_deviation_that_one_side_lacks_is_left_out_with_a_word():
    with pytest.warns(DataWarning, match="no known standard deviation"):
        made = bare() * cr.MeasuredFRF(SECOND, HZ)
    assert made.std is None
    both = ct.append(bare(), bare(SECOND, 2 * STD))  # beside another one they stay
    assert_allclose([both.std[0, 0], both.std[1, 1]], [STD, 2 * STD])
    assert_allclose(both.frdata[1, 1], SECOND)


def test_what_does_not_fit_is_refused():
    for operation, match in (
        (lambda H: H * cr.MeasuredFRF([1.0, 2.0], [1.0, 2.0]), "different frequencies"),
        (lambda H: H + cr.MeasuredFRF(PLANT, HZ * 1.001), "different frequencies"),
        (lambda H: np.ones((2, 2)) * H * np.ones((3, 1)), "as many inputs"),
        (lambda H: H.feedback(np.ones((2, 2))), "feedback of shape"),
        (lambda H: 1 / ct.append(H, H), "one channel"),
        (lambda H: ct.append(H, H) ** 2, "one channel"),
    ):
        with pytest.raises(DataError, match=match):
            operation(bare())
    with pytest.raises(UnsuitableSystemError, match="dt=True"):
        _ = bare() * ct.tf([1], [1, 0.5], True)
    for operation in (lambda H: H * "a", lambda H: H - None, lambda H: {} + H):
        with pytest.raises(TypeError):
            operation(bare())
