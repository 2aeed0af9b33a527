"""Steering and chassis alone, driven by what the undivided plant in Python exchanges between them."""

import shutil

import numpy as np
import pytest
from fmpy import validation

from steer_env.connect import fmu
from steer_env.vehicle import cars, plant, road
from steer_env.vehicle.chassis import two_track
from steer_env.vehicle.layout import plant_layout
from steer_env.vehicle.subsystems.car import NAMED
from tests.connect.fmu.runs import begin, bits, opened, replay

if shutil.which("cc") is None:
    pytest.skip("there is no C compiler", allow_module_level=True)

SAMPLES = 4000
COLUMN = [name for name, _ in plant.CHANNELS[:8]]


def undivided(p):
    """Channels (T, C) of a plant in a hard sine, the mean rack force (T,) of each step, and the assist's speed (T,)."""
    t = 1e-3 * np.arange(1.0, SAMPLES + 1.0)
    u = np.zeros((SAMPLES, len(plant.INPUTS)))
    u[:, plant.HAND] = (0.5 if p.robot else 4.0) * np.sin(4.0 * t)
    u[:, plant.HAND_SPEED] = 2.0 * np.cos(4.0 * t) if p.robot else 0.0
    u[:, 2] = 0.5 * np.sin(9.0 * t)
    u[:, 3] = 200.0 * np.sin(2.0 * t)
    u[:, 8] = np.where((t > 1.0) & (t < 2.0), 0.1, 0.0)
    state, at = plant.initial_state(p), plant_layout(p)
    record, force, speed = np.zeros((SAMPLES, len(plant.channels(p)))), np.zeros(SAMPLES), np.zeros(SAMPLES)
    for i in range(SAMPLES):
        s = (state[at.steps] + 0.5) / plant.STEPS_PER_CHASSIS_STEP
        force[i] = state[at.rack_force] + s * (state[at.rack_force] - state[at.rack_force + 1])
        speed[i] = abs(state[at.chassis + two_track.U]) if hasattr(p.chassis, "body") else p.chassis.v_x
        plant.run(p, state, u[i : i + 1], record[i : i + 1], 1)
    return u, record, force, speed


def steering_equals(tmp_path, law, chassis, robot):
    """The exported steering gives the plant's channels under the plant's rack forces."""
    p = cars.load("compact").plant(law, robot=robot, chassis=chassis)
    u, record, force, speed = undivided(p)
    path = fmu.export(tmp_path / "steering.fmu", subsystem="steering", friction=law, robot=robot, cpu="native")
    assert validation.validate_fmu(str(path)) == []
    hands = ["hand_angle", "hand_speed"] if robot else ["hand_torque"]
    columns = [*(u[:, i] for i in range(len(hands))), u[:, 2], force, speed]
    names = [*hands, "assist_request", "rack_force", "vehicle_speed"]
    with opened(path, tmp_path / "unit") as (unit, references, _):
        begin(unit)
        found = replay(unit, references, np.column_stack(columns), names, [*COLUMN, "rack_travel", "rack_speed"])
    rack = p.pinion_radius * record[:, [plant.CHANNEL["column_angle"], plant.CHANNEL["column_speed"]]]
    assert np.ptp(rack[:, 0]) > 1e-3
    assert np.array_equal(bits(found), bits(np.column_stack([record[:, :8], rack])))


def chassis_equals(tmp_path, chassis, changed):
    """The exported chassis gives the plant's rack force and motion under the plant's motion of the rack."""
    p = cars.load("compact").plant("lugre", robot=True, chassis=chassis)
    if changed:
        p = p._replace(chassis=p.chassis._replace(mu=0.7, m=1300.0))
    u, record, _, _ = undivided(p)
    path = fmu.export(tmp_path / "chassis.fmu", friction="lugre", subsystem="chassis", chassis=chassis, cpu="native")
    assert validation.validate_fmu(str(path)) == []
    rack = p.pinion_radius * record[:, [plant.CHANNEL["column_angle"], plant.CHANNEL["column_speed"]]]
    names = ["rack_travel", "rack_speed", *(NAMED[name][0] for name, _ in plant.INPUTS[3:])]
    outputs = [name for name, _ in plant.channels(p)[8:]]
    with opened(path, tmp_path / "unit") as (unit, references, _):
        if changed:
            unit.setReal([references["chassis.mu"], references["chassis.m"]], [0.7, 1300.0])
        begin(unit)
        found = replay(unit, references, np.column_stack([rack, u[:, 3:]]), names, outputs)
    assert np.ptp(record[:, plant.CHANNEL["lateral_acceleration"]]) > 1.0
    assert np.array_equal(bits(found), bits(record[:, 8:]))


