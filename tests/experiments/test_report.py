"""The report with a reduced scope: complete, self-contained, and never half-written, whatever interrupts it."""

import json
import re
import signal
import subprocess
import sys
import time
from functools import partial
from html.parser import HTMLParser
from urllib.parse import unquote
from xml.etree import ElementTree

import pytest

from steer_env import friction, manoeuvres, metrics
from steer_env.experiments import sweep
from steer_env.experiments.cli.main import main
from steer_env.experiments.pages import pages, traces, words
from steer_env.experiments.reports import report, report_findings
from steer_env.experiments.reports.report_results import Scope
from steer_env.experiments.studies import held_torque
from steer_env.experiments.studies.common import friction_cases
from steer_env.experiments.studies.common.assist_margins import assist_cells
from steer_env.recording import files
from steer_env.vehicle import cars
from tests.experiments.faked_times import NONE, faked
from tests.experiments.first_screen import sentence

pytestmark = pytest.mark.whole

LAWS = {law: friction.make(law) for law in ("lugre", "masing")}
TESTS = {"weave": {"cycles": 6}, "slow-ramp": {}, "step-steer": {}, "hold": {}}
SCOPE = Scope(tests=TESTS, widths=(0.0, 1.0, 2.0), steps=(1e-3, 1e-2), speeds_kph=(0.0,))
IN_TWO = partial(sweep.run, where=sweep.Where(2))
FIRST = ("first_terms", "narrow_terms", "first_weave", "first_loops")
FIGURES = (
    *("characteristics", "reversal", "real_time", "margins", "held_on", "held_off"),
    *("chassis", "parking", "loop_width"),
)


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    out = tmp_path_factory.mktemp("made") / "report"
    seen = []
    results = report.build(out, LAWS, SCOPE, lambda part, what: seen.append(part), sweep=IN_TWO)
    assert seen == sorted(seen)
    assert seen[-1] == 1.0
    return out, results


@pytest.fixture(scope="module")
def source(made):
    return report.provenance_of(made[1])


def without_pictures(results, source):
    """The text of the page."""
    with pytest.MonkeyPatch.context() as patched:
        patched.setattr(report, "_pictures", lambda _: dict.fromkeys(FIGURES, "<svg/>"))
        return report.page_of(results, source).html()


@pytest.fixture(scope="module")
def before(made, source):
    """The text of the page of what was made, as if every difference were sure."""
    return without_pictures(sure(made[1]), source)


class Page(HTMLParser):
    """Tags with their attributes, and the text."""

    def __init__(self, text):
        super().__init__()
        self.tags, self.open, self.words = [], [], []
        self.feed(text)

    def handle_starttag(self, tag, attrs):
        self.tags.append((tag, dict(attrs)))
        if tag not in {"meta", "img", "br"}:
            self.open.append(tag)

    def handle_endtag(self, tag):
        assert self.open.pop() == tag

    def handle_data(self, data):
        if self.open and self.open[-1] not in ("script", "style"):
            self.words.append(data)


def test_the_page_is_well_formed_and_needs_nothing_from_outside(made):
    text = (made[0] / "index.html").read_text(encoding="utf-8")
    page = Page(text)
    assert page.open == []
    images = [attrs["src"] for tag, attrs in page.tags if tag == "img"]
    assert len(images) == len(set(images)) == len(FIRST) + len(FIGURES) + len(TESTS)
    assert all(src.startswith("data:image/svg+xml,") for src in images)
    assert all(attrs["alt"] for tag, attrs in page.tags if tag == "img")
    assert not {"link", "iframe"} & {tag for tag, _ in page.tags}
    assert not [attrs for tag, attrs in page.tags if tag == "script" and "src" in attrs]
    ids = [attrs["id"] for _, attrs in page.tags if "id" in attrs]
    links = {attrs["href"] for tag, attrs in page.tags if tag == "a"}
    assert len(ids) == len(set(ids))
    assert links <= {f"#{name}" for name in ids}


