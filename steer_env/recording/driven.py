"""What a person's drive must be to have metrics: one set throughout, and at a motor the whole torque of that set.

The recording of ``steer-env drive`` has the channels ``chosen_set``, ``share_of_next_set`` and ``watchdog_gain``, and
its meta tells by ``motor`` whether a device gave the torque. The soft start at the begin of a recording and the fade at
its end belong to every drive.
"""

from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from steer_env.recording.recording import Recording

MANY_MISSED = 0.01  # share of the deadlines from which on a person is too fast for the simulation; assumed [1]
WHOLE = 0.999  # gain of the watchdog from which on the torque counts as whole; assumed [1]
START, END = 2.0, 0.5  # longest time without the whole torque at begin and end that is not told; assumed [s]


def is_drive(recording: Recording) -> bool:
    """Whether a recording is that of a person's drive."""
    return "chosen_set" in recording.channels and "sets" in recording.meta


def acted(recording: Recording) -> list[tuple[str, float, float]]:
    """Of a drive, the label of every set that acted, one after another, with the times between which it did [s]."""
    acting, time, sets = recording["chosen_set"], recording.time, recording.meta["sets"]
    bounds = [0, *(np.flatnonzero(np.diff(acting)) + 1).tolist(), time.size - 1]
    return [(sets[round(acting[i]) - 1]["label"], float(time[i]), float(time[j])) for i, j in pairwise(bounds)]


def check(recording: Recording) -> None:
    """Refuse a drive without one set and its whole torque throughout; other recordings pass.

    Raises
    ------
    ValueError
        Says what acted when, or when the torque was off, and the longest part that can be evaluated.
    """
    if not is_drive(recording):
        return
    time, acting = recording.time, recording["chosen_set"]
    torque = np.ones(time.size, bool)
    if recording.meta.get("motor"):
        torque = recording["watchdog_gain"] >= WHOLE
    whole = np.flatnonzero(torque)
    lost = time[~torque]
    if whole.size and time[whole[0]] - time[0] <= START:
        lost = lost[lost > time[whole[0]]]
    if whole.size and time[-1] - time[whole[-1]] <= END:
        lost = lost[lost < time[whole[-1]]]
    found = []
    if lost.size:
        found.append(f"the torque was off or faded, first at {lost[0]:.1f} s")
    if (acting != acting[0]).any():
        each = ", ".join(f"{label} to {end:.1f} s" for label, _, end in acted(recording))
        found.append(f"several sets acted: {each}")
    if found:
        usable = torque & (recording["share_of_next_set"] <= 0.0)
        raise ValueError(f"{'; '.join(found)}. {_part(time, usable, acting)}")


def _part(time: NDArray[np.float64], usable: NDArray[np.bool_], acting: NDArray[np.float64]) -> str:
    """The longest part of one set that is usable throughout, in words."""
    ends = np.flatnonzero((usable[1:] != usable[:-1]) | (acting[1:] != acting[:-1]))
    runs = [(i, j) for i, j in pairwise([0, *(ends + 1).tolist(), time.size]) if usable[i]]
    if not runs:
        return "No part has the whole torque of one set: drive again"
    i, j = max(runs, key=lambda run: time[run[1] - 1] - time[run[0]])
    # Rounded to the inside, so that the part is what is told.
    start, end = np.ceil(10.0 * time[i]) / 10.0, np.floor(10.0 * time[j - 1]) / 10.0
    return f"The longest part that is whole: --between {start:.1f} {end:.1f}"
