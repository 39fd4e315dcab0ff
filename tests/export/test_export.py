"""Exported code is compiled or parsed, run, and compared with the simulation."""

import ctypes
import keyword
import re
import shutil
import subprocess
import sys

import control as ct
import numpy as np
import pytest

import ctrl_realize as cr

export = cr.export
RNG = np.random.default_rng(8)
COUNT = 120
SETPOINT = np.repeat(RNG.uniform(30, 70, 8), COUNT // 8)
MEASURED = 50 + np.cumsum(RNG.standard_normal(COUNT))
MANUAL = np.where((np.arange(COUNT) // 30) % 3 == 1, 42.0, np.nan)
PID = cr.design.PIDController(2.3, 7.0, 1.5, 0.2, dt=0.25, name="TIC 101.OP")
ALGORITHMS = {
    "full": PID.algorithm(
        setpoint_weight=0.7, derivative_weight=0.1, output_limits=(0, 100), bias=35.0
    ),
    "forward": cr.design.PIDController(-0.8, 12.0, dt=0.25, method="forward").algorithm(
        output_limits=(-np.inf, 20), tracking_time=3.0
    ),
    "P": cr.design.PIDController(1.4, dt=0.25).algorithm(),
}
CORE = ct.tf([1.8, 0.3], [1.0, 0.9, 0.2])
SISO = cr.delayed_ss(CORE, dead_time=1.83, dt=0.25, name="column")
MIMO = cr.DelayedStateSpace(
    ct.ss(
        [[0.9, 0.1, 0], [0, 0.7, -0.2], [0, 0.2, 0.7]],
        [[1.0, 0], [0.5, -1], [0, 2]],
        [[1.0, 0, 0.3], [0, 1, 0]],
        [[0.2, 0], [0, 0]],
        0.25,
    ),
    [4, 0],
    output_delay=[0, 2],
    name="two by two",
)
PLANTS = {
    "gain": cr.delayed_ss(ct.ss([], [], [], [[2.0]], 0.25), 3, name="für [1]"),
    "siso": SISO,
    "mimo": MIMO,
    "lag": cr.delayed_ss(ct.ss(0.9, 1, 0.1, 0, 0.25), 0),
}
DIRECT = cr.delayed_ss(ct.ss(0.9, 1, 1, 1, 0.1), 0)
gcc = pytest.mark.skipif(shutil.which("gcc") is None, reason="gcc compiles the exported C")


def simulated(plant):
    """Outputs at the call after each input, as exported code gives them."""
    u = RNG.standard_normal((plant.ninputs, COUNT))
    longer = np.c_[u, np.zeros(plant.ninputs)]
    y = plant.simulate(longer if plant.ninputs > 1 else longer[0])
    return u, np.atleast_2d(y)[:, 1:]


def compiled(system, folder):
    source = export.to_c(system, folder / "unit.c", name="unit")
    library = folder / "unit.so"
    # C89 without warnings, as the compilers of controllers want it
    strict = ["-std=c89", "-pedantic", "-Wall", "-Wextra", "-Werror", "-O2", "-shared", "-fPIC"]
    subprocess.run(["gcc", *strict, "-o", str(library), str(source)], check=True)
    made = ctypes.CDLL(str(library))
    made.unit_step.restype = ctypes.c_double
    return made, ctypes.create_string_buffer(1 << 14)


def python_unit(system, folder):
    path = export.to_python(system, folder / "unit.py", name="unit")
    scope = {}
    exec(compile(path.read_text(), str(path), "exec"), scope)
    return scope["unit"]()


def structured_text(system, folder, **options):
    pytest.importorskip("blark", reason="blark parses Structured Text")
    from tests.oracles.structured_text import FunctionBlock

    return FunctionBlock(export.to_structured_text(system, folder / "u.st", **options).read_text())


def ran(system, language, inputs, folder):
    """Outputs of the exported code, a column for each row of inputs."""
    inputs = [list(map(float, row)) for row in inputs]
    algorithm = isinstance(system, cr.design.PIDAlgorithm)
    outputs = 1 if algorithm else system.noutputs
    if language == "python":
        unit = python_unit(system, folder)
        return np.transpose([np.atleast_1d(unit.step(*row)) for row in inputs])
    got = []
    if language == "c":
        made, state = compiled(system, folder)
        made.unit_init(state)
        for row in inputs:
            given = [ctypes.c_double(value) for value in row]
            if algorithm:
                given[2] = int(row[2])
            out = [ctypes.c_double() for _ in range(outputs)]
            single = made.unit_step(state, *given, *map(ctypes.byref, out if outputs > 1 else []))
            got.append([each.value for each in out] if outputs > 1 else [single])
        return np.transpose(got)
    block = structured_text(system, folder)
    names = ["u"] if len(inputs[0]) == 1 else ["u1", "u2"]
    for row in inputs:
        if algorithm:
            block(setpoint=row[0], measured=row[1], manual=bool(row[2]), manual_output=row[3])
        else:
            block(**dict(zip(names, row, strict=True)))
        shown = r"u" if algorithm else r"y\d?"
        got.append([value for name, value in block.values.items() if re.fullmatch(shown, name)])
    return np.transpose(got)


LANGUAGES = pytest.mark.parametrize("language", [pytest.param("c", marks=gcc), "python", "st"])


@pytest.mark.parametrize("kind", ALGORITHMS)
@LANGUAGES
def test_an_exported_controller_is_the_simulated_one(kind, language, tmp_path):
    expected = ALGORITHMS[kind].simulate(SETPOINT, MEASURED, MANUAL)
    signals = np.stack([SETPOINT, MEASURED, ~np.isnan(MANUAL), np.nan_to_num(MANUAL)], axis=1)
    got = ran(ALGORITHMS[kind], language, signals, tmp_path)
    np.testing.assert_allclose(got[0], expected, rtol=1e-12, atol=1e-12)
    assert np.ptp(expected) > 5


@pytest.mark.parametrize("kind", PLANTS)
@LANGUAGES
def test_an_exported_plant_is_the_simulated_one(kind, language, tmp_path):
    u, expected = simulated(PLANTS[kind])
    got = ran(PLANTS[kind], language, u.T, tmp_path)
    np.testing.assert_allclose(got, expected, rtol=0, atol=1e-12 * np.abs(expected).max())


def test_names_become_identifiers_and_short_numbers_are_a_choice(tmp_path):
    block = structured_text(ALGORITHMS["full"], tmp_path, real="REAL")
    assert str(block.block.name) == "TIC_101_OP"
    text = (tmp_path / "u.st").read_text()
    assert "LREAL" not in text
    assert text.isascii()
    path = export.to_python(PID, tmp_path / "a.py", name="while")
    assert "class while_1:" in path.read_text()


# IEC 61131-3: elementary types (table 10), standard functions (tables 22 to 38) and function
# blocks (tables 43 to 46), keywords; each of its kind.
IEC_WORDS = """TIME WORD LREAL TIME_OF_DAY LDT WSTRING INT_TO_REAL TO_DINT BCD_TO_UINT TRUNC ABS
EXPT ATAN2 SHL MUX LE MID CONCAT_DATE_TOD SPLIT_DT SR RS R_TRIG CTUD TP TON TOF END_IF INITIAL_STEP
VAR_IN_OUT NAMESPACE OVERRIDE REF_TO Private by AT ENO ANY_NUM LDN"""
MATLAB_WORDS = "catch otherwise parfor spmd classdef end"


@pytest.mark.parametrize("word", [*IEC_WORDS.split(), *MATLAB_WORDS.split(), *keyword.kwlist])
def test_a_word_of_any_language_is_no_name(word, tmp_path):
    expected = f"{word}_1"
    text = export.to_structured_text(PID, tmp_path / "a.st", name=word).read_text()
    assert f"FUNCTION_BLOCK {expected}\n" in text
    text = export.to_python(PID, tmp_path / "a.py", name=word).read_text()
    scope = {}
    exec(compile(text, "a.py", "exec"), scope)
    assert expected in scope
    assert f"\n{expected} = pid(" in export.to_matlab(PID, tmp_path / "a.m", name=word).read_text()


@pytest.mark.parametrize(
    ("name", "expected"),
    [("", "TIC_101_OP"), ("  ", "pid"), ("7", "pid_7"), ("\u6e29\u5ea6", "pid"), ("_x__y", "x_y")],
)
def test_a_name_of_other_signs_becomes_an_identifier(name, expected, tmp_path):
    text = export.to_structured_text(PID, tmp_path / "a.st", name=name).read_text()
    assert f"FUNCTION_BLOCK {expected}\n" in text


def test_variables_of_a_script_differ_before_matlab_cuts_their_names(tmp_path):
    text = export.to_matlab(ALGORITHMS["full"], tmp_path / "a.m", name="x" * 100).read_text()
    names = re.findall(r"^(\w+) = ", text, re.M)
    assert len(names) == 3
    assert max(map(len, names)) <= 63
    # a variable `ss` would hide the function when the script runs again
    assert "\nss_1 = ss(" in export.to_matlab(SISO, tmp_path / "a.m", name="ss").read_text()


BREAKS = "".join(map(chr, (*range(32), 127, 0x85, 0x2028)))


@pytest.mark.parametrize("name", ["G\rclear all", "G\x0bquit", "G\x0cquit", f"G{BREAKS}quit"])
def test_no_sign_of_a_name_or_label_ends_a_comment_or_a_text(name, tmp_path):
    plant = cr.delayed_ss(CORE, dead_time=1.83, dt=0.25, name=name, inputs=[name], outputs=["a'b"])
    text = export.to_matlab(plant, tmp_path / "a.m", name="G").read_text()
    assert all(re.match(r"% |G(_[ABCD]|\.\w+)? = .*;$", line) for line in text.splitlines())
    assert "G.OutputName = {'a''b'};" in text
    for write, suffix in ((export.to_structured_text, "st"), (export.to_c, "c")):
        text = write(plant, tmp_path / f"a.{suffix}", name="G").read_text()
        assert not re.search(r"[^\n\x20-\x7e]", text)
    text = export.to_python(plant, tmp_path / "a.py", name="G").read_text()
    compile(text, "a.py", "exec")


@pytest.mark.parametrize(
    ("system", "rules"),
    [
        (PID, "integral by the tustin rule, derivative by the backward rule"),
        (ALGORITHMS["forward"], "integral by the forward rule"),
        (ALGORITHMS["P"], None),
    ],
)
def test_the_head_states_the_rule_of_each_part(system, rules, tmp_path):
    head = export.to_c(system, tmp_path / "a.c").read_text().splitlines()[1]
    assert ("rule" in head) == (rules is not None)
    assert rules is None or head.endswith(f", {rules} */")


@pytest.mark.skipif(sys.platform != "linux", reason="pythonfmu brings libraries for this machine")
@pytest.mark.parametrize("name", ["Boolean", "round", "class"])
def test_an_fmu_runs_under_any_name(name, tmp_path):
    pytest.importorskip("pythonfmu", reason="pythonfmu makes FMUs")
    fmpy = pytest.importorskip("fmpy", reason="fmpy runs FMUs")
    gain = cr.delayed_ss(ct.ss([], [], [], [[2.0]], 0.25), 1, inputs=["a\x0bb"], name="G\x0c")
    path = export.to_fmu(gain, tmp_path / "a.fmu", name=name)
    held = np.array([(0.0, 1.5)], dtype=[("time", float), ("u", float)])
    options = {"stop_time": 1.0, "step_size": 0.25, "output_interval": 0.25, "output": ["y"]}
    result = fmpy.simulate_fmu(str(path), input=held, **options)
    assert result["y"][-1] == 3.0


@pytest.mark.skipif(sys.platform != "linux", reason="pythonfmu brings libraries for this machine")
def test_two_fmus_of_one_name_in_a_process_are_two_plants(tmp_path):
    pytest.importorskip("pythonfmu", reason="pythonfmu makes FMUs")
    fmpy = pytest.importorskip("fmpy", reason="fmpy runs FMUs")
    held = np.array([(0.0, 1.0)], dtype=[("time", float), ("u", float)])
    options = {"stop_time": 1.0, "step_size": 0.25, "output_interval": 0.25, "output": ["y"]}
    for gain in (2.0, 3.0):  # the second ran the code of the first
        plant = cr.delayed_ss(ct.ss([], [], [], [[gain]], 0.25), 1)
        path = export.to_fmu(plant, tmp_path / f"{gain}.fmu", name="plant")
        result = fmpy.simulate_fmu(str(path), input=held, **options)
        assert result["y"][-1] == gain


@pytest.mark.skipif(sys.platform != "linux", reason="pythonfmu brings libraries for this machine")
def test_an_fmu_is_valid_and_simulates_the_model(tmp_path):
    pytest.importorskip("pythonfmu", reason="pythonfmu makes FMUs")
    fmpy = pytest.importorskip("fmpy", reason="fmpy runs FMUs")
    from fmpy.validation import validate_fmu

    places = list(sys.path)
    path = export.to_fmu(SISO, tmp_path / "column.fmu")
    assert sys.path == places
    assert validate_fmu(str(path)) == []
    assert validate_fmu(str(export.to_fmu(ALGORITHMS["full"], tmp_path / "pid.fmu"))) == []
    u, expected = simulated(SISO)
    time = 0.25 * np.arange(COUNT)
    held = np.array(list(zip(time, u[0], strict=True)), dtype=[("time", float), ("u", float)])
    result = fmpy.simulate_fmu(
        str(path),
        stop_time=0.25 * 100,
        step_size=0.25,
        output_interval=0.25,
        input=held,
        output=["y"],
    )
    np.testing.assert_allclose(result["y"][1:100], expected[0, :99], rtol=0, atol=1e-12)


@pytest.mark.parametrize(
    ("write", "grammar"),
    [
        (export.to_structured_text, "tree_sitter_iec61131_3_st"),
        (export.to_matlab, "tree_sitter_matlab"),
    ],
)
def test_a_second_parser_accepts_the_text(write, grammar, tmp_path):
    tree_sitter = pytest.importorskip("tree_sitter", reason="tree-sitter parses exported text")
    language = pytest.importorskip(grammar, reason="the grammar of the exported text").language()
    parser = tree_sitter.Parser(tree_sitter.Language(language))
    for system in (*ALGORITHMS.values(), *PLANTS.values(), PID):
        text = write(system, tmp_path / "unit.m").read_bytes()
        assert not parser.parse(text).root_node.has_error
        assert parser.parse(text + b"\nx = (1 + ;\n").root_node.has_error


@pytest.mark.skipif(shutil.which("g++") is None, reason="g++ compiles the sketch")
def test_a_sketch_in_c_plus_plus_links_with_the_exported_c(tmp_path):
    # As an Arduino is programmed: the sketch is C++, a file beside it that ends in .c is C.
    source = export.to_c(ALGORITHMS["P"], tmp_path / "unit.c", name="unit")
    sketch = tmp_path / "sketch.cpp"
    sketch.write_text(
        '#include <stdio.h>\n#include "unit.h"\nint main() { unit_state s; unit_init(&s); '
        'printf("%.6f", unit_step(&s, 3.0, 1.0, 0, 0.0)); }\n'
    )
    subprocess.run(["gcc", "-c", str(source), "-o", str(tmp_path / "unit.o")], check=True)
    program = str(tmp_path / "program")
    subprocess.run(["g++", str(sketch), str(tmp_path / "unit.o"), "-o", program], check=True)
    answer = subprocess.run([program], check=True, capture_output=True, text=True).stdout
    assert float(answer) == pytest.approx(1.4 * 2.0)  # kp (3 - 1)


def read_script(path):
    """Variables of a script of MATLAB: matrices as arrays, calls as (name, arguments)."""
    found = {}
    for name, value in re.findall(r"^(\w+) = (.*);$", path.read_text(), re.M):
        call = re.fullmatch(r"(\w+)\((.*)\)", value)
        if call and call[1] != "zeros":
            parts = re.findall(r"\[[^]]*\]|[^,]+", call[2])
            found[name] = (call[1], [part.strip().strip("'") for part in parts])
        elif value.startswith(("[", "-")) or value[0].isdigit():
            rows = value.strip("[]").split(";")
            found[name] = np.array([row.split() for row in rows], dtype=float)
    return found


@pytest.mark.parametrize("kind", ["siso", "mimo"])
def test_a_script_of_matlab_has_all_digits_and_the_delays(kind, tmp_path):
    plant = PLANTS[kind]
    script = read_script(export.to_matlab(plant, tmp_path / "plant.m", name="G"))
    for letter in "ABCD":
        np.testing.assert_array_equal(script[f"G_{letter}"], getattr(plant.delay_free, letter))
    name, (a, b, c, d, dt, *delays) = script["G"]
    assert (name, a, b, c, d, float(dt)) == ("ss", "G_A", "G_B", "G_C", "G_D", 0.25)
    expected = {
        "siso": ["InputDelay", "8"],
        "mimo": ["InputDelay", "[4; 0]", "OutputDelay", "[0; 2]"],
    }
    assert delays == expected[kind]


def test_delays_inside_of_loops_keep_their_form(tmp_path):
    loop = ct.feedback(ct.tf([2.0], [3.0, 1.0]) * cr.delay(0.7), 0.4)
    script = read_script(export.to_matlab(loop, tmp_path / "loop.m", name="T"))
    assert script["T"] == ("setDelayModel", ["T_core", "0.7"])
    # w(t) = z(t - tau) between the last output and the last input of the core
    A, B, C, D = (script[f"T_core_{letter}"] for letter in "ABCD")
    for omega in (0.1, 1.0, 4.0):
        H = C @ np.linalg.solve(1j * omega * np.eye(1) - A, B) + D
        late = np.exp(-0.7j * omega)
        got = H[0, 0] + H[0, 1] * late * H[1, 0] / (1 - H[1, 1] * late)
        plant = 2.0 * late / (3j * omega + 1)
        assert got == pytest.approx(plant / (1 + 0.4 * plant), rel=1e-12)


def test_scripts_of_continuous_models_and_controllers(tmp_path):
    path = tmp_path / "x.m"
    continuous = read_script(export.to_matlab(SISO, path, name="G", continuous=True))
    assert continuous["G"][1][4:6] == ["0", "InputDelay"]
    assert float(continuous["G"][1][6]) == pytest.approx(1.83, rel=1e-9)
    poles = np.linalg.eigvals(continuous["G_A"])
    np.testing.assert_allclose(np.sort(poles), [-0.5, -0.4], rtol=1e-9)
    name, gains = read_script(export.to_matlab(PID, path, name="C"))["C"]
    assert name == "pid"
    assert list(map(float, gains[:5])) == pytest.approx([2.3, 2.3 / 7, 2.3 * 1.5, 0.2, 0.25])
    assert gains[5:] == ["IFormula", "Trapezoidal", "DFormula", "BackwardEuler"]
    script = read_script(export.to_matlab(ALGORITHMS["full"], path, name="C"))
    assert script["C"][0] == "pid2"
    assert script["C"][1][4:6] == ["0.7", "0.1"]
    np.testing.assert_array_equal(script["C_limits"], [[0, 100]])
    assert script["C_tracking_time"][0, 0] == pytest.approx(np.sqrt(7.0 * 1.5))


@pytest.mark.parametrize(
    ("error", "match", "write", "system", "name"),
    [
        ("OptionError", "ends in .c", export.to_c, PID, "a.txt"),
        ("OptionError", "discretised", export.to_c, PID.continuous, "a.c"),
        ("UnsuitableSystemError", "TransferFunction", export.to_python, CORE, "a.py"),
        ("UnsuitableSystemError", "DelayedStateSpace", export.to_matlab, CORE, "a.m"),
        ("UnsuitableSystemError", "within the same", export.to_structured_text, DIRECT, "a.st"),
    ],
)
def test_what_cannot_be_exported_is_refused_and_writes_nothing(
    error, match, write, system, name, tmp_path
):
    with pytest.raises(getattr(cr.errors, error), match=match):
        write(system, tmp_path / name)
    assert list(tmp_path.iterdir()) == []
