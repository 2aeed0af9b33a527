"""What a record tells of itself before any law is fitted: its own noise, and defects that make it unfit (F36)."""

import math

import numpy as np
from numpy.typing import NDArray

from steer_env.friction.identification.branches import Branches
from steer_env.friction.identification.displacement import motion_of, noise_of
from steer_env.friction.law import make
from steer_env.friction.response import response

STRAIGHT = 0.01  # torque beside a straight line through the displacement, of its range [1]
NOISIEST = 0.05  # noise of the displacement, of its range [1]
CLIPPED = 10  # samples in a row at the very extreme of a noisy torque
ALIKE = 0.02  # difference of two periods: of the displacement, of its range [1]
LOST = 2.0  # noise of x that leaves a torque, over what a second smoothing of the smoothed motion shows; assumed [1]


def refuse(x: NDArray, torque: NDArray, noise: float) -> None:
    """Raise ValueError, with the remedy, for a record from which no law can be identified.

    Parameters
    ----------
    x, torque : (T,) arrays
        Displacement [rad] and torque [N m].
    noise : float
        Deviation of the noise of x [rad].
    """
    swing = float(np.ptp(x))
    if noise > NOISIEST * swing:
        raise ValueError(
            f"x must have noise of at most {NOISIEST:.0%} of its travel, got {noise:g} of {swing:g} rad: filter it, "
            "record wider strokes, or check that the displacement's column is not another one's"
        )
    beside = torque - np.polyval(np.polyfit(x - x.mean(), torque, 1), x - x.mean())
    if np.ptp(torque) > 0.0 and float(np.std(beside)) < STRAIGHT * float(np.ptp(torque)):
        raise ValueError(
            f"torque must not follow x along a straight line, as it does within {STRAIGHT:.0%}: check that the "
            "torque's column does not hold the displacement; a spring alone has no friction, so record wider strokes"
        )


def clipped(torque: NDArray) -> int:
    """The most samples in a row at the highest or lowest torque of a noisy record; 0 for less than ``CLIPPED``."""
    if noise_of(torque) == 0.0:  # a constant torque is then no sign of a sensor at its limit
        return 0
    longest = 0
    for limit in (torque.max(), torque.min()):
        at = np.concatenate([[0], (torque == limit).astype(int), [0]])
        edges = np.flatnonzero(np.diff(at))
        longest = max(longest, int(np.max(edges[1::2] - edges[::2])))
    return longest if longest >= CLIPPED else 0


def repeatability(x: NDArray, torque: NDArray, branches: Branches) -> float:
    """Deviation of the torque from one period to the next [N m]; 0 where the displacement has no period (F36).

    What is before the weighed samples does not count: there the memory of the start makes a period differ.
    """
    spans = np.subtract(branches.turns[3:-1], branches.turns[1:-3])
    if spans.size < 2:
        return 0.0
    period = int(np.median(spans))
    begin = branches.turns[branches.first]
    x, torque = x[begin:], torque[begin:]
    if x.size <= period:
        return 0.0
    if np.sqrt(np.mean((x[period:] - x[:-period]) ** 2)) > ALIKE * np.ptp(x):
        return 0.0
    return float(np.sqrt(0.5 * np.mean((torque[period:] - torque[:-period]) ** 2)))


def own_noise(x: NDArray, torque: NDArray, branches: Branches, by_x: float) -> float:
    """What even the true law would leave of the torque [N m] (F36).

    The larger of the noise from sample to sample and of that from period to period, with what noise of x adds.
    """
    return math.hypot(max(noise_of(torque), repeatability(x, torque, branches)), by_x)  # (F36)


def by_noise(x: NDArray, noise: float, dt: float, level: float, length: float) -> float:
    """What noise of a displacement leaves of the torque after it was smoothed [N m] (F36).

    The smoothed motion gets such noise once more and is smoothed once more; the torque of a Dahl law with the record's
    level and length then differs by about half of it, as small reversals that the first smoothing lost do not count.

    Parameters
    ----------
    x : (T,) array
        The smoothed motion [rad].
    noise : float
        Its deviation [rad].
    dt : float
        Time between samples [s].
    level, length : float
        The scales of the record [N m, rad].
    """
    law = make("dahl", F_c=level, sigma_0=level / length)
    again = motion_of(x + np.random.default_rng(0).normal(0.0, noise, x.size), noise)
    return LOST * float(np.std(response(law, again, dt) - response(law, x, dt)))
