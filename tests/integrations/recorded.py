"""The true transitions of an environment, and the returns of them, to hold what a library stores against."""

from typing import Any, NamedTuple

import gymnasium as gym
import numpy as np
from gymnasium.vector import AutoresetMode

import steer_env  # noqa: F401 (registers the ids)

ID = "steer_env/DriverDoubleLaneChange-v3"
# Random hands end an episode within 10 to 30 decisions: some here are terminated, and the others truncated.
MADE: dict[str, Any] = {"control_dt": 0.1, "max_episode_steps": 20}
STEPS, GAMMA, LAMBDA = 200, 0.98, 0.9


class Transition(NamedTuple):
    """One decision: what was seen, what the environment was given, and what came of it."""

    observation: np.ndarray
    action: np.ndarray
    reward: float
    next_observation: np.ndarray
    terminated: bool
    truncated: bool
    cost: float


class Recorded(gym.Wrapper):
    """A single environment that keeps its transitions; what it gives is copied, so that no library can change it."""

    def __init__(self, env):
        super().__init__(env)
        self.kept, self.over = [], True

    def reset(self, **arguments):
        observation, info = self.env.reset(**arguments)
        self.seen, self.over = observation.copy(), False
        return observation, info

    def step(self, action):
        given = np.array(action)
        observation, reward, terminated, truncated, info = self.env.step(action)
        result = (float(reward), observation.copy(), bool(terminated), bool(truncated), info["cost"])
        self.kept.append(Transition(self.seen, given, *result))
        self.seen, self.over = observation.copy(), terminated or truncated
        return observation, reward, terminated, truncated, info


class RecordedVector(gym.vector.VectorWrapper):
    """A vector environment, and beside each sub-environment a single one with the same seed that meets its actions."""

    def __init__(self, env):
        super().__init__(env)
        self.autoreset_mode = env.metadata["autoreset_mode"]  # Gymnasium's wrappers do without, and TorchRL asks for it
        self.twins = [made() for _ in range(env.num_envs)]

    def reset(self, *, seed=None, options=None):
        if (options or {}).get("reset_mask", np.array(True)).all():
            seed = 0 if seed is None else seed
            for i, twin in enumerate(self.twins):
                twin.reset(seed=seed[i] if isinstance(seed, list) else seed + i)
        return self.env.reset(seed=seed, options=options)

    def step(self, actions):
        for twin, action in zip(self.twins, np.array(actions)):
            if twin.over:
                twin.reset()
                if self.autoreset_mode is AutoresetMode.NEXT_STEP:
                    continue  # the step that resets takes no action
            twin.step(action)
        return self.env.step(actions)


def made(env_id=ID, **arguments):
    """A single environment that keeps its transitions."""
    return Recorded(gym.make(env_id, **{**MADE, **arguments}))


def made_vector(num_envs, mode, **arguments):
    """A vector environment whose twins keep its transitions."""
    return RecordedVector(gym.make_vec(ID, num_envs, autoreset_mode=mode, **{**MADE, **arguments}))


def columns(transitions):
    """The transitions as arrays, one for each field."""
    return Transition(*(np.array(column) for column in zip(*transitions)))


def episodes(transitions):
    """The transitions of each episode; the last may go on."""
    ends = [i + 1 for i, each in enumerate(transitions) if each.terminated or each.truncated]
    return [transitions[a:b] for a, b in zip([0, *ends], [*ends, len(transitions)]) if a < b]


def returns(transitions, value):
    """Generalised advantage plus value, from its definition (Schulman et al. 2016, eq. 16), for each transition.

    An episode ends the sum. Behind its last transition stands the value of the last observation, and nothing where it
    was terminated. ``value`` gives the values of the observations of an episode, (T + 1, O) -> (T + 1,).
    """
    found = []
    for episode in episodes(transitions):
        seen = columns(episode)
        values = np.asarray(value(np.vstack([seen.observation, seen.next_observation[-1:]])), float)
        behind = values[1:] * ~seen.terminated
        surprise = seen.reward + GAMMA * behind - values[:-1]
        powers = (GAMMA * LAMBDA) ** np.arange(len(episode))
        found += [values[i] + powers[: len(episode) - i] @ surprise[i:] for i in range(len(episode))]
    return np.array(found)


def check_both_ends(transitions):
    """Among what was collected there are episodes that were terminated, and others that were truncated."""
    seen = columns(transitions)
    assert seen.terminated.sum() >= 2
    assert (seen.truncated & ~seen.terminated).sum() >= 2
    assert (np.abs(seen.action) <= 1.0).any()
