"""Several records of one plant with common dynamics and a gain for each."""

import functools
import pickle

import control as ct
import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy.optimize import least_squares

import ctrl_realize as cr
from ctrl_realize.errors import OptionError
from ctrl_realize.identification import RecordGains
from tests.rigs import codes

DT, DEAD_TIME, LAG, NOISE = 0.01, 0.123, 0.4, 0.01
GAINS = (1.0, 0.5, 0.25)
ONE_LAG = [(1, 1)]


def step(seed, gain, *, level=0.0, height=2.0, lag=LAG, n=700, dead_time=DEAD_TIME, noise=NOISE):
    """One step record of a lag with dead time, in closed form."""
    t = DT * np.arange(n)
    after = np.maximum(t - 1.0 - dead_time, 0.0)
    y = gain * height * -np.expm1(-after / lag)
    e = noise * np.random.default_rng(seed).standard_normal(n)
    return cr.Record(t, level + height * (t >= 1.0), 3.0 + y + e, name=f"at {level:g}")


def at_three_levels(seed=0, gains=GAINS, **kwargs):
    return [step(10 * seed + i, gain, level=2.0 * i, **kwargs) for i, gain in enumerate(gains)]


def moved(seed, gain, *, n=400):
    """A record with a random binary input, held for 5 samples."""
    rng = np.random.default_rng(seed)
    u = np.repeat(rng.choice([-1.0, 1.0], n // 5), 5)
    plant = cr.delayed_ss(ct.tf([gain], [LAG, 1]), dead_time=DEAD_TIME, dt=DT)
    y = np.asarray(plant.simulate(u)) + NOISE * rng.standard_normal(n)
    return cr.Record(DT * np.arange(n), u, y, name=f"no. {seed}")


def own(records, **kwargs):
    return cr.fit_output_error(records, structures=ONE_LAG, gains="own", **kwargs)


@functools.cache
def fitted(seed=0):
    """Model of three records at three levels, which several tests look at."""
    return own(at_three_levels(seed))


def test_gains_of_steps_are_within_their_intervals_and_the_dead_time_in_its():
    inside = []
    for seed in range(6):
        fit = fitted(seed).fit
        gains = fit.gains
        inside += [*((gains.low <= GAINS) & (gains.high >= GAINS))]
        inside.append(fit.interval[0] <= DEAD_TIME <= fit.interval[1])
        assert_allclose(gains.gains, GAINS, rtol=0, atol=5 * gains.errors.max())
        assert not gains.outlying
    # 24 intervals of 95 %: 21 or more in 97 % of all such sets
    assert sum(inside) >= 21


def test_steps_agree_with_least_squares_over_all_parameters_at_once():
    records = at_three_levels(3)

    def residual(p):
        after = np.maximum(records[0].time - 1.0 - p[0], 0.0)
        shape = 2.0 * -np.expm1(-after / p[1])
        return np.concatenate(
            [
                np.ravel(record.output) - level - gain * shape
                for record, gain, level in zip(records, p[2:5], p[5:], strict=True)
            ]
        )

    exact = least_squares(residual, [0.12, 0.5, 0.8, 0.6, 0.3, 3.0, 3.0, 3.0], x_scale="jac")
    errors = NOISE * np.sqrt(np.diag(np.linalg.inv(exact.jac.T @ exact.jac)))
    fit = own(records, loss="least_squares").fit
    # means over bins, and levels from other samples: a fraction of the standard error apart
    assert abs(fit.dead_time - exact.x[0]) < 0.5 * errors[0]
    assert np.all(np.abs(fit.gains.gains - exact.x[2:5]) < 0.7 * errors[2:5])
    assert_allclose(fit.gains.errors, errors[2:5], rtol=0.35)


def test_gains_of_random_inputs_are_within_their_intervals():
    records = [moved(seed, gain, n=200) for seed, gain in enumerate(GAINS)]
    fit = own(records).fit
    assert np.all((fit.gains.low <= GAINS) & (fit.gains.high >= GAINS))
    assert fit.interval[0] <= DEAD_TIME <= fit.interval[1]


def test_gains_of_fits_with_one_gain_agree_with_those_of_own_gains():
    fit = own(at_three_levels(1, gains=(0.7, 0.7, 0.7))).fit
    common = cr.fit_output_error(at_three_levels(1, gains=(0.7, 0.7, 0.7)), structures=ONE_LAG).fit
    assert not fit.gains.differ
    assert "gains_differ" not in codes(fit)
    assert fit.gain == pytest.approx(common.gain, rel=1e-3)  # the mean and the median
    assert fit.gains.at(0.0) == fit.gains.at(5.0) == fit.gain


def test_the_schedule_is_linear_between_records_and_constant_beyond():
    sys = fitted()
    gains = sys.fit.gains
    assert_allclose(gains.operating_points, [1.0, 3.0, 5.0])
    assert gains.at(2.0) == pytest.approx((gains.gains[0] + gains.gains[1]) / 2)
    assert gains.at(-7.0) == gains.gains[0]
    assert gains.at(70.0) == gains.gains[2]
    assert sys.dcgain() == pytest.approx(gains.reference) == pytest.approx(gains.gains[1])
    # the model at an operating point predicts the record there
    record = step(77, 0.25, level=4.0, noise=0.0)
    predicted = gains.ratio(record) * np.asarray(sys.simulate(np.ravel(record.input) - 4.0))
    assert_allclose(predicted, np.ravel(record.output) - 3.0, atol=0.01)


def test_where_all_steps_have_one_middle_the_schedule_is_over_their_height():
    records = [
        step(i, 1.0 - 0.1 * height, level=-height / 2, height=height)
        for i, height in enumerate((2.0, 4.0, 6.0))
    ]
    gains = own(records).fit.gains
    assert gains.scheduled_over == "step height"
    assert gains.at(5.0) == pytest.approx(0.5, abs=0.01)
    assert gains.at(records[0]) == pytest.approx(0.8, abs=0.01)


@pytest.mark.parametrize("strange", [{"lag": 0.6}, {"dead_time": 0.2}, {"gain": 0.0}])
def test_a_record_with_other_dynamics_or_none_is_named_and_left_out(strange):
    records = at_three_levels(gains=(1.0, 0.5, 0.25, 0.4))
    records[1] = step(91, **{"gain": 0.5, "level": 2.0, **strange})
    fit = own(records).fit
    assert fit.gains.outlying == fit.repeatability.outlying == ("at 2",)
    assert "at 2" in next(str(flag) for flag in fit.flags if flag.code == "outlying_records")
    assert fit.interval[0] <= DEAD_TIME <= fit.interval[1]
    assert_allclose(fit.gains.gains[[0, 2, 3]], [1.0, 0.25, 0.4], atol=0.005)


def test_a_gain_may_change_its_sign_between_records():
    gains = own(at_three_levels(gains=(0.5, -0.2, -1.0))).fit.gains
    assert_allclose(gains.gains, [0.5, -0.2, -1.0], atol=0.005)
    assert gains.reference == pytest.approx(-0.2, abs=0.005)
    assert np.all(gains.low < gains.gains)
    two = own([step(1, 1.0), step(2, -0.5, level=2.0)]).fit.gains
    assert_allclose(two.gains, [1.0, -0.5], atol=0.005)


def test_records_of_one_name_are_told_apart():
    records = at_three_levels(n=300)
    alike = [cr.Record(r.time, r.input, r.output, name="bench") for r in records]
    strange = step(91, 0.5, lag=0.6, n=300)
    fit = own([*alike, cr.Record(strange.time, strange.input, strange.output, name="bench")]).fit
    assert fit.gains.outlying == ("bench (3)",)


def test_the_flag_of_different_gains_names_the_option_and_the_fit_with_it_the_schedule():
    records = at_three_levels()
    common = cr.fit_output_error(records, structures=ONE_LAG).fit
    told = [str(flag) for flag in common.flags if "gain" in flag.code]
    assert told
    assert all("gains='own'" in text for text in told)
    fit = fitted().fit
    assert [flag.code for flag in fit.flags if "gain" in flag.code] == ["gains_differ"]
    assert "schedule" in fit.report()
    assert "outlying" not in fit.gains.report()


def test_table_plot_and_pickle_of_the_gains():
    gains = fitted().fit.gains
    table = gains.table()
    assert list(table.index) == ["at 0", "at 2", "at 4"]
    assert_allclose(table[["input_before", "input_after"]], gains.input_levels)
    assert_allclose(table["output_after"] - table["output_before"], [2.0, 1.0, 0.5], atol=0.02)
    again = pickle.loads(pickle.dumps(gains))
    assert isinstance(again, RecordGains)
    assert_allclose(again.gains, gains.gains)
    cplt = gains.plot()
    assert [text.get_text() for text in cplt.figure.axes[0].get_legend().get_texts()] == [
        "records",
        "schedule",
    ]
    with pytest.raises(ValueError, match="read-only"):
        gains.gains[0] = 2.0


def test_the_gains_are_drawn_with_the_units_of_the_records():
    units = {"u": "%", "y": "m3/h"}
    records = [cr.Record(r.time, r.input, r.output, units=units) for r in at_three_levels(n=300)]
    axes = own(records).fit.gains.plot().figure.axes[0]
    assert (axes.get_xlabel(), axes.get_ylabel()) == ("input level [%]", "gain [(m3/h)/%]")
    axes = fitted().fit.gains.plot().figure.axes[0]
    assert axes.get_xlabel() == "input level [unit of the input]"
    assert axes.get_ylabel() == "gain [output / input]"


def test_the_gain_of_an_integrating_plant_is_drawn_per_second():
    records = []
    for seed, slope in enumerate((0.05, 0.02)):
        u = np.where(DT * np.arange(400) < 1.0, 0.0, 1.0 + seed)
        y = cr.delayed_ss(ct.tf([slope], [1, 0]), dead_time=0.35, dt=DT).simulate(u)
        y += 1e-3 * np.random.default_rng(seed).standard_normal(u.size)
        units = {"u": "%", "y": "m"}
        records.append(cr.Record(DT * np.arange(400), u, y, units=units))
    gains = cr.fit_output_error(records, structures="IPDT", gains="own").fit.gains
    assert_allclose(gains.gains, (0.05, 0.02), rtol=0.05)
    assert gains.plot().figure.axes[0].get_ylabel() == "gain [m/(% s)]"


def test_other_options_are_refused():
    with pytest.raises(OptionError, match="gains"):
        cr.fit_output_error(at_three_levels(), gains="mean")
    with pytest.raises(OptionError, match="gains"):
        cr.identify(at_three_levels()[0], method="scan", gains="own")
    with pytest.raises(OptionError, match="point"):
        fitted().fit.gains.at("high")


def test_identify_and_campaigns_take_own_gains():
    records = at_three_levels()
    sys = cr.identify(records, gains="own", order=1)
    assert_allclose(sys.fit.gains.gains, GAINS, atol=0.005)
    campaign = cr.identify_campaign(records, gains="own", order=1)
    assert_allclose(campaign.system.fit.gains.gains, GAINS, atol=0.005)


def test_a_free_response_does_not_take_the_place_of_the_response_to_the_step(shared_data):
    paths = sorted((shared_data / "two_cart_drive").glob("v*.csv"))[1:]
    records = [cr.read_record(path) for path in paths]
    assert len(records) == 13
    # 68: a motor with friction overshoots little
    highest = max(np.ptp(record.output) / np.ptp(record.input) for record in records)
    fit = cr.fit_output_error(records).fit
    assert 0.5 * highest < fit.gain < highest