def test_what_is_read_first(made):
    """Verdict, a picture, a table and what differs come before anything else; the glossary is the end."""
    text = (made[0] / "index.html").read_text(encoding="utf-8")
    headings = ("verdict", "differs", "ratings", "characteristics", "held", "feel", "real_time", "assist", "vehicle")
    places = [text.index(f'<section id="{name}">') for name in (*headings, "provenance", "glossary")]
    assert places == sorted(places)
    first = " ".join("".join(Page(text[places[0] : places[1]]).words).split())
    assert "a driver tells no law from lugre with one calibration, no law with each fitted." in first
    assert sentence(text).startswith("By the ")
    assert [text[places[0] : places[1]].count(tag) for tag in ("<img ", "<table")] == [4, 1]
    differs = Page(text[places[1] : places[2]])
    assert "Of " in "".join(differs.words)
    assert "Newberry, Griffin and Dowson" in "".join(differs.words)
    contents = text[text.index('<nav class="contents">') : text.index("</nav>")]
    assert contents.count("<a href=") == 11
    assert [tag for tag, _ in Page(text).tags].count("details") > 10


def test_both_terms_have_all_laws_and_their_numbers_are_those_of_the_json(made):
    """Counts of the first screen's table, from the differences that the JSON holds."""
    numbers = json.loads((made[0] / "metrics.json").read_text(encoding="utf-8"))
    terms = report_findings.terms(made[1])
    held, shown = (numbers["differences"], numbers["fitted"]["differences"]), []
    for term, of in zip(terms, held, strict=True):
        assert of["base"] == term.base == "lugre"
        assert list(of["laws"]) == list(term.laws) == ["masing"]
        rows = of["laws"]["masing"].values()
        assert term.laws["masing"].compared == len(rows)
        assert term.laws["masing"].large == sum(row["large"] for row in rows)
        assert len(term.laws["masing"].perceptible) == sum(row["perception"] == "perceptible" for row in rows)
        known = sum(row["perception"] != "no threshold known" for row in rows)
        shown += [(len(term.laws["masing"].perceptible), known), (term.laws["masing"].large, len(rows))]
    first = (made[0] / "index.html").read_text(encoding="utf-8").partition("</section>")[0]
    (row,) = re.findall("<tr><td>masing</td>(.*?)</tr>", first)
    assert re.findall(r"<td>(\d+) of (\d+)</td>", row) == [(str(part), str(of)) for part, of in shown]
    assert terms[1].laws["masing"].large > terms[0].laws["masing"].large
    assert numbers["fitted"]["laws"]["lugre"]["undetermined"] == ["sigma_1", "sigma_2", "F_s", "v_s"]
    fitted = made[1].fitted.laws["lugre"]
    assert (fitted.sigma_1, fitted.sigma_2, fitted.F_s) == (0.0, 0.0, fitted.F_c)
    level, speed = words.number(fitted.F_c), words.number(fitted.v_s)
    assert f"lugre sigma_1 = 0, sigma_2 = 0, F_s = {level}, v_s = {speed}" in first


def on_terms(made):
    """Numbers of the JSON, laws and largest difference of each term, with the table's words for it."""
    numbers = json.loads((made[0] / "metrics.json").read_text(encoding="utf-8"))
    first = (made[0] / "index.html").read_text(encoding="utf-8").partition("</section>")[0]
    said = re.findall(r'<td class="text">([^<]*), ([^<,]*)</td>', first)
    held = (numbers["differences"], numbers["fitted"]["differences"])
    laws = (made[1].laws, made[1].fitted.laws)
    yield from zip(report_findings.terms(made[1]), held, laws, said, strict=True)


def key_of(row):
    return row.metric if row.test == "weave" else f"{row.test.replace('-', '_')}.{row.metric}"


def test_the_sentence_and_the_largest_differences_are_those_of_the_json(made):
    counts = []
    for term, held, _, (said, test) in on_terms(made):
        rows = held["laws"]["masing"]
        largest = max((key for key, row in rows.items() if row["real"]), key=lambda key: abs(rows[key]["share"]))
        assert key_of(term.laws["masing"].largest) == largest
        metric = largest.rpartition(".")[2]
        assert (said, test) == (
            f"{words.change(rows[largest]['share'])} {words.label(metric)}",
            term.laws["masing"].largest.test.replace("-", " "),
        )
        felt = [row["perception"] == "perceptible" for row in rows.values()]
        known = sum(row["perception"] != "no threshold known" for row in rows.values())
        counts.append((known, len(rows), sum(felt)))
    text = sentence((made[0] / "index.html").read_text(encoding="utf-8"))
    assert f"By the {counts[0][0]} known thresholds of {counts[0][1]} metrics" in text
    assert [bool(felt) for *_, felt in counts] == [False, False]
    assert text.count("no law") == 2


