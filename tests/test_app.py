"""The session behind the app: commands in, drawing data out."""

import base64
import json
import re

import numpy as np
import pytest

import ctrl_realize as cr
from ctrl_realize.interactive.session import Session
from tests.app_records import messy_csv, step_record


def opened(name: str, content: bytes, **more):
    return {"do": "open", "name": name, "content": base64.b64encode(content).decode(), **more}


def put(part, index=None, **values):
    place = {} if index is None else {"index": index}
    return {"do": "set", "part": part, "values": values, **place}


def saved(session):
    return base64.b64decode(session.apply({"do": "write", "what": "work"})["written"]["content"])


def finished(session: Session, until: str = ""):
    """Compute all that the view needs, as a page does, or what comes before a kind of work."""
    answer = session.apply({"do": "view"})
    while answer["view"]["pending"] not in (None, "", until):
        answer = session.apply({"do": "compute"})
        assert "error" not in answer
    return answer["view"]


def panel(view, part, key):
    return next(one for one in view[part]["panels"] if one["key"] == key)


def layer(drawn, look):
    return next(one for one in drawn["layers"] if one["look"] == look)


@pytest.fixture(scope="module")
def fitted():
    session = Session()
    session.add_record(step_record())
    return session, finished(session)


@pytest.fixture(scope="module")
def called():
    """What the same call of Python gives."""
    return cr.identify(step_record())


def test_the_curve_over_the_dead_time_is_the_profile_of_the_fit(fitted, called):
    _, view = fitted
    fit = called.fit
    curve = layer(panel(view, "model", "criterion"), "model")
    dead_time, misfit = fit.estimate.profile
    # in s, the unit of the panel
    np.testing.assert_allclose(curve["x"], dead_time, rtol=0, atol=1e-9)
    np.testing.assert_allclose(curve["y"], misfit, rtol=0, atol=1e-9)
    band = layer(panel(view, "model", "criterion"), "band")
    assert (band["low"], band["high"]) == pytest.approx(fit.interval, abs=1e-9)


@pytest.mark.parametrize("name", ["dead_time", "lag_1", "gain"])
def test_a_dragged_model_is_the_closed_form_with_that_value(fitted, called, name):
    session, _ = fitted
    fit = called.fit
    values = {one.name: one.value for one in fit.parameters}
    moved = {name: 1.3 * values[name]}
    drag = session.apply({"do": "drag", "values": moved})["drag"]
    now = values | moved
    line = drag["lines"]["response"]
    since = np.maximum(np.array(line["x"]) - 3 - now["dead_time"], 0)
    base = fit.fitted[0]
    expected = base + 10 * now["gain"] * -np.expm1(-since / now["lag_1"])
    # seven digits are drawn; the hold makes no difference for a step at a sample
    np.testing.assert_allclose(line["y"], expected, rtol=0, atol=2e-5)
    assert drag["misfit"]["residual"] > 1.1 * drag["misfit"]["best"]


def test_a_dragged_model_of_any_input_is_its_simulation():
    """Several records, one after the other: what is unknown of the past is left out of each."""
    time, rng = 0.1 * np.arange(500), np.random.default_rng(3)
    plant = cr.design.ProcessModel(gain=2.0, lag=1.5, dead_time=0.8).system(0.1)
    session, records = Session(), []
    for _ in range(2):
        signal = 40 + 5 * np.sign(rng.standard_normal(50)).repeat(10)
        output = plant.simulate(signal - 40) + 0.1 * rng.standard_normal(500)
        records.append(cr.Record(time, signal, output))
        session.add_record(records[-1])
    session.apply(put("model", structure=[1, 1]))
    view = finished(session, "tuning")
    values = {one["name"]: one["value"] for one in view["model"]["parameters"]}
    drag = session.apply({"do": "drag", "values": {"gain": 1.5 * values["gain"]}})["drag"]
    at, output = (np.array(drag["lines"]["response"][key]) for key in "xy")
    before = layer(panel(view, "model", "response"), "model")
    moved = output - np.interp(at, before["x"], before["y"])
    alone = plant.simulate(records[0].input - records[0].input[0])
    there = at < 49
    expected = 0.5 * np.interp(at[there], time, alone)
    # of the parameters, which the fit finds to 1 %; the move is as large as 10
    np.testing.assert_allclose(moved[there], expected, atol=0.3)


