"""Reports: what they say first, what they must not leave out, and that they stay whole."""

import base64
import hashlib
import re
from html.parser import HTMLParser

import control as ct
import numpy as np
import pytest

import ctrl_realize as cr
from ctrl_realize import report
from ctrl_realize._wording import interval_in_time
from ctrl_realize.report.controller import controller_of
from ctrl_realize.report.provenance import record_sha256
from ctrl_realize.report.verdict import comparison_verdict, verdict_of

HOSTILE = '"><script>alert(1)</script><img src=x onerror=alert(2)>$\\frac{'


class Tags(HTMLParser):
    """Collects start tags, and checks that tags nest."""

    VOID = frozenset({"meta", "link", "img", "br"})

    def __init__(self) -> None:
        super().__init__()
        self.seen: list[tuple[str, dict[str, str | None]]] = []
        self.open: list[str] = []
        self.text = ""

    def handle_starttag(self, tag, attrs):
        self.seen.append((tag, dict(attrs)))
        if tag not in self.VOID:
            self.open.append(tag)

    def handle_startendtag(self, tag, attrs):
        self.seen.append((tag, dict(attrs)))

    def handle_endtag(self, tag):
        assert self.open, tag
        assert self.open.pop() == tag

    def handle_data(self, data):
        self.text += data


def parsed(path):
    tags = Tags()
    tags.feed(path.read_text(encoding="utf-8"))
    assert tags.open == []
    return tags


@pytest.fixture(scope="module")
def record(valve):
    return valve.step_record(16.0, rng=5)


@pytest.fixture(scope="module")
def fitted(record):
    return cr.fit_output_error(record, structures=[(3, 3)])


@pytest.fixture(scope="module")
def measured(valve):
    frequency = np.geomspace(0.1, 20.0, 40)
    return cr.MeasuredFRF(valve.truth.frf(frequency).frdata[0, 0], frequency, coherence=np.ones(40))


@pytest.fixture(scope="module")
def page(tmp_path_factory, record, fitted, measured):
    folder = tmp_path_factory.mktemp("page")
    path = folder / "report.html"
    data = folder / "data.csv"
    data.write_text("time,u,y\n", encoding="utf-8")
    return report.write_identification(
        path,
        fitted,
        record,
        files=[data],
        frf=measured,
        comparison=cr.compare_frf(fitted, measured),
        settings={"method": "output_error"},
        calls=[("In Python", "sys = cr.identify(record)")],
        simulated=True,
    )


def test_a_report_needs_no_network_and_has_only_its_own_script(page):
    text = page.read_text(encoding="utf-8")
    tags = parsed(page)
    assert {tag for tag, _ in tags.seen}.isdisjoint({"iframe", "object", "img"})
    (script,) = re.findall(r"<script>(.*?)</script>", text, flags=re.DOTALL)
    assert text.count("<script") == 1
    digest = base64.b64encode(hashlib.sha256(script.encode()).digest()).decode()
    assert f"default-src 'none'; style-src 'unsafe-inline'; script-src 'sha256-{digest}'" in text
    links = [
        value
        for _, attributes in tags.seen
        for name, value in attributes.items()
        if name in ("src", "href", "xlink:href", "action", "srcset")
    ]
    assert links
    assert all(link.startswith(("#", "data:")) for link in links)
    assert "http://" not in text
    assert "https://" not in text
    assert "@import" not in text


def test_the_verdict_comes_first_with_dead_time_and_interval(page, fitted):
    text = parsed(page).text
    verdict = text.index(f"Dead time {1e3 * fitted.fit.dead_time:.4g} ms")
    assert verdict < text.index("Figures") < text.index("Details of the fit")
    low, high = fitted.fit.interval
    assert interval_in_time(low, high) in text
    assert text.index("simulated data") < verdict


