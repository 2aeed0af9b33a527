"""Driver models on courses: cones on every car, longer control intervals, known loads, and the torque they give."""

from itertools import product

import gymnasium as gym
import numpy as np
import pytest

import steer_env  # noqa: F401 (registers the ids)
from steer_env import drivers
from steer_env.drivers.common.known_torque import acceleration_gain, known_torque
from steer_env.engine import infos
from steer_env.registration import id_of
from steer_env.vehicle import cars, plant
from steer_env.vehicle.analysis import linear
from tests.by_law import pairs

KPH = 1.0 / 3.6
DRIVERS, CHASSIS, CONTROL_DT = ("preview", "robot", "macadam"), ("two_track", "single_track"), (0.01, 0.05)
LANE_CHANGE, SWERVE = "steer_env/DriverDoubleLaneChange-v3", "steer_env/DriverObstacleAvoidance-v3"


def driven(name, driver, *, n, options=None, **kwargs):
    """Metrics of n episodes, drawn with fixed seeds."""
    env = gym.make_vec(name, n, vectorization_mode="vector_entry_point", **kwargs)
    controller = drivers.Controller(env, driver)
    observations, _ = env.reset(seed=list(range(n)), options=options)
    metrics = [None] * n
    while None in metrics:
        observations, _, terminated, truncated, info = env.step(controller.act(observations))
        for i in np.flatnonzero(terminated | truncated).tolist():
            metrics[i] = metrics[i] or infos.row(info["metrics"], i)
    env.close()
    return metrics


def cones(*args, **kwargs):
    return [metrics["cones_hit"] for metrics in driven(*args, **kwargs)]


SWERVES = pairs(product(DRIVERS, CHASSIS, CONTROL_DT))


@pytest.mark.parametrize(
    ("driver", "chassis", "control_dt", "kph"),
    [
        *(("preview", *each, 53.0) for each in product(CHASSIS, CONTROL_DT)),
        *(pytest.param(*each, 50.0, marks=pytest.mark.whole) for each in SWERVES),
        pytest.param("preview", "two_track", 0.01, 30.0, marks=pytest.mark.whole),
    ],
)
def test_the_obstacle_is_avoided_without_a_cone(driver, kph, chassis, control_dt):
    """To both sides, from all drawn entries. Drivers with one effort [m/rad] cut the corner and hit the same cone."""
    assert not any(cones(SWERVE, driver, n=16, speed=kph * KPH, chassis=chassis, control_dt=control_dt))


@pytest.mark.parametrize(
    ("car", "driver", "chassis", "control_dt"),
    [
        pytest.param(*each, marks=[] if each[0] == "bmw_320i" else pytest.mark.whole)
        for each in pairs(product(cars.available(), DRIVERS, CHASSIS, CONTROL_DT))
    ],
)
def test_every_car_is_taken_through_the_double_lane_change(car, driver, chassis, control_dt):
    """ISO 3888-1 at 80 km/h, with one effort and one preview time for all cars."""
    assert not any(cones(LANE_CHANGE, driver, n=12, vehicle=car, chassis=chassis, control_dt=control_dt))


def test_two_points_take_the_lane_change_up_to_55():
    """The speed that the driver's docstring tells."""
    assert not any(cones(LANE_CHANGE, "two_point", n=8, speed=55.0 * KPH))


@pytest.mark.parametrize("conditions", [{"load": 500.0}, {"load": 400.0, "road_friction": 0.5}])
def test_an_informed_driver_allows_for_load_and_grip(conditions):
    told, not_told = (
        driven(LANE_CHANGE, drivers.make("preview", informed=informed), n=8, options=conditions)
        for informed in (True, False)
    )
    assert not any(metrics["cones_hit"] for metrics in told)
    assert min(metrics["cones_hit"] for metrics in not_told) >= 1.0


def test_an_informed_driver_in_the_loop_is_told_as_well():
    """Unladen he has the gains of every driver; with a load he has those for the loaded car."""
    gains = {}
    for informed in (True, False):
        for load in (0.0, 300.0):
            env = gym.make("steer_env/AssistLaneChange-v3", driver={"driver": "preview", "informed": informed})
            env.reset(seed=0, options={"load": load})
            gains[informed, load] = env.unwrapped.batch.drivers.arrays.gains[0]
    assert np.array_equal(gains[True, 0.0], gains[False, 300.0])
    assert not np.allclose(gains[True, 300.0], gains[True, 0.0], rtol=0.02)


@pytest.mark.parametrize(
    ("name", "driver", "speed"),
    [
        pytest.param(*each, marks=[] if each[0] == "DriverLaneKeeping" else pytest.mark.whole)
        for each in pairs(product(("DriverLaneKeeping", "DriverWindingRoad"), DRIVERS, (10.0, 30.0, 60.0)))
    ],
)
def test_a_held_torque_keeps_the_lane_as_well(name, driver, speed):
    """At 50 ms the offset is at most a tenth and a centimetre more than at 10 ms, and no handwheel oscillates.

    The robot's arms of 200 N m/rad made a limit cycle before they were softened for the interval.
    """
    fine, held = (driven(id_of(name), driver, n=3, speed=speed, control_dt=dt) for dt in (0.01, 0.05))
    for a, b in zip(fine, held):
        assert b["rms_lateral_offset"] < 1.1 * a["rms_lateral_offset"] + 0.01
        assert b["rms_handwheel_speed"] < 1.7 * a["rms_handwheel_speed"] + 0.01


