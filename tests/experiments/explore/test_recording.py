"""A recording that is laid over: read as Python reads it, shown, removed; and what is refused, in a sentence."""

import pytest

from steer_env import manoeuvres, metrics, recording
from steer_env.manoeuvres.common import driving
from steer_env.vehicle import cars
from tests.experiments.explore.cases import READY, address, in_both
from tests.needs import needs

pytestmark = needs("ziglang")

TOLD = "document.querySelector('#recording p')"
LAID = "[...document.querySelectorAll('#metrics thead th')].some((cell) => cell.textContent.startsWith('R,'))"
DROP = """((...parts) => {
  const dropped = new DataTransfer();
  dropped.items.add(new File(parts, "dropped.csv"));
  dispatchEvent(new DragEvent("drop", { dataTransfer: dropped }));
})(%s)"""
COLUMNS = "time_s,handwheel_angle_deg,handwheel_torque_Nm"
REFUSED = {
    "new Uint8Array(1000)": "it begins with bytes that are no text",
    "''": "it has no line that names its columns",
    "new Uint8Array(2e8)": "it has 200 MB, and this page reads at most 64 MB",
    "'a,b\\n1,2\\n'": "its first line names no column time_s",
    "'time_s,speed_m_s\\n0,1\\n1,2\\n'": "none of its columns is one of handwheel_angle",
    "'time_s,handwheel_torque\\n0,1\\n'": "its column handwheel_torque has no unit",
    "'time_s,handwheel_torque_deg\\n0,1\\n'": "its column handwheel_torque has the unit deg",
    f"'{COLUMNS}\\n'": "it has fewer than two rows of numbers",
    f"'{COLUMNS}\\n0,1,1\\n0.1,0x10,1\\n'": "line 3 has 0x10 where a finite number is needed",
    f"'{COLUMNS}\\n0,1,1\\n0.1,1\\n'": "line 3 has 2 cells, the header has 3",
    f"'{COLUMNS}\\n0,1,1\\n0,1,1\\n'": "line 3 has no time after that of the line before",
    f"'{COLUMNS}\\n0,1,nan\\n0.1,1,\\n0.2,1,1\\n'": "handwheel_torque has no value between 0.000 and 0.2000 s",
    f"'{COLUMNS}\\n0,nan,nan\\n0.1,nan,nan\\n'": "no number is in its columns handwheel_angle, handwheel_torque",
    f"'{COLUMNS}\\n0,1,1e9\\n0.1,1,1\\n'": "handwheel_torque reaches 1.00e+9 N m: its unit cannot be right",
    f"'{COLUMNS}\\n0,1,1\\n0.1,1,1\\n700,1,1\\n'": "it lasts longer than 600 s",
}


@pytest.fixture(scope="module")
def weave():
    """A weave of another law, simulated."""
    car, of = cars.load("compact"), manoeuvres.make("weave")
    return driving.drive_plant(car, driving.build_plant(car, of, "dahl"), of)


@in_both
def test_a_recording_is_laid_over_and_removed(page, browser, weave, tmp_path):
    """Its metrics are those of Python, between whose samples the page draws lines."""
    browser.open(address(page))
    browser.until(READY)
    for rate, close in ((1000.0, 1e-6), (200.0, 2e-3)):
        file = tmp_path / f"weave_{rate:g}.csv"
        recording.write(weave.resampled(rate), file)
        browser.choose_file("#recording input", file)
        browser.until(LAID)
        assert browser.value(f"{TOLD}.textContent") == ""
        assert browser.value("document.querySelector('#recording span').textContent") == f"R: {file.name}, compact"
        expected = metrics.evaluate(recording.read(file), "weave", intervals=False)
        found = browser.value("steerShown.laid().measured.values")
        assert {name: pytest.approx(value.value, rel=close) for name, value in expected.items()} == found
        browser.value("document.querySelector('#recording button').click()")
        assert not browser.value(LAID)


def test_what_is_no_recording_is_refused_in_a_sentence(page, browser):
    browser.open(address(page))
    browser.until(READY)
    for content, words in REFUSED.items():
        browser.value(DROP % content)
        browser.until(f"{TOLD}.className === 'refusal'")
        assert browser.value(f"{TOLD}.textContent").startswith(f"dropped.csv is not shown: {words}")
        browser.value(f"{TOLD}.className = ''")
    assert browser.value("steerShown.laid()") is None


def test_a_recording_of_another_drive_is_shown_as_a_whole(page, browser):
    """With semicolons, decimal commas, brackets and other units."""
    browser.open(address(page))
    browser.until(READY)
    text = "time [ms];handwheel_torque (Ncm);rack_force_kN\\n0;150;2\\n100;100,5;3\\n150;50;1\\n"
    browser.value(DROP % f"'{text}'")
    browser.until(f"{TOLD}.textContent === 'The curves alone are shown: there is no channel handwheel_angle.'")
    shown = browser.value("steerShown.laid().over.shown")
    assert (shown["handwheel_torque"][100], shown["rack_force"][-1]) == (pytest.approx(1.005), pytest.approx(1000.0))


def test_a_recording_is_read_as_the_manoeuvre_that_is_shown(page, browser, tmp_path):
    """A release, which is no weave."""
    car, of = cars.load("compact"), manoeuvres.make("release")
    release = driving.drive_plant(car, driving.build_plant(car, of, "dahl"), of)
    recording.write(release, tmp_path / "release.csv")
    browser.open(address(page))
    browser.until(READY)
    browser.choose_file("#recording input", tmp_path / "release.csv")
    browser.until(f"{TOLD}.textContent === 'The curves alone are shown: its manoeuvre is release.'")
    browser.value(
        "((select) => { select.value = 'release'; select.dispatchEvent(new Event('change')); })"
        "(document.getElementById('manoeuvre'))"
    )
    browser.until(f"{READY} && steerShown.answer.manoeuvre === 'release' && {TOLD}.textContent === ''")
    expected = metrics.evaluate(release, "release", intervals=False)
    found = browser.value("steerShown.laid().measured.values")
    assert {name: pytest.approx(value.value, rel=1e-3) for name, value in expected.items()} == found
