"""Several models on one record that they were not fitted to."""

import control as ct
import numpy as np
import pytest

import ctrl_realize as cr

PLANT = cr.delayed_ss(ct.tf([2.0], [0.5, 1]), dead_time=0.3, dt=0.05, name="plant")


def record(seed):
    rng = np.random.default_rng(seed)
    u = np.repeat(rng.choice([-1.0, 1.0], 60), 10)
    y = 4 + PLANT.simulate(u) + 0.05 * rng.standard_normal(u.size)
    return cr.Record(0.05 * np.arange(u.size), u, y, name=f"day {seed}")


def test_the_plant_leaves_white_noise_and_other_models_what_they_lack():
    unseen = record(2)
    late, weak = PLANT.replace(delay=8), 0.8 * PLANT
    found = cr.compare({"plant": PLANT, "late": late, "weak": weak}, unseen)
    assert found.best == "plant"
    table = found.table()
    assert next(iter(table.index)) == "plant"
    assert table["white"].to_dict() == {"plant": True, "late": False, "weak": False}
    assert table.loc["plant", "independent"]
    assert not table.loc["late", "independent"]
    spread = np.std(unseen.output)
    expected = 100 * (1 - table["residual_rms"] / spread)
    np.testing.assert_allclose(table["fit_percent"], expected, atol=0.1)  # the mean is not 0
    axes = found.plot().figure.axes
    assert [len(axis.lines) for axis in axes] == [4, 3, 3, 3]
    labels = [text.get_text() for text in axes[0].get_legend().get_texts()]
    assert labels[0] == "measured"
    assert labels[1] == f"plant, {table.loc['plant', 'fit_percent']:.1f} %"


def test_a_record_of_the_fit_is_told_and_equal_names_are_numbered():
    seen = record(1)
    fitted = [cr.fit_output_error(seen, structures=[(1, 1)]) for _ in range(2)]
    found = cr.compare([*fitted, PLANT], seen)
    assert found.names == ("day 1 (0)", "day 1 (1)", "plant")
    assert found.estimation_data == (True, True, False)
    assert found.report().count("fitted to this record") == 2
    assert cr.compare(PLANT, record(2)).estimation_data == (False,)


@pytest.mark.parametrize(("models", "match"), [([], "no models"), ({}, "no models")])
def test_nothing_to_compare_is_refused(models, match):
    with pytest.raises(cr.errors.DataError, match=match):
        cr.compare(models, record(2))
