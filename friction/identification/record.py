"""A record of friction, and what makes it unfit for identification."""

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from steer_env.friction.numerics.check import numbers, positive

UNEVEN = 0.01  # departure of a time step from the median step [1]


class Record(NamedTuple):
    """Displacement and torque at a constant rate, in any units: lengths and forces serve as well [rad, N m, s, N]."""

    x: NDArray[np.float64]  # (T,) displacement [rad]
    torque: NDArray[np.float64]  # (T,) resists positive motion [N m]
    dt: float  # time between samples [s]
    load: NDArray[np.float64] | None = None  # (T,) load on the contact [N], where it was recorded


def checked(x: ArrayLike, torque: ArrayLike, dt: float, load: ArrayLike | None = None) -> Record:
    """A record of arrays that are finite and of equal length.

    Raises
    ------
    ValueError
        Naming the array and what is wrong.
    """
    path, T, step = numbers("x", x), numbers("torque", torque), positive("dt", dt)
    if path.size != T.size:
        raise ValueError(f"x and torque must be of equal length, got {path.size} and {T.size} samples")
    forces = None if load is None else numbers("load", load)
    if forces is not None and forces.size != T.size:
        raise ValueError(f"load and torque must be of equal length, got {forces.size} and {T.size} samples")
    if not np.ptp(path) > 0.0:
        raise ValueError(f"x must move, got a path from {path.min():g} to {path.max():g}")
    return Record(path, T, step, forces)


def timed(time: ArrayLike, x: ArrayLike, torque: ArrayLike, load: ArrayLike | None = None) -> Record:
    """A record of samples at given times [s], which must be evenly spaced.

    Raises
    ------
    ValueError
        For repeated or descending times, gaps and uneven steps, with the place and the remedy.
    """
    t = numbers("time", time)
    steps = np.diff(t)
    if t.size != np.size(x) or t.size < 2:
        raise ValueError(f"time and x must be of equal length of at least 2, got {t.size} and {np.size(x)} samples")
    if np.any(steps <= 0.0):
        i = int(np.argmax(steps <= 0.0))
        raise ValueError(
            f"time must ascend, got {t[i]:g} s at index {i} and {t[i + 1]:g} s after it: remove the repeated samples"
        )
    dt = float(np.median(steps))
    uneven = np.abs(steps - dt) > UNEVEN * dt
    if np.any(uneven):
        i = int(np.argmax(uneven))
        raise ValueError(
            f"time must be evenly spaced, got a step of {steps[i]:g} s at {t[i]:g} s where the median is {dt:g} s: cut "
            "the record at the gap and fit the longer part, or resample it to even steps"
        )
    return checked(x, torque, float((t[-1] - t[0]) / (t.size - 1)), load)
