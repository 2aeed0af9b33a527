"""Active return: a torque towards the centre that fades when the driver holds the handwheel.

    s = gain (th1 + lead th1')/saturation
    T = -saturation s/sqrt(1 + s^2) 1/(1 + (T_tb/hold)^2) v/(v + v_0)

th1 is the handwheel angle, T_tb the torsion bar's torque: hands that hold the handwheel twist the bar, a released
handwheel does not. v is the car's speed; the tyres of a standing car do not centre, and no return is wanted in parking.
The term in th1' brakes before the centre. The structure is common practice; the shapes of saturation and fades are
assumed. docs/scores.md tells what it changes in each task.
"""

from typing import Any

import numpy as np

from steer_env.assists.common.definition import Array, Baseline, register
from steer_env.friction.numerics.check import not_negative, positive

HALF_SPEED = 3.0  # v_0, speed at which the return has half its size, assumed [m/s]


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
        self.saturation = positive("saturation [N m]", saturation)
        self.lead = not_negative("lead [s]", lead)
        self.hold = positive("hold [N m]", hold)

    def torque(self, seen: Array) -> Array:
        """Torque towards the centre [N m]."""
        angle, rate, twist, speed = seen.T
        # IEEE rounds roots and quotients exactly, so the result does not depend on the number of rows.
        s = self.gain / self.saturation * (angle + self.lead * rate)
        held, share = twist / self.hold, np.abs(speed) / (np.abs(speed) + HALF_SPEED)
        return -self.saturation * s / np.sqrt(1.0 + s * s) / (1.0 + held * held) * share


register("active_return", ActiveReturn)
