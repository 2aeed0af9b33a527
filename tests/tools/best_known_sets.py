"""The best known parameter sets of the tuning ids in a few contexts, which a test holds random sets against.

    python -m tests.tools.best_known_sets [EVALUATIONS]

writes ``tests/steer_env/best_known_sets.json``: in each context the best set that scipy's COBYQA finds from the start,
from the car's own set, which an episode does not tell, and after differential evolution from anywhere. A set of the
file that is better stays.
"""

import json
import sys
from pathlib import Path
from typing import Any

import gymnasium as gym
import numpy as np
from scipy import optimize

from steer_env.experiments.learning.tuners import DRAWN_RANGES
from steer_env.registration import id_of
from steer_env.tuning.scenarios.common.definition import SCENARIOS

FILE = Path(__file__).parents[1] / "steer_env" / "best_known_sets.json"
CONTEXTS = ((0, False), (1, False), (2, True))  # seed, and whether the conditions are drawn
EVALUATIONS = 200  # of each search


def context(name: str, seed: int, drawn: bool) -> Any:
    """The environment of a scenario in a context."""
    env: Any = gym.make(id_of(name), sets=None, randomise=DRAWN_RANGES if drawn else None).unwrapped
    env.reset(seed=seed)
    return env


def searched(env: Any, evaluations: int, known: np.ndarray) -> tuple[float, np.ndarray]:
    """The largest reward that the searches find in a context, or that of the known set, and its set."""
    tried: list[tuple[float, np.ndarray]] = []

    def loss(action: np.ndarray) -> float:
        tried.append((env.step(action.astype(np.float32))[1], action.astype(np.float32)))
        return -tried[-1][0]

    n = env.action_space.shape[0]
    bounds = [(-1.0, 1.0)] * n
    loss(known)
    rounds = max(evaluations // (4 * n) - 1, 1)
    found = optimize.differential_evolution(loss, bounds, popsize=4, maxiter=rounds, polish=False, rng=0)
    for begin in (np.zeros(n), env.own_action.astype(float), found.x):
        options = {"maxfev": evaluations, "initial_tr_radius": 0.3}
        optimize.minimize(loss, begin, method="COBYQA", bounds=bounds, options=options)
    return max(tried, key=lambda each: each[0])


def main(evaluations: int) -> None:
    """Search in every context of every scenario, and write the file."""
    before = json.loads(FILE.read_text("utf-8")) if FILE.is_file() else []
    known = {(each["scenario"], each["seed"], each["drawn"]): each["action"] for each in before}
    found = []
    for name in SCENARIOS.available():
        for seed, drawn in CONTEXTS:
            env = context(name, seed, drawn)
            reward, action = searched(env, evaluations, np.array(known.get((name, seed, drawn), env.own_action)))
            print(name, seed, drawn, reward, flush=True)
            found.append({"scenario": name, "seed": seed, "drawn": drawn, "reward": reward, "action": action.tolist()})
    FILE.write_text(json.dumps(found, indent=1) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main(int(sys.argv[1]) if len(sys.argv) > 1 else EVALUATIONS)
