"""Computing time of steps: an environment against CartPole-v1, the plant against its friction law, and the first step.

``python -m tests.maintain verify time`` prints them.
"""

import math
import os
import subprocess
import sys
import time
from collections.abc import Callable, Iterable, Mapping
from dataclasses import replace
from functools import partial
from typing import Any, TypeVar

import gymnasium as gym
import numpy as np

from steer_env import manoeuvres
from steer_env.friction import law, make
from steer_env.friction.numerics.kernel import kernel
from steer_env.vehicle import cars, plant
from steer_env.vehicle.steering.eps import SAMPLE_TIME

Key = TypeVar("Key")
FIRST_STEP = (
    "import time, gymnasium, steer_env; "
    "e = gymnasium.make({name!r}, chassis={chassis!r}); e.reset(seed=0); e.step(e.action_space.sample()); "
    "print(time.process_time())"
)


def _best(runs: Mapping[Key, Callable[[], float]], repeats: int) -> dict[Key, float]:
    """The least value that each run returns in several rounds.

    With many short rounds, some round of each run is undisturbed by other programs.
    """
    times = [{name: run() for name, run in runs.items()} for _ in range(repeats)]
    return {name: min(each[name] for each in times) for name in runs}


def _step_time(env: gym.Env, action: object, steps: int) -> float:
    """Time of a ``step`` without the resets [s]."""
    env.reset(seed=0)
    spent = 0.0
    start = time.perf_counter()
    for _ in range(steps):
        _, _, terminated, truncated, _ = env.step(action)
        if terminated or truncated:
            spent += time.perf_counter() - start
            env.reset()
            start = time.perf_counter()
    return (spent + time.perf_counter() - start) / steps


def ratios(cases: Iterable[tuple[str, str]], steps: int = 200, repeats: int = 200) -> dict[tuple[str, str], float]:
    """Time of 10 ms in driving environments over that of a step of CartPole-v1, in this process.

    A case is an id and an ``info_level``. All environments are those of ``gymnasium.make``, with its wrappers.
    """
    cart, action = ("CartPole-v1", ""), np.array([0.02], np.float32)
    runs = {cart: partial(_step_time, gym.make("CartPole-v1"), 1, steps)}
    for name, level in cases:
        env = gym.make(name, control_dt=0.01, info_level=level)
        runs[name, level] = partial(_step_time, env, action, steps)
    times = _best(runs, repeats)
    return {case: times[case] / times[cart] for case in cases}


def first_step(name: str, cache: str, chassis: str = "single_track") -> float:
    """Processor time of a new process with this cache folder until the end of its first step, with all imports [s].

    On an idle machine it equals the wall time, as a single thread does all of the work.
    """
    environment = {**os.environ, "NUMBA_CACHE_DIR": cache}
    command = [sys.executable, "-c", FIRST_STEP.format(name=name, chassis=chassis)]
    return float(subprocess.run(command, env=environment, check=True, capture_output=True, text=True).stdout)


def training_share(env_id: str, rollouts: int = 3) -> float:
    """Share of the environment in the wall time of PPO, at the id's settings but with 64 sub-environments.

    Needs the extra ``train``.
    """
    from stable_baselines3.common.vec_env import VecMonitor, VecNormalize

    from steer_env.experiments.learning.training import new_model, settings
    from steer_env.sb3 import SteerVecEnv

    spent = 0.0

    class Timed(SteerVecEnv):
        def step_wait(self) -> Any:
            nonlocal spent
            start = time.perf_counter()
            found = super().step_wait()
            spent += time.perf_counter() - start
            return found

    given = settings(env_id, "ppo")
    sub_environments = Timed(env_id, 64, **given["environment"])
    model = new_model("ppo", VecNormalize(VecMonitor(sub_environments)), given["algorithm"], seed=0)
    steps = 64 * given["algorithm"]["n_steps"]
    model.learn(steps)
    spent, start = 0.0, time.perf_counter()
    model.learn(rollouts * steps)
    return spent / (time.perf_counter() - start)


@kernel
def _friction_alone(p, memory, w, steps):
    """LuGre's step equation in a loop, with the torques of the column in a weave."""
    for i in range(steps):
        w, _ = law.step(p, 1.0, memory, 100.0, 20.0 * math.sin(1e-3 * i), 1e-3, w)
    return w


def substeps(friction: str = "lugre", n: int = 2000, repeats: int = 100) -> dict[str, float]:
    """Time of a 1 ms step of the friction law alone and of the whole plant on each chassis, in this process [s].

    The plants drive a weave at 100 km/h on one core.
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

    def timed(run: Callable[[], Any]) -> float:
        start = time.perf_counter()
        run()
        return (time.perf_counter() - start) / n

    return _best({name: partial(timed, run) for name, run in runs.items()}, repeats)
