"""The nearest explanation of a difference between simulation and measurement, of pairs whose difference is known."""

import json
import math
import shlex
from dataclasses import replace

import numpy as np
import pytest

from steer_env import friction
from steer_env import recording as recordings
from steer_env.experiments.cli.main import main
from steer_env.experiments.studies.common import comparison_power, explanation, simulation_vs_measurement
from steer_env.experiments.studies.common.explanation import PARAMETERS
from tests.synthetic.recordings import changed
from tests.verification import explanation as pairs

BY_NAME = {each.name: each for each in PARAMETERS}


@pytest.fixture(scope="module")
def clean():
    return pairs.simulated("sine", pairs.own())


@pytest.fixture
def _few(monkeypatch):
    """Two parameters of the car and no other law."""
    monkeypatch.setattr(explanation, "PARAMETERS", (BY_NAME["friction"], BY_NAME["boost"]))
    monkeypatch.setattr(comparison_power, "other_laws", lambda car, law: {})


@pytest.fixture(scope="module")
def stiff():
    """A measurement of a car with 1.4 times the friction and 0.7 times the boost, whose torque sensor is off."""
    at = pairs.own()
    for name, factor in (("friction", 1.4), ("boost", 0.7)):
        at = BY_NAME[name].change(at, math.log(factor))
    return pairs.logged("sine", at, {"handwheel_torque": 0.2}, np.random.default_rng(3))


@pytest.mark.usefixtures("_few")
def test_what_differs_is_named_with_its_amount(clean, stiff):
    found = explanation.explain(stiff, clean, "sine", simulation_vs_measurement.tolerances())
    assert found.explained
    assert found.inside
    friction, boost = found.best.changes
    assert friction.low <= 1.4 <= friction.high
    assert boost.low <= 0.7 <= boost.high
    assert found.offsets["handwheel_torque"].value == pytest.approx(0.2, abs=0.01)
    said = explanation.verdict(found)
    assert "friction 4" in said
    assert "boost " in said
    assert len(said.split()) <= 25


@pytest.mark.usefixtures("_few")
def test_a_difference_of_another_kind_is_not_explained(clean, stiff):
    strong = changed(stiff, handwheel_torque=1.3 * stiff["handwheel_torque"])
    found = explanation.explain(strong, clean, "sine", simulation_vs_measurement.tolerances())
    assert not found.explained
    assert not found.equal
    assert "that were tried explains it" in explanation.verdict(found)


def test_another_motion_of_the_handwheel_is_refused(clean, stiff):
    other = changed(stiff, handwheel_angle=stiff["handwheel_angle"] ** 3 / np.max(stiff["handwheel_angle"]) ** 2)
    with pytest.raises(ValueError, match="steered otherwise than in the simulation, by"):
        explanation.explain(other, clean, "sine", simulation_vs_measurement.tolerances())


@pytest.mark.usefixtures("_few")
def test_the_suggested_car_can_be_validated(clean, stiff, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    for name, found in (("car", stiff), ("model", clean)):
        recordings.write(found, tmp_path / f"{name}.csv")
    assert main(["validate", "car.csv", "model.csv", "--suggest", "own.toml", "--out", "out"]) == 1
    told = json.loads((tmp_path / "out" / "evaluation.json").read_text(encoding="utf-8"))
    assert told["verdict"] == told["explanation"]["in_words"][0]
    assert [*told["explanation"]["nearest"]["changes"]] == ["friction", "boost"]
    (again,) = (line for line in capsys.readouterr().out.splitlines() if line.startswith("steer-env validate"))
    assert main(shlex.split(again)[1:]) == 0
    assert main(["validate", "car.csv", "model.csv", "--suggest", "own.json"]) == 2
    assert "a car file ends in .toml" in capsys.readouterr().err


def test_a_suggested_law_whose_parameters_are_arrays_is_written(clean, tmp_path, monkeypatch, capsys):
    monkeypatch.setattr(explanation, "PARAMETERS", (BY_NAME["friction"],))
    monkeypatch.setattr(comparison_power, "other_laws", lambda car, law: {"gms": friction.make("gms")})
    soft = pairs.own()._replace(law=friction.make("gms", F_c=1.5))
    monkeypatch.chdir(tmp_path)
    for name, found in (("car", pairs.logged("sine", soft, {}, np.random.default_rng(4))), ("model", clean)):
        recordings.write(found, tmp_path / f"{name}.csv")
    assert main(["validate", "car.csv", "model.csv", "--suggest", "own.toml"]) == 1
    assert "--friction own_friction.json" in capsys.readouterr().out
    written = json.loads((tmp_path / "own_friction.json").read_text(encoding="utf-8"))
    assert friction.law_of(friction.resolve(written["friction"])).name == "gms"


def test_without_a_car_to_drive_there_is_no_explanation(clean, stiff):
    bare = replace(clean, meta={key: value for key, value in clean.meta.items() if key != "trace"})
    with pytest.raises(ValueError, match="its trace names no car and law"):
        explanation.explain(stiff, bare, "sine", simulation_vs_measurement.tolerances())


@pytest.mark.whole
@pytest.mark.filterwarnings("ignore::steer_env.vehicle.cars.UnusualCar")  # of the cars of the pairs
def test_the_causes_of_made_pairs_are_named():
    """Six of the pairs of ``verify explanation``, with another seed."""
    assert [row.verdict for row in pairs.rows(6, seed=100)] == ["pass"] * 3
