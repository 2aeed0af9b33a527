"""A copy of an environment goes on to the bit, whatever the moment: by its state, by pickle, by deepcopy."""

import copy
import dataclasses
import pickle
import subprocess
import sys
from functools import partial
from itertools import cycle

import gymnasium as gym
import numpy as np
import pytest
from gymnasium.vector import AutoresetMode

from steer_env import friction
from steer_env.engine.kernels import advance, step
from steer_env.friction.numerics.kernel import COMPILED
from steer_env.registration import DRIVEN
from steer_env.vehicle import road
from tests.needs import needs

LANE, WEAVE = "steer_env/DriverLaneKeeping-v3", "steer_env/AssistWeave-v3"
EVERYTHING = {"load": (0, 300), "friction_level": (0.5, 1.5), "sensor_noise": (0.5, 1), "delay": (0, 0.05)}
EVERYTHING |= {"action_gain": (0.8, 1.2), "action_lag": (0, 0.1), "friction": {"F_c": (0.5, 1.5)}}
MODES = [mode.value for mode in AutoresetMode]


def by_state(env, make_other):
    """Another environment, in the middle of another episode, that has taken the state."""
    other = make_other()
    other.reset(seed=99)
    vector = isinstance(other, gym.vector.VectorEnv)
    for _ in range(3):
        other.step(np.full((other.num_envs, 1) if vector else 1, 0.2, np.float32))
    other.unwrapped.set_state(pickle.loads(pickle.dumps(env.unwrapped.get_state())))
    return other


def by_pickle(env, make_other):
    return pickle.loads(pickle.dumps(env))


def by_deepcopy(env, make_other):
    return copy.deepcopy(env)


WAYS = [by_state, by_pickle, by_deepcopy]
every_way = pytest.mark.parametrize("way", WAYS)


def equal(one, other):
    """Whether two results of ``reset`` or ``step`` are the same to the bit."""
    if isinstance(one, dict):
        return one.keys() == other.keys() and all(equal(one[key], other[key]) for key in one)
    if isinstance(one, tuple):
        return len(one) == len(other) and all(map(equal, one, other))
    if isinstance(one, np.ndarray) and one.dtype == object:
        return equal(tuple(one), tuple(other))
    return np.array_equal(one, other, equal_nan=not isinstance(one, str | None))


def go_on(env, steps, seed=1):
    """Results of the next steps under random actions, with a reset after each episode's end."""
    rng, results = np.random.default_rng(seed), []
    for _ in range(steps):
        action = rng.uniform(-0.3, 0.3, env.action_space.shape).astype(np.float32)
        results.append(env.step(action))
        *_, terminated, truncated, _ = results[-1]
        over = np.atleast_1d(terminated | truncated)
        if isinstance(env, gym.vector.VectorEnv):
            if over.any() and env.autoreset_mode == AutoresetMode.DISABLED:
                results.append(env.reset(options={"reset_mask": over}))
        elif over[0]:
            results.append(env.reset())
    return tuple(results)


def test_what_differs_is_seen():
    """The comparison that all tests here rest on."""
    env = gym.make(LANE)
    env.reset(seed=0)
    one = go_on(env, 3)
    assert equal(one, copy.deepcopy(one))
    observation, reward, *_ = changed = list(copy.deepcopy(one[-1]))
    changed[0] = np.nextafter(observation, np.float32(9.0))
    assert not equal(one, (*one[:-1], tuple(changed)))
    changed[:2] = observation, np.nextafter(reward, 9.0)
    assert not equal(one, (*one[:-1], tuple(changed)))
    assert not equal({"a": None}, {"a": 1.0})


