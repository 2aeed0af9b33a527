"""Controllers on held-out episodes: the same seeds for each, and every metric with its interval."""

from collections.abc import Callable, Mapping, Sequence
from typing import Any, NamedTuple, Protocol

import gymnasium as gym
import numpy as np
from numpy.typing import NDArray
from scipy import stats

from steer_env.engine.infos import require_full
from steer_env.experiments.learning.constants import HELD_OUT

Array = NDArray[np.float64]

CONFIDENCE_LEVEL = 0.95  # of the intervals


class Controller(Protocol):
    """A controller of a batch of episodes: a driver model, an assist or a trained policy."""

    def reset(self, sub_environments: Any = ...) -> None:
        """Forget the episodes of some rows of the batch (mask or indices), or of all."""

    def act(self, observation: NDArray[np.float32]) -> NDArray[np.float32]:
        """Actions (N, 1) for observations (N, O)."""


class Episodes(NamedTuple):
    """Results of one controller; each array is (N,), in the order of the seeds."""

    reward: Array  # sum over the episode
    cost: Array  # sum over the episode
    failure: NDArray[np.int64]  # at the end: place among the failures of the tasks, 0 for none
    metrics: dict[str, Array]  # episode metrics of the task


class Estimate(NamedTuple):
    """A value with its 95 % interval."""

    value: float  # [unit of the metric]
    low: float  # [unit of the metric]
    high: float  # [unit of the metric]


class Job(NamedTuple):
    """A controller that a worker evaluates."""

    label: str
    env_id: str
    make: Callable[[Any], Controller]
    episodes: int
    options: Mapping[str, float] = {}  # of every reset, such as a scenario
    arguments: Mapping[str, Any] = {}  # of the environment


def evaluate(job: Job) -> Episodes:
    """The held-out episodes of a job."""
    return collect(job.env_id, job.make, job.episodes, options=job.options, **job.arguments)


def job_label(job: Job) -> str:
    """The label of a job, for messages."""
    return job.label


def collect(
    env_id: str,
    make: Callable[[Any], Controller],
    episodes: int,
    first_seed: int = HELD_OUT,
    options: Mapping[str, float] | None = None,
    **arguments: Any,
) -> Episodes:
    """One episode for each seed from ``first_seed`` on, in one vector environment; ``options`` are those of resets."""
    env: Any = gym.make_vec(env_id, num_envs=episodes, **arguments)
    found = drive(env, make(env), first_seed, options)
    env.close()
    return found


def drive(
    env: Any, controller: Controller, seed: int | Sequence[int], options: Mapping[str, float] | None = None
) -> Episodes:
    """One episode in every sub-environment of a vector environment; ``seed`` and ``options`` are those of its reset.

    ValueError for an environment whose ``info_level`` leaves out cost, failure or metrics.
    """
    require_full(env.unwrapped.info_level, "held-out episodes, of which cost, failure and metrics are told")
    episodes = env.num_envs
    controller.reset()
    observation, _ = env.reset(seed=seed, options=dict(options or {}))
    reward, cost, going = np.zeros(episodes), np.zeros(episodes), np.ones(episodes, bool)
    failure, metrics = np.zeros(episodes, np.int64), dict[str, Array]()
    while going.any():
        observation, rewards, terminated, truncated, info = env.step(controller.act(observation))
        reward += np.where(going, rewards, 0.0)
        cost += np.where(going, info["cost"], 0.0)
        ended = going & (terminated | truncated)
        failure[ended] = info["failure"][ended]
        if ended.any():
            for name, values in info["metrics"].items():
                if not name.startswith("_"):
                    metrics.setdefault(name, np.zeros(episodes))[ended] = values[ended]
        going &= ~ended
    return Episodes(reward, cost, failure, metrics)


def mean(values: Array) -> Estimate:
    """Mean with Student's interval."""
    value, n = float(np.mean(values)), values.size
    if n < 2:
        return Estimate(value, np.nan, np.nan)
    half = float(stats.t.ppf(0.5 + 0.5 * CONFIDENCE_LEVEL, n - 1) * np.std(values, ddof=1) / np.sqrt(n))
    return Estimate(value, value - half, value + half)


def share(hits: NDArray[np.bool_]) -> Estimate:
    """Share of the episodes in which ``hits`` is true, with Wilson's interval."""
    result = stats.binomtest(int(hits.sum()), hits.size)
    interval = result.proportion_ci(CONFIDENCE_LEVEL, "wilson")
    return Estimate(float(result.statistic), float(interval.low), float(interval.high))


def summary(found: Episodes) -> dict[str, Estimate]:
    """Means of reward, cost and the task's metrics, and shares: of episodes that failed, and without a cone hit."""
    values = {"reward": mean(found.reward), "cost": mean(found.cost), "failed_share": share(found.failure != 0)}
    values |= {name: mean(column) for name, column in found.metrics.items()}
    if "cones_hit" in found.metrics:
        values["clean_share"] = share(found.metrics["cones_hit"] == 0.0)
    return values


def differences(found: Episodes, reference: Episodes) -> dict[str, Estimate]:
    """Means of ``found`` less ``reference``, paired by seed."""
    pairs: Mapping[str, tuple[Array, Array]] = {
        "reward": (found.reward, reference.reward),
        "cost": (found.cost, reference.cost),
        **{name: (column, reference.metrics[name]) for name, column in found.metrics.items()},
    }
    return {name: mean(one - other) for name, (one, other) in pairs.items()}
