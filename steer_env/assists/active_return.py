"""Active return: a torque towards the centre that fades when the driver holds the handwheel.

The law is that of the plant's own active return (E11), :mod:`steer_env.vehicle.steering.assist.active_return`, at the
control step instead of every millisecond. The scores of docs/benchmark.md tell what it changes in each task.

Where the environment tells a wanted return (AssistRelease), angle and speed are those beyond it, so that the handwheel
follows it, and the release is known: nothing fades with the grip. An integral of the angle then takes up what friction
and rack hold against it, within the same saturation.
"""

from typing import Any

import numpy as np

from steer_env.assists.common.definition import Array, Baseline, register
from steer_env.friction.numerics.bounds import within
from steer_env.friction.numerics.check import not_negative, positive
from steer_env.friction.numerics.kernel import kernel
from steer_env.tasks.assist_release import RETURN_ERRORS
from steer_env.vehicle.steering.assist import active_return


@kernel
def _torques(p, gain, seen, out):
    """The return's torque in every row."""
    for i in range(seen.shape[0]):
        at = seen[i]
        out[i] = active_return.torque(p, gain, at.handwheel_angle, at.handwheel_speed, at.torsion_bar_torque, at.speed)


@kernel
def _following(p, gain, integral, dt, seen, memory, out):
    """The torque in every row that follows the wanted return."""
    for i in range(seen.shape[0]):
        at = seen[i]
        if at.released < 0.5:
            memory[i] = out[i] = 0.0
            continue
        memory[i] = within(memory[i] + integral * dt * at.return_error, -p.saturation, p.saturation)
        out[i] = memory[i] + active_return.torque(p, gain, -at.return_error, -at.return_speed_error, 0.0, at.speed)


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
    integral : float
        Of the angle, where a wanted return is told [N m/(rad s)].
    """

    needs = ("handwheel_angle", "handwheel_speed", "torsion_bar_torque", "speed")
    optional = ("released", *RETURN_ERRORS)
    tuned = {  # noqa: RUF012
        "gain": (1.0, 160.0),
        "saturation": (0.3, 10.0),
        "lead": (0.0, 0.2),
        "hold": (0.05, 1.0),
        "integral": (0.0, 1500.0),
    }

    def __init__(
        self,
        env: Any,
        *,
        gain: float = 10.0,
        saturation: float = 2.0,
        lead: float = 0.05,
        hold: float = 0.3,
        integral: float = 0.0,
    ) -> None:
        super().__init__(env)
        self.integral = not_negative("integral [N m/(rad s)]", integral)
        self._follows = RETURN_ERRORS[0] in [quantity.name for quantity in self.batch.observed]
        self._integrals = np.zeros(self.n)
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
        if self._follows:
            _following(self._law, self.gain, self.integral, self.control_dt, seen, self._integrals, out)
        else:
            _torques(self._law, self.gain, seen, out)
        return out


register("active_return", ActiveReturn)
