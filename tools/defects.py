#!/usr/bin/env python3
"""Put one deliberate defect at a time into a copy of the project, and see whether a test fails.

    python3 tools/defects.py                          all of them
    python3 tools/defects.py noise interval           those whose names hold one of these words
    python3 tools/defects.py --list                   what is wrong in each
    python3 tools/defects.py --tree ../other --write table.json

The list was made before the tests were cut, to tell whether the shorter suite is as strong. Each
defect is a wrong sign, unit, limit or choice that somebody could have made, at one place that is
found by its text wherever the module lies. The test files whose names hold one of its words run
first, then the folders named, until the first failure. A text that is not found once is an error
of the list: renew it.
"""

from __future__ import annotations

import argparse
import json
import os
import shutil
import subprocess
import sys
import tempfile
import time
from dataclasses import dataclass
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
PACKAGE = "ctrl_realize"
LIMIT = 900  # seconds for the tests of one defect
KERNELS, FITS, LOOPS = "numerics identification", "identification numerics", "design numerics"
FREQUENCY, SYSTEMS, FILES = "frequency numerics", "test_delayed.py design host", "io"


@dataclass(frozen=True)
class Defect:
    """One place to be spoilt: `old` becomes `new`; `where` are words of test files, and folders."""

    name: str
    wrong: str
    old: str
    new: str
    where: tuple[str, str]


def _d(name: str, wrong: str, old: str, new: str, words: str, folders: str) -> Defect:
    return Defect(name, wrong, old, new, (words, folders))