def test_the_transfer_function_stands_in_place_of_the_matrices(page, fitted):
    text = parsed(page).text
    assert text.count(fitted.fit.formula) == 1
    assert text.index(fitted.fit.formula) < text.index("Parameters") < text.index("Figures")
    html = page.read_text(encoding="utf-8")
    fold = html.index("<summary>State-space matrices")
    assert html.rindex("<details>", 0, fold) < fold < html.index("</details>", fold)
    # said once beside the figures, once among the parameters, and by the verdict
    low, high = fitted.fit.interval
    outside = re.sub(r"<svg.*?</svg>", "", html, flags=re.DOTALL)
    assert outside.count(interval_in_time(low, high)) == 3


def test_the_parameters_of_an_actuator_stand_in_the_table_of_parameters(tmp_path):
    command = 10.0 + 8.0 * (np.arange(400) > 80)
    slow = cr.actuators.SlewRateLimit(16.0).simulate(command, 0.01)
    smooth = np.concatenate([np.zeros(9), np.cumsum(0.1 * 0.9 ** np.arange(391))])
    output = np.convolve(np.diff(slow, prepend=10.0), smooth)[:400]
    noise = 0.005 * np.random.default_rng(1).standard_normal(400)
    record = cr.Record(0.01 * np.arange(400), command, output + noise, units={"u": "%"})
    fitted = cr.fit_output_error(record, structures=[(1, 1)], actuator="slew_rate")
    rate = fitted.fit.actuator["slew_rate"]
    text = parsed(report.write_identification(tmp_path / "page.html", fitted, record)).text
    assert text.count(rate.interval_text()) == 1
    where = text.index(f"{rate.label} (actuator, before the lags)")
    assert text.index("Parameters") < where < text.index(rate.interval_text())
    assert "%/s" in text[where:][:80]
    assert text.count("the linear part, without the actuator") == 1
    assert where < text.index("Figures") < text.index("Details of the fit")


def test_several_records_stand_each_beside_the_model_with_the_scatter_of_their_gains(
    tmp_path, valve, measured
):
    records = [valve.step_record(16.0, rng=seed, name=f"run {seed}") for seed in range(3)]
    system = cr.fit_output_error(records, structures=[(2, 2)])
    away = cr.MeasuredFRF(
        1.5 * measured.frdata[0, 0], measured.omega / 2 / np.pi, coherence=np.ones(40)
    )
    comparison = cr.compare_frf(system, away)
    path = report.write_identification(
        tmp_path / "r.html", system, records[0], frf=away, comparison=comparison
    )
    text = parsed(path).text
    assert "Each record beside the model" in text
    facts = dict(verdict_of(system, comparison=comparison).facts)
    away_by = 100 * comparison.rms_relative_error
    assert 30 < away_by < 40  # the response was made larger by half
    assert facts["from the measured response"] == f"{away_by:.3g} % rms, 0.1 to 20 Hz"
    assert "(std 0.0" in facts["gains of the records"]
    assert all(value in text for value in facts.values())
    assert verdict_of(system, comparison=comparison).level == "poor"


