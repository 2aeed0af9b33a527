"""The steering's power: hand and motor = friction + dampers + compliance + rack + change of the stored energy.

From what a user records at 1 ms, within 0.5 % of the net work of hand and motor at every time of a manoeuvre.
"""

from functools import lru_cache

import numpy as np
import pytest

from steer_env import friction, manoeuvres
from steer_env.manoeuvres.common.driving import run, run_closed
from steer_env.vehicle import cars, plant, power
from steer_env.vehicle.chassis import available

CAR = cars.load()
KPH = 1.0 / 3.6
RUNS = {"weave": 100.0 * KPH, "lane change": 80.0 * KPH}  # [m/s]


@lru_cache
def hands(name):
    """Inputs of a robot (N, I), and its torque (N,): two cycles of a weave, or the double lane change of ISO 3888-1."""
    if name == "weave":
        manoeuvre = manoeuvres.make("weave")
        p = manoeuvres.build_plant(CAR, manoeuvre, "lugre")
        u = manoeuvres.inputs(manoeuvre, 0.25, 10.0)
        record = run(p, manoeuvre, u)
    else:
        manoeuvre = manoeuvres.make("double-lane-change")
        p = manoeuvres.build_plant(CAR, manoeuvre, "lugre")
        record = run_closed(CAR, p, manoeuvre)
        u = np.zeros((len(record), len(plant.INPUTS)))
        u[:, plant.HAND], u[:, plant.HAND_SPEED] = record[:, :2].T
    return u, record[:, plant.CHANNEL["handwheel_torque"]]


@pytest.mark.parametrize("chassis", available())
@pytest.mark.parametrize("steered", ["robot", "torque", "arms"])
@pytest.mark.parametrize("law", friction.available())
@pytest.mark.parametrize("name", RUNS)
def test_steering_power(name, law, steered, chassis):
    p = CAR.plant(law, RUNS[name], robot=steered == "robot", chassis=chassis)
    u, torque = hands(name)
    if steered != "robot":
        u = np.zeros_like(u)
        u[:, plant.HAND] = torque
    if steered == "arms":
        p = p._replace(column=p.column._replace(I_arm=0.05, C_arm=0.5, K_arm=5.0))
        u *= 2.0
    record, passed = power.recorded(p, u, plant.initial_state(p))
    terms = power.steering(p, record, passed)
    off, given = power.error(terms)
    assert off < 0.005 * abs(given), {name: float(work.sum()) for name, work in terms.items()}
    assert abs(given) > 0.1
    for name in ("friction", "column damper", "compliance lag", "torsion-bar damper"):
        assert terms[name].sum() > 0.0
