"""What lane-keeping tasks share: the road, wind and surface that are drawn, the reward of keeping the lane."""

import math
from collections.abc import Mapping
from typing import NamedTuple

import numpy as np

from steer_env.courses import path
from steer_env.friction.numerics.kernel import kernel
from steer_env.tasks.common.definition import NODE, Case, Setting, Term
from steer_env.tasks.common.feel import judge_feel
from steer_env.tasks.common.path_following import judge_action, judge_following, lost, see
from steer_env.vehicle.chassis.common.interface import RACK_DISTURBANCE, WIND_FORCE, WIND_MOMENT

DURATION = 30.0  # [s]
LANE_HALF_WIDTH = 1.75  # [m]
WIND = 300.0  # standard deviation of the crosswind's force, assumed [N]
WIND_CORRELATION = 1.0  # [s]
WIND_ARM = 0.3  # centre of pressure ahead of the centre of gravity, assumed [m]
ROAD = 60.0  # standard deviation of the rack force of a rough surface, assumed [N]
ROAD_CORRELATION = 0.02  # [s]
DISTURBANCES = (WIND_FORCE, WIND_MOMENT, RACK_DISTURBANCE)


class Lane(NamedTuple):
    """Rules of the driver's tasks."""

    half_width: float  # [m]


class AssistedLane(NamedTuple):
    """Rules of the assist's task."""

    half_width: float  # [m]


@kernel
def _low_pass(noise, deviation, pole):
    """White noise of unit variance to first-order noise with a standard deviation, in place, from zero."""
    # Eight lines here save every start of an environment the 0.7 s of importing scipy.signal.
    gain = deviation * math.sqrt(1.0 - pole * pole)
    value = 0.0
    for i in range(noise.size):
        value = pole * value + gain * noise[i]
        noise[i] = value


def disturbances(rng: np.random.Generator, duration: float, wind: float, road: float) -> np.ndarray:
    """Wind force, wind moment and rack disturbance (N + 1, 3) at the nodes, from zero; standard deviations [N]."""
    n = round(duration / NODE) + 1
    found = np.zeros((n, 3))
    for column, deviation, correlation in ((0, wind, WIND_CORRELATION), (2, road, ROAD_CORRELATION)):
        noise = rng.standard_normal(n)
        _low_pass(noise, deviation, math.exp(-NODE / correlation))
        found[:, column] = noise
    found[:, 1] = WIND_ARM * found[:, 0]
    return found


def starter(peak_lateral_acceleration: float, held: bool = False):
    """Cases on winding roads with curvatures up to a lateral acceleration; ``held``: a column for the hands first."""

    def start(rng: np.random.Generator, setting: Setting, options: Mapping[str, float]) -> Case:
        road = path.winding(rng, setting.speed * (DURATION + 2.0), peak_lateral_acceleration / setting.speed**2)
        nodes = disturbances(rng, DURATION, options.get("wind", WIND), options.get("road", ROAD))
        return Case(np.insert(nodes, 0, 0.0, axis=1) if held else nodes, path=road)

    return start


OPTIONS = {
    "wind": (0.0, 2000.0, "standard deviation of the crosswind's force [N]"),
    "road": (0.0, 500.0, "standard deviation of the rough surface's rack force [N]"),
}
DEPARTURE = Term("departure", -10.0, "1", "leaving the lane")
BEGINS = (
    "Straight ahead in the middle of the lane at the held speed. The road (curvatures up to {:g} m/s2 at that speed), "
    f"the crosswind ({WIND:g} N, {WIND_CORRELATION:g} s) and the rack force of the surface ({ROAD:g} N, "
    f"{1e3 * ROAD_CORRELATION:g} ms) are drawn."
)
ENDS = (
    f"Terminates when the car leaves its lane ({LANE_HALF_WIDTH:g} m) or points across it; "
    f"truncates after {DURATION:g} s."
)


@kernel
def look(rules, row, path, values, now, memory, situation):
    see(row, path, now, memory, situation)


@kernel
def judge(rules, row, situation, values, now, memory, rewards, costs, figures):
    judge_following(row, situation, now, memory, rewards, costs, figures)
    judge_action(now, 3, rewards)
    if lost(situation, rules.half_width):
        rewards[5] += 1.0
        return True
    return False


@kernel
def judge_assist(rules, row, situation, values, now, memory, rewards, costs, figures):
    judge_following(row, situation, now, memory, rewards, costs, figures)
    judge_feel(row, now, 3, rewards)
    if lost(situation, rules.half_width):
        rewards[6] += 1.0
        return True
    return False
