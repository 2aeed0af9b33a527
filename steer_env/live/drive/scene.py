"""What stands beside the road of a drive: nothing, or the cones of a lane change, again and again along the way."""

from collections.abc import Iterable

import numpy as np
from numpy.typing import NDArray

from steer_env.courses import iso3888
from steer_env.friction.numerics.check import one_of
from steer_env.vehicle.cars import Car

Array = NDArray[np.float64]

PLAIN_COURSE = "plain"
COURSES = (PLAIN_COURSE, *iso3888.EDITIONS)
FIRST, GAP = 150.0, 250.0  # from the start to the first course, and from the end of one to the next; assumed [m]
LANE, LANES = 3.5, 3  # width of a lane [m], and number of lanes, of which the car starts in the middle; assumed


class Scene:
    """A course on a straight road along x.

    Parameters
    ----------
    name : str
        Of ``COURSES``.
    car : Car
        Whose width the lanes between the cones suit.

    Raises
    ------
    ValueError
        Unknown course.
    """

    def __init__(self, name: str, car: Car) -> None:
        one_of("course", name, COURSES)
        self.name, self.size = name, iso3888.footprint(car)
        course = None if name == PLAIN_COURSE else iso3888.course(name, self.size.width)
        self._places = np.zeros((0, 2)) if course is None else np.concatenate([course.left, course.right])
        self._period = GAP if course is None else course.length + GAP
        self._shown, self._touched = -1, np.zeros(len(self._places), bool)
        self._x = 0.0  # of the last pose [m]

    def touch_cones(self, poses: Iterable[tuple[float, float, float]]) -> None:
        """Note which cones a car touched on its way through poses of x, y [m] and yaw angle [rad]."""
        if not len(self._places):
            return
        for x, y, yaw in poses:
            number = max(int((x - FIRST + 0.5 * GAP) // self._period), 0)
            anew = x < self._x - 0.5 * GAP  # the road has begun anew
            if number != self._shown or anew:
                self._shown, self._touched = number, np.zeros(len(self._places), bool)
            self._x = x
            margins = iso3888.cone_margins(self._at(), self.size, np.array(x), np.array(y), np.array(yaw))
            self._touched |= margins < 0.0

    def cones(self) -> Array | None:
        """Cones (N, 3) of the course that is nearest: x, y [m], and 1 where they were touched; None without any."""
        return np.column_stack([self._at(), self._touched]) if len(self._places) else None

    def _at(self) -> Array:
        return np.asarray(np.add(self._places, (FIRST + max(self._shown, 0) * self._period, 0.0)))
