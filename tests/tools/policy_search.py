"""Search for policies without mercy: the cross-entropy method on linear policies, and PPO as it comes.

It is meant for auditing a reward, not for good controllers: what it finds shows what the reward pays for.
"""

from typing import Any, NamedTuple

import gymnasium as gym
import numpy as np
from numpy.typing import NDArray

from steer_env.experiments.learning import held_out

Array = NDArray[np.float64]

AUDITED = 3_000_000  # first seed of the episodes of a search: neither those of training nor those of evaluations


class Budget(NamedTuple):
    """Size of a search."""

    rounds: int = 12
    candidates: int = 24  # of a round
    best: int = 6  # around which the next round draws
    episodes: int = 4  # for each candidate
    steps: int = 100_000  # of PPO, summed over its sub-environments


def over_usual(env: Any) -> Array:
    """Factors (O,) on the observations of an environment that make them multiples of their usual sizes."""
    factors: Array = env.unwrapped.observation_scale / np.array([each.usual for each in env.unwrapped.batch.observed])
    return factors


class LinearPolicy:
    """A policy whose action is a weighted sum of the scaled observations, clipped.

    Parameters
    ----------
    env : gym.Env or gym.vector.VectorEnv
        Of any driving id.
    weights : (O,) or (n, O) array
        On the observations over their usual sizes; one row for each sub-environment, or the same for all.
    """

    def __init__(self, env: Any, weights: Array) -> None:
        self._scale = over_usual(env)
        self.weights = weights

    def reset(self, rows: Any = slice(None)) -> None:
        """A linear policy remembers nothing."""

    def act(self, observation: NDArray[np.float32]) -> NDArray[np.float32]:
        """Action (1,) for an observation (O,), or (n, 1) for (n, O)."""
        action = np.clip((observation * self._scale * self.weights).sum(axis=-1, keepdims=True), -1.0, 1.0)
        return action.astype(np.float32)


def cross_entropy(env_id: str, budget: Budget, seed: int = 0, **arguments: Any) -> Array:
    """Weights (O,) of the linear policy with the largest mean return that the cross-entropy method finds."""
    env: Any = gym.make_vec(env_id, num_envs=budget.candidates * budget.episodes, **arguments)
    size = len(env.unwrapped.batch.observed)
    rng = np.random.default_rng(seed)
    mean, spread = np.zeros(size), np.full(size, 0.3)
    seeds = [AUDITED + k for k in range(budget.episodes)] * budget.candidates
    found, highest = mean, -np.inf
    for _ in range(budget.rounds):
        tried = mean + spread * rng.standard_normal((budget.candidates, size))
        tried[0] = mean
        policy = LinearPolicy(env, np.repeat(tried, budget.episodes, axis=0))
        rewards = held_out.drive(env, policy, seeds).reward
        scores = rewards.reshape(budget.candidates, budget.episodes).mean(axis=1)
        order = np.argsort(scores)
        if scores[order[-1]] > highest:
            found, highest = tried[order[-1]], scores[order[-1]]
        best = tried[order[-budget.best :]]
        mean, spread = best.mean(axis=0), best.std(axis=0) + 0.01
    env.close()
    return found


def plain_ppo(env_id: str, budget: Budget, seed: int = 0, **arguments: Any) -> Any:
    """A model of PPO with the defaults of Stable-Baselines3."""
    import torch
    from stable_baselines3 import PPO

    from steer_env.sb3 import SteerVecEnv

    torch.set_num_threads(1)  # more threads are slower with networks of this size
    model = PPO("MlpPolicy", SteerVecEnv(env_id, 8, **arguments), seed=seed, device="cpu")
    model.learn(budget.steps)
    return model


class ModelPolicy:
    """The deterministic policy of a model of Stable-Baselines3, which saw observations over their usual sizes."""

    def __init__(self, model: Any, env: Any) -> None:
        self._model, self._scale = model, over_usual(env)

    def reset(self, rows: Any = slice(None)) -> None:
        """A policy without recurrence remembers nothing."""

    def act(self, observation: NDArray[np.float32]) -> NDArray[np.float32]:
        """Action (1,) for an observation (O,), or (n, 1) for (n, O)."""
        return self._model.predict(observation * self._scale, deterministic=True)[0]
