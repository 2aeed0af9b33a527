"""Inputs of a case from a manoeuvre's definition: the same that the test battery drives."""

import numpy as np
from numpy.typing import NDArray

from steer_env.manoeuvres.common.definition import Manoeuvre
from steer_env.tasks.common.definition import NODE
from steer_env.vehicle.chassis.common.interface import HAND, HAND_SPEED

HANDS = (HAND, HAND_SPEED)


def nodes(manoeuvre: Manoeuvre, amplitude: float, duration: float) -> NDArray[np.float64]:
    """Handwheel angle [rad] and speed [rad/s] (N + 1, 2) at the nodes."""
    t: NDArray[np.float64] = NODE * np.arange(round(duration / NODE) + 1.0)
    return np.column_stack(manoeuvre.hand(t, amplitude))
