"""The page in a real browser: the same numbers as Python, its fields, its address, and nothing asked of a network."""

import functools
import http.server
import shutil
import threading
import time
from urllib.parse import quote

import pytest

from steer_env import friction
from steer_env.experiments import explore
from steer_env.vehicle.keys import checked
from tests.experiments.explore.cases import CHANGED, READY, SITES, address, evaluated, in_both
from tests.experiments.explore.chromium import Chromium, chromium_needed
from tests.needs import needs

pytestmark = needs("ziglang")

UNSTABLE = {"column.K_tb": 290.0, "column.I2": 0.02}


@pytest.fixture(scope="module")
def pages(tmp_path_factory):
    """Two laws on both chassis."""
    return explore.explore(tmp_path_factory.mktemp("pages") / "page", friction=["lugre", "masing"])


@in_both
def test_metrics_are_those_of_python(page, browser):
    """The whole chain in the browser, whose search for the amplitude begins elsewhere; every law: test_scripts.py."""
    browser.open(address(page, **CHANGED))
    browser.until(READY)
    found, expected = browser.value("steerShown.answer.values"), evaluated("lugre", "single_track", CHANGED)
    assert {name: pytest.approx(value.value, rel=1e-4) for name, value in expected.items()} == found


# What the page tells, once it is loaded.
TOLD = "(document.getElementById('status')?.textContent ?? '').replace(/^Loading.*/, '')"


def test_the_page_opens_in_small_turns_with_another_law_pinned(pages, browser):
    browser.open(pages.as_uri())
    browser.until(f"{READY} && steerShown.pins.A?.answer.exact")
    assert browser.value("[steerShown.answer.manoeuvre, steerShown.pins.A.shown.law]") == ["small-turns", "masing"]
    assert browser.value("document.querySelectorAll('#large canvas').length") == 2
    expected = evaluated("masing", "single_track", {}, "small-turns")["loop_area"].value
    assert browser.value("steerShown.pins.A.answer.values.loop_area") == pytest.approx(expected, rel=1e-4)


@in_both
def test_sites_have_sliders_and_the_metrics_of_python(tmp_path_factory, browser):
    page = explore.explore(tmp_path_factory.mktemp("sites") / "page", friction=[SITES], chassis=["single_track"])
    changed = {"friction.gear.F_c": 1.1, "friction.gear.efficiency": 0.75, "friction.gear.x_c": 0.006}
    changed |= {"friction.gear.load": 1e-4, "friction.upper_column.F_c": 0.12, "friction_scale": 1.2}
    browser.open(address(page, law=quote(SITES), A=quote(f"law={quote(SITES)}"), **changed))
    browser.until(f"{READY} && steerShown.pins.A?.answer.exact")
    found, expected = browser.value("steerShown.answer.values"), evaluated(SITES, "single_track", changed)
    assert {name: pytest.approx(value.value, rel=1e-4) for name, value in expected.items()} == found
    assert found["torque_deadband"] > 1.1 * browser.value("steerShown.pins.A.answer.values.torque_deadband")
    browser.value("document.querySelector('input[type=range][data-name=\"friction.gear.efficiency\"]').focus()")
    browser.key("ArrowRight")
    browser.until("location.hash.includes('friction.gear.efficiency=0.752')")
    shown = browser.value("location.hash")
    assert f"law={quote(SITES, safe='')}" in shown
    browser.open(f"{page.with_name('drive.html').as_uri()}{shown}")
    browser.until("typeof steerDriven === 'object' && steerDriven.ready")
    told = browser.value("document.getElementById('cars').textContent")
    assert "masing,efficiency=0.88 at gear + coulomb,F_c=0.05 at upper column, single track, gear.F_c 1.1" in told


def test_a_weave_of_an_unstable_assist_loop_has_no_metrics(page, browser):
    browser.open(address(page, **UNSTABLE, **{"friction.F_c": 0}))
    told = browser.until(f"{READY} && document.getElementById('status').textContent")
    assert told.startswith(
        "F_c must be finite and greater than 0, got 0; left as the car has it. The assist loop is unstable"
    )
    assert not browser.value("Object.values(steerShown.answer?.values ?? {}).some(Number.isFinite)")


