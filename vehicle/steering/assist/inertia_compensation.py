"""Inertia compensation: the motor supplies the torque that accelerates part of the inertia below the torsion bar (E14).

    T = J(v) s/(1 + s/p) th2'                                       (E14)

At frequencies well below p and the motor's bandwidth the inertia below the torsion bar is I2 - J. The lags of filter,
delay and motor turn part of the torque into negative damping, about -J omega^2 times their sum in seconds, so that it
needs motor damping.
"""

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from steer_env.friction.numerics.kernel import kernel
from steer_env.vehicle.keys import checked
from steer_env.vehicle.steering.assist import first_order
from steer_env.vehicle.steering.assist.by_speed import by_speed, shortest
from steer_env.vehicle.steering.assist.first_order import FirstOrder, filtered


class InertiaCompensation(NamedTuple):
    """Parameters as the kernels take them."""

    gain: NDArray[np.float64]  # (V,) inertia that is compensated [kg m2]
    derivative: FirstOrder  # from column speed to acceleration


STATES = (("acceleration_filter", "rad/s2"),)


def make(
    count: int, dt: float, *, inertia_compensation: ArrayLike = (0.0,), inertia_bandwidth: float = 100.0
) -> InertiaCompensation:
    """Checked parameters for ``count`` speeds and samples of ``dt`` [s]; an inertia of 0 is off.

    Parameters
    ----------
    count : int
        Speeds of the boost table, V.
    dt : float
        Sample time [s].
    inertia_compensation : (V,) or (1,) array_like, or float
        Inertia that is compensated, 0 to 1 [kg m2]; it should be less than the column's I2.
    inertia_bandwidth : float
        Corner p up to which the column speed is differentiated, 1 to 450 [Hz].
    """
    return InertiaCompensation(
        by_speed("inertia_compensation", inertia_compensation, count),
        first_order.derivative(checked("assist", "inertia_bandwidth", inertia_bandwidth), dt),
    )


def keys(p: InertiaCompensation, dt: float) -> dict[str, Any]:
    """The keys of a car file that make these parameters; the corner to twelve digits."""
    return {"inertia_compensation": shortest(p.gain), "inertia_bandwidth": first_order.pole(p.derivative, dt)}


@kernel
def torque(p, gain, x, w):
    """Torque with the acceleration [N m]; ``x`` is the function's state, ``w`` the column speed [rad/s]."""
    return gain * filtered(p.derivative, x, 0, w)  # (E14)
