"""Tuning at its edges: own values beyond the usual limits, metrics refused everywhere, a database in the folder."""

import json
import math

import pytest

from steer_env.experiments.calibration import feasibility, problem, search
from steer_env.experiments.cli import tune
from steer_env.experiments.cli.main import parsed
from steer_env.vehicle import cars

pytestmark = pytest.mark.filterwarnings("ignore::steer_env.vehicle.cars.UnusualCar")


def test_an_own_value_beyond_the_usual_limits_stays_in_a_range_that_is_widened():
    car = cars.load("compact")
    for value in (0.06, 12.0):
        data = car.data()
        own = cars.load({**data, "assist": {**data["assist"], "return_gain": 5.0, "return_saturation": value}})
        (r,) = problem.ranges_of(own.assist, ("return_saturation",))
        (wider,) = search.widened((r,), {"return_saturation": value})
        assert wider.low <= value <= wider.high


def test_a_metric_that_is_refused_everywhere_is_written():
    never = feasibility.Closest("yaw_lag", 3.0, 3.0, math.nan, math.nan, ("calm",))
    found = feasibility.Feasibility(2, False, (never,), (), ("yaw_lag",), 0)
    written = json.loads(json.dumps(feasibility.as_json(found), allow_nan=False))
    assert written["never"][0]["low"] is None


def test_a_database_in_the_folder_and_modules_of_ones_own(tmp_path):
    words = ["tune", "--import", "json", "--storage", f"sqlite:///{tmp_path / 'study.db'}", "--out", str(tmp_path)]
    (tmp_path / "study.db").touch()
    with pytest.raises(ValueError, match="has no study that could be resumed"):
        tune.run(parsed([*words, "--resume"]))
    told = tune._words(parsed(words), cars.load(), "best.toml", "after")
    assert told[1:5] == ["--import", "json", "--friction", "lugre@column_eps"]
