"""Importing the package does nothing but import it."""

import importlib
import subprocess
import sys
import types

import pytest

import ctrl_realize as cr

MOST = 36  # names that a user learns

MODULES = """
actuators bench data datasets design errors export frequency identification io paper plots report
results validation valves experiment
"""
SUBMODULES = set(MODULES.split())
PROMISED = """
Record ImpulseResponse MeasuredFRF compare read_record read_frf detect_step
unit_step impulse_from_step impulse_from_io impulse_from_frf fit_frf realize estimate_delay
fit_output_error fit_state_space scan_orders identify Campaign identify_campaign DelayTracker
DelayedStateSpace DelaySystem delay exp delayed_ss interconnect extend_control save_model
load_model
stepped_sine_frf spectral_frf compare_frf app
CtrlRealizeError CtrlRealizeWarning
"""

PROBE = """
import sys
import control
heavy = {"pandas", "scipy.stats", "joblib", "jinja2", "typer", "dask", "tqdm", "pyarrow",
         "matplotlib.pyplot"} - set(sys.modules)
import ctrl_realize as cr
print(sorted(heavy & set(sys.modules)))
cr.Record, cr.read_record, cr.read_frf, cr.identify
print(sum(name.startswith("ctrl_realize.") for name in sys.modules))
"""


def test_import_leaves_heavy_parts_alone_and_names_the_methods_behind_them(tmp_path):
    """What else an import must leave alone: test_defects_of_others."""
    done = subprocess.run(
        [sys.executable, "-W", "error", "-c", PROBE], capture_output=True, text=True, cwd=tmp_path
    )
    heavy, modules = done.stdout.splitlines()
    assert (heavy, done.stderr) == ("[]", "")
    assert int(modules) < 120  # of more than 400; a fit of a step record needs 180
    assert list(tmp_path.iterdir()) == []


def test_every_public_name_is_there_and_documented():
    public = [name for name in dir(cr) if not name.startswith("_")]
    promised = set(PROMISED.split())
    assert set(public) == promised | SUBMODULES
    assert len(promised) <= MOST
    undocumented = [name for name in public if not getattr(cr, name).__doc__]
    assert undocumented == []


@pytest.mark.parametrize(
    "module", [None, *sorted(SUBMODULES - {"datasets", "errors", "export", "results"})]
)
def test_completion_offers_what_is_public_and_no_module_of_ours(module):
    place = cr if module is None else importlib.import_module(f"ctrl_realize.{module}")
    offered = dir(place)
    assert offered
    inner = {name for name in offered if isinstance(getattr(place, name), types.ModuleType)}
    assert inner == (SUBMODULES if module is None else set())
    homes = {getattr(getattr(place, name), "__module__", "ctrl_realize") for name in offered}
    assert all(home.split(".")[0] == "ctrl_realize" for home in homes)
    # nothing that can be imported from there by name is left out
    public = {
        name
        for name, value in vars(place).items()
        if not name.startswith("_")
        and getattr(value, "__module__", "").startswith("ctrl_realize.")
        and not isinstance(value, types.ModuleType)
    }
    assert public <= set(offered)


@pytest.mark.parametrize("name", sorted(SUBMODULES))
def test_a_public_module_exports_its_own_names_only(name):
    module = importlib.import_module(f"ctrl_realize.{name}")
    owners = {one: getattr(getattr(module, one), "__module__", None) for one in module.__all__}
    others = {o for o, at in owners.items() if at and not at.startswith(("ctrl_realize", "typing"))}
    assert others == set()
    assert not {"annotations", "Any", "dataclass", "warn_caller"} & set(module.__all__)
