"""Ms of the controllers that `design.pid` hands out: `python -m benchmarks.verdicts.controllers`.

Of the step records whose tuning is called good, of all kinds but running loops: the plain rule, and
the one that is slower where it must be, on the true plant sampled once a second.
"""

from __future__ import annotations

import argparse
import sys
import warnings

import numpy as np

import ctrl_realize as cr

from .cases import KINDS, Case, case

WAYS = {"plain": {}, "robust": {"closed_loop_time": "robust"}}
OMEGA = np.geomspace(1e-4, 3.1, 6000)


def sensitivity(one: Case, model: cr.DelayedStateSpace, options: dict[str, str]) -> tuple[str, str]:
    """Largest sensitivity of the PI on the true plant, and whether the design warned."""
    with warnings.catch_warnings(record=True) as told:
        warnings.simplefilter("always")
        try:
            pi = cr.design.pid(model, **options)
        except cr.errors.UnsuitableSystemError:
            return "refused", ""
    # a sampled controller acts half a sample later
    controller = pi.kp * (1 + 1 / (1j * OMEGA * pi.ti)) * np.exp(-0.5j * OMEGA)
    largest = np.max(1 / np.abs(1 + controller * one.plant.response(OMEGA)))
    return f"{largest:.2f}", "warned" if told else ""


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seeds", type=int, nargs=2, default=(100, 112))
    chosen, good = parser.parse_args(), 0
    for kind in KINDS[:-1]:
        for seed in range(*chosen.seeds):
            one = case(kind, seed)
            model = cr.fit_output_error(one.record)
            if model.fit.verdicts[2].level != "good":
                continue
            good += 1
            for way, options in WAYS.items():
                largest, told = sensitivity(one, model, options)
                if largest == "refused" or float(largest) > 2:
                    sys.stdout.write(f"{kind}, {seed}, {way}: {largest} {told}\n")
    sys.stdout.write(f"{good} records\n")


if __name__ == "__main__":
    main()
