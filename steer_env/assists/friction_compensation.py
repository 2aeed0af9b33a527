"""Friction compensation: a friction law is the observer of the friction torque, and a share of it is fed back.

At every control step the law's own kernels advance its memory by the displacement of the step at the observed column
speed, and give the present torque, exact for that history (equal to :func:`steer_env.friction.response`):

    z <- advance(z, w, dt),    T_obs = torque(z, w),    T <- limit(T + limit(T_obs - T, k |w| dt), T_max)
    grip <- max(|T_tb|, grip exp(-dt/tau)),    request = share T grip^2/(grip^2 + hold^2)

The observed torque is limited for these reasons:

* ``STIFFNESS`` k bounds its slope over displacement. Coulomb's jump at a reversal has an unbounded gain at small
  amplitudes and, sampled and delayed, causes a limit cycle at standstill; as a ramp it is elastic there, as real
  friction is.
* ``LIMIT`` T_max bounds its size: the dry friction of a steering system is not larger, and a viscous observer would
  cancel the damping of fast motions.
* The grip fades it out with the torsion bar's torque. With a released handwheel the oscillation of a car with little
  motor damping is damped by little else than friction: if most of it is compensated, the car does not come to rest, and
  if the observer has more friction than the car, no share is safe. Hands on the handwheel add damping, and only they
  feel the friction.

The share is a compromise. With a dry law the feel error of AssistWeave falls up to a share of 1 (LuGre: 0.47 N m
without compensation, 0.38 N m at 0.4, 0.30 N m at 1), because the motor damping of the default car alone makes its loop
wider than that of the reference feel. But AssistRelease costs 7 % more at 0.4 and 17 % more at 1 with LuGre, and the
driver of AssistLaneKeeping has 13 % and 35 % more rms handwheel speed with Coulomb's law, 7 % and 34 % with the viscous
one, and no more with the others.
"""

import math
from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np

from steer_env import friction
from steer_env.assists.common.definition import Array, Baseline, register
from steer_env.friction import defaults
from steer_env.friction.law import advance, law_of, torque
from steer_env.friction.numerics.check import number
from steer_env.friction.numerics.kernel import bind, kernel

STIFFNESS = 2.0 * defaults.SIGMA_0  # slope of the default laws directly after a reversal from saturation [N m/rad]
LIMIT = 2.0 * defaults.F_C  # of the observed torque, before the share is taken [N m]
HOLD = 0.5  # torsion-bar torque at which half of the share is fed back, assumed [N m]
GRIP_TIME = 0.3  # time constant with which the grip decays, assumed [s]


class Observer(NamedTuple):
    """What the observers of all rows remember."""

    memory: Array  # (n, M) of the friction law
    observed: Array  # (n,) friction torque [N m]
    limited: Array  # (n,) friction torque within slope and size [N m]
    grip: Array  # (n,) decaying peak of the torsion bar's torque [N m]


@kernel
def _compensate(p, dt, decay, seen, observer, out):
    """Torque to feed back in every row, before the share is taken; ``decay`` is the grip's over ``dt``."""
    for i in range(seen.shape[0]):
        w = seen[i, 0]
        advance(p, 1.0, observer.memory[i], w, dt)
        observer.observed[i] = torque(p, 1.0, observer.memory[i], w)
        most = STIFFNESS * abs(w) * dt
        change = min(max(observer.observed[i] - observer.limited[i], -most), most)
        observer.limited[i] = min(max(observer.limited[i] + change, -LIMIT), LIMIT)
        grip = max(abs(seen[i, 1]), decay * observer.grip[i])
        observer.grip[i] = grip
        out[i] = observer.limited[i] * grip * grip / (grip * grip + HOLD * HOLD)


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
        memory = np.zeros((self.n, law_of(self.law).memory_size(self.law)))
        self._observer = Observer(memory, *np.zeros((3, self.n)))
        self.observed = self._observer.observed
        self._decay = math.exp(-self.control_dt / GRIP_TIME)
        self._kernel: Callable[..., None] | None = None

    def begin(self, i: int, seen: Array) -> None:
        """Start the observer at rest."""
        for array in self._observer:
            array[i] = 0.0

    def torque(self, seen: Array) -> Array:
        """A share of the observed friction torque [N m]."""
        out = np.zeros(self.n)
        arguments = self.law, self.control_dt, self._decay, seen, self._observer, out
        if self._kernel is None:
            self._kernel = bind(_compensate, *arguments)
        self._kernel(*arguments)
        return self.share * out


register("friction_compensation", FrictionCompensation)
