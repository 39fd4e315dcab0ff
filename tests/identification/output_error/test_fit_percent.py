"""How much of a record a fit follows, and why not more."""

import numpy as np
import pytest

import ctrl_realize as cr
from tests import rigs


def followed(fit):
    return dict(line.split(maxsplit=1) for line in map(str.strip, fit.report().splitlines()[1:]))[
        "fit"
    ]


TWO = {"structures": [(2, 2)]}


@pytest.mark.parametrize("noise", [0.002, 0.02])
def test_the_fit_of_a_right_model_is_what_noise_leaves(noise):
    record = rigs.step_record(rigs.R2, noise=noise, before=400, after=900)
    fit = cr.fit_output_error(record, **TWO).fit
    left = 16 * noise / np.std(record.output)
    # the noise of one record, known to 1 / sqrt(2 N)
    assert fit.fit_percent == pytest.approx(100 * (1 - left), abs=100 * left * 0.06)
    assert followed(fit) == f"{fit.fit_percent:.1f} % of the response"
    assert not any("closely" in choice for choice in fit.choices)


def test_a_drift_is_in_the_fit_and_not_in_the_model_alone():
    record = rigs.step_record(rigs.R2, noise=0.001, before=900, after=900)
    drift = 3e-3 * np.arange(record.n_samples)
    fit = cr.fit_output_error(
        cr.Record(record.time, record.input, record.output + drift), **TWO
    ).fit
    assert "drift" in {flag.code for flag in fit.flags}
    clean = record.output
    alone = 100 * (1 - np.std(drift) / np.std(clean + drift))
    assert fit.fit_percent > 99
    assert f"{alone:.1f} % by the model without drift" in followed(fit)


def test_a_structure_that_follows_more_closely_is_named_where_none_is_right():
    # Seven poles; at most five are tried.
    plant = rigs.R2 + 0.1 * rigs.lag(6.0) * rigs.pair(20.0, 0.05) - 0.1 * rigs.pair(9.0, 0.03)
    fit = cr.fit_output_error(rigs.step_record(plant, noise=1e-3, before=300, after=900)).fit
    (line,) = [choice for choice in fit.choices if "closely" in choice]
    assert "no structure reaches the noise" in line
    assert f"instead of {fit.estimate.followed.complete:.1f} %" in line
