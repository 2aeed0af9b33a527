"""The hand torque that a lateral acceleration should have: degressive, firm on centre, still rising far from it (E7).

    T(A) = G_1 A + (G_0 - G_1) s tanh(A/s)

The gradient on centre is within the 12 to 22 N m/g of compact cars with EPS and near the 23 N m/g that drivers
preferred (Segel, 1964); the rest is assumed. The boost of the packaged cars is shaped for it, and it is the main part
of the reference feel of the assist tasks.
"""

import math

from steer_env.friction.numerics.kernel import kernel
from steer_env.vehicle.constants import GRAVITY

GRADIENT, FAR_GRADIENT = 22.0, 4.0  # G_0, G_1: on centre and far from it [N m/g]
SOFTENING = 0.11  # s: lateral acceleration at which the gradient has fallen most of the way [g]


@kernel
def torque_build_up(lateral_acceleration):
    """Hand torque [N m], without friction, at a lateral acceleration [m/s2]; odd."""
    A = lateral_acceleration / GRAVITY
    return FAR_GRADIENT * A + (GRADIENT - FAR_GRADIENT) * SOFTENING * math.tanh(A / SOFTENING)  # (E7)
