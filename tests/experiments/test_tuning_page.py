"""The set that is nearest to the constraints, and what the picture of the front shows."""

import re
from types import SimpleNamespace

import numpy as np
import optuna

from steer_env.experiments.calibration import feasibility, tuning_page
from steer_env.experiments.pages import tuning_pictures
from steer_env.targets import Band

UNITS = {"torque_deadband": "N m", "angle_deadband": "deg"}
POSED = SimpleNamespace(bands={name: Band((0.0, 1.0), (-1.0, 2.0)) for name in UNITS})


def trial(number, values, missed):
    names = tuple(UNITS)
    found = optuna.trial.create_trial(
        value=0.0,
        user_attrs={"objectives": [sum(values)], "details": {"metrics": {"smooth": dict(zip(names, values))}}},
        constraints=missed,
    )
    found.number = number
    return found


def test_where_no_set_keeps_the_constraints_the_nearest_is_told():
    far, near = {"phase_20": 0.4, "gain_20": -1.0}, {"phase_20": 0.1, "gain_140": 0.05, "stable": 0.0}
    trials = [trial(0, (0.5, 0.5), far), trial(1, (2.0, 0.5), near)]
    found = feasibility.judge(POSED, trials, tuple(UNITS))
    assert [name for name, _ in found.nearest] == ["phase_20", "gain_140"]


def test_front_shows_or_counts_every_set():
    values = np.array([[0.5, 1.0], [3.0, 0.2], [30.0, 0.4], [1.0, 9.0]])
    ends = tuning_page.ends(values, [(3.0, 0.2), (1.0, 2.5)])
    assert ends[0] > 3.0
    assert ends[1] > 2.5
    assert tuning_page.outside(values, ends) == 2
    drawn = tuning_pictures.front({"TPE": values}, values[:2], {"best": (3.0, 0.2)}, ["return", "effort"], ends)
    shown = tuning_pictures.front({"TPE": values[:2]}, values[:2], {"best": (3.0, 0.2)}, ["return", "effort"], ends)
    assert len(re.findall("<use", drawn)) == len(re.findall("<use", shown))  # those outside are not put on the edge
