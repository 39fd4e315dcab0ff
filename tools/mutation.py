#!/usr/bin/env python3
"""Change the numerical core on purpose, one place at a time, and see whether a test fails.

    pip install -e .[test,mutation]
    python tools/mutation.py                          every module of the list below
    python tools/mutation.py numerics/kung            only these
    python tools/mutation.py --sample 40 --seed 2     another sample of large modules

The changes are made by mutmut, in a copy of the project; mutation_loop.py runs the tests that are
named beside a module for each of them. Changes of the words of messages are left out. Of a module
with more changes than the sample, a seeded random sample is tried. Prints a line for each module,
and writes what no test noticed into the file that --survivors names.
"""

from __future__ import annotations

import argparse
import ast
import contextlib
import difflib
import json
import os
import random
import shutil
import subprocess
import sys
import tempfile
import time
from collections import Counter
from pathlib import Path

from mutmut.mutation.file_mutation import mutate_file_contents

ROOT = Path(__file__).resolve().parents[1]
PACKAGE = "ctrl_realize"

# In order of consequence. The tests are those that ought to notice, quick ones first: what only
# a slow end-to-end test would notice counts as unnoticed.
MODULES = {
    "numerics/hankel": "tests/numerics/test_hankel.py tests/numerics/test_kung.py",
    "numerics/kung": "tests/numerics/test_kung.py",
    "numerics/iae": "tests/numerics/test_iae.py",
    "numerics/differences": "tests/numerics/test_differences.py",
    "numerics/filters": "tests/numerics/test_filters.py",
    "numerics/sampling": "tests/numerics/test_sampling.py",
    "numerics/edges": "tests/numerics/test_edges.py",
    "numerics/rest": "tests/numerics/test_rest.py",
    "numerics/input_moves": "tests/numerics/test_input_moves.py",
    "numerics/first_motion": "tests/numerics/test_first_motion.py",
    "numerics/noise_level": "tests/numerics/test_noise_level.py",
    "numerics/onset": "tests/numerics/test_onset.py",
    "numerics/process_step": "tests/numerics/test_process_step.py",
    "numerics/pole_factors": "tests/numerics/test_pole_factors.py",
    "numerics/separable_fit": "tests/numerics/test_separable_batch.py "
    "tests/numerics/test_own_terms.py "
    "tests/numerics/test_separable_fit.py",
    "numerics/structure_search": "tests/numerics/test_structure_search.py "
    "tests/numerics/test_separable_fit.py",
    "numerics/delay_bound": "tests/numerics/test_delay_bound.py",
    "numerics/profile_interval": "tests/numerics/test_profile_interval.py "
    "tests/numerics/test_step_numerics.py tests/numerics/test_delay_bound.py",
    "numerics/step_problem": "tests/numerics/test_step_problem.py",
    "numerics/relaxation": "tests/numerics/test_relaxation.py",
    "numerics/sections": "tests/numerics/test_sections.py",
    "numerics/section_fit": "tests/numerics/test_section_fit.py",
    "numerics/own_terms": "tests/numerics/test_own_terms.py",
    "numerics/svd": "tests/numerics/test_svd.py",
    "numerics/lag_chains": "tests/numerics/test_lag_chains.py",
    "numerics/dispersed_flow": "tests/numerics/test_flow_fit.py "
    "tests/numerics/test_dispersed_flow.py",
    "numerics/fir_kernels": "tests/numerics/test_fir_kernels.py",
    "numerics/kernel_priors": "tests/numerics/test_fir_kernels.py",
    "numerics/kernel_search": "tests/numerics/test_fir_kernels.py",
    "io/csv_files": "tests/io/test_csv_files.py",
    "numerics/output_error": "tests/numerics/test_output_error.py",
    "identification/steps": "tests/identification/test_steps.py",
    "identification/realization": "tests/identification/test_realization_by_hand.py",
    "identification/delay_scan": "tests/identification/test_delay_scan.py",
    "identification/orders": "tests/identification/test_orders_by_hand.py",
    "identification/impulses": "tests/identification/test_impulses.py",
    "identification/known_dynamics": "tests/identification/test_known_dynamics.py",
    "identification/averaging": "tests/identification/test_averaging.py",
    "identification/delay_fit": "tests/identification/test_delay_fit_steps.py "
    "tests/identification/test_delay_fit_by_hand.py",
    "identification/delay_fit_result": "tests/identification/test_delay_fit_result.py",
    "identification/fit_summary": "tests/identification/test_fit_summary.py",
    "identification/fit_flags": "tests/identification/test_fit_flags.py",
    "identification/channels": "tests/identification/test_channels.py",
    "identification/channel_cores": "tests/identification/test_channels.py",
    "identification/channel_fit": "tests/identification/test_channel_fit_by_hand.py "
    "tests/identification/test_channel_search.py",
    "identification/channel_fit_result": "tests/identification/test_channel_fit.py",
    "identification/channel_search": "tests/identification/test_channel_search.py "
    "tests/identification/test_channel_fit.py",
    "identification/mode_choice": "tests/identification/test_mode_choice_by_hand.py "
    "tests/identification/test_mode_choice.py",
    "identification/delay_scan_result": "tests/identification/test_delay_scan.py",
    "identification/scan_curve": "tests/identification/test_delay_scan.py",
    "identification/scan_surface": "tests/identification/test_orders.py "
    "tests/identification/test_delay_scan.py",
    "identification/realization_result": "tests/identification/test_realization.py",
    "identification/order_choice": "tests/identification/test_order_choice.py "
    "tests/identification/test_orders.py",
    "identification/from_io": "tests/identification/test_from_io_by_hand.py "
    "tests/identification/test_from_io.py",
    "identification/impulse_estimate": "tests/identification/test_impulse_estimate.py",
    "identification/pulse_choice": "tests/identification/test_pulse_choice.py",
    "identification/pulse_regression": "tests/identification/test_pulse_regression.py",
    "identification/residuals": "tests/identification/test_residuals.py",
    "identification/residual_check": "tests/identification/test_residual_check.py",
    "identification/record_simulation": "tests/identification/test_record_simulation.py "
    "tests/identification/test_residuals.py",
    "identification/prediction": "tests/identification/test_prediction.py "
    "tests/identification/test_residuals.py",
    "identification/cross_validation": "tests/identification/test_cross_validation.py",
    "identification/bootstrap": "tests/identification/test_bootstrap_by_hand.py",
    "identification/campaign": "tests/identification/test_campaign_by_hand.py",
    "identification/campaign_flags": "tests/identification/test_campaign_flags.py",
    "identification/campaign_row": "tests/identification/test_campaign_row.py",
    "identification/campaign_run": "tests/identification/test_campaign_by_hand.py",
    "identification/cross_check": "tests/identification/test_cross_check_by_hand.py",
    "identification/delay_check": "tests/identification/test_delay_check.py",
    "identification/identify": "tests/identification/test_identify_by_hand.py",
    "identification/from_step": "tests/identification/test_from_step.py "
    "tests/identification/test_steps.py",
    "identification/packed_model": "tests/identification/test_packed_model.py",
    "identification/tracker": "tests/identification/test_tracker_by_hand.py "
    "tests/identification/test_tracker.py",
    "identification/tracker_checks": "tests/identification/test_tracker_checks.py",
    "identification/tracker_solution": "tests/identification/test_tracker_solution.py",
    "identification/tracked": "tests/identification/test_tracked.py",
    "identification/any_input_fit": "tests/identification/test_any_input_fit.py",
    "numerics/arx": "tests/numerics/test_arx.py",
    "numerics/bands": "tests/numerics/test_bands.py tests/numerics/test_spectra.py",
    "numerics/block_svd": "tests/numerics/test_block_svd.py tests/numerics/test_lanczos.py",
    "numerics/closed_loop": "tests/numerics/test_closed_loop.py",
    "numerics/coloured_noise": "tests/numerics/test_coloured_noise.py",
    "numerics/correlation": "tests/numerics/test_correlation.py",
    "numerics/crossovers": "tests/numerics/test_crossovers.py",
    "numerics/delay_choice": "tests/numerics/test_delay_choice.py",
    "numerics/likelihood_interval": "tests/numerics/test_likelihood_interval.py",
    "numerics/flow_modes": "tests/numerics/test_dispersed_flow.py",
    "numerics/whitening": "tests/numerics/test_whitening.py",
    "numerics/coloured_fit": "tests/numerics/test_coloured_fit.py",
    "numerics/moving_mean": "tests/numerics/test_moving_mean.py",
    "numerics/delay_models": "tests/numerics/test_kung.py tests/identification/test_delay_scan.py",
    "numerics/delay_split": "tests/numerics/test_delay_split.py",
    "numerics/delayed_regulator": "tests/design/test_predictor.py",
    "numerics/gramians": "tests/design/test_balanced.py",
    "numerics/half_rule": "tests/numerics/test_half_rule.py tests/design/test_reduction.py",
    "numerics/inverse_hold": "tests/design/test_conversions.py",
    "numerics/lagged": "tests/numerics/test_lagged.py tests/numerics/test_arx.py",
    "numerics/lanczos": "tests/numerics/test_lanczos.py",
    "numerics/modes": "tests/design/test_balanced.py tests/design/test_smith.py",
    "numerics/pade": "tests/design/test_conversions.py",
    "numerics/phase_slope": "tests/design/test_phase.py",
    "numerics/pole_moves": "tests/numerics/test_recursive.py",
    "numerics/rational": "tests/numerics/test_rational.py",
    "numerics/rational_bounds": "tests/frequency/test_fit_frf.py",
    "numerics/rational_fit": "tests/frequency/test_fit_frf.py",
    "numerics/rational_search": "tests/numerics/test_rational_search.py "
    "tests/frequency/test_fit_frf.py",
    "numerics/rational_starts": "tests/frequency/test_fit_frf.py",
    "numerics/recurrence": "tests/numerics/test_lanczos.py",
    "numerics/recursive": "tests/numerics/test_recursive.py",
    "numerics/rise": "tests/numerics/test_rise.py",
    "numerics/running_residual": "tests/numerics/test_running_residual.py",
    "numerics/sampled_data": "tests/numerics/test_sampled_data.py",
    "numerics/sampled_fit": "tests/numerics/test_sampled_fit.py",
    "numerics/sines": "tests/numerics/test_sines.py",
    "numerics/spectra": "tests/numerics/test_spectra.py",
    "numerics/state_space": "tests/numerics/test_state_space.py",
    "numerics/statistics": "tests/numerics/test_statistics.py",
    "numerics/thiran": "tests/design/test_conversions.py",
    "numerics/time_axis": "tests/numerics/test_time_axis.py tests/test_signals.py",
    "numerics/response_bins": "tests/numerics/test_response_bins.py",
    "numerics/delayed_modes": "tests/numerics/test_delayed_modes.py "
    "tests/numerics/test_long_responses.py",
    "numerics/fit_window": "tests/numerics/test_fit_window.py",
    "numerics/output_error_result": "tests/numerics/test_output_error_result.py",
    "numerics/vector_fitting": "tests/numerics/test_rational.py",
}

