"""Friction compensation: a friction law runs along as an observer, and a share of its torque is fed back.

At every control step the law's own kernels carry its memory over the displacement of the step, at the observed column
speed, and give the torque now, exact for that history (:func:`steer_env.friction.response` of it is the same):

    z <- advance(z, w, dt),    T_obs = torque(z, w),    T <- limit(T + limit(T_obs - T, k |w| dt), T_max)
    grip <- max(|T_tb|, grip exp(-dt/tau)),    request = share T grip^2/(grip^2 + hold^2)

What is taken off the observed torque, and why:

* ``STIFFNESS`` k bounds its slope by the displacement. Coulomb's jump at a reversal has an unbounded gain at small
  amplitudes and, sampled and late, rattles about standstill; as a ramp it is elastic there, as friction itself is.
* ``LIMIT`` T_max bounds its size: no dry friction of a steering is larger, and a viscous observer would cancel the
  damping of fast motions.
* The grip fades it out with the torsion bar's torque. A car whose handwheel is let go swings little damped but for
  friction; with most of that taken away it does not come to rest, and where the observer has more friction than the
  car, no gain of it is safe. Hands on the handwheel bring the damping, and nobody else feels the friction.

The share follows from AssistWeave: the reference feel asks for a friction of its own, so that its error is least at
0.3 to 0.4 of the car's friction, and no better than without compensation at 0.7. With 0.7 the driver of
AssistLaneKeeping also sways where the car's friction is Coulomb's or viscous; with 0.4 he is a third busier there,
and elsewhere as without.
"""

import math
from collections.abc import Callable
from typing import Any

import numpy as np

from steer_env import friction
from steer_env.assists.common.definition import Array, Baseline, register
from steer_env.friction import defaults
from steer_env.friction.law import advance, law_of, torque
from steer_env.friction.numerics.check import number
from steer_env.friction.numerics.kernel import bind, kernel

STIFFNESS = 2.0 * defaults.SIGMA_0  # slope of the default laws right after a reversal from saturation [N m/rad]
LIMIT = 2.0 * defaults.F_C  # of the torque before the share [N m]
HOLD = 0.5  # torsion-bar torque at which half is fed back, assumed [N m]
GRIP_TIME = 0.3  # in which a grip is forgotten, assumed [s]


@kernel
def _compensate(p, dt, kept, seen, memory, observed, given, grip, out):
    """Torque to feed back in every lane; the observed torque, what slope and size leave of it, and the grip remain."""
    for i in range(seen.shape[0]):
        w = seen[i, 0]
        advance(p, 1.0, memory[i], w, dt)
        observed[i] = torque(p, 1.0, memory[i], w)
        most = STIFFNESS * abs(w) * dt
        change = min(max(observed[i] - given[i], -most), most)
        given[i] = min(max(given[i] + change, -LIMIT), LIMIT)
        grip[i] = max(abs(seen[i, 1]), kept * grip[i])
        out[i] = given[i] * grip[i] * grip[i] / (grip[i] * grip[i] + HOLD * HOLD)


class FrictionCompensation(Baseline):
    """Compensation of a share of the friction.

    Parameters
    ----------
    env : assist environment
    law : str or parameters
        The observer's law, by name or from ``friction.make``; it need not be the car's.
    share : float
        0 to 1, of the observed torque.

    Attributes
    ----------
    observed : (n,) array
        The observer's friction torque [N m].
    """

    needs = ("column_speed", "torsion_bar_torque")

    def __init__(self, env: Any, *, law: Any = "lugre", share: float = 0.4) -> None:
        super().__init__(env)
        self.law = friction.resolve(law)
        self.share = number("share", share, minimum=0.0, maximum=1.0)
        self._memory = np.zeros((self.n, law_of(self.law).memory_size(self.law)))
        self._kept = math.exp(-self.control_dt / GRIP_TIME)
        self.observed, self._given, self._grip = np.zeros(self.n), np.zeros(self.n), np.zeros(self.n)
        self._bound: Callable[..., None] | None = None

    def begin(self, i: int, seen: Array) -> None:
        """At rest."""
        self._memory[i] = self.observed[i] = self._given[i] = self._grip[i] = 0.0

    def torque(self, seen: Array) -> Array:
        """A share of the observed friction torque [N m]."""
        out = np.zeros(self.n)
        arguments = (
            self.law, self.control_dt, self._kept, seen, self._memory, self.observed, self._given, self._grip, out
        )  # fmt: skip
        if self._bound is None:
            self._bound = bind(_compensate, *arguments)
        self._bound(*arguments)
        return self.share * out


register("friction_compensation", FrictionCompensation)
