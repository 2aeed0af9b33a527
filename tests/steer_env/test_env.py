"""The registered environments: Gymnasium's checks, reproducibility, bad input, documentation."""

import math
import os
import re
import subprocess
import sys
import warnings
from pathlib import Path

import gymnasium as gym
import numpy as np
import pytest
from gymnasium.utils.env_checker import check_env

from steer_env import drivers, tasks
from steer_env.episode import randomise
from steer_env.episode.timing import UPDATE_INTERVAL
from steer_env.friction.numerics import packing
from steer_env.friction.numerics.kernel import COMPILED
from steer_env.registration import DRIVEN, REGISTERED, id_of
from steer_env.tasks import driver_parking as parking
from steer_env.tasks.common import terms
from steer_env.tasks.common.definition import DEPARTED, LAST_ACTION, NON_FINITE, ROLLED_OVER, SPUN_OUT, EpisodeContext
from steer_env.tasks.common.reference_feel import reference_torque
from steer_env.vehicle import cars, plant, road
from steer_env.vehicle import tyre as tyres
from steer_env.vehicle.chassis import two_track
from tests.needs import needs

IDS = tuple(DRIVEN)
TUNED_ID = "steer_env/TuneOnCentre-v3"
ACTION = np.array([0.1], np.float32)
# Every id on the chassis that is not its default, with which test_gymnasium_suite.py checks it; laws change no space.
CHECKED = [(name, chassis) for name in tasks.available() for chassis in tasks.task(name).chassis[1:]]


def run(env, steps, seed=3):
    """Observations, rewards and channels of an episode's beginning under a fixed sequence of actions."""
    rng = np.random.default_rng(0)
    first, _ = env.reset(seed=seed)
    seen = [first]
    for _ in range(steps):
        observation, reward, terminated, truncated, info = env.step(rng.uniform(-0.05, 0.05, 1).astype(np.float32))
        assert env.observation_space.contains(observation)
        assert reward == pytest.approx(sum(info["reward_terms"].values()))
        assert info["cost"] == pytest.approx(sum(info["cost_terms"].values()))
        seen += [observation, [reward], [info[name] for name in plant.CHANNEL]]
        if terminated or truncated:
            break
    return np.concatenate([np.ravel(part) for part in seen])


@pytest.mark.parametrize(("name", "chassis"), CHECKED)
def test_gymnasium_accepts(name, chassis):
    env = gym.make(id_of(name), chassis=chassis)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        check_env(env.unwrapped, skip_render_check=True)
    env.close()


@needs("stable_baselines3")
@pytest.mark.parametrize("name", REGISTERED)
def test_stable_baselines3_accepts(name):
    from stable_baselines3.common.env_checker import check_env as check_for_sb3

    check_for_sb3(gym.make(name).unwrapped)


RUN = """
import gymnasium, steer_env, tests.steer_env.test_env as t
print(*[x.hex() for name in t.PLAIN for x in t.run(gymnasium.make(name, friction="masing"), 5).tolist()])
"""
PLAIN = ("steer_env/AssistWeave-v3", "steer_env/DriverDoubleLaneChange-v3")


@pytest.mark.skipif(not COMPILED, reason="nothing is compiled")
def test_plain_python_drives_the_same_to_rounding():
    """Functions such as sine may differ in the last bit, which some runs show and others do not."""
    done = subprocess.run(
        [sys.executable, "-c", RUN],
        cwd=Path(__file__).parents[2],
        env=os.environ | {"NUMBA_DISABLE_JIT": "1"},
        check=True,
        capture_output=True,
        text=True,
    )
    compiled = [x for name in PLAIN for x in run(gym.make(name, friction="masing"), 5).tolist()]
    assert [float.fromhex(x) for x in done.stdout.split()] == pytest.approx(compiled, rel=1e-11, abs=1e-14)


@pytest.mark.parametrize("name", IDS)
def test_control_dt_changes_the_sampling_and_not_the_car(name):
    """The same held action through 5 ms and 10 ms steps leads through the same states, after a driver's first line."""
    fine, coarse = gym.make(name, control_dt=0.005), gym.make(name, control_dt=0.01)
    fine.reset(seed=1)
    coarse.reset(seed=1)
    for k in range(50):
        fine.step(0.5 * ACTION if k == 0 and fine.unwrapped.task.action.ramped else ACTION)
        *_, a = fine.step(ACTION)
        *_, b = coarse.step(ACTION)
        assert {key: a[key] for key in plant.CHANNEL} == pytest.approx({key: b[key] for key in plant.CHANNEL}, rel=1e-9)


