"""The ids that Gymnasium knows; the entry points are strings, so that registering them imports no environment."""

import json
from importlib.resources import files

import gymnasium as gym

from steer_env.friction.numerics.registry import camel_case, modules_by_name

_TUNED = (
    " An episode starts with the assist out of tune, and narrow wanted bands about the car's own feel replace the "
    "target bands."
)
FIRST = "First version."
# What each version changed, from v0 on, by task or tuning scenario; "" is all of them that there were.
CHANGES: tuple[dict[str, str], ...] = (
    {"": FIRST},
    {
        "": "Another default car and assist, the rack force without the weight of the wheels, another reference feel; "
        "rewards from 0 to 1 per second, scaled observations with the last action, decisions of drivers every 50 ms, "
        "on straight lines."
    },
    {
        "AssistRelease": "A speed and an angle that are drawn from low to high, a wanted return that is observed, a "
        "reward for following it, and 10 N m of authority; before, doing nothing earned almost as much as the best "
        "controller."
    },
    {
        "": "Episodes begin in the balance of straight running; before, after five seconds of it, in which two tracks "
        "did not reach their speed, by 0.4 %.",
        "TuneOnCentre": f"{_TUNED} Three more parameters are tuned; before, 20 random sets reached the maximum.",
        "TuneAllRound": _TUNED,
    },
    {
        "": "The friction of a car is LuGre at several sites, whose gear has an efficiency; before, at one. The "
        "default car has a front axle that returns from the lock, with one compliance for each wheel, and an assist "
        "that keeps 30 deg and 6 dB while the gear slides."
    },
    {"DriverStopAndGo": FIRST},
)


def _changes(name: str) -> list[str]:
    changes = [change.get("", "") + change.get(name, "") for change in CHANGES if "" in change or name in change]
    return changes[max(i for i, change in enumerate(changes) if change == FIRST) :]


def id_of(name: str) -> str:
    """The id of a task or a tuning scenario, by its name."""
    return f"steer_env/{name}-v{len(_changes(name)) - 1}"


def history(name: str) -> str:
    """What the versions of an id changed, by the name of its task or tuning scenario, the latest first."""
    return "\n\n".join(f"v{i}: {change}" for i, change in reversed(list(enumerate(_changes(name)))))


def _entry_points(package: str, module: str) -> dict[str, str]:
    """Id -> entry point, for everything in a folder of tasks or scenarios."""
    return {id_of(name): f"{module}:{name}" for name in modules_by_name(package, camel_case)}


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
