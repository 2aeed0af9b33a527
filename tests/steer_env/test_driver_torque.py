"""The torque that driver models know to be needed and give: over the whole range of speeds, cars, loads and roads."""

import gymnasium as gym
import numpy as np
import pytest

import steer_env  # noqa: F401 (registers the ids)
from steer_env import drivers
from steer_env.drivers.common.definition import NEUROMUSCULAR_STATES, TORQUE_LIMIT
from steer_env.drivers.common.known_torque import known_torque
from steer_env.vehicle import cars

IN_LOOP, CONTROLLED = "steer_env/AssistLaneKeeping-v3", "steer_env/DriverLaneKeeping-v3"
SPEEDS = (3.0, 4.0, 5.0, 8.0, 15.0, 30.0, 45.0, 60.0, 70.0)
# About a third above the largest that were found on dry roads; sines of one frequency gave 2338 and -2204.
STIFFNESS, DAMPING = 14.0, 7.5  # [N m/rad], [N m s/rad]


def keeps_lane(name, driver="preview", options=None, **kwargs):
    """Failure code, peak offset [m] and peak hand torque [N m] of an episode of lane keeping without disturbances."""
    env = gym.make(name, **({"driver": driver} if name == IN_LOOP else {}), **kwargs)
    controller, peak, over = drivers.Controller(env, driver) if name == CONTROLLED else None, 0.0, False
    observation, info = env.reset(seed=0, options={"wind": 0, "road": 0, **(options or {})})
    while not over:
        action = np.zeros(1, np.float32) if controller is None else controller.act(observation)
        observation, _, terminated, truncated, info = env.step(action)
        peak, over = max(peak, abs(info["handwheel_torque"])), terminated or truncated
    return info["failure"], info["metrics"]["peak_lateral_offset"], peak


def known(batch, **conditions):
    """Stiffness and damping that a driver knows of."""
    wanted = batch.usual_conditions._replace(**conditions)
    torque = known_torque(batch.car.loaded(wanted.load), wanted, batch.steering_response)
    # What counts the slip takes from the angle's part what the car's motion takes from the slip.
    assert torque.lateral_speed <= 0.0
    assert torque.yaw_rate <= 0.0
    return torque.angle, torque.speed


def check(found, where):
    stiffness, damping = found
    assert 0.3 < stiffness < STIFFNESS, where
    assert 0.0 <= damping < DAMPING, where


@pytest.mark.whole
@pytest.mark.parametrize("chassis", ["single_track", "two_track"])
@pytest.mark.parametrize("car", cars.available())
def test_what_a_driver_knows_is_bounded_at_every_speed(car, chassis):
    batch = gym.make(IN_LOOP, vehicle=car, chassis=chassis).unwrapped.batch
    for speed in SPEEDS:
        check(known(batch, speed=speed), speed)


@pytest.mark.whole
@pytest.mark.parametrize("car", ["compact", "bmw_320i", "vw_vanagon"])
def test_what_an_informed_driver_knows_is_bounded_on_every_road(car):
    """Where the tyres only slide the car gives no torque back, so the stiffness may be zero."""
    batch = gym.make(IN_LOOP, vehicle=car).unwrapped.batch
    for road_friction in (0.1, 0.4, 1.2):
        for load in (0.0, 500.0):
            for speed in (3.0, 22.0, 70.0):
                stiffness, damping = known(batch, speed=speed, load=load, road_friction=road_friction)
                assert 0.0 <= stiffness < STIFFNESS, (road_friction, load, speed)
                assert 0.0 <= damping < DAMPING, (road_friction, load, speed)


@pytest.mark.parametrize(
    ("name", "car", "chassis", "speed"),
    [
        *[(IN_LOOP, "compact", "single_track", speed) for speed in (3.0, 60.0)],
        *[(CONTROLLED, "compact", "single_track", speed) for speed in (3.0, 4.0)],
        (IN_LOOP, "compact", "two_track", 3.0),
        (CONTROLLED, "vw_vanagon", "two_track", 3.0),
        (IN_LOOP, "vw_vanagon", "single_track", 53.0),
        (CONTROLLED, "bmw_320i", "single_track", 60.0),
    ],
)
def test_the_lane_is_kept_at_walking_pace_and_at_top_speed(name, car, chassis, speed):
    failure, offset, torque = keeps_lane(name, vehicle=car, chassis=chassis, speed=speed)
    assert failure == 0
    assert offset < 0.15
    assert torque < 6.0


@pytest.mark.parametrize(("car", "speed", "road_friction"), [("bmw_320i", 45.0, 0.5), ("compact", 45.0, 0.3)])
def test_an_informed_driver_keeps_the_lane_on_a_slippery_road(car, speed, road_friction):
    driver, options = {"driver": "preview", "informed": True}, {"road_friction": road_friction}
    failure, offset, torque = keeps_lane(IN_LOOP, driver, options, vehicle=car, speed=speed)
    assert failure == 0
    assert offset < 0.15
    assert torque < 6.0


@pytest.mark.parametrize("side", [-1.0, 1.0])
def test_hands_in_the_loop_give_at_most_their_limit(side):
    """Hands that intend to be half a turn away: with the impedance in the plant, what they give is just the limit."""
    env = gym.make(IN_LOOP, driver="preview")
    _, info = env.reset(seed=0)
    batch, torques = env.unwrapped.batch, []
    z = batch.drivers.arrays.memory[0, :NEUROMUSCULAR_STATES]
    z[:] = side * np.pi
    z[1] = 0.0  # the speed
    stiffness, damping = batch.drivers.arm.stiffness, batch.drivers.arm.damping
    for update in range(4):
        impedance = stiffness * info["handwheel_angle"] + damping * info["handwheel_speed"]
        *_, info = env.step(np.zeros(1, np.float32))
        torques.append(batch.arrays.scripted_inputs[0, update + 1, 0] - impedance)
        assert abs(info["handwheel_torque"]) < TORQUE_LIMIT
    np.testing.assert_allclose(torques, side * TORQUE_LIMIT, rtol=1e-9)


def test_a_controller_asks_for_at_most_the_limit():
    env = gym.make(CONTROLLED)
    observation, _ = env.reset(seed=0)
    controller = drivers.Controller(env)
    controller.act(observation)
    motion, paths = np.array([[3.0, 5.0, 0.0, 0.0]]), np.zeros((1, 17))
    for side in (1.0, -1.0):
        assert controller._drivers.torque(side * motion, paths)[0] == -side * TORQUE_LIMIT
