"""What the page of a tuning says, and what its pictures show."""

import re
from types import SimpleNamespace

import numpy as np
import optuna
import pytest

from steer_env.experiments.calibration import constraints, feasibility, margin_map, tuning_page
from steer_env.experiments.pages import tuning_pictures
from steer_env.targets import Band
from steer_env.vehicle.steering.margins import Margins

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


def judged(*rows):
    found = feasibility.judge(POSED, [trial(k, *row) for k, row in enumerate(rows)], tuple(UNITS))
    return found, feasibility.sentences(POSED, found, UNITS, "TPE")


def test_verdict_where_no_set_keeps_the_constraints():
    far, near = {"phase_20": 0.4, "gain_20": -1.0}, {"phase_20": 0.1, "gain_140": 0.05, "stable": 0.0}
    found, said = judged(((0.5, 0.5), far), ((2.0, 0.5), near))
    assert [name for name, _ in found.nearest] == ["phase_20", "gain_140"]
    assert said[0] == "Not feasible as far as 2 different sets of TPE show: no set keeps the constraints."
    assert "27 of 30 deg" in said[1]
    assert "5.7 of 6 dB" in said[1]
    text = " ".join(said)
    assert "while the constraints are kept" not in text
    assert "torque dead band is in no set" not in text


def test_verdict_tells_its_number_of_sets():
    kept, missed = {"gain_20": -0.1}, {"gain_20": 0.1}
    _, said = judged(((2.0, 0.5), kept), ((3.0, 0.5), kept), ((0.5, 2.0), missed))
    assert said[0].startswith("Not feasible as far as 3 different sets of TPE show, 2 of which keep the constraints:")
    assert "torque dead band is in no set in its band of 0 to 1 N m" in said[1]
    assert "while the constraints are kept" in said[1]
    _, said = judged(((2.0, 0.5), kept), ((3.0, 0.5), missed))
    assert "while the constraints are kept" not in " ".join(said)
    _, said = judged(((2.0, 0.5), kept))
    assert said[0].startswith("Not feasible as far as one set of TPE shows:")


@pytest.mark.parametrize(
    ("constraint", "violation", "words"),
    [
        ("column_phase_0", 0.5, "the phase margin of the column with fixed hands at 0 km/h, 15 of 30 deg"),
        ("gain_11", 0.25, "the gain margin of the laden car with hands off at 11 km/h, 4.5 of 6 dB"),
        ("free_damping_60", 0.02, "the damping of the free car at 60 km/h, a ratio of -0.02"),
        ("free_pulse_140", 0.5, "at 140 km/h, whose motion does not decay"),
        ("motor_limit", 0.2, "the limit of the motor, of which the boost asks for 1.2 times"),
        ("stable", 1.0, "stability"),
    ],
)
def test_constraints_in_words(constraint, violation, words):
    assert words in constraints.told(constraint, violation)


def test_a_point_of_the_map_tells_its_load():
    margins = Margins(4.0, 0.2, 0.01, 0.4, 5.0, True)
    cell = margin_map.Cell(20.0, 4.0, "off", "friction slides", margins)
    assert cell.where == "20 km/h, 4 N m, hands off, friction slides"
    assert cell._replace(load=300.0).where.endswith("friction slides, 300 kg of load")


def test_front_shows_or_counts_every_set():
    values = np.array([[0.5, 1.0], [3.0, 0.2], [30.0, 0.4], [1.0, 9.0]])
    ends = tuning_page.ends(values, [(3.0, 0.2), (1.0, 2.5)])
    assert ends[0] > 3.0
    assert ends[1] > 2.5
    assert tuning_page.outside(values, ends) == 2
    drawn = tuning_pictures.front({"TPE": values}, values[:2], {"best": (3.0, 0.2)}, ["return", "effort"], ends)
    for word in ("TPE", "best", "Pareto front", "return", "effort"):
        assert word in drawn
    shown = tuning_pictures.front({"TPE": values[:2]}, values[:2], {"best": (3.0, 0.2)}, ["return", "effort"], ends)
    assert len(re.findall("<use", drawn)) == len(re.findall("<use", shown))  # those outside are not put on the edge
