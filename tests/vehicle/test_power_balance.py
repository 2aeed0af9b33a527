"""The steering's power: hand and motor = friction + dampers + compliance + rack + change of the stored energy.

From what a user records at 1 ms, within 0.5 % of the net work of hand and motor at every time of a manoeuvre.
"""

from itertools import product

import numpy as np
import pytest

from steer_env.vehicle import cars, plant
from steer_env.vehicle.chassis import available
from steer_env.vehicle.layout import plant_layout
from tests.by_law import pairs
from tests.vehicle.test_two_track import CHASSIS, energy
from tests.verification.common import power
from tests.verification.common.two_track_power import at_tie_rods, energies, powers

CAR = cars.load()
RUNS = ("weave", "double-lane-change")


@pytest.fixture(scope="module")
def hands():
    return {name: power.hands(CAR, name) for name in RUNS}


LAWS = ("coulomb", "lugre", "masing")  # the group "power" of the requirements runs every one, led by a robot


@pytest.mark.parametrize(
    ("name", "law", "steered", "chassis"), pairs(product(RUNS, LAWS, ("torque", "arms"), available()))
)
def test_steering_power(hands, name, law, steered, chassis):
    speed, u, torque = hands[name]
    p, u = CAR.plant(law, speed, chassis=chassis), np.zeros_like(u)
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
def test_chassis_power_on_two_tracks(hands, name):
    """What the terms leave of the balance is a ten-thousandth of the losses by lateral slip."""
    speed, u, _ = hands[name]
    p = CAR.plant("lugre", speed, robot=True, chassis="two_track")
    _, passed = power.recorded(p, u, plant.initial_state(p))
    at = plant_layout(p)
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
