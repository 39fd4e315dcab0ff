"""The words of a residual check."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.testing import assert_array_equal

import ctrl_realize as cr
from ctrl_realize.identification.residual_check import ResidualCheck
from ctrl_realize.results import Flag

TIME = 0.1 * np.arange(4)


def check(*, white=True, independent=True, name="day 2"):
    output = np.array([[3.0, -3.0, 3.0, -3.0], [3.0, 4.0, 0.0, 0.0]])
    return ResidualCheck(
        fit_percent=np.array([98.765, 43.21]),
        simulated=np.zeros((2, 4)),
        residual=output,
        autocorrelation=np.ones((2, 3)),
        cross=np.zeros((2, 1, 5)),
        bound=0.5,
        cross_bound=np.ones((2, 1)),
        whiteness=np.ones(2),
        white=white,
        independent=independent,
        confidence=0.995,
        record=cr.Record(TIME, np.ones(4), output, name=name),
        flags=(Flag("feedback", "the input follows the residual"),),
    )


def test_a_check_reports_fit_rms_and_answers_with_their_confidence():
    assert check().report().splitlines() == [
        "Residual of day 2",
        "  fit                98.77 %, 43.21 %",
        "  residual rms       3, 2.5",
        "  white              yes (at 99.5 %)",
        "  free of the input  yes (at 99.5 %)",
        "  ! the input follows the residual",
    ]
    assert check(name="").report().startswith("Residual of a record\n")


@pytest.mark.parametrize("white", [True, False])
@pytest.mark.parametrize("independent", [True, False])
def test_each_answer_is_its_own(white, independent):
    one = check(white=white, independent=independent)
    rows = dict(one._rows())
    assert rows["white"].split()[0] == ("yes" if white else "no")
    assert rows["free of the input"].split()[0] == ("yes" if independent else "no")
    assert repr(one) == (
        f"<ResidualCheck: fit 98.8, 43.2 %, white {white}, independent {independent}>"
    )


def test_lags_lie_on_both_sides_of_zero():
    assert_array_equal(check().lags, [-2, -1, 0, 1, 2])