def test_a_comparison_of_files_has_the_largest_differences_of_the_report(made, tmp_path):
    for term, held, laws, (said, _) in on_terms(made):
        largest = term.laws["masing"].largest
        for law in (term.base, "masing"):
            driven = manoeuvres.drive(made[1].car, made[1].manoeuvres[largest.test], laws[law])
            files.write(driven, tmp_path / f"{law}.csv")
        paths = [str(tmp_path / f"{law}.csv") for law in (term.base, "masing")]
        assert main(["evaluate", "--compare", *paths, "--out", str(tmp_path / "compared")]) == 0
        compared = json.loads((tmp_path / "compared" / "evaluation.json").read_text(encoding="utf-8"))
        share = compared["differences"]["masing"][largest.metric]["share"]
        assert share == pytest.approx(held["laws"]["masing"][key_of(largest)]["share"], rel=1e-6)
        assert said.split()[0] in (tmp_path / "compared" / "index.html").read_text(encoding="utf-8")


def test_the_friction_study_has_the_differences_of_the_report(made):
    """The largest of the tests that both drive alike: the weave is shorter in this file's report."""
    factors = friction_cases.LAW, friction_cases.MEASURED
    for (term, held, _, _), factor in zip(on_terms(made), factors, strict=True):
        largest = next(row for row in term.differences.rows if row.test != "weave" and row.found.real)
        cases = friction_cases.cases(made[1].laws, made[1].fitted.laws)
        own = [case for case in cases if case.factor == factor and case.level in (term.base, "masing")]
        driven = [friction_cases.drives((made[1].car, case, (largest.test,))) for case in own]
        shares = {row.metric: row.found.share for row in friction_cases.effects(own, driven)}
        assert shares[largest.metric] == pytest.approx(held["laws"]["masing"][key_of(largest)]["share"], rel=1e-9)


def test_what_stands_below_the_table_is_in_the_json_and_on_the_pages_of_its_studies(made):
    """Ripple of a held torque, and the margins of the assist loop."""
    numbers = json.loads((made[0] / "metrics.json").read_text(encoding="utf-8"))
    first = (made[0] / "index.html").read_text(encoding="utf-8").partition('<section id="differs">')[0]
    found = {words.number(1e3 * test["ripple"]) for test in numbers["held_torque"]}
    study = held_torque.Results(made[1].held, held_torque.of_every_law(made[1].car, "lugre"))
    page = held_torque.build(study, made[1].car.name)[0].html()
    ripples = re.findall(r"([\d.]+) mN m", first)
    assert ripples
    assert set(ripples) <= found
    assert all(f"<td>{ripple}</td>" in page for ripple in ripples)
    own = [(cell.phase_deg, cell.gain_db) for cell in assist_cells(made[1].car, 0.0)]
    assert [(cell["phase_deg"], cell["gain_db"]) for cell in numbers["margins"]["parking"]] == own
    assert list(numbers["margins"]) == ["parking"]
    assert "with the handwheel held (parking)" in first


def test_a_full_page_is_interactive(made, source):
    page = Page(report.page_of(made[1], source, report.Look(full=True)).html())
    assert sum("plotly-graph-div" in (attrs.get("class") or "") for _, attrs in page.tags) == len(TESTS)


def test_the_page_is_small_and_has_no_script_library(made, source):
    text = report.page_of(made[1], source).html()
    assert len(text.encode()) < 400_000
    page = Page(text)
    assert page.open == []
    assert "Plotly.newPlot" not in text
    images = [attrs for tag, attrs in page.tags if tag == "img"]
    assert len(images) == len(FIRST) + len(FIGURES) + len(TESTS)
    assert all(attrs["alt"] for attrs in images)
    for attrs in images:
        root = ElementTree.fromstring(unquote(attrs["src"].removeprefix("data:image/svg+xml,")))
        assert root.tag.endswith("svg")
        assert len(list(root.iter())) > 20


