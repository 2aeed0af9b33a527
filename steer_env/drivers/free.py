"""No driver: hands off the handwheel."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from steer_env.drivers.common.definition import NO_ARM, Driver, register, register_preview_model
from steer_env.friction.numerics.kernel import kernel
from steer_env.vehicle.cars import Car


class NoPreview(NamedTuple):
    """Parameters of a preview model that always commands zero; there are none."""


def _gains(p: NoPreview, car: Car, speed: float) -> NDArray[np.float64]:
    return np.zeros(0)


@kernel
def _command(p, gains, path, lateral_speed, yaw_rate, z, memory):
    return 0.0


register_preview_model(NoPreview, _gains, _command)
register("free", lambda: Driver("free", NoPreview(), NO_ARM))
