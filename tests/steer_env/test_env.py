"""The registered environments: Gymnasium's checks, reproducibility, bad input, documentation."""

import pickle
import re
import warnings

import gymnasium as gym
import numpy as np
import pytest
from gymnasium.utils.env_checker import check_env

import friction
from steer_env import REGISTERED
from vehicle import plant, two_track
from vehicle import tyre as tyres

IDS = tuple(REGISTERED)
ACTION = np.array([0.1], np.float32)


def run(env, steps, seed=3):
    """Observations, rewards and channels of an episode's beginning under a fixed sequence of actions."""
    rng = np.random.default_rng(0)
    first, _ = env.reset(seed=seed)
    seen = [first]
    for _ in range(steps):
        observation, reward, terminated, truncated, info = env.step(rng.uniform(-0.05, 0.05, 1).astype(np.float32))
        assert env.observation_space.contains(observation)
        assert reward == pytest.approx(sum(info["reward_terms"].values()))
        seen += [observation, [reward], [info[name] for name in plant.CHANNEL]]
        if terminated or truncated:
            break
    return np.concatenate([np.ravel(part) for part in seen])


@pytest.mark.parametrize("chassis", ["single_track", "two_track"])
@pytest.mark.parametrize("law", friction.available())
@pytest.mark.parametrize("name", IDS)
def test_gymnasium_accepts(name, law, chassis):
    env = gym.make(name, friction=law, chassis=chassis, render_mode="rgb_array")
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        check_env(env.unwrapped)
    env.close()


@pytest.mark.parametrize("name", IDS)
def test_stable_baselines3_accepts(name):
    from stable_baselines3.common.env_checker import check_env as check_for_sb3

    check_for_sb3(gym.make(name).unwrapped)


def test_a_new_law_drives_an_environment(toy):
    assert "toy_jenkins" in friction.available()
    env = gym.make("steer_env/AssistWeave-v0", friction=toy.make(k=80.0))
    assert np.isfinite(run(env, 100)).all()


@pytest.mark.parametrize("name", IDS)
def test_same_seed_same_run(name):
    one, two = gym.make(name), gym.make(name)
    assert np.array_equal(run(one, 200), run(two, 200))
    assert np.array_equal(run(one, 200), run(two, 200))  # and again after a reset
    assert not np.array_equal(run(one, 200, seed=4), run(two, 200))


@pytest.mark.parametrize("name", IDS)
def test_control_dt_changes_the_sampling_and_not_the_car(name):
    """The same held action through 5 ms and 10 ms steps leads through the same states."""
    fine, coarse = gym.make(name, control_dt=0.005), gym.make(name, control_dt=0.01)
    fine.reset(seed=1)
    coarse.reset(seed=1)
    for _ in range(50):
        fine.step(ACTION)
        *_, a = fine.step(ACTION)
        *_, b = coarse.step(ACTION)
        assert {key: a[key] for key in plant.CHANNEL} == {key: b[key] for key in plant.CHANNEL}


@pytest.mark.parametrize("chassis", ["single_track", "two_track"])
def test_left_is_positive(chassis):
    env = gym.make("steer_env/DriverLaneKeeping-v0", chassis=chassis).unwrapped
    env.reset(seed=0)
    env._inputs[:] = 0.0  # no wind, smooth road
    for _ in range(30):
        *_, info = env.step(np.array([0.2], np.float32))
    for channel in ("handwheel_angle", "yaw_rate", "lateral_acceleration", "rack_force", "y", "motor_torque"):
        assert info[channel] > 0.0, channel


def test_lane_keeping_ends_outside_the_lane():
    env = gym.make("steer_env/DriverLaneKeeping-v0")
    env.reset(seed=0)
    for _ in range(3000):
        _, _, terminated, _, info = env.step(np.array([0.5], np.float32))
        if terminated:
            break
    assert info["reward_terms"]["departure"] == -10.0
    with pytest.raises(RuntimeError, match="call reset"):
        env.unwrapped.step(ACTION)


