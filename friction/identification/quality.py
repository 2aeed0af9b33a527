"""What a record tells of itself before any law is fitted: its own noise, and defects that make it unfit (F36)."""

import math

import numpy as np
from numpy.typing import NDArray

from steer_env.friction.identification.branches import Branches
from steer_env.friction.identification.displacement import smoothed_motion, white_noise_deviation
from steer_env.friction.identification.periods import repeatability
from steer_env.friction.law import make
from steer_env.friction.response import response

STRAIGHT = 0.01  # torque beside a straight line through the displacement, of its range [1]
NOISIEST = 0.05  # noise of the displacement, of its range [1]
CLIPPED = 20  # samples in a row at the largest value that are taken for a sensor at its end
ALTERNATING = 0.6  # third differences that change their sign, at least [1]; of white noise 0.77 do
NOISY = 1e-3  # noise of a sensor's signal over its range, at least [1]
DRIFT = 0.03  # of the level: a smaller drift of the zero is not told [1]
MATTERS = 0.01  # of the level: less than this that noise of x or a law leaves is not told [1]
# What noise of x leaves, over what a second smoothing of the smoothed motion shows; assumed [1]
SMOOTHING_LOSS_FACTOR = 2.0
DRAWS = 4  # of noise of a displacement


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
            f"x must have noise of at most {NOISIEST:.0%} of its travel, got {noise:g} of {swing:g}: filter it, "
            "record wider strokes, or check that the displacement's column is not another one's"
        )
    beside = torque - np.polyval(np.polyfit(x - x.mean(), torque, 1), x - x.mean())
    if np.ptp(torque) > 0.0 and float(np.std(beside)) < STRAIGHT * float(np.ptp(torque)):
        raise ValueError(
            f"torque must not follow x along a straight line, as it does within {STRAIGHT:.0%}: check that the "
            "torque's column does not hold the displacement; a spring alone has no friction, so record wider strokes"
        )


def clipped(friction: NDArray[np.float64]) -> str | None:
    """A note where the friction stays at exactly its largest or smallest value though it is noisy elsewhere."""
    if _noise(friction) < NOISY * np.ptp(friction):
        return None  # a law's own plateau is as flat
    for side, name in ((1.0, "largest"), (-1.0, "smallest")):
        end = (side * friction).max()
        at_end = side * friction == end
        edges = np.flatnonzero(np.diff(np.concatenate([[0], at_end.astype(int), [0]])))
        longest = int(np.max(edges[1::2] - edges[::2]))
        if longest >= CLIPPED:
            return (
                f"the friction stays at its {name} value, {side * end:g}, for {longest} samples in a row: the sensor is"
                " at the end of its range, which makes the level a lower bound. Measure with a larger range"
            )
    return None


def _noise(values: NDArray[np.float64]) -> float:
    """Standard deviation of white noise on a smooth history between its ends, by the third differences.

    They have 20 times its variance, and change their sign from sample to sample as those of a smooth motion do not.
    Zero where few samples lie between the ends.
    """
    between = (values > values.min()) & (values < values.max())
    whole = between[3:] & between[2:-1] & between[1:-2] & between[:-3]
    there = np.diff(values, 3)[whole]
    if there.size <= CLIPPED or np.mean(there[1:] * there[:-1] < 0.0) < ALTERNATING:
        return 0.0
    return 1.4826 * float(np.median(np.abs(there))) / math.sqrt(20.0)


def own_noise(x: NDArray, torque: NDArray, branches: Branches, by_x: float) -> float:
    """What even the true law would leave of the torque [N m] (F36).

    The larger of the noise from sample to sample and of that from period to period, with what noise of x adds.
    """
    apart = repeatability(x, torque, branches.turns[branches.first]) or 0.0
    return math.hypot(max(white_noise_deviation(torque), apart / math.sqrt(2.0)), by_x)  # (F36)


def noisy_again(x: NDArray, noise: float) -> list[NDArray[np.float64]]:
    """The smoothed motion x (T,) with noise of this deviation once more, smoothed once more, some times [rad]."""
    rng = np.random.default_rng(0)
    return [smoothed_motion(x + rng.normal(0.0, noise, x.size), noise) for _ in range(DRAWS)]


def by_noise(x: NDArray, again: NDArray, dt: float, level: float, length: float) -> float:
    """What noise of a displacement leaves of the torque after it was smoothed [N m] (F36).

    The torque of a Dahl law with the record's level and length differs by about half of it between the smoothed motion
    and the one that was smoothed once more, as small reversals that the first smoothing lost do not count.

    Parameters
    ----------
    x, again : (T,) arrays
        The smoothed motion, and one of :func:`noisy_again` [rad].
    dt : float
        Time between samples [s].
    level, length : float
        The scales of the record [N m, rad].
    """
    law = make("dahl", F_c=level, sigma_0=level / length)
    return SMOOTHING_LOSS_FACTOR * float(np.std(response(law, again, dt) - response(law, x, dt)))
