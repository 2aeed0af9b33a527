"""Every sub-environment of a vector environment is bit-identical to the single environment."""

import os
import tracemalloc
import warnings
from itertools import cycle

import gymnasium as gym
import numpy as np
import pytest
from gymnasium.vector import AutoresetMode

from steer_env.drivers import Controller
from steer_env.engine.infos import row
from steer_env.engine.kernels import ROWS_AT_ONCE
from steer_env.registration import DRIVEN
from tests.steer_env.test_state import equal

IDS = tuple(DRIVEN)
WEAVE, COURSE = "steer_env/AssistWeave-v3", "steer_env/DriverDoubleLaneChange-v3"
RANDOM = {
    "load": (0, 300),
    "road_friction": (0.6, 1.0),
    "friction_level": (0.5, 1.5),
    "sensor_noise": (0, 1),
    "delay": (0, 0.03),
    "friction": {"F_c": (0.5, 1.5)},
}
ROWS = 4


def make(name, n=ROWS, **arguments):
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        return gym.make_vec(name, num_envs=n, **arguments)


# A law of the whole column, one with a memory of its own elements, and laws at three sites with a worm gear among them.
AT_SITES = {"upper_column": "coulomb", "lower_column": "masing", "gear": "coulomb,F_c=0.3,efficiency=0.88"}
DRAWN = (
    ("lugre", {"F_c": (0.5, 1.5)}),
    ("masing", {"F_c": (0.5, 1.5), "x_c": (0.001, 0.002)}),
    (AT_SITES, {"upper_column.F_c": (0.05, 0.2), "lower_column.F_c": (0.5, 1.0)}),
)


@pytest.mark.parametrize(("name", "law", "friction"), [(name, *law) for name, law in zip(IDS, cycle(DRAWN))])
def test_equal_to_single_environments_to_the_bit(name, law, friction):
    """With resets at different times and everything drawn that can be drawn; two threads against one."""
    arguments = {"friction": law, "randomise": {**RANDOM, "friction": friction}, "control_dt": 0.02}
    vector, single = make(name, threads=2, **arguments), [gym.make(name, **arguments) for _ in range(ROWS)]
    observations, infos = vector.reset(seed=7)
    for i, env in enumerate(single):
        observation, info = env.reset(seed=7 + i)
        assert np.array_equal(observation, observations[i])
        assert equal(row(infos, i), info)
    rng, over = np.random.default_rng(0), np.zeros(ROWS, bool)
    for _ in range(300):
        actions = rng.uniform(-0.4, 0.4, (ROWS, 1)).astype(np.float32)
        observations, rewards, terminated, truncated, infos = vector.step(actions)
        for i, env in enumerate(single):
            if over[i]:
                (observation, info), reward, ended, cut = env.reset(), 0.0, False, False
            else:
                observation, reward, ended, cut, info = env.step(actions[i])
            assert np.array_equal(observation, observations[i])
            assert (reward, ended, cut) == (rewards[i], terminated[i], truncated[i])
            assert equal(row(infos, i), info)
        over = terminated | truncated


def runs(env, seed=3, steps=200):
    """Observations of an episode's beginning."""
    seen, rng = [env.reset(seed=seed)[0]], np.random.default_rng(1)
    for _ in range(steps):
        seen.append(env.step(rng.uniform(-0.3, 0.3, (ROWS, 1)).astype(np.float32))[0].copy())
    return np.array(seen)


def test_threads_survive_a_fork():
    vector = make(WEAVE, threads=2)
    here = runs(vector)
    child = os.fork()
    if child == 0:
        os._exit(0 if np.array_equal(runs(vector), here) else 1)
    assert os.waitpid(child, 0)[1] == 0
    assert np.array_equal(runs(vector), here)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"num_envs": 0}, "num_envs must be a whole number of at least 1, got 0"),
        ({"threads": 0}, "threads must be a whole number of at least 1, got 0"),
        ({"autoreset_mode": "never"}, "never"),
        ({"render_mode": "human"}, "render_mode must be None or one of rgb_array, rgb_array_list, got 'human'"),
        ({"max_episode_steps": 0}, "max_episode_steps must be a whole number of at least 1, got 0"),
    ],
)
def test_bad_arguments(arguments, message):
    with pytest.raises(ValueError, match=message):
        gym.make_vec(WEAVE, **arguments)


def test_whole_numbers_may_be_numpys():
    vector, same = make(WEAVE, n=np.int64(2), threads=np.int32(2)), make(WEAVE, n=2)
    assert (vector.num_envs, type(vector.num_envs)) == (2, int)
    for seed, plain in ((np.int64(4), 4), (np.array([4, 9]), [4, 9]), ((np.uint8(4), None), [4, None])):
        assert np.array_equal(vector.reset(seed=seed)[0][0], same.reset(seed=plain)[0][0])
        assert vector.np_random_seed[0] == 4


