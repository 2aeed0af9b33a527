"""What the page hands on is what Python takes: a car file, lines that make an environment, a recording, pictures."""

import ast
import json
import re
import runpy
import time
from xml.etree import ElementTree

import numpy as np
import pytest
from py_mini_racer import MiniRacer

from steer_env import friction, metrics, recording
from steer_env.experiments.explore import parameters, writing
from steer_env.friction.numerics.packing import numbers
from steer_env.vehicle import cars
from tests.experiments.explore.browser import PATIENCE
from tests.experiments.explore.cases import CHANGED, READY, SITES, address
from tests.experiments.explore.chromium import Chromium, chromium_needed

pytestmark = chromium_needed

VALUES = CHANGED | {
    "friction_scale": 1.5,
    "assist.damping": 3.0,
    "assist.return_gain": 2.0,  # which the car has off at every speed
    "assist.boost_scale.4": 1.2,
    "column.C2": 0.8,
    "steering.friction_load": 0.05,
}


@pytest.fixture(scope="module")
def downloads(page, tmp_path_factory):
    """The folder of the four files of a changed car, and the metrics and the number of pictures that its page shows."""
    folder = tmp_path_factory.mktemp("downloads")
    with Chromium(folder / "profile") as browser:
        browser.call("Page.setDownloadBehavior", behavior="allow", downloadPath=str(folder))
        browser.open(address(page, **VALUES))
        browser.until(READY)
        for kind, suffix in (("car", "toml"), ("environment", "py"), ("recording", "csv"), ("pictures", "svg")):
            browser.value(f"document.querySelector('#downloads [data-file={kind}]').click()")
            end = time.monotonic() + PATIENCE
            while not (folder / f"compact_lugre.{suffix}").exists() and time.monotonic() < end:
                time.sleep(0.02)
        assert browser.errors == []
        return folder, *browser.value("[steerShown.answer.values, document.querySelectorAll('figure').length]")


def test_the_car_file_gives_the_plant_of_the_page(downloads):
    folder, *_ = downloads
    found, of_drive = cars.load(folder / "compact_lugre.toml"), ("friction.", "load", "speed_kph", "friction_scale")
    rest = {name: value for name, value in VALUES.items() if name.startswith(of_drive)}
    for chassis in ("single_track", "two_track"):
        own = numbers(parameters.plant(found, "lugre", chassis, rest))
        np.testing.assert_array_equal(own, numbers(parameters.plant(cars.load("compact"), "lugre", chassis, VALUES)))
    assert found.name == "compact, changed"


def test_the_lines_make_an_environment_of_the_car(downloads, monkeypatch):
    folder, *_ = downloads
    monkeypatch.chdir(folder)
    made = runpy.run_path("compact_lugre.py")
    made["env"].step(np.zeros(1))
    arguments = made["env"].spec.kwargs
    assert arguments["friction"] == {"law": "lugre", "F_c": VALUES["friction.F_c"]}
    assert made["env"].unwrapped.batch.car.column.K_tb == VALUES["column.K_tb"]
    assert made["info"]["conditions"]["friction_level"] == VALUES["friction_scale"]
    assert made["info"]["conditions"]["load"] == VALUES["load"]
    assert made["info"]["conditions"]["speed"] == pytest.approx(VALUES["speed_kph"] / 3.6)


@pytest.mark.parametrize(
    ("law", "changed"),
    [
        ("masing", {"friction.F_c": 1.4}),  # whose x_c follows F_c in Python, and not in the page
        (SITES, {"friction.gear.F_c": 1.1, "friction.gear.efficiency": 0.75, "friction.upper_column.F_c": 0.12}),
        ("masing,k=100:50,y=0.002:0.008@rack", {"friction.rack.asymmetry": 0.1}),
        ("masing@column_eps", {"friction.column_eps.F_c": 1.1, "friction.column_eps.efficiency": 0.8}),
    ],
)
def test_the_lines_have_the_friction_of_the_page(law, changed):
    car, context = cars.load("compact"), MiniRacer()
    context.eval((writing.PAGE_FOLDER / "downloads.js").read_text(encoding="utf-8"))
    given = [writing.declared(car, [writing.Combination(law, "single_track")])]
    given.append({"law": law, "chassis": "single_track", "values": changed})
    lines = context.eval(
        f"(([declared, of]) => steerFiles(declared).environmentLines(of, 'compact', 90))({json.dumps(given)})"
    )
    found = ast.literal_eval(re.search(r"friction=(.*),\n", lines)[1])
    shown = {q.name: q.value for q in parameters.every(car, law, "single_track")} | changed
    expected = parameters.plant(car, law, "single_track", shown).friction
    np.testing.assert_array_equal(numbers(friction.resolve(found)), numbers(expected))


def test_the_recording_has_the_metrics_of_the_page(downloads):
    folder, shown, _ = downloads
    found = metrics.evaluate(recording.read(folder / "compact_lugre.csv"), "weave", intervals=False)
    assert {name: pytest.approx(value.value, rel=1e-4) for name, value in found.items()} == shown


def test_the_pictures_are_in_one_svg(downloads):
    folder, _, shown = downloads
    root = ElementTree.parse(folder / "compact_lugre.svg").getroot()
    assert len(root.findall("{*}g")) == len(root.findall("{*}g/{*}polyline")) == shown >= 5
    texts = [text.text for text in root.iterfind("{*}g/{*}text")]
    assert "Hand torque over handwheel angle" in texts
    for line in root.iterfind("{*}g/{*}polyline"):
        points = np.array([list(map(float, point.split(","))) for point in line.get("points").split()])
        assert 62 <= points[:, 0].min() < points[:, 0].max() <= 626
        assert 30 <= points[:, 1].min() < points[:, 1].max() <= 332