@pytest.mark.parametrize("chassis", ["single_track", "two_track"])
def test_left_is_positive(chassis):
    env = gym.make("steer_env/DriverLaneKeeping-v3", chassis=chassis).unwrapped
    env.reset(seed=0, options={"wind": 0.0, "road": 0.0})
    for _ in range(30):
        *_, info = env.step(np.array([0.2], np.float32))
    for channel in ("handwheel_angle", "yaw_rate", "lateral_acceleration", "rack_force", "y", "motor_torque"):
        assert info[channel] > 0.0, channel


def test_lane_keeping_ends_outside_the_lane():
    env = gym.make("steer_env/DriverLaneKeeping-v3")
    env.reset(seed=0)
    for _ in range(600):
        _, reward, terminated, _, info = env.step(np.array([0.5], np.float32))
        if terminated:
            break
    assert info["failure"] == DEPARTED
    assert env.unwrapped.failure_text() == "the car left its lane or its course"
    assert info["reward_terms"]["failure"] == -1.0
    assert -1.0 <= reward < -1.0 + env.unwrapped.control_dt
    with pytest.raises(RuntimeError, match="call reset"):
        env.unwrapped.step(ACTION)


def test_a_car_that_rolls_over_ends_the_episode():
    env = gym.make("steer_env/DriverLaneKeeping-v3", chassis="two_track", control_dt=0.01).unwrapped
    env.reset(seed=0)
    env.batch.arrays.states[0, env.batch.states.index("roll_angle")] = 1.2
    _, reward, terminated, _, info = env.step(ACTION)
    assert (terminated, info["failure"], env.failure_text()) == (True, ROLLED_OVER, "the car rolled over")
    assert -1.0 <= reward < -1.0 + env.control_dt


def test_a_car_that_spins_ends_the_episode(tmp_path):
    """Released from 3 rad at 70 m/s, the default car does without the damping of its motor."""
    undamped = tmp_path / "undamped.toml"
    undamped.write_text(f'base = "compact"\n[assist]\ndamping = {[0.0] * cars.load().assist.speeds.size}\n')
    env = gym.make("steer_env/AssistRelease-v4", vehicle=str(undamped), speed=70.0)
    env.reset(seed=0, options={"amplitude": 3.0})
    ended = False
    while not ended:
        _, reward, ended, truncated, info = env.step(0 * ACTION)
        assert not truncated
    assert (info["failure"], env.unwrapped.failure_text()) == (SPUN_OUT, "the car spun out")
    assert -1.0 <= reward < -1.0 + env.unwrapped.control_dt
    assert all(np.isfinite(value) for value in info["metrics"].values())


def test_metrics_end_with_the_episode_whatever_the_control_step():
    """A hand torque that rises to 5 N m in 0.1 s until the car leaves its lane."""
    found = []
    for control_dt in (0.01, 0.05, 0.1):
        env = gym.make("steer_env/DriverLaneKeeping-v3", control_dt=control_dt)
        env.reset(seed=2)
        ended, k = False, 0
        while not ended:
            k += 1
            *_, ended, _, info = env.step(np.array([0.5 * min(k * control_dt / 0.1, 1.0)], np.float32))
        found.append(info["metrics"])
    assert 4.8 < found[0]["rms_hand_torque"] < 5.0
    assert found[1] == pytest.approx(found[0], rel=1e-3)
    assert found[2] == pytest.approx(found[0], rel=1e-3)


def test_short_control_steps_find_no_jerk_of_their_own():
    for control_dt, steps in ((0.001, 3000), (0.002, 1500), (0.01, 300)):
        env = gym.make("steer_env/DriverLaneKeeping-v3", control_dt=control_dt)
        env.reset(seed=3)
        assert sum(env.step(0 * ACTION)[4]["cost_terms"]["comfort"] for _ in range(steps)) == 0.0


def test_parking_targets_keep_to_their_fastest():
    for seed in range(100):
        setup = parking.TASK.draw_setup(np.random.default_rng(seed), EpisodeContext(cars.load(), 0.0), {})
        assert np.abs(np.diff(setup.data)).max() <= parking.MOVES.fastest * UPDATE_INTERVAL * (1.0 + 1e-9)


