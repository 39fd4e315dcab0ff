"""Masked, complex and non-finite numbers are seen at every public border."""

from __future__ import annotations

import control as ct
import numpy as np
import pytest

import ctrl_realize as cr
from ctrl_realize.errors import CtrlRealizeError, DataError

T = 0.1 * np.arange(50)
U = (T > 1).astype(float)
Y = (T > 2).astype(float)
PLANT = cr.delayed_ss(ct.ss([[0.9]], [[1.0]], [[0.1]], [[0.0]], 0.1), 3)


def masked():
    """The last nine samples are masked; below the mask stands 1e20, as netCDF files have it."""
    values = np.where(T > 4.05, 1e20, Y)
    return np.ma.masked_array(values, mask=T > 4.05)


@pytest.mark.parametrize("given", [masked(), [masked()], (masked(),), list(masked())])
def test_masked_samples_are_missing_in_lists_too(given):
    count = int(np.sum(T > 4.05))
    assert cr.Record(T, U, given, missing="keep").n_missing == count
    for make in (
        lambda: cr.Record(T, U, given),
        lambda: cr.Record.resampled(T, U, given),
        lambda: PLANT.simulate(given),
    ):
        with pytest.raises(DataError, match="non-finite"):
            make()


COMPLEX = np.array([1.0, 2.0]) + 1j


@pytest.mark.parametrize(
    "use",
    [
        lambda: PLANT.simulate(COMPLEX),
        lambda: cr.design.predictor_lqr(PLANT, [[1 + 1j]], 1.0),
        lambda: cr.design.kalman_predictor(PLANT, 1.0, [[1 + 1j]]),
        lambda: cr.design.unwrapped_phase(PLANT, COMPLEX),
        lambda: cr.design.uncertainty_bound([1.1 * PLANT], PLANT, COMPLEX),
        lambda: cr.design.ProcessModel(1.0, 1.0, 1.0).step(COMPLEX),
        lambda: cr.design.ProcessModel(1.0 + 1j, 1.0, 1.0),
        lambda: cr.Record(T, U, Y + 1j),
        lambda: cr.ImpulseResponse(Y + 1j, 0.1),
        lambda: cr.MeasuredFRF([1.0, 2.0], COMPLEX),
        lambda: cr.design.margins(PLANT, 1 + 1j),
    ],
)
def test_complex_numbers_where_real_ones_belong_are_refused_not_cut(use):
    with pytest.raises(CtrlRealizeError):
        use()
