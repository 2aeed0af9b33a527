"""Active return: a torque towards the centre that fades when the driver holds the handwheel.

The law is that of the plant's own active return (E11), :mod:`steer_env.vehicle.steering.assist.active_return`, at the
control step instead of every millisecond. docs/scores.md tells what it changes in each task.
"""

from typing import Any

import numpy as np

from steer_env.assists.common.definition import Array, Baseline, register
from steer_env.friction.numerics.check import not_negative, positive
from steer_env.friction.numerics.kernel import kernel
from steer_env.vehicle.steering.assist import active_return


@kernel
def _torques(p, gain, seen, out):
    """The return's torque in every row."""
    for i in range(seen.shape[0]):
        at = seen[i]
        out[i] = active_return.torque(p, gain, at.handwheel_angle, at.handwheel_speed, at.torsion_bar_torque, at.speed)


class ActiveReturn(Baseline):
    """Active return to the centre.

    Parameters
    ----------
    env : assist environment
    gain : float
        Stiffness about the centre [N m/rad].
    saturation : float
        Largest torque [N m].
    lead : float
        Time over which the handwheel's motion is extrapolated [s].
    hold : float
        Torsion-bar torque that halves the return [N m].
    """

    needs = ("handwheel_angle", "handwheel_speed", "torsion_bar_torque", "speed")
    tuned = {"gain": (1.0, 40.0), "saturation": (0.3, 5.0), "lead": (0.0, 0.2), "hold": (0.05, 1.0)}  # noqa: RUF012

    def __init__(
        self, env: Any, *, gain: float = 10.0, saturation: float = 2.0, lead: float = 0.05, hold: float = 0.3
    ) -> None:
        super().__init__(env)
        self.gain = not_negative("gain [N m/rad]", gain)
        self._law = active_return.make(
            1,
            return_saturation=positive("saturation [N m]", saturation),
            return_lead=not_negative("lead [s]", lead),
            return_hold=positive("hold [N m]", hold),
        )

    def torque(self, seen: Any) -> Array:
        """Torque towards the centre [N m]."""
        out = np.zeros(self.n)
        _torques(self._law, self.gain, seen, out)
        return out


register("active_return", ActiveReturn)
