"""Audit of the rewards: does anything that scores more than the classical controllers behave worse than they do?

A policy cheats if its reward is above that of the best classical controller while its behaviour is worse: more ripple
in the hands, more failures, or a larger error in what the task is about. Policies are searched for under the conditions
that the training of the id draws; policies that once cheated (:data:`CHEATS`) are tried again at its default settings.
An assist that scores more is driven through the suite for assists, as a reward does not know all margins of stability.
"""

from collections.abc import Callable, Mapping
from functools import partial
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from steer_env import tasks
from steer_env.episode.timing import UPDATE_INTERVAL
from steer_env.experiments.learning import assist_suite, held_out, policy, training
from steer_env.experiments.learning.controllers import ZeroAction, baselines
from tests.tools.policy_search import Budget, LinearPolicy, ModelPolicy, cross_entropy, plain_ppo

EPISODES = 16
SAMPLED = 0.005  # of the torque of policies without memory, for the ripple [s]
RIPPLE_LIMIT = 0.05  # root mean square above 10 Hz that hands do not mind, assumed [N m]
WORSE = 1.25  # factor on a measure of behaviour above which it counts as worse, assumed [1]
# What the tasks are about; the first that a task has is its aim.
AIMS = ("rms_angle_error", "rms_feel_error", "rms_lateral_offset")


class Behaviour(NamedTuple):
    """What a controller does, whatever the reward says: means over the episodes."""

    reward: float  # sum over the episode [s]
    failures: float  # share of the episodes
    ripple: float  # [N m]
    aim: float  # root mean square of the task's error [its unit]
    cones: float  # touched per episode


class Verdict(NamedTuple):
    """One policy beside the best classical controller."""

    env_id: str
    policy: str
    found: Behaviour
    best: Behaviour  # of the classical controllers and zero action, by reward
    best_name: str
    worse_in: tuple[str, ...]  # if its reward is higher
    failed: int = 0  # conditions of the suite for assists in which it fails
    driven: int = 0  # conditions of the suite; 0 for a driver, and for an assist that scores no more

    @property
    def cheats(self) -> bool:
        """Whether it scores more and behaves worse."""
        return self.found.reward > self.best.reward and bool(self.worse_in)

    @property
    def unstable(self) -> bool:
        """Whether it scores more and fails the suite."""
        return self.found.reward > self.best.reward and self.failed > 0


class Held:
    """A controller without memory that acts every ``times`` steps of an environment with shorter steps."""

    def __init__(self, make: Callable[[Any], Any], times: int, env: Any) -> None:
        self._controller, self._times, self._since = make(env), times, 0

    def reset(self, rows: Any = slice(None)) -> None:
        """It remembers no episode; all episodes begin together."""
        self._since = 0

    def act(self, observation: NDArray[np.float32]) -> NDArray[np.float32]:
        """The action of the present interval."""
        if self._since % self._times == 0:
            self._action: NDArray[np.float32] = self._controller.act(observation)
        self._since += 1
        return self._action


class Scripted:
    """A policy that depends on the observations by a function of their names."""

    def __init__(self, act: Callable[[Mapping[str, NDArray[np.float64]]], NDArray[np.float64]], env: Any) -> None:
        self._act, self._names = act, [quantity.name for quantity in env.unwrapped.batch.observed]
        self._scale = getattr(env.unwrapped, "observation_scale", 1.0)
        self.scale = env.unwrapped.batch.task.action.scale

    def reset(self, rows: Any = slice(None)) -> None:
        """It remembers nothing."""

    def act(self, observation: NDArray[np.float32]) -> NDArray[np.float32]:
        """Actions (n, 1) for observations (n, O)."""
        seen = dict(zip(self._names, (observation * self._scale).astype(float).T))
        return np.clip(self._act(seen) / self.scale, -1.0, 1.0).astype(np.float32)[:, None]


def _shake(seen: Mapping[str, NDArray[np.float64]]) -> NDArray[np.float64]:
    """Shake the robot's hands before the release, follow the wanted return after it."""
    following = 40.0 * seen["return_error"] + 2.0 * seen["return_speed_error"]
    return np.where(seen["released"] > 0.5, following, np.where(seen["last_action"] > 0.0, -5.0, 5.0))


# Policies that an earlier reward paid for: name -> (tasks, what it does [N m]).
CHEATS: dict[str, tuple[str, Callable[[Mapping[str, NDArray[np.float64]]], NDArray[np.float64]]]] = {
    "full lock into the ditch": ("lateral_offset", lambda seen: np.full(seen["speed"].size, 25.0)),
    "hands off": ("Driver", lambda seen: np.zeros(seen["speed"].size)),
    "stiff servo that chatters": ("target_0.0s", lambda seen: 80.0 * seen["target_0.0s"]),
    "shake before the release": ("released", _shake),
}


