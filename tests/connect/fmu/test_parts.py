"""Steering and chassis alone, driven by what the undivided plant in Python exchanges between them."""

import shutil

import numpy as np
import pytest

from steer_env.connect import fmu
from steer_env.vehicle import cars, plant, road
from steer_env.vehicle.chassis import two_track
from steer_env.vehicle.layout import layout_of
from steer_env.vehicle.subsystems.car import NAMED
from tests.connect.fmu.runs import begin, bits, opened, replay

fmpy = pytest.importorskip("fmpy", reason="the extra fmu is not installed")
validation = pytest.importorskip("fmpy.validation", reason="the extra fmu is not installed")
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
    state, at = plant.initial_state(p), layout_of(p)
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
    path = fmu.export(tmp_path / "chassis.fmu", subsystem="chassis", chassis=chassis, cpu="native")
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
    [("lugre", "two_track", True), ("masing", "single_track", True), ("coulomb", "two_track", False)],
)
def test_steering_of_other_laws(tmp_path, law, chassis, robot):
    steering_equals(tmp_path, law, chassis, robot)


@pytest.mark.whole
@pytest.mark.parametrize(
    ("chassis", "changed"), [("single_track", False), ("two_track", False), ("single_track", True)]
)
def test_chassis(tmp_path, chassis, changed):
    chassis_equals(tmp_path, chassis, changed)


def test_the_road_under_each_wheel_is_that_of_the_plant_in_python(tmp_path):
    """A slippery left side on which the car also starts, and a bump whose heights the importer gives: to the bit."""
    ground, level = road.bump(0.04, 1.0, 12.0, friction=(0.4, 0.9)), road.make_road(friction=(0.4, 0.9))
    p, before = (cars.load("compact").plant("lugre", 20.0, chassis="two_track", road=r) for r in (ground, level))
    names, at = [name for name, _ in plant.channels(p)], layout_of(p)
    u = np.zeros((1000, len(plant.INPUTS)))
    u[:, plant.HAND] = 2.0
    state, row = plant.settled(before)  # which would drive over the bump
    record, given = np.zeros((len(u), len(names))), np.zeros((len(u), 8))
    for i in range(len(u)):
        plant.run(p, state, u[i : i + 1], record[i : i + 1], 1)
        distance = state[at.chassis + two_track.DISTANCE]
        a, b = float(p.chassis.body[0].a), float(p.chassis.body[0].b)
        under = [road.height(ground, side, distance + x) for x in (a, -b) for side in (road.LEFT, road.RIGHT)]
        given[i] = [*(z for z, _ in under), *(slope for _, slope in under)]
    path = fmu.export(tmp_path / "car.fmu", chassis="two_track", speed=20.0, cpu="native")
    inputs = [f"road_{what}_{wheel}" for what in ("height", "slope") for wheel in two_track.WHEELS]
    slippery = {f"road_friction_{wheel}": 0.4 if wheel.endswith("left") else 0.9 for wheel in two_track.WHEELS}
    with opened(path, tmp_path / "unit") as (unit, references, _):
        unit.setReal([references[name] for name in slippery], list(slippery.values()))
        begin(unit)
        assert np.array_equal(bits(np.array(unit.getReal([references[name] for name in names]))), bits(row))
        found = replay(unit, references, np.column_stack([u[:, plant.HAND], given]), ["hand_torque", *inputs], names)
    assert np.ptp(record[:, plant.CHANNEL["wheel_load_front_left"]]) > 2000.0
    assert np.array_equal(bits(found), bits(record))


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
