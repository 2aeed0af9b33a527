"""The driving page in a real browser: a drive by keys that Python repeats and evaluates, devices, halts, blind test."""

import time

import numpy as np
import pytest

from steer_env.experiments import explore
from steer_env.experiments.cli.main import main
from steer_env.experiments.explore import parameters
from steer_env.recording import read
from steer_env.vehicle import cars, plant
from steer_env.vehicle.chassis.common.interface import HAND, HAND_SPEED, INPUTS, TARGET_SPEED
from tests.experiments.explore.browser import PATIENCE
from tests.experiments.explore.chromium import Chromium, chromium_needed

pytestmark = chromium_needed
ADDRESS = "law=lugre&chassis=two_track&A=law%3Dlugre%26chassis%3Dsingle_track%26friction_scale%3D2"
KEEP = """(() => {
  globalThis.kept = [];
  steerDriven.worker.addEventListener("message", ({ data }) => { if (data.samples) kept.push(...data.samples); });
})()"""
# A drive stands where a busy machine comes too late; it then goes on, as by a driver's key.
GO_ON = """(() => {
  globalThis.late = 0;
  steerDriven.worker.addEventListener("message", ({ data }) => {
    if (data.stands !== "slow") return;
    late += 1;
    document.body.dispatchEvent(new KeyboardEvent("keydown", { key: "p", bubbles: true }));
  });
})()"""
DRIVEN = "steerDriven.log.samples"


@pytest.fixture(scope="module")
def page(tmp_path_factory):
    folder = tmp_path_factory.mktemp("driven") / "page"
    return explore.explore(folder, friction=["lugre"]).with_name("drive.html")


@pytest.fixture
def browser(tmp_path):
    with Chromium(tmp_path / "profile") as found:
        yield found
        assert found.errors == []


def begin(browser, page, address=ADDRESS):
    """Open the page and wait until a drive can begin."""
    browser.open(f"{page.as_uri()}#{address}")
    browser.until("typeof steerDriven === 'object' && steerDriven.ready")
    browser.value(GO_ON)


def hold(browser, name, seconds):
    """Hold a key."""
    browser.call("Input.dispatchKeyEvent", type="keyDown", key=name)
    time.sleep(seconds)
    browser.call("Input.dispatchKeyEvent", type="keyUp", key=name)


def columns(rows, names):
    """Columns by their names."""
    return dict(zip(names, rows.reshape(-1, len(names)).T))


def driven(browser):
    """Steer to both sides and drive faster, and stand; the samples by the names of their columns."""
    browser.value(KEEP)
    browser.key("p")
    end = time.monotonic() + PATIENCE
    while browser.value(DRIVEN) < 2600:
        assert time.monotonic() < end, browser.value("steerDriven.stands")
        hold(browser, "ArrowLeft", 0.3)
        browser.key("ArrowUp")
        hold(browser, "d", 0.45)
    browser.key("p")
    browser.until("steerDriven.stands === 'asked'")
    return columns(np.array(browser.value("kept")), browser.value("steerDriven.columns"))


