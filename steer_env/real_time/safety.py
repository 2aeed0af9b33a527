"""What keeps a motor from running away: limits of torque, power and slew, a soft start, and a watchdog.

The torque of the plant reaches the motor times a gain, which a state machine moves:

    OFF       gain 0. Begins to start where inputs arrive and the loop keeps its deadlines.
    STARTING  the gain rises from 0 to 1 in ``soft_start``.
    ON        gain 1.
    FADING    the gain falls to 0 in ``fade`` at most, and goes on falling whatever happens; then OFF, or FAILED.
    FAILED    gain 0 until a new session begins.

From STARTING and ON it fades where no input arrived for ``hold``, where deadlines are missed, where the motor's side
reports a failure, or where the plant does not stay finite; behind the last two it stays FAILED. docs/real_time.md has
the same as a table.
"""

import math
from typing import NamedTuple

import numpy as np

from steer_env.friction.numerics.bounds import within
from steer_env.friction.numerics.kernel import kernel

PHASES = ("off", "starting", "on", "fading", "failed")
OFF, STARTING, ON, FADING, FAILED = range(len(PHASES))


class Limits(NamedTuple):
    """Limits of the torque and times of the watchdog; all assumed, for the wheel of a driving simulator."""

    torque: float = 8.0  # largest of the motor [N m]
    power: float = 60.0  # largest that the motor gives to the handwheel [W]
    slew: float = 1000.0  # fastest change of the torque [N m/s]
    soft_start: float = 1.0  # [s]
    hold: float = 0.02  # time without an input, after which it is stale [s]
    fade: float = 0.025  # [s]
    share: float = 1.0  # of the torsion bar's torque that the motor gives [1]
    missed: float = 25.0  # deadlines missed in a row, a miss being forgiven for every ten that are kept [1]


SAFETY = np.dtype(
    [
        ("phase", "i8"),
        ("gain", "f8"),  # of the torque
        ("input_gain", "f8"),  # of the inputs that fade
        ("limited", "f8"),  # torque before the gain [N m]
        ("misses", "f8"),  # deadlines missed, less those that are forgiven
        ("failed", "i8"),  # whether the motor's side or the plant has failed
        ("begun", "i8"),  # sessions of the model seen so far
        ("stale_trips", "i8"),  # fades because no input arrived
        ("deadline_trips", "i8"),  # because deadlines were missed
        ("failure_trips", "i8"),  # because the motor's side or the plant failed
        ("clipped", "i8"),  # samples in which the torque was limited
    ]
)
# What the watchdog counts, and what it means.
TRIPS = {
    "stale_trips": "times that the torque faded because no input arrived",
    "deadline_trips": "times that it faded because deadlines were missed",
    "failure_trips": "times that it faded because the motor could not be reached, or the plant did not stay finite",
    "clipped": "samples in which a limit of torque or power acted",
}
FORGIVEN = 0.1  # of a missed deadline, by each that is kept


@kernel
def begin(s):
    """Return to OFF, and forget failures."""
    s.phase, s.gain, s.input_gain, s.limited, s.misses, s.failed = OFF, 0.0, 1.0, 0.0, 0.0, 0


@kernel
def supervise(limits, s, elapsed, age, missed):
    """Move the state machine by ``elapsed`` [s].

    Parameters
    ----------
    limits : Limits
    s : record of SAFETY
    elapsed : float
        Time since the last call [s].
    age : float
        Of the last input, infinite where there is none [s].
    missed : int
        Deadlines missed since the last call.
    """
    stale = not age <= limits.hold
    s.misses = min(max(s.misses - FORGIVEN, 0.0) + missed, 2.0 * limits.missed)
    overrun = s.misses > limits.missed
    step = elapsed / limits.fade
    s.input_gain = within(s.input_gain + (-step if stale else step), 0.0, 1.0)
    if s.phase == STARTING or s.phase == ON:
        if s.failed != 0 or overrun or stale:
            s.phase = FADING
            s.failure_trips += s.failed != 0
            s.deadline_trips += s.failed == 0 and overrun
            s.stale_trips += s.failed == 0 and not overrun and age < math.inf  # else the client has gone, as it told
    elif s.phase == OFF:
        if s.failed != 0:
            s.phase = FAILED
        elif not stale and not overrun:
            s.phase = STARTING
    if s.phase == STARTING:
        s.gain = min(s.gain + elapsed / limits.soft_start, 1.0)
        if s.gain == 1.0:
            s.phase = ON
    elif s.phase == FADING:
        s.gain = max(s.gain - step, 0.0)
        if s.gain == 0.0:
            s.phase = FAILED if s.failed != 0 else OFF


@kernel
def limited(limits, s, torque, speed, elapsed):
    """The torque of the motor [N m]: within the limits at a speed of the handwheel [rad/s], times the gain."""
    if not abs(torque) < math.inf or not abs(speed) < math.inf:
        s.failed, s.limited = 1, 0.0
        return 0.0
    allowed = within(torque, -limits.torque, limits.torque)
    if allowed * speed > limits.power:  # it drives the handwheel; braking is not limited
        allowed = limits.power / speed
    s.clipped += allowed != torque
    change = limits.slew * elapsed
    s.limited = within(allowed, s.limited - change, s.limited + change)
    return s.gain * s.limited
