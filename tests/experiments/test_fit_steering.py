"""``steer-env fit-steering``: from the packaged drive to page, JSON, law and car, and what it refuses."""

import dataclasses
import json
import re
from functools import cache
from pathlib import Path

import numpy as np
import pytest

from steer_env import friction, identify, manoeuvres
from steer_env.experiments.calibration import column_fit
from steer_env.experiments.cli.main import main
from steer_env.experiments.reports import steering_fit
from steer_env.experiments.studies.common.friction_records import road_drive
from steer_env.friction import sites
from steer_env.hand_torque import prepared
from steer_env.hand_torque.model import stretched
from steer_env.recording import Recording
from steer_env.vehicle import cars
from tests.needs import needs
from tests.synthetic import hand_torque as synthetic
from tests.synthetic.faults import NOISE

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
    assert rows["dahl"]["residual"] < 0.18 < rows["viscous"]["residual"]
    assert found["unseen"]["adds_interval"][0] > 0.0
    assert found["chosen"] == "dry"
    assert {"ratio", "understeer"} <= set(found["not_determined"])
    assert found["trace"]["command"][0] == "fit-steering"


def test_the_fitted_car_drives_a_weave(written, tmp_path):
    """The car has the boost and the friction that were identified, and says so."""
    car = cars.load(written / "car.toml")
    assert car.steering["friction_load"] == 0.0
    assert "identified from mkz_2016" in car.source
    law = json.loads((written / "friction.json").read_text())
    level = json.loads((written / "fit.json").read_text())["car"]["terms"]["F_c"]["value"]
    assert law["friction"]["F_c"] == pytest.approx(level)
    words = ["--vehicle", str(written / "car.toml"), "--friction", str(written / "friction.json")]
    assert main(["run", "weave", *words, "--out", str(tmp_path / "weave.csv")]) == 0


def test_the_fitted_car_predicts_the_drive(written):
    """On the part that was not fitted; the packaged car leaves 0.44 N m there, and a constant 0.31."""
    found = json.loads((written / "fit.json").read_text())
    car, best = found["car"], found["rows"]["dahl"]
    assert best["residual"] < car["residual"] < 0.21  # regression
    assert car["adds_interval"][0] < car["adds"] < car["adds_interval"][1]
    assert "no handwheel_torque" in car["one_site"]


BAR = ("torsion_bar_torque",)


def made_by(car, law, seed=3, torques=BAR, noise=0.0):
    """A free drive of a car, as its logger would keep it; ``noise`` is a factor on that of its sensors."""
    made = manoeuvres.drive(car, manoeuvres.make("road", duration=90.0, seed=seed), law).resampled(100.0)
    kept, rng = ("handwheel_angle", *torques, "vehicle_speed"), np.random.default_rng(seed)
    channels = {name: made[name] + noise * NOISE[name] * rng.standard_normal(made.time.size) for name in kept}
    return Recording(made.time, channels, {name: made.units[name] for name in kept})


@pytest.mark.whole
def test_the_car_that_made_a_drive_is_found():
    """Boost, damping and friction that a drive was made with are found from those of the packaged car."""
    base = cars.load("compact", {"steering.friction_load": 0.0})
    true = {"s": 4.0, "T_d": 0.3, "D": 1.5, "F_c": 0.7, "x_c": np.radians(0.4)}
    assist = {f"assist.{key}": value for key, value in column_fit.changes(base, true, 100.0 / 3.6).items()}
    car, law = cars.load(base.data(), assist), stretched("dahl", true["F_c"], true["x_c"])
    drive = made_by(car, law)
    found = column_fit.fit_column(identify(drive, laws=["dahl"]), base)
    assert found.residual < 0.01 * np.std(drive["torsion_bar_torque"])
    assert found.adds_interval[0] > 0.0
    assert found.limited == ()
    assert "no handwheel_torque" in found.one_site
    assert {*found.terms} == {*true}  # and no bank: at one speed it would not be told from the car's lag
    for name, value in true.items():
        assert found.terms[name] == pytest.approx(value, rel=0.05), name
        low, high = found.intervals[name]
        assert low <= found.terms[name] <= high
    boosts = (np.array(each.data()["assist"]["boost"]) for each in (found.car, car))
    np.testing.assert_allclose(*boosts, rtol=0.05, atol=0.05)


HANDS_AND_MOTOR = ("handwheel_torque", "motor_torque")
TRUTHS = {  # friction above the torsion bar, and Masing friction below it [N m]; ``whole``: a fit takes half a minute
    "both": ({"law": "coulomb", "F_c": 0.2}, 0.7),
    "above": ({"law": "coulomb", "F_c": 0.3}, 0.0),
    "below": (None, 0.8),
}