@pytest.mark.parametrize(("every", "moving"), [(1, 0.0), (10, 0.0), (1, 1.0)])
def test_the_start_is_drawn_where_all_samples_are_of_one_response(tmp_path, every, moving):
    t = np.arange(400.0)
    noise = 0.01 * np.random.default_rng(3).standard_normal(400)
    y = np.where(t > 72, -2 * np.expm1(-np.clip(t - 72, 0, None) / 20), 0.0) + noise
    y += moving * np.exp(-t / 20)
    record = cr.Record(t, np.where(t < 60, 0.0, 1.0), y[(np.arange(400) // every) * every])
    model = cr.identify(record, structures=["FOPDT"])
    page = report.write_identification(tmp_path / "report.html", model, record)
    drawn = "Start of the response" in page.read_text(encoding="utf-8")
    assert drawn == (every == 1 and not moving)


def test_hostile_names_stay_text(tmp_path, record, fitted):
    hostile = cr.Record(
        record.time, record.input, record.output, name=HOSTILE, input_labels=[HOSTILE],
        output_labels=[HOSTILE + "y"],
    )  # fmt: skip
    path = report.write_identification(
        tmp_path / "r.html",
        fitted,
        hostile,
        settings={HOSTILE: HOSTILE},
        calls=[(HOSTILE, HOSTILE)],
    )
    tags = parsed(path)
    assert [tag for tag, _ in tags.seen].count("script") == 1  # the page's own
    assert "img" not in {tag for tag, _ in tags.seen}
    assert not any(name.startswith("on") for _, attributes in tags.seen for name in attributes)
    assert "<script>alert(1)</script>" in tags.text  # said, not done


@pytest.mark.usefixtures("without_figures")
def test_a_report_that_fails_leaves_the_old_one(tmp_path, record, fitted, monkeypatch):
    path = tmp_path / "r.html"
    path.write_text("old", encoding="utf-8")
    monkeypatch.setattr("ctrl_realize.report.build.versions", lambda: 1 / 0)
    with pytest.raises(ZeroDivisionError):
        report.write_identification(path, fitted, record)
    assert path.read_text(encoding="utf-8") == "old"
    assert list(tmp_path.iterdir()) == [path]


def test_a_campaign_report_lists_every_record_and_names_the_failed(tmp_path, valve):
    flat = valve.record(np.full(2000, 8.0), rng=1, name="flat")
    records = [valve.step_record(16.0, rng=k, name=f"step {k}") for k in range(3)] + [flat]
    campaign = cr.identify_campaign(records, method="scan", order=3, max_delay=80, progress=False)
    assert len(campaign.failed) == 1
    path = report.write_campaign(
        tmp_path / "r.html", campaign, records=records, truth=37, simulated=True
    )
    tags = parsed(path)
    for record in records:
        assert record.name in tags.text
        assert record_sha256(record) in tags.text
    assert campaign.failed[0].error in tags.text
    assert sum(a.get("class") == "failed" for tag, a in tags.seen if tag == "tr") == 1
    assert f"{campaign.statistics().mean:.2f} samples" in tags.text


def test_a_comparison_report_judges_by_the_error_in_the_band(tmp_path, fitted, measured):
    good = cr.compare_frf(fitted, measured)
    off = cr.compare_frf(fitted * 1.5, measured)
    assert off.rms_relative_error > 0.3
    assert comparison_verdict(fitted, off).level == "poor"
    assert comparison_verdict(fitted, good).level != "poor"
    path = report.write_comparison(tmp_path / "r.html", fitted, measured, off)
    assert "disagree" in parsed(path).text


def test_the_part_of_a_controller_lists_the_models_on_which_its_loop_is_unstable():
    truth = cr.design.ProcessModel(gain=1.0, lag=20.0, second_lag=4.0, dead_time=3.0).system(1.0)
    time = np.arange(160.0)
    u = np.where(time < 20, 0.0, 1.0)
    noise = 0.1 * np.random.default_rng(3).standard_normal(time.size)
    system = cr.identify(cr.Record(time, u, truth.simulate(u) + noise))
    with pytest.warns(cr.errors.ModelWarning, match="unstable"):
        pid = cr.design.pid(system, "cohen_coon", "PID")
    unstable = [one for one in pid.check.corners if np.isinf(one.ms)]
    part = controller_of(system, pid)
    assert part.level == "poor"
    assert unstable
    assert any(f"one of {len(unstable)} of 38 models" in reason for reason in part.unsafe)
    assert "gain kp" in dict(part.facts)
    assert part.figure.svg.count("<path") > 10
    tuning = next(one for one in system.fit.verdicts if one.question == "tuning")
    assert tuning.level != "good"
    # robust on all models that are drawn, and still not what the fit can promise
    safe = controller_of(system, cr.design.pid(system, closed_loop_time="robust"))
    assert safe.level == "caution"


@pytest.mark.parametrize(("ends", "said"), [([1], "gain 1, 2"), ([1, 0], "integrating")])
def test_a_model_of_two_inputs_has_its_gains_in_the_verdict(ends, said):
    """Two valves of a tank had no report: python-control has no zeros of two inputs, one output."""
    one, other = (
        cr.delayed_ss(ct.tf([gain], np.polymul([lag, 1], ends)), 2, dt=1.0)
        for gain, lag in ((1, 5), (2, 3))
    )
    system = np.ones((1, 2)) * one.append(other)
    assert said in verdict_of(system).headline