@pytest.mark.parametrize(("name", "way"), list(zip(DRIVEN, cycle(WAYS))))
def test_a_copy_goes_on_to_the_bit(name, way):
    """From the first and from a later step, with everything drawn; the original is stepped first."""
    made = partial(gym.make, name, randomise=EVERYTHING, control_dt=0.02)
    env = made()
    env.reset(seed=3)
    for before in (0, 150):
        go_on(env, before, seed=0)
        other = way(env, made)
        assert other is not env
        assert equal(go_on(env, 20), go_on(other, 20))
        assert other.unwrapped.np_random_seed == 3


@every_way
def test_a_copy_between_two_updates_of_a_driver_model(way):
    """At 1 ms the driver model acts at every tenth step."""
    made = partial(gym.make, "steer_env/AssistLaneKeeping-v3", randomise=EVERYTHING, control_dt=0.001)
    env = made()
    env.reset(seed=3)
    go_on(env, 1003, seed=0)
    assert equal(go_on(way(env, made), 20), go_on(env, 20))


@every_way
def test_the_end_of_an_episode_is_copied(way):
    """At its last step, after it, and into the next episodes, whose draws are the generator's."""
    made = partial(gym.make, LANE, randomise=EVERYTHING, control_dt=0.1)
    env, action = made(), np.ones(1, np.float32)
    env.reset(seed=0)
    ended = False
    while not ended:
        before = way(env, made)
        last = env.step(action)
        ended = last[2] or last[3]
    assert equal(last, before.step(action))
    after = way(env, made)
    for one in (env, before, after):
        with pytest.raises(RuntimeError, match="call reset"):
            one.unwrapped.step(action)
    first = env.reset()
    assert equal(first, before.reset())
    assert equal(first, after.reset())
    assert equal(go_on(env, 60), go_on(after, 60))


@pytest.mark.parametrize(("mode", "way"), list(zip(MODES, WAYS)))
def test_a_copied_vector_goes_on_to_the_bit(mode, way):
    """Through the ends of episodes at different times, from every moment around them."""
    made = partial(gym.make_vec, LANE, num_envs=3, randomise=EVERYTHING, control_dt=0.1, autoreset_mode=mode, threads=2)
    env, actions = made(), np.array([[1.0], [0.7], [0.0]], np.float32)
    env.reset(seed=[5, 8, 2])
    ends = 0
    for _ in range(40):
        other = way(env, made)
        result = env.step(actions)
        assert equal(result, other.step(actions))
        over = result[2] | result[3]
        if over.any():
            ends += 1
            other = way(env, made)  # while resets are pending
            if mode == AutoresetMode.DISABLED.value:
                for one in (env, other):
                    with pytest.raises(RuntimeError, match="call reset"):
                        one.step(actions)
                again = env.reset(options={"reset_mask": over})
                assert equal(again, other.reset(options={"reset_mask": over}))
            assert equal(go_on(copy.deepcopy(env), 30), go_on(other, 30))
    assert ends > 3


@pytest.mark.parametrize("way", [by_pickle, by_deepcopy])
def test_what_has_not_begun_is_copied(way):
    one, many = gym.make(WEAVE), gym.make_vec(WEAVE, num_envs=2)
    for env in (one, many):
        other = way(env, None)
        with pytest.raises(RuntimeError, match="call reset"):
            other.unwrapped.step(np.zeros(env.action_space.shape, np.float32))
        assert equal(env.reset(seed=4), other.reset(seed=4))
    state = gym.make(WEAVE).unwrapped.get_state()
    one.unwrapped.set_state(state)
    with pytest.raises(RuntimeError, match="call reset"):
        one.unwrapped.step(np.zeros(1, np.float32))


@pytest.mark.parametrize("way", [by_pickle, by_deepcopy])
def test_a_tuning_environment_is_copied_in_an_episode(way):
    """A set tried, and with it the best one so far; the prepared tests are not searched for again."""
    env = gym.make("steer_env/TuneOnCentre-v3", randomise={"load": (0, 300)}, friction="masing").unwrapped
    env.reset(seed=0)
    env.step(env.baseline_action)
    other = way(env, None)
    action = np.full(env.action_space.shape, 0.3, np.float32)
    for _ in range(7):
        one, two = env.step(action), other.step(action)
        assert equal(one[:4], two[:4])
    assert equal(one[4]["best"], two[4]["best"])
    assert one[3]
    assert equal(env.reset(), other.reset())


