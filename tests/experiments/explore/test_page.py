"""The page in a real browser: the same numbers as Python, its fields, its address, and nothing asked of a network."""

import functools
import http.server
import json
import os
import shutil
import statistics
import threading
import time
from dataclasses import replace
from urllib.parse import quote

import numpy as np
import pytest

from steer_env import friction, manoeuvres, metrics
from steer_env.experiments import explore
from steer_env.experiments.explore import parameters
from steer_env.friction.numerics.packing import numbers
from steer_env.manoeuvres.common import driving
from steer_env.vehicle import cars, chassis
from steer_env.vehicle.keys import checked
from steer_env.vehicle.steering import stability
from tests.experiments.explore.chromium import Chromium, needed

pytestmark = needed
READY = "typeof steerShown === 'object' && steerShown.answer?.exact && steerShown.answer.id"
CHANGED = {
    **{
        "friction.F_c": 1.4,
        "column.K_tb": 190.0,
        "assist.boost_scale": 0.8,
        "assist.friction_share": 0.3,
        "load": 250.0,
    },
    **{"speed_kph": 120.0, "steering.pinion_radius": 0.0075, "chassis.front_cornering_stiffness_factor": 1.2},
}


@pytest.fixture(scope="module")
def page(tmp_path_factory):
    return explore.explore(tmp_path_factory.mktemp("page") / "page", friction=["lugre"], chassis=["single_track"])


@pytest.fixture
def browser(tmp_path):
    with Chromium(tmp_path / "profile") as found:
        yield found
        assert found.errors == []


def address(page, law="lugre", body="single_track", **values):
    pairs = {"law": law, "chassis": body, **values}
    return f"{page.as_uri()}#{'&'.join(f'{key}={value}' for key, value in pairs.items())}"


def evaluated(law, body, values):
    """Python's metrics of the standard weave with values of the page."""
    car, speed = cars.load("compact"), values.get("speed_kph", 100.0) / 3.6
    weave = replace(manoeuvres.make("weave"), speed=speed, chassis=body)
    p = parameters.plant(car, law, body, values) if values else driving.build_plant(car, weave, law)
    return metrics.evaluate(driving.drive_plant(car, p, weave), "weave", speed_m_s=speed, intervals=False)


def require_equal(found, expected):
    """Every metric of the page within 0.1 % of Python's, and refused where that is refused."""
    assert set(found) == set(expected)
    for name, value in expected.items():
        shown = np.nan if found[name] is None else found[name]  # JSON knows no NaN
        assert shown == pytest.approx(value.value, rel=1e-3, nan_ok=True), name


@pytest.mark.parametrize("values", [{}, CHANGED], ids=["the car's own", "changed"])
def test_every_metric_is_that_of_python(page, browser, values):
    browser.open(address(page, **values))
    browser.until(READY)
    require_equal(browser.value("steerShown.answer.values"), evaluated("lugre", "single_track", values))


@pytest.mark.whole
@pytest.mark.parametrize("body", chassis.available())
@pytest.mark.parametrize("law", friction.available())
def test_every_metric_of_every_law_is_that_of_python(law, body, browser, tmp_path):
    browser.open(address(explore.explore(tmp_path / "page", friction=[law], chassis=[body]), law, body))
    browser.until(READY)
    require_equal(browser.value("steerShown.answer.values"), evaluated(law, body, {}))


def test_packed_numbers_are_those_of_python(page, browser):
    browser.open(address(page))
    browser.until(READY)
    car, structure = cars.load("compact"), "steerShown.structures.get('lugre single_track')"
    fields = parameters.every(car, "lugre", "single_track")
    rng = np.random.default_rng(1)
    for _ in range(3):
        values = {q.name: q.low + rng.random() * (q.high - q.low) for q in fields}
        found = browser.value(f"Array.from(steerSimulation().packed({structure}, {json.dumps(values)}))")
        np.testing.assert_allclose(
            found, numbers(parameters.plant(car, "lugre", "single_track", values)), rtol=1e-12, atol=1e-15
        )


def test_an_unstable_assist_loop_is_told_in_the_words_of_python(page, browser):
    """Over sets of values: which of them are unstable, and why; a weave of one has no metrics."""
    browser.open(address(page))
    browser.until(READY)
    car, structure = cars.load("compact"), "steerShown.structures.get('lugre single_track')"
    fields, rng, told = parameters.every(car, "lugre", "single_track"), np.random.default_rng(3), []
    for _ in range(40):
        values = {q.name: q.low + rng.random() * (q.high - q.low) for q in fields}
        p, speed = parameters.plant(car, "lugre", "single_track", values), values["speed_kph"] / 3.6
        packed = f"Float64Array.from({json.dumps(numbers(p).tolist())})"
        found = browser.value(f"steerStability().reason({structure}.places, {packed}, {speed})")
        told.append(stability.reason(p.column, p.assist, speed, free=False))
        assert found == told[-1]
        if found:
            unstable = values
    assert 4 <= sum(map(bool, told)) <= 36
    browser.open("about:blank")
    browser.until("typeof steerShown === 'undefined'")
    browser.open(address(page, **unstable))
    browser.until("document.getElementById('status')?.textContent.includes('the assist loop is unstable')")
    assert not browser.value("Object.values(steerShown.answer?.values ?? {}).some(Number.isFinite)")


