"""The steering's power: hand and motor = friction + dampers + compliance + rack + change of the stored energy.

From what a user records at 1 ms, within 0.5 % of the net work of hand and motor at every time of a manoeuvre.
"""

from functools import lru_cache
from itertools import product

import numpy as np
import pytest

from steer_env import manoeuvres
from steer_env.manoeuvres.common.driving import run, run_closed
from steer_env.vehicle import cars, plant
from steer_env.vehicle.chassis import available
from steer_env.vehicle.layout import layout_of
from tests.by_law import pairs
from tests.vehicle.test_two_track import CHASSIS, energy
from tests.verification.common import power
from tests.verification.common.two_track_power import at_tie_rods, energies, powers

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


LAWS = ("coulomb", "lugre", "masing")  # the group "power" of the requirements runs every one, led by a robot


@pytest.mark.parametrize(
    ("name", "law", "steered", "chassis"), pairs(product(RUNS, LAWS, ("torque", "robot", "arms"), available()))
)
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


@pytest.mark.parametrize("name", RUNS)
def test_chassis_power_on_two_tracks(name):
    """What the terms leave of the balance is a ten-thousandth of the losses by lateral slip."""
    p = CAR.plant("lugre", RUNS[name], robot=True, chassis="two_track")
    _, passed = power.recorded(p, hands(name)[0], plant.initial_state(p))
    at = layout_of(p)
    passed = passed[passed[:, at.steps] == 0.0]
    x, dx, out = passed[:, CHASSIS], passed[:, at.rate : at.rate_before], passed[:, at.outputs : at.outputs_before]
    rack, force = at_tie_rods(p.chassis.body[0], x, dx, p.pinion_radius * passed[:, [2, 3]])
    power_of = powers(p.chassis, p.strut, x, dx, out, rack)
    total = sum(power_of.values()) + (force * rack[..., 1]).sum(1)
    stored = sum(energies(p.chassis.body[0], p.strut, x, rack[..., 0]).values())
    work = plant.CHASSIS_STEP * np.cumsum(0.5 * (total[1:] + total[:-1]))
    lost = -np.trapezoid(power_of["lateral slip"], dx=plant.CHASSIS_STEP)
    assert np.abs(work - (stored[1:] - stored[0])).max() < 2e-4 * lost
    again = [energy(p, x[i], p.pinion_radius * passed[i, 2]) for i in (0, 1000, 2000)]
    np.testing.assert_allclose(force.sum(1), passed[:, at.rack_force], rtol=1e-9, atol=1e-6)
    np.testing.assert_allclose(stored[[0, 1000, 2000]] - stored[0], np.subtract(again, again[0]), atol=1e-3)
