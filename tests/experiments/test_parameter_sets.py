"""Parameter sets of tuning environments as a sweep."""

import gymnasium as gym
import numpy as np
import pytest

from steer_env.experiments.learning import parameter_sets
from tests.steer_env.test_state import equal

ENV = "steer_env/TuneOnCentre-v3"
ARGUMENTS = {"randomise": {"load": (0, 300)}, "vector_reward": True}
CONTEXTS = [{"speed": 25.0}, {"friction_level": 2.0}]


def evaluated(**options):
    actions = np.random.default_rng(0).uniform(-0.5, 0.5, (3, 8))
    return actions, parameter_sets.evaluate(
        ENV, actions, arguments=ARGUMENTS, contexts=CONTEXTS, seed=4, together=2, **options
    )


def test_are_those_of_the_environment():
    actions, found = evaluated()
    assert [len(each) for each in found] == [3, 3]
    for context, results in zip(CONTEXTS, found, strict=True):
        env = gym.make(ENV, **ARGUMENTS).unwrapped
        env.reset(seed=4, options=context)
        for action, result in zip(actions, results, strict=True):
            _, reward, _, _, info = env.step(action.astype(np.float32))
            assert np.array_equal(reward, result.reward)
            assert equal(info["evaluated"], result.info["evaluated"])
            assert env.refused == result.refused


def test_bad_input():
    with pytest.raises(ValueError, match=r"env_id must be one of steer_env/TuneAllRound-v3, .*got 'CartPole-v1'"):
        parameter_sets.evaluate("CartPole-v1", np.zeros((1, 5)))
    with pytest.raises(ValueError, match=r"actions must be an array \(K, n\) with at least one row, got shape \(5,\)"):
        parameter_sets.evaluate(ENV, np.zeros(5))
    with pytest.raises(ValueError, match="unknown reset option 'delay'"):
        parameter_sets.evaluate(ENV, np.zeros((1, 5)), contexts=[{"delay": 1.0}])