def cheats_for(env_id: str) -> dict[str, Callable[[Any], Any]]:
    """The known cheats that an id's observations or name allow."""
    task = tasks.task(env_id.removeprefix("steer_env/").rpartition("-")[0])
    names = [quantity.name for quantity in task.observed]
    return {
        name: partial(Scripted, act)
        for name, (needs, act) in CHEATS.items()
        if task.name.startswith("Driver" if needs in ("Driver", "lateral_offset") else "")
        and (needs in names or task.name.startswith(needs))
    }


def behaviour(env_id: str, make: Callable[[Any], Any], *, remembers: bool, **arguments: Any) -> Behaviour:
    """Drive a controller on held-out episodes.

    The ripple of one that remembers nothing is sampled at ``SAMPLED``: with the environment's own steps of 10 ms an
    action that changes its sign at every step would be seen near its zeros.
    """
    found = held_out.collect(env_id, make, EPISODES, **arguments)
    step = tasks.task(policy.check_driven(env_id)).control_dt
    rippled = found
    if not remembers and step < 2.0 * UPDATE_INTERVAL:  # longer ones are sampled at the updates
        held = partial(Held, make, round(step / SAMPLED))
        rippled = held_out.collect(env_id, held, EPISODES, control_dt=SAMPLED, **arguments)
    aim = next((name for name in AIMS if name in found.metrics), None)
    means = {name: float(np.mean(values)) for name, values in found.metrics.items()}
    return Behaviour(
        float(found.reward.mean()),
        float(np.mean(found.failure > 0)),
        float(np.mean(rippled.metrics["rms_ripple"])),
        means[aim] if aim else 0.0,
        means.get("cones_hit", 0.0),
    )


def worse_in(found: Behaviour, best: Behaviour) -> tuple[str, ...]:
    """The measures in which a behaviour is worse than another."""
    judged = {
        "failures": found.failures > best.failures,
        "ripple": found.ripple > max(RIPPLE_LIMIT, WORSE * best.ripple),
        "aim": found.aim > WORSE * best.aim,
        "cones": found.cones > best.cones + 1.0 / EPISODES,
    }
    return tuple(name for name, worse in judged.items() if worse)


def suite(env_id: str, make: Callable[[Any], Any]) -> tuple[int, int]:
    """Conditions of the suite for assists in which a controller fails, and all of them; none for a driver."""
    if not policy.check_driven(env_id).startswith("Assist"):
        return 0, 0
    held = [result.holds for result in assist_suite.examine(make, env_id)]
    return held.count(False), len(held)


def audited(case: tuple[str, Budget, int]) -> list[Verdict]:
    """:func:`audit` with its arguments as one, for sweeps."""
    return audit(*case)


def audit(env_id: str, budget: Budget, seed: int = 0, **arguments: Any) -> list[Verdict]:
    """Every known cheat that fits an id, and what the searches find, beside the best classical controller.

    Known cheats drive at the default settings, as a lag of the actuator hides a shake; the searches, and what they are
    compared with, under the conditions that the training draws. ``arguments`` of make stand over both.
    """
    drawn = {**training.conditions(env_id), **arguments}
    weights = cross_entropy(env_id, budget, seed, **drawn)
    searched: dict[str, Callable[[Any], Any]] = {
        "linear, cross-entropy method": lambda env: LinearPolicy(env, weights),
    }
    if budget.steps > 0:
        searched["PPO, defaults"] = partial(ModelPolicy, plain_ppo(env_id, budget, seed, **drawn))
    return [*_beside(env_id, cheats_for(env_id), **arguments), *_beside(env_id, searched, **drawn)]


def _beside(env_id: str, tried: Mapping[str, Callable[[Any], Any]], **arguments: Any) -> list[Verdict]:
    """Policies beside the best classical controller in the same episodes."""
    if not tried:
        return []
    classical: dict[str, Callable[[Any], Any]] = {"zero action": ZeroAction, **baselines(env_id)}
    scores = {name: behaviour(env_id, make, remembers=True, **arguments) for name, make in classical.items()}
    best_name = max(scores, key=lambda name: scores[name].reward)
    best = scores[best_name]
    verdicts = []
    for name, make in tried.items():
        found = behaviour(env_id, make, remembers=False, **arguments)
        driven = suite(env_id, make) if found.reward > best.reward else (0, 0)
        verdicts.append(Verdict(env_id, name, found, best, best_name, worse_in(found, best), *driven))
    return verdicts
