"""The examples run, in short."""

import importlib.util
from pathlib import Path

import numpy as np

from steer_env.experiments.cli.main import main
from steer_env.vehicle import cars

FOLDER = Path(__file__).parents[1] / "examples"


def load(name):
    spec = importlib.util.spec_from_file_location(name, FOLDER / f"{name}.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def test_train_a_policy(tmp_path):
    found = load("train_a_policy").main(64 * 128, str(tmp_path / "frame.png"))
    assert 0.4 < found["boost table"] < 0.55
    assert np.isfinite(found["policy"])
    assert (tmp_path / "frame.png").stat().st_size > 10_000


def test_compare_drivers():
    found = load("compare_drivers").main(("lugre",), ("preview", "macadam"))
    assert found["lugre", "preview"]["cones_hit"] == 0.0
    assert found["lugre", "macadam"]["steering_work"] > 0.0


def test_tune_assist(tmp_path):
    """The best set is a car file, which the command line drives."""
    path = tmp_path / "tuned.toml"
    own, best = load("tune_assist").main(40, str(path))
    assert best > own
    assert cars.load(path).name == "compact_tuned"
    assert main(["run", "rig", "--vehicle", str(path), "--out", str(tmp_path)]) == 0


def test_plan_by_cross_entropy():
    found = load("plan_by_cross_entropy").main(4.0)
    assert found["cross-entropy"] > found["zero action"]