@cache
def told(truth, torques=HANDS_AND_MOTOR):
    """What is identified, and the car, from a drive with noise whose friction is known."""
    base = cars.load("compact", {"steering.friction_load": 0.0})
    above, level = TRUTHS[truth]
    below = stretched("masing", level, np.radians(0.4)) if level else None
    given = {name: law for name, law in (("upper_column", above), ("gear", below)) if law}
    found = identify(made_by(base, given, torques=torques, noise=1.0), laws=["masing"])
    return found, column_fit.fit_column(found, base)


@pytest.mark.parametrize(
    ("truth", "torques"),
    [
        ("both", HANDS_AND_MOTOR),
        pytest.param("above", HANDS_AND_MOTOR, marks=pytest.mark.whole),
        pytest.param("below", HANDS_AND_MOTOR, marks=pytest.mark.whole),
        pytest.param("both", ("handwheel_torque", *BAR), marks=pytest.mark.whole),
    ],
)
def test_friction_above_the_bar_is_told_from_friction_below(truth, torques):
    """The boost of the car that drove is not (H3), and its chassis has one track, where that of the fit has two."""
    above, level = TRUTHS[truth]
    true = {"F_u": above["F_c"] if above else 0.0, "F_c": level}
    _, fit = told(truth, torques)
    assert fit.one_site == ""
    for name, value in true.items():
        low, high = fit.intervals[name]
        print(f"{truth}: {name} {fit.terms[name]:.3f} [{low:.3f}, {high:.3f}], truth {value}")
        assert low <= value <= high
        assert high - low < 0.35
        assert fit.terms[name] == pytest.approx(value, abs=0.08)
    assert fit.shown == {name: value > 0.0 for name, value in true.items()}


@pytest.mark.whole
def test_what_is_told_of_both_sites_drives_a_car(tmp_path):
    found, fit = told("both")
    steering_fit.write(tmp_path / "out", found, ["drive"], fit, {"command": []})
    held = friction.resolve(tmp_path / "out" / "friction.json")
    assert friction.as_mapping(held) == friction.as_mapping(fit.friction)
    assert sites.sliding_torque(held.upper_column.law) == pytest.approx(fit.terms["F_u"])
    assert sites.sliding_torque(held.lower_column.law) == pytest.approx(fit.terms["F_c"])
    again = cars.load(tmp_path / "out" / "car.toml")
    assert again.tyre.coefficients.QDZ1 == pytest.approx(fit.terms["n"] * cars.load().tyre.coefficients.QDZ1)


@pytest.mark.parametrize(
    ("torques", "why"),
    [
        (BAR, "no handwheel_torque"),
        (("handwheel_torque",), "no motor_torque or torsion_bar_torque beside it"),
        (HANDS_AND_MOTOR, ""),
    ],
)
def test_a_drive_that_cannot_tell_the_sites_says_so(torques, why):
    drive = prepared(made_by(cars.load("compact"), "masing", torques=torques))
    said = column_fit.one_site(drive)
    assert why in said
    assert said.startswith("the drive cannot tell friction above the torsion bar from friction below it") == bool(why)


def test_too_little_of_a_drive_and_a_car_without_boost_are_told():
    found = identify(synthetic.drive(1, "coulomb", 0.4), laws=["coulomb"])
    with pytest.raises(ValueError, match="compact has no boost at"):
        column_fit.fit_column(found, cars.load("compact", {"assist.boost_scale": 0.0}))
    late = found.drive._replace(weight=np.where(found.drive.time < 60.0, 0.0, found.drive.weight))
    with pytest.raises(ValueError, match=r"s of the fitted part can be compared with a car, and 45 s are needed"):
        column_fit.fit_column(found._replace(drives=(late,)), cars.load("compact"))


def test_a_drive_that_no_friction_of_a_car_describes_is_told():
    """An angle [deg] taken for the torque, and the torque for an angle [deg]: the friction ends at a limit."""
    drive = road_drive("mkz_2016_traffic")
    angle, torque = np.degrees(drive["handwheel_angle"]), np.radians(drive["torsion_bar_torque"])
    exchanged = {**drive.channels, "handwheel_angle": torque, "torsion_bar_torque": angle}
    found = identify(dataclasses.replace(drive, channels=exchanged), laws=["dahl"])
    with pytest.raises(ValueError, match="F_c ends at the limit of the search, 6 N m; are channels exchanged"):
        column_fit.fit_column(found, cars.load("compact"))