# checks whose second argument is a name for the message
NAMING = {"band", "one_of", "positive", "real", "whole"}
HEAD = ("module", "changes", "tried", "noticed", "endless", "no test", "survived", "minutes")


class _WithoutWords(ast.NodeTransformer):
    """Leave of a function what a program can notice: of an error its class, of texts no case."""

    def visit_Raise(self, node: ast.Raise) -> ast.AST:
        return ast.Raise(node.exc.func if isinstance(node.exc, ast.Call) else node.exc, node.cause)

    def visit_Call(self, node: ast.Call) -> ast.AST:
        self.generic_visit(node)
        names = isinstance(node.func, ast.Name) and node.func.id in NAMING
        if names and len(node.args) > 1 and isinstance(node.args[1], ast.Constant):
            node.args[1] = ast.Constant("")
        return node

    def visit_Constant(self, node: ast.Constant) -> ast.AST:
        if isinstance(node.value, str):
            return ast.Constant(node.value.replace("XX", "").lower())
        return node


def body(function: ast.FunctionDef) -> ast.Module:
    return ast.parse(
        f"{ast.unparse(function.args)!r}\n" + "\n".join(map(ast.unparse, function.body))
    )


def changes(mutated: str) -> dict[str, str]:
    """Read what mutmut has changed: for every mutant the lines, without those of words alone."""
    functions = {
        node.name: node
        for node in ast.walk(ast.parse(mutated))
        if isinstance(node, ast.FunctionDef) and "__mutmut_" in node.name
    }
    found = {}
    for name, function in functions.items():
        stem, _, number = name.rpartition("__mutmut_")
        original = functions[f"{stem}__mutmut_orig"]
        plain = [ast.dump(_WithoutWords().visit(body(each))) for each in (original, function)]
        if number == "orig" or plain[0] == plain[1]:
            continue
        texts = [ast.unparse(body(each)).splitlines() for each in (original, function)]
        lines = list(difflib.unified_diff(*texts, n=0, lineterm=""))[2:]
        found[name] = "\n".join(line for line in lines if not line.startswith("@@"))
    return found