def test_a_slider_by_the_keyboard_drives_the_car_anew_and_the_address_repeats_it(page, browser):
    browser.open(address(page))
    browser.until(READY)
    before = browser.value("steerShown.answer.values.torque_deadband")
    browser.value("document.querySelector('input[type=range][data-name=\"friction.F_c\"]').focus()")
    for _ in range(40):
        browser.key("ArrowRight")
    browser.until("location.hash.includes('friction.F_c')")
    after = browser.value("steerShown.answer.values.torque_deadband")
    assert after > 1.2 * before
    shown = browser.value("document.getElementById('field-friction.F_c').value")
    link = browser.value("location.href")
    assert link.endswith(f"friction.F_c={shown}")
    browser.open("about:blank")
    browser.until("typeof steerShown === 'undefined'")
    browser.open(link)
    browser.until(READY)
    assert browser.value("steerShown.answer.values.torque_deadband") == pytest.approx(after, rel=1e-6)


@pytest.mark.parametrize(
    ("name", "text", "refuse"),
    [
        ("column.K_tb", "-1", lambda: checked("column", "K_tb", -1)),
        ("steering.pinion_radius", "0.2", lambda: checked("steering", "pinion_radius", 0.2)),
        ("friction.F_c", "0", lambda: friction.make("lugre", F_c=0)),
    ],
)
def test_a_field_refuses_what_python_refuses_in_the_same_words(page, browser, name, text, refuse):
    browser.open(address(page))
    browser.until(READY)
    run = browser.value("steerShown.answer.id")
    browser.value(f"document.getElementById('field-{name}').select()")
    browser.type(text)
    with pytest.raises(ValueError, match=name.split(".")[1]) as refused:
        refuse()
    assert browser.value(f"document.getElementById('field-{name}-refusal').textContent") == str(refused.value)
    time.sleep(0.5)
    assert browser.value("steerShown.answer.id") == run


def test_a_field_takes_a_comma_and_refuses_what_is_no_number(page, browser):
    browser.open(address(page))
    browser.until(READY)
    browser.value("document.getElementById('field-friction.F_c').select()")
    browser.type("1,2")
    browser.until("location.hash.includes('friction.F_c=1.2')")
    browser.value("document.getElementById('field-friction.F_c').select()")
    browser.type("much")
    told = browser.value("document.getElementById('field-friction.F_c-refusal').textContent")
    assert told == "F_c must be finite and greater than 0, got much"


def test_an_address_that_names_what_there_is_not_is_told(page, browser):
    browser.open(address(page, law="stiction", **{"column.K_tb": "-5", "column.gone": 1}))
    browser.until(READY)
    told = browser.value("document.getElementById('status').textContent")
    assert "no law stiction" in told
    assert "K_tb must be finite and greater than 0, got -5" in told
    assert "no column.gone" in told


def test_pins_are_laid_over_and_differences_are_told(page, browser):
    browser.open(address(page))
    browser.until(READY)
    browser.value("document.querySelector('button.pin[data-pin=A]').focus()")
    browser.key("Enter")
    browser.until("document.querySelectorAll('#metrics thead th').length === 4")
    browser.value("document.getElementById('field-assist.boost_scale').select()")
    browser.type("0.5")
    browser.until("location.hash.includes('assist.boost_scale=0.5')")
    rows = "[...document.querySelectorAll('#metrics tbody tr')]"
    peak = f"{rows}.find((row) => row.textContent.startsWith('peak handwheel torque'))"
    assert browser.value(f"{peak}.querySelector('small.noticed').textContent") == "perceptible"
    assert "A=" in browser.value("location.hash")


def test_a_pinned_car_of_the_address_is_checked_too(page, browser):
    pin = "law=lugre&chassis=single_track&friction.F_c=-2&column.K_tb=200"
    browser.open(address(page, B=quote(pin)))
    browser.until(READY)
    told = browser.until("document.getElementById('status').textContent")
    assert "B: F_c must be finite and greater than 0, got -2; left as the car has it." in told
    assert browser.value("document.getElementById('pinned').textContent") == "B: lugre, single track, Torsion bar 200"