DEFECTS = (
    # --- realization
    _d("kung signs", "negative eigenvalues of the Hankel matrix lose their sign",
       "sign = np.where(values < 0, -1.0, 1.0)", "sign = np.ones_like(values)", "kung", KERNELS),
    _d("kung last row", "the shifted Hankel matrix ends with zeros instead of the next sample",
       "shifted += vectors[:, :, -1, np.newaxis] * along[:, np.newaxis, :]",
       "shifted += 0.0 * along[:, np.newaxis, :]", "kung", KERNELS),
    _d("kung block signs", "C of several channels does not turn with B",
       "C = U[:p] * (turn * root)", "C = U[:p] * root", "kung mimo", KERNELS),
    _d("truncation bound", "half of the bound of the truncation error",
       "return 2.0 * float(np.sqrt(missing * rest))", "return float(np.sqrt(missing * rest))",
       "kung", KERNELS),
    _d("hankel wraps", "a transform too short: the product wraps around",
       "self.points = fft_length(2 * size - 1)", "self.points = fft_length(size)",
       "hankel", KERNELS),
    _d("hankel norm", "every antidiagonal counted once too little",
       "np.minimum(k + 1, rows + columns - 1 - k)", "np.minimum(k, rows + columns - 1 - k)",
       "hankel kung", KERNELS),
    _d("iae feedthrough", "the direct term is no part of the misfit",
       "iae += np.abs(markov[delays] - D)", "iae += np.abs(markov[delays])", "kung", KERNELS),
    _d("iae before the delay", "what lies before the delay is no misfit: late delays look better",
       "iae += np.concatenate([[0.0], np.cumsum(np.abs(markov))])[delays]", "iae += 0.0",
       "kung scan", KERNELS),
    _d("iae end of the window", "one sample beyond the window counts for every delay",
       "row[window - 1 - delay :] = 0.0", "row[window - delay :] = 0.0", "kung scan", KERNELS),
    # --- the separable fit
    _d("slope of the static part", "the derivative of the level with a pole has the wrong sign",
       "level = ((-1.0 / self._free)[:, None] @ self.dfree)[:, 0].real",
       "level = ((1.0 / self._free)[:, None] @ self.dfree)[:, 0].real",
       "eliminate local_terms", KERNELS),
    _d("slope with the delay", "the derivative of the response with the delay has the wrong sign",
       "through[:, :, 0] = -amplitudes * self._poles",
       "through[:, :, 0] = amplitudes * self._poles",
       "eliminate", KERNELS),
    _d("no projection", "gains count as known where the delay's deviation is computed",
       "return np.asarray(columns - basis @ (np.swapaxes(basis, 1, 2) @ columns))",
       "return columns", "eliminate local_terms cramer", KERNELS),
    _d("initial state", "the free response of a record does not follow its poles",
       "derivative[:, :, derivative.shape[2] - moved.shape[2] :] += moved", "pass",
       "local_terms eliminate", KERNELS),
    # --- noise
    _d("noise of third differences", "a record without rest seems 2.6 times as noisy",
       "third = np.diff(record, 3) / np.sqrt(20)", "third = np.diff(record, 3) / np.sqrt(3)",
       "noise", KERNELS),
    _d("drift in coloured noise", "slow noise before the step passes for a drift",
       "error = sigma * np.sqrt(12 * correlation_time(residual) / residual.size**3)",
       "error = sigma * np.sqrt(12 / residual.size**3)", "noise decisions", KERNELS),
    _d("clipped noise", "noise comes out 4 % too small",
       "max(values.size - lost, 1))) / 0.96", "max(values.size - lost, 1)))", "noise", KERNELS),
    _d("correlation time", "coloured samples count for half of what they share",
       "time = 2 * float(_correlation(residual).sum(axis=1).sum()) - 1.0",
       "time = float(_correlation(residual).sum(axis=1).sum())", "noise", KERNELS),
    _d("hum", "a sine in the rest is not seen", "while n >= 64 and len(found) < most:",
       "while False:", "noise", KERNELS),
    _d("rounding as noise", "an undithered output has no noise at all",
       "floor = quantum / np.sqrt(12)", "floor = 0.0", "noise step_data step_fit rounded", KERNELS),
    # --- edges and onset
    _d("edge late", "the step is put on the last sample at rest",
       "first = int(resting[-1]) + 1 if resting.size else 0",
       "first = int(resting[-1]) if resting.size else 0", "edges steps", KERNELS),
    _d("onset at the crossing", "the onset is not walked back from the threshold",
       "return crossing - low * (second - crossing) / (high - low)", "return float(crossing)",
       "onset", KERNELS),
    # --- intervals
    _d("interval of 68 percent", "limits of the likelihood of one sigma, called 95 %",
       "CHI2_95 = 3.841458820694124", "CHI2_95 = 1.0", "profile", KERNELS),
    _d("std of the interval", "twice the standard deviation",
       "DelayInterval(low, high, (last - first) / (2 * Z_95))",
       "DelayInterval(low, high, (last - first) / Z_95)",
       "step_fit profile decisions any_input", FITS),
    _d("plausible structures", "structures that the data do not rule out leave the interval",
       "STRONG, VERY_STRONG = 6.0, 10.0", "STRONG, VERY_STRONG = 6.0, 0.01",
       "poles step_fit decisions", "numerics"),
    _d("least charge", "structures with needless zeros widen the interval of short records",
       "more = least_charge(penalty) - penalty", "more = 0.0",
       "step_fit decisions any_input", FITS),
    _d("open beginning", "a zero that imitates a smooth onset leaves the interval narrow",
       "open_start = onset is not None and choice.flow is None and chosen.structure.zeros > 0",
       "open_start = False", "step_fit lags_flow", FITS),
    _d("flows narrow", "axial dispersion that is not ruled out leaves the interval as it is",
       "limits += [(other.low, other.high) for other in others]",
       "limits += [(o.low, o.high) for o in others[len(flows):]]", "lags_flow", FITS),
    _d("endless chain", "chains that get better with every lag still have a firm delay",
       "if unlimited := still_improving(equal_lags, min(fits.criterion.values())):",
       "if unlimited := False:",
       "step_fit lags_flow", FITS),
    _d("rounding averages out", "a coarse output of any input is as good as its many samples",
       "return step if coarse else 0.0", "return 0.0", "coarse_output", FITS),
    _d("chain as long", "a plant as long as the longest chain passes for a longer one",
       "far = excess[-1] > max(_WORSE, excess[-2] / _WORSE)", "far = excess[-1] > _WORSE",
       "fit_frf", FREQUENCY),
    _d("resonance as chain", "a plant that no chain explains passes for a long chain",
       "np.all(np.diff(np.log(excess), 2) < 0) if far else", "True if far else",
       "fit_frf", FREQUENCY),
    _d("views narrow", "where no model is adequate the interval leaves out the latest view",
       "high = min(max(float(dead_times[-1]), dead_time + unseen), fits.scales.latest)",
       "high = min(float(dead_times[-2]), fits.scales.latest)",
       "step_data decisions step_fit", FITS),
    _d("records that differ", "jitter from record to record does not widen the interval",
       "if repeats.p_value < 0.01:", "if False:", "several decisions", FITS),
    # --- choices of the fit
    _d("coloured noise ignored", "noise is never made white",
       "in_coloured_noise(noisy, data) if whiten", "in_coloured_noise(noisy, data) if False",
       "step_data lags_flow decisions", FITS),
    _d("every model adequate", "a residual with structure passes for noise",
       "noise = rms <= level or (", "noise = True or (",
       "step_data step_fit decisions", FITS),
    _d("needless zeros", "zeros and poles cost nothing more",
       "NEEDLESS_ZERO, NEEDLESS_POLE = 6.0, 4.0",
       "NEEDLESS_ZERO, NEEDLESS_POLE = 0.0, 0.0",
       "poles lags_flow decisions step_fit", FITS),
    _d("no chains", "equal lags are never taken for a chain",
       "if chain is not None and chain.criterion < lags.level:", "if False:",
       "lags_flow", FITS),
    _d("no flows", "axial dispersion never takes the place of lags",
       "if flow is None or flow.criterion >= lags.level:", "if True:",
       "lags_flow", FITS),
    _d("unlike noise", "what the noise cannot explain is made white all the same",
       "if colour > _UNLIKE**2 and Rule.UNLIKE.on:", "if False:", "lags_flow", FITS),
    _d("steps from anything", "an input that never holds a level is taken for steps",
       "_HOLDS = 0.2", "_HOLDS = 1e3", "step_fit any_input decisions", FITS),
    # --- flags
    _d("delay at its bound", "a delay at max_delay is not flagged",
       "if reached and fit.high >= AT_BOUND * fit.latest:", "if False:",
       "test_flags step_fit unmodelled", FITS),
    _d("no delay at all", "that no dead time fits as well is not flagged",
       "return fit.low <= _SAMPLES_BESIDE_NOTHING * dt and not stated", "return False",
       "short_dead gain_resolved", FITS),
    _d("not settled", "a record that ends early is not flagged",
       "elif fit.numerator[0] and (unseen := _not_died_away(fit.poles, seen)).size:", "elif False:",
       "test_flags step_fit unmodelled", FITS),
    _d("integrator", "an integrating plant is not flagged",
       "if np.abs(fit.poles).min() * length < INTEGRATOR:", "if False:",
       "test_flags step_fit unmodelled", FITS),
    _d("outliers", "samples far off the model are not flagged",
       "if share > _MANY:", "if False:",
       "missing_samples", FITS),
    # --- choices of the method
    _d("modes never asked", "a plant that rings keeps its lags, whatever they leave",
       "if fit.actuator is not None or np.isfinite(fit.onset) or missing:", "if True:",
       "identify decisions", FITS),
    _d("modes for nothing", "any gain of the criterion replaces lags by modes",
       "if gain > VERY_STRONG and not late:", "if not late:",
       "identify decisions", FITS),
    _d("best of the models", "the most favourable model decides whether a plant can be tuned",
       "float(np.sort(found)[-1 - seldom])", "float(np.min(found))", "verdicts", FITS),
    _d("never OKID", "a lightly damped plant is not given to OKID",
       "CLEARLY = 0.5", "CLEARLY = 0.0", "from_io decisions", FITS),
    _d("response cut off", "the length of a response does not grow with what is left at its end",
       "if length is not None or not tail or count == most:", "if True:",
       "from_io decisions", FITS),
    _d("delays of channels", "delays of several channels stay where the search begins",
       "if better.bic >= best.bic:", "if True:", "state_space_fit decisions", FITS),
    _d("silent output", "an output of pure noise is not flagged",
       "gain < count * np.log(found.counts)", "gain < 0",
       "state_space_fit decisions", FITS),
    _d("order by the noise", "orders that only follow the noise are suggested", "ABOVE_NOISE = 1.3",
       "ABOVE_NOISE = 0.0", "order_scan", FITS),
    # --- correlation, frequency responses
    _d("cross-correlation", "lags have the wrong sign",
       "product = np.fft.rfft(x, n=points) * np.conj(np.fft.rfft(y, n=points))",
       "product = np.conj(np.fft.rfft(x, n=points)) * np.fft.rfft(y, n=points)",
       "filters residuals", KERNELS),
    _d("overlapping segments", "segments that overlap count as independent",
       "return count / (1 + excess)", "return float(count)", "spectral rational", FREQUENCY),
    _d("hold in comparison", "half a sample of the hold stays in the model's phase",
       "model = model / hold_response(omega, dt)", "model = model * 1.0", "compare", FREQUENCY),
    _d("stepped sine", "repeats are averaged without their phases",
       "response = (y @ u.conj()) / (u @ u.conj()).real",
       "response = (np.abs(y) @ np.abs(u)) / (u @ u.conj()).real", "stepped", FREQUENCY),
    # --- systems with delay, design, files, tracker
    _d("output delays", "responses leave out the delays of the outputs",
       "later(free[i, j], before + behind)", "later(free[i, j], before)", "delayed", SYSTEMS),
    _d("part of a sample", "a part of a sample moves the input into a wrong state",
       "Gamma1 = early @ partial", "Gamma1 = partial", "sampling delayed", KERNELS),
    _d("forgetting", "the mean of the output never forgets",
       "self._total = keep * self._total + y", "self._total = self._total + y",
       "recursive tracker", KERNELS),
    _d("tracker offset", "an offset of the input enters the solution",
       "gram -= sums[:, :, None] * sums[:, None, :] / self.weight", "gram = gram * 1.0",
       "recursive tracker", KERNELS),
    _d("delay margin", "the delay margin forgets to leave degrees",
       "np.where(pm < 0, pm + 360, pm) * np.pi / 180 / gains",
       "np.where(pm < 0, pm + 360, pm) / 180 / gains", "margins", LOOPS),
    _d("SIMC integral time", "SIMC's integral time is not bounded for slow lags",
       "ti, second = min(model.lag, 4 * (tau_c + theta)), model.second_lag",
       "ti, second = model.lag, model.second_lag", "pid", LOOPS),
    _d("minutes", "a column in minutes is read as seconds", '"min": (60.0, 1.0)',
       '"min": (1.0, 1.0)', "records", FILES),
)  # fmt: skip


