"""``steer-env fit-friction``: from the shipped record and from files to a page, files of laws, and an environment."""

import contextlib
import io
import json
import re
from pathlib import Path

import gymnasium as gym
import numpy as np
import pytest

import steer_env.environments  # noqa: F401
from steer_env import friction, manoeuvres
from steer_env.experiments.cli.common.tables import print_fits
from steer_env.experiments.cli.main import main
from steer_env.experiments.reports import friction_fit, friction_fit_page
from steer_env.friction import level
from steer_env.metrics.common import just_noticeable
from steer_env.recording import files, friction_record
from steer_env.vehicle import cars
from tests.friction.test_bad_input import refused

ROOT = Path(__file__).parents[2]
GUIDE = (ROOT / "docs" / "friction_measurement.md").read_text(encoding="utf-8")
DT = 0.02  # [s]
T = np.arange(0.0, 60.0, DT)
X = 3.0 * np.sin(2.0 * np.pi * 0.1 * T)  # [deg]
DAHL = friction.make("dahl", sigma_0=120.0, F_c=0.9)
NOISE = np.random.default_rng(0).normal(0.0, 0.005, T.size)
F = friction.response(DAHL, np.radians(X), DT) + 0.05 + NOISE  # [N m]


@pytest.fixture(autouse=True)
def _somewhere(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("COLUMNS", "200")


def save(name="mine.csv", header="time_s,displacement_deg,torque_Nm", columns=(T, X, F)):
    rows = "\n".join(",".join(map(repr, row)) for row in np.column_stack(columns).tolist())
    with open(name, "w", encoding="utf-8") as file:
        file.write(f"{header}\n{rows}\n")


def loaded(path):
    with open(path, encoding="utf-8") as file:
        return json.load(file)


def fails(capsys, *words):
    """The one line on standard error with which a command line ends."""
    capsys.readouterr()
    assert main(["fit-friction", *words]) == 2
    return capsys.readouterr().err


def test_the_shipped_record_from_a_fresh_clone(capsys):
    """Two laws of the rig: the bristle beats Coulomb by far, in m and N, which drive no column until they are told."""
    assert main(["fit-friction", "rig", "--law", "dahl", "coulomb", "--out", "rig", "--figures", "figures"]) == 0
    assert {each.stem for each in Path("figures").iterdir()} == {"fitted_loops", "residuals", "law_dahl", "law_coulomb"}
    assert "turned to resist positive motion" in capsys.readouterr().out
    found = loaded("rig/fit.json")
    assert found["record"]["units"] == {"displacement": "m", "torque": "N"}
    assert found["record"]["period"] == pytest.approx(4.0)
    assert found["record"]["samples"] == 20000
    assert (found["best"], found["equals"]) == ("dahl", ["dahl"])
    mean = found["record"]["mean_friction"]
    own = found["record"]["repeats"] / mean
    dahl, coulomb = (found["laws"][law]["held_out"][0] / mean for law in ("dahl", "coulomb"))
    assert own < 0.03 < dahl < 0.17 < 0.7 < coulomb < 0.8  # while moving: Coulomb says nothing at rest
    with refused(["rig/dahl.json", "m and N", "--lever", "--to-column"]):
        gym.make("steer_env/AssistWeave-v3", friction="rig/dahl.json")


def test_the_shipped_record_drives_a_column_as_told():
    """By the radius of a lever or stretched to a column, the parameters scale exactly and the residual not at all."""
    options = {"rig": [], "lever": ["--lever", "0.00796"], "column": ["--to-column", "level=0.9,presliding_deg=0.5"]}
    found = {}
    for name, more in options.items():
        assert main(["fit-friction", "rig", "--law", "dahl", "--rate-hz", "40", "--out", name, *more]) == 0
        found[name] = loaded(f"{name}/fit.json")
    record = found["rig"]["record"]
    for name in ("lever", "column"):
        there, back = found[name]["record"]["factors"], found[name]["laws"]["dahl"]
        assert found[name]["record"]["units"] == {"displacement": "rad", "torque": "N m"}
        p, q = back["friction"], found["rig"]["laws"]["dahl"]["friction"]
        assert p["F_c"] == pytest.approx(there["torque"] * q["F_c"], rel=1e-6)
        assert p["sigma_0"] == pytest.approx(there["torque"] / there["displacement"] * q["sigma_0"], rel=1e-6)
        left = back["held_out"][0] / found[name]["record"]["mean_friction"]
        assert left == pytest.approx(found["rig"]["laws"]["dahl"]["held_out"][0] / record["mean_friction"], rel=1e-6)
        env = gym.make("steer_env/AssistWeave-v3", friction=f"{name}/dahl.json")
        assert env.unwrapped.spec.kwargs["friction"] == p
    assert found["lever"]["record"]["factors"] == pytest.approx({"displacement": 1 / 0.00796, "torque": 0.00796})


@pytest.fixture(scope="module")
def fitted(tmp_path_factory):
    """A folder with a record of one's own, what was fitted to it without ``--out``, and what was printed."""
    folder = tmp_path_factory.mktemp("fitted")
    with pytest.MonkeyPatch.context() as patch, contextlib.redirect_stdout(io.StringIO()) as printed:
        patch.chdir(folder)
        patch.setenv("COLUMNS", "200")
        save()
        assert main(["fit-friction", "mine.csv", "--law", "dahl", "--law", "coulomb"]) == 0
    return folder, printed.getvalue()


def test_a_file_of_ones_own(fitted, monkeypatch):
    monkeypatch.chdir(fitted[0])
    file, all_of_it = loaded("friction_mine/dahl.json"), loaded("friction_mine/fit.json")
    assert file["friction"] == {"law": "dahl", "sigma_0": file["friction"]["sigma_0"], "F_c": file["friction"]["F_c"]}
    for name, true in DAHL._asdict().items():
        assert file["friction"][name] == pytest.approx(true, rel=0.01)
        low, high = file["intervals"][name]
        assert low < file["friction"][name] < high
    assert file["level"] is None
    assert file["residual"] == pytest.approx(0.005, rel=0.2)
    assert all_of_it["best"] == "dahl"
    assert "dahl" not in all_of_it["laws"]["coulomb"]["alike"]


def test_a_result_is_made_again_to_the_bit(fitted, monkeypatch, capsys):
    monkeypatch.chdir(fitted[0])
    for name in ("dahl.json", "index.html"):
        capsys.readouterr()
        assert main(["rerun", f"friction_mine/{name}"]) == 0, capsys.readouterr()


def test_a_fitted_file_stands_for_a_law_on_the_command_line(fitted, capsys):
    given = str(fitted[0] / "friction_mine" / "dahl.json")
    assert main(["run", "rig", "--friction", given, "--rate-hz", "50", "--out", "run.csv"]) == 0
    made = files.read("run.csv")
    assert made.meta["friction"] == "dahl"
    assert made.meta["trace"]["friction"]["dahl.json"]["parameters"] == {
        key: value for key, value in loaded(given)["friction"].items() if key != "law"
    }
    assert main(["rerun", "run.csv"]) == 0, capsys.readouterr()


@pytest.mark.whole
def test_a_weave_of_a_car_gives_the_friction_of_its_column():
    """The default car with LuGre: level, stiffness and growth with the rack force, behind all other torques."""
    run = manoeuvres.drive(cars.load(), manoeuvres.make("weave"), "lugre")
    files.write(run.without("friction_torque", "column_angle", "torsion_bar_torque"), "weave.csv", digits=7)
    words = ["weave.csv", "--law", "lugre", "--vehicle", "compact", "--by-load", "--rate-hz", "100", "--starts", "1"]
    assert main(["fit-friction", *words, "--out", "out"]) == 0
    found, true = loaded("out/lugre.json"), friction.make("lugre")
    steering = cars.load().steering
    growth = steering["friction_load"] * steering["pinion_radius"] / true.F_c  # (F11)
    assert found["friction"]["F_c"] == pytest.approx(true.F_c, rel=0.02)
    assert found["friction"]["sigma_0"] == pytest.approx(true.sigma_0, rel=0.02)
    assert found["level"]["load"] == pytest.approx(growth, rel=0.025)
    assert any("balance of torques with the parameters of compact" in note for note in found["notes"])
    assert found["trace"]["car"]["steering"] == steering


def test_the_record_judges_on_what_was_not_fitted():
    """A law that describes the first part only is caught by the last: the friction doubles there."""
    grown = np.where(T < 40.0, 1.0, 2.0)
    record = friction_record.FrictionRecord(np.radians(X), grown * F, DT, {"displacement": "rad", "torque": "N m"})
    found = friction_fit.collect(record, "grown", ["dahl"], held_out=1.0 / 3.0)
    assert found.first == 2000
    assert found.best.fit.residual < 0.01
    assert found.best.residual > 0.5
    low, high = found.best.interval
    assert low <= found.best.residual <= high
    whole = friction_fit.collect(record, "grown", ["dahl"], held_out=0.0)
    assert whole.first == 0
    assert whole.best.residual == pytest.approx(whole.best.fit.residual, rel=0.1)


def test_the_criterion_charges_for_parameters_and_for_what_is_left():
    """LuGre on a record of Dahl leaves as much and pays for what it determines more, Coulomb for what it leaves."""
    record = friction_record.FrictionRecord(np.radians(X), F, DT, {"displacement": "rad", "torque": "N m"})
    found = friction_fit.collect(record, "own", ["dahl", "lugre", "coulomb"])
    dahl, lugre, coulomb = (next(e for e in found.laws if e.law == law) for law in ("dahl", "lugre", "coulomb"))
    n = 0.5 * T.size
    more = len(lugre.fit.parameters) - len(lugre.fit.undetermined) - 2
    assert found.criterion(dahl) == pytest.approx(0.0, abs=1e-6)
    assert found.criterion(lugre) == pytest.approx(more * np.log(n), abs=10.0)
    assert found.criterion(coulomb) > n
    assert not found.apart(lugre)
    assert found.apart(coulomb)


def test_noise_of_the_displacement_is_told_and_taken_out():
    """0.02 deg over 6 deg of travel: the level within 2 %, and what is left is the torque's noise."""
    noisy = np.radians(X + np.random.default_rng(2).normal(0.0, 0.02, T.size))
    record = friction_record.FrictionRecord(noisy, F, DT, {"displacement": "rad", "torque": "N m"})
    found = friction_fit.collect(record, "noisy", ["dahl"])
    assert "noise of 0.02 deg" in found.record.notes[-1]
    assert found.best.fit.parameters.F_c == pytest.approx(DAHL.F_c, rel=0.02)
    assert found.best.residual < 0.02


def test_a_level_by_load_is_in_the_curve_and_the_file(tmp_path):
    """2e-4 of the level per N, found beside the level itself."""
    load = 2000.0 + 1500.0 * np.sin(2.0 * np.pi * T / 60.0)
    found_level = level.make(load=2e-4)
    torque = friction.response(DAHL, np.radians(X), DT, level.by_sample(found_level, load, X)) + NOISE
    units = {"displacement": "rad", "torque": "N m"}
    record = friction_record.FrictionRecord(np.radians(X), torque, DT, units, load)

    found = friction_fit.collect(record, "loaded", ["dahl"], by_load=True)
    assert found.best.residual == pytest.approx(0.005, rel=0.1)
    friction_fit_page.write(tmp_path / "out", found, {})
    assert loaded("out/dahl.json")["level"]["load"] == pytest.approx(2e-4, rel=0.1)
    assert loaded("out/dahl.json")["friction"]["F_c"] == pytest.approx(DAHL.F_c, rel=0.02)


def test_a_level_by_position_is_in_the_curve_and_the_file():
    """A tenth more at its peak, eighty times in a turn; beside each law stands what it leaves without."""
    x, true = np.radians(X), level.make(position=0.1, order=80.0, peak=0.01)
    scales = level.by_sample(true, np.zeros(T.size), x)
    save(columns=(T, X, friction.response(DAHL, x, DT, scales) + 0.05 + NOISE))
    assert main(["fit-friction", "mine.csv", "--law", "dahl", "--by-position", "--out", "out"]) == 0
    file = loaded("out/dahl.json")
    assert file["level"]["position"] == pytest.approx(0.1, rel=0.1)
    assert file["level"]["order"] == pytest.approx(80.0, rel=0.02)
    assert file["intervals"]["peak"][0] <= 0.01 <= file["intervals"]["peak"][1]
    assert file["held_out"][0] == pytest.approx(0.005, rel=0.1)
    assert file["held_out_alone"] > 5.0 * file["held_out"][0]
    keys = {name: f"steering.friction_{name}" for name in ("position", "order", "peak")}
    car = cars.load("compact", {keys[name]: file["level"][name] for name in keys})
    assert car.plant().level.position == pytest.approx(0.1, rel=0.1)
    with pytest.warns(
        UserWarning, match="set steering.friction_position, steering.friction_order, steering.friction_p"
    ):
        friction.resolve("out/dahl.json")


def test_an_asymmetry_is_told_beside_the_offset(fitted):
    folder, printed = fitted
    assert "an asymmetry of 0.055" in printed
    value, low, high = loaded(folder / "friction_mine" / "dahl.json")["asymmetry"]
    assert low < value < high
    assert value == pytest.approx(0.05 / DAHL.F_c, rel=0.05)


def test_a_record_that_no_law_can_be_fitted_to_gives_no_files(capsys):
    save(columns=(T[:400], X[:400], F[:400]))  # a stroke and a half: nothing reverses in the first part
    assert "record a stroke to and fro" in fails(capsys, "mine.csv", "--held-out", "0.9", "--out", "out")
    assert not Path("out").exists()


def test_a_law_that_is_refused_is_told_and_gives_no_file(tmp_path):
    record = friction_record.FrictionRecord(np.radians(X), F, DT, {"displacement": "rad", "torque": "N m"})
    found = friction_fit.collect(record, "own", ["dahl", "coulomb"])
    refused_law = found.laws[1]._replace(fit=None, refused="no set of it is near this record")
    found = found._replace(laws=(found.laws[0], refused_law), curves={"dahl": found.curves["dahl"]})
    friction_fit_page.write(tmp_path / "out", found, {})
    print_fits(found)
    assert loaded("out/fit.json")["laws"]["coulomb"] == {"refused": "no set of it is near this record"}
    assert sorted(path.name for path in Path("out").iterdir()) == ["dahl.json", "fit.json", "index.html"]


@pytest.mark.parametrize("off", [0.5 * just_noticeable.TORQUE, 2.0 * just_noticeable.TORQUE])
def test_the_verdict_tells_whether_a_driver_would_notice_another_law(off):
    record = friction_record.FrictionRecord(np.radians(X), F, DT, {"displacement": "rad", "torque": "N m"})
    found = friction_fit.collect(record, "own", ["dahl", "coulomb"])
    curve = found.curves["dahl"]
    said = friction_fit_page.verdict(found._replace(curves={"dahl": curve, "coulomb": curve + off}))
    assert said.startswith("Dahl")
    assert ("Coulomb" in said) == (off >= just_noticeable.TORQUE)
    assert f"{off:.2g} N m" in said
    assert len(said.split()) <= 25


def test_one_way_from_rest_to_sliding_is_fitted_as_a_whole():
    x = np.concatenate([np.zeros(100), 0.05 * np.linspace(0.0, 1.0, 1500)])
    torque = friction.response(DAHL, x, DT) + NOISE[: x.size]
    save(columns=(T[: x.size], np.degrees(x), -torque))
    assert main(["fit-friction", "mine.csv", "--law", "dahl"]) == 0
    found = loaded("friction_mine/fit.json")
    assert found["judged_from"] == 0.0
    assert found["laws"]["dahl"]["friction"]["F_c"] == pytest.approx(DAHL.F_c, rel=0.02)
    assert any("goes one way" in text for text in found["laws"]["dahl"]["warnings"])


@pytest.mark.filterwarnings("default")
def test_a_level_that_the_car_has_to_have_is_told_in_one_line(capsys):
    law = {"friction": friction.as_mapping(DAHL), "level": {"load": 0.0, "asymmetry": 0.1}}
    Path("fitted.json").write_text(json.dumps(law), encoding="utf-8")
    assert main(["run", "rig", "--friction", "fitted.json", "--rate-hz", "50", "--out", "run.csv"]) == 0
    said = capsys.readouterr().err.splitlines()
    assert [line for line in said if "steering.friction_asymmetry" in line] == said[:1]
    assert said[0].startswith("steer-env run: warning: fitted.json: the level of this friction (asymmetry 0.1)")


BAD = [
    (["nowhere.csv"], ["nowhere.csv", "No such file"]),
    (["riig"], ["'riig'", "packaged record (rig)"]),
    (["mine.csv", "--law", "dahll"], ["dahll", "dahl"]),
    (["mine.csv", "--held-out", "0.95"], ["--held-out", "at most 0.9", "0.95"]),
    (["mine.csv", "--lever", "0.1", "--to-column"], ["--lever or --to-column"]),
    (["mine.csv", "--lever", "-1"], ["--lever", "greater than 0"]),
    (["mine.csv", "--to-column", "F_c=1"], ["--to-column", "level and presliding_deg", "F_c=1"]),
    (["mine.csv", "--zero", "rack_force"], ["--zero", "--vehicle"]),
    (["mine.csv", "--vehicle", "compact"], ["cannot be separated", "rack_force", "motor_torque"]),
    (["mine.csv", "--vehicle", "compact", "--inertia", "0.1"], ["--inertia", "--vehicle"]),
    (["mine.csv", "--map", "friction=displacement[Nm]"], ["displacement [rad or m]", "names every channel"]),
    (["swapped.csv"], ["exchanged", "--map displacement="]),
    (["forces.csv"], ["rad", "in N", "--lever"]),
    (["mine.csv", "--by-load"], ["no load", "--map load="]),
    (["mine.csv", "--by-load", "--by-position"], ["--by-load and --by-position", "leave one of them out"]),
    (["rig", "--by-position", "2"], ["--by-position ORDER", "--lever"]),
    (["rig", "--by-load"], ["hardly varies (4.995 to 5.004)", "leave --by-load out"]),
    (["mine.csv", "--template", "mine.csv"], ["--template mine.csv exists"]),
    (["mine.csv", "--between", "100", "200"], ["no samples from 100"]),
]


@pytest.mark.parametrize(("words", "contains"), BAD, ids=lambda each: " ".join(each)[:40])
def test_what_is_refused_says_what_to_do(words, contains, capsys):
    save()
    save("swapped.csv", columns=(T, F, X))
    save("forces.csv", header="time_s,displacement_deg,friction_N")
    said = fails(capsys, *words)
    assert said.count("\n") == 1
    for part in contains:
        assert part in said


def test_a_template_offers_the_columns_of_a_record():
    save(header="t [s],pos [mm],load cell [N]")
    assert main(["fit-friction", "mine.csv", "--template", "map.toml"]) == 0
    text = Path("map.toml").read_text(encoding="utf-8")
    for section in ("displacement", "displacement_speed", "friction", "load"):
        assert f"# [channels.{section}]" in text
    assert '# from = "pos [mm]"  # mm, -3 to 3' in text
    assert '# from = "load cell [N]"' in text


def test_the_guide_is_true(monkeypatch, capsys):
    """Its program runs, and the command has every option that it names."""
    monkeypatch.chdir(ROOT)
    (program,) = re.findall(r"^```python\n(.*?)^```", GUIDE, flags=re.DOTALL | re.MULTILINE)
    names = {}
    exec(compile(program, "friction_measurement.md", "exec"), names)
    assert names["record"].of_a_column
    assert names["found"].law == "dahl"
    with pytest.raises(SystemExit):
        main(["fit-friction", "--help"])
    known = capsys.readouterr().out
    named = set(re.findall(r"(--[a-z][a-z-]+)", GUIDE)) - {"--friction"}
    assert len(named) > 10
    assert [option for option in sorted(named) if option not in known] == []