def test_steering(tmp_path):
    steering_equals(tmp_path, "lugre", "single_track", False)


@pytest.mark.whole
@pytest.mark.parametrize(
    ("law", "chassis", "robot"),
    [
        ("masing", "two_track", True),
        ("masing,efficiency=0.88@gear+coulomb,F_c=0.1@upper_column", "two_track", False),
    ],
)
def test_steering_of_other_laws(tmp_path, law, chassis, robot):
    steering_equals(tmp_path, law, chassis, robot)


@pytest.mark.whole
@pytest.mark.parametrize(("chassis", "changed"), [("two_track", False), ("single_track", True)])
def test_chassis(tmp_path, chassis, changed):
    chassis_equals(tmp_path, chassis, changed)


def test_the_road_under_each_wheel_is_that_of_the_plant_in_python(tmp_path):
    """A slippery left side on which the car also starts, and a bump whose heights the importer gives: to the bit."""
    ground, level = road.bump(0.04, 1.0, 12.0, friction=(0.4, 0.9)), road.make_road(friction=(0.4, 0.9))
    p, before = (cars.load("compact").plant("lugre", 20.0, chassis="two_track", road=r) for r in (ground, level))
    names, at = [name for name, _ in plant.channels(p)], plant_layout(p)
    u = np.zeros((1000, len(plant.INPUTS)))
    u[:, plant.HAND] = 2.0
    state, row = plant.settled(before)  # which would drive over the bump
    record, given = np.zeros((len(u), len(names))), np.zeros((len(u), 8))
    for i in range(len(u)):
        plant.run(p, state, u[i : i + 1], record[i : i + 1], 1)
        distance = state[at.chassis + two_track.DISTANCE]
        a, b = float(p.chassis.body[0].a), float(p.chassis.body[0].b)
        under = [
            road.height(ground, side, distance + x) for x in (a, -b) for side in (road.LEFT_TRACK, road.RIGHT_TRACK)
        ]
        given[i] = [*(z for z, _ in under), *(slope for _, slope in under)]
    path = fmu.export(tmp_path / "car.fmu", friction="lugre", chassis="two_track", speed=20.0, cpu="native")
    inputs = [f"road_{what}_{wheel}" for what in ("height", "slope") for wheel in two_track.WHEELS]
    slippery = {f"road_friction_{wheel}": 0.4 if wheel.endswith("left") else 0.9 for wheel in two_track.WHEELS}
    with opened(path, tmp_path / "unit") as (unit, references, _):
        unit.setReal([references[name] for name in slippery], list(slippery.values()))
        begin(unit)
        assert np.array_equal(bits(np.array(unit.getReal([references[name] for name in names]))), bits(row))
        found = replay(unit, references, np.column_stack([u[:, plant.HAND], given]), ["hand_torque", *inputs], names)
    assert np.ptp(record[:, plant.CHANNEL["wheel_load_front_left"]]) > 2000.0
    assert np.array_equal(bits(found), bits(record))


def rotations(axis, angles):
    """Rotation matrices (T, 3, 3) about a coordinate axis."""
    c, s = np.cos(angles), np.sin(angles)
    found = np.zeros((len(angles), 3, 3))
    j, k = (axis + 1) % 3, (axis + 2) % 3
    found[:, axis, axis] = 1.0
    found[:, j, j], found[:, k, k], found[:, k, j], found[:, j, k] = c, c, s, -s
    return found


