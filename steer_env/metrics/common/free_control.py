"""Free control: yaw rate and handwheel after the hands have let go, in a release from a steady turn and after a pulse.

The definitions are after ISO 17288-1 (release) and ISO 17288-2 (pulse), from secondary sources. A value is counted
positive towards the side of the turn or of the pulse, so that the offset of a sensor has opposite effects to the left
and to the right and drops out. Time ranges and bands are assumed.
"""

from functools import partial

import numpy as np

from steer_env.metrics.common import decay
from steer_env.metrics.common.definitions import RefusedError, metric
from steer_env.metrics.common.filtered_channels import ANGLE, TORQUE, YAW
from steer_env.metrics.common.free_hands import Pulses, Releases
from steer_env.metrics.common.kept import kept
from steer_env.recording.recording import Recording

FREE = 4.0  # time for which the hands must stay off [s]
RESIDUAL = (3.0, 4.0)  # section in which the residual is read, from the release [s]
UNSETTLED = 0.2  # span of the yaw rate in that section, over the excitation, from which there is no residual [1]
BAND = 0.1  # half width of the band around the residual in which the yaw rate has settled, over the excitation [1]
FITTED = 3.0  # length of the section to which the oscillation is fitted, from the first extreme on [s]
LINEAR = (0.03, 0.35)  # lateral acceleration at which the car is linear and stands out of the noise [g]


class FreeControl:
    """The releases or the pulses of a recording, and the motion of the car after them."""

    def __init__(self, recording: Recording, conditions: object, kind: type[Releases | Pulses]) -> None:
        self.events = kind(recording, FREE)

    @kept
    def peak_acceleration(self) -> float:
        """Largest lateral acceleration [g]."""
        return self.events.peak_acceleration()

    @kept
    def excitation(self) -> np.ndarray:
        """Yaw rate (n,) that was held before a release, or the peak of the yaw rate from a pulse [rad/s]."""
        if isinstance(self.events, Releases):
            return self.events.held(YAW)
        if np.any(self.events.mean(YAW, -0.3, 0.1) <= 0):  # before the car can have swung back
            raise RefusedError(f"{YAW} does not follow {TORQUE}: check the signs, a left turn is positive in both")
        return np.array([-decay.lowest(*self._negative_yaw(k, -0.3, 0.7))[1] for k in range(len(self.events))])

    def _negative_yaw(self, event: int, begin: float, end: float) -> tuple[np.ndarray, np.ndarray]:
        t, y = self.events.section(YAW, event, begin, end)
        return t, -y

    @kept
    def residual(self, name: str) -> np.ndarray:
        """Mean (n,) of a channel from 3 to 4 s after each event; refused where the car still oscillates."""
        for k, size in enumerate(self.checked_excitation()):
            if np.ptp(self.events.section(YAW, k, *RESIDUAL)[1]) > UNSETTLED * size:
                raise RefusedError(
                    f"{YAW} still spans over {UNSETTLED:.0%} of the excitation {RESIDUAL[0]:g} s after the "
                    "hands let go: the car oscillates, or the channel is too noisy"
                )
        return self.events.mean(name, *RESIDUAL)

    def checked_excitation(self) -> np.ndarray:
        """The excitation (n,) [rad/s]; refused where the yaw rate opposes the hands."""
        size = self.excitation()
        if np.any(size <= 0):
            raise RefusedError(f"{YAW} runs against the hands: check the signs, a left turn is positive in both")
        return size

    @kept
    def opposite(self) -> tuple[np.ndarray, np.ndarray]:
        """Time [s] and yaw rate [rad/s] of the first extreme to the other side, each (n,)."""
        self.checked_excitation()
        found = [decay.lowest(*self.events.section(YAW, k, 0.0, 1.5)) for k in range(len(self.events))]
        return np.array([t for t, _ in found]), np.array([y for _, y in found])

    @kept
    def decays(self) -> list[decay.Decay]:
        """The oscillation after each event, from its first extreme to the other side."""
        begin, found = self.opposite()[0], []
        for k, t in enumerate(begin):
            found.append(decay.fit(*self.events.section(YAW, k, t, min(t + FITTED, FREE)), YAW))
        return found

    def settling(self) -> np.ndarray:
        """Time (n,) after which the yaw rate stays within the band around the residual [s]."""
        size, residual = self.checked_excitation(), self.residual(YAW)
        sections = (self.events.section(YAW, k, 0.0, FREE) for k in range(len(size)))
        return np.array([decay.last_outside(t, y - r, BAND * s) for (t, y), r, s in zip(sections, residual, size)])


_both = partial(metric, validity=LINEAR, source="after ISO 17288-1 and 17288-2")


@_both("1", "release", "pulse")
def free_damping_ratio(free: FreeControl) -> np.ndarray:
    """Damping ratio of a decaying cosine that is fitted to 3 s of the yaw rate after the hands let go.

    The 3 s begin at the first extreme of the yaw rate to the other side.
    """
    return np.array([found.damping_ratio for found in free.decays()])


@_both("Hz", "release", "pulse")
def free_natural_frequency(free: FreeControl) -> np.ndarray:
    """Undamped natural frequency of the decaying cosine that gives the damping ratio."""
    return np.array([found.natural_frequency for found in free.decays()])


@_both("deg/s", "release", "pulse")
def residual_yaw_rate(free: FreeControl) -> np.ndarray:
    """Mean yaw rate from 3 to 4 s after the hands let go; positive to the side of the turn or the pulse."""
    return free.residual(YAW)


@_both("deg", "release", "pulse")
def residual_handwheel_angle(free: FreeControl) -> np.ndarray:
    """Mean handwheel angle from 3 to 4 s after the hands let go; positive to the side of the turn or the pulse."""
    return free.residual(ANGLE)


@_both("s", "release", "pulse")
def free_yaw_rate_settling_time(free: FreeControl) -> np.ndarray:
    """Time after the hands let go until the yaw rate stays within 10 % of the excitation around the residual yaw rate.

    The excitation is the yaw rate held before a release, or the peak of the yaw rate that a pulse caused.
    """
    return free.settling()