@in_both
def test_a_slider_by_the_keyboard_drives_the_car_anew_and_the_address_repeats_it(page, browser):
    browser.open(address(page))
    browser.until(READY)
    before, run = browser.value("[steerShown.answer.values.torque_deadband, steerShown.answer.id]")
    browser.value("document.querySelector('input[type=range][data-name=\"friction.F_c\"]').focus()")
    for _ in range(40):
        browser.key("ArrowRight")
    browser.until(
        "location.hash.endsWith(`friction.F_c=${document.getElementById('field-friction.F_c').value}`)"
        f" && {READY} > {run}"
    )
    after = browser.value("steerShown.answer.values.torque_deadband")
    assert after > 1.2 * before
    shown = browser.value("document.getElementById('field-friction.F_c').value")
    link = browser.value("location.href")
    assert link.endswith(f"friction.F_c={shown}")
    browser.open("about:blank")
    browser.until("typeof steerShown === 'undefined'")
    browser.open(link)
    browser.until(READY)
    assert browser.value("steerShown.answer.values.torque_deadband") == pytest.approx(after, rel=1e-4)


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


@in_both
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
    """A pinned car is checked too; one that the page does not have is not taken."""
    missing, beyond = "law=moose&chassis=single_track", "law=lugre&chassis=single_track&friction.F_c=-2"
    values = {"column.K_tb": "-5", "column.gone": 1, "A": quote(missing), "B": quote(beyond)}
    browser.open(address(page, law="stiction", **values))
    browser.until(f"{READY} && steerShown.pins.B")
    told = browser.until("document.getElementById('status').textContent")
    for words in (
        "no law stiction", "K_tb must be finite and greater than 0, got -5", "no column.gone", "no law moose",
        "B: F_c must be finite and greater than 0, got -2; left as the car has it.",
    ):  # fmt: skip
        assert words in told
    assert browser.value("Object.keys(steerShown.pins)") == ["B"]


def test_pins_are_laid_over_and_differences_are_told(page, browser):
    browser.open(address(page))
    browser.until(READY)
    browser.value("document.querySelector('button.pin[data-pin=A]').focus()")
    browser.key("Enter")
    browser.until("document.querySelectorAll('#metrics thead th').length === 4")
    browser.value("document.getElementById('field-assist.boost_scale').select()")
    browser.type("0.5")
    browser.until("location.hash.includes('assist.boost_scale=0.5') && steerShown.answer.exact")
    rows = "[...document.querySelectorAll('#metrics tbody tr')]"
    peak = f"{rows}.find((row) => row.textContent.startsWith('peak handwheel torque'))"
    assert browser.value(f"{peak}.querySelector('small.noticed').textContent") == "perceptible"
    assert "A=" in browser.value("location.hash")


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


def test_pins_that_are_removed_while_one_is_driven_stay_away(page, browser):
    browser.open(address(page))
    browser.until(READY)
    browser.value("document.querySelector('button.pin[data-pin=A]').click()")
    browser.value("document.getElementById('unpin').click()")
    browser.value("document.querySelector('button.pin[data-pin=B]').click()")
    browser.until("document.querySelector('#pinned li[data-pin=B]') !== null")
    assert browser.value("document.querySelector('#pinned li[data-pin=A]') === null")


def test_a_manoeuvre_of_a_standing_car_takes_its_chassis_and_pins_along(pages, browser):
    """Parking as Python drives it, and back to a weave on the chassis of before."""
    browser.open(address(pages, A=quote("law=masing&chassis=single_track")))
    browser.until(f"{READY} && document.querySelector('#pinned li') !== null")
    choose(browser, "manoeuvre", "parking")
    browser.until(f"{READY} && steerShown.answer.manoeuvre === 'parking'")
    browser.until("document.querySelectorAll('#metrics thead th').length === 4")
    found = browser.value("[steerShown.answer.values, steerShown.pins.A.answer.values]")
    for values, law in zip(found, ("lugre", "masing")):
        expected = evaluated(law, "two_track", {}, "parking")
        assert values == {name: pytest.approx(value.value, rel=1e-4) for name, value in expected.items()}
    assert browser.value("document.getElementById('chassis').value") == "two_track"
    assert "manoeuvre=parking" in browser.value("location.hash")
    choose(browser, "manoeuvre", "weave")
    browser.until(f"{READY} && steerShown.answer.manoeuvre === 'weave'")
    assert browser.value("document.getElementById('chassis').value") == "single_track"


