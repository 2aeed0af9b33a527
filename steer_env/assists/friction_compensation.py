"""Friction compensation: a friction law is the observer of the friction torque, and a share of it is fed back.

The observer is the plant's own (E13), :mod:`steer_env.vehicle.steering.assist.friction_compensation`, which also tells
why its torque is limited and fades with the grip; here it runs at the control step instead of every millisecond.

The share is a compromise. With a dry law the feel error of AssistWeave falls up to a share of 1 (LuGre: 0.47 N m
without compensation, 0.38 N m at 0.4, 0.30 N m at 1), because the motor damping of the default car alone makes its loop
wider than that of the reference feel. But AssistRelease earns 4 % less at 0.4 and 7 % less at 1 with LuGre, and the
driver of AssistLaneKeeping has 13 % and 35 % more rms handwheel speed with Coulomb's law, 7 % and 34 % with the viscous
one, and no more with the others.
"""

from collections.abc import Callable
from typing import Any

import numpy as np

from steer_env import friction
from steer_env.assists.common.definition import Array, Baseline, register
from steer_env.friction.numerics.check import number
from steer_env.friction.numerics.kernel import bind, kernel
from steer_env.vehicle.steering.assist import friction_compensation
from steer_env.vehicle.steering.assist.friction_compensation import MEMORY, OBSERVED


@kernel
def _compensate(p, seen, memory, out):
    """Torque to feed back in every row, before the share is taken."""
    for i in range(seen.shape[0]):
        out[i] = friction_compensation.torque(p, memory[i], seen[i].column_speed, seen[i].torsion_bar_torque)


class FrictionCompensation(Baseline):
    """Compensation of a share of the friction torque.

    Parameters
    ----------
    env : assist environment
    law : str or parameters
        The observer's law, by name or from ``friction.make``; it need not be the car's.
    share : float
        Share of the observed torque that is fed back, 0 to 1.

    Attributes
    ----------
    observed : (n,) array
        The observer's friction torque [N m].
    """

    needs = ("column_speed", "torsion_bar_torque")
    tuned = {"share": (0.0, 1.0)}  # noqa: RUF012

    def __init__(self, env: Any, *, law: Any = "lugre", share: float = 0.4) -> None:
        super().__init__(env)
        self.law = friction.resolve(law)
        self.share = number("share", share, minimum=0.0, maximum=1.0)
        self._law = friction_compensation.make(1, self.control_dt, friction_law=self.law)
        self._memory = np.zeros((self.n, MEMORY + self._law.memory_size))
        self.observed = self._memory[:, OBSERVED]
        self._kernel: Callable[..., None] | None = None

    def begin(self, i: int, seen: Any) -> None:
        """Start the observer at rest."""
        self._memory[i] = 0.0

    def torque(self, seen: Any) -> Array:
        """A share of the observed friction torque [N m]."""
        out = np.zeros(self.n)
        arguments = self._law, seen, self._memory, out
        if self._kernel is None:
            self._kernel = bind(_compensate, *arguments)
        self._kernel(*arguments)
        return self.share * out


register("friction_compensation", FrictionCompensation)
