"""Tuning ids in the benchmark: what the episode of a tuner is worth, and baselines.

A tuner chooses parameter sets of an assist that is out of tune, one a step, and sees the metrics of the last one. Its
episode is worth the reward of the best set that it has tried.
"""

from collections.abc import Callable, Generator, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import lsq_linear

from steer_env.experiments.learning.held_out import Controller, Episodes
from steer_env.tuning.env import observed_quantities, wanted_metrics
from steer_env.tuning.reward import MAX_DISTANCE
from steer_env.vehicle.steering.margins import TARGETS as MARGINS

Array = NDArray[np.float64]

SETS = 12  # in an episode
# Drawn for every seed, so that other metrics are wanted in each; assumed.
DRAWN_RANGES = {"load": (0.0, 300.0), "friction_level": (0.5, 2.0), "speed": (22.0, 36.0)}
SETTINGS = {"sets": SETS, "randomise": DRAWN_RANGES, "workers": 1}  # of the environment; the sweep has the processes
JACOBIAN_STEP = 0.25  # of a parameter for its column of the Jacobian, and first radius of the steps, assumed [1]
RIDGE = 0.05  # that a change of a parameter by 1 costs beside the distances of the metrics, assumed [1]


def tune(env: Any, tuner: Controller, seeds: Sequence[int]) -> Episodes:
    """An episode in every sub-environment; reward and cost are those of the best set."""
    tuner.reset()
    observation, _ = env.reset(seed=seeds)
    cost, best = np.zeros(env.num_envs), np.full(env.num_envs, -np.inf)
    for _ in range(SETS):
        observation, rewards, _, _, info = env.step(tuner.act(observation))
        better = rewards > best
        best[better], cost[better] = rewards[better], info["cost"][better]
    return Episodes(best, cost, np.zeros(env.num_envs, np.int64), {})


class OwnAssist:
    """The car's own assist, which the wanted bands are made about and an episode does not tell."""

    def __init__(self, env: Any) -> None:
        self._envs = env.unwrapped.envs

    def reset(self, sub_environments: Any = None) -> None:
        """Nothing is kept."""

    def act(self, observation: NDArray[np.float32]) -> NDArray[np.float32]:
        """Actions (N, n)."""
        return np.array([env.own_action for env in self._envs])


class GaussNewton:
    """Least squares of the wanted metrics (Gauss and Newton), with a Jacobian that follows (Broyden).

    The residuals are the distances of the observed metrics from the middles of the wanted bands, in widths of the
    target bands, and the shortfalls of the margins.
    """

    def __init__(self, env: Any) -> None:
        self._n, self._size = env.action_space.shape
        first = env.unwrapped.envs[0]
        names, aims = (
            [quantity.name for quantity in observed_quantities(first.scenario)],
            wanted_metrics(first.scenario),
        )
        self._widths = np.array([np.ptp(first.terms[name].band.good) for name in aims])
        self._wanted = [names.index(f"wanted_{name}") for name in aims]
        self._metrics = [names.index(name) for name in aims]
        self._margins = [names.index(name) for name in ("phase_margin", "gain_margin")]
        self._refused = names.index("refused")

    def reset(self, sub_environments: Any = None) -> None:
        """Begin anew in every sub-environment."""
        self._searches = [_search(self._size) for _ in range(self._n)]
        self._begun = False

    def act(self, observation: NDArray[np.float32]) -> NDArray[np.float32]:
        """Actions (N, n)."""
        seen = observation.astype(float)
        distance = (seen[:, self._metrics] - seen[:, self._wanted]) / self._widths
        shortfall = np.maximum(0.0, 1.0 - seen[:, self._margins] / MARGINS)
        residuals = np.column_stack([distance, shortfall])
        residuals[seen[:, self._refused] > 0.0] = MAX_DISTANCE  # that of a refused metric in the reward
        told = residuals if self._begun else [None] * self._n
        self._begun = True
        return np.array([search.send(each) for search, each in zip(self._searches, told)], np.float32)


def _search(size: int) -> Generator[Array, Array, None]:
    """Sets (size,) to be tried, without an end; each is answered with its residuals (R,)."""
    best = np.zeros(size)
    least = start = yield best
    J = np.zeros((start.size, size))
    for j, step in enumerate(JACOBIAN_STEP * np.eye(size)):
        J[:, j] = ((yield step) - start) / JACOBIAN_STEP
    radius = JACOBIAN_STEP
    while True:
        # Levenberg's ridge keeps parameters that change nothing where they are.
        system = np.vstack([J, RIDGE * np.eye(size)])
        low, high = np.maximum(-radius, -1.0 - best), np.minimum(radius, 1.0 - best)
        step = lsq_linear(system, -np.append(least, RIDGE * best), (low - 1e-9, high + 1e-9)).x
        found = yield best + step
        J += np.outer(found - least - J @ step, step) / max(step @ step, 1e-12)  # Broyden's update
        if found @ found < least @ least:
            best, least, radius = best + step, found, min(1.5 * radius, 1.0)
        else:
            radius *= 0.5


BASELINES: dict[str, Callable[[Any], Controller]] = {"own_assist": OwnAssist, "gauss_newton": GaussNewton}
