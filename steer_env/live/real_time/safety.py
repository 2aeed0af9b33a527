"""What keeps a motor from running away: limits of torque, power and slew, a soft start, and a watchdog.

The torque of the plant reaches the motor times a gain, which a state machine moves:

    OFF       gain 0. Begins to start where inputs arrive, a dead-man key is held, and the loop keeps its deadlines.
    PHASE_STARTING  the gain rises from 0 to 1 in ``soft_start``.
    ON        gain 1.
    PHASE_FADING    the gain falls to 0 in ``fade`` at most, and goes on falling whatever happens; then OFF, or
    PHASE_FAILED. PHASE_FAILED    gain 0 until a new session begins, or `RealTime.resume`.

From PHASE_STARTING and ON it fades where no input arrived for ``hold``, where deadlines are missed, where a dead-man
key is released, or where the motor's side reports a failure, behind which it stays PHASE_FAILED. Where an input is
outside its range, the handwheel angle jumps, or the plant does not stay finite, it is PHASE_FAILED at once.
docs/real_time.md has the same as a table.
"""

import math
from typing import NamedTuple

import numpy as np

from steer_env.friction.numerics.bounds import within
from steer_env.friction.numerics.check import number
from steer_env.friction.numerics.kernel import kernel
from steer_env.vehicle.steering.eps import SAMPLE_TIME

PHASES = ("off", "starting", "on", "fading", "failed")
PHASE_OFF, PHASE_STARTING, PHASE_ON, PHASE_FADING, PHASE_FAILED = range(len(PHASES))


class Limits(NamedTuple):
    """Limits of the torque and times of the watchdog; all assumed, for the wheel of a driving simulator."""

    torque: float = 8.0  # largest of the motor [N m]
    power: float = 60.0  # largest that the motor gives to the handwheel [W]
    slew: float = 1000.0  # fastest change of the torque, but for a fall by the limit of power [N m/s]
    soft_start: float = 1.0  # [s]
    hold: float = 0.02  # time without an input, after which it is stale [s]
    fade: float = 0.025  # [s]
    share: float = 1.0  # of the torsion bar's torque that the motor gives [1]
    missed: float = 25.0  # deadlines missed, of which one is forgiven for every ten that are kept [1]


_MAY_BE_ZERO = "torque", "share"


def checked(limits: Limits) -> Limits:
    """The same limits.

    Raises
    ------
    ValueError
        One that is not finite or not positive; torque and share may be zero, and the share is at most 1.
    """
    for name, value in limits._asdict().items():
        most = 1.0 if name == "share" else math.inf
        number(f"{name} of Limits", value, minimum=0.0, above=name not in _MAY_BE_ZERO, maximum=most)
    return limits


SAFETY = np.dtype(
    [
        ("phase", "i8"),
        ("gain", "f8"),  # of the torque
        ("input_gain", "f8"),  # of the inputs that fade
        ("limited", "f8"),  # torque before the gain [N m]
        ("misses", "f8"),  # deadlines missed, less those that are forgiven
        ("failed", "i8"),  # whether the motor's side or the plant has failed
        ("heard", "i8"),  # time of the input that acted last, -1 where there is none [ns]
        ("begun", "i8"),  # sessions of the model seen so far
        ("stale_trips", "i8"),  # fades because no input arrived
        ("deadline_trips", "i8"),  # because deadlines were missed
        ("dead_man_trips", "i8"),  # because the dead-man key was released
        ("failure_trips", "i8"),  # because the motor's side or the plant failed
        ("clipped", "i8"),  # samples in which the torque was limited
    ]
)
# What the watchdog counts, and what it means.
TRIPS = {
    "stale_trips": "times that the torque faded because no input arrived",
    "deadline_trips": "times that it faded because deadlines were missed",
    "dead_man_trips": "times that it faded because the dead-man key was released",
    "failure_trips": "times that it ended because the motor, an input or the plant failed",
    "clipped": "samples in which a limit of torque or power acted",
}
FORGIVEN = 0.1  # of a missed deadline, by each that is kept


@kernel
def begin(s):
    """Forget failures, and return to OFF once the torque of the last session has faded."""
    s.phase, s.input_gain, s.misses, s.failed, s.heard = PHASE_FADING if s.gain > 0.0 else PHASE_OFF, 1.0, 0.0, 0, -1


@kernel
def end_torque(s):
    """End the torque at once, until a new session begins."""
    s.failure_trips += s.phase == PHASE_STARTING or s.phase == PHASE_ON
    s.phase, s.gain, s.limited, s.failed = PHASE_FAILED, 0.0, 0.0, 1


@kernel
def supervise(limits, s, elapsed, age, missed, released):
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
    released : bool
        Whether a dead-man key is needed and not held.
    """
    stale = not age <= limits.hold
    s.misses = min(max(s.misses - FORGIVEN, 0.0) + missed, 2.0 * limits.missed)
    overrun = s.misses > limits.missed
    step = elapsed / limits.fade
    s.input_gain = within(s.input_gain + (-step if stale else step), 0.0, 1.0)
    if s.phase == PHASE_STARTING or s.phase == PHASE_ON:
        if s.failed != 0 or overrun or stale or released:
            s.phase = PHASE_FADING
            if s.failed != 0:
                s.failure_trips += 1
            elif overrun:
                s.deadline_trips += 1
            elif stale:
                s.stale_trips += age < math.inf  # else the client has gone, as it told
            else:
                s.dead_man_trips += 1
    elif s.phase == PHASE_OFF:
        if s.failed != 0:
            s.phase = PHASE_FAILED
        elif not (stale or overrun or released):
            s.phase = PHASE_STARTING
    if s.phase == PHASE_STARTING:
        s.gain = min(s.gain + elapsed / limits.soft_start, 1.0)
        if s.gain == 1.0:
            s.phase = PHASE_ON
    elif s.phase == PHASE_FADING:
        s.gain = max(s.gain - step, 0.0)
        if s.gain == 0.0:
            s.phase = PHASE_FAILED if s.failed != 0 else PHASE_OFF


@kernel
def limit_torque(limits, s, torque, speed):
    """The torque of the motor [N m] in a sample: within the limits at a speed of the handwheel [rad/s], times the gain.

    The limit of power comes last, so that it holds in every sample: it only reduces, which needs no limit of slew.
    """
    if not abs(torque) < math.inf or not abs(speed) < math.inf:
        end_torque(s)
        return 0.0
    wanted = within(torque, -limits.torque, limits.torque)
    change = limits.slew * SAMPLE_TIME  # however many deadlines were missed: the motor has held its torque meanwhile
    moved = within(wanted, s.limited - change, s.limited + change)
    drives = moved * speed > limits.power  # the handwheel; braking is not limited
    s.limited = limits.power / speed if drives else moved
    s.clipped += drives or wanted != torque
    return s.gain * s.limited
