"""What a record of friction tells of itself: the sign, faults of the sensors, how far it repeats, level and distance.

Displacement and friction are (T,) arrays at uniform steps in any units. The functions find the reversals themselves:
turning points that stand out by a share of the travel.
"""

import math
from itertools import pairwise
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
BAND = 0.05  # of the travel: a smaller swing is no reversal [1]
LEAST_WORK = 0.1  # net work over the sum of its magnitudes, below which a record has no sign [1]
# Half the travel and mean friction of contacts from a small joint to a loaded rack, by unit; assumed.
USUAL = {"m": (2e-6, 0.2), "rad": (2e-5, 15.0), "N": (0.02, 1e4), "N m": (2e-4, 200.0)}
CONCAVE = 0.35  # of a branch's rise that friction has reached at half its way, at least [1]; a straight line has 0.5


class Scales(NamedTuple):
    """Level and pre-sliding distance of a record, read from it without a law."""

    level: float  # median friction against the motion, where it slides [unit of the friction]
    distance: float  # pre-sliding distance x_c of a branch 1 - 2 exp(-x/x_c) with the same zero [unit of displacement]


def find_reversals(x: Array) -> NDArray[np.intp]:
    """Samples of the reversals, in order."""
    from scipy.signal import find_peaks  # here, because its import takes longer than the start of an environment

    least = BAND * np.ptp(x)
    return np.sort(np.concatenate([find_peaks(side * x, prominence=least, plateau_size=1)[0] for side in (1.0, -1.0)]))


def moving(x: Array) -> NDArray[np.int_]:
    """The direction of motion at each sample, -1, 0 or 1; slower than a tenth of the usual speed counts as rest."""
    speed = np.gradient(x)
    swift = np.abs(speed) > 0.1 * np.sqrt(np.mean(speed**2))
    return np.where(swift, np.sign(speed), 0.0).astype(int)


def middle(x: Array, friction: Array) -> float:
    """The friction midway between its medians in either direction; where it moves in one only, that before it moves."""
    way = moving(x)
    sides = [np.median(friction[way == side]) for side in (1, -1) if np.any(way == side)]
    return float(np.mean(sides)) if len(sides) == 2 else float(np.median(friction[: np.argmax(way != 0) or 1]))


def mean_friction(x: Array, friction: Array) -> float:
    """Mean magnitude of the friction about its middle [unit of the friction]."""
    return float(np.mean(np.abs(friction - middle(x, friction))))


def work(x: Array, friction: Array) -> float:
    """Net work that a friction takes, as a share of what goes in and out (-1 to 1) [1]."""
    parts = (friction[1:] + friction[:-1] - 2.0 * middle(x, friction)) * np.diff(x)
    whole = float(np.sum(np.abs(parts)))
    return float(np.sum(parts)) / whole if whole > 0.0 else 0.0


def sign(x: Array, friction: Array) -> float:
    """1 where the friction resists positive motion, -1 where it is the opposite force, by the work that it takes.

    Raises
    ------
    ValueError
        Where the work is too small to tell, with the remedies.
    """
    share = work(x, friction)
    if abs(share) < LEAST_WORK:
        raise ValueError(
            f"friction takes no work over the record (net {share:.1%} of what goes in and out), so that its sign is not"
            " seen: check that displacement and friction are the columns they should be, and record whole cycles; or "
            "say the sign with --sign 1 (the friction is positive when it resists positive motion) or --sign -1"
        )
    return math.copysign(1.0, share)


def check_columns(x: Array, friction: Array) -> None:
    """ValueError where friction rises ever steeper after a reversal, as a displacement over friction does."""
    at = find_reversals(x)
    shares = []
    for a, b in pairwise(at):
        way = np.abs(x[a : b + 1] - x[a])
        half = int(np.argmax(way >= 0.5 * way[-1]))
        rise = friction[b] - friction[a]
        if abs(rise) > 0.2 * np.ptp(friction):  # a viscous friction is zero at every reversal
            shares.append((friction[a + half] - friction[a]) / rise)
    if shares and np.median(shares) < CONCAVE:
        raise ValueError(
            f"half-way from a reversal to the next, the friction has made {np.median(shares):.0%} of its way; friction "
            "is past half of it by then. Displacement and friction are exchanged, or an end stop or a spring is in the "
            "record: name the columns with --map displacement=... and --map friction=..., or cut the record"
        )


def drift(t: Array, x: Array, friction: Array) -> tuple[float, float]:
    """Slope of the middle of the loops over time, and the drift over the record as a share of the level.

    Zero where the record has fewer than three loops, where the slope is within three standard errors, or where its two
    halves do not agree.
    """
    at = find_reversals(x)
    ends = at[::2]
    if ends.size < 4:
        return 0.0, 0.0
    instants = np.array([0.5 * (t[a] + t[b]) for a, b in pairwise(ends)])
    middles = np.array([middle(x[a : b + 1], friction[a : b + 1]) for a, b in pairwise(ends)])
    half = middles.size // 2
    if half > 2:  # a memory that settles moves the first loops, a drift all of them
        parts = [np.polyfit(instants[part], middles[part], 1)[0] for part in (slice(half), slice(half, None))]
        if min(parts) * max(parts) <= 0.0 or min(map(abs, parts)) < 0.3 * max(map(abs, parts)):
            return 0.0, 0.0
    (slope, _), covariance = np.polyfit(instants, middles, 1, cov="unscaled")
    left = middles - np.polyval(np.polyfit(instants, middles, 1), instants)
    error = math.sqrt(covariance[0, 0] * np.sum(left**2) / (middles.size - 2))
    if abs(slope) <= 3.0 * error:
        return 0.0, 0.0
    return float(slope), float(slope) * (t[-1] - t[0]) / scales(x, friction).level


def scales(x: Array, friction: Array) -> Scales:
    """Level and pre-sliding distance of a record whose friction resists positive motion.

    Raises
    ------
    ValueError
        Where there is no reversal after which the friction changes sides.
    """
    T = friction - middle(x, friction)
    against = moving(x) * T
    sliding = against[against > 0.0]
    distances = []
    at = find_reversals(x)
    for a, b in pairwise(at):
        side = np.sign(x[b] - x[a])
        branch = side * T[a : b + 1]
        if branch[0] < 0.0 and np.any(branch > 0.0):
            distances.append(abs(x[a + int(np.argmax(branch > 0.0))] - x[a]))
    if not distances or sliding.size == 0:
        raise ValueError(
            "after no reversal does the friction change sides: record strokes that slide in both directions"
        )
    return Scales(float(np.median(sliding)), float(np.median(distances)) / math.log(2.0))
