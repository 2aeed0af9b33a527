"""``steer-env fit-steering``: from the packaged drive to page, JSON, law and car, and what it refuses."""

import json
import re
from pathlib import Path

import numpy as np
import pytest

from steer_env import friction, identify, manoeuvres
from steer_env.experiments.cli.main import main
from steer_env.experiments.reports import steering_fit
from steer_env.experiments.reports.steering_fit import page_of
from steer_env.hand_torque.drive import FEWEST
from steer_env.recording import Recording
from steer_env.vehicle import cars
from tests.experiments.first_screen import sentence
from tests.synthetic import hand_torque as synthetic

CAN_LOG = Path(__file__).parents[2] / "examples" / "can_log"


@pytest.fixture(scope="module")
def written(tmp_path_factory):
    """The folder that the command writes, with two laws."""
    out = tmp_path_factory.mktemp("drive") / "mkz"
    assert main(["fit-steering", "mkz_2016", "--law", "dahl", "coulomb", "--out", str(out)]) == 0
    return out


def test_the_numbers_stand_in_the_json(written):
    found = json.loads((written / "fit.json").read_text())
    rows = found["rows"]
    assert rows["dahl"]["residual"] < 0.20 < rows["viscous"]["residual"] < rows["none"]["residual"]
    assert found["chosen"] == "dry"
    assert {"ratio", "understeer", "boost"} <= set(found["not_determined"])
    assert found["trace"]["command"][0] == "fit-steering"


def test_the_page_begins_with_one_sentence_and_a_short_table(written):
    page = (written / "index.html").read_text(encoding="utf-8")
    assert len(sentence(page).split()) <= 25
    table = re.search(r'<table id="first">.*?</table>', page, re.DOTALL)
    assert table[0].count("<tr>") <= 11  # with its head
    assert "hands on the wheel are assumed" in page


def test_law_and_car_drive_a_weave(written, tmp_path):
    """The car is the packaged one but for the friction by load, and says what was identified."""
    car = cars.load(written / "car.toml")
    assert car.steering["friction_load"] == 0.0
    assert "identified from the drive mkz_2016" in car.source
    law = json.loads((written / "dahl.json").read_text())
    level = json.loads((written / "fit.json").read_text())["rows"]["dahl"]["level"]
    assert law["friction"]["F_c"] == pytest.approx(level)
    words = ["--vehicle", str(written / "car.toml"), "--friction", str(written / "dahl.json")]
    assert main(["run", "weave", *words, "--out", str(tmp_path / "weave.csv")]) == 0


def test_the_car_file_is_driven_through_the_drive(written, capsys):
    """A car that is not that of the drive leaves more than the equation, and the page says so."""
    found = json.loads((written / "fit.json").read_text())["car_driven"]
    assert 0.3 < found["residual"] < 0.6  # regression; the measured torque has 0.31 N m
    assert 0.2 < found["measured_over_predicted"] < 0.7
    page = (written / "index.html").read_text(encoding="utf-8")
    assert "predicts that torque to 0.4" in page


def test_the_car_that_made_a_drive_predicts_it():
    """To a hundredth of its torque, with the friction of its column; another car does not."""
    car, law = cars.load("compact", {"steering.friction_load": 0.0}), friction.make("dahl")
    made = manoeuvres.drive(car, manoeuvres.make("road", duration=90.0, seed=3), law).resampled(100.0)
    kept = ("handwheel_angle", "torsion_bar_torque", "vehicle_speed")
    channels, units = ({name: each[name] for name in kept} for each in (made.channels, made.units))
    found = identify(Recording(made.time, channels, units), laws=["dahl"])
    best = found.best
    terms = {**best.judged.terms, "T_0": 0.0}
    judged = best.judged._replace(friction=law, terms=terms)
    found = found._replace(rows=(best._replace(judged=judged), found.row("viscous")))
    size = np.std(channels["torsion_bar_torque"])
    own, other = (steering_fit.driven(found, each) for each in (car, cars.load("rear_drive_saloon")))
    assert own.residual < 0.02 * size
    assert own.slope == pytest.approx(1.0, abs=0.02)
    assert other.residual > 3.0 * own.residual


@pytest.mark.filterwarnings("ignore:car compact. boost, limit")
def test_a_car_that_cannot_be_driven_is_told():
    found = identify(synthetic.drive(1, "coulomb", 0.4), laws=["coulomb"])
    unstable = cars.load("compact", {"assist.boost_scale": 9.0, "assist.delay": 0.004})
    assert "unstable" in steering_fit.driven(found, unstable).refused


def refused(capsys, *words):
    """The one line on standard error with which the command line ends."""
    capsys.readouterr()
    assert main(["fit-steering", *words]) == 2
    return capsys.readouterr().err


def test_an_unknown_drive_is_refused(capsys):
    assert "no packaged drive" in refused(capsys, "nothing")


def test_a_torque_in_counts_and_an_assistance_that_steers_are_refused(capsys):
    """The CAN log of another car, whose assistance steered most of the time and whose torque has no calibration."""
    pytest.importorskip("can")
    log = (
        str(CAN_LOG / "rav4_2017_can_60s.log.gz"), "--dbc", str(CAN_LOG / "toyota_rav4_2017.dbc"),
        "--mapping", str(CAN_LOG / "rav4.toml"),
    )  # fmt: skip
    text = refused(capsys, *log)
    assert "counts" in text
    assert "scale=" in text
    text = refused(
        capsys, *log, "--map", "handwheel_torque=STEER_TORQUE_SENSOR.STEER_TORQUE_DRIVER[Nm],scale=0.005",
        "--map", "assistance_active=STEERING_LKA.STEER_REQUEST[1]",
    )  # fmt: skip
    assert "an assistance steers in 85% of the drive" in text


def test_the_program_of_the_guide_runs(monkeypatch):
    root = Path(__file__).parents[2]
    guide = (root / "docs" / "road_drive.md").read_text(encoding="utf-8")
    (program,) = re.findall(r"^```python\n(.*?)^```", guide, flags=re.DOTALL | re.MULTILINE)
    monkeypatch.chdir(root)
    names = {}
    exec(compile(program, "road_drive.md", "exec"), names)
    assert names["torque"].size == names["drive"].time.size


def said(*laws):
    """The page of a drive with Coulomb friction of 0.4 N m to which only these laws were fitted."""
    found = identify(synthetic.drive(1, "coulomb", 0.4), laws=laws)
    assert found.drive.turns > FEWEST
    return page_of(found, "drive", "out").html()


def test_a_law_without_pre_sliding_has_no_sentence_about_it():
    page = said("coulomb")
    assert "with Coulomb" in page
    assert "pre-sliding" not in page


def test_a_page_without_a_law_says_why():
    """That the corrections are too few is said only where they are."""
    page = said("viscous")
    assert "too few corrections" not in page
    assert "no dry law was fitted" in page