def main() -> int:
    """Run what was asked for, and print a line for each defect."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("words", nargs="*", help="words of names; none: all defects")
    parser.add_argument("--tree", type=Path, default=ROOT, help="the project to be spoilt")
    parser.add_argument("--write", type=Path, help="file for the results, as JSON; resumed")
    parser.add_argument("--named", action="store_true", help="only files whose names fit a defect")
    parser.add_argument("--list", action="store_true", help="only say what is wrong in each")
    asked = parser.parse_args()
    chosen = [d for d in DEFECTS if not asked.words or any(w in d.name for w in asked.words)]
    if asked.list:
        for defect in chosen:
            print(f"{defect.name:28} {defect.wrong}")
        return 0
    done = {}
    if asked.write is not None and asked.write.exists():
        done = json.loads(asked.write.read_text())
    for defect in chosen:
        if defect.name in done:
            continue
        done[defect.name] = result = _tried(defect, asked.tree.resolve(), asked.named)
        print(f"{defect.name:28} {result['result']:10} {result['seconds']:5} s  {result['by']}")
        sys.stdout.flush()
        if asked.write is not None:
            asked.write.write_text(json.dumps(done, indent=1))
    found = sum(done[d.name]["result"] == "found" for d in chosen)
    print(f"{found} of {len(chosen)} found")
    return 0


def _tried(defect: Defect, tree: Path, named: bool) -> dict[str, str | int]:
    """Run the tests on a spoilt copy: found, not found, no end, or no such text."""
    begun = time.monotonic()
    with tempfile.TemporaryDirectory() as folder:
        copy = Path(folder) / "tree"
        skipped = shutil.ignore_patterns("__pycache__", ".*", "_build", "*.ipynb")
        shutil.copytree(tree, copy, ignore=skipped)
        places = [
            path for path in copy.glob(f"{PACKAGE}/**/*.py") if defect.old in path.read_text()
        ]
        if len(places) != 1 or places[0].read_text().count(defect.old) != 1:
            return {"result": "no text", "seconds": 0, "by": f"found in {len(places)} modules"}
        places[0].write_text(places[0].read_text().replace(defect.old, defect.new))
        result, by = "not found", ""
        words, folders = (part.split() for part in defect.where)
        first = [
            str(path)
            for path in sorted((copy / "tests").glob("**/test_*.py"))
            if any(word in path.name for word in words)
        ]
        rest = [str(copy / "tests" / name) for name in folders if (copy / "tests" / name).exists()]
        for paths in (first,) if named else (first, rest):
            if result == "not found" and paths:
                result, by = _run(paths, copy)
    return {"result": result, "seconds": round(time.monotonic() - begun), "by": by}


def _run(paths: list[str], copy: Path) -> tuple[str, str]:
    environment = os.environ | {
        "PYTHONPATH": str(copy),
        "OMP_NUM_THREADS": "1",
        "OPENBLAS_NUM_THREADS": "1",
        "MPLBACKEND": "Agg",
    }
    command = [sys.executable, "-m", "pytest", "-x", "-q", "--tb=no", "-p", "no:cacheprovider"]
    try:
        ended = subprocess.run(
            [*command, *paths], cwd=copy, env=environment, capture_output=True, text=True,
            timeout=LIMIT, check=False,
        )  # fmt: skip
    except subprocess.TimeoutExpired:
        return "no end", f"after {LIMIT} s"
    failed = [line for line in ended.stdout.splitlines() if line.startswith(("FAILED", "ERROR"))]
    if ended.returncode == 1:
        return "found", failed[0].split(" - ")[0].split(" ", 1)[1] if failed else ""
    return ("not found", "") if ended.returncode in (0, 5) else ("error", ended.stdout[-200:])


if __name__ == "__main__":
    sys.exit(main())
