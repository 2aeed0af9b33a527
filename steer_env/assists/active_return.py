"""Active return: a torque toward the middle that gives way to the driver.

    s = gain (th1 + lead th1')/saturation
    T = -saturation s/sqrt(1 + s^2) 1/(1 + (T_tb/hold)^2) v/(v + v_0)

th1 is the handwheel angle, T_tb the torsion bar's torque: hands that hold the handwheel twist the bar, a handwheel let
go leaves it slack. v is the car's speed; tyres that stand do not centre, and parking wants no return. The term in th1'
brakes before the middle. The structure is common practice; the shapes of saturation and fades are assumed, the gains
chosen for a quarter less cost in AssistRelease without a loss in the other tasks.
"""

from typing import Any

import numpy as np

from steer_env.assists.common.definition import Array, Baseline, register
from steer_env.friction.numerics.check import not_negative, positive

STANDING = 3.0  # v_0, speed at which half of the return is there, assumed [m/s]


class ActiveReturn(Baseline):
    """Active return.

    Parameters
    ----------
    env : assist environment
    gain : float
        Stiffness about the middle [N m/rad].
    saturation : float
        Largest torque [N m].
    lead : float
        Time over which the handwheel's motion is foreseen [s].
    hold : float
        Torsion-bar torque that halves the return [N m].
    """

    needs = ("handwheel_angle", "handwheel_speed", "torsion_bar_torque", "speed")

    def __init__(
        self, env: Any, *, gain: float = 10.0, saturation: float = 2.0, lead: float = 0.05, hold: float = 0.3
    ) -> None:
        super().__init__(env)
        self.gain = not_negative("gain [N m/rad]", gain)
        self.saturation = positive("saturation [N m]", saturation)
        self.lead = not_negative("lead [s]", lead)
        self.hold = positive("hold [N m]", hold)

    def torque(self, seen: Array) -> Array:
        """Toward the middle [N m]."""
        angle, rate, twist, speed = seen.T
        # A root and quotients, which IEEE rounds exactly, so that lanes do not depend on their number.
        s = self.gain / self.saturation * (angle + self.lead * rate)
        held, share = twist / self.hold, np.abs(speed) / (np.abs(speed) + STANDING)
        return -self.saturation * s / np.sqrt(1.0 + s * s) / (1.0 + held * held) * share


register("active_return", ActiveReturn)
