import hashlib
import json
import pickle

import control as ct
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_array_equal

import ctrl_realize as cr
from ctrl_realize.errors import FileFormatError, OptionError, UnsuitableSystemError
from ctrl_realize.io import FitSummary, load_model, save_model
from ctrl_realize.results import Flag, ModelFit

FINITE = st.floats(allow_nan=False, allow_infinity=False, width=64)
# python-control keeps dots in names for itself
NAMES = st.text(st.characters(codec="utf-8", exclude_characters="."), min_size=1, max_size=12)


@st.composite
def models(draw):
    """Models of all shapes: static, SISO and MIMO, any delays, any finite numbers."""
    n, m, p = draw(st.integers(0, 4)), draw(st.integers(1, 3)), draw(st.integers(1, 3))
    core = [
        np.array(draw(st.lists(FINITE, min_size=a * b, max_size=a * b))).reshape(a, b)
        for a, b in ((n, n), (n, m), (p, n), (p, m))
    ]
    delays = st.integers(0, 40)
    return cr.DelayedStateSpace(
        ct.StateSpace(*core, draw(st.floats(1e-9, 1e9)), remove_useless_states=False),
        draw(st.lists(delays, min_size=m, max_size=m)),
        output_delay=draw(st.lists(delays, min_size=p, max_size=p)),
        name=draw(NAMES),
        inputs=draw(st.lists(NAMES, min_size=m, max_size=m, unique=True)),
        outputs=draw(st.lists(NAMES, min_size=p, max_size=p, unique=True)),
    )


def assert_same(loaded, model):
    assert type(loaded) is cr.DelayedStateSpace
    for letter in "ABCD":
        assert_array_equal(getattr(loaded, letter), getattr(model, letter), strict=True)
        ours, theirs = (np.signbit(getattr(s.delay_free, letter)) for s in (loaded, model))
        assert_array_equal(ours, theirs)
    for attribute in (
        "dt", "name", "input_labels", "output_labels", "state_labels",
        "input_delays", "output_delays",
    ):  # fmt: skip
        assert getattr(loaded, attribute) == getattr(model, attribute)


@given(models())
def test_save_and_load_is_the_identity(tmp_path_factory, model):
    file = tmp_path_factory.mktemp("model") / "model.json"
    save_model(file, model)
    loaded = load_model(file)
    assert_same(loaded, model)
    assert loaded.fit is None
    again = file.with_name("again.json")
    save_model(again, loaded)
    assert again.read_bytes() == file.read_bytes()


@pytest.fixture
def model():
    core = ct.ss([[0.9, 0.1], [0.0, 0.5]], [[0.0], [1 / 3]], [[1.0, 0.0]], [[0.0]], 1 / 1280)
    return cr.delayed_ss(core, 37, name="valve", inputs="current", outputs="position")


@pytest.fixture
def file(tmp_path, model):
    path = tmp_path / "valve.json"
    save_model(path, model, settings={"order": 3, "window": [0.1, 2]}, note="a bench")
    return path


class Fit(ModelFit):
    """A result with numbers of all kinds."""

    delay = np.int64(37)
    dead_time = 0.0289
    order = 3
    interval = 0.0287, np.inf
    delay_interval = None
    interval_kind = "flatness"
    sampling = "impulse-invariant"
    gain = np.float64(-2.0)
    records = ()
    choices = ("order 3: chosen by hand",)
    flags = (Flag("delay_at_bound", "the best delay is max_delay=100; try a larger one"),)

    def _title(self):
        return "Delay scan"

    def _rows(self):
        return [("delay", "37 samples"), ("IAE", "0.1")]


def test_the_main_numbers_of_a_fit_its_report_and_its_flags_stay(tmp_path, model):
    fit = Fit()
    save_model(tmp_path / "a.json", model.replace(fit=fit))
    summary = load_model(tmp_path / "a.json").fit
    assert isinstance(summary, FitSummary)
    assert summary.report() == fit.report()
    assert summary.flags == fit.flags
    assert (summary["delay"], summary["gain"], summary["sampling"]) == (37, -2.0, fit.sampling)
    assert (summary.gain, summary.order, summary.total_delay) == (-2.0, 3, None)
    assert (summary.interval_label, summary.choices) == (fit.interval_label, fit.choices)
    # JSON has no infinity
    assert summary["interval"] == (0.0287, "inf")
    assert summary.interval == (0.0287, np.inf)
    assert repr(summary) == "<FitSummary of Fit>"
    assert pickle.loads(pickle.dumps(summary)).report() == fit.report()
    with pytest.raises(KeyError):
        summary["onset"]


