"""Nobody: hands off the handwheel."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from steer_env.drivers.common.definition import FREE, Driver, register, register_eyes
from steer_env.friction.numerics.kernel import kernel
from steer_env.vehicle.cars import Car


class Closed(NamedTuple):
    """Eyes that see nothing."""


def _gains(p: Closed, car: Car, speed: float) -> NDArray[np.float64]:
    return np.zeros(0)


@kernel
def _command(p, gains, sight, lateral_speed, yaw_rate, z, memory):
    return 0.0


register_eyes(Closed, _gains, _command)
register("free", lambda: Driver("free", Closed(), FREE))
