"""The report with a reduced scope: complete, self-contained, and with the numbers of the other commands."""

import json
import re
from functools import partial
from html.parser import HTMLParser
from urllib.parse import unquote
from xml.etree import ElementTree

import pytest

from steer_env import friction
from steer_env.experiments import sweep
from steer_env.experiments.cli.main import main
from steer_env.experiments.pages import traces, words
from steer_env.experiments.reports import report, report_findings
from steer_env.experiments.reports.report_results import Scope
from steer_env.vehicle import cars
from tests.experiments.faked_times import NONE, faked

pytestmark = pytest.mark.whole

LAWS = {law: friction.make(law) for law in ("lugre", "masing")}
TESTS = {"weave": {"cycles": 6}, "slow-ramp": {}, "step-steer": {}, "hold": {}}
SCOPE = Scope(tests=TESTS, widths=(0.0, 1.0, 2.0), steps=(1e-3, 1e-2), speeds_kph=(0.0,))
IN_TWO = partial(sweep.run, where=sweep.Where(2))


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    out = tmp_path_factory.mktemp("made") / "report"
    seen = []
    results = report.build_report(out, LAWS, SCOPE, lambda part, what: seen.append(part), sweep=IN_TWO)
    assert seen == sorted(seen)
    assert seen[-1] == 1.0
    return out, results


@pytest.fixture(scope="module")
def source(made):
    return report.provenance_of(made[1])


class Page(HTMLParser):
    """Tags with their attributes."""

    def __init__(self, text):
        super().__init__()
        self.tags, self.open = [], []
        self.feed(text)

    def handle_starttag(self, tag, attrs):
        self.tags.append((tag, dict(attrs)))
        if tag not in {"meta", "img", "br"}:
            self.open.append(tag)

    def handle_endtag(self, tag):
        assert self.open.pop() == tag


def test_the_page_is_well_formed_and_needs_nothing_from_outside(made):
    text = (made[0] / "index.html").read_text(encoding="utf-8")
    assert len(text.encode()) < 400_000
    page = Page(text)
    assert page.open == []
    images = [attrs["src"] for tag, attrs in page.tags if tag == "img"]
    assert len(images) == len(set(images)) > len(TESTS)
    for src in images:
        assert ElementTree.fromstring(unquote(src.removeprefix("data:image/svg+xml,"))).tag.endswith("svg")
    assert all(attrs["alt"] for tag, attrs in page.tags if tag == "img")
    assert not {"link", "iframe"} & {tag for tag, _ in page.tags}
    assert not [attrs for tag, attrs in page.tags if tag == "script" and "src" in attrs]
    ids = [attrs["id"] for _, attrs in page.tags if "id" in attrs]
    links = {attrs["href"] for tag, attrs in page.tags if tag == "a"}
    assert len(ids) == len(set(ids))
    assert links <= {f"#{name}" for name in ids}


def test_both_terms_have_all_laws_and_their_numbers_are_those_of_the_json(made):
    numbers = json.loads((made[0] / "metrics.json").read_text(encoding="utf-8"))
    terms = report_findings.terms(made[1])
    for term, of in zip(terms, (numbers["differences"], numbers["fitted"]["differences"]), strict=True):
        assert of["base"] == term.base == "lugre"
        assert list(of["laws"]) == list(term.laws) == ["masing"]
        rows = of["laws"]["masing"].values()
        assert term.laws["masing"].compared == len(rows)
        assert term.laws["masing"].large == sum(row["large"] for row in rows)
        assert len(term.laws["masing"].perceptible) == sum(row["perception"] == "perceptible" for row in rows)
    assert terms[1].laws["masing"].large > terms[0].laws["masing"].large
    assert numbers["fitted"]["laws"]["lugre"]["undetermined"] == ["sigma_1", "sigma_2", "F_s", "v_s"]
    fitted = made[1].fitted.laws["lugre"]
    assert (fitted.sigma_1, fitted.sigma_2, fitted.F_s) == (0.0, 0.0, fitted.F_c)


def test_a_full_page_is_interactive(made, source):
    page = Page(report.make_page(made[1], source, report.Look(full=True)).html())
    assert sum("plotly-graph-div" in (attrs.get("class") or "") for _, attrs in page.tags) == len(TESTS)


def test_pictures_that_were_drawn_while_others_were_computed_are_those_of_the_page(made, source):
    html = (made[0] / "index.html").read_text(encoding="utf-8")
    images = report.make_page(made[1], source).values["images"]
    assert {"chassis", "parking", "loop_width"} <= images.keys()
    assert all(shown in html for shown in images.values())


def test_a_law_that_a_driver_feels_is_told(made, source):
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
    for noticed, felt in ((0.15, True), (0.3, False)):
        assert bool(report_findings.terms(changed, noticed)[0].laws["masing"].perceptible) == felt
        json_of = report.metrics_json(changed, source, report.Look(noticed=noticed))["differences"]["laws"]["masing"]
        assert (json_of["step_steer.steady_step_torque"]["perception"] == "perceptible") == felt


