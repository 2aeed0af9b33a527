"""Adapter for Stable-Baselines3, which does not accept Gymnasium's vector environments. Needs the extra ``train``."""

import time
import warnings
from collections.abc import Iterable, Sequence
from functools import cache
from typing import Any

import gymnasium as gym
import numpy as np
import torch
from gymnasium.vector import AutoresetMode
from numpy.typing import NDArray
from stable_baselines3.common.vec_env import VecEnv
from stable_baselines3.common.vec_env.base_vec_env import VecEnvIndices

from steer_env.engine.infos import require_full, row
from steer_env.friction.numerics.check import one_of
from steer_env.registration import REGISTERED

STARVED = 3.0  # how much longer a small network takes in torch's threads than in one before it is told; assumed [1]


class SteerVecEnv(VecEnv):
    """``num_envs`` environments of an id for Stable-Baselines3.

    Every info has the step's ``cost`` and, of the driving ids, ``failure``. A sub-environment whose episode ends is
    reset at once; its info is then the whole one of that step, as a single environment gives it, with
    ``terminal_observation`` and ``TimeLimit.truncated``. ``reset_infos`` has the whole infos of ``reset``. To give
    whole infos at every step would take a fifth of the time. VecMonitor, VecNormalize, VecVideoRecorder,
    EvalCallback and so on wrap it as usual.

    A small network is often slower in several threads of torch than in one, by a hundred times where other programs or
    a container leave fewer processors than torch believes. The first step of a process measures that and warns.

    Parameters
    ----------
    env_id : str
        An id of this package.
    num_envs : int
        Number of sub-environments.
    arguments :
        As :class:`steer_env.vector.SteerVectorEnv`, or of a tuning id :class:`steer_env.tuning.TuneVectorEnv`, without
        ``autoreset_mode``.

    Raises
    ------
    ValueError
        The id is not one of this package, ``vector_reward`` is given, as Stable-Baselines3 takes one number, or an
        ``info_level`` without ``cost`` and ``failure``.
    """

    def __init__(self, env_id: str, num_envs: int, **arguments: Any) -> None:
        one_of("env_id", env_id, REGISTERED)
        if arguments.get("vector_reward"):
            raise ValueError(
                "vector_reward must be False for Stable-Baselines3, whose rewards are numbers, got True: leave it out, "
                "and use gymnasium.make_vec where rewards are to be arrays"
            )
        require_full(arguments.get("info_level", "full"), "Stable-Baselines3, whose infos have cost and failure")
        self.vector: Any = gym.make_vec(env_id, num_envs, autoreset_mode=AutoresetMode.SAME_STEP, **arguments)
        super().__init__(num_envs, self.vector.single_observation_space, self.vector.single_action_space)
        self.metadata = self.vector.metadata
        self._actions: NDArray[np.float32] | None = None

    def reset(self) -> NDArray[np.float32]:
        """Start an episode in every sub-environment, with what ``seed`` and ``set_options`` have set."""
        options = self._options[0] if self._options else {}
        if any(other != options for other in self._options):
            raise ValueError("the sub-environments of a vector environment share their reset options")
        observations, info = self.vector.reset(
            seed=self._seeds if any(s is not None for s in self._seeds) else None, options=options
        )
        self.reset_infos = [row(info, i) for i in range(self.num_envs)]
        self._reset_seeds()
        self._reset_options()
        return observations

    def step_async(self, actions: NDArray[np.float32]) -> None:
        """Keep the actions (num_envs, A) for ``step_wait``; the first of a process looks at torch's threads."""
        _look_at_threads()
        self._actions = actions

    def step_wait(self) -> tuple[NDArray[np.float32], NDArray[np.float32], NDArray[np.bool_], list[dict[str, Any]]]:
        """Observations, rewards, whether episodes ended, infos."""
        observations, rewards, terminated, truncated, info = self.vector.step(self._actions)
        costs, done = info["cost"].tolist(), terminated | truncated
        infos: list[dict[str, Any]]
        if "failure" in info:
            infos = [{"cost": cost, "failure": code} for cost, code in zip(costs, info["failure"].tolist())]
        else:  # nothing fails in a tuning environment
            infos = [{"cost": cost} for cost in costs]
        for i in np.flatnonzero(done).tolist():
            infos[i] = {
                **row(info["final_info"], i),
                "terminal_observation": info["final_obs"][i],
                "TimeLimit.truncated": bool(truncated[i] and not terminated[i]),
            }
        return observations, rewards.astype(np.float32), done, infos

    def close(self) -> None:
        """Stop the threads or worker processes."""
        self.vector.close()

    def get_attr(self, attr_name: str, indices: VecEnvIndices = None) -> list[Any]:
        """An attribute of the vector environment, once for every sub-environment asked for."""
        return [getattr(self.vector, attr_name) for _ in self._get_indices(indices)]

    def set_attr(self, attr_name: str, value: Any, indices: VecEnvIndices = None) -> None:
        """Set an attribute of the vector environment; its sub-environments share it."""
        if len(list(self._get_indices(indices))) != self.num_envs:
            raise ValueError(f"the sub-environments share {attr_name!r}: it cannot be set for some of them only")
        setattr(self.vector, attr_name, value)

    def env_method(self, method_name: str, *args: Any, indices: VecEnvIndices = None, **kwargs: Any) -> list[Any]:
        """Refused: sub-environments are rows of arrays, not objects with methods."""
        raise NotImplementedError(f"the sub-environments have no method {method_name!r} of their own")

    def env_is_wrapped(self, wrapper_class: type, indices: VecEnvIndices = None) -> list[bool]:
        """False for every sub-environment: none has a wrapper."""
        return [False for _ in self._get_indices(indices)]

    def get_images(self) -> Sequence[NDArray[np.uint8] | None]:
        """The present picture of each sub-environment, with ``render_mode="rgb_array"``."""
        return self.vector.render() or [None] * self.num_envs

    def _get_indices(self, indices: VecEnvIndices) -> Iterable[int]:
        return range(self.num_envs) if indices is None else super()._get_indices(indices)


@cache
def _look_at_threads() -> None:
    """Warn, once in a process, where two layers of 64 take much longer in torch's threads than in one."""
    threads = torch.get_num_threads()
    if threads == 1:
        return
    many = _layers_time()
    torch.set_num_threads(1)
    try:
        one = _layers_time()
    finally:
        torch.set_num_threads(threads)
    if many > STARVED * one:
        warnings.warn(
            f"torch computes in {threads} threads, in which two layers of 64 take {1e3 * many:.3g} ms for a batch of "
            f"2048, and {1e3 * one:.3g} ms in one: with a network of this size call torch.set_num_threads(1) before "
            "the training",
            stacklevel=4,
        )


def _layers_time() -> float:
    """Median time of two layers of 64 for a batch [s]; nothing is drawn, so that a training is the same."""
    x, first, second = torch.ones(2048, 32), torch.ones(64, 32), torch.ones(64, 64)
    times = []
    for _ in range(6):  # the first of which starts the threads
        start = time.perf_counter()
        with torch.no_grad():
            torch.tanh(torch.tanh(x @ first.T) @ second.T)
        times.append(time.perf_counter() - start)
    return float(np.median(times[1:]))
