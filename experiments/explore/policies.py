"""The shipped policies as the page takes them: what they see and do, and the weights of their layers.

The page computes their observations itself, without noise or delay, from the plant's channels and the path ahead. What
it knows nothing of, as a target of the handwheel angle, no policy of the page observes.
"""

from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np

from steer_env import tasks
from steer_env.assists.common import reference_feel
from steer_env.courses import iso3888
from steer_env.courses.path import SPACING
from steer_env.courses.preview import PREVIEW_TIMES
from steer_env.experiments.learning import network, policy
from steer_env.live.drive import scene
from steer_env.manoeuvres.double_lane_change import APPROACH
from steer_env.tasks.common import cones
from steer_env.tasks.common.definition import LAST_ACTION, SPEED, Task
from steer_env.tasks.common.path_following import PATH_OBSERVATIONS
from steer_env.vehicle.cars import Car
from steer_env.vehicle.chassis.common.interface import ASSIST_REQUEST, HAND
from steer_env.vehicle.plant import CHANNEL
from steer_env.vehicle.steering.eps import SAMPLE_TIME
from steer_env.vehicle.subsystems.car import input_index

FOLDER = "policies"
_PATH = [quantity.name for quantity in PATH_OBSERVATIONS]
_COMPUTED_OBSERVATIONS = {*CHANNEL, SPEED.name, LAST_ACTION.name, *_PATH}
_ROLES = {HAND: "driver", ASSIST_REQUEST: "assist"}  # by the input of the plant


@lru_cache(1)
def available() -> tuple[str, ...]:
    """Ids of the shipped policies that can act in the page."""
    found = sorted(file.parent.name for file in policy.SHIPPED_IN.glob("*/policy.zip"))
    return tuple(f"steer_env/{name}" for name in found if _acts(policy.SHIPPED_IN / name / "policy.zip"))


def _acts(path: Path) -> bool:
    """Whether the page can compute what a policy observes and the form of its network."""
    about = policy.read_description(path)
    return (
        about["algorithm"] == "ppo"
        and policy.observation_frames(about) == 1
        and _COMPUTED_OBSERVATIONS.issuperset(about["observations"])
    )


def script_path(env_id: str) -> str:
    """Path of the script of a policy in the folder."""
    return f"{FOLDER}/{env_id.removeprefix('steer_env/')}.js"


def _task(env_id: str) -> Task:
    return tasks.task(policy.check_driven(env_id))


def listed() -> list[dict[str, Any]]:
    """What the page shows of each policy before it is chosen: id, role, task, law and speeds of training, script."""
    return [_listed(each) for each in available()]


def _listed(env_id: str) -> dict[str, Any]:
    task, about = _task(env_id), policy.read_description(policy.shipped_policy(env_id))
    return {
        "id": env_id,
        "role": _ROLES[task.action.input],
        "about": task.summary,
        "law": about["friction"],
        "speeds": policy.conditions(about).get("randomise", {}).get("speed"),  # [m/s]; None: those of its task
        "file": script_path(env_id),
    }


def paths(car: Car) -> dict[str, Any]:
    """The path (P, 4) through each course with cones of the drive, whose first cone stands at x = 0."""
    size = iso3888.footprint(car)
    shift = np.array([APPROACH, 0.0, 0.0, 0.0])
    return {name: cones.course(name, size)[0] - shift for name in scene.COURSES if name != scene.PLAIN_COURSE}


def described(env_id: str) -> dict[str, Any]:
    """A policy as ``policy.js`` of the page takes it, with its weights as an array of 32-bit floats.

    Raises
    ------
    ValueError
        There is no such policy.
    """
    path, task = policy.shipped_policy(env_id), _task(env_id)
    about = policy.read_description(path)
    policy.check_observations(path, about, env_id)
    layers, scaling = network.layers(path, about), about["scaling"]
    environment, caution = about["settings"]["environment"], policy.guard_caution(about)
    dt, normalised = environment["control_dt"], environment.get("normalise", True)
    return {
        "id": env_id,
        "role": _ROLES[task.action.input],
        "observed": [
            {
                "name": quantity.name,
                "bound": float(np.float32(quantity.bound)),
                "scale": quantity.usual if normalised else 1.0,
                "mean": mean,
                "deviation": deviation,
            }
            for quantity, mean, deviation in zip(task.observed, scaling["mean"], scaling["deviation"])
        ],
        "follows": any(name in about["observations"] for name in _PATH),
        "clip": scaling["clip"],
        "path": {"names": _PATH, "spacing": SPACING, "step": PREVIEW_TIMES[0]},
        "layers": [layer.weight.shape for layer in layers],
        "weights": np.concatenate([each.ravel() for layer in layers for each in layer]).astype("<f4"),
        "given": input_index(task.action.input),
        "torque": task.action.scale,
        "ramped": task.action.ramped,
        "samples": round(dt / SAMPLE_TIME),
        "guard": None if caution is None else _guard(dt, caution),
    }


def _guard(dt: float, caution: float) -> dict[str, Any]:
    """The numbers of the guard that fades an assist (:mod:`steer_env.experiments.learning.guard`)."""
    hands, corner, grip_kept, motion_kept, caution = reference_feel.rates_at(dt, caution)
    return {
        "dt": dt,
        "hands": hands,
        "corner": corner,
        "gripKept": grip_kept,
        "motionKept": motion_kept,
        "caution": caution,
        "above": reference_feel.ABOVE,
        "grip": reference_feel.GRIP,
        "slow": reference_feel.SLOW_HANDWHEEL_SPEED,
        "halfSpeed": reference_feel.HALF_SPEED,
    }
