"""From the numbers of a fit to the model and the words of the result, on fits by hand."""

from __future__ import annotations

import numpy as np
import pytest

from ctrl_realize.identification.fit_summary import fitted_core
from ctrl_realize.numerics.output_error_result import OutputErrorFit, StructureFit
from ctrl_realize.numerics.separable_fit import Structure


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
