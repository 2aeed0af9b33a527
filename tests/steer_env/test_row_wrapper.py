"""A wrapper of one's own is the same in single environments, in vector environments and for Stable-Baselines3."""

import gymnasium as gym
import numpy as np
import pytest
from gymnasium.envs.registration import EnvSpec
from gymnasium.vector import AutoresetMode

from steer_env import RowWrapper
from steer_env.registration import id_of
from tests.needs import needs

ID = id_of("AssistRelease")


class Smooth(RowWrapper):
    """Halves the action, shows the last one and how many were seen since the reset, and punishes changes."""

    def __init__(self, num_envs, observation_space, action_space):
        super().__init__(num_envs, observation_space, action_space)
        low, high = observation_space.low, observation_space.high
        self.observation_space = gym.spaces.Box(
            *(np.float32(np.append(*ends)) for ends in ((low, [-1.0, 0.0]), (high, [1.0, np.inf])))
        )
        self.last, self.change, self.seen = (np.zeros((num_envs, 1), np.float32) for _ in range(3))

    def reset(self, rows):
        self.last[rows] = self.seen[rows] = 0.0

    def action(self, actions):
        self.change, self.last = actions - self.last, actions.copy()
        return 0.5 * actions

    def reward(self, rewards, info):
        return rewards - self.change[:, 0] ** 2 - 0.0 * info["cost"]

    def observation(self, observations, rows):
        self.seen[rows] += 1.0
        return np.hstack([observations, self.last[rows], self.seen[rows]])


def actions(steps, n):
    return np.random.default_rng(3).uniform(-1.0, 1.0, (steps, n, 1)).astype(np.float32)


def test_a_single_environment_does_what_the_class_says():
    env, plain = gym.make(ID, wrapper=Smooth), gym.make(ID)
    observation, _ = env.reset(seed=1)
    expected, _ = plain.reset(seed=1)
    np.testing.assert_array_equal(observation, [*expected, 0.0, 1.0])
    assert env.observation_space.contains(observation)
    last = 0.0
    for k, action in enumerate(actions(20, 1)[:, 0]):
        observation, reward, *_ = env.step(action)
        expected, own, *_ = plain.step(0.5 * action)
        np.testing.assert_array_equal(observation, np.float32([*expected, action[0], k + 2]))
        assert reward == own - (action[0] - np.float32(last)) ** 2
        last = action[0]


def episodes(env, seeds, steps):
    """Observations, rewards and ends of a vector environment, a list over the steps."""
    rows = [(env.reset(seed=seeds)[0], None, None)]
    for action in actions(steps, env.num_envs):
        observation, reward, terminated, truncated, _ = env.step(action)
        rows.append((observation, reward, terminated | truncated))
    return rows


@pytest.mark.parametrize("mode", [AutoresetMode.NEXT_STEP, AutoresetMode.SAME_STEP])
def test_a_vector_environment_equals_single_ones_through_their_resets(mode):
    arguments = {"control_dt": 0.1, "max_episode_steps": 7, "wrapper": Smooth}
    env = gym.make_vec(ID, num_envs=3, autoreset_mode=mode, **arguments)
    found = episodes(env, [5, 6, 7], 20)
    others = gym.vector.SyncVectorEnv([lambda: gym.make(ID, **arguments)] * 3, autoreset_mode=mode)
    expected = episodes(others, [5, 6, 7], 20)
    assert sum(done.all() for _, _, done in found[1:]) >= 2
    for one, other in zip(found, expected):
        for mine, theirs in zip(one, other):
            np.testing.assert_array_equal(mine, theirs)


def test_the_end_of_an_episode_has_the_observation_of_the_wrapper():
    env = gym.make_vec(ID, num_envs=2, autoreset_mode="SameStep", max_episode_steps=3, wrapper=Smooth)
    env.reset(seed=1)
    *_, info = [env.step(action) for action in actions(3, 2)][-1]
    np.testing.assert_array_equal(np.stack(info["final_obs"])[:, -1], [4.0, 4.0])


def test_a_reset_of_some_rows_shows_the_wrapper_no_others():
    env = gym.make_vec(ID, num_envs=2, autoreset_mode="Disabled", wrapper=Smooth)
    env.reset(seed=1)
    env.step(actions(1, 2)[0])
    observations, _ = env.reset(options={"reset_mask": np.array([True, False])})
    np.testing.assert_array_equal(observations[:, -1], [1.0, 2.0])


@needs("stable_baselines3")
def test_stable_baselines3_sees_the_same():
    from steer_env.sb3 import SteerVecEnv

    env = SteerVecEnv(ID, 2, max_episode_steps=5, wrapper=Smooth)
    vector = gym.make_vec(ID, num_envs=2, max_episode_steps=5, autoreset_mode="SameStep", wrapper=Smooth)
    env.seed(3)
    np.testing.assert_array_equal(env.reset(), vector.reset(seed=3)[0])
    for action in actions(12, 2):
        observations, rewards, done, infos = env.step(action)
        expected, own, *_, info = vector.step(action)
        np.testing.assert_array_equal(observations, expected)
        np.testing.assert_array_equal(rewards, own.astype(np.float32))
        if done.any():
            np.testing.assert_array_equal(infos[1]["terminal_observation"], info["final_obs"][1])
    assert env.observation_space == vector.single_observation_space


def test_the_specification_names_the_wrapper():
    env = gym.make(ID, wrapper=Smooth)
    assert env.spec.kwargs["wrapper"] == f"{__name__}:Smooth"
    again = gym.make(EnvSpec.from_json(env.spec.to_json()))
    np.testing.assert_array_equal(again.reset(seed=2)[0], env.reset(seed=2)[0])


def test_what_is_no_wrapper_or_gives_another_shape_is_refused():
    with pytest.raises(ValueError, match=r"wrapper must be a subclass of steer_env\.RowWrapper.*ClipAction"):
        gym.make(ID, wrapper=gym.wrappers.ClipAction)

    class Short(RowWrapper):
        def observation(self, observations, rows):
            return observations[:, :2]

    with pytest.raises(ValueError, match=r"Short\.observation must give \(3, \d+\), .* got \(3, 2\)"):
        gym.make_vec(ID, num_envs=3, wrapper=Short).reset(seed=1)


def test_a_base_class_changes_nothing():
    env, plain = (gym.make_vec(ID, num_envs=2, **given) for given in ({"wrapper": RowWrapper}, {}))
    np.testing.assert_array_equal(env.reset(seed=1)[0], plain.reset(seed=1)[0])
    for mine, theirs in zip(env.step(actions(1, 2)[0])[:2], plain.step(actions(1, 2)[0])[:2]):
        np.testing.assert_array_equal(mine, theirs)
