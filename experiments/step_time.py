"""What a step of an environment costs, beside CartPole-v1 in the same run, and how long the first one takes.

python -m experiments.step_time
"""

import os
import subprocess
import sys
import tempfile
import time

import gymnasium as gym
import numpy as np

from steer_env import REGISTERED

FIRST_STEP = (
    "import time; t = time.perf_counter(); import gymnasium, steer_env; "
    "e = gymnasium.make({name!r}); e.reset(seed=0); e.step(e.action_space.sample()); "
    "print(time.perf_counter() - t)"
)


def step_time(env: gym.Env, action: object, steps: int = 2000, repeats: int = 5) -> float:
    """Seconds per ``step``, the best of several repeats; resets are not counted."""
    best = float("inf")
    for _ in range(repeats):
        env.reset(seed=0)
        spent = 0.0
        start = time.perf_counter()
        for _ in range(steps):
            _, _, terminated, truncated, _ = env.step(action)
            if terminated or truncated:
                spent += time.perf_counter() - start
                env.reset()
                start = time.perf_counter()
        best = min(best, (spent + time.perf_counter() - start) / steps)
    return best


def ratios(steps: int = 2000, repeats: int = 5) -> dict[str, float]:
    """Step time of each environment at its defaults over that of CartPole-v1, measured in turn in this process."""
    reference = step_time(gym.make("CartPole-v1"), 1, steps, repeats)
    action = np.array([0.02], np.float32)
    return {name: step_time(gym.make(name), action, steps, repeats) / reference for name in REGISTERED}


def first_step(name: str, cache: str) -> float:
    """Seconds from the start of the imports to the end of the first step in a new process with this cache folder."""
    environment = {**os.environ, "NUMBA_CACHE_DIR": cache}
    command = [sys.executable, "-c", FIRST_STEP.format(name=name)]
    return float(subprocess.run(command, env=environment, check=True, capture_output=True, text=True).stdout)


if __name__ == "__main__":
    for name, ratio in ratios().items():
        with tempfile.TemporaryDirectory() as cache:
            cold, warm = first_step(name, cache), first_step(name, cache)
        print(f"{name:32s} {ratio:.2f} x CartPole-v1   first step: cold {cold:.1f} s, warm cache {warm:.1f} s")
