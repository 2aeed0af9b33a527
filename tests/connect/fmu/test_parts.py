"""Steering and chassis alone, driven by what the undivided plant in Python exchanges between them."""

import shutil

import numpy as np
import pytest

from steer_env.connect import fmu
from steer_env.vehicle import cars, plant
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
