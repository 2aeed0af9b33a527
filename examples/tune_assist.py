"""Search for a better parameter set of the assist in the tuning environment by scipy's differential evolution.

python examples/tune_assist.py [EVALUATIONS] [FILE.toml]

The best set becomes a car file: steer-env run weave --vehicle tuned.toml
"""

import sys

import gymnasium as gym
import numpy as np
from scipy import optimize

import steer_env  # noqa: F401 (registers the ids)
from steer_env.vehicle import cars


def main(evaluations: int, out: str) -> tuple[float, float]:
    """Reward of the start, and of the best one found, which is written as a car file."""
    env = gym.make("steer_env/TuneOnCentre-v3")

    def reward(action: np.ndarray) -> float:
        env.reset(seed=0)
        return float(env.step(action.astype(np.float32))[1])

    size = env.action_space.shape[0]
    rounds = max(evaluations // (4 * size) - 1, 0)
    best = optimize.differential_evolution(
        lambda action: -reward(action), [(-1.0, 1.0)] * size, maxiter=rounds, popsize=4, polish=False, rng=0
    )
    cars.write(env.unwrapped.tuned_car(best.x.astype(np.float32)), out)
    return reward(np.zeros(size)), -float(best.fun)


if __name__ == "__main__":
    count, path = (*sys.argv[1:], *("200", "tuned.toml")[len(sys.argv) - 1 :])
    own, found = main(int(count), path)
    print(f"start {own:.3f}, best found {found:.3f}: {path}")