def test_own_car_and_tyre(tmp_path):
    """A file each, as a user brings them; the two-track chassis publishes all that the single track does, and more."""
    car = 'base = "compact"\n[chassis]\nmass = 1400.0\nsprung_mass = 1268.6\n'
    (tmp_path / "mycar.toml").write_text(car, encoding="utf-8")
    tyres.save(tyres.load(), tmp_path / "some.tir")
    arguments = {"vehicle": str(tmp_path / "mycar.toml"), "tyre": str(tmp_path / "some.tir")}
    env = gym.make("steer_env/DriverLaneKeeping-v3", chassis="two_track", **arguments)
    _, info = env.reset(seed=0)
    assert set(plant.CHANNEL) < set(info)
    assert info["longitudinal_speed"] == pytest.approx(100.0 / 3.6, rel=0.01)
    lift = 0.5 * 1.2 * 0.15 * info["longitudinal_speed"] ** 2
    loads = sum(info[f"wheel_load_{wheel}"] for wheel in two_track.WHEELS)
    assert loads == pytest.approx(1400.0 * 9.80665 - lift, rel=1e-5)  # not quite settled


def test_reset_options_fix_the_case():
    env = gym.make("steer_env/AssistWeave-v3")
    env.reset(seed=0, options={"amplitude": 0.1})
    peak = 0.0
    for _ in range(1000):
        *_, info = env.step(0 * ACTION)
        peak = max(peak, abs(info["handwheel_angle"]))
    assert peak == pytest.approx(0.1, rel=1e-3)
    with pytest.raises(ValueError, match=r"unknown reset option 'amplitud'.*amplitude"):
        env.reset(options={"amplitud": 0.1})
    with pytest.raises(ValueError, match=r"'amplitude'.*at most 2.*got 5"):
        env.reset(options={"amplitude": 5})


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"speed": 200.0}, r"speed \[m/s\] must be .*at most (70|3), got 200"),
        ({"speed": float("nan")}, r"speed \[m/s\] must be .*got nan"),
        ({"vehicle": "tank"}, r"vehicle must be a .toml or .json file or one of bmw_320i, .*, got 'tank'"),
        ({"control_dt": "0.01"}, r"control_dt \[s\] must be a number, got '0\.01'"),
        ({"control_dt": 0.015}, r"1, 2 or 5 ms or a multiple of 10 ms, got 0\.015"),
        ({"chassis": "hovercraft"}, r"chassis must be one of single_track, two_track, got 'hovercraft'"),
        ({"weights": {"feell": 1.0}}, r"no reward term 'feell'; there are"),
        ({"weights": [1.0]}, r"weights must map reward terms to numbers, got \[1\.0\]"),
        ({"randomise": {"friction": {"F_c": (1, 2), "F_s": (1, 2)}}}, r"(F_s|sigma_2) must be at least"),
        ({"randomise": {"wind": (0, 1)}}, r"randomise has no 'wind'; it takes: load, .*, friction"),
        (
            {"randomise": {"load": (200, 100)}},
            r"randomise\['load'\] must be \(low, high\) with low <= high, got \(200, 100\)",
        ),
        ({"randomise": {"load": 3}}, r"randomise\['load'\] must be \(low, high\), got 3"),
        ({"randomise": {"load": (0, 9000)}}, r"randomise\['load'\] must be .*at most 500, got 9000"),
        ({"randomise": {"friction": {"F_x": (1, 2)}}}, r"'lugre' has no parameter 'F_x'"),
        ({"randomise": {"friction": {"F_c": (-1, 2)}}}, r"F_c must be .*got -1"),
        ({"control_dt": 1.0}, r"control_dt \[s\] must be .*at most 0\.1"),
    ],
)
def test_bad_arguments(arguments, message):
    with pytest.raises(ValueError, match=message):
        gym.make("steer_env/AssistWeave-v3", **arguments)


@pytest.mark.parametrize("name", [IDS[0], TUNED_ID])
def test_seeds(name):
    """Numpy's integers are whole numbers."""
    env = gym.make(name)
    one, _ = env.reset(seed=np.int64(3))
    assert np.array_equal(one, env.reset(seed=3)[0])
    assert (env.unwrapped.np_random_seed, type(env.unwrapped.np_random_seed)) == (3, int)
    for bad in (-1, 1.0, "1", True, np.float32(1.0)):
        with pytest.raises(ValueError, match=f"seed must be a whole number of at least 0, got {re.escape(repr(bad))}"):
            env.reset(seed=bad)


