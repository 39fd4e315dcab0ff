"""One stepped sine through the simulated valve, which several files look at."""

import pytest

import ctrl_realize as cr


@pytest.fixture(scope="session")
def sweep() -> list[list[cr.Record]]:
    """Records of 120 frequencies, five repeats of each."""
    return cr.bench.valve().stepped_sine(7, points=120)


@pytest.fixture(scope="session")
def valve_frf(sweep) -> cr.MeasuredFRF:
    return cr.stepped_sine_frf(sweep)