# -- files that are not what they should be ------------------------------------------------------


def test_a_file_cut_anywhere_is_refused(file):
    whole = file.read_bytes()
    # the last byte is the line end, which carries nothing
    for size in [*range(0, len(whole) - 2, 37), len(whole) - 2]:
        file.write_bytes(whole[:size])
        with pytest.raises(FileFormatError, match=r"truncated|empty"):
            load_model(file)


def signed(content):
    """A file whose checksum fits, as somebody who knows how could make it."""
    content.pop("sha256", None)
    canonical = json.dumps(content, sort_keys=True, separators=(",", ":"), allow_nan=False)
    return json.dumps({**content, "sha256": hashlib.sha256(canonical.encode()).hexdigest()})


NO_DELAY = "'input_delays' must contain 1 non-negative whole"
FIT = {"kind": "", "title": "", "rows": [], "values": {}, "flags": []}
EDITS = {
    "another format": ({"format": "pickle"}, "not a model file of ctrl_realize"),
    "a later schema": ({"schema": 2}, "later version: schema 2, this one reads up to 1"),
    "a schema of words": ({"schema": "1"}, "schema '1' is not known"),
    "schema true": ({"schema": True}, "schema True is not known"),
    "no model": ({"model": None}, "'model' is missing"),
    "a fit of words": ({"fit": "good"}, "'fit'"),
    "a fit with rows of words": ({"fit": {**FIT, "rows": ["ab"]}}, "'rows'"),
    "a fit with code": ({"fit": {**FIT, "values": {"a": {"b": 1}}}}, "'values'"),
    "A too small": ({"model.A": [[1.0]]}, "'A' must be 2 rows of 2"),
    "A of words": ({"model.A": [["1", "2"], ["3", "4"]]}, "'A' must be"),
    "A with true": ({"model.A": [[True, 0.0], [0.0, 0.0]]}, "'A' must be"),
    "B beyond doubles": ({"model.B": [[10**400], [0]]}, "'B' must be"),
    "order negative": ({"model.order": -1}, "negative order"),
    "order true": ({"model.order": True}, "'order' is true or false"),
    "order huge": ({"model.order": 10**9}, "'A' must be"),
    "delay negative": ({"model.input_delays": [-1]}, NO_DELAY),
    "delay broken": ({"model.input_delays": [1.5]}, NO_DELAY),
    "delay for two": ({"model.input_delays": [1, 2]}, NO_DELAY),
    "delay huge": ({"model.input_delays": [10**12]}, "samples; at most 10000000 are allowed"),
    "dt zero": ({"model.dt": 0}, "dt=0.0 is not a sample time"),
    "dt true": ({"model.dt": True}, "'dt' is true or false"),
    "dt beyond doubles": ({"model.dt": 10**400}, "too large"),
    "no inputs": ({"model.inputs": []}, "no inputs or outputs"),
    "inputs of numbers": ({"model.inputs": [1]}, "not text"),
    "a name too few": ({"model.states": ["x"]}, "1 names for"),
    "a name twice": ({"model.inputs": ["u", "u"]}, "a name twice"),
    "half a character": ({"model.name": "\ud800"}, "'name' is missing"),
    "an endless name": ({"model.name": "x" * 5000}, "'name' is missing"),
    "a name with a dot": ({"model.name": "a.b"}, "valve.json"),
}


@pytest.mark.parametrize(("changes", "match"), EDITS.values(), ids=EDITS.keys())
def test_content_that_makes_no_sense_is_refused_even_with_a_right_checksum(file, changes, match):
    content = json.loads(file.read_text())
    for key, value in changes.items():
        *parents, last = key.split(".")
        part = content
        for parent in parents:
            part = part[parent]
        part[last] = value
    file.write_text(signed(content))
    with pytest.raises(FileFormatError, match=match):
        load_model(file)


