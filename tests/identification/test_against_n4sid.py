"""Fit on the half of a measured record that was not used, beside N4SID of the package nfoursid."""

from itertools import product

import control as ct
import numpy as np
import pandas as pd
import pytest

import ctrl_realize as cr
from tests import measured

nfoursid = pytest.importorskip("nfoursid.nfoursid")


def by_n4sid(record, order, block_rows):
    u, y = (
        np.atleast_2d(x) - np.atleast_2d(x).mean(axis=1, keepdims=True)
        for x in (record.input, record.output)
    )
    inputs, outputs = ([f"{s}{i}" for i in range(len(x))] for s, x in (("u", u), ("y", y)))
    frame = pd.DataFrame(np.vstack([u, y]).T, columns=inputs + outputs)
    method = nfoursid.NFourSID(frame, outputs, inputs, num_block_rows=block_rows)
    method.subspace_identification()
    found, _ = method.system_identification(rank=order)
    return ct.ss(found.a, found.b, found.c, found.d, record.dt)


def best_of_n4sid(first, second, orders):
    """Largest mean fit, in %, on the second half; 0 without a stable model."""
    fits = [0.0]
    for order, block_rows in product(orders, (10, 20)):
        model = by_n4sid(first, order, block_rows) if order <= block_rows else None
        # It does not promise a stable model, and an unstable one simulates nothing.
        if model is not None and np.abs(model.poles()).max() < 1:
            fits.append(cr.validation.analyse_residuals(model, second).fit_percent.mean())
    return max(fits)


@pytest.mark.parametrize(
    ("plant", "orders", "gain", "ours"),
    [
        ("hairdryer", (3, 4), 0.0, None),
        ("exchanger", (2, 3), 0.0, None),
        ("robot_arm", (6, 12), 0.0, None),
        # 78.0 % beside 72.7 %; by default an order of 20 with 83.0 %, which takes 20 s
        ("cd_player_mimo", (6, 12, 20), 5.0, [6]),
    ],
)
def test_a_fit_with_defaults_predicts_no_worse_than_a_subspace_method(plant, orders, gain, ours):
    first, second = measured.halves(f"{plant}/record")
    found = cr.fit_state_space(first, ours)
    fit = cr.validation.analyse_residuals(found, second).fit_percent.mean()
    # One percent: halves of a record differ by more, and theirs are the best in hindsight.
    assert fit > best_of_n4sid(first, second, orders) + gain - 1.0
