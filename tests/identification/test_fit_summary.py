"""From the numbers of a fit to the model and the words of the result, on fits by hand."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

from ctrl_realize.identification.fit_summary import fitted_core, summarise
from ctrl_realize.numerics.output_error_result import OutputErrorFit, StructureFit
from ctrl_realize.numerics.separable_fit import Structure
from ctrl_realize.wording import interval_in_time

DT = 0.1


def line(order, degree, delay=1.0, low=np.nan, high=np.nan, excess=0.0):
    return StructureFit(
        Structure(order, degree), delay, delay + 2.0, excess, low, high, np.array([-1.0 + 0j])
    )


def fit(**changed):
    """6 (s + 3) / ((s + 1)(s + 2)(s + 6)) behind 1 s: a gain of 1.5, with nothing to tell."""
    values = {
        "delay": 1.0,
        "low": 0.9,
        "high": 1.2,
        "std": 0.05,
        "structure": Structure(3, 2),
        "poles": np.array([-1.0, -6.0, -2.0]) + 0j,
        "numerator": np.array([18.0, 6.0]),
        "adequate": True,
        "misfit": 1.25,
        "residual": 0.02,
        "correlation": 1.0,
        "structures": (line(3, 2, low=0.9, high=1.2), line(1, 1, 1.5, excess=30.0)),
        "views": (),
        "fitted": np.linspace(0.0, 2.0, 100),
        "profile": (np.array([0.9, 1.0]), np.array([4.0, 0.0])),
        "latest": 5.0,
    }
    return OutputErrorFit(**values | changed)


def data(motion=SimpleNamespace(onset=11.5), edge=20):  # noqa: B008  # read only
    return SimpleNamespace(
        output=np.linspace(0.0, 1.0, 100), edge=edge, dt=DT, motion=motion, sigma=0.01
    )


TIME = DT * np.arange(-20, 80)


def summed_up(given=None, found=None, **changed):
    return summarise(found or fit(**changed), given or data(), TIME, ("r",), ("flag",))


def test_numbers_of_the_fit_are_those_of_the_result():
    result = summed_up()
    assert (result.dead_time, result.std, result.interval) == (1.0, 0.05, (0.9, 1.2))
    assert (result.order, result.relative_degree, result.structure) == (3, 2, (3, 2))
    assert (result.at_noise_level, result.misfit) == (True, 1.25)
    assert (result.noise, result.residual, result.correlation) == (0.01, 0.02, 1.0)
    assert (result.dt, result.records, result.flags, result.views) == (DT, ("r",), ("flag",), {})
    np.testing.assert_array_equal(result.time, TIME)
    np.testing.assert_array_equal(result.measured, np.linspace(0.0, 1.0, 100))
    np.testing.assert_array_equal(result.fitted, np.linspace(0.0, 2.0, 100))
    np.testing.assert_array_equal(result.profile_delay, [0.9, 1.0])
    np.testing.assert_array_equal(result.profile_excess, [4.0, 0.0])
    views = (("whole", 1.0), ("early", 1.1))
    assert summed_up(views=views).views == {"whole": 1.0, "early": 1.1}


def test_the_total_delay_is_dead_time_and_lags_less_leads():
    result = summed_up()
    assert result.total_delay == pytest.approx(1 + 1 + 1 / 2 + 1 / 6 - 1 / 3, rel=1e-12)
    assert result.gain == pytest.approx(1.5, rel=1e-12)
    np.testing.assert_array_equal(result.poles, [-6.0, -2.0, -1.0])
    np.testing.assert_allclose(result.zeros, [-3.0], rtol=1e-12)


def test_zeros_are_sorted_and_of_a_gain_alone_there_are_none():
    # (s + 2)(s + 5) = 10 + 7 s + s^2
    zeros = summed_up(numerator=np.array([10.0, 7.0, 1.0]), structure=Structure(3, 1)).zeros
    np.testing.assert_allclose(zeros, [-5.0, -2.0], rtol=1e-12)
    none = summed_up(numerator=np.array([18.0])).zeros
    assert none.shape == (0,)
    assert none.dtype == np.complex128


def test_a_pole_that_the_record_cannot_tell_from_zero_is_an_integrator():
    # 80 samples of 0.1 s behind the edge: 5e-3 / 8 s = 6.25e-4
    slow = summed_up(poles=np.array([-2.0, -6.24e-4]) + 0j, numerator=np.array([6.0]))
    np.testing.assert_array_equal(slow.poles, [-2.0, 0.0])
    assert slow.total_delay == pytest.approx(1.5, rel=1e-12)
    assert slow.gain == pytest.approx(3.0, rel=1e-12)  # the slope per second
    lag = summed_up(poles=np.array([-2.0, -6.26e-4]) + 0j, numerator=np.array([6.0]))
    np.testing.assert_array_equal(lag.poles, [-2.0, -6.26e-4])


def test_the_onset_is_a_time_and_without_a_step_there_is_none():
    assert summed_up().onset == pytest.approx(1.15, rel=1e-12)
    assert np.isnan(summed_up(given=data(motion=None)).onset)


def test_structures_that_are_ruled_out_have_no_interval():
    first, second = summed_up().structures
    assert (first.order, first.relative_degree, first.interval) == (3, 2, (0.9, 1.2))
    assert (second.dead_time, second.total_delay, second.excess) == (1.5, 3.5, 30.0)
    assert second.interval is None


def test_arrays_of_the_result_cannot_be_changed():
    result = summed_up()
    for name in ("poles", "zeros", "profile_delay", "profile_excess", "time", "measured", "fitted"):
        assert not getattr(result, name).flags.writeable


# the model


@pytest.mark.parametrize(
    ("poles", "numerator"),
    [
        ([-4.0], [8.0]),
        ([0.0], [2.0]),
        ([-1.0, -2.0, -6.0], [18.0, 6.0]),
        ([-1.0, -100.0], [5.0]),
        ([-3 + 4j, -3 - 4j, 0.0], [1.0, 2.0, 3.0]),
        ([-1e6, -1e6, -2e6], [1e18, 1e11]),
    ],
)
def test_the_model_is_the_ratio_of_its_polynomials(poles, numerator):
    poles = np.array(poles) + 0j
    core = fitted_core(fit(numerator=np.array(numerator)), poles)
    assert core.nstates == poles.size
    assert core.dt == 0
    size = max(abs(poles).max(), 1.0)
    for s in (0.3j * size, 1.7j * size, (0.2 + 0.1j) * size):
        exact = np.polyval(numerator[::-1], s) / np.prod(s - poles)
        assert complex(core(s)) == pytest.approx(exact, rel=1e-9)


def test_the_entries_of_the_model_are_comparable():
    # poles 1 and 100: in units of 10 rad/s the polynomial is s^2 + 10.1 s + 1
    core = fitted_core(fit(numerator=np.array([500.0])), np.array([-1.0, -100.0, 0.0]) + 0j)
    np.testing.assert_allclose(core.A, 10 * np.array([[0, 1, 0], [0, 0, 1], [0, -1, -10.1]]))
    np.testing.assert_allclose(core.B, [[0.0], [0.0], [10.0]])
    np.testing.assert_allclose(core.C, [[0.5, 0.0, 0.0]])  # 500 / 10^3
    np.testing.assert_array_equal(core.D, [[0.0]])
    alone = fitted_core(fit(numerator=np.array([2.0])), np.array([0j]))
    assert (alone.A.item(), alone.B.item(), alone.C.item()) == (0.0, 1.0, 2.0)


# the words


def told(**changed):
    return summed_up(**changed).choices


def test_the_model_was_chosen_among_structures():
    assert told() == (
        "order 3, relative degree 2: lowest information criterion of 2 structures, where zeros and "
        "a fourth pole must be worth it",
        "interval: profile likelihood of 1 structure(s) that the data cannot rule out",
    )
    assert told(chain="chain of 8 lags")[0].startswith("chain of 8 lags: lowest")


def test_where_no_model_leaves_only_noise_the_views_decide():
    model, delay = told(views=(("whole", 1.0),), adequate=False)
    assert "2 structures with up to three poles, where" in model
    assert delay.startswith("dead time: median of five views")


def test_a_flow_is_followed_by_the_model():
    flow = told(follows_flow=True)[0]
    assert flow.startswith("dead time: that of a flow")
    assert "than all 2 structures; order 3, relative degree 2: follows it" in flow


def test_an_open_start_and_coloured_noise_are_told():
    assert told(open_start=True)[2].startswith("interval widened by the first motion")
    assert told(correlation=3.21)[2].endswith("3.21 samples count as one")
    assert told(correlation=1.01)[2].startswith("the residual is correlated: 1.01 samples")
    whitened = told(correlation=3.21, whitened=True)
    assert "generalised least squares" in whitened[2]
    assert "instead of counting 3.21 samples as one" in whitened[2]
    assert len(whitened) == 3
    assert len(told(whitened=True)) == 3


def test_what_reaches_beyond_the_structures_is_named():
    within = [line(3, 2, low=0.9, high=1.1), line(2, 2, low=1.0, high=1.2), line(1, 1)]
    beside = (
        ("inside", 0.9, 1.2),
        ("below", 0.89, 1.0),
        ("above", 1.0, 1.21),
    )
    _, interval = told(structures=tuple(within), beside=beside)
    assert interval == (
        f"interval: profile likelihood of 2 structure(s), below ({interval_in_time(0.89, 1.0)}), "
        f"above ({interval_in_time(1.0, 1.21)}) that the data cannot rule out"
    )
    _, alone = told(structures=(line(1, 1),), beside=beside[:1])
    assert alone == (
        f"interval: profile likelihood of inside ({interval_in_time(0.9, 1.2)}) that the data "
        "cannot rule out"
    )