@pytest.mark.skipif(not COMPILED, reason="nothing is compiled")
def test_a_copy_compiles_nothing():
    """Arrays of a copy have the types of the original: a Masing set, a driver model and a road of its own."""
    arguments = {"friction": "masing", "chassis": "two_track", "road": road.iso8608(1, "B")}
    env = gym.make("steer_env/AssistLaneChange-v3", **arguments)
    env.reset(seed=0)
    compiled = [len(kernel.overloads) for kernel in (advance, step)]
    other = by_pickle(env, None)
    assert equal(go_on(env, 20), go_on(other, 20))
    assert equal(env.reset(seed=1), other.reset(seed=1))
    assert [len(kernel.overloads) for kernel in (advance, step)] == compiled
    assert other.unwrapped.task is env.unwrapped.batch.task is other.unwrapped.batch.task


CHILD = """
import pickle, sys
env, action = pickle.load(sys.stdin.buffer)
sys.stdout.buffer.write(pickle.dumps(env.step(action)))
"""


def test_another_process_goes_on():
    env, action = gym.make(LANE), np.array([0.1], np.float32)
    env.reset(seed=0)
    go_on(env, 10)
    done = subprocess.run(
        [sys.executable, "-c", CHILD], input=pickle.dumps((env, action)), check=True, capture_output=True
    )
    assert equal(env.step(action), pickle.loads(done.stdout))


def test_a_state_is_a_copy_that_can_be_taken_again():
    env = gym.make(LANE, randomise=EVERYTHING).unwrapped
    env.reset(seed=0)
    state = env.get_state()
    one = go_on(env, 20)
    for _ in range(2):
        env.set_state(state)
        assert equal(state.observations[0], env.batch.arrays.observations[0])
        assert equal(go_on(env, 20), one)


def test_a_vector_branches_from_the_state_of_a_single_environment():
    """Every branch is the single environment's future for its actions; longer and shorter episodes make room."""
    made = {"randomise": EVERYTHING, "control_dt": 0.01}
    env, vector = gym.make(LANE, **made).unwrapped, gym.make_vec(LANE, num_envs=4, **made)
    vector.reset(seed=7, options={"speed": 60.0})
    env.reset(seed=1)
    go_on(env, 30)
    state = env.get_state()
    vector.set_state(state)
    actions = np.linspace(-0.5, 0.5, 4, dtype=np.float32)[:, None]
    branches = [vector.step(actions)[:2] for _ in range(50)]
    assert len(np.unique(branches[-1][1])) == 4
    for i in range(4):
        env.set_state(state)
        for observations, rewards in branches:
            observation, reward, *_ = env.step(actions[i])
            assert np.array_equal(observation, observations[i])
            assert reward == rewards[i]
    env.set_state(vector.get_state().row(-1))
    assert equal(env.step(actions[3])[:2], tuple(part[3] for part in vector.step(actions)[:2]))
    fresh = gym.make_vec(LANE, num_envs=2, control_dt=0.01)
    fresh.set_state(state)  # needs no reset
    assert np.array_equal(fresh.get_state().observations, np.tile(state.observations, (2, 1)))