def test_poses_of_the_wheels_are_those_of_a_rigid_body_and_the_exact_strut(tmp_path):
    """A hard turn with braking: positions by rotation matrices, angles by the hard points of the strut.

    The chassis alone has the same poses, to the bit.
    """
    car = cars.load("compact")
    p = car.plant("lugre", 25.0, chassis="two_track")
    d = p.chassis.body[0]
    channels = [name for name, _ in plant.channels(p)]
    parts = ("x", "y", "z", "heading", "inclination")
    poses = [f"wheel_{part}_{wheel}" for part in parts for wheel in two_track.WHEELS]
    u = np.zeros((SAMPLES, len(plant.INPUTS)))
    u[:, plant.HAND] = 5.0 * np.sin(4e-3 * np.arange(1.0, SAMPLES + 1.0))
    u[:, 8] = np.where(np.arange(SAMPLES) < 1500, 0.0, 0.2)
    path = fmu.export(tmp_path / "car.fmu", friction="lugre", chassis="two_track", speed=25.0, cpu="native")
    names = ["hand_torque", None, *(NAMED[name][0] for name, _ in plant.INPUTS[2:])]
    with opened(path, tmp_path / "unit") as (unit, references, _):
        begin(unit)
        wanted = [*channels, *poses]
        first = np.array(unit.getReal([references[name] for name in wanted]))
        found = replay(unit, references, u, names, wanted)
    expected, start = np.zeros((SAMPLES, len(channels))), plant.settled(p)
    plant.run(p, start[0], u, expected, 1)
    assert np.array_equal(bits(found[:, : len(channels)]), bits(expected))  # which the poses leave as they are
    # At odd samples angles and forces are extrapolated since the last evaluation of the chassis.
    rows = np.vstack([first, found[1::2]])
    at = dict(zip(wanted, rows.T))
    roll, pitch, yaw = at["roll_angle"], at["pitch_angle"], at["yaw_angle"]
    assert min(map(np.ptp, (roll, pitch, yaw))) > 0.01
    body = rotations(2, yaw) @ rotations(1, pitch) @ rotations(0, roll)
    origin = np.stack([at["x"], at["y"], at["height"]], -1)
    assert np.array_equal(origin[0, :2], [0.0, 0.0])
    # Rack travel less that of the compliance of each wheel, from the angle of the wheel by Newton's method.
    travel = [at[f"travel_{wheel}"] for wheel in two_track.WHEELS]
    struts = []
    for i, side in enumerate(("left", "right")):
        rack = p.pinion_radius * at["column_angle"]
        for _ in range(4):
            pose = car.strut.solve_pair(rack, travel[0], travel[1])[i]
            rack = rack + (at[f"road_wheel_angle_{side}"] - pose.steer_angle) / pose.per_rack.rotation[..., 2]
        struts.append(car.strut.solve_pair(rack, travel[0], travel[1])[i])
    for i, wheel in enumerate(two_track.WHEELS):
        side = -1.0 if i % 2 else 1.0
        centre = [d.a, 0.5 * side * d.t_f] if i < 2 else [-d.b, 0.5 * side * d.t_r]
        inside = np.stack([*np.broadcast_arrays(*centre, d.R_l - d.h + travel[i])], -1)
        position = origin + (body @ inside[..., None])[..., 0]
        assert np.stack([at[f"wheel_{part}_{wheel}"] for part in "xyz"], -1) == pytest.approx(position, abs=1e-9)
        if i < 2:
            steer, camber = at[f"road_wheel_angle_{('left', 'right')[i]}"], struts[i].inclination
            turned = struts[i].rotation
        else:
            steer = side * d.steer_r * travel[i] + d.compliance_steer_r * at[f"lateral_force_{wheel}"]
            camber = side * d.camber_r * travel[i]
            turned = rotations(2, steer) @ rotations(0, camber)
        heading, inclination = at[f"wheel_heading_{wheel}"], at[f"wheel_inclination_{wheel}"]
        assert heading == pytest.approx(yaw + steer, abs=1e-12)
        assert inclination == pytest.approx(camber + roll, abs=3e-7)  # the table of the strut has errors of 3e-7 rad
        # The tyres take sums of angles; the axle that turns with body and carrier differs by pitch times steer angle.
        x, y, z = np.moveaxis((body @ turned)[..., 1], -1, 0)
        print(wheel, np.abs(np.arctan2(-x, y) - heading).max(), np.abs(np.arcsin(z) - inclination).max())
        assert np.arctan2(-x, y) == pytest.approx(heading, abs=0.01)
        assert np.arcsin(z) == pytest.approx(inclination, abs=0.01)
    rack = p.pinion_radius * found[:, [plant.CHANNEL["column_angle"], plant.CHANNEL["column_speed"]]]
    path = fmu.export(
        tmp_path / "chassis.fmu", friction="lugre", subsystem="chassis", chassis="two_track", speed=25.0, cpu="native"
    )
    names = ["rack_travel", "rack_speed", *(NAMED[name][0] for name, _ in plant.INPUTS[3:])]
    with opened(path, tmp_path / "chassis") as (unit, references, _):
        begin(unit)
        alone = replay(unit, references, np.column_stack([rack, u[:, 3:]]), names, poses)
    assert np.array_equal(bits(alone), bits(found[:, len(channels) :]))


@pytest.mark.whole
def test_end_stops_belong_to_the_steering(tmp_path):
    """A hand torque of 60 N m winds the rack against the stop, which holds it."""
    p = cars.load("compact").plant()
    path = fmu.export(tmp_path / "steering.fmu", subsystem="steering")
    with opened(path, tmp_path / "unit") as (unit, references, _):
        begin(unit)
        held = replay(unit, references, np.full((3000, 1), 60.0), ["hand_torque"], ["rack_travel", "rack_speed"])[-1]
    assert p.rack_limit < held[0] < p.rack_limit + 0.01
    assert abs(held[1]) < 1e-3
