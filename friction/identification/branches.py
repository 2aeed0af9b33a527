"""A record as its branches from reversal to reversal, and what they tell before any law is fitted."""

import math
from itertools import pairwise
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

BAND = 0.02  # of the range of x [1]: the search for reversals takes a smaller swing as noise; it still drives the law
SATURATED_RISE = 0.02  # rise over the last quarter of a saturated branch, of its whole rise [1]
SLIDES = 0.2  # least torque of a record in which the contact always slides one way, of its level [1]
LEAST_SAMPLES = 20  # samples to weigh


class Branches(NamedTuple):
    """The branches of a record; the first one begins at the start of motion."""

    turns: list[int]  # samples that bound the branches
    ways: list[NDArray[np.float64]]  # distances from the start of each branch [rad]
    rises: list[NDArray[np.float64]]  # torques above the one at the start of each branch, positive against motion [N m]
    swing: float  # width of the torque's plateau [N m]
    saturated: list[bool]  # whether each branch ends saturated
    first: int  # the first branch to be weighed
    one_way: bool  # whether the record has no reversal

    @property
    def saturates(self) -> bool:
        """Whether a weighed branch ends saturated."""
        return any(self.saturated[self.first :])


def find_branches(x: NDArray, T: NDArray, band: float) -> Branches:
    """The branches of a record.

    Parameters
    ----------
    x, T : (T,) arrays
        Displacement [rad] and torque [N m].
    band : float
        A smaller swing is no reversal [rad].

    Raises
    ------
    ValueError
        Without motion, without a reversal unless the torque breaks away, and for torque of the wrong sign.
    """
    turns = find_reversals(x, band)
    swing = float(np.ptp(np.percentile(T, (1, 99))))  # without outliers
    rises = [math.copysign(1.0, x[b] - x[a]) * (T[a : b + 1] - T[a]) for a, b in pairwise(turns)]
    ways = [np.abs(x[a : b + 1] - x[a]) for a, b in pairwise(turns)]
    one_way = len(turns) == 2
    if one_way:
        swing = 2.0 * float(np.percentile(np.abs(T), 99))
    slides = one_way and np.min(np.abs(np.percentile(T, (1, 99)))) > SLIDES * 0.5 * swing  # at several speeds
    if one_way and not slides and not saturates(ways[0], rises[0], 0.125 * swing):
        raise ValueError(
            f"x must move and reverse at least once, or the torque must rise and break away, got a path from "
            f"{x.min():g} to {x.max():g}: record a stroke to and fro that slides at both ends"
        )
    mean_rise = np.mean(T) * (x[-1] - x[0]) if slides else np.mean(np.concatenate(rises))
    if mean_rise <= 0.0:
        raise ValueError(
            f"torque must rise as x rises, as friction resists, got {mean_rise:g} on the mean after a reversal: "
            "if its sign is swapped, pass -torque"
        )
    saturated = [slides or saturates(way, rise, 0.25 * swing) for way, rise in zip(ways, rises)]
    first = 1 + (saturated[:-1].index(True) if any(saturated[:-1]) else 0)
    return Branches(turns, ways, rises, swing, saturated, 0 if one_way else first, one_way)


def find_reversals(x: NDArray, band: float) -> list[int]:
    """Samples that bound the branches: the start of motion, the reversals and the end."""
    turns, values = [], x.tolist()
    side = low = high = 0
    for i, value in enumerate(values):
        low = i if value < values[low] else low
        high = i if value > values[high] else high
        if side <= 0 and value - values[low] > band:
            turns.append(low)
            side, high = 1, i
        elif side >= 0 and values[high] - value > band:
            turns.append(high)
            side, low = -1, i
    return [*turns, x.size - 1] if turns else [0, x.size - 1]


def weighed_samples(x: NDArray, branches: Branches, remembers: bool) -> NDArray[np.bool_]:
    """The samples that count: those from the first reversal after saturation on, where the memory is known.

    Raises
    ------
    ValueError
        Where they are too few.
    """
    weighed = np.arange(x.size) >= branches.turns[branches.first]
    if not remembers:  # a law without memory does not determine the torque at rest
        weighed &= np.diff(x, prepend=x[0]) != 0.0
    if np.count_nonzero(weighed) < LEAST_SAMPLES:
        raise ValueError(
            f"x and torque must hold at least {LEAST_SAMPLES} samples after the first reversal, got "
            f"{np.count_nonzero(weighed)}"
        )
    return weighed


def saturates(way: NDArray, rise: NDArray, least: float) -> bool:
    """Whether the torque of a branch has risen by ``least`` [N m] and does not rise further.

    It is flat over the last quarter of the distance, or was as high before (break-away, stick-slip).
    """
    last = way >= 0.75 * way[-1]
    u, end = way[last] - np.mean(way[last]), np.mean(rise[last])
    flat = abs(u @ rise[last]) * 0.25 * way[-1] < SATURATED_RISE * end * (u @ u)
    peaked = np.max(rise[~last], initial=0.0) >= (1.0 - 0.5 * SATURATED_RISE) * np.max(rise[last])
    return bool(end >= least and (flat or peaked))


def reversal_stiffness(branches: Branches) -> float:
    """Stiffness of the chord after a reversal up to a quarter of the swing [N m/rad].

    It is the median over the branches whose torque rises that far, and at most that of one step between samples.
    """
    quarter = 0.25 * branches.swing
    ways, rises = branches.ways[branches.first :], branches.rises[branches.first :]
    ends = [int(np.argmax(rise >= quarter)) for rise in rises]
    chords = [rise[i] / way[i] for way, rise, i in zip(ways, rises, ends) if i and way[i] > 0.0]
    return float(np.median(chords)) if chords else 4.0 * quarter / max(map(np.max, branches.ways))