@pytest.mark.parametrize(
    ("text", "match"),
    [
        ("[" * 100_000, "not a model file"),
        ('{"a":' * 100_000, "not a model file"),
        ("9" * 100_000, "not a model file"),
        ('{"format": NaN}', "NaN is not a finite number"),
        ('{"schema": 1, "schema": 1}', "a key occurs twice"),
        ("[]", "not a model file"),
        ("null", "not a model file"),
        ("time,u,y\n0,1,2\n", "not a model file; expected one that save_model or identify wrote$"),
        ("\x80\x04\x95", "not a model file; expected one that save_model or identify wrote$"),
    ],
)
def test_other_files_are_refused(tmp_path, text, match):
    (tmp_path / "a.json").write_text(text, encoding="latin-1")
    with pytest.raises(FileFormatError, match=match):
        load_model(tmp_path / "a.json")


def test_a_model_of_any_delay_is_read(tmp_path, model):
    far = model.replace(delay=900_000)
    save_model(tmp_path / "a.json", far)
    assert_array_equal(load_model(tmp_path / "a.json")(1j), far(1j))
    plain = ct.ss([[0.5]], [[1.0]], [[2.0]], [[0.25]], 0.1, name="plain", inputs="a", outputs="b")
    save_model(tmp_path / "a.json", plain)
    assert_same(load_model(tmp_path / "a.json"), cr.DelayedStateSpace(plain, 0, name="plain"))


def test_what_cannot_be_saved_leaves_the_old_model_and_no_file(file, model):
    before = file.read_bytes()
    for what, settings in (
        (model, {"bad": {1, 2}}),
        (ct.ss(0.5, 1, 1, 0, True), {}),
        (ct.tf([1], [1, 0.5], 0.1), {}),
        (ct.StateSpace([[0.5]], [[np.inf]], [[1.0]], [[0.0]], 0.1), {}),
        ("model", {}),
    ):
        with pytest.raises((OptionError, UnsuitableSystemError)):
            save_model(file, what, settings=settings)
    with pytest.raises(UnsuitableSystemError, match=r"system is a str; .* after the path"):
        save_model(model, str(file))
    with pytest.raises(FileNotFoundError):
        save_model(file.parent / "nowhere" / "a.json", model)
    assert file.read_bytes() == before
    assert [path.name for path in file.parent.iterdir()] == [file.name]


def test_a_model_that_was_loaded_is_saved_as_it_was_and_keeps_its_interval(tmp_path):
    system = cr.identify(cr.bench.valve(noise=1e-3).step_record(16, rng=5), structures=[(3, 3)])
    save_model(tmp_path / "a.json", system)
    again = load_model(tmp_path / "a.json")
    assert again.fit.dead_time_interval == system.fit.dead_time_interval
    drawn, stored = (one.fit.plausible_models.models for one in (system, again))
    for each, other in zip(drawn, stored, strict=True):
        assert each.dead_time == other.dead_time
        assert_array_equal(each.poles, other.poles)
        assert_array_equal(each.numerator, other.numerator)
    pi = cr.design.pid(system)
    told = [cr.design.delay_robustness(each, pi).report() for each in (system, again)]
    assert told[0] == told[1]
    save_model(tmp_path / "b.json", again)
    assert (tmp_path / "a.json").read_bytes() == (tmp_path / "b.json").read_bytes()


def test_a_controller_of_a_loaded_model_is_that_of_the_model(tmp_path):
    """It was checked without the models that the record does not rule out, and had no units."""
    t = 10.0 * np.arange(70)
    lags = np.maximum(t - 563, 0)
    y = 15 - 15 * (150 * np.exp(-lags / 150) - 40 * np.exp(-lags / 40)) / 110
    y += 0.5 * np.random.default_rng(2).standard_normal(70)
    record = cr.Record(t, np.where(t < 500, 40.0, 50.0), y, units={"u": "%", "y": "°C"})
    system = cr.identify(record)
    save_model(tmp_path / "a.json", system)
    told = []
    for model in (system, load_model(tmp_path / "a.json")):
        with pytest.warns(cr.errors.ModelWarning):
            told.append(cr.design.pid(model, "simc", closed_loop_time="robust").report())
    assert told[0] == told[1]
    assert "UNSTABLE somewhere" in told[0]
    assert "%/°C" in told[0]