def mutate(copy: Path, module: str) -> dict[str, str]:
    """Put the changes of a module in its place; return their lines by name."""
    path = copy / PACKAGE / f"{module}.py"
    with contextlib.chdir(copy):  # where mutmut reads its settings
        code = mutate_file_contents(str(path), path.read_text(encoding="utf-8")).code
    path.write_text(code, encoding="utf-8")
    prefix = f"{PACKAGE}.{module.replace('/', '.')}."
    return {prefix + name: lines for name, lines in changes(code).items()}


def attempt(copy: Path, names: list[str], tests: list[str]) -> dict[str, str]:
    """Run the tests for every change; return how each ended."""
    asked, ends = copy / "names.json", copy / "ends.json"
    asked.write_text(json.dumps(names), encoding="utf-8")
    threads = dict.fromkeys(("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"), "1")
    paths = {"MUTATION_NAMES": str(asked), "MUTATION_ENDS": str(ends), "MPLBACKEND": "Agg"}
    search = os.pathsep.join([str(copy), str(ROOT / "tools"), os.environ.get("PYTHONPATH", "")])
    options = ["-q", "-p", "no:cacheprovider", "-p", "no:xdist", "-p", "mutation_loop"]
    # nobody reads why a test fails, and to find out takes longer than most tests
    options += ["--assert=plain", "--tb=no"]
    done = subprocess.run(
        [sys.executable, "-m", "pytest", *options, *tests],
        cwd=copy,
        env={**threads, **os.environ, **paths, "PYTHONPATH": search},
        capture_output=True,
        text=True,
        check=False,
    )
    found = json.loads(ends.read_text(encoding="utf-8")) if ends.exists() else {}
    if set(found) != set(names):
        sys.exit(f"the tests did not come to an end:\n{(done.stdout + done.stderr)[-2000:]}")
    return found


