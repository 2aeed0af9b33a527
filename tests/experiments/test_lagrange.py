"""The Lagrange multiplier of a training: penalised rewards, the estimated cost of an episode, and its state."""

import json

import numpy as np
import pytest
from gymnasium import spaces
from stable_baselines3.common.vec_env.base_vec_env import VecEnv

from steer_env.experiments.learning import lagrange, policy
from steer_env.experiments.learning.lagrange import PenalisedVecEnv
from steer_env.experiments.learning.training import Training
from tests.needs import needs

pytestmark = needs("stable_baselines3")


class Constant(VecEnv):
    """Two sub-environments with the reward 1 and a cost at every step, and episodes of five steps."""

    def __init__(self, cost):
        box = spaces.Box(-1.0, 1.0, (1,), np.float32)
        super().__init__(2, box, box)
        self.cost, self.steps = cost, 0

    def reset(self):
        return np.zeros((2, 1), np.float32)

    def step_async(self, actions):
        self.steps += 1

    def step_wait(self):
        done = np.full(2, self.steps % 5 == 0)
        return self.reset(), np.ones(2, np.float32), done, [{"cost": self.cost}] * 2

    def close(self):
        pass

    def get_attr(self, attr_name, indices=None):
        return [None, None]

    def set_attr(self, attr_name, value, indices=None):
        raise NotImplementedError

    def env_method(self, method_name, *method_args, indices=None, **method_kwargs):
        raise NotImplementedError

    def env_is_wrapped(self, wrapper_class, indices=None):
        return [False, False]


def rollout(env, steps=4):
    rewards = [env.step(np.zeros((2, 1), np.float32))[1] for _ in range(steps)]
    env.update(env.venv.steps)
    return rewards


def test_the_multiplier_rises_above_the_budget_and_falls_to_zero_below():
    env = PenalisedVecEnv(Constant(0.6), 1.0)
    env.reset()
    rollout(env)
    assert env.rows == []  # no episode has ended, so that its cost is not known
    rollout(env)
    assert env.rows == [(8, pytest.approx(3.0), pytest.approx(2.0 * lagrange.RATE), 1.0)]  # five steps of 0.6
    env.venv.cost = 0.0
    first = rollout(env)
    held = 2.0 * lagrange.RATE
    assert first[0] == pytest.approx(1.0 / (1.0 + held))
    assert env.rows[-1].cost == pytest.approx(1.5)  # the last two rollouts cover five steps
    for _ in range(10):
        rollout(env)
    assert env.multiplier == 0.0
    assert rollout(env)[0].tolist() == [1.0, 1.0]


def test_the_penalty_is_the_multiplier_times_the_cost():
    env = PenalisedVecEnv(Constant(0.6), 1.0)
    env.reset()
    for _ in range(10):
        rollout(env)
    held = env.multiplier
    assert held > 0.5
    assert rollout(env)[0] == pytest.approx((1.0 - 0.6 * held) / (1.0 + held))


def test_it_goes_on_from_its_state():
    one, other = (PenalisedVecEnv(Constant(0.6), 1.0) for _ in range(2))
    for env in (one, other):
        env.reset()
    for _ in range(3):
        rollout(one)
    other.set_state(json.loads(json.dumps(one.get_state())))
    other.venv.steps = one.venv.steps
    for _ in range(3):
        assert np.array_equal(rollout(one), rollout(other))
    assert one.get_state() == other.get_state()


def test_any_policy_within_the_budget_is_better_than_one_beyond():
    assert policy.score(3.0, 9.0, None) == policy.score(3.0, 1.0, 1.0) == 3.0
    assert policy.score(-1.0, 1.0, 1.0) > policy.score(20.0, 1.01, 1.0) > policy.score(20.0, 2.0, 1.0)


def test_bad_budgets(tmp_path):
    with pytest.raises(ValueError, match="cost_budget must be finite and greater than 0, got 0"):
        Training("steer_env/AssistWeave-v3", None, tmp_path / "run", cost_budget=0.0)
    with pytest.raises(ValueError, match=r"cost_budget needs an algorithm that trains on rollouts, .* got sac"):
        Training("steer_env/AssistWeave-v3", "sac", tmp_path / "run", cost_budget=1.0)