def test_a_drag_says_whether_the_record_allows_the_dead_time(fitted, called):
    session, _ = fitted
    low, high = called.fit.interval
    for value, allowed in ((0.9 * low, False), ((low + high) / 2, True), (1.1 * high, False)):
        drag = session.apply({"do": "drag", "values": {"dead_time": value}})["drag"]
        assert drag["misfit"]["allowed"] is allowed
        assert ("outside of what the record allows" in drag["misfit"]["text"]) is not allowed


def test_a_known_parameter_is_that_of_the_fit_and_can_be_freed():
    session = Session()
    session.add_record(step_record())
    session.apply(put("model", structure=[1, 1]))
    finished(session, "tuning")
    session.apply(put("model", known={"dead_time": 1.3}))
    view = finished(session, "tuning")
    known = cr.identification.ProcessStructure("P1D", fixed={"dead_time": 1.3})
    expected = cr.identify(step_record(), structures=known).fit
    shown = {one["name"]: one for one in view["model"]["parameters"]}
    assert shown["dead_time"]["value"] == 1.3
    assert shown["dead_time"]["known"]
    assert shown["lag_1"]["value"] == expected.parameters[2].value
    assert view["model"]["misfit"]["residual"] > view["model"]["misfit"]["best"]
    session.apply(put("model", known={}))
    assert session.state["model"]["known"] == {}


COMMANDS = [
    opened("log.csv", messy_csv()),
    put("model", structure=[1, 1]),
    {"do": "compute"},
    {"do": "drag", "values": {"dead_time": 50.0}},
    put("model", known={"lag_1": 81.0}),
    {"do": "compute"},
    put("loop", rule="lambda", limits=[-5, 5]),
    {"do": "compute"},
    {"do": "compute"},
    {"do": "slide", "speed": 0.8},
    put("record", 0, struck=[[700.0, 740.0]]),
    put("record", 0, range=[20.0, 1000.0]),
    {"do": "undo"},
    {"do": "undo"},
    {"do": "redo"},
    {"do": "undo"},
    {"do": "nonsense"},
    put("model", known={"lag_7": 1.0}),
    {"do": "write", "what": "script"},
    {"do": "write", "what": "st"},
    {"do": "write", "what": "work"},
]  # fmt: skip


def test_the_same_commands_give_the_same_json():
    first, second = (
        [json.dumps(session.apply(one)) for one in COMMANDS] for session in (Session(), Session())
    )
    assert first == second
    assert [k for k, one in enumerate(first) if '"error"' in one[:40]] == [16, 17]


def test_the_lines_of_python_give_the_same_numbers(tmp_path, capsys):
    path = tmp_path / "log.csv"
    path.write_bytes(messy_csv())
    session = Session()
    session.add_file(path)
    for command in (
        put("record", 0, units={"output": "K"}),
        put("record", 0, struck=[[700.0, 740.0]]),
        put("record", 0, shift=6.0),
        put("record", 0, range=[20.0, 1000.0]),
        put("record", 0, rest=[20.0, 50.0, 120.0]),
        put("model", structure=[1, 1]),
    ):
        assert "error" not in session.apply(command)
    finished(session, "tuning")
    session.apply(put("model", known={"gain": 0.61}))
    session.apply(put("loop", speed=0.7, form="siemens_pid_compact"))
    view = finished(session)
    names: dict = {}
    with pytest.warns(cr.errors.DataWarning, match="3 samples have missing values"):
        exec(view["script"], names)
    fit = names["system"].fit
    assert (names["record"].reference == 55).all()
    assert names["record"].input_units + names["record"].output_units == ("%", "K")
    shown = {one["name"]: one["value"] for one in view["model"]["parameters"]}
    assert {one.name: one.value for one in fit.parameters} == shown
    form = names["pid"].as_form("siemens_pid_compact")
    assert [list(row) for row in form._rows()] == [list(r) for r in view["loop"]["numbers"]["rows"]]
    assert form.title in capsys.readouterr().out