def test_seeds_and_generators_are_those_of_the_sub_environments():
    vector = make(WEAVE, n=3)
    assert len(set(vector.np_random_seed)) == 3  # of their own before there is a seed
    drawn = [rng.bit_generator.state for rng in vector.np_random]
    vector.reset()
    assert all(rng.bit_generator.state != before for rng, before in zip(vector.np_random, drawn))
    vector.reset(seed=7)
    assert vector.np_random_seed == (7, 8, 9)
    vector.reset(seed=[1, None, 3])
    assert vector.np_random_seed == (1, 8, 3)
    single = gym.make(WEAVE).unwrapped
    single.reset(seed=3)
    assert single.np_random.bit_generator.state == vector.np_random[2].bit_generator.state


@pytest.mark.parametrize("mode", [mode.value for mode in AutoresetMode])
@pytest.mark.parametrize("seed", [5, [5, 6]])
def test_a_first_reset_may_leave_sub_environments_out(mode, seed):
    """They are seeded all the same, and begin at the next step, or with DISABLED at their own reset."""
    vector, whole = (make(WEAVE, n=2, autoreset_mode=mode) for _ in range(2))
    actions = np.zeros((2, 1), np.float32)
    expected, _ = whole.reset(seed=seed)
    begun, info = vector.reset(seed=seed, options={"reset_mask": np.array([True, False])})
    assert np.array_equal(begun[0], expected[0])
    assert list(info["_conditions"]) == [True, False]
    if mode == AutoresetMode.DISABLED.value:
        with pytest.raises(RuntimeError, match="call reset"):
            vector.step(actions)
        later, _ = vector.reset(options={"reset_mask": np.array([False, True])})
        assert np.array_equal(later, expected)
    else:
        later, rewards, *_ = vector.step(actions)
        assert np.array_equal(later[1], expected[1])
        assert np.array_equal(later[0], whole.step(actions)[0][0])
        assert rewards[1] == 0.0


def test_bad_calls():
    vector = make(WEAVE, n=2)
    with pytest.raises(RuntimeError, match="call reset"):
        vector.step(np.zeros((2, 1), np.float32))
    vector.reset(seed=0)
    for actions, message in (
        (np.zeros(2, np.float32), r"shape \(2, 1\)"),
        (np.array([[0.0], [np.nan]], np.float32), "of sub-environment 1 must be finite.*got nan"),
        ([[0.0]], r"shape \(2, 1\)"),
    ):
        with pytest.raises(ValueError, match=message):
            vector.step(actions)
    with pytest.raises(ValueError, match="reset_mask must be a boolean array"):
        vector.reset(options={"reset_mask": np.array([1, 0])})
    with pytest.raises(ValueError, match="seed must be a number or 2 of them"):
        vector.reset(seed=[1, 2, 3])
    for seed in (-1, 1.5, "ab", [1, -1], [1, 2.0]):
        with pytest.raises(ValueError, match="seed must be a whole number of at least 0"):
            vector.reset(seed=seed)
    with pytest.raises(TypeError, match="unexpected keyword argument 'frictoin'"):
        gym.make_vec(WEAVE, num_envs=2, frictoin="lugre")


def test_a_controller_drives_every_sub_environment():
    """The preview driver takes four cars of different load through the cones, ends and begins anew."""
    vector = make(COURSE, randomise={"load": (0, 300)}, control_dt=0.01)
    driver = Controller(vector)
    observations, _ = vector.reset(seed=0)
    ends = 0
    for _ in range(1000):
        observations, _, terminated, truncated, info = vector.step(driver.act(observations))
        done = terminated | truncated
        if done.any():
            ends += int(done.sum())
            assert not info["metrics"]["cones_hit"][done].any()
            driver.reset(done)
    assert ends == ROWS


@pytest.mark.parametrize("threads", [1, 2])
def test_rows_of_every_block_are_those_of_single_environments(threads):
    """More sub-environments than go through a step together, and not a multiple of them."""
    n = 2 * ROWS_AT_ONCE + 3
    vector, rng = make(COURSE, n=n, threads=threads), np.random.default_rng(0)
    seen = [vector.reset(seed=0)[0]]
    actions = rng.uniform(-0.3, 0.3, (10, n, 1)).astype(np.float32)
    seen += [vector.step(action)[0] for action in actions]
    for i in (0, n // 2, ROWS_AT_ONCE - 1, ROWS_AT_ONCE, n - 1):
        env = gym.make(COURSE)
        expected = [env.reset(seed=i)[0], *(env.step(action[i])[0] for action in actions)]
        assert np.array_equal([each[i] for each in seen], expected)


def test_steps_keep_no_memory():
    vector = make(WEAVE, n=64, friction="masing")
    vector.reset(seed=0)
    actions, held = np.zeros((64, 1), np.float32), []
    tracemalloc.start()
    for _ in range(3):
        for _ in range(50):
            vector.step(actions)
        held.append(tracemalloc.get_traced_memory()[0])
    tracemalloc.stop()
    assert held[2] - held[1] < 2000  # [B] of 50 steps