@pytest.mark.parametrize("law", ["coulomb", "lugre"])
def test_a_plain_preview_driver_keeps_the_lane(law):
    """Curvature ahead, offset and heading make a wanted acceleration; the default car takes 0.132 rad for 1 m/s2."""
    env = gym.make("steer_env/DriverLaneKeeping-v0", friction=law)
    observation, _ = env.reset(seed=1)
    truncated, total = False, 0.0
    while not truncated:
        angle, speed, *_, offset, heading, _, _, ahead, _, _ = observation.tolist()
        wanted = 27.8**2 * ahead - offset - 27.0 * heading
        torque = 1.1 * wanted + 6.0 * (0.132 * wanted - angle) - 0.3 * speed
        action = np.clip([torque / 10.0], -1.0, 1.0).astype(np.float32)
        observation, reward, terminated, truncated, _ = env.step(action)
        total += reward
        assert not terminated
    assert total > 0.0


def test_a_car_that_rolls_over_ends_the_episode():
    env = gym.make("steer_env/DriverLaneKeeping-v0", chassis="two_track").unwrapped
    env.reset(seed=0)
    names = [name for name, _ in plant.states(env.plant)]
    env._state[names.index("roll_angle")] = 1.2
    _, reward, terminated, _, info = env.step(ACTION)
    assert (reward, terminated, info["rolled_over"]) == (-100.0, True, True)


def test_own_car_and_tyre(tmp_path):
    """A file each, as a user brings them; the two-track chassis publishes all that the single track does, and more."""
    car = 'base = "compact"\n[chassis]\nmass = 1400.0\nsprung_mass = 1268.6\n'
    (tmp_path / "mycar.toml").write_text(car, encoding="utf-8")
    tyres.save(tyres.load(), tmp_path / "some.tir")
    arguments = {"vehicle": str(tmp_path / "mycar.toml"), "tyre": str(tmp_path / "some.tir")}
    env = gym.make("steer_env/DriverLaneKeeping-v0", chassis="two_track", **arguments)
    _, info = env.reset(seed=0)
    assert set(plant.CHANNEL) < set(info)
    assert info["longitudinal_speed"] == pytest.approx(100.0 / 3.6, rel=0.01)
    lift = 0.5 * 1.2 * 0.15 * info["longitudinal_speed"] ** 2
    loads = sum(info[f"wheel_load_{wheel}"] for wheel in two_track.WHEELS)
    assert loads == pytest.approx(1400.0 * 9.80665 - lift, rel=1e-5)  # not quite settled


def test_weave_truncates_after_its_duration():
    env = gym.make("steer_env/AssistWeave-v0", control_dt=0.1)
    env.reset(seed=0)
    for step in range(1, 201):
        _, _, terminated, truncated, _ = env.step(ACTION)
        assert not terminated
        assert truncated == (step == 200)
    with pytest.raises(RuntimeError, match="call reset"):
        env.unwrapped.step(ACTION)


def test_reset_options_fix_the_case():
    env = gym.make("steer_env/AssistWeave-v0")
    env.reset(seed=0, options={"amplitude": 0.1})
    peak = 0.0
    for _ in range(1000):
        *_, info = env.step(0 * ACTION)
        peak = max(peak, abs(info["handwheel_angle"]))
    assert peak == pytest.approx(0.1, rel=1e-3)
    with pytest.raises(ValueError, match=r"unknown reset option 'amplitud'.*amplitude"):
        env.reset(options={"amplitud": 0.1})
    with pytest.raises(ValueError, match=r"amplitude \[rad\].*at most 2.*got 5"):
        env.reset(options={"amplitude": 5})


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"friction": "lugree"}, r"unknown friction law 'lugree'.*lugre"),
        ({"friction": 3.0}, r"3\.0 is not a set of friction parameters"),
        ({"speed": 200.0}, r"speed \[m/s\] must be .*at most 70, got 200"),
        ({"speed": 0.0}, r"speed \[m/s\] must be .*at least 3"),
        ({"speed": float("nan")}, r"speed \[m/s\] must be .*got nan"),
        ({"vehicle": "tank"}, r"vehicle must be a .toml or .json file or one of bmw_320i, .*, got 'tank'"),
        ({"control_dt": 0.0015}, r"whole number of milliseconds, got 0\.0015"),
        ({"control_dt": 1.0}, r"control_dt \[s\] must be .*at most 0\.1"),
    ],
)
@pytest.mark.parametrize("name", IDS)
def test_bad_arguments(name, arguments, message):
    with pytest.raises(ValueError, match=message):
        gym.make(name, **arguments)


