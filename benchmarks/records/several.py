"""How much narrower the interval of a dead time is from several records of a measured plant."""

from __future__ import annotations

import platform
import warnings
from dataclasses import dataclass
from datetime import date

import numpy as np

import ctrl_realize as cr

from .measured import DATA


@dataclass(frozen=True)
class Plant:
    """Records of a plant: folder, pattern of file names, and what is known of the dead time."""

    name: str
    folder: str
    pattern: str
    known: str


PLANTS = (
    Plant("wis_canal, gate 1-2", "wis_canal", "20210202_step_gate1_2_*", "1.30 s"),
    Plant("wis_canal, gate 2-3", "wis_canal", "20210202_step_gate2_3_*", "0.70 s"),
    Plant("wis_canal, gate 1-2, slow", "wis_canal", "*gate1_2*_slow", "1.30 to 1.55 s"),
    Plant("wis_canal, gate 2-3, slow", "wis_canal", "*gate2_3*_slow", "0.70 to 0.95 s"),
    Plant("heating_system", "heating_system", "edge*", "2 to 4 s"),
    Plant("two_cart_drive", "two_cart_drive", "v*", "0.9 to 3.4 ms"),
    Plant("hdd_arm", "hdd_arm", "edge*", "0.8 to 3.2 ms"),
    Plant("flexible_robot", "flexible_robot", "step*", "2 to 6 ms"),
    Plant("tclab", "tclab", "kantor*", "0 to 5 s"),
    Plant("sbhs_heater", "sbhs_heater", "step*", "1 to 4.5 s"),
    Plant("dc_motor_tacho", "dc_motor_tacho", "up", "2.3 to 3.1 ms"),
    Plant("rlc_zero_delay", "rlc_zero_delay", "up", "0"),
)
_MUCH = 0.5  # of the width, that one cause must have


def _fit(records: list[cr.Record], **options: object) -> cr.identification.OutputErrorFit:
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        return cr.identify(records if len(records) > 1 else records[0], **options).fit


def _width(fit: cr.results.ModelFit) -> float:
    return float(fit.interval[1] - fit.interval[0])


def _shown(fit: cr.results.ModelFit | None) -> str:
    if fit is None:
        return ""
    factor, unit = (1.0, "s") if fit.dt > 5e-3 else (1e3, "ms")
    low, high = (factor * end for end in fit.interval)
    return f"{low:.3g} to {high:.3g} {unit}"


def cause(fit: cr.identification.OutputErrorFit) -> str:
    """What makes most of the width of an interval."""
    agreed = getattr(fit, "agreement", None)
    if agreed is not None and agreed.contradicts:
        return "records and FRF contradict each other"
    repeats, misfit = fit.repeatability, f"misfit, {fit.normalized_rms:.1f} times the noise"
    if agreed is None and repeats is not None and repeats.p_value < 0.01:
        between = float(repeats.delays[repeats.kept].std(ddof=1) / np.sqrt(repeats.kept.sum()))
        if 2 * 1.96 * between > _MUCH * _width(fit):
            return "the records differ" + ("" if fit.at_noise_level else f"; {misfit}")
    if not fit.at_noise_level:
        return misfit
    own = [line.interval for line in fit.structures if line.interval is not None]
    narrow = min((high - low for low, high in own), default=0.0)
    return "structures" if narrow < _MUCH * _width(fit) else "noise"


def line(plant: Plant) -> str:
    """Row of a plant."""
    folder = DATA / plant.folder
    paths = sorted(folder.glob(f"{plant.pattern}.csv"))
    records = [cr.read_record(p) for p in paths if "slow" not in p.stem or "slow" in plant.pattern]
    single = [_fit([one]) for one in records]
    width = float(np.median([_width(fit) for fit in single]))
    factor, unit = (1.0, "s") if records[0].dt > 5e-3 else (1e3, "ms")
    together = [_fit(records), _fit(records, gains="own")] if len(records) > 1 else [None, None]
    frf = folder / "frf.csv"
    joint = _fit(records, frf=cr.read_frf(frf)) if frf.exists() else None
    found = [fit for fit in (*together, joint) if fit is not None]
    best = min(found, key=_width)
    cells = [
        plant.name,
        plant.known,
        str(len(records)),
        f"{factor * width:.3g} {unit}",
        *map(_shown, (*together, joint)),
        f"{_width(best) / width:.2f}",
        cause(best),
    ]
    return f"| {' | '.join(cells)} |"


def table() -> str:
    """Make the table in Markdown."""
    lines = [
        "| plant | known dead time | records | median width of single intervals | together | "
        "together, own gains | with the FRF | narrowest over single | what sets it |",
        "|" + "---|" * 9,
        *map(line, PLANTS),
        "",
        f"Made on {date.today()} by `python -m benchmarks.records several` with Python "
        f"{platform.python_version()}, ctrl-realize {cr.__version__}, numpy {np.__version__}.",
        "",
    ]
    return "\n".join(lines)
