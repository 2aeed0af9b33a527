"""The page beside another page, which links into it with its car and laws."""

import re
from urllib.parse import parse_qs

import pytest
from markupsafe import Markup

from steer_env import friction
from steer_env.experiments.cli.main import main
from steer_env.experiments.explore import beside
from steer_env.experiments.reports import car_page
from steer_env.vehicle import cars
from tests.experiments.explore.cases import READY, SITES
from tests.needs import needs

pytestmark = needs("ziglang")

LAWS = {"own": "lugre,F_c=1.2,sigma_1=3", "far": "lugre,F_c=99", "finer": "masing,elements=20"}


@pytest.mark.parametrize(
    ("law", "values"),
    [
        ("lugre", ""),
        ("masing", ""),
        ("lugre,F_c=1.2", "&friction.F_c=1.2"),
        ("dahl,F_c=0.5,sigma_0=80", "&friction.F_c=0.5&friction.sigma_0=80.0"),
    ],
)
def test_an_address_gives_a_law_with_its_parameters(law, values):
    found = beside.address(cars.load(), friction.resolve(law), "two_track")
    assert sorted(found.split("&")) == sorted(f"law={law.split(',')[0]}&chassis=two_track{values}".split("&"))


@pytest.mark.parametrize("given", [SITES, {"gear": "masing,efficiency=0.88", "upper_column": "coulomb,F_c=5e-2"}])
def test_sites_have_an_address_that_says_them(given):
    assert parse_qs(beside.address(cars.load(), given, "two_track")) == {"law": [SITES], "chassis": ["two_track"]}


@pytest.mark.parametrize("law", [LAWS["far"], LAWS["finer"], "lugre,F_s=0.95,sigma_2=1", "stribeck,F_s=1.5@gear"])
def test_a_law_that_the_fields_refuse_or_do_not_give_has_no_address(law):
    assert beside.address(cars.load(), friction.resolve(law), "single_track") == ""


def test_a_page_links_to_its_car_with_its_laws_and_sites(tmp_path, browser):
    car = cars.load("compact", {"column.K_tb": 143.0})
    laws = {**{label: friction.resolve(text) for label, text in LAWS.items()}, "two sites": SITES}
    car_page.write_car_page(tmp_path / "car", car, beside=beside.PageBeside(car, laws, ("single_track",)))
    html = (tmp_path / "car" / "index.html").read_text(encoding="utf-8")
    assert "Sliders do not give the parameters of far, finer." in Markup(html).striptags()
    own = {"friction.F_c": "1.2", "friction.sigma_1": "3", "column.K_tb": "143"}
    two = {"friction.gear.efficiency": "0.88", "friction.upper_column.F_c": "0.05", "column.K_tb": "143"}
    for label, values in (("own", own), ("two sites", two)):
        (link,) = re.findall(rf'<a href="(live/[^"]*)">{label}</a>', html)
        browser.open("about:blank")
        browser.open(f"{(tmp_path / 'car').as_uri()}/{Markup(link).unescape()}")
        browser.until(READY)
        for name, value in values.items():
            assert browser.value(f"document.getElementById('field-{name}').value") == value
        assert browser.value("document.getElementById('status').textContent") == ""


def test_a_law_of_another_contact_than_a_column_is_refused_before_the_work(tmp_path, capsys):
    assert main(["fit-friction", "rig", "--live", "--out", str(tmp_path / "fit")]) != 0
    assert "--live needs friction of a column" in capsys.readouterr().err
