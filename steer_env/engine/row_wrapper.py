"""A wrapper of one's own around rows: the same class for single environments, vector environments and SteerVecEnv.

Gymnasium and Stable-Baselines3 have a kind of wrapper each for single and for vector environments, and a wrapper of a
single environment that is applied to each of many makes a vector environment as slow as they are together. A
:class:`RowWrapper` is applied within the environment, once for all rows.
"""

from typing import Any

import gymnasium as gym
import numpy as np
from gymnasium.envs.registration import load_env_creator
from numpy.typing import NDArray

Rows = slice | NDArray[np.int_]  # which sub-environments the rows of an array are of
ALL = slice(None)


class RowWrapper:
    """Base of a wrapper of one's own, which may change observations, actions and rewards.

    ``gymnasium.make(id, wrapper=Mine)``, ``gymnasium.make_vec(id, num_envs=N, wrapper=Mine)`` and
    ``steer_env.sb3.SteerVecEnv(id, N, wrapper=Mine)`` apply it alike. Each method takes rows, one alone in a single
    environment; what is written in numpy costs one call for all of them. ``rows`` indexes arrays (N, ...) that the
    wrapper keeps. In a step come ``action``, ``reward`` and ``observation``; where episodes begin, ``reset`` and
    ``observation`` of these rows. ``get_state`` does not hold what a wrapper keeps.

    Attributes
    ----------
    num_envs : int
        N, 1 in a single environment.
    observation_space, action_space : gymnasium.spaces.Box
        Of one row; a subclass whose observations or actions have another shape sets them in its constructor.
    """

    def __init__(self, num_envs: int, observation_space: gym.spaces.Box, action_space: gym.spaces.Box) -> None:
        self.num_envs, self.observation_space, self.action_space = num_envs, observation_space, action_space

    def reset(self, rows: Rows) -> None:
        """Forget the episodes of some rows."""

    def action(self, actions: NDArray[np.float32]) -> NDArray[np.float32]:
        """Actions (N, 1) in [-1, 1] of the environment for those of the policy (N, ...)."""
        return actions

    def reward(self, rewards: NDArray[np.float64], info: dict[str, Any]) -> NDArray[np.float64]:
        """Rewards (N,) for those of the environment; ``info`` has arrays (N,), in a single environment numbers."""
        return rewards

    def observation(self, observations: NDArray[np.float32], rows: Rows) -> NDArray[np.float32]:
        """Observations (n, ...) for those of the environment (n, O), of some rows."""
        return observations


def wrapper_of(given: Any, num_envs: int, observation_space: gym.spaces.Box, action_space: gym.spaces.Box) -> Any:
    """The wrapper of an environment by its argument: a class, or ``"module:Class"``; None for none.

    Raises
    ------
    ValueError
        It is no subclass of :class:`RowWrapper`, as a wrapper of Gymnasium is not.
    """
    if given is None:
        return None
    kind: Any = load_env_creator(given) if isinstance(given, str) and ":" in given else given
    if not (isinstance(kind, type) and issubclass(kind, RowWrapper)):
        raise ValueError(
            "wrapper must be a subclass of steer_env.RowWrapper, or its place as 'module:Class', "
            f"got {given!r}; wrappers of Gymnasium go around the environment that make or make_vec gives"
        )
    return kind(num_envs, observation_space, action_space)


def observed(wrapper: RowWrapper, observations: NDArray[np.float32], rows: Rows) -> NDArray[np.float32]:
    """The observations (n, ...) that a wrapper makes of those of some rows; ValueError where its space says another."""
    found = np.asarray(wrapper.observation(observations, rows), np.float32)
    expected = (len(observations), *wrapper.observation_space.shape)
    if found.shape != expected:
        raise ValueError(
            f"{type(wrapper).__name__}.observation must give {expected}, by its observation_space, got {found.shape}"
        )
    return found
