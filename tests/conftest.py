"""Fixtures that all tests share."""

import gc
import os
from pathlib import Path

import pytest
from hypothesis import HealthCheck, settings

import ctrl_realize as cr
from tests import measured

# Same examples on every run: a failure seen once is seen again. CI machines are slow at times,
# so no deadline on a single example.
settings.register_profile(
    "suite",
    derandomize=True,
    deadline=None,
    max_examples=30,
    suppress_health_check=[HealthCheck.too_slow],
)
settings.register_profile("long", parent=settings.get_profile("suite"), max_examples=1000)
settings.load_profile(os.environ.get("HYPOTHESIS_PROFILE", "suite"))


def pytest_collection() -> None:
    """What is imported is no garbage, and looking for some takes a quarter of the time."""
    gc.disable()


def pytest_collection_finish() -> None:
    """Modules and tests stay to the end, too."""
    gc.freeze()
    gc.enable()


@pytest.fixture
def without_figures(monkeypatch) -> None:
    """No figures in reports: drawing takes most of the time where something else is looked at."""
    monkeypatch.setattr("ctrl_realize.report.build.identification_sketches", lambda *_, **__: [])
    monkeypatch.setattr("ctrl_realize.report.build.campaign_sketches", lambda *_, **__: [])


@pytest.fixture(scope="session")
def valve() -> cr.bench.Valve:
    """The simulated valve, its records short."""
    return cr.bench.valve(pre_step_time=0.5, hold=1.0)


@pytest.fixture(scope="session")
def shared_data() -> Path:
    """Folder of measured records, which are not part of the project."""
    return measured.shared_folder()
