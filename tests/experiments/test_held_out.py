"""Held-out episodes: their sums are those of single environments, whenever each of them ends."""

import gymnasium as gym
import numpy as np
import pytest

from steer_env.experiments.learning import held_out

LANE = "steer_env/DriverLaneKeeping-v3"


class Constant:
    """A constant action of each row."""

    def __init__(self, actions):
        self.actions = np.array(actions, np.float32)[:, None]

    def reset(self, rows=slice(None)):
        pass

    def act(self, observation):
        return self.actions


def test_what_follows_the_end_of_an_episode_does_not_count():
    """The vector environment begins another one while the longest goes on."""
    actions, lengths = [1.0, 0.7, 0.0], []
    env = gym.make_vec(LANE, num_envs=3, control_dt=0.1)
    found = held_out.drive(env, Constant(actions), 2)
    for i, action in enumerate(actions):
        single, reward, cost, over, steps = gym.make(LANE, control_dt=0.1), 0.0, 0.0, False, 0
        single.reset(seed=2 + i)
        while not over:
            _, each, terminated, truncated, info = single.step(np.array([action], np.float32))
            reward, cost, over, steps = reward + each, cost + info["cost"], terminated or truncated, steps + 1
        assert (found.reward[i], found.cost[i]) == pytest.approx((reward, cost), rel=1e-12)
        assert found.failure[i] == info["failure"]
        lengths.append(steps)
    assert len({*lengths}) == 3
