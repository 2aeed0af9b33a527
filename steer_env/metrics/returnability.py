"""Returnability: how far and how fast the handwheel returns from a quarter turn at low speed.

In the workshop check the handwheel must return to within 20 deg. Angles are counted positive to the side from which the
handwheel returns.
"""

from copy import copy

import numpy as np

from steer_env.metrics.common import decay
from steer_env.metrics.common.definitions import Doubt, RefusedError, metric, register_evaluation
from steer_env.metrics.common.filtered_channels import ANGLE
from steer_env.metrics.common.free_hands import Releases
from steer_env.recording.recording import DEGREE, Recording

FREE_TIME = 4.0  # time for which the hands must stay off [s]
RETURN_RANGE = (80.0 * DEGREE, 30.0 * DEGREE)  # angles between which the return rate is read [rad]
SOURCE = "workshop check at 35 km/h from 90 deg (Hyundai); times assumed"


class Returns:
    """Releases of a handwheel that was held at about ``angle_rad``."""

    def __init__(self, recording: Recording, conditions: dict[str, float]) -> None:
        self.releases = Releases(recording, FREE_TIME)
        held, wanted = self.releases.held(ANGLE), conditions["angle_rad"]
        if np.any(np.abs(held / wanted - 1) > 0.1):
            found = ", ".join(f"{a / DEGREE:.0f}" for a in held)
            raise RefusedError(
                f"{ANGLE} was held at {found} deg, not {wanted / DEGREE:.0f} +- 10%: hold it there, or say angle_rad"
            )

    def doubts(self) -> list[Doubt]:
        """What the recording leaves open: the instant of the release between two samples."""
        return [
            Doubt(
                "the instant of the release", "sample faster", tuple(map(self._at, self.releases.earlier_and_later()))
            )
        ]

    def _at(self, releases: Releases) -> "Returns":
        other = copy(self)
        other.releases = releases
        return other

    def angle(self, event: int) -> tuple[np.ndarray, np.ndarray]:
        """Time [s] and handwheel angle [rad] after a release."""
        return self.releases.section(ANGLE, event, -0.2, FREE_TIME)


register_evaluation("returnability", Returns, speed_m_s=35 / 3.6, angle_rad=0.5 * np.pi)


@metric("deg", "returnability", source=SOURCE)
def handwheel_angle_after_1s(returns: Returns) -> np.ndarray:
    """Mean handwheel angle from 0.9 to 1.1 s after the release."""
    return returns.releases.mean(ANGLE, 0.9, 1.1)


@metric("deg", "returnability", usual=(0.0, 20.0), source=SOURCE)
def handwheel_angle_after_3s(returns: Returns) -> np.ndarray:
    """Mean handwheel angle from 2.9 to 3.1 s after the release."""
    return returns.releases.mean(ANGLE, 2.9, 3.1)


@metric("deg/s", "returnability", source=SOURCE)
def handwheel_return_rate(returns: Returns) -> np.ndarray:
    """Mean speed of the handwheel on its way back from 80 to 30 deg."""
    rates = []
    for k in range(len(returns.releases)):
        first, last = (decay.first_below(*returns.angle(k), level, ANGLE) for level in RETURN_RANGE)
        rates.append((RETURN_RANGE[0] - RETURN_RANGE[1]) / (last - first))
    return np.array(rates)


@metric("deg", "returnability", source=SOURCE)
def handwheel_return_overshoot(returns: Returns) -> np.ndarray:
    """Largest angle of the handwheel beyond straight ahead; 0 where the handwheel stops short of straight ahead."""
    lowest = (decay.lowest(*returns.angle(k))[1] for k in range(len(returns.releases)))
    return np.array([max(-angle, 0.0) for angle in lowest])
