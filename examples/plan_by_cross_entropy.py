"""Plan by the cross-entropy method on copies of an environment's state: model-predictive control of a car in its lane.

python examples/plan_by_cross_entropy.py [SECONDS]     the whole episode of 30 s takes half a minute

Every 0.2 s a vector environment takes the state of the driven environment, tries 64 sequences of hand torque over the
next second, and draws the next 64 around the best eight. The copies carry the crosswind and the rough surface that were
drawn for the episode, so the planner foresees them: its score shows what is possible, not what a driver could reach.
Noise of the sensors would be known too; with ``get_state(include_rng=False)`` every copy draws its own.
"""

import sys

import gymnasium as gym
import numpy as np
from gymnasium.vector import VectorEnv
from numpy.typing import NDArray

import steer_env  # noqa: F401 (registers the ids)
from steer_env.engine.state import State

ENV, STEP = "steer_env/DriverLaneKeeping-v3", 0.05  # time between two actions [s]
SEQUENCES, BEST, ROUNDS = 64, 8, 3
HORIZON, DRIVEN = 20, 4  # actions of a plan, and how many of them are driven before the next plan
SPREAD, LEAST = 0.2, 0.02  # standard deviation of the first sequences, and what is added to that of the best
# Sequences are straight lines between five values: neighbouring actions of independent size would cancel out.
LINES = np.array([np.interp(np.linspace(0.0, 4.0, HORIZON), np.arange(5.0), unit) for unit in np.eye(5)])


def plan(
    copies: VectorEnv, state: State, actions: NDArray[np.float64], rng: np.random.Generator
) -> NDArray[np.float64]:
    """Better actions (HORIZON,) from a state, found around those given."""
    spread = np.full(HORIZON, SPREAD)
    for _ in range(ROUNDS):
        tried = np.clip(actions + spread * (rng.standard_normal((SEQUENCES, 5)) @ LINES), -1.0, 1.0)
        tried[0] = actions
        copies.unwrapped.set_state(state)
        scores, driving = np.zeros(SEQUENCES), np.ones(SEQUENCES, bool)
        for column in tried.T.astype(np.float32):
            _, rewards, terminated, truncated, _ = copies.step(column[:, None])
            scores += np.where(driving, rewards, 0.0)
            driving &= ~(terminated | truncated)
        best = tried[np.argsort(scores)[-BEST:]]
        actions, spread = best.mean(axis=0), best.std(axis=0) + LEAST
    return actions


def score(planned: bool, seconds: float, seed: int = 0) -> float:
    """Sum of the rewards of an episode's beginning, with planned actions or without any."""
    env, rng = gym.make(ENV, control_dt=STEP), np.random.default_rng(seed)
    copies = gym.make_vec(ENV, num_envs=SEQUENCES, control_dt=STEP)
    env.reset(seed=seed)
    actions, total = np.zeros(HORIZON), 0.0
    for k in range(round(seconds / STEP)):
        if planned and k % DRIVEN == 0:
            actions = plan(copies, env.unwrapped.get_state(), np.append(actions[DRIVEN:], [0.0] * DRIVEN), rng)
        _, reward, terminated, truncated, _ = env.step(actions[k % DRIVEN, None].astype(np.float32))
        total += reward
        if terminated or truncated:
            break
    return total


def main(seconds: float) -> dict[str, float]:
    """Scores of zero action and of the planner."""
    return {"zero action": score(False, seconds), "cross-entropy": score(True, seconds)}


if __name__ == "__main__":
    found = main(float(sys.argv[1]) if len(sys.argv) > 1 else 30.0)
    knows = {"zero action": "nothing", "cross-entropy": "the state, the drawn wind, surface and noise to come"}
    for name, value in found.items():
        print(f"{name:14s} score {value:8.2f}   knows {knows[name]}")
