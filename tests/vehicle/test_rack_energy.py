"""The rack force is the slope of the energy that the steered car stores; ``tests.verification.power`` has the work."""

import numpy as np
import pytest
from scipy.optimize import brentq

from steer_env.vehicle import cars, road
from steer_env.vehicle.chassis import single_track, two_track
from steer_env.vehicle.chassis.two_track import PITCH, ROLL, TRAVEL, TRAVEL_RATE, P, Q, W, Z
from steer_env.vehicle.constants import GRAVITY as G
from steer_env.vehicle.suspension.macpherson import load_coefficients
from tests.vehicle.test_single_track import code as single_track_code
from tests.vehicle.test_two_track import OUT, changed, code, energy, inputs, random_state, straight, tossed

CAR = cars.load()
C = CAR.chassis
RACK = np.linspace(0.0, CAR.steering["rack_limit"], 36)


def bare():
    """The car on two tracks whose tyres have a load only, with bump stops that it touches, at rest."""
    return changed(tossed(), clearance_f=0.002, clearance_r=0.06, T_rack=1e12)


def settled(p, x, rack):
    """The state at rest at a rack position, by Newton's method from the state ``x``."""
    free, rates = [Z, ROLL, PITCH, *range(TRAVEL, TRAVEL + 4)], [W, P, Q, *range(TRAVEL_RATE, TRAVEL_RATE + 4)]
    u = inputs(1, coast=1.0)[0]

    def left_over(y):
        x[free] = y
        return code(p, x, rack, 0.0, u)[0][rates]

    y = x[free].copy()
    for _ in range(6):
        slope = [(left_over(y + e) - left_over(y - e)) / 2e-6 for e in 1e-6 * np.eye(7)]
        y -= np.linalg.solve(np.transpose(slope), left_over(y))
    assert np.abs(left_over(y)).max() < 1e-8
    return x


@pytest.mark.parametrize("seed", range(5))
def test_slope_of_the_energy_two_track(seed):
    """In motion too: weight and inertia of the unsprung mass, anti-roll bar and bump stop pass the strut."""
    p, rng = bare(), np.random.default_rng(seed)
    x, rack, u = random_state(rng, 15.0), rng.uniform(-0.04, 0.04), inputs(1, coast=1.0)[0]
    x[[ROLL, PITCH]], x[two_track.KAPPA : two_track.BORE_ANGLE] = 0.0, 0.0
    slope = (energy(p, x, rack + 1e-5) - energy(p, x, rack - 1e-5)) / 2e-5
    # the radius of the tyre is that of the design position in the strut, and the height of the wheel in the energy
    assert code(p, x, rack, 0.0, u)[2] == pytest.approx(slope, rel=0.005, abs=5.0)


@pytest.mark.parametrize("roll", [0.0, 0.04])
def test_slope_of_the_energy_single_track(roll):
    """Steering at constant strut lengths lifts body and wheels, against loads and an anti-roll bar that stay constant.

    This chassis has no heave, so that the lengths are those at the travel of the roll.
    """
    p, x = CAR.plant(speed=3.0)._replace(tyre=tossed().tyre), np.zeros(len(single_track.STATES))
    x[2], d = roll, p.chassis
    static = 0.5 * G * d.m * d.b / (d.a + d.b)
    loads = static - np.array([1.0, -1.0]) * d.K_f * roll / d.t_f
    carried = 0.5 * G * d.m_uf - np.array([1.0, -1.0]) * C["front_anti_roll"] * roll / d.t_f  # by the wheel itself
    travel = [-0.5 * d.t_f * roll, 0.5 * d.t_f * roll]

    def stored(rack, i, length):
        side = (1.0, -1.0)[i]
        s = brentq(lambda s: float(CAR.strut.solve(side * rack, s).strut_length) - length, -0.06, 0.06, xtol=1e-14)
        pose = CAR.strut.solve(side * rack, s)
        return carried[i] * float(pose.wheel_centre[2]) - loads[i] * float(pose.contact[2])

    def slope(rack):
        lengths = [float(pose.strut_length) for pose in CAR.strut.solve_pair(rack, *travel)]
        return sum(stored(rack + 1e-4, i, l) - stored(rack - 1e-4, i, l) for i, l in enumerate(lengths)) / 2e-4

    force = np.array([single_track_code(p, x, rack)[2] for rack in RACK])
    np.testing.assert_allclose(force[:-1], [slope(rack) for rack in RACK[:-1]], rtol=1e-4, atol=0.01)


def test_rack_force_jumps_where_a_braked_wheel_locks():
    """The brake gives its capacity while the wheel turns, and what the road gives once it rests."""
    p, u = CAR.plant(speed=20.0, chassis="two_track"), inputs(1, coast=1.0, brake=1.0)[0]
    x = straight(p)
    x[two_track.KAPPA : two_track.KAPPA + 4], rack = -1.0, 0.01
    force, out = [], np.zeros(0)
    for omega in (1e-9, 0.0):
        x[two_track.OMEGA] = omega  # the left front wheel
        _, out, value = code(p, x, rack, 0.0, u)
        force.append(value)
    given = abs(out[OUT["road_torque_front_left"]] + 0.5 * out[OUT["front_drive_torque"]])
    pose = CAR.strut.solve(rack - x[two_track.COMPLIANCE], x[TRAVEL])
    work, less = load_coefficients(pose), p.chassis.brakes.front - given
    expected = less / p.chassis.body[0].R_e * float(work.F_x_centre - work.F_x_contact)
    expected -= less * float(pose.per_travel.rotation[1] * work.F_z_centre)  # the wheel falls as its anti-dive is lost
    assert force[1] - force[0] == pytest.approx(expected, rel=1e-4)
    assert abs(expected) > 300.0


def test_a_road_that_rises_under_a_wheel_pushes_it_back():
    """The road pushes normal to its surface, through the wheel's centre; what that takes off the strut is below 1 %."""
    p, force, out = CAR.plant(speed=20.0, chassis="two_track"), [], np.zeros(0)
    x = straight(p)
    for slope in (0.0, 0.05):
        under = road.WheelRoad(slope_front_left=slope)
        _, out, value = code(p._replace(chassis=p.chassis._replace(road=under)), x)
        force.append(value)
    work = load_coefficients(CAR.strut.solve(-x[two_track.COMPLIANCE], x[TRAVEL]))
    pushed = -0.05 * out[OUT["wheel_load_front_left"]]
    assert force[1] - force[0] == pytest.approx(-pushed * float(work.F_x_centre), rel=0.01)
    assert abs(force[1] - force[0]) > 100.0
