"""Where points of the road lie in a picture.

Lengths in the picture are in pixels, y downward; the axes of the road are ISO 8855: x forward, y to the left.
"""

import math

import numpy as np
from numpy.typing import ArrayLike, NDArray

Array = NDArray[np.float64]

_EXTENSION = 100  # points one metre apart by which a path continues straight at both ends


class View:
    """Maps points of the road [m] to the picture: the car is at ``centre``, the direction ``heading`` points upward."""

    def __init__(self, centre: tuple[float, float], scale: float, now: Array, heading: float) -> None:
        self.centre, self.scale, self.heading = np.array(centre), scale, heading
        self._focus = now[:2]

    def __call__(self, points: Array) -> Array:
        ahead_left = rotate(points - self._focus, -self.heading)
        return self.centre - self.scale * ahead_left[:, ::-1]


def rotate(points: ArrayLike, angle: float) -> Array:
    """Points (N, 2) turned to the left by an angle [rad]."""
    c, s = math.cos(angle), math.sin(angle)
    return np.asarray(points) @ np.array([[c, s], [-s, c]])


def extend(path: Array) -> Array:
    """A path (P, 3) of x, y, direction, continued straight at both ends."""
    steps = np.arange(1.0, _EXTENSION + 1.0)

    def straight(point: Array, distances: Array) -> Array:
        x, y, direction = point
        return np.column_stack(
            [x + distances * np.cos(direction), y + distances * np.sin(direction), np.full(steps.size, direction)]
        )

    return np.concatenate([straight(path[0], -steps[::-1]), path, straight(path[-1], steps)])