def run(copy: Path, module: str, sample: int, seed: int) -> tuple[list[str], dict[str, str]]:
    """Mutate one module; return the row of the table and the survivors' changed lines."""
    started = time.monotonic()
    found = mutate(copy, module)
    names = sorted(found)
    if len(names) > sample:
        names = sorted(random.Random(seed).sample(names, sample))
    tests = [test for test in MODULES[module].split() if (ROOT / test).exists()]
    ends = attempt(copy, names, tests)
    count = Counter(ends.values())
    counts = (len(found), len(names), *(count[end] for end in HEAD[3:7]))
    minutes = (time.monotonic() - started) / 60
    left = {
        name.rpartition(".")[2]: found[name]
        for name in names
        if ends[name] in ("survived", "no test")
    }
    return [module, *map(str, counts), f"{minutes:.1f}"], left


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("modules", nargs="*", help="such as numerics/kung; all without")
    parser.add_argument("--sample", type=int, default=250, help="most changes of a module (250)")
    parser.add_argument("--seed", type=int, default=1, help="of the sample (1)")
    parser.add_argument("--survivors", type=Path, help="file for what no test noticed")
    asked = parser.parse_args()
    if strange := set(asked.modules) - set(MODULES):
        parser.error(f"no module {', '.join(sorted(strange))}; there are {', '.join(MODULES)}")
    print(f"| {' | '.join(HEAD)} |\n| {' | '.join(['---'] * len(HEAD))} |", flush=True)
    survived = False
    for module in asked.modules or MODULES:
        with tempfile.TemporaryDirectory() as temporary:
            copy = Path(temporary) / "project"
            for folder in (PACKAGE, "tests"):
                skip = shutil.ignore_patterns("__pycache__")
                shutil.copytree(ROOT / folder, copy / folder, ignore=skip)
            settings = (ROOT / "pyproject.toml").read_text(encoding="utf-8")
            settings += f'\n[tool.mutmut]\nsource_paths = ["{PACKAGE}"]\n'
            (copy / "pyproject.toml").write_text(settings, encoding="utf-8")
            row, survivors = run(copy, module, asked.sample, asked.seed)
        print(f"| {' | '.join(row)} |", flush=True)
        survived = survived or bool(survivors)
        if asked.survivors is not None:
            with asked.survivors.open("a", encoding="utf-8") as file:
                file.writelines(f"{module} {name}\n{text}\n\n" for name, text in survivors.items())
    sys.exit(survived)


if __name__ == "__main__":
    main()
