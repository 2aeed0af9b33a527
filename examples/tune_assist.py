"""Search for a better parameter set of the assist in the tuning environment by scipy's differential evolution.

python examples/tune_assist.py [EVALUATIONS]
"""

import sys

import gymnasium as gym
import numpy as np
from scipy import optimize

import steer_env  # noqa: F401 (registers the ids)


def main(evaluations: int) -> tuple[float, float]:
    """Reward of the car's own parameter set, and of the best one found."""
    env = gym.make("steer_env/TuneOnCentre-v1")

    def reward(action: np.ndarray) -> float:
        env.reset(seed=0)
        return float(env.step(action.astype(np.float32))[1])

    size = env.action_space.shape[0]
    rounds = max(evaluations // (4 * size) - 1, 0)
    best = optimize.differential_evolution(
        lambda action: -reward(action), [(-1.0, 1.0)] * size, maxiter=rounds, popsize=4, polish=False, rng=0
    )
    return reward(np.zeros(size)), -float(best.fun)


if __name__ == "__main__":
    own, found = main(int(sys.argv[1]) if len(sys.argv) > 1 else 200)
    print(f"own set {own:.3f}, best found {found:.3f}")
