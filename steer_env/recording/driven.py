"""What a person's drive must be to have metrics: one set throughout, in time, and at a motor the whole torque.

The recording of ``steer-env drive`` has the channels ``CHANNELS``, and its meta tells by ``motor`` whether a device
gave the torque. The soft start at the begin of a recording and the fade at its end belong to every drive.
"""

from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from steer_env.recording.recording import Recording
from steer_env.vehicle.steering.eps import SAMPLE_TIME

CHANNELS = ("chosen_set", "share_of_next_set", "watchdog_gain", "deadlines_missed")
MANY_MISSED = 0.01  # share of the deadlines from which on it is told that a person is too fast; assumed [1]
TOO_MANY = 0.1  # the same, from which on a drive is no measurement; assumed [1]
STOOD = 0.1  # shortest time without a sample that a person feels as a halt; assumed [s]
WHOLE = 0.999  # gain of the watchdog from which on the torque counts as whole; assumed [1]
START, END = 2.0, 0.5  # longest time without the whole torque at begin and end that is not told; assumed [s]
SHORTEST = 1.0  # part that is told; assumed [s]
TENTHS = 10.0  # of a second, to which the bounds of a part are told [1/s]


def is_drive(recording: Recording) -> bool:
    """Whether a recording is that of a person's drive."""
    return "sets" in recording.meta and all(name in recording.channels for name in CHANNELS)


def acting_labels(recording: Recording) -> list[tuple[str, float, float]]:
    """Of a drive, the label of every set that acted, one after another, with the times between which it did [s]."""
    acting, time, sets = recording["chosen_set"], recording.time, recording.meta["sets"]
    bounds = [0, *(np.flatnonzero(np.diff(acting)) + 1).tolist(), time.size - 1]
    return [(sets[round(acting[i]) - 1]["label"], float(time[i]), float(time[j])) for i, j in pairwise(bounds)]


def check(recording: Recording) -> None:
    """Refuse a drive without one set, its samples in time and its whole torque throughout; other recordings pass.

    Raises
    ------
    ValueError
        Says which configurations acted, when the torque was off, when the simulation stood still, or how many deadlines
        it missed, and the longest part that can be evaluated.
    """
    if not is_drive(recording):
        return
    time, acting, missed = recording.time, recording["chosen_set"], recording["deadlines_missed"]
    torque = np.ones(time.size, bool)
    if recording.meta.get("motor"):
        torque = recording["watchdog_gain"] >= WHOLE
    stood, excess = missed * SAMPLE_TIME >= STOOD, _excess(time, missed)
    if not np.isin(acting, np.arange(1.0, len(recording.meta["sets"]) + 1.0)).all():
        raise ValueError(
            "chosen_set is not everywhere the number of one of the configurations in the meta: drive again"
        )
    changed, alone = np.diff(acting, prepend=acting[0]) != 0.0, recording["share_of_next_set"] <= 0.0
    found = []
    if (lost := _lost(time, torque)).size:
        found.append(f"the torque was off or faded, first at {lost[0]:.1f} s")
    if changed.any():
        each = ", ".join(f"{label} to {end:.1f} s" for label, _, end in acting_labels(recording))
        found.append(f"several configurations acted: {each}")
    elif not alone.all():
        found.append(f"two configurations were mixed, first at {time[~alone][0]:.1f} s")
    if stood.any():
        at, most = time[stood][0], SAMPLE_TIME * missed.max()
        found.append(f"the simulation stood still, first at {at:.1f} s and for up to {most:.1f} s")
    if excess.sum() > 0:
        share, first = share_missed(recording), time[missed > 0][0]
        found.append(
            f"{share:.1%} of the deadlines were missed, first at {first:.1f} s, by which the person was too fast for "
            "the simulation"
        )
    if found:
        usable = torque & alone & ~changed & ~stood
        raise ValueError(f"{'; '.join(found)}. {_part(time, usable, excess)}")


def _lost(time: NDArray[np.float64], torque: NDArray[np.bool_]) -> NDArray[np.float64]:
    """Times without the whole torque, but for a soft start and a fade at the end [s]."""
    whole, lost = time[torque], time[~torque]
    if whole.size and whole[0] - time[0] <= START:
        lost = lost[lost > whole[0]]
    if whole.size and time[-1] - whole[-1] <= END:
        lost = lost[lost < whole[-1]]
    return lost


def share_missed(recording: Recording) -> float:
    """Share of the deadlines of a drive that were missed [1]."""
    missed = float(recording["deadlines_missed"].sum())
    return missed / (missed + recording.time.size * _samples(recording.time))


def _samples(time: NDArray[np.float64]) -> float:
    """Samples of the loop in a row [1]."""
    return float(np.median(np.diff(time))) / SAMPLE_TIME


def _excess(time: NDArray[np.float64], missed: NDArray[np.float64]) -> NDArray[np.int64]:
    """By row, a number whose sum is positive where more than ``TOO_MANY`` of the deadlines were missed.

    Whole numbers, so that a part whose sum is 0 still is one when it is evaluated alone.
    """
    return np.rint((1.0 / TOO_MANY - 1.0) * missed - _samples(time)).astype(np.int64)


def _part(time: NDArray[np.float64], usable: NDArray[np.bool_], excess: NDArray[np.int64]) -> str:
    """The longest part that is usable throughout and has not too many missed deadlines, in words."""
    # A row that is not usable outweighs all others.
    sums = np.append(0, np.cumsum(np.where(usable, excess, np.abs(excess).sum() + 1)))
    # Tenths to the inside, so that the part is what is told.
    bounds = np.arange(np.ceil(TENTHS * time[0]), np.floor(TENTHS * time[-1]) + 1.0) / TENTHS
    before, upto = (sums[np.searchsorted(time, bounds, side)] for side in ("left", "right"))
    # The first bound whose sum is not below that at the end: the rows between have no excess.
    first = np.searchsorted(np.maximum.accumulate(before), upto)
    lengths = np.arange(bounds.size) - first
    if lengths.max(initial=0) < SHORTEST * TENTHS:
        return "No part has the whole torque of one set in time: drive again"
    end = int(lengths.argmax())
    return f"The longest part that is whole: --between {bounds[first[end]]:.1f} {bounds[end]:.1f}"