def test_a_value_that_changes_while_the_whole_weave_is_driven_counts(page, browser):
    """The weave of the value before is left; what is shown in the end is what a link to the last value shows."""
    browser.open(address(page))
    browser.until(READY)
    for value in (0.5, 0.7, 1.1, 1.3, 1.7):
        browser.value("document.getElementById('field-friction.F_c').select()")
        browser.type(str(value))
        time.sleep(0.3)
    browser.until("location.hash.includes('friction.F_c=1.7') && steerShown.answer.exact")
    found = browser.value("steerShown.answer.values")
    browser.open("about:blank")
    browser.until("typeof steerShown === 'undefined'")
    browser.open(address(page, **{"friction.F_c": 1.7}))
    browser.until(READY)
    assert found == pytest.approx(browser.value("steerShown.answer.values"), rel=1e-4)


def test_a_pinned_car_finds_an_amplitude_of_its_own(page, browser):
    fast = "law=lugre&chassis=single_track&speed_kph=160&chassis.rear_cornering_stiffness_factor=0.8"
    browser.open(address(page, speed_kph=60, A=quote(fast)))
    browser.until("document.querySelector('#pinned li') !== null")
    assert browser.value("steerShown.pins.A.answer.amplitude") < 0.4 * browser.value("steerShown.answer.amplitude")


def test_a_folder_that_lacks_a_file_is_told(page, browser, tmp_path):
    shutil.copytree(page.parent, tmp_path / "copy")
    (tmp_path / "copy" / "modules" / "single_track_lugre.js").unlink()
    browser.open((tmp_path / "copy" / "index.html").as_uri())
    browser.until("document.getElementById('status')?.textContent")
    told = browser.value("document.getElementById('status').textContent")
    assert told == "modules/single_track_lugre.js could not be loaded: is the folder complete?"


def test_nothing_is_asked_of_a_network(page, browser):
    browser.open(address(page))
    browser.until(READY)
    folder = page.parent.as_uri()
    assert len(browser.requested) > 10
    assert all(url.startswith((folder, "blob:", "data:", "about:")) for url in browser.requested), browser.requested


def test_it_opens_from_a_static_host_too(page, browser):
    handler = functools.partial(http.server.SimpleHTTPRequestHandler, directory=page.parent)
    handler.log_message = lambda *_: None
    with http.server.ThreadingHTTPServer(("localhost", 0), handler) as server:
        threading.Thread(target=server.serve_forever, daemon=True).start()
        browser.open(f"http://localhost:{server.server_port}/index.html")
        browser.until(READY)
        server.shutdown()
    assert browser.value("location.protocol") == "http:"


def test_a_browser_without_webassembly_is_told_in_a_sentence(page, browser):
    browser.call("Page.addScriptToEvaluateOnNewDocument", source="delete globalThis.WebAssembly")
    browser.open(address(page))
    browser.until("document.getElementById('status')?.textContent")
    assert "which this browser lacks" in browser.value("document.getElementById('status').textContent")


def test_a_page_holds_what_it_should_at_most(page):
    """At most 2 MB to begin with, and 100 kB for a further law."""
    sizes = {path: path.stat().st_size for path in page.parent.rglob("*") if path.is_file()}
    assert sum(sizes.values()) < 2e6
    assert all(size < 1e5 for path, size in sizes.items() if path.parent.name == "modules")


@pytest.fixture
def quiet():
    """Times are measured where other programs leave half of the processors alone."""
    if os.getloadavg()[0] > 0.5 * (os.cpu_count() or 1):
        pytest.skip(f"the machine is too busy for a time: load {os.getloadavg()[0]:.1f}")


@pytest.mark.whole
def test_first_loops_are_there_within_a_second(page, tmp_path, quiet):
    taken = []
    for k in range(3):
        with Chromium(tmp_path / f"profile{k}") as browser:
            start = time.monotonic()
            browser.open(address(page))
            browser.until("document.querySelector('main')?.dataset.run")
            taken.append(time.monotonic() - start)
    assert min(taken) < 1.0, taken


MOVES = """(async () => {
  const slider = document.querySelector('input[type=range][data-name="friction.F_c"]');
  const main = document.querySelector("main");
  const taken = [];
  for (let k = 0; k < 200; k++) {
    const start = performance.now();
    const drawn = new Promise((resolve) => {
      const watch = new MutationObserver(() => resolve(watch.disconnect()));
      watch.observe(main, { attributeFilter: ["data-run"] });
    });
    slider.value = 20 + (k * 7) % 160;
    slider.dispatchEvent(new Event("input", { bubbles: true }));
    await drawn;
    taken.push(performance.now() - start);
  }
  return taken;
})()"""


@pytest.mark.whole
def test_a_move_of_a_slider_is_redrawn_at_once(page, browser, quiet):
    browser.open(address(page))
    browser.until(READY)
    taken = browser.value(MOVES)
    assert statistics.median(taken) < 30.0
    assert np.quantile(taken, 0.95) < 80.0
