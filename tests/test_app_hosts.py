"""The two hosts of the app: a server on this machine, and a widget."""

import http.client
import json
import signal
import subprocess
import sys
import threading
import time
from contextlib import closing

import pytest

import ctrl_realize as cr
from ctrl_realize.interactive.hosting import Host
from ctrl_realize.interactive.server import AppServer
from ctrl_realize.interactive.session import Session
from tests.app_records import messy_csv, step_record
from tests.rigs import interruptible


@pytest.fixture(scope="module")
def server():
    with closing(Host(Session())) as host, AppServer(host) as running:
        thread = threading.Thread(target=running.serve_forever)
        thread.start()
        yield running
        running.shutdown()
        thread.join()


def ask(server, place="", method="GET", body=None, token=None, **headers):
    """Status, headers and text of an answer."""
    port = server.server_address[1]
    connection = http.client.HTTPConnection("127.0.0.1", port, timeout=60)
    named = {key.replace("_", "-"): value for key, value in headers.items()}
    connection.putrequest(method, f"/{token or server.token}/{place}", skip_host="Host" in named)
    content = None if body is None else json.dumps(body).encode()
    if content is not None:
        named = {"Content-Type": "application/json", **named, "Content-Length": str(len(content))}
    for name, value in named.items():
        connection.putheader(name, value)
    connection.endheaders(content)
    answer = connection.getresponse()
    text = answer.read().decode()
    connection.close()
    return answer.status, dict(answer.getheaders()), text


def test_the_page_and_its_parts_are_sent_with_a_policy_that_allows_nothing_from_outside(server):
    for place, kind in (
        ("", "text/html"), ("app.js", "text/javascript"), ("page.js", "text/javascript"),
        ("app.css", "text/css"),
    ):  # fmt: skip
        status, headers, text = ask(server, place)
        assert status == 200
        assert headers["Content-Type"].startswith(kind)
        policy = dict(
            part.strip().split(" ", 1) for part in headers["Content-Security-Policy"].split(";")
        )
        assert policy["default-src"] == "'none'"
        assert policy["script-src"] == policy["connect-src"] == "'self'"
        assert headers["Referrer-Policy"] == "no-referrer"  # the address holds the token
        assert "http://" not in text.replace("http://www.w3.org", "")
        assert "https://" not in text


@pytest.mark.parametrize(
    ("change", "reason"),
    [
        ({"token": "x" * 32}, "a wrong token"),
        ({"token": "ü"}, "a wrong token"),
        ({"Host": "evil.example"}, "another host name"),
        ({"Host": "127.0.0.1"}, "another host name"),
        ({"Origin": "https://evil.example"}, "another origin"),
        ({"Origin": "null"}, "another origin"),
        ({"Sec_Fetch_Site": "cross-site"}, "another site"),
        ({"Content_Type": "text/plain"}, "not JSON"),
    ],
)
def test_a_command_from_elsewhere_is_refused(server, change, reason):
    if change.get("token") == "ü":
        change = {"token": "%C3%BC"}
    status, _, text = ask(server, "command", "POST", {"do": "view"}, **change)
    assert (status, text) == (403, f"refused: {reason}")


def test_a_command_from_the_page_is_answered(server):
    port = server.server_address[1]
    origin = f"http://127.0.0.1:{port}"
    status, _, text = ask(server, "command", "POST", {"do": "view", "id": "7"}, Origin=origin,
                          Sec_Fetch_Site="same-origin")  # fmt: skip
    answer = json.loads(text)
    assert (status, answer["id"], answer["view"]["pending"]) == (200, "7", "")


@pytest.mark.parametrize("body", [["view"], "view", 7])
def test_what_is_no_command_is_refused(server, body):
    assert ask(server, "command", "POST", body)[0] == 400
    assert ask(server, "elsewhere", "POST", {"do": "view"})[0] == 404
    assert ask(server, "../server.py")[0] == 404


def test_long_work_is_cancelled_and_can_be_done_later():
    session = Session()
    session.add_record(step_record())
    with closing(Host(session)) as host:
        before = json.dumps(session.state)
        answers = []
        work = threading.Thread(target=lambda: answers.append(host.answer({"do": "compute"})))
        work.start()
        while not answers and work.is_alive():
            host.answer({"do": "cancel"})
            time.sleep(0.05)
        work.join()
        assert answers[0]["cancelled"]
        assert answers[0]["error"].startswith("cancelled")
        assert json.dumps(session.state) == before
        host.answer({"do": "cancel"})  # nothing is being done
        view = host.answer({"do": "compute"})["view"]
        assert view["model"]["parameters"][1]["value"] == cr.identify(step_record()).fit.dead_time


def test_the_command_says_its_address_and_ends_when_it_is_interrupted(tmp_path):
    file, wrong = tmp_path / "log.csv", tmp_path / "wrong.csv"
    file.write_bytes(messy_csv())
    wrong.write_bytes(b"\x00\x01")
    words = [sys.executable, "-m", "ctrl_realize", "app", str(file), str(wrong), "--no-browser"]
    with interruptible():
        running = subprocess.Popen(words, stdout=subprocess.PIPE, text=True)
    with running:
        assert "wrong.csv" in running.stdout.readline()
        address = running.stdout.readline().partition("http://")[2].strip()
        place, _, path = address.partition("/")
        connection = http.client.HTTPConnection(place, timeout=60)
        connection.request(
            "POST", f"/{path}command", '{"do": "view"}', {"Content-Type": "application/json"}
        )
        answer = json.loads(connection.getresponse().read())
        connection.close()
        assert [one["name"] for one in answer["view"]["data"]["records"]] == ["log.csv"]
        running.send_signal(signal.SIGINT)
        assert running.wait(timeout=60) == 0


def test_a_widget_answers_what_is_set_by_a_page():
    pytest.importorskip("anywidget")
    widget = cr.app(step_record())
    try:
        widget.set_state({"command": {"do": "view", "id": "a"}})
        answer = widget.get_state()["answer"]
        assert (answer["id"], answer["view"]["data"]["records"][0]["name"]) == ("a", "heater")
        widget.set_state({"command": {"do": "compute", "id": "b"}})
        until = time.monotonic() + 60
        while widget.answer["id"] != "b" and time.monotonic() < until:
            time.sleep(0.02)
        assert widget.answer["view"]["model"]["parameters"][1]["name"] == "dead_time"
        assert "--measured" in widget.get_state()["style"]
    finally:
        widget.close()