def test_a_set_point_is_kept_and_drawn():
    bare = step_record()
    wanted = np.where(bare.time < 3, np.nan, 56.0)
    session = Session()
    session.add_record(bare.__replace__(reference=wanted))
    panel = session.apply(put("record", 0, range=[1.0, 29.0]))["view"]["data"]["panels"][0]
    drawn = next(one for one in panel["layers"] if one["name"] == "set point")
    assert drawn["y"] == [None if np.isnan(one) else one for one in wanted]


def test_saved_work_opens_as_it_was():
    session = Session()
    session.add_record(step_record())
    session.apply(put("record", 0, range=[1.0, 25.0]))
    session.apply(put("model", structure=[1, 1]))
    view, work = finished(session), saved(session)
    other = Session()
    assert "error" not in other.apply(opened("work.json", work))
    again = finished(other)
    for part in ("state", "data", "model", "loop", "script"):
        assert json.dumps(again[part]) == json.dumps(view[part])


@pytest.mark.parametrize(
    ("change", "said"),
    [
        (lambda text: text[: len(text) // 2], "truncated"),
        (lambda text: text.replace('"used": true', '"used": false'), "checksum"),
        (lambda text: text.replace('"schema": 1', '"schema": 7'), "schema 7"),
    ],
)
def test_saved_work_that_was_damaged_is_refused(change, said):
    session = Session()
    session.add_record(step_record())
    work = change(saved(session).decode()).encode()
    answer = Session().apply(opened("work.json", work))
    assert said in answer["error"]
    assert answer["view"]["state"]["records"] == []


def test_a_file_that_cannot_be_read_is_a_sentence_and_changes_nothing(fitted):
    session, _ = fitted
    before = json.dumps(session.state)
    answer = session.apply(opened("picture.csv", b"\x89PNG\r\n\x1a\n" + bytes(range(256))))
    assert answer["error"].startswith("picture.csv")
    assert json.dumps(session.state) == before


def test_columns_that_are_not_told_by_their_names_are_asked_for():
    rows = "\n".join(f"{k},{k % 7},{int(k > 30)},{k * 0.1}" for k in range(100))
    session = Session()
    answer = session.apply(opened("plain.csv", f"one,two,three,four\n{rows}".encode()))
    listed = answer["view"]["data"]
    assert listed["records"][0]["bad"]
    assert "time" in listed["records"][0]["notes"][0]
    assert [one["name"] for one in listed["preview"]["columns"]] == ["one", "two", "three", "four"]
    chosen = {"time": 0, "input": 2, "output": 3}
    answer = session.apply(put("record", 0, options=chosen))
    assert answer["view"]["data"]["preview"]["taken"] == chosen
    assert not answer["view"]["data"]["records"][0]["bad"]


def test_what_was_guessed_is_told_on_the_page_and_nowhere_else(recwarn):
    lines = ["time,heater,room"] + [
        f"{k},{int(k > 5)},{20 + 0.1 * max(k - 7, 0)}" for k in range(40)
    ]
    view = Session().apply(opened("log.csv", "\n".join(lines).encode()))["view"]
    assert "'heater' is taken as input" in json.dumps(view["data"])
    assert list(recwarn) == []


def test_undo_takes_back_one_change_after_the_other():
    session = Session()
    session.add_record(step_record())
    states = [json.dumps(session.state)]
    for command in (
        put("record", 0, struck=[[5.0, 6.0]]),
        put("record", 0, range=[2.0, 20.0]),
        put("loop", kind="PID", rule="amigo"),
    ):
        session.apply(command)
        states.append(json.dumps(session.state))
    for expected in states[-2::-1]:
        session.apply({"do": "undo"})
        assert json.dumps(session.state) == expected
    for expected in states[1:]:
        session.apply({"do": "redo"})
        assert json.dumps(session.state) == expected


def test_records_are_layers_and_fitted_together():
    session = Session()
    session.add_record(step_record(seed=1))
    session.add_record(step_record(seed=2))
    session.apply(put("model", structure=[1, 1]))
    view = finished(session, "tuning")
    drawn = panel(view, "data", "record-output")
    assert sum(one["look"] == "plausible" for one in drawn["layers"]) == 1
    both = cr.identify([step_record(seed=1), step_record(seed=2)], structures=[(1, 1)]).fit
    shown = {one["name"]: one["value"] for one in view["model"]["parameters"]}
    assert shown["dead_time"] == both.dead_time
    session.apply(put("record", 0, used=False))
    alone = cr.identify(step_record(seed=2), structures=[(1, 1)]).fit
    view = finished(session, "tuning")
    assert {one["name"]: one["value"] for one in view["model"]["parameters"]}[
        "dead_time"
    ] == alone.dead_time


def test_margins_on_plausible_plants_are_those_of_the_check():
    record = step_record(noise=0.3)
    session = Session()
    session.add_record(record)
    session.apply(put("model", structure=[1, 1]))
    session.apply(put("loop", speed=0.9))
    view = finished(session)
    system = cr.identify(record, structures=[(1, 1)])
    options = view["script"].rpartition("closed_loop_time=")[2].partition(")")[0]
    with pytest.warns(cr.CtrlRealizeWarning):
        check = cr.design.pid(system, closed_loop_time=float(options)).check
    shown = dict(map(tuple, view["loop"]["margins"]))
    assert float(shown["Ms"]) == pytest.approx(check.margins.ms, rel=5e-3)  # three digits
    worst = float(shown["Ms on plausible plants"].removeprefix("at most "))
    assert worst == pytest.approx(check.worst.ms, rel=5e-3)
    assert view["loop"]["warnings"]


def test_plants_that_a_quick_loop_makes_unstable_are_drawn_apart():
    record = step_record(count=120, dt=0.2, noise=1.5, seed=4)
    session = Session()
    session.add_record(record)
    session.apply(put("model", structure=[1, 1]))
    session.apply(put("loop", speed=1.0))
    view = finished(session)
    unstable = dict(map(tuple, view["loop"]["margins"]))["unstable plants"]
    count = int(unstable.partition(" ")[0])
    assert 0 < count < 39
    drawn = panel(view, "loop", "output-set-point")
    assert len(layer(drawn, "bad")["many"]) == count
    band = layer(drawn, "band")
    assert max(band["high"]) < max(map(max, layer(drawn, "bad")["many"]))


def test_noise_at_the_actuator_is_that_of_a_simulated_loop(fitted, called):
    _, view = fitted
    pid = cr.design.pid(called)
    loop = cr.design.simulate_loop(
        called, pid, 40_000, setpoint_step=0.0, noise_std=called.fit.noise_model.std
    )
    told = float(view["loop"]["noise"].partition(" by ")[2].partition(" ")[0])
    # of 40 000 samples, of which many follow one another, the std is known to 2 %
    assert told == pytest.approx(np.std(loop.output[2000:]), rel=0.03)


def test_a_loop_that_is_slow_beside_its_samples_is_drawn_as_it_is():
    record = step_record(count=6000, dt=0.005)
    session = Session()
    session.add_record(record)
    session.apply(put("model", structure=[1, 1]))
    drawn = layer(panel(finished(session), "loop", "measured-set-point"), "model")
    system = cr.identify(record, structures=[(1, 1)])
    pid = cr.design.pid(system)
    loop = cr.design.simulate_loop(system, pid, 4000)
    assert drawn["x"][1] > 5 * record.dt
    there = np.interp(drawn["x"], loop.time, loop.measured)
    # the hold of the coarser samples is half a sample more dead time
    np.testing.assert_allclose(drawn["y"][:300], there[:300], atol=0.03)


def test_limits_of_the_output_are_kept(fitted):
    session = Session()
    session.add_record(step_record())
    session.apply(put("model", structure=[1, 1]))
    session.apply(put("loop", limits=[-0.5, 1.9]))
    view = finished(session)
    for key in ("output-set-point", "output-load"):
        drawn = layer(panel(view, "loop", key), "model")["y"]
        assert -0.5 <= min(drawn) <= max(drawn) <= 1.9


def test_a_planned_test_shows_the_interval_that_it_will_give(fitted):
    session = Session()
    record = step_record(count=150, dt=0.2, noise=0.2)
    session.add_record(record)
    session.apply(put("model", structure=[1, 1]))
    session.apply(put("plan", want="dead_time", time=15.0))
    view = finished(session)
    system = cr.identify(record, structures=[(1, 1)])
    plan = cr.experiment.plan(system, want="dead_time", time=15.0)
    half = (view["plan"]["interval"]["high"] - view["plan"]["interval"]["low"]) / 2
    assert half == pytest.approx(1.96 * plan.chosen.together, rel=1e-3)  # 1.95996 deviations
    written = session.apply({"do": "write", "what": "plan"})["written"]
    assert base64.b64decode(written["content"]).startswith(b"time_s,command")


def test_a_measured_response_is_drawn_beside_the_model():
    frequency = np.geomspace(0.01, 1, 30)
    s = 2j * np.pi * frequency
    response = 0.6 * np.exp(-1.2 * s) / (2 * s + 1)
    columns = np.stack([frequency, np.abs(response), np.degrees(np.angle(response))], axis=1)
    rows = [",".join(map(str, row)) for row in columns.tolist()]
    text = "frequency_hz,magnitude,phase_deg\n" + "\n".join(rows)
    other = Session()
    other.add_record(step_record())
    other.apply(put("model", structure=[1, 1]))
    assert "error" not in other.apply(opened("sweep.csv", text.encode()))
    assert finished(other, "tuning")["data"]["frf"] == "sweep.csv"
    figures = {one["key"]: one["svg"] for one in other.apply({"do": "figures"})["figures"]}
    assert set(figures) == {"residuals", "plausible", "frf"}
    assert all("<svg" in one for one in figures.values())


@pytest.mark.parametrize(
    ("what", "text"),
    [
        ("report", b"<!DOCTYPE html>"), ("model", b'"ctrl_realize model"'), ("c", b"_step("),
        ("st", b"FUNCTION_BLOCK"), ("python", b"class "), ("matlab", b"pid2("),
    ],
)  # fmt: skip
def test_what_is_written_is_what_its_name_says(fitted, what, text):
    written = fitted[0].apply({"do": "write", "what": what})["written"]
    assert text in base64.b64decode(written["content"])


@pytest.mark.parametrize(
    ("command", "said"),
    [
        ({"do": "drag"}, "values is a NoneType; expected the parameters"),
        ({"do": "slide", "speed": "quick"}, "speed='quick'"),
        ({"do": "slide", "speed": None}, "speed=None"), ({"do": "set"}, "set: .* is incomplete"),
        ({"do": "select"}, "index=None; expected a whole number in 0...0"),
        ({"do": "remove", "index": -1}, "index=-1; expected a whole number in 0...0"),
        ({"do": "open", "name": "x.csv", "content": "%"}, "x.csv"),
        ({"do": "open", "name": "x.csv", "content": 5}, "base64"),
        ({"do": "open", "name": "x.csv", "content": None}, "x.csv"),
        ({"do": "write", "what": "everything"}, "everything"),
        ({"do": "dance"}, "choose one of .*'undo'"), ([1], "do='None'"), (None, "do='None'"),
        (put("loop", rule="best"), "rule='best'"), (put("loop", limits=[3, 1]), r"limits=\(3, 1\)"),
        (put("model", structure=[0]), r"structure=\[0\]; expected two numbers"),
        (put("model", structure="FOPDT"), "structure='FOPDT'; expected two numbers"),
        (put("record", 5, used=True), "index=5"),
        (put("record", 0, options={"path": "/etc/passwd"}), "options has path"),
    ],
)  # fmt: skip
def test_a_command_that_makes_no_sense_is_a_sentence_and_changes_nothing(fitted, command, said):
    session, _ = fitted
    before = json.dumps(session.state)
    assert re.search(said, session.apply(command)["error"])
    assert json.dumps(session.state) == before


@pytest.mark.parametrize("first", [-5.0, 0.0])
def test_the_time_of_a_step_has_a_handle_also_where_time_counts_from_it(first):
    k = np.arange(400)
    noise = 0.01 * np.random.default_rng(0).standard_normal(400)
    own = Session()
    own.add_record(cr.Record(first + 0.1 * k, np.where(k < 50, 20.0, 30.0), (k >= 57) + noise))
    driven = own.apply({"do": "view"})["view"]["data"]["panels"][1]
    assert [one["name"] for one in driven["handles"]] == ["step"]
