"""The front axle of the default car returns from the lock at walking pace; the compliance of each of its wheels."""

import math

import numpy as np
import pytest

from steer_env.vehicle import cars, plant
from steer_env.vehicle.chassis import two_track
from steer_env.vehicle.chassis.two_track import TRAVEL
from steer_env.vehicle.constants import GRAVITY as G
from steer_env.vehicle.suspension.macpherson import WheelLoad, rack_force
from tests.vehicle.test_rack_energy import bare, settled
from tests.vehicle.test_two_track import OUT, code, front_poses, inputs, make, ramp, random_state, straight

CAR = cars.load()
LOCK = CAR.steering["rack_limit"] / CAR.steering["pinion_radius"]
WALKING = [("two_track", 1.0), ("two_track", 2.0), ("single_track", 3.0)]  # chassis, speed [m/s]
WHERE = pytest.mark.parametrize(("chassis", "speed"), WALKING)


def held(chassis, speed, angle):
    """State and last channels (C,) of the car whose handwheel a robot turns to an angle in 4 s and holds for 4 s."""
    p = CAR.plant(speed=speed, chassis=chassis, robot=True)
    state, record = plant.initial_state(p), np.zeros((1, len(plant.channels(p))))
    assert plant.run(p, state, ramp(angle, 8000, 4.0), record, 1)
    return state, record[0]


@WHERE
def test_rack_force_is_towards_the_centre(chassis, speed):
    """From half of the lock to 97 % of it by at least 400 N, a mark of the project."""
    parts = (0.5, 0.6, 0.7, 0.8, 0.9, 0.97)
    force = [held(chassis, speed, part * LOCK)[1][plant.CHANNEL["rack_force"]] for part in parts]
    print(chassis, speed, np.round(force))
    assert min(force) > 400.0


@WHERE
def test_a_released_handwheel_returns(chassis, speed):
    """Released at nine tenths of the lock: after ten seconds at less than 60 % of that angle, a mark of the project."""
    state, _ = held(chassis, speed, 0.9 * LOCK)
    p = CAR.plant(speed=speed, chassis=chassis)
    record = np.zeros((1, len(plant.channels(p))))
    assert plant.run(p, state, inputs(10_000), record, 1)
    angle = record[0, plant.CHANNEL["handwheel_angle"]]
    print(chassis, speed, math.degrees(angle))
    assert -0.1 * LOCK < angle < 0.6 * 0.9 * LOCK


def rates(p, x, rack):
    """What x + T x' of both compliance travels is [m], and the rack force [N]."""
    dx, _, force = code(p, x, rack)
    i = slice(two_track.COMPLIANCE, two_track.COMPLIANCE + 2)
    return x[i] + p.chassis.body[0].T_rack * dx[i], force


@pytest.mark.parametrize("seed", range(3))
def test_the_mean_compliance_is_that_of_one_spring_at_the_rack(seed):
    """Whatever the shares of the wheels; each wheel has it where their forces are equal."""
    p, rng = make(), np.random.default_rng(seed)
    x, rack = random_state(rng), rng.uniform(-0.04, 0.04)
    x[two_track.COMPLIANCE : two_track.COMPLIANCE + 2] = rng.uniform(-1e-3, 1e-3, 2)
    towards, force = rates(p, x, rack)
    assert towards.mean() == pytest.approx(force / CAR.rack_stiffness(), rel=1e-12)


def test_mirrored_cars_have_mirrored_compliance():
    """Left and right change places and sign, to the bit, where the wheels of a straight car are steered."""
    p, x = make(), straight(make())
    (left, right), force = rates(p, x, 0.02)
    (other_left, other_right), other_force = rates(p, x, -0.02)
    assert (left, right, force) == (-other_right, -other_left, -other_force)
    assert left != right


@pytest.mark.parametrize("rack", [-0.06, 0.02, 0.06])
def test_each_wheel_gives_way_to_its_own_force(rack):
    """The statics of each knuckle of a parked car, by the exact strut, less that of the car that stands straight."""
    p, u = bare(), inputs(1, coast=1.0)[0]
    x, d = straight(p), p.chassis.body[0]
    x[:6], x[two_track.OMEGA : two_track.OMEGA + 4] = 0.0, 0.0
    x[two_track.COMPLIANCE : two_track.COMPLIANCE + 2] = 0.0
    settled(p, x, rack)
    towards, _ = rates(p, x, rack)
    _, out, _ = code(p, x, rack, 0.0, u)
    s = x[TRAVEL : TRAVEL + 2]
    beyond = np.maximum(np.abs(s) - d.clearance_f, 0.0)
    past = d.m_f * G + d.B_f * (s - s[::-1]) + np.copysign(d.K_stop * beyond**2 / (beyond + 0.01), s)
    loads = out[OUT["wheel_load_front_left"] :][:2]
    forces = [
        float(rack_force(pose, WheelLoad(F_z=F, F_z_centre=-w)))
        for pose, F, w in zip(front_poses(x, rack), loads, past)
    ]
    straight_ahead = float(rack_force(CAR.strut.straight, WheelLoad(F_z=d.F_zf, F_z_centre=-d.m_f * G)))
    expected = (np.array(forces) - straight_ahead * np.array([1.0, -1.0])) / (0.5 * d.K_rack)
    # the radius of the tyre is that of the design position in the strut
    np.testing.assert_allclose(towards, expected, rtol=0.01, atol=5.0 / d.K_rack)
    assert np.abs(expected).min() > 1e-4


def test_the_toe_of_a_standing_car_is_zero():
    x = straight(make(0.0))
    assert np.abs(x[two_track.COMPLIANCE : two_track.COMPLIANCE + 2]).max() < 1e-12


def test_the_table_of_a_strut_ends_6_mm_beyond_the_stop():
    for name in ("compact", "ford_escort"):
        car = cars.load(name)
        assert -car.kinematics_table.rack_min == pytest.approx(car.steering["rack_limit"] + 0.006, rel=1e-12)
    with pytest.raises(
        ValueError, match=r"^steering.rack_limit must leave the strut 6 mm beyond it, got 0.072: no pose"
    ):
        cars.load(changes={"steering.rack_limit": 0.072})
