"""A classical controller that turns the handwheel along a target angle: the baseline where no path is observed.

    T = K e + K_i integral of e + D (w - th1') + T_turn,    e = target - th1

w is the target's speed and T_turn the torque that turning is known to need: that of a standing car's tyres, or the
friction of the steering system on centre. Both twist before they slide, so it follows the angle turned since the last
reversal with a length l, as friction after Dahl:

    dT_turn/dth = (T_slide sign(w) - T_turn)/l

The integral corrects what a car needs beyond that. Source: textbook servo control; numbers tuned on DriverParking and
DriverOnCentre.
"""

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from steer_env.drivers.common.definition import Arm
from steer_env.drivers.common.driver_batch import decided_arm

Array = NDArray[np.float64]


class Gains(NamedTuple):
    """Numbers of a servo."""

    stiffness: float  # K [N m/rad]
    damping: float  # D [N m s/rad]
    integral: float  # K_i/K [1/s]
    sliding: float  # T_slide [N m]
    length: float  # l [rad]


# Stable with 20 ms of delay. The sliding torque is that for which the assists of the packaged cars are designed.
PARKING = Gains(9.0, 0.6, 5.0, 4.0, 0.7)
ON_CENTRE = Gains(23.0, 1.1, 30.0, 0.5, 0.01)
_ANGLES, _TIMES = ("target_0.0s", "target_0.2s", "target_0.5s"), (0.0, 0.2, 0.5)


class AngleServo:
    """Follows the target angle of a task that observes it, single or vector, by hand torque.

    Parameters
    ----------
    env : gym.Env or gym.vector.VectorEnv
        Of a task that observes handwheel angle and speed and the target angles ahead, as ``DriverParking``; with any
        ``control_dt``, with which the servo becomes softer beyond 50 ms.
    gains : Gains, optional
        ``PARKING`` by default where the task's car stands, else ``ON_CENTRE``.

    Raises
    ------
    ValueError
        The task observes no target angle.
    """

    def __init__(self, env: Any, gains: Gains | None = None) -> None:
        batch = env.unwrapped.batch
        names = [quantity.name for quantity in batch.observed]
        wanted = ("handwheel_speed", *_ANGLES)
        if not {*wanted} <= {*names}:
            raise ValueError(f"the angle servo cannot act in {batch.task.name}: it needs an observed target angle")
        self._places = np.array([names.index(name) for name in wanted])
        self._observation_scale = getattr(env.unwrapped, "observation_scale", 1.0)
        self._interval, self._scale = batch.control_dt, batch.task.action.scale
        self._gains = gains or (PARKING if batch.task.speed == 0.0 else ON_CENTRE)
        self._arm = decided_arm(Arm(0.0, self._gains.damping, self._gains.stiffness, 0.0), batch.car, self._interval)
        self._integral, self._turning = np.zeros(batch.n), np.zeros(batch.n)  # [rad s], [N m]

    def reset(self, rows: Any = slice(None)) -> None:
        """Forget the episodes of some sub-environments (mask or indices), or of all."""
        self._integral[rows] = self._turning[rows] = 0.0

    def act(self, observation: NDArray[np.float32]) -> NDArray[np.float32]:
        """Action (1,) for an observation (O,), or (n, 1) for (n, O)."""
        seen = np.atleast_2d(observation).astype(float) * self._observation_scale
        speed, error, *ahead = seen[:, self._places].T
        wanted = _speed_ahead(np.array([error, *ahead]), self._interval)
        self._integral += self._interval * error
        sliding = self._gains.sliding * np.sign(wanted)
        kept = np.exp(-np.abs(wanted) * self._interval / self._gains.length)
        self._turning = sliding + (self._turning - sliding) * kept
        expected = error + self._interval * (wanted - speed)  # at the interval's end, when the action is reached
        correction = self._arm.stiffness * (expected + self._gains.integral * self._integral)
        torque = correction + self._arm.damping * (wanted - speed) + self._turning
        action = np.clip(torque / self._scale, -1.0, 1.0).astype(np.float32)
        return action if observation.ndim == 1 else action[:, None]


def _speed_ahead(angles: Array, time: float) -> Array:
    """Speed (n,) at a time from now [s] of the parabola through the angles (3, n) at ``_TIMES``."""
    first, second = np.diff(angles, axis=0) / np.diff(_TIMES)[:, None]
    acceleration = 2.0 * (second - first) / (_TIMES[2] - _TIMES[0])
    speed: Array = first + acceleration * (time - 0.5 * (_TIMES[0] + _TIMES[1]))
    return speed