@pytest.mark.parametrize(
    ("action", "message"),
    [
        (np.array([np.nan], np.float32), "must be finite.*got nan"),
        (np.array([np.inf], np.float32), "must be finite.*got inf"),
        (np.zeros(2, np.float32), r"shape \(1,\)"),
        (0.5, r"shape \(1,\) of real numbers, got 0\.5; numpy\.reshape\(action, \(1,\)\) has it"),
        ([[0.5], [0.1, 0.2]], r"must become an array of shape \(1,\)"),
        (np.array([True]), "real numbers"),
        (np.array([1j]), "real numbers"),
    ],
)
def test_bad_actions(action, message):
    env = gym.make("steer_env/AssistWeave-v3").unwrapped
    env.reset(seed=0)
    with pytest.raises(ValueError, match=message):
        env.step(action)


def test_actions_in_the_forms_that_gymnasium_takes():
    """A list, a tuple and numbers of double precision act as the array does."""
    env = gym.make(IDS[0])
    action = 0.25 * np.ones(env.action_space.shape, np.float32)
    env.reset(seed=0)
    expected = env.step(action)[0]
    for given in (action.tolist(), tuple(action.tolist()), action.astype(float)):
        env.reset(seed=0)
        assert np.array_equal(env.unwrapped.step(given)[0], expected)
    vector = gym.make_vec(IDS[0], num_envs=1)
    vector.reset(seed=0)
    assert np.array_equal(vector.step([action.tolist()])[0][0], expected)
    vector.close()


@needs("torch")
def test_a_tensor_is_an_action():
    import torch

    env = gym.make(IDS[0]).unwrapped
    env.reset(seed=0)
    env.step(torch.zeros(1))
    with pytest.raises(ValueError, match="must become an array"):
        env.step(torch.zeros(1, requires_grad=True))


def test_no_step_after_close():
    env, vector = gym.make(IDS[0]).unwrapped, gym.make_vec(IDS[0], num_envs=2)
    for each in (env, vector):
        each.reset(seed=0)
        each.close()
        with pytest.raises(RuntimeError, match="over or has not begun"):
            each.step(np.zeros(each.action_space.shape, np.float32))


def test_a_state_that_turns_nan_ends_the_episode_and_is_named():
    env = gym.make("steer_env/DriverLaneKeeping-v3").unwrapped
    env.reset(seed=0)
    env.step(ACTION)
    env.batch.arrays.scripted_inputs[0, 2:, 2] = np.nan  # the rack disturbance
    observation, reward, terminated, _, info = env.step(ACTION)
    assert terminated
    assert reward == -1.0
    assert env.observation_space.contains(observation)
    assert info["failure"] == NON_FINITE
    assert env.failure_text() == env.failure_text(NON_FINITE) == "a state is not finite: handwheel_angle [rad]"
    env.reset()
    assert (env.failure_text(), env.failure_text(NON_FINITE)) == ("", "a state is not finite")
    for code in (5, -1, 1.0, "spun"):
        with pytest.raises(ValueError, match="failure must be a whole number"):
            env.failure_text(code)


def test_weights_replace_the_tasks():
    name = "steer_env/AssistWeave-v3"
    plain, other = gym.make(name, control_dt=0.01), gym.make(name, control_dt=0.01, weights={"effort": 7.0})
    plain.reset(seed=0)
    other.reset(seed=0)
    *_, a = plain.step(ACTION)
    *_, b = other.step(ACTION)
    quality = 1.0 / math.sqrt(1.0 + (0.1 / terms.ACTION_SCALE) ** 2)
    assert b["reward_terms"]["effort"] == pytest.approx(7.0 * 0.01 * quality, rel=1e-9)  # in 10 ms
    assert {k: v for k, v in a["reward_terms"].items() if k != "effort"} == {
        k: v for k, v in b["reward_terms"].items() if k != "effort"
    }


