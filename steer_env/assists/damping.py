"""Motor damping in addition to the table's own: T = -gain w, w the column speed, by the plant's own kernel (E12).

The tables of the packaged cars already contain the damping that free control needs; every gain worsens the feel of a
weave. Twice the former default of 0.5 N m s/rad makes the driver model hunt on one of the packaged cars.
"""

from typing import Any

from steer_env.assists.common.definition import Array, Baseline, register
from steer_env.friction.numerics.check import not_negative
from steer_env.friction.numerics.kernel import plain
from steer_env.vehicle.steering.assist import damping


class Damping(Baseline):
    """Damping of the column.

    Parameters
    ----------
    env : assist environment
    gain : float
        Damping [N m s/rad].
    """

    needs = ("column_speed",)
    tuned = {"gain": (0.0, 3.0)}  # noqa: RUF012

    def __init__(self, env: Any, *, gain: float = 0.3) -> None:
        super().__init__(env)
        self.gain = not_negative("gain [N m s/rad]", gain)

    def torque(self, seen: Any) -> Array:
        """Torque against the column speed [N m]."""
        return plain(damping.torque)(self.gain, seen.column_speed)


register("damping", Damping)