def test_a_law_that_a_driver_feels_is_in_the_verdict(made, source):
    """A parking torque 1.2 times as large for one law."""
    results = made[1]
    drive = results.drives["step-steer"]["masing"]
    torque = drive.values["steady_step_torque"]
    louder = torque._replace(
        value=1.2 * torque.value,
        low=1.2 * torque.low,
        high=1.2 * torque.high,
        repeats=tuple(1.2 * x for x in torque.repeats),
    )
    values = {**drive.values, "steady_step_torque": louder}
    drives = {**results.drives, "step-steer": {**results.drives["step-steer"], "masing": drive._replace(values=values)}}
    changed = results._replace(drives=drives)
    text = " ".join(report.page_of(changed, source).html().split())
    assert "a driver tells masing from lugre with one calibration" in text
    assert '<span class="badge perceptible">perceptible</span>' in text
    deaf = " ".join(report.page_of(changed, source, report.Look(noticed=0.3)).html().split())
    assert "a driver tells no law from lugre with one calibration" in deaf
    json_of = report.metrics_json(changed, source)["differences"]["laws"]["masing"]
    assert json_of["step_steer.steady_step_torque"]["perception"] == "perceptible"


def test_the_first_table_of_many_laws_has_ten_rows(made, source):
    results, own = made[1], [f"own_{k}" for k in range(11)]

    def many(of):
        return {**of, **dict.fromkeys(own, of["masing"])}

    changed = results._replace(
        laws=many(results.laws),
        drives={test: many(drives) for test, drives in results.drives.items()},
        torques=many(results.torques),
        tables=many(results.tables),
        times=faked(dict.fromkeys(many(results.laws), 100.0)),
    )
    text = report.page_of(changed, source).html()
    sentence(text)
    assert {name for name in own if f"<tr><td>{name.replace('_', ' ')}</td><td>" in text} == set(own)


def test_labels_are_in_words(made):
    words = " ".join(Page((made[0] / "index.html").read_text(encoding="utf-8")).words)
    assert not re.findall(r"\b\d+(?:hz|nm|p\d+g)\b", words)
    assert not re.findall(r"\d–[−\d]", words)  # a range with a dash, which a minus sign garbles
    assert "m/s2" not in words


def test_both_files_hold_the_trace(made):
    record = traces.read(made[0] / "metrics.json")
    assert record == traces.read(made[0] / "index.html")
    assert record["car"] == made[1].car.data()
    assert set(record["friction"]) == set(LAWS)


def test_computing_times_do_not_make_another_result(made, source, tmp_path):
    results = sure(made[1])
    slower = times(lugre=200.0, masing=1e4)(results)
    other = report.provenance_of(results) | {"date": "2000-01-01T00:00:00+00:00", "processor": "abacus", "cores": 1}
    pages = {"one": (results, source), "slow": (slower, other), "changed": (ratio_of(results), source)}
    for name, (found, about) in pages.items():
        (tmp_path / f"{name}.html").write_text(report.page_of(found, about).html(), encoding="utf-8")
    assert traces.differences(tmp_path / "one.html", tmp_path / "slow.html") == []
    assert traces.differences(tmp_path / "one.html", tmp_path / "changed.html") != []


def ratio_of(results):
    """The results with another margin of the assist."""
    margins = {speed: [cell._replace(phase_deg=1.0) for cell in cells] for speed, cells in results.margins.items()}
    return results._replace(margins=margins)


def test_the_report_of_an_own_car(tmp_path, monkeypatch):
    """The command hands over the car of its options, its look, and what has to be run again."""
    seen = {}

    def build_(out, laws, scope, notify, look, trace, sweep, beside):
        seen.update(car=scope.loaded(), look=look, trace=trace, beside=beside)

    monkeypatch.setattr(report, "build", build_)
    options = ["--vehicle", "bmw_320i", "--set", "column.K_tb=143", "--noticed-percent", "10"]
    command = ["report", *options, "--friction", "lugre", "--out", str(tmp_path / "mine")]
    assert main(command) == 0
    assert (seen["car"].name, seen["car"].column.K_tb) == ("bmw_320i", 143.0)
    assert seen["look"] == report.Look(noticed=pytest.approx(0.1))
    assert seen["beside"] is None
    assert (seen["trace"]["command"], seen["trace"]["result"]) == (command, "mine")
    assert cars.load(seen["trace"]["car"]).column.K_tb == 143.0


