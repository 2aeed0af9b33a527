"""The study of where friction sits, and a report with two sites."""

import json

import matplotlib
import numpy as np
import pytest

from steer_env.experiments.cli.main import main
from steer_env.experiments.pages import style, words
from steer_env.experiments.studies.friction_sites import ABOVE, BASE, EQUAL_LOSS, EQUAL_TORQUE, GEAR
from tests.experiments.first_screen import sentence

pytestmark = pytest.mark.whole


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    """The page and its numbers."""
    out = tmp_path_factory.mktemp("made") / "sites"
    assert main(["study", "friction-sites", "--out", str(out)]) == 0
    return (out / "index.html").read_text(encoding="utf-8"), json.loads((out / "friction-sites.json").read_text())


def test_with_equal_loss_the_loops_are_alike(made):
    areas = made[1]["differences"][EQUAL_LOSS]["weave: loop area"]
    assert all(abs(areas[site]["share"]) < 1e-3 for site in (ABOVE, GEAR))


def test_friction_above_the_bar_leaves_the_angle_alone(made):
    """With the handwheel prescribed the column moves as it does without it; below the bar it lags and is held back."""
    found = made[1]["response_per_s"]
    assert abs(found["above"][0]) < 1e-6 < -1e-2 * found["below"][0]


def test_published_signs(made):
    """Friction above the bar widens the dead band of torque more; other than published, it also costs more response."""
    band, response = made[1]["torque_deadband_nm"], made[1]["response_deg_s_nm"]
    assert band["above"][1] > band["below"][2] > 0.0
    assert response["above"][2] < response["below"][1] < 0.0


def test_a_worm_gear_returns_a_little_less(made):
    """The worse the gear, the more angle is left at every speed; the faster the car, the less."""
    page, numbers = made
    left = numbers["handwheel_angle_after_3s_deg"]
    assert left.pop("speeds_kph") == [0.0, 10.0, 35.0]
    angles = np.array(list(left.values()))
    assert list(left) == ["lower column", "worm gear, efficiency 0.9", "worm gear, efficiency 0.85"]
    assert np.all(np.diff(angles, axis=0) > 0.0)
    assert np.all(np.diff(angles, axis=1) < 0.0)
    assert f"{angles[0, 1]:.1f}" in page


def test_the_page_says_what_to_measure(made):
    page, numbers = made
    assert "metrics tell friction above the torsion bar from friction below" in sentence(page)
    torques = numbers["sliding_torque_nm"]
    assert torques[EQUAL_LOSS][BASE] == torques[EQUAL_TORQUE][BASE] > torques[EQUAL_LOSS][GEAR]


def test_a_report_of_sites_alone(tmp_path):
    """It claims nothing of schemes that were not run, and tells what a worm gear does to the margins."""
    out, laws = tmp_path / "report", ["lugre@column_eps", "masing@gear+coulomb,F_c=0.3@upper_column"]
    assert main(["report", "--friction", *laws, "--out", str(out)]) == 0
    split, two = (json.loads((out / "metrics.json").read_text())["metrics"][law] for law in laws)
    assert two["torque_at_0g"]["value"] > split["torque_at_0g"]["value"]
    page = (out / "index.html").read_text(encoding="utf-8")
    assert f"Friction at several sites ({', '.join(laws)}) is not integrated by the other schemes" in page
    assert "Longest usable step" not in page
    assert "is larger by 1.1 dB, which these margins contain" in page


@matplotlib.rc_context(style.STYLE)
def test_a_legend_of_sites_stays_in_its_picture():
    labels = ["lugre", "lugre@column_eps", "masing,efficiency=0.88@gear+coulomb,F_c=0.05@upper_column"]
    figure = style.new_figure(4.8, 3.0)
    axes = figure.subplots()
    for label in labels:
        axes.plot([0, 1], [0, 1], label=label)
    style.legend(figure, axes)
    figure.canvas.draw()
    room, taken = figure.bbox, figure.legends[0].get_window_extent()
    assert room.x0 <= taken.x0 < taken.x1 <= room.x1
    assert words.law_name(labels[2]) == labels[2]
    assert words.law_name("bouc_wen") == "bouc wen"
