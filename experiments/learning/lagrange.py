"""PPO with a Lagrange multiplier: the reward less a multiplier times the cost keeps an episode's cost in a budget.

The reward of a step is (r - lambda c)/(1 + lambda). After each rollout, lambda goes up where the cost of an episode is
above the budget, and down, to 0 at least, where it is below: lambda <- max(0, lambda + rate (C/B - 1)), the projected
ascent of the dual problem. C is the mean cost of a step in the last rollouts, as many as an episode is long, times the
mean steps of the episodes that ended last; so it is known after every rollout, also where no episode ends in it. Until
one has ended lambda is 0.

Source: Ray, Achiam, Amodei, Benchmarking safe exploration in deep reinforcement learning, 2019, section 5. Deviations:
the error is relative to the budget, plain ascent instead of Adam on a softplus of lambda, one value network.
"""

from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np
from stable_baselines3.common.vec_env import VecEnvWrapper
from stable_baselines3.common.vec_env.base_vec_env import VecEnvObs, VecEnvStepReturn

RATE = 0.05  # of lambda after a rollout whose cost is twice the budget; assumed [1]


class RolloutRow(NamedTuple):
    """A rollout."""

    steps: int  # of the training, at its end
    cost: float  # of an episode, estimated from the last rollouts [1]
    multiplier: float  # lambda after it [1]
    budget: float  # of the cost of an episode [1]


class PenalisedVecEnv(VecEnvWrapper):
    """Sub-environments whose rewards are penalised by their costs.

    Parameters
    ----------
    venv : VecEnv
        Whose infos have the ``cost`` of the step.
    budget : float
        Of the cost of an episode, above 0 [1].
    """

    def __init__(self, venv: Any, budget: float) -> None:
        super().__init__(venv)
        self._budget = budget
        self._ages = np.zeros(venv.num_envs, int)  # steps of the present episodes
        self._lengths: list[int] = []  # of the episodes that ended last, one for each sub-environment at most [steps]
        self.rows: list[RolloutRow] = []  # of every rollout since an episode has ended
        self._rollouts: list[tuple[int, float]] = []  # of the last episode's length: steps, mean cost of a step
        self._taken, self._cost = 0, 0.0  # in the present rollout: steps of each sub-environment, sum of the mean costs

    @property
    def multiplier(self) -> float:
        """The present multiplier lambda [1]."""
        return self.rows[-1].multiplier if self.rows else 0.0

    def reset(self) -> VecEnvObs:
        """Start an episode in every sub-environment."""
        self._ages[:] = 0
        return self.venv.reset()

    def step_wait(self) -> VecEnvStepReturn:
        """Observations, penalised rewards, whether episodes ended, infos."""
        observations, rewards, done, infos = self.venv.step_wait()
        cost = np.array([info["cost"] for info in infos])
        self._taken, self._cost = self._taken + 1, self._cost + float(cost.mean())
        self._ages += 1
        if done.any():
            self._lengths = [*self._lengths, *self._ages[done].tolist()][-self.num_envs :]
            self._ages[done] = 0
        penalised = (rewards - self.multiplier * cost) / (1.0 + self.multiplier)
        return observations, penalised.astype(rewards.dtype), done, infos

    def update(self, steps: int) -> None:
        """Update the multiplier between two rollouts, after ``steps`` of the training."""
        if not self._taken:
            return
        self._rollouts.append((self._taken, self._cost / self._taken))
        self._taken, self._cost = 0, 0.0
        if not self._lengths:
            return
        length = float(np.mean(self._lengths))
        while sum(taken for taken, _ in self._rollouts[1:]) >= length:
            self._rollouts.pop(0)
        taken, costs = zip(*self._rollouts)
        cost = length * float(np.average(costs, weights=taken))
        multiplier = max(self.multiplier + RATE * (cost / self._budget - 1.0), 0.0)
        self.rows.append(RolloutRow(steps, cost, multiplier, self._budget))

    def get_state(self) -> dict[str, Any]:
        """What decides, beside the environment and between two rollouts, how it goes on; as JSON holds it."""
        return {
            "rows": [list(row) for row in self.rows],
            "rollouts": [list(each) for each in self._rollouts],
            "ages": self._ages.tolist(),
            "lengths": self._lengths,
        }

    def set_state(self, state: Mapping[str, Any]) -> None:
        """Go on from a state."""
        self._ages[:], self._lengths = state["ages"], list(state["lengths"])
        self.rows = [RolloutRow(*row) for row in state["rows"]]
        self._rollouts = [(taken, cost) for taken, cost in state["rollouts"]]
