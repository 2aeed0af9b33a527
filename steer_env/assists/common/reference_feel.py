"""What assists share that make the hand torque follow a reference feel: the reference, and when they step back.

The reference feel has stiffness, which lags with the lateral acceleration, and hardly any damping. A hand torque that
follows it in every motion takes the steering's own damping away: the arms of a driver then oscillate with the car at
about 1 Hz, and a released handwheel even more. A filter that left these frequencies out would add lag to the loop; so
the assist is faded instead, by a share of two factors:

    share = g^2/(g^2 + GRIP^2) s^2/(s^2 + caution f^2 v^2/(v^2 + v_0^2))

* g is the grip: the decaying peak of the hands' torque T_tb + I_1 w1', which is what twists the torsion bar beyond the
  handwheel's own inertia, through two low-pass filters, less what friction above the bar may hold without hands.
  Nobody holds the handwheel where it is small.
* f is the decaying peak of the handwheel speed's part above ``CORNER``, and s^2 that of the part below, plus
  ``SLOW_HANDWHEEL_SPEED``^2. Quick steering is left to the car and its boost, the more the larger ``caution`` is. Only
  the ratio counts, so an oscillation of any size fades the assist that feeds it, until it dies out. v is the car's
  speed: a standing car has no lateral motion.

Structure and numbers are assumed; the numbers were chosen on the suite for assists
(:mod:`steer_env.experiments.learning.assist_suite`).
"""

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from steer_env.friction.numerics.kernel import kernel
from steer_env.tasks.assist_parking import WANTED, wanted_torque
from steer_env.tasks.common.reference_feel import reference_torque
from steer_env.tasks.common.standstill import CREEPING

Array = NDArray[np.float64]

ABOVE = 0.2  # twist of the bar that friction above it may hold, twice that of the default car; assumed [N m]
GRIP = 0.1  # torque of the hands beyond it that halves the assist [N m]
GRIP_TIME = 0.15  # time constant with which the grip decays [s]
HANDS_BANDWIDTH = 4.0  # of each of the two filters on the hands' torque [Hz]
CORNER = 0.5  # between slow and quick motions of the handwheel [Hz]
SLOW_HANDWHEEL_SPEED = 0.1  # handwheel speed below which quick motions do not count [rad/s]
MOTION_TIME = 1.6  # time constant with which the peaks of the motions decay [s]
HALF_SPEED = 3.0  # v_0 [m/s]
DRIVING = CREEPING[1]  # speed below which the wanted feel is that of parking [m/s]

# Layout of a row's memory: filters of the hands' torque, grip, filters of the slow and the quick part, their peaks.
(
    _SPEED_FILTER,
    _HANDS_FILTER,
    _GRIP_STATE,
    _SLOW_MOTION_FILTER,
    _QUICK_MOTION_FILTER,
    _SLOW_POWER,
    _QUICK_POWER,
    _MEMORY_SIZE,
) = 0, 1, 3, 4, 6, 10, 11, 12


@kernel
def write_references(seen, out):
    """Write the reference torque [N m] of every row.

    Columns of ``seen``: lateral acceleration [m/s2], handwheel speed [rad/s] and speed [m/s].
    """
    for i in range(seen.shape[0]):
        if abs(seen[i, 2]) < DRIVING:
            out[i] = wanted_torque(WANTED, seen[i, 1])
        else:
            out[i] = reference_torque(seen[i, 0], seen[i, 1])


@kernel
def write_shares(rates, inertia, dt, seen, memory, out):
    """Write the share of every row and advance its memory; columns of ``seen``: T_tb, handwheel speed, speed."""
    hands, corner, grip_kept, motion_kept, caution = rates
    for i in range(seen.shape[0]):
        m, speed, v = memory[i], seen[i, 1], seen[i, 2]
        value = seen[i, 0] + inertia * (speed - m[_SPEED_FILTER]) / dt
        m[_SPEED_FILTER] = speed
        for k in range(_HANDS_FILTER, _GRIP_STATE):
            m[k] += hands * (value - m[k])
            value = m[k]
        m[_GRIP_STATE] = max(abs(value) - ABOVE, grip_kept * m[_GRIP_STATE])
        slow = quick = speed
        for k in range(_SLOW_MOTION_FILTER, _QUICK_MOTION_FILTER):
            m[k] += corner * (slow - m[k])
            slow = m[k]
        for k in range(_QUICK_MOTION_FILTER, _SLOW_POWER):
            m[k] += corner * (quick - m[k])
            quick -= m[k]
        m[_SLOW_POWER] = max(abs(slow), motion_kept * m[_SLOW_POWER])
        m[_QUICK_POWER] = max(abs(quick), motion_kept * m[_QUICK_POWER])
        held, calm = m[_GRIP_STATE] ** 2, m[_SLOW_POWER] ** 2 + SLOW_HANDWHEEL_SPEED * SLOW_HANDWHEEL_SPEED
        disturbed = caution * m[_QUICK_POWER] ** 2 * v * v / (v * v + HALF_SPEED * HALF_SPEED)
        out[i] = held / (held + GRIP * GRIP) * calm / (calm + disturbed)


def rates_at(dt: float, caution: float) -> tuple[float, float, float, float, float]:
    """What :func:`write_shares` needs at steps of ``dt`` [s]: two shares of filters, two of decay, the caution [1]."""
    hands, corner = (1.0 - math.exp(-2.0 * math.pi * f * dt) for f in (HANDS_BANDWIDTH, CORNER))
    return hands, corner, math.exp(-dt / GRIP_TIME), math.exp(-dt / MOTION_TIME), caution


class Feel:
    """The reference feel, and how far an assist may make the hand torque follow it; for ``n`` rows.

    Parameters
    ----------
    batch : EnvironmentBatch
        Of the environment in which the assist acts.
    caution : float
        Weight of quick motions [1].
    """

    def __init__(self, batch: Any, caution: float) -> None:
        self._inertia, self._dt = batch.car.column.I1, batch.control_dt
        self._rates = rates_at(self._dt, caution)
        self._memory = np.zeros((batch.n, _MEMORY_SIZE))

    def begin(self, i: int, handwheel_speed: float) -> None:
        """Start row ``i`` with a handwheel speed [rad/s], without hands."""
        self._memory[i] = 0.0
        self._memory[i, _SPEED_FILTER] = handwheel_speed

    def get_state(self) -> Array:
        """A copy of what it remembers of all rows."""
        return self._memory.copy()

    def set_state(self, state: Array) -> None:
        """Go on from a copy."""
        self._memory[:] = state

    def references(self, lateral_acceleration: Array, handwheel_speed: Array, speed: Array) -> Array:
        """The reference torque (n,) [N m] at lateral accelerations [m/s2], handwheel speeds [rad/s], speeds [m/s]."""
        out = np.zeros(len(self._memory))
        write_references(np.column_stack([lateral_acceleration, handwheel_speed, speed]), out)
        return out

    def shares(self, torque: Array, handwheel_speed: Array, speed: Array) -> Array:
        """The share (n,) of the assist, once a step, from torsion-bar torque [N m] and both speeds [rad/s], [m/s]."""
        out = np.zeros(len(self._memory))
        seen = np.column_stack([torque, handwheel_speed, speed])
        write_shares(self._rates, self._inertia, self._dt, seen, self._memory, out)
        return out