def test_the_verdict_names_who_is_noticed_where_and_by_how_much(made):
    def said(*felt):
        """The verdict where these terms have one metric that is perceptible, and all others are alike."""
        found = []
        for term, noticed in zip(report_findings.terms(made[1]), felt):
            known = [row for row in term.differences.known if row.law == "masing"]
            perceptible = known[:1] if noticed else []
            laws = {"masing": term.laws["masing"]._replace(perceptible=perceptible)}
            found.append(term._replace(differences=term.differences._replace(perceptible=perceptible), laws=laws))
        return report_findings.verdict(made[1], found), found

    none, (shared, fitted) = said(False, False)
    largest = max(abs(row.of_base) for term in (shared, fitted) for row in term.differences.known)
    assert "another law would go unnoticed" in none
    assert words.percent(largest) in none
    both, (shared, _) = said(True, True)
    own, (_, fitted) = said(False, True)
    for text, term in ((both, shared), (own, fitted)):
        row = term.differences.perceptible[0]
        assert {"masing", "lugre"} <= set(re.findall(r"\w+", text))
        assert words.label(row.metric) in text
        assert row.test.replace("-", " ") in text
        assert words.change(row.of_base) in text
    assert all(len(text.split()) <= 25 for text in (none, both, own))


def test_small_turns_name_the_laws_that_lose_least_and_most(made):
    found = report_findings.small_turns(made[1])
    lost = {law: made[1].small_turns[law].values["loop_area"].value for law in LAWS}
    assert found.lost == lost
    assert lost[found.most] == max(lost.values())
    assert lost[found.least] == min(lost.values())
    assert found.ratio > found.weave


def test_both_files_hold_the_trace(made):
    record = traces.read(made[0] / "metrics.json")
    assert record == traces.read(made[0] / "index.html")
    assert record["car"] == made[1].car.data()
    assert set(record["friction"]) == set(LAWS)


def test_computing_times_do_not_make_another_result(made, source, tmp_path):
    results, slower = (made[1]._replace(times=faked({"lugre": 200.0, "masing": ns})) for ns in (100.0, 1e4))
    other = report.provenance_of(results) | {"date": "2000-01-01T00:00:00+00:00", "processor": "abacus", "cores": 1}
    pages = {"one": (results, source), "slow": (slower, other), "changed": (ratio_of(results), source)}
    for name, (found, about) in pages.items():
        (tmp_path / f"{name}.html").write_text(report.make_page(found, about).html(), encoding="utf-8")
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

    monkeypatch.setattr(report, "build_report", build_)
    monkeypatch.setattr(report_findings, "terms", lambda results, noticed: [])
    monkeypatch.setattr(report_findings, "verdict", lambda results, terms: "")
    options = ["--vehicle", "bmw_320i", "--set", "column.K_tb=143", "--noticed-percent", "10"]
    command = ["report", *options, "--friction", "lugre", "--out", str(tmp_path / "mine")]
    assert main(command) == 0
    assert (seen["car"].name, seen["car"].column.K_tb) == ("bmw_320i", 143.0)
    assert seen["look"] == report.Look(noticed=pytest.approx(0.1))
    assert seen["beside"] is None
    assert (seen["trace"]["command"], seen["trace"]["result"]) == (command, "mine")
    assert cars.load(seen["trace"]["car"]).column.K_tb == 143.0


def test_what_is_told_of_the_held_torque_follows_from_its_numbers(made):
    def found(which, **changes):
        held = [test._replace(**changes) if which(test) else test for test in made[1].held]
        return report_findings.held_torque(made[1]._replace(held=held))

    def bare(test):
        return not test.damping_ratio

    def masing(test):
        return test.law == "masing"

    own = found(bare)
    told = (own.vibrates, bool(own.lasting), own.of_the_step, own.damper_explains, own.fed_by_assist)
    assert told == (True, True, False, True, True)
    assert not found(lambda test: bare(test) and masing(test), ripple=1e-9).vibrates
    assert not found(masing, lasting=0.1).lasting
    assert found(bare, ripple_fine=1.0).of_the_step
    assert not found(lambda test: not bare(test) and masing(test), ripple=1.0).damper_explains
    assert not found(lambda test: test.assist == "off", lasting=1.0).fed_by_assist


def test_what_a_metric_is_noted_with_stands_on_the_page(made):
    _, results = made
    note = "wheel loads from 1 to 2 N, beyond the range of a tyre"
    drive = results.drives["weave"]["masing"]
    noted = drive._replace(values={name: each._replace(notes=(note,)) for name, each in drive.values.items()})
    drives = {**results.drives, "weave": {**results.drives["weave"], "masing": noted}}
    page = report.make_page(results._replace(drives=drives), report.provenance_of(results)).html()
    assert page.count(note) == 1
    assert note not in report.make_page(results, report.provenance_of(results)).html()


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
        times=NONE,
    )
    assert Page(report.make_page(alone, report.provenance_of(alone)).html()).open == []
