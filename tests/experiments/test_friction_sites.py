"""The study of where friction sits, and a report with two sites."""

import json

import numpy as np
import pytest

from steer_env import friction
from steer_env.experiments.cli.main import main
from steer_env.experiments.reports import report
from steer_env.experiments.reports.report_results import Scope
from steer_env.experiments.studies.friction_sites import ABOVE, BASE, EQUAL_LOSS, EQUAL_TORQUE, GEAR

pytestmark = pytest.mark.whole


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    """The numbers of the study."""
    out = tmp_path_factory.mktemp("made") / "sites"
    assert main(["study", "friction-sites", "--out", str(out)]) == 0
    return json.loads((out / "friction-sites.json").read_text())


def test_with_equal_loss_the_loops_are_alike(made):
    areas = made["differences"][EQUAL_LOSS]["weave: loop area"]
    assert all(abs(areas[site]["share"]) < 1e-3 for site in (ABOVE, GEAR))


def test_friction_above_the_bar_leaves_the_angle_alone(made):
    """With the handwheel prescribed the column moves as it does without it; below the bar it lags and is held back."""
    found = made["response_per_s"]
    assert abs(found["above"][0]) < 1e-6 < -1e-2 * found["below"][0]


def test_published_signs(made):
    """Friction above the bar widens the dead band of torque more; other than published, it also costs more response."""
    band, response = made["torque_deadband_nm"], made["response_deg_s_nm"]
    assert band["above"][1] > band["below"][2] > 0.0
    assert response["above"][2] < response["below"][1] < 0.0


def test_a_worm_gear_returns_a_little_less(made):
    """The worse the gear, the more angle is left at every speed; the faster the car, the less."""
    left = made["handwheel_angle_after_3s_deg"]
    assert left.pop("speeds_kph") == [0.0, 10.0, 35.0]
    angles = np.array(list(left.values()))
    assert list(left) == ["lower column", "worm gear, efficiency 0.9", "worm gear, efficiency 0.85"]
    assert np.all(np.diff(angles, axis=0) > 0.0)
    assert np.all(np.diff(angles, axis=1) < 0.0)


def test_torques_are_equal_where_they_are_to_be(made):
    torques = made["sliding_torque_nm"]
    assert torques[EQUAL_LOSS][BASE] == torques[EQUAL_TORQUE][BASE] > torques[EQUAL_LOSS][GEAR]


def test_a_report_of_sites_alone(tmp_path):
    """It has nothing of schemes that were not run."""
    laws = {law: friction.resolve(law) for law in ("lugre@column_eps", "masing@gear+coulomb,F_c=0.3@upper_column")}
    scope = Scope(tests={"weave": {"cycles": 6}}, widths=(0.0, 1.0), steps=(1e-3,), speeds_kph=(0.0,))
    report.build_report(tmp_path / "report", laws, scope)
    found = json.loads((tmp_path / "report" / "metrics.json").read_text())
    split, two = (found["metrics"][law]["torque_at_0g"]["value"] for law in laws)
    assert two > split
    assert not any(found["real_time"]["laws"].values())