def test_the_page_says_everything_in_plain_words(made):
    words = " ".join(" ".join(Page((made[0] / "index.html").read_text(encoding="utf-8")).words).split())
    headings = "Verdict", "1 Friction", "2 Held", "3 Feel", "4 Real time", "5 Assist", "6 Vehicle", "7 Provenance"
    for heading in (*headings, "Parking", "Glossary"):
        assert heading in words
    for name in {name for test in TESTS for name in metrics.available(test)}:
        assert " ".join(report_findings.label(name).split()) in words
    assert not {"nan", "None", "Undefined", "inf"} & set(words.split())
    lasting = r"keeps vibrating with strong friction \(3 N m\) and assist on: [\d.]+ mN m without a micro-damper, "
    light = r"[\d.]+ mN m with a damping ratio of 0\.1 \(decays\), "
    assert re.search(lasting + light + r"[\d.]+ mN m with a damping ratio of 0\.44 \(decays\)", words)
    assert "; it decays in the other 3 combinations of friction and assist" in words
    assert "The lines of masing and lugre (wide) coincide within a line's width" in words
    assert ":mod:" not in words
    assert ":func:" not in words


def test_metrics_json(made):
    data = json.loads((made[0] / "metrics.json").read_text(encoding="utf-8"))
    parts = {"metrics", "differences", "fitted", "real_time", "held_torque", "margins", "vehicle"}
    assert set(data) == {*parts, "provenance", "trace"}
    assert set(data["differences"]["laws"]) == {"masing"}
    assert data["differences"]["noticed_share"] == 0.15
    assert set(data["vehicle"]) == {"weave_peaks", "parking"}
    prefixes = {"weave": "", "slow-ramp": "slow_ramp.", "step-steer": "step_steer.", "hold": "hold."}
    names = {prefix + name for test, prefix in prefixes.items() for name in metrics.available(test)}
    for law in LAWS:
        assert set(data["metrics"][law]) == names
        for entry in data["metrics"][law].values():
            assert set(entry) == {"value", "ci", "unit"}
            low, high = entry["ci"]
            assert low is high is None or low <= entry["value"] <= high
        assert {row["scheme"] for row in data["real_time"]["laws"][law]} == {
            "midpoint",
            "explicit Euler",
            "backward Euler",
        }
        assert data["provenance"]["laws"][law]["parameters"]
    assert data["provenance"]["version"]
    assert data["provenance"]["random_numbers"].startswith("none")


def test_refused_metrics_are_null_with_a_reason(made, monkeypatch):
    monkeypatch.setattr(report, "_pictures", lambda _: dict.fromkeys(FIGURES, "<svg/>"))
    _, results = made
    drive = results.drives["weave"]["lugre"]
    refused = {**drive.values, "yaw_lag": metrics.Value(float("nan"), float("nan"), float("nan"), "ms", "no yaw rate")}
    drives = {**results.drives, "weave": {**results.drives["weave"], "lugre": drive._replace(values=refused)}}
    changed = results._replace(drives=drives)
    source = report.provenance_of(changed)
    entry = report.metrics_json(changed, source)["metrics"]["lugre"]["yaw_lag"]
    assert entry == {"value": None, "ci": [None, None], "unit": "ms", "reason": "no yaw rate"}
    assert "Refused: yaw lag (lugre): no yaw rate." in report.page_of(changed, source).html()


def row_of(law, **changes):
    """A change of the results: the midpoint row of a law at 1 ms."""

    def change(results):
        rows = [row._replace(**changes) if row[:2] == ("midpoint", 1e-3) else row for row in results.tables[law]]
        return results._replace(tables={**results.tables, law: rows})

    return change


def times(**ns):
    """A change of the results: the computing times of laws [ns]; not measurable without."""
    return lambda results: results._replace(times=faked(ns) if ns else NONE)


sure = times(lugre=200.0, masing=100.0)  # fixed times, so that the load of the machine has no effect on them


def held(which, **changes):
    """A change of the results: the held-torque tests that are chosen."""
    return lambda results: results._replace(held=[t._replace(**changes) if which(t) else t for t in results.held])


def bare(test):
    return test.damping_ratio == 0.0


