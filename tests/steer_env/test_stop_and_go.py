"""Stop-and-go: the recorded speed, the assumed road, what the friction law decides, and what does not pay."""

import hashlib
import math
from importlib.resources import files

import gymnasium as gym
import numpy as np
import pytest

from steer_env import drivers
from steer_env.registration import history, id_of
from steer_env.tasks import driver_stop_and_go
from steer_env.tasks.driver_stop_and_go import LARGEST, RADIUS, SPEEDS, TIMES

ID = id_of("DriverStopAndGo")
N = 16


def made(**arguments):
    return gym.make_vec(ID, num_envs=N, **arguments).unwrapped


def returns(env, act):
    """Reward (N,) of the episodes under ``act(observation, step)``."""
    observation, _ = env.reset(seed=0)
    total, ended = np.zeros(N), np.zeros(N, bool)
    for k in range(round(30.0 / env.batch.control_dt)):
        observation, reward, terminated, truncated, _ = env.step(act(observation, k))
        total += np.where(ended, 0.0, reward)
        ended |= terminated
    assert truncated.any() or ended.all()
    return total


def of_servo(**arguments):
    env = made(**arguments)
    servo = drivers.AngleServo(env)
    return returns(env, lambda observation, k: servo.act(observation)).mean()


@pytest.fixture(scope="module")
def best():
    """Mean reward of the angle servo on the friction of the car."""
    return of_servo()


def same(action):
    """Every sub-environment takes the action of the step."""
    return lambda observation, k: np.full((N, 1), action(k), np.float32)


@pytest.mark.parametrize("scenario", [50, 100, 219])
def test_the_car_follows_the_recorded_speed(scenario):
    """The hold lags by half a second (its gain is 2/s), so by half the change of speed within a second."""
    env = gym.make(ID, info_level="full")
    _, info = env.reset(seed=0, options={"scenario": scenario})
    assert info["conditions"]["speed"] == np.interp(scenario, TIMES, SPEEDS)
    found, truncated = [info["longitudinal_speed"]], False
    while not truncated:
        _, _, terminated, truncated, info = env.step(np.zeros(1, np.float32))
        assert not terminated
        found.append(info["longitudinal_speed"])
    t = scenario + 0.05 * np.arange(len(found))
    assert t[-1] == scenario + 30.0
    lag = 0.5 * np.abs(np.diff(SPEEDS)[scenario - 50 : scenario - 20]).max()
    assert np.abs(found - np.interp(t, TIMES, SPEEDS)).max() < 1.1 * lag


def test_an_episode_begins_at_a_whole_second_of_the_drive_that_is_drawn_or_given():
    env = gym.make(ID).unwrapped
    begun = {env.reset(seed=seed)[1]["conditions"]["scenario"] for seed in range(40)}
    assert len(begun) > 30
    assert all(TIMES[0] <= each <= TIMES[-1] - 30.0 and each == round(each) for each in begun)
    for value, said in ((120.5, "whole number from 50 to 219"), (220, "at most 219"), (49, "at least 50")):
        with pytest.raises(ValueError, match=said):
            env.reset(options={"scenario": value})


def test_the_target_is_that_of_a_car_on_the_assumed_road():
    """Its bends are those of Ackermann's angle; corrections are added. The spread is that of the recorded angle."""
    env = made()
    env.reset(seed=0)
    targets = env.batch.arrays.task_data[:, 1:]
    car = env.batch.car
    wheelbase = car.chassis["front_axle"] + car.chassis["rear_axle"]
    assert not targets[:, 0].any()
    assert np.abs(targets).max() <= car.steering_ratio() * wheelbase / RADIUS + LARGEST
    assert 2.0 < math.degrees(targets.std()) < 3.0  # 2.7 deg in the record below 26 m/s


def test_the_friction_law_decides_what_a_servo_reaches_and_nothing_of_zero_action():
    rewards = {law: of_servo(friction=law) for law in ("lugre", "stribeck")}
    idle = [returns(made(friction=law), same(lambda k: 0.0)) for law in rewards]
    np.testing.assert_allclose(*idle, rtol=1e-9)
    reach = max(rewards.values()) - idle[0].mean()
    assert rewards["lugre"] - rewards["stribeck"] > 0.15 * reach


@pytest.mark.parametrize(
    "action",
    [
        lambda k: 0.0,
        lambda k: 0.1,  # a held torque, half a newton metre
        lambda k: 0.1 * (-1.0) ** k,  # shaking
        lambda k: 0.5 * (-1.0) ** k,
        lambda k: 1.0,
    ],
)
def test_what_does_not_look_at_the_target_earns_little(action, best):
    assert returns(made(), same(action)).mean() < 0.55 * best


def test_the_car_stays_controlled_at_the_lowest_speed_of_the_whole_drive(best, monkeypatch):
    """The rest of the recorded drive, which is not here, goes down to 1.2 m/s."""
    monkeypatch.setattr(driver_stop_and_go, "SPEEDS", SPEEDS * 1.2 / SPEEDS.min())
    assert of_servo() > 0.97 * best


def test_the_versions_of_an_id_begin_with_its_first():
    assert history("DriverStopAndGo") == "v0: First version."
    assert history("DriverOnCentre").endswith("\n\nv0: First version.")
    assert ID == "steer_env/DriverStopAndGo-v0"


def test_the_recorded_speed_has_its_source():
    folder = files("steer_env.courses").joinpath("data")
    text = folder.joinpath("SOURCES.md").read_text(encoding="utf-8")
    assert hashlib.sha256(folder.joinpath("stop_and_go.csv").read_bytes()).hexdigest() in text
    assert "MIT License" in text
