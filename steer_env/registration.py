"""The ids that Gymnasium knows; entry points are strings, so that registering them imports no environment."""

import gymnasium as gym

from steer_env.friction.numerics.registry import camel_case, listed

VERSION = "v0"

# A step is a moment of a drive; each id has a vector environment of its own.
DRIVEN = {
    f"steer_env/{name}-{VERSION}": f"steer_env.environments:{name}" for name in listed("steer_env.tasks", camel_case)
}
# A step is a whole evaluation of a set of parameters.
TUNED = {
    f"steer_env/{name}-{VERSION}": f"steer_env.tuning.registration:{name}" for name in ("TuneOnCentre", "TuneAllRound")
}
REGISTERED = DRIVEN | TUNED


def register() -> None:
    """Register the ids with Gymnasium."""
    for name, entry_point in DRIVEN.items():
        gym.register(name, entry_point=entry_point, vector_entry_point=f"{entry_point}Vector")
    for name, entry_point in TUNED.items():
        gym.register(name, entry_point=entry_point)