@pytest.mark.filterwarnings("ignore:car compact. boost, limit")
def test_a_car_that_cannot_be_driven_is_told(tmp_path, capsys):
    out = tmp_path / "out"
    words = ("--law", "coulomb", "--set", "assist.delay=0.004", "--set", "column.K_tb=300", "--out", str(out))
    assert main(["fit-steering", "mkz_2016", *words]) == 0
    assert "no car is written: drive: the assist loop is unstable" in capsys.readouterr().out
    assert not (out / "car.toml").exists()


def test_two_drives_of_one_car(tmp_path, capsys):
    """One steering from a packaged drive and a file of its own, whose columns ``--map`` names."""
    out, paths = tmp_path / "out", [str(tmp_path / folder / "own.csv") for folder in "ab"]
    for seed, path in zip((4, 5), paths):
        made = synthetic.traffic(seed, "dahl", 0.3, duration=150.0)
        table = np.column_stack([made.time, *(made[name] for name in synthetic.UNITS)])
        Path(path).parent.mkdir()
        np.savetxt(path, table, delimiter=",", header="t[s],SWA[rad],EPS_Tq[Nm],v[m/s]", comments="")
    told = ["--map", "handwheel_angle=SWA", "--map", "torsion_bar_torque=EPS_Tq", "--map", "vehicle_speed=v"]
    assert main(["fit-steering", *paths, *told, "--law", "dahl", "--out", str(out)]) == 0
    found = json.loads((out / "fit.json").read_text())
    assert [(each["fitted_on"], each["judged_on"]) for each in found["across"]] == [("own", "own_2"), ("own_2", "own")]
    assert len(found["by_each_drive"]["level"]["intervals"]) == 2
    assert "level" not in found["differ"]
    assert "fitted on own and judged on own_2" in capsys.readouterr().out
    assert len(found["car"]["offsets"]) == 2
    assert main(["fit-steering", paths[0], paths[0], *told, "--out", str(out)]) == 2
    assert "the same" in capsys.readouterr().err
    assert main(["fit-steering", "mkz_2016", "nothing.csv"]) == 2
    assert "nothing.csv" in capsys.readouterr().err


def refused(capsys, *words):
    """The one line on standard error with which the command line ends."""
    capsys.readouterr()
    assert main(["fit-steering", *words]) == 2
    return capsys.readouterr().err


def test_an_unknown_drive_is_refused(capsys):
    assert "no packaged drive" in refused(capsys, "nothing")


def test_mappings_and_packaged_drives(capsys):
    """What the options say of drives that have mappings of their own."""
    assert "2 mappings are given for 1 drives" in refused(capsys, "mkz_2016", "--mapping", "a.toml", "b.toml")
    text = refused(capsys, "mkz_2016", "mkz_2016_traffic", "--mapping", "a.toml")
    assert "1 mappings are given for 2 drives, of which 2 packaged" in text
    text = refused(capsys, "mkz_2016", "own.csv", "--map", "vehicle_speed=v")
    assert "mkz_2016, which is packaged, has names of its own" in text


def test_drives_with_other_torques(tmp_path, capsys):
    """A car is fitted to drives with the same ones, and what one has alone can be left out of all."""
    found = synthetic.fitted()
    other = found.drive._replace(torques=dict.fromkeys(HANDS_AND_MOTOR, found.drive.torque))
    with pytest.raises(ValueError, match=r"torsion_bar_torque and handwheel_torque, motor_torque.*--without NAME"):
        column_fit.fit_column(
            found._replace(drives=(found.drive, other), firsts=2 * found.firsts), cars.load("compact")
        )
    made = synthetic.packaged()
    columns = [made.time, *(made[name] for name in synthetic.UNITS)]
    header = "t[s],handwheel_angle[rad],torsion_bar_torque[Nm],vehicle_speed[m/s]"
    for name, extra in (("a", {}), ("b", {",motor_torque[Nm]": 3.0 * made["torsion_bar_torque"]})):
        path = tmp_path / f"{name}.csv"
        np.savetxt(
            path,
            np.column_stack([*columns, *extra.values()]),
            delimiter=",",
            header=header + "".join(extra),
            comments="",
        )
    paths = [str(tmp_path / f"{name}.csv") for name in "ab"]
    assert main(["fit-steering", *paths, "--without", "motor_torque", "--out", str(tmp_path / "out")]) == 2
    out, err = capsys.readouterr()
    assert "a.csv: has no motor_torque" in out
    assert "drives 1 and 2 are the same" in err
    assert "motor_torque" in refused(capsys, paths[0], "--without", "motor_torque", "--out", str(tmp_path / "out"))


@needs("can", "cantools")
def test_a_torque_in_counts_and_an_assistance_that_steers_are_refused(capsys):
    """The CAN log of another car, whose assistance steered most of the time and whose torque has no calibration."""
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