@pytest.mark.parametrize("name", IDS)
def test_unknown_keywords_are_refused(name):
    with pytest.raises(TypeError, match="frictoin"):
        gym.make(name, frictoin="lugre")


@pytest.mark.parametrize(
    ("action", "message"),
    [
        (np.array([np.nan], np.float32), "got nan"),
        (np.array([np.inf], np.float32), "got inf"),
        (np.zeros(2, np.float32), r"shape \(1,\)"),
        (0.5, r"shape \(1,\), got 0\.5"),
    ],
)
def test_bad_actions(action, message):
    env = gym.make("steer_env/AssistWeave-v0").unwrapped
    env.reset(seed=0)
    with pytest.raises(ValueError, match=message):
        env.step(action)


def test_a_state_that_turns_nan_ends_the_episode_and_is_named():
    env = gym.make("steer_env/DriverLaneKeeping-v0").unwrapped
    env.reset(seed=0)
    env.step(ACTION)
    env._inputs[20:, plant.RACK_DISTURBANCE] = np.nan
    env.step(ACTION)
    observation, reward, terminated, _, info = env.step(ACTION)
    assert terminated
    assert reward == -100.0
    assert env.observation_space.contains(observation)
    assert info["non_finite_state"] == "handwheel_angle [rad]"


@pytest.mark.parametrize("name", IDS)
def test_docstring_tables_match_the_spaces(name):
    env = gym.make(name).unwrapped
    table = env.__doc__.split("## Observation")[1].split("##")[0]
    rows = re.findall(r"^\s*\| ([0-9-]+) \|.*\| ([0-9.pi]+) \| (.*) \|$", table, flags=re.MULTILINE)
    documented = []
    for index, bound, unit in rows:
        first, _, last = index.partition("-")
        value = np.pi if bound == "pi" else float(bound)
        documented += [(value, unit)] * (int(last or first) - int(first) + 1)
    declared = [(o.bound, o.unit) for o in (*env.task.channels, *env.task.situation)]
    assert documented == [(pytest.approx(bound), unit) for bound, unit in declared]
    scale = re.search(r"\| 0 \|.*\| (\d+) \| N m \|", env.__doc__.split("## Action")[1])
    assert scale is not None
    assert float(scale[1]) == env.task.action_scale


@pytest.mark.parametrize("name", IDS)
def test_specification_survives_pickling(name):
    env = pickle.loads(pickle.dumps(gym.make(name, friction="masing").spec)).make()
    assert np.array_equal(run(env, 20), run(gym.make(name, friction="masing"), 20))


@pytest.mark.parametrize("name", IDS)
def test_gymnasium_vectorises(name):
    """Gymnasium's own vector environment seeds lane i with seed + i."""
    vector = gym.make_vec(name, num_envs=2, vectorization_mode="sync", friction="masing")
    observations, _ = vector.reset(seed=5)
    single = gym.make(name, friction="masing")
    assert np.array_equal(observations[1], single.reset(seed=6)[0])
    for _ in range(10):
        observations, *_ = vector.step(np.tile(ACTION, (2, 1)))
        observation, *_ = single.step(ACTION)
    assert np.array_equal(observations[1], observation)
    vector.close()


@pytest.mark.parametrize("name", IDS)
def test_a_frame_shows_something(name):
    env = gym.make(name, render_mode="rgb_array")
    env.reset(seed=0)
    empty = env.render()
    for _ in range(100):
        env.step(ACTION)
    frame = env.render()
    assert frame.shape == (360, 720, 3)
    assert frame.dtype == np.uint8
    assert (frame != empty).mean() > 0.001
    env.close()
