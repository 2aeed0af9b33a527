"""What steps cost: of an environment beside CartPole-v1, of the plant beside its friction law alone, and the first one.

python -m experiments.step_time
"""

import math
import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from dataclasses import replace
from functools import partial
from typing import Any

import gymnasium as gym
import numpy as np

from friction import law, make
from friction.kernel import kernel
from steer_env import manoeuvres
from steer_env.ids import DRIVEN
from vehicle import cars, plant
from vehicle.assist import SAMPLE_TIME

FIRST_STEP = (
    "import time; t = time.perf_counter(); import gymnasium, steer_env; "
    "e = gymnasium.make({name!r}, chassis={chassis!r}); e.reset(seed=0); e.step(e.action_space.sample()); "
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
    """Step time of each driving environment at its defaults over that of CartPole-v1, in turn in this process."""
    reference = step_time(gym.make("CartPole-v1"), 1, steps, repeats)
    action = np.array([0.02], np.float32)
    return {name: step_time(gym.make(name), action, steps, repeats) / reference for name in DRIVEN}


def first_step(name: str, cache: str, chassis: str = "single_track") -> float:
    """Seconds from the start of the imports to the end of the first step in a new process with this cache folder."""
    environment = {**os.environ, "NUMBA_CACHE_DIR": cache}
    command = [sys.executable, "-c", FIRST_STEP.format(name=name, chassis=chassis)]
    return float(subprocess.run(command, env=environment, check=True, capture_output=True, text=True).stdout)


@kernel
def _friction_alone(p, memory, w, steps):
    """LuGre's step equation in a loop, as the column would have it in a weave."""
    for i in range(steps):
        w, _ = law.step(p, 1.0, memory, 100.0, 20.0 * math.sin(1e-3 * i), 1e-3, w)
    return w


def substeps(friction: str = "lugre", n: int = 20_000, repeats: int = 7) -> dict[str, float]:
    """Seconds per 1 ms step of the friction law alone and of the whole plant on each chassis, in turn in this process.

    The best of several repeats; the plants weave at 100 km/h on one core.
    """
    p = make(friction)
    memory = np.zeros(law.law_of(p).memory_size(p))
    runs: dict[str, Callable[[], Any]] = {"friction": lambda: _friction_alone(p, memory, 0.0, n)}
    weave = manoeuvres.make("weave")
    u = manoeuvres.inputs(weave, 0.26, n * SAMPLE_TIME)
    for chassis in cars.SPEEDS:
        whole = manoeuvres.build_plant(cars.load(), replace(weave, chassis=chassis), p)
        state, row = plant.initial_state(whole), np.zeros((1, len(plant.channels(whole))))
        runs[chassis] = partial(plant.run, whole, state, u, row, 1)
    for run in runs.values():  # compiles
        run()
    best = dict.fromkeys(runs, math.inf)
    for _ in range(repeats):
        for name, run in runs.items():
            start = time.perf_counter()
            run()
            best[name] = min(best[name], (time.perf_counter() - start) / n)
    return best


if __name__ == "__main__":
    for name, ratio in ratios().items():
        with tempfile.TemporaryDirectory() as cache:
            cold, warm = first_step(name, cache), first_step(name, cache)
        print(f"{name:32s} {ratio:.2f} x CartPole-v1   first step: cold {cold:.1f} s, warm cache {warm:.1f} s")
    with tempfile.TemporaryDirectory() as cache:
        cold = first_step("steer_env/AssistWeave-v0", cache, "two_track")
    print(f"steer_env/AssistWeave-v0 on two tracks: first step cold {cold:.1f} s")
    times = substeps()
    for name, seconds in times.items():
        print(
            f"1 ms of {name:24s} {1e9 * seconds:6.0f} ns   {seconds / times['friction']:5.2f} x the friction law alone"
        )
