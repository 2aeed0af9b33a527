"""Controllers by the names that commands take: zero and random action, baselines, trained policies."""

from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from steer_env import assists, drivers, tasks
from steer_env.experiments.learning import policy
from steer_env.experiments.learning.constants import SHIPPED, SUITES
from steer_env.experiments.learning.held_out import Controller

Maker = Callable[[Any], Controller]


class ZeroAction:
    """No torque: the car, its boost curve and, where the task has one, its driver alone."""

    def __init__(self, env: Any) -> None:
        self._shape = env.action_space.shape

    def reset(self, sub_environments: Any = None) -> None:
        """Nothing is kept."""

    def act(self, observation: NDArray[np.float32]) -> NDArray[np.float32]:
        """Actions (1,), or (N, 1) of a vector environment."""
        return np.zeros(self._shape, np.float32)


class RandomActions(ZeroAction):
    """Actions that are drawn evenly from [-1, 1] at every step, the same ones in every run."""

    def __init__(self, env: Any) -> None:
        super().__init__(env)
        self._rng = np.random.default_rng(0)

    def act(self, observation: NDArray[np.float32]) -> NDArray[np.float32]:
        """Actions (1,), or (N, 1) of a vector environment."""
        return self._rng.uniform(-1.0, 1.0, self._shape).astype(np.float32)


SIMPLE: dict[str, Maker] = {"zero": ZeroAction, "random": RandomActions}


def baselines(env_id: str) -> dict[str, Maker]:
    """Classical controllers of an id by name: assists with the best known options, or drivers on a path."""
    task = tasks.task(policy.check_driven(env_id))
    if task.name.startswith("Assist"):
        return {name: partial(assists.make, name) for name in assists.available()}
    observed = [quantity.name for quantity in task.task_observations]
    if "target_0.0s" in observed:
        return {"angle_servo": drivers.AngleServo}
    if "lateral_offset" in observed:
        models: dict[str, Any] = {name: name for name in drivers.available() if name != "free"}
        models["informed_preview"] = {"driver": "preview", "informed": True}
        return {name: partial(drivers.Controller, driver=model) for name, model in models.items()}
    return {}


def reference(env_id: str) -> str:
    """The baseline that scores 1 in an id in the benchmark, with the law of the car."""
    return {**SUITES["drivers"], **SUITES["assists"]}[policy.check_driven(env_id)]


def is_policy(name: str) -> bool:
    """Whether a name stands for a trained policy."""
    return name == SHIPPED or name.endswith(".zip")


def policy_path(name: str, env_id: str) -> Path:
    """The file of a policy that :func:`is_policy` accepts; ValueError if none is shipped with the id."""
    return policy.shipped_policy(env_id) if name == SHIPPED else Path(name)


def controller_named(name: str, env_id: str) -> Maker:
    """The controller of a name for an id.

    Raises
    ------
    ValueError
        If the name is neither of ``SIMPLE`` nor a baseline or a policy of the id, or the policy is of another id.
    """
    if is_policy(name):
        path = policy_path(name, env_id)
        policy.check_observations(path, policy.read_description(path), env_id)
        return policy.load(path)
    known = {**SIMPLE, **baselines(env_id)}
    if name not in known:
        names = ", ".join([*known, SHIPPED])
        raise ValueError(f"{name!r} is neither a policy.zip nor a controller of {env_id}: {names}")
    return known[name]