def test_rewards_of_a_weave_are_those_of_the_recorded_channels():
    """Feel, effort and smoothness from what a user sees, at one evaluation a step."""
    env, rng, last = gym.make("steer_env/AssistWeave-v3", control_dt=0.01), np.random.default_rng(4), 0.0
    squared = 0.0  # mean of the rate's square over 0.1 s
    env.reset(seed=1)
    for _ in range(300):
        action = rng.uniform(-0.2, 0.2, 1).astype(np.float32)
        observation, reward, *_, info = env.step(action)
        wanted = reference_torque(info["lateral_acceleration"], info["handwheel_speed"])
        squared += (((action.item() - last) / 0.01) ** 2 - squared) * 0.01 / 0.11
        quality = {
            "feel": (0.7, (info["handwheel_torque"] - wanted) / 0.3),
            "effort": (0.05, action.item() / 0.5),
            "smoothness": (0.1, math.sqrt(squared) / 4.0),
        }
        for name, (weight, error) in quality.items():
            expected = 0.01 * weight / math.sqrt(1.0 + error**2)
            assert info["reward_terms"][name] == pytest.approx(expected, rel=1e-6), name
        assert reward == pytest.approx(sum(info["reward_terms"].values()), rel=1e-12)
        last = action.item()
        assert observation[env.unwrapped.batch.observed.index(LAST_ACTION)] == action[0]


def test_what_is_drawn_changes_the_car_and_an_option_fixes_it():
    """A held torque on two tracks: more load, less friction of the road, another speed, another level of friction."""
    ranges = {"load": (0, 400), "road_friction": (0.5, 1.0), "speed": (20, 30), "friction_level": (0.5, 2.0)}
    env = gym.make(
        "steer_env/DriverLaneKeeping-v3", friction="lugre", chassis="two_track", randomise=ranges, control_dt=0.01
    )
    fixed = {"load": 300.0, "road_friction": 0.8, "speed": 25.0, "friction_level": 1.5, "wind": 0.0, "road": 0.0}

    def end(options):
        env.reset(seed=1, options=options)
        peak = 0.0
        for k in range(100):
            *_, info = env.step(np.array([0.3], np.float32))
            if k >= 10:  # LuGre's damper no longer feels the step of the hand torque
                peak = max(peak, abs(info["friction_torque"]))
        return {**info, "peak_friction_torque": peak}

    usual = end(fixed)
    assert end(fixed) == usual
    loads = sum(usual[f"wheel_load_{wheel}"] for wheel in two_track.WHEELS)
    lighter = end({**fixed, "load": 0.0})
    gained = loads - sum(lighter[f"wheel_load_{wheel}"] for wheel in two_track.WHEELS)
    assert gained == pytest.approx(300.0 * 9.80665, rel=0.01)
    assert end({**fixed, "speed": 21.0})["longitudinal_speed"] == pytest.approx(21.0, rel=0.02)
    light = end({**fixed, "friction_level": 0.5})["peak_friction_torque"]
    assert light == pytest.approx(usual["peak_friction_torque"] / 3.0, rel=0.1)  # the load on the rack differs
    left = end({**fixed, "friction_asymmetry": 0.5, "friction_load": 0.0})["peak_friction_torque"]
    assert left == pytest.approx(1.5 * end({**fixed, "friction_load": 0.0})["peak_friction_torque"], rel=0.1)
    assert end({**fixed, "friction_position": 0.5})["peak_friction_torque"] > 1.3 * usual["peak_friction_torque"]
    assert end({}) != usual


@pytest.mark.parametrize(("law", "chassis"), [("lugre", "single_track"), ("masing", "two_track")])
def test_friction_does_not_act_straight_ahead(law, chassis):
    """A draw of friction alone begins as the plant that was driven straight with it, to the bit."""
    options = {"friction_level": 1.7, "friction_load": 0.2, "friction_asymmetry": 0.2, "friction_position": 0.3}
    env = gym.make("steer_env/AssistWeave-v3", friction=law, chassis=chassis, randomise={"friction_level": (0.5, 2.0)})
    batch = env.unwrapped.batch
    env.reset(seed=0, options=options)
    drawn = batch.conditions[0]
    assert not drawn.same_plant(batch.usual_conditions)
    numbers = packing.numbers(batch._plant(drawn, batch.task.robot, batch.driver))[None]
    begun = batch.arrays.plants, batch.arrays.states, batch.arrays.channels
    for one, other in zip((numbers, *batch._settled(numbers)[:2]), begun):
        assert one.tobytes() == other.tobytes()


