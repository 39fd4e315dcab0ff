#!/usr/bin/env python3
"""Change the numerical core on purpose, one place at a time, and see whether a test fails.

    pip install -e .[test,mutation]
    python tools/mutation.py                          every module of the list below
    python tools/mutation.py numerics/kung            only these
    python tools/mutation.py --sample 40 --seed 2     another sample of large modules

The changes are made by mutmut, in a copy of the project, each module against the tests that are
named beside it. Changes of the words of messages are left out. Of a module with more changes than
the sample, a seeded random sample is tried. Prints a line for each module, and writes what no test
noticed into the file that --survivors names.
"""

from __future__ import annotations

import argparse
import ast
import difflib
import json
import os
import random
import shutil
import subprocess
import sys
import tempfile
import time
from pathlib import Path

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
    "numerics/separable_fit": "tests/numerics/test_separable_fit.py",
    "numerics/structure_search": "tests/numerics/test_structure_search.py "
    "tests/numerics/test_separable_fit.py",
    "numerics/delay_bound": "tests/numerics/test_delay_bound.py",
    "numerics/profile_interval": "tests/numerics/test_step_numerics.py "
    "tests/numerics/test_delay_bound.py",
    "numerics/step_problem": "tests/numerics/test_step_problem.py",
    "numerics/relaxation": "tests/numerics/test_relaxation.py",
    "numerics/sections": "tests/numerics/test_sections.py",
    "numerics/section_fit": "tests/numerics/test_section_fit.py",
    "numerics/own_terms": "tests/numerics/test_own_terms.py",
    "numerics/svd": "tests/numerics/test_svd.py",
    "numerics/lag_chains": "tests/numerics/test_lag_chains.py",
    "numerics/dispersed_flow": "tests/numerics/test_dispersed_flow.py",
    "numerics/fir_kernels": "tests/numerics/test_fir_kernels.py",
    "io/csv_files": "tests/io/test_csv_files.py",
    "numerics/output_error": "tests/identification/test_delay_fit.py",
    "identification/steps": "tests/identification/test_steps.py",
    "identification/realization": "tests/identification/test_realization.py",
    "identification/delay_scan": "tests/identification/test_delay_scan.py",
    "identification/orders": "tests/identification/test_orders.py",
    "identification/impulses": "tests/identification/test_impulses.py",
    "identification/known_dynamics": "tests/identification/test_known_dynamics.py",
    "identification/averaging": "tests/identification/test_averaging.py",
    "identification/fit_flags": "tests/identification/test_delay_fit.py",
}

# exit codes by which mutmut tells how a mutant ended
TIMED_OUT = {36, -24, 24, 152, 255}
UNTESTED = {5, 33}
HEAD = ("module", "changes", "tried", "noticed", "endless", "no test", "survived", "minutes")


class _WithoutWords(ast.NodeTransformer):
    """Leave of a function what a program can notice: of an error its class, of texts no case."""

    def visit_Raise(self, node: ast.Raise) -> ast.AST:
        return ast.Raise(node.exc.func if isinstance(node.exc, ast.Call) else node.exc, node.cause)

    def visit_Constant(self, node: ast.Constant) -> ast.AST:
        if isinstance(node.value, str):
            return ast.Constant(node.value.replace("XX", "").lower())
        return node


def body(function: ast.FunctionDef) -> ast.Module:
    return ast.parse(
        f"{ast.unparse(function.args)!r}\n" + "\n".join(map(ast.unparse, function.body))
    )


def changes(mutated: Path) -> dict[str, str]:
    """Read what mutmut has changed: for every mutant the lines, without those of words alone."""
    functions = {
        node.name: node
        for node in ast.walk(ast.parse(mutated.read_text(encoding="utf-8")))
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


def configure(copy: Path, module: str, tests: list[str]) -> None:
    """Tell mutmut in the copy's pyproject.toml which file to change and which tests to run."""
    settings = {
        "source_paths": [PACKAGE],
        "only_mutate": [f"{PACKAGE}/{module}.py"],
        "also_copy": [PACKAGE],
        "pytest_add_cli_args": ["-p", "no:cacheprovider"],
        "pytest_add_cli_args_test_selection": tests,
    }
    lines = [f"{key} = {json.dumps(value)}" for key, value in settings.items()]
    text = (ROOT / "pyproject.toml").read_text(encoding="utf-8")
    table = "\n".join(["", "[tool.mutmut]", *lines, "use_git_change_detection = false", ""])
    (copy / "pyproject.toml").write_text(text + table, encoding="utf-8")


def mutmut(copy: Path, *names: str) -> str:
    threads = dict.fromkeys(("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"), "1")
    done = subprocess.run(
        [sys.executable, "-m", "mutmut", "run", "--max-children", "1", *names],
        cwd=copy,
        env={**threads, **os.environ, "MPLBACKEND": "Agg"},
        capture_output=True,
        text=True,
        check=False,
    )
    return done.stdout + done.stderr


def run(copy: Path, module: str, sample: int, seed: int) -> tuple[list[str], dict[str, str]]:
    """Mutate one module; return the row of the table and the survivors' changed lines."""
    started = time.monotonic()
    configure(copy, module, [test for test in MODULES[module].split() if (ROOT / test).exists()])
    mutated = copy / "mutants" / PACKAGE / f"{module}.py"
    prefix = f"{PACKAGE}.{module.replace('/', '.')}."
    # a name that is none makes mutmut write its mutants and stop
    told = mutmut(copy, "none.of.these")
    if not mutated.with_suffix(".py.meta").exists():
        sys.exit(f"mutmut made no changes to {module}:\n{told[-2000:]}")
    found = changes(mutated)
    names = sorted(found)
    if len(names) > sample:
        names = sorted(random.Random(seed).sample(names, sample))
    told = mutmut(copy, *(prefix + name for name in names))
    codes = json.loads(mutated.with_suffix(".py.meta").read_text())["exit_code_by_key"]
    ends = {name: codes.get(prefix + name) for name in names}
    if None in ends.values():
        sys.exit(f"mutmut did not finish {module}:\n{told[-2000:]}")
    survivors = {name: found[name] for name in names if ends[name] == 0}
    endless = sum(code in TIMED_OUT for code in ends.values())
    untested = {name: found[name] for name in names if ends[name] in UNTESTED}
    noticed = len(names) - len(survivors) - len(untested) - endless
    counts = (len(found), len(names), noticed, endless, len(untested), len(survivors))
    minutes = (time.monotonic() - started) / 60
    return [module, *map(str, counts), f"{minutes:.0f}"], {**survivors, **untested}


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
            row, survivors = run(copy, module, asked.sample, asked.seed)
        print(f"| {' | '.join(row)} |", flush=True)
        survived = survived or bool(survivors)
        if asked.survivors is not None:
            with asked.survivors.open("a", encoding="utf-8") as file:
                file.writelines(f"{module} {name}\n{text}\n\n" for name, text in survivors.items())
    sys.exit(survived)


if __name__ == "__main__":
    main()
