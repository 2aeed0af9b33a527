"""The start of an episode: the car's own assist out of tune, by an offset of every parameter that the action sets.

An offset has the action's unit: a step from -1 to 0 or from 0 to 1. It lies between half of the largest one and the
largest one, so that no parameter is right by chance. That of a strength is above 0, as most cars do not have the
function, and less than nothing is nothing. The start is driveable: the loop keeps a share of the wanted margins.
"""

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from steer_env.friction.sites import transmissions
from steer_env.tuning import reward
from steer_env.tuning.parameters import FUNCTIONS, make_assist, values
from steer_env.vehicle.cars import Car
from steer_env.vehicle.steering.margins import TARGETS as MARGINS
from steer_env.vehicle.steering.margins import least, worst_margins

Array = NDArray[np.float64]

LEAST_OFFSET_RATIO = 0.5  # smallest offset over the largest one; assumed [1]
KEPT_MARGIN_SHARE = 2.0 / 3.0  # of the wanted margins that the start keeps; assumed [1]
TRIES = 20  # offsets that are drawn at most; the one with the largest margins is taken where none keeps them


def draw_offsets(
    rng: np.random.Generator, car: Car, friction: Any, names: tuple[str, ...], speeds: Sequence[float], largest: float
) -> Array:
    """Offsets (n,) of the named parameters, with which the loop is stable at the speeds of the tests [m/s]."""
    if not largest:
        return np.zeros(len(names))
    upward = np.array([name in FUNCTIONS for name in names])
    best, most, passed = np.zeros(len(names)), 0.0, transmissions(friction)
    for _ in range(TRIES):
        sign = np.where(upward, 1.0, rng.choice((-1.0, 1.0), len(names)))
        offset = sign * rng.uniform(LEAST_OFFSET_RATIO, 1.0, len(names)) * largest
        kept = _margin_share(car, passed, names, speeds, offset)
        if kept > most:
            best, most = offset, kept
        if most >= KEPT_MARGIN_SHARE:
            break
    return best


def _margin_share(
    car: Car, passed: tuple[float, ...], names: tuple[str, ...], speeds: Sequence[float], offset: Array
) -> float:
    """The smaller share of a wanted margin that an offset keeps [1]; 0 where the loop is unstable."""
    assist = make_assist(car.assist, values(car.assist, names, offset))
    found = least([worst_margins(car.column, assist, speed, passed) for speed in speeds])
    shares = (margin / wanted for margin, wanted in zip(reward.degrees_and_decibels(found), MARGINS))
    return min(shares) if found.stable else 0.0
