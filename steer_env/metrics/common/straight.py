"""Straight running at the start of a recording: what the sensors read before the handwheel first moves.

Many tests begin with it: sine, step, transition, swept sine, pulse, crosswind, lane changes, and circles that are
entered from straight ahead. Random steering, releases and tests with a standing car do not, nor does a recording that
was cut off before its input. The torque in that part may be one that friction holds at rest; nothing in a recording
tells it from the sensor's zero.
"""

import numpy as np

from steer_env.metrics.common.definitions import UNITS, RefusedError
from steer_env.metrics.common.filtered_channels import ANGLE, AY, CHANNELS, SPEED, TORQUE, YAW, FilteredChannels
from steer_env.recording.recording import DEGREE, Recording

# Readings at zero from which on they are told, with the unit of the note; assumed, about what good sensors resolve.
NOTED_ZEROS = {ANGLE: (0.2, "deg"), TORQUE: (0.05, "N m"), AY: (0.05, "m/s2"), YAW: (0.1, "deg/s")}
STANDING = 1.0  # speed up to which a car stands, on a rig; assumed [m/s]
CUTOFF = 10.0  # low-pass of the angle; a quarter of the sampling rate where that is lower [Hz]
SHORTEST, LONGEST = 0.5, 1.0  # of the part that is read; assumed [s]
STILL = 0.3 * DEGREE  # by how much the handwheel angle may change in it; assumed [rad]
CLEARANCE_TIME = 0.2  # between that part and the place where the angle has changed by more; assumed [s]
STRAIGHT = 0.5 * DEGREE  # mean yaw rate up to which the car goes straight, and the rest is an offset; assumed [rad/s]


def zeros(recording: Recording) -> dict[str, float]:
    """Mean reading of angle, torque, lateral acceleration and yaw rate, as far as recorded, in straight running [SI].

    Raises
    ------
    RefusedError
        Where the recording does not begin with straight running; the text says why.
    """
    time = recording.time - recording.time[0]
    angle = FilteredChannels(recording, min(CUTOFF, recording.rate / 4))[ANGLE]
    moved = time[np.abs(angle - angle[time <= SHORTEST].mean()) > STILL]
    end = min(moved[0] - CLEARANCE_TIME if moved.size else time[-1], LONGEST)
    if end < SHORTEST:
        raise RefusedError(
            f"{ANGLE} does not rest for {SHORTEST + CLEARANCE_TIME:g} s at the start: record "
            f"{LONGEST + CLEARANCE_TIME:g} s of straight running before the first input"
        )
    rest = time <= end
    means = {
        name: float(recording[name][rest].mean())
        for name in (*NOTED_ZEROS, SPEED)
        if recording.units.get(name) == CHANNELS[name]
    }
    speed = means.pop(SPEED, np.inf)
    if speed < STANDING:
        raise RefusedError("the car stands at the start")
    turns = [abs(means[name]) / by for name, by in ((YAW, 1.0), (AY, speed)) if name in means]
    if not turns or min(turns) > STRAIGHT:
        known = f"the car turns at {min(turns) / DEGREE:.2g} deg/s" if turns else f"neither {YAW} nor {AY} is recorded"
        raise RefusedError(f"{known} at the start, so that it does not show straight running")
    return means


def describe_zeros(zeros: dict[str, float], where: str) -> list[str]:
    """Sentences about the zeros of sensors that are large enough to be told; ``where`` they were read."""
    found = []
    for name, value in zeros.items():
        least, unit = NOTED_ZEROS[name]
        if abs(value) * UNITS[unit] > least:
            found.append(
                f"{name} reads {value * UNITS[unit]:.3g} {unit} {where}, which is subtracted; a mapping may hold the "
                "sensor's offset"
            )
    return found


def notes(recording: Recording) -> list[str]:
    """What is told of the zeros before the first input, or why none are known."""
    try:
        return describe_zeros(zeros(recording), "before the first input, where the car goes straight")
    except RefusedError as error:
        return [f"no zeros of the sensors are known: {error}"]