def test_a_controller_takes_scaled_observations():
    actions = {}
    for normalise in (True, False):
        env = gym.make(LANE_CHANGE, normalise=normalise)
        observation, _ = env.reset(seed=0, options={"entry_offset": 0.2})
        controller, given = drivers.Controller(env), []
        for _ in range(20):
            given.append(controller.act(observation))
            observation, *_ = env.step(given[-1])
        actions[normalise] = given
    assert abs(actions[True][-1]) > 0.01
    np.testing.assert_allclose(actions[True], actions[False], rtol=1e-4, atol=1e-5)


@pytest.mark.parametrize("speed", [50.0 * KPH, 80.0 * KPH])
@pytest.mark.parametrize("name", ["compact", "bmw_320i"])
def test_the_torque_of_a_motion_is_known(name, speed):
    """A sine of another frequency with a prescribed handwheel: the drivers' torque is nearer than that of a spring.

    The spring is the best one in hindsight.
    """
    env = gym.make(LANE_CHANGE, vehicle=name)
    batch, car = env.unwrapped.batch, cars.load(name)
    conditions = batch.usual_conditions._replace(speed=speed)
    known = np.array(known_torque(car, conditions, batch.steering_response))
    frequency, amplitude = 0.4, 2.5 / acceleration_gain(car, speed)
    p = car.plant("lugre", speed=speed, robot=True)
    state, row = plant.settled(p)
    t, omega = 0.001 * np.arange(1.0, 7501.0), 2.0 * np.pi * frequency
    u, record = np.zeros((t.size, len(plant.INPUTS))), np.tile(row, (t.size, 1))
    u[:, plant.HAND], u[:, plant.HAND_SPEED] = amplitude * np.sin(omega * t), amplitude * omega * np.cos(omega * t)
    plant.run(p, state, u, record, 1)
    late = record[2500:]
    angle, v_y, r, torque = (
        late[:, plant.CHANNEL[name]] for name in ("handwheel_angle", "lateral_speed", "yaw_rate", "handwheel_torque")
    )
    given = np.column_stack([angle, u[2500:, plant.HAND_SPEED], -(omega**2) * angle, v_y, r]) @ known
    of_a_spring = angle * (angle @ torque) / (angle @ angle)
    error, of_spring = (np.sqrt(np.mean((torque - found) ** 2)) for found in (given, of_a_spring))
    assert error < 0.6 * of_spring


@pytest.mark.parametrize("speed", [8.0, 22.0, 50.0])
@pytest.mark.parametrize("car", cars.available())
def test_an_effort_counts_lateral_acceleration(car, speed):
    """The formula of the steady gain against the linear model's own."""
    car = cars.load(car)
    body = linear.from_car(car, speed).state_space("handwheel")
    assert acceleration_gain(car, speed) == pytest.approx(body.dcgain()[2, 0], rel=1e-6)


@pytest.mark.parametrize("control_dt", [0.01, 0.05])
def test_an_angle_servo_parks(control_dt):
    """Rms error of a degree, and a hand torque with less than 0.05 N m rms above 10 Hz; alike in a single one."""
    from scipy import signal

    n, name = 4, "steer_env/DriverParking-v3"
    env = gym.make_vec(name, n, vectorization_mode="vector_entry_point", control_dt=control_dt)
    single = gym.make(name, control_dt=control_dt)
    servo, one = drivers.AngleServo(env), drivers.AngleServo(single)
    observations, _ = env.reset(seed=list(range(n)))
    observation, _ = single.reset(seed=0)
    actions, over = [], False
    while not over:
        actions.append(servo.act(observations))
        assert np.array_equal(one.act(observation), actions[-1][0])
        observations, _, _, truncated, info = env.step(actions[-1])
        observation, *_ = single.step(actions[-1][0])
        over = truncated.any()
    # Without arms the hand torque goes on straight lines from action to action.
    given = 10.0 * np.vstack([np.zeros((1, n)), np.array(actions)[:, :, 0]])
    times = np.arange(0.0, control_dt * len(actions), 0.001)
    torque = np.column_stack([np.interp(times, control_dt * np.arange(len(given)), row) for row in given.T])
    ripple = signal.sosfilt(signal.butter(4, 10.0, "high", fs=1000.0, output="sos"), torque, axis=0)
    assert np.sqrt(np.mean(ripple**2)) < 0.05
    assert info["metrics"]["rms_angle_error"].max() < 0.02
    servo.reset()
    assert np.array_equal(servo.act(env.reset(seed=list(range(n)))[0]), actions[0])