@pytest.mark.parametrize(
    ("change", "gone", "instead"),
    [
        (
            times(lugre=200.0, masing=1e4),
            "LuGre takes more computing time than Masing",
            "LuGre takes less computing time than Masing",
        ),
        (times(lugre=200.0, masing=1e4), "as an exponential and a Newton step take more", "A step costs 1 ("),
        (
            times(lugre=200.0, masing=200.0),
            "LuGre takes more computing",
            "LuGre and Masing take the same computing time",
        ),
        (times(lugre=1e6, masing=100.0), "both run in real time", "a step is long with LuGre"),
        (times(lugre=1e6, masing=100.0), "hardly: 0.", "yes: 110"),
        (times(lugre=200.0, masing=1e6), "Masing runs in real time", "Masing may not run in real time"),
        (times(), "step of the column of 1 ms takes", "not measurable now: a bare loop waits 66"),
        (times(), "ns (lugre)", '<td class="text" colspan="3">not measurable now</td>'),
        (row_of("masing", error=0.5), ", both negligible", "and 50\u00a0%."),
        (
            held(lambda test: bare(test) and test.law == "masing", ripple=1e-9),
            "yes, unless strongly damped",
            "Masing friction does not vibrate more than LuGre",
        ),
        (
            held(lambda test: test.law == "masing", lasting=0.1),
            "keeps vibrating with strong friction",
            "Masing friction vibrates more than LuGre friction, and the vibration decays",
        ),
        (held(bare, ripple_fine=1.0), "the step length does not cause it", "the step length contributes to it"),
        (
            held(lambda test: not bare(test) and test.law == "masing", ripple=1.0),
            "removes nearly all",
            "leaves a difference",
        ),
        (
            held(lambda test: test.assist == "off", lasting=1.0),
            "so that the vibration persists",
            "Masing's elements are springs",
        ),
    ],
)
def test_a_claim_changes_with_its_number(made, source, before, change, gone, instead):
    after = without_pictures(change(sure(made[1])), source)
    assert gone in before
    assert gone not in after
    assert instead in after


def test_one_law_alone_makes_a_page_too(made):
    _, results = made
    alone = results._replace(
        laws={"masing": LAWS["masing"]},
        base="masing",
        drives={test: {"masing": drives["masing"]} for test, drives in results.drives.items()},
        torques={"masing": results.torques["masing"]},
        tables={"masing": results.tables["masing"]},
        held=[test for test in results.held if test.law == "masing"],
        vehicle=None,
    )
    page = report.page_of(alone, report.provenance_of(alone)).html()
    assert "made without one of them" in page
    assert "6 Provenance" in page


def test_an_error_half_way_leaves_the_old_report(made, tmp_path, monkeypatch):
    _, results = made
    out = tmp_path / "report"
    out.mkdir()
    (out / "index.html").write_text("old")
    monkeypatch.setattr(report, "collect", lambda *_: results)
    monkeypatch.setattr(pages.Page, "html", lambda *_: "<body>new</body>")

    def fail(*_):
        raise RuntimeError("disk on fire")

    with monkeypatch.context() as patch:
        patch.setattr(pages, "write_json", fail)  # the page is written by then
        with pytest.raises(RuntimeError, match="disk on fire"):
            report.build(out, LAWS, SCOPE, sweep=IN_TWO)
    assert [path.name for path in tmp_path.rglob("*")] == ["report", "index.html"]
    assert (out / "index.html").read_text() == "old"
    report.build(out, LAWS, SCOPE, sweep=IN_TWO)
    assert "<body>new" in (out / "index.html").read_text()
    assert sorted(path.name for path in tmp_path.rglob("*")) == ["index.html", "metrics.json", "report"]


@pytest.mark.skipif(sys.platform == "win32", reason="sends SIGINT to one process")
def test_ctrl_c_leaves_the_old_report_and_no_process(tmp_path):
    out = tmp_path / "report"
    out.mkdir()
    (out / "index.html").write_text("old")
    command = [sys.executable, "-m", "steer_env.experiments.cli.main", "report", "--workers", "2", "--out", str(out)]
    # A suite that runs in the background hands on that Ctrl-C is ignored.
    heard = partial(signal.signal, signal.SIGINT, signal.SIG_DFL)
    with subprocess.Popen(command, stderr=subprocess.PIPE, text=True, preexec_fn=heard) as process:
        while len(list(tmp_path.iterdir())) == 1:  # until it builds beside the old one
            time.sleep(0.05)
            assert process.poll() is None
        time.sleep(1.0)  # the workers start
        process.send_signal(signal.SIGINT)
        _, errors = process.communicate(timeout=20.0)  # ends only when no worker holds the pipe any more
    assert process.returncode == 130
    assert errors == "steer-env report: interrupted\n"
    assert [path.name for path in tmp_path.rglob("*")] == ["report", "index.html"]
    assert (out / "index.html").read_text() == "old"
