"""Fits that several files look at; results are frozen."""

import pytest

import ctrl_realize as cr
from tests import rigs


@pytest.fixture(scope="session")
def quiet_valve() -> cr.DelayedStateSpace:
    """Fit with defaults of the simulated valve R3 behind 36.4 samples, with 0.1 % of noise."""
    return cr.fit_output_error(rigs.step_record(noise=0.001, delay=36.4))