def test_without_its_generator_a_state_leaves_noise_and_draws_to_the_environment():
    env = gym.make(LANE, randomise={"sensor_noise": (1, 1)}, control_dt=0.01).unwrapped
    env.reset(seed=0)
    go_on(env, 20)
    vector = gym.make_vec(LANE, num_envs=2, control_dt=0.01)
    vector.reset(seed=5)
    vector.set_state(env.get_state(include_rng=False))
    assert vector.np_random_seed == (5, 6)
    for _ in range(130):
        observation, reward, *_, info = env.step(np.zeros(1, np.float32))
        observations, rewards, *_, infos = vector.step(np.zeros((2, 1), np.float32))
        assert np.array_equal(rewards, [reward] * 2)  # the drawn wind is known
        assert np.array_equal(infos["lateral_speed"], [info["lateral_speed"]] * 2)
        assert (np.abs(observations - observation).max(axis=1) > 0.0).all()
        assert np.abs(observations[0] - observations[1]).max() > 0.0
    vector.set_state(env.get_state())
    assert vector.np_random_seed == (0, 0)
    assert np.array_equal(vector.step(np.zeros((2, 1), np.float32))[0][1], env.step(np.zeros(1, np.float32))[0])


@pytest.mark.parametrize(
    ("name", "arguments", "message"),
    [
        (WEAVE, {}, f"does not fit this environment: id is '{LANE}' in the state and '{WEAVE}' here"),
        (LANE, {"vehicle": "ford_escort"}, r"car is 'compact \(.*' in the state and 'ford_escort \(.*' here"),
        (LANE, {"tyre": "example_mf61"}, r"car is 'compact \(.*' in the state and 'compact \(.*' here"),
        (LANE, {"friction": "masing"}, r"law is 'lugre@upper_column\+.* \(.*' in the state and 'masing \(.*' here"),
        (LANE, {"control_dt": 0.02}, "control_dt is '0.05 s' in the state and '0.02 s' here"),
        (LANE, {"chassis": "two_track"}, "chassis is 'single_track' in the state and 'two_track' here"),
        (LANE, {"chassis": "two_track", "road": road.iso8608(1, "C")}, "chassis is .*; road is 'the default' in the"),
    ],
)
def test_a_state_of_another_kind_is_refused(name, arguments, message):
    env = gym.make(LANE).unwrapped
    env.reset(seed=0)
    other = gym.make(name, **arguments).unwrapped
    before = other.reset(seed=0)[0]
    with pytest.raises(ValueError, match=message):
        other.set_state(env.get_state())
    assert np.array_equal(other.get_state().observations[0], before)  # nothing was taken


def test_a_state_of_another_driver_law_version_or_size_is_refused():
    name = "steer_env/AssistLaneKeeping-v3"
    env = gym.make(name).unwrapped
    env.reset(seed=0)
    state = env.get_state()
    with pytest.raises(ValueError, match=r"driver is .*'macadam'.* in the state and .*'preview'.* here"):
        env.set_state(gym.make(name, driver="macadam").unwrapped.get_state())
    few = gym.make(name, friction=friction.make("masing", elements=5)).unwrapped
    with pytest.raises(ValueError, match=r"masing \(\d+ numbers"):
        few.set_state(gym.make(name, friction="masing").unwrapped.get_state())
    with pytest.raises(ValueError, match="version 0, this release takes version 2: repeat the episode here"):
        env.set_state(dataclasses.replace(state, version=0))
    with pytest.raises(ValueError, match=r"the state has 2 .* this environment 1: take one by state.row\(i\)"):
        env.set_state(gym.make_vec(name, num_envs=2).get_state())
    with pytest.raises(TypeError, match="from get_state, got dict"):
        env.set_state(dataclasses.asdict(state))
    with pytest.raises(IndexError):
        state.row(1)


@needs("pygame")
@every_way
def test_pictures_of_a_copy(way):
    """A pickled picture shows the same; a state brings no trace along."""
    made = partial(gym.make, LANE, render_mode="rgb_array")
    env = made()
    env.reset(seed=0)
    go_on(env, 30)
    other = way(env, made)
    shown, also = env.render(), other.render()
    assert np.array_equal(shown, also) == (way is not by_state)
    assert np.mean(shown != also) < 0.2
    assert equal(go_on(env, 5), go_on(other, 5))