def test_friction_acts_where_a_car_does_not_run_straight():
    """On a bank an episode with a drawn law begins as the plant that was driven with it, to the bit."""
    ranges = {"friction": {"F_c": (0.5, 3.0)}}
    env = gym.make(id_of("DriverOnCentre"), chassis="two_track", road=road.make_road(bank=0.05), randomise=ranges)
    batch = env.unwrapped.batch
    env.reset(seed=0)
    states, _, straight = batch._settled(batch.arrays.plants)
    assert not straight[0]
    assert np.abs(batch.arrays.states - batch._usual_start[1]).max() > 1e-4
    keep = [i for i in range(states.shape[1]) if i not in batch._pose_states]
    assert np.array_equal(states[0, keep], batch.arrays.states[0, keep])


def test_an_episode_that_was_refused_is_over():
    """The level suits the laws of some rows only: those that were changed ask for a reset."""
    arguments = {"friction": "stribeck", "randomise": {"friction": {"F_s": (1.0, 1.5)}}}
    envs = gym.make_vec(id_of("AssistWeave"), 4, autoreset_mode="Disabled", **arguments)
    envs.reset(seed=3)
    with pytest.raises(ValueError, match="friction"):
        envs.reset(options={"friction_level": 5.0})
    with pytest.raises(RuntimeError, match="call reset"):
        envs.step(np.zeros((4, 1), np.float32))
    envs.reset(seed=3)
    envs.step(np.zeros((4, 1), np.float32))


@pytest.mark.parametrize(
    ("env_id", "chassis"), [("AssistLaneKeeping", "single_track"), ("DriverLaneKeeping", "two_track")]
)
def test_a_drawn_plant_is_that_of_its_car(env_id, chassis):
    env = gym.make(id_of(env_id), friction="masing", chassis=chassis)
    batch = env.unwrapped.batch
    env.reset(seed=0, options={"load": 200.0, "road_friction": 0.5, "speed": 20.0, "friction_level": 1.7})
    drawn, robot = batch.conditions[0], batch.task.robot
    p = batch.car.loaded(200.0).plant("masing", 20.0, robot, road_friction=0.5, chassis=chassis)
    if batch.driver is not None:
        p = drivers.with_arms(p, batch.driver.arm)
    assert np.array_equal(batch.arrays.plants[0], packing.numbers(randomise.with_level(p, drawn)))


@pytest.mark.parametrize(
    ("name", "value"),
    [
        ("load", 9.0),
        ("road_friction", 0.5),
        ("speed", 20.0),
        ("friction_level", 2.0),
        ("friction_load", 0.1),
        ("friction_asymmetry", 0.2),
        ("friction_position", 0.3),
    ],
)
def test_each_condition_alone_changes_the_plant(name, value):
    batch = gym.make("steer_env/DriverLaneKeeping-v3", control_dt=0.01).unwrapped.batch
    batch.start([0], [np.random.default_rng(0)], {})
    usual = batch.arrays.plants.copy()
    batch.start([0], [np.random.default_rng(0)], {name: value})
    assert np.any(batch.arrays.plants != usual)
    assert batch.conditions[0].values([name]) == [value]


def test_noise_has_its_size_and_a_delay_its_age():
    env = gym.make("steer_env/AssistWeave-v3", randomise={"sensor_noise": (1, 1), "delay": (0.05, 0.05)}).unwrapped
    clean = gym.make("steer_env/AssistWeave-v3").unwrapped
    clean.reset(seed=0, options={"amplitude": 0.2})
    env.reset(seed=0, options={"amplitude": 0.2})
    seen, true = [], []
    for _ in range(1500):
        seen.append(env.step(0 * ACTION)[0])
        true.append(clean.step(0 * ACTION)[0])
    clean.reset(seed=0, options={"amplitude": 0.2, "delay": 0.05})  # an option needs no range to be drawn from
    late = [clean.step(0 * ACTION)[0] for _ in range(100)]
    assert np.array_equal(late[5:], true[:95])
    errors = (np.array(seen)[5:] - np.array(true)[:-5]) * env.observation_scale
    for k, quantity in enumerate(env.batch.observed):
        assert errors[:, k].std() == pytest.approx(randomise.SENSOR_NOISE.get(quantity.name, 0.0), rel=0.08, abs=1e-6)
        assert abs(errors[:, k].mean()) < 4.0 * randomise.SENSOR_NOISE.get(quantity.name, 0.0) / 38.0 + 1e-6