def test_notes_and_what_was_chosen_about_the_clock_are_read_as_they_were_written(tmp_path):
    rng = np.random.default_rng(4)
    t = np.sort(0.02 * (np.arange(900) + 0.2 * rng.uniform(-1, 1, 900)))
    y = np.where(t < 6.4, 0.0, -np.expm1(-(t - 6.4) / 0.8)) + 0.004 * rng.standard_normal(t.size)
    y[[120, 500, 730]] += 0.4  # outliers, which are a note
    system = cr.identify(cr.Record.from_samples(t, (t >= 6.0) * 1.0, y), structures="P1D")
    save_model(tmp_path / "a.json", system)
    assert load_model(tmp_path / "a.json").fit.report() == system.fit.report()
    assert "  - note: " in system.fit.report()
    assert "irregular" in system.fit.report()


@pytest.mark.parametrize("options", [{"structures": "P1D"}, {"method": "scan"}])
def test_a_model_that_was_loaded_is_judged_as_it_was(tmp_path, options):
    record = cr.bench.heater().step_record(rng=1)
    system = cr.identify(record, **options)
    save_model(tmp_path / "a.json", system)
    again = load_model(tmp_path / "a.json")
    assert again.fit.verdicts == system.fit.verdicts
    assert len(again.fit.verdicts) == (3 if "structures" in options else 0)
    assert cr.report.verdict_of(again) == cr.report.verdict_of(system)
    assert cr.report.summary(again, record) == cr.report.summary(system, record)


def test_a_plain_continuous_model_is_stored_without_delay(tmp_path):
    tank = ct.ss([[-0.5]], [[1.0]], [[2.0]], [[0.0]], name="tank", inputs="valve", outputs="level")
    for system in (tank, ct.ss([], [], [], [[3.0]], inputs="valve", outputs="level")):
        save_model(tmp_path / "a.json", system)
        again = load_model(tmp_path / "a.json")
        assert (again.dt, again.input_labels) == (system.dt, system.input_labels)
        assert again(0.3j) == system(0.3j)
    with pytest.raises(UnsuitableSystemError, match="expected a sample time"):
        save_model(tmp_path / "a.json", ct.ss([[0.5]], [[1.0]], [[2.0]], [[0.0]], True))


def test_an_actuator_is_stored_with_its_model(tmp_path):
    command = 10.0 + 8.0 * (np.arange(400) > 80)
    slow = cr.actuators.SlewRateLimit(16.0).simulate(command, 0.01)
    smooth = np.concatenate([np.zeros(9), np.cumsum(0.1 * 0.9 ** np.arange(391))])
    output = np.convolve(np.diff(slow, prepend=10.0), smooth)[:400]
    noise = 0.005 * np.random.default_rng(1).standard_normal(400)
    record = cr.Record(0.01 * np.arange(400), command, output + noise)
    sys = cr.fit_output_error(record, structures=[(1, 1)], actuator="slew_rate")
    file = tmp_path / "model.json"
    save_model(file, sys)
    loaded = load_model(file)
    assert loaded.fit.actuator == sys.fit.actuator
    assert (
        cr.compare({"a": loaded}, record).fit_percent == cr.compare({"a": sys}, record).fit_percent
    )
    # a file whose actuator is not one makes no linear model of it
    content = json.loads(file.read_text())
    for broken in (
        ["SlewRateLimit"], 5, [["Actuator"], "input", [], [], 1.0],
        [["SlewRateLimit", -1, None], "input", [], [], 1.0],
        [["SlewRateLimit", [1], None], "input", [], [], 1.0],
    ):  # fmt: skip
        content["fit"]["values"]["actuator"] = broken
        file.write_text(json.dumps(content))
        with pytest.raises(FileFormatError, match="actuator"):
            load_model(file)
