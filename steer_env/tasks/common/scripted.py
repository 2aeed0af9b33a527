"""Scripted inputs from a manoeuvre's definition: the same that the test battery drives."""

from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from steer_env.episode.timing import UPDATE_INTERVAL
from steer_env.manoeuvres.common import shapes
from steer_env.manoeuvres.common.definition import Manoeuvre
from steer_env.vehicle.chassis.common.interface import HAND, HAND_SPEED

HANDS = (HAND, HAND_SPEED)


def update_times(duration: float) -> NDArray[np.float64]:
    """Times (U,) of the updates of an episode, its start and end included [s]."""
    times: NDArray[np.float64] = UPDATE_INTERVAL * np.arange(round(duration / UPDATE_INTERVAL) + 1.0)
    return times


@lru_cache(maxsize=4)
def sine_factors(frequency: float, duration: float) -> NDArray[np.float64]:
    """Factors (2, U, 2) of a :class:`Script` of :func:`hand_motion` of a sine [Hz] at every update."""
    return np.stack(shapes.sine_factors(update_times(duration), frequency)).transpose(0, 2, 1)


def hand_motion(manoeuvre: Manoeuvre, amplitude: float, duration: float) -> NDArray[np.float64]:
    """Handwheel angle [rad] and speed [rad/s] (U, 2) at every update."""
    return np.column_stack(manoeuvre.hand(update_times(duration), amplitude))
