"""Integral control of the feel: the request grows as long as the hand torque differs from the reference feel.

    I <- (I + rate share e dt) exp(-(1 - share) dt/LEAK),    e = T_tb - r,    request = share (I + proportional e)

r is the reference of the task, and the share fades the request when nobody holds the handwheel or it moves quickly
(:mod:`steer_env.assists.common.reference_feel`); the integral then leaks. It has the whole of the action's scale. The
torsion bar's torque stands for the hand torque, which neglects the handwheel's inertia.

The defaults are near the largest with which the suite for assists holds
(:mod:`steer_env.experiments.learning.assist_suite`): a quicker loop ripples where the action is doubled.
"""

import math
from typing import Any

import numpy as np

from steer_env.assists.common.definition import Array, Baseline, register
from steer_env.assists.common.reference_feel import Feel
from steer_env.friction.numerics.check import not_negative

LEAK = 0.2  # time constant with which the integral fades where the assist does, assumed [s]


class Integral(Baseline):
    """Integral control of the feel.

    Parameters
    ----------
    env : assist environment
    rate : float
        Rate at which the request grows for each N m of error [1/s].
    proportional : float
        Request for each N m of error [1].
    caution : float
        How far quick motions of the handwheel fade the request [1].
    """

    needs = ("speed", "torsion_bar_torque", "lateral_acceleration", "handwheel_speed")
    tuned = {"rate": (5.0, 150.0), "proportional": (0.0, 3.0), "caution": (0.3, 100.0)}  # noqa: RUF012

    def __init__(self, env: Any, *, rate: float = 45.0, proportional: float = 0.5, caution: float = 5.0) -> None:
        super().__init__(env)
        self.rate = not_negative("rate [1/s]", rate)
        self.proportional = not_negative("proportional", proportional)
        self.caution = not_negative("caution", caution)
        self._feel, self._integral = Feel(self.batch, self.caution), np.zeros(self.n)

    def begin(self, i: int, seen: Any) -> None:
        """Start without a request."""
        self._integral[i] = 0.0
        self._feel.begin(i, seen.handwheel_speed)

    def torque(self, seen: Any) -> Array:
        """Torque that the integral requests [N m]."""
        twist, rate = seen.torsion_bar_torque, seen.handwheel_speed
        share = self._feel.shares(twist, rate, seen.speed)
        error = twist - self._feel.references(seen.lateral_acceleration, rate, seen.speed)
        # Row by row, as numpy's own exponential may depend on the number of rows.
        kept = np.array([math.exp(-(1.0 - each) * self.control_dt / LEAK) for each in share.tolist()])
        grown = kept * (self._integral + self.rate * self.control_dt * share * error)
        self._integral = np.clip(grown, -self.scale, self.scale)
        return share * (self._integral + self.proportional * error)


register("integral", Integral)
