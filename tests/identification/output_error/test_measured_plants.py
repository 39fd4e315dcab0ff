"""fit_output_error on plants that others have measured, with its defaults.

Bands: what the sources state or the first motion allows (README of the data). They are doubtful
by a sample or two themselves.
"""

from __future__ import annotations

import numpy as np
import pytest

import ctrl_realize as cr
from tests import measured

# Seconds; the gates of the `slow` records take a quarter of a second longer, give or take.
GATES = {"1_2": (1.15, 1.45), "1_2_slow": (1.25, 1.85), "2_3": (0.4, 0.85), "2_3_slow": (0.5, 1.25)}
CANAL = {
    f"wis_canal/{day}_step_gate{gate}_s{opening}{slow}": tuple(
        128 * seconds
        for seconds in GATES[gate + slow]  # in samples
    )
    for day, slow in (("20210202", ""), ("20210302", "_slow"))
    for gate in ("1_2", "2_3")
    for opening in (25, 100, 255)
}
HEATING = {f"heating_system/edge{i}": (0.5, 2.2) for i in range(5)}
SINGLE = {
    "air_duct/45": (10, 13),
    "air_duct/90": (10, 13),
    "dc_motor_tacho/up": (31, 42),
    "rlc_zero_delay/up": (-1, 1),
}
SHORT = {  # dead times of a few samples; no rule was made with the last three plants
    **{f"two_cart_drive/v{volts}_{i}": (0.9, 3.4) for volts in ("1_5", "2") for i in range(7)},
    **{f"sbhs_heater/step{i}": (1, 4.5) for i in (1, 2)},
    **{f"hdd_arm/edge{i}": (0.8, 3.2) for i in range(3)},
    **{f"tclab/apm_{i}": (0, 5) for i in range(3)},
    **{f"tclab/kantor_step50{which}": (0, 5) for which in ("", "_b", "_c")},
}


@pytest.mark.parametrize(
    ("bands", "count", "least"),
    [(CANAL, 12, 9), (HEATING, 5, 4), (SINGLE, 4, 4), (SHORT, 25, 19)],
    ids=["canal", "heating", "single", "short"],
)
def test_dead_times_are_in_their_bands(bands, count, least):
    assert len(bands) == count
    fits = {name: measured.fitted(name) for name in bands}
    assert sum(low <= fits[name].delay <= high for name, (low, high) in bands.items()) >= least


def test_intervals_meet_the_bands_and_are_not_wider_than_they_must_be():
    widths = []
    for name, (low, high) in (CANAL | HEATING | SINGLE | SHORT).items():
        fit = measured.fitted(name)
        assert fit.delay_interval[0] <= high, name
        assert fit.delay_interval[1] >= low, name
        if name not in SHORT:
            widths.append((fit.interval[1] - fit.interval[0]) / max(fit.onset, 0.5 * fit.dt))
    assert np.median(widths) <= 0.6


def test_a_misfit_is_never_hidden():
    for name in CANAL | HEATING | SINGLE | SHORT:
        fit = measured.fitted(name)
        flagged = {flag.code for flag in fit.flags}
        assert ("structured_misfit" in flagged) == (not fit.at_noise_level), name
        assert fit.interval[0] <= fit.dead_time <= fit.interval[1]
        assert np.isfinite(fit.onset)


def test_a_drift_before_the_step_does_not_make_an_integrator_of_a_lamp():
    # Ten samples at rest, a hundred after: the drift is the end of the step before.
    edges = [measured.record(f"heating_system/edge{i}") for i in range(5)]
    fit = cr.fit_output_error(edges).fit
    flags = {flag.code for flag in fit.flags}
    assert "drift" in flags
    assert "integrating" not in flags
    assert 17 < fit.gain < 23  # of the five records one by one: 16 to 23
    assert 0.5 <= fit.delay <= 2.2
