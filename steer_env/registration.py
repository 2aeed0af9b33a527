"""The ids that Gymnasium knows; the entry points are strings, so that registering them imports no environment."""

import json
from importlib.resources import files

import gymnasium as gym

from steer_env.friction.numerics.registry import camel_case, listed

VERSION = "v1"
HISTORY = (
    "v1: another default car and assist, the rack force without the weight of the wheels, another reference feel; "
    "rewards from 0 to 1 per second, scaled observations with the last action, decisions of drivers every 50 ms, "
    "on straight lines.\n\n"
    "v0: first version; v1 replaces it."
)


def _entry_points(package: str, module: str) -> dict[str, str]:
    """Id -> entry point, for everything in a folder of tasks or scenarios."""
    return {f"steer_env/{name}-{VERSION}": f"{module}:{name}" for name in listed(package, camel_case)}


# A step is one control step of a drive.
DRIVEN = _entry_points("steer_env.tasks", "steer_env.environments")
# A step is the evaluation of one parameter set.
TUNED = _entry_points("steer_env.tuning.scenarios", "steer_env.tuning.environments")
REGISTERED = DRIVEN | TUNED


def register() -> None:
    """Register the ids with Gymnasium; ``tests.maintain scores`` wrote the mean rewards of the best baselines."""
    thresholds = json.loads((files("steer_env") / "reward_thresholds.json").read_text("utf-8"))
    for name, entry_point in REGISTERED.items():
        solved = thresholds.get(name)
        gym.register(name, entry_point=entry_point, vector_entry_point=f"{entry_point}Vector", reward_threshold=solved)