def test_a_drive_by_keys_is_that_of_the_native_plant_and_is_read_by_python(page, browser, tmp_path, capsys):
    begin(browser, page)
    browser.value("document.getElementById('manoeuvre').value = 'road'")
    found = driven(browser)
    count = found["x"].size
    assert count == browser.value(DRIVEN) > 2500
    assert browser.value("steerDriven.largest") < 100.0
    assert np.degrees(found["handwheel_angle"].max()) > 10.0
    assert found["target_speed"][-1] >= 5.0 / 3.6
    p, u = parameters.plant(cars.load("compact"), "lugre", "two_track", {}), np.zeros((count, len(INPUTS)))
    for place, name in ((HAND, "handwheel_angle"), (HAND_SPEED, "handwheel_speed"), (TARGET_SPEED, "target_speed")):
        u[:, place] = found[name]
    native = np.empty((count, len(plant.channels(p))))
    plant.run(p, plant.settled(p)[0], u, native, 1)
    for name, values in zip(plant.CHANNEL, native.T):
        assert np.abs(found[name] - values).max() <= 1e-9 * np.ptp(values), name
    path = tmp_path / "drive.csv"
    path.write_text(browser.value("steerDriven.csv()"))
    recording = read(path)
    mean = found["torsion_bar_torque"][: count // 5 * 5].reshape(-1, 5).mean(axis=1)
    np.testing.assert_allclose(recording["torsion_bar_torque"], mean, rtol=1e-6, atol=1e-9)
    assert [each["law"] for each in recording.meta["sets"]] == ["lugre", "lugre"]
    assert recording.meta["sets"][1]["address"] == "law=lugre&chassis=single_track&friction_scale=2"
    assert main(["evaluate", str(path)]) == 1
    assert "and 30 s are needed" in capsys.readouterr().out  # tests/verification/page.py drives a minute
    assert all(url.startswith((page.parent.as_uri(), "blob:", "data:")) for url in browser.requested)


def test_keys_take_other_cars_and_let_the_wheel_go(page, browser):
    begin(browser, page)
    browser.value(KEEP)
    browser.key("p")
    hold(browser, "ArrowLeft", 0.3)
    browser.key("2")
    browser.until("kept.length && kept.at(1 - steerDriven.columns.length) === 2")
    browser.key("h")
    browser.until("steerDriven.now.hold === false")
    time.sleep(0.2)
    browser.key("h")
    browser.until("steerDriven.now.hold")
    browser.key("p")
    found = columns(np.array(browser.value("kept")), browser.value("steerDriven.columns"))
    assert set(found["chosen_set"]) == {1.0, 2.0}
    assert np.abs(np.diff(found["torsion_bar_torque"])).max() < 0.2
    assert (np.abs(found["handwheel_torque"]) < 1e-9).sum() > 150
    told = browser.value("document.getElementById('cars').textContent")
    assert "Friction scale 2" in told


PAD = """(() => {
  const buttons = Array.from({ length: 8 }, () => ({ pressed: false }));
  globalThis.pad = { id: "a pad", index: 0, axes: [0, 0], buttons };
  navigator.getGamepads = () => [pad];
  document.getElementById("device").value = "gamepad";
  document.getElementById("device").dispatchEvent(new Event("change"));
})()"""


def test_a_pad_steers_and_its_buttons_command(page, browser):
    begin(browser, page)
    browser.value(PAD)
    browser.key("p")
    browser.value("pad.axes[0] = -0.525")  # half of the way beyond the dead zone, whose square is a quarter
    browser.until("Math.abs(steerDriven.now.angle * 180 / Math.PI - 45) < 0.1")
    browser.value("(pad.axes[0] = 0, pad.buttons[4].pressed = true)")
    browser.until("Math.round(3.6 * steerDriven.now.held) === 105")
    browser.value("pad.buttons[3].pressed = true")
    browser.until("!steerDriven.now.hold")
    browser.value("pad.buttons[3].pressed = false")
    browser.until("steerDriven.now.hold")


def test_a_hidden_page_stands_and_goes_on_without_skipping_a_sample(page, browser):
    begin(browser, page)
    browser.value(KEEP)
    browser.key("p")
    browser.until(f"{DRIVEN} > 100")
    browser.value("Object.defineProperty(document, 'hidden', { get: () => true, configurable: true })")
    browser.value("document.dispatchEvent(new Event('visibilitychange'))")
    browser.until("document.getElementById('notice').textContent.includes('the page was hidden')")
    stood = browser.value(DRIVEN)
    time.sleep(0.3)
    assert browser.value(DRIVEN) == stood
    browser.key("p")
    browser.until(f"{DRIVEN} > {stood} + 100")
    found = columns(np.array(browser.value("kept")), browser.value("steerDriven.columns"))
    missed = np.flatnonzero(found["deadlines_missed"])
    assert stood in missed
    assert missed.size == 1 + browser.value("late")
    assert found["deadlines_missed"][stood] >= 300
    assert np.diff(found["x"]).max() < 1.01e-3 * 100.0 / 3.6  # the car went on where it stood


POLICY = """((id) => {
  for (const [name, value] of [["course", "double-lane-change"], ["policy", id]]) {
    document.getElementById(name).value = value;
    document.getElementById(name).dispatchEvent(new Event("change"));
  }
})"""


def test_a_policy_drives_through_the_cones_and_hands_take_the_wheel_back(page, browser):
    begin(browser, page)
    for _ in range(4):
        browser.key("ArrowDown")  # to 80 km/h, for which it was trained
    browser.value(f"{POLICY}('steer_env/DriverDoubleLaneChange-v3')")
    browser.until("document.getElementById('notice').textContent.endsWith('drives.')")
    browser.value(KEEP)
    browser.key("p")
    browser.until("steerDriven.now.x > 205")
    browser.value(f"{POLICY}('')")
    browser.until("steerDriven.now.hold")
    found = columns(np.array(browser.value("kept")), browser.value("steerDriven.columns"))
    assert found["y"].max() > 2.5  # in the side lane
    assert found["y"][found["x"] < 150.0].max() < 0.5
    assert np.abs(np.diff(found["torsion_bar_torque"])).max() < 0.2


def test_a_browser_without_webgl_shows_the_drive_from_above(page, browser):
    browser.call(
        "Page.addScriptToEvaluateOnNewDocument",
        source="""const own = HTMLCanvasElement.prototype.getContext;
        HTMLCanvasElement.prototype.getContext = function (kind, ...rest) {
          return kind === "webgl2" ? null : own.call(this, kind, ...rest);
        };""",
    )
    begin(browser, page)
    assert "needs WebGL 2" in browser.value("document.getElementById('status').textContent")


def test_a_blind_test_by_keys_ends_in_a_personal_threshold(page, browser):
    begin(browser, page)
    listed = browser.value("document.getElementById('cars').textContent")
    browser.key("t")
    for k in range(6):
        browser.until(f"document.getElementById('trial').textContent.startsWith('Trial {k + 1}:')")
        browser.call("Input.dispatchKeyEvent", type="keyDown", key="Y" if k % 3 else "X", modifiers=8)
    browser.key("t")
    told = browser.until(
        "/^Your/.test(document.getElementById('trial').textContent) && document.getElementById('trial').textContent"
    )
    assert "personal result of 6 trials, steered by keyboard" in told
    assert browser.value("document.getElementById('cars').textContent") == listed  # neither X nor Y is told
    found = browser.value("steerDriven.threshold")
    assert 0.0 < found["low"] < found["middle"] < found["high"]


def test_the_pages_lead_to_one_another_with_the_address(page, browser):
    browser.open(f"{page.with_name('index.html').as_uri()}#law=lugre&chassis=two_track&friction_scale=2")
    browser.until("typeof steerShown === 'object' && steerShown.answer?.exact")
    browser.value("document.querySelector('a[href^=\"drive.html\"]').click()")
    browser.until("typeof steerDriven === 'object' && steerDriven.ready")
    assert "Friction scale 2" in browser.value("document.getElementById('cars').textContent")
    assert browser.value("document.getElementById('back').href").endswith(
        "#law=lugre&chassis=two_track&friction_scale=2"
    )