@chromium_needed
@pytest.mark.parametrize(
    ("file", "keep", "words"),
    [
        ("uplot.js", None, "A file of this page is missing or damaged"),
        ("modules/single_track_lugre.js", 1000, "modules/single_track_lugre.js is damaged"),
    ],
)
def test_a_damaged_folder_is_told(page, tmp_path, file, keep, words):
    shutil.copytree(page.parent, tmp_path / "copy")
    damaged = tmp_path / "copy" / file
    text = damaged.read_text(encoding="utf-8")
    damaged.unlink() if keep is None else damaged.write_text(text[:keep], encoding="utf-8")
    with Chromium(tmp_path / "profile") as found:
        found.open((tmp_path / "copy" / "index.html").as_uri())
        assert words in found.until(TOLD)


def test_a_law_that_cannot_be_loaded_leaves_the_law_before(pages, browser, tmp_path):
    shutil.copytree(pages.parent, tmp_path / "copy")
    (tmp_path / "copy" / "modules" / "single_track_masing.js").unlink()
    browser.open(address(tmp_path / "copy" / "index.html"))
    browser.until(READY)
    choose(browser, "law", "masing")
    browser.until("document.getElementById('status').textContent.includes('could not be loaded')")
    assert browser.value("document.getElementById('law').value") == "lugre"


@in_both
def test_law_and_chassis_that_are_chosen_at_once_are_both_taken(pages, browser):
    browser.open(address(pages))
    browser.until(READY)
    choose(browser, "law", "masing")
    choose(browser, "chassis", "two_track")
    browser.until("location.hash.includes('law=masing') && location.hash.includes('chassis=two_track')")
    assert browser.value("document.getElementById('law').value") == "masing"


def test_a_car_that_cannot_be_driven_is_not_pinned_and_that_is_told(page, browser):
    bad = "law=lugre&chassis=single_track&column.I2=0.005&column.K_tb=300&assist.boost_scale=1.5&assist.damping=0"
    browser.open(address(page, A=quote(bad)))
    told = browser.until(TOLD)
    assert told.startswith("A is not pinned. ")


def choose(browser, name, value):
    browser.value(
        f"((select) => {{ select.value = '{value}'; select.dispatchEvent(new Event('change')); }})"
        f"(document.getElementById('{name}'))"
    )


@chromium_needed
def test_a_phone_has_targets_for_a_finger_and_does_not_scroll_sideways(page, tmp_path):
    """At least 24 px each way, as WCAG 2.2 asks (2.5.8)."""
    with Chromium(tmp_path / "profile", 390, 844) as phone:
        phone.open(address(page))
        phone.until(READY)
        small = phone.value(
            "[...document.querySelectorAll('main :is(button, select, input:not([type=file]), label.file, summary)')]"
            ".filter((one) => one.checkVisibility()).map((one) => [one.outerHTML, one.getBoundingClientRect()])"
            ".filter(([, box]) => box.width < 24 || box.height < 24).map(([html]) => html)"
        )
        assert small == []
        assert phone.value("document.documentElement.scrollWidth <= innerWidth")


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
    browser.until(TOLD)
    assert "which this browser lacks" in browser.value("document.getElementById('status').textContent")


def test_a_page_holds_what_it_should_at_most(page):
    """At most 2 MB to begin with, and 100 kB for a further law."""
    sizes = {path: path.stat().st_size for path in page.parent.rglob("*") if path.is_file()}
    assert sum(sizes.values()) < 2e6
    assert all(size < 1e5 for path, size in sizes.items() if path.parent.name == "modules")
