"""Free control: what yaw rate and handwheel do when the hands have let go, after a steady turn and after a pulse.

Definitions are after ISO 17288-1 (release) and ISO 17288-2 (pulse), from secondary sources. A value is counted positive
towards the side of the turn or of the pulse, so that what a sensor's offset does to the left it undoes to the right.
Ranges of time and bands are assumed.
"""

from functools import cache, partial

import numpy as np

from steer_env.metrics.common import decay
from steer_env.metrics.common.definitions import RefusedError, metric, procedure
from steer_env.metrics.common.free_hands import Pulses, Releases
from steer_env.metrics.common.reading import ANGLE, TORQUE, YAW
from steer_env.recording.recording import Recording

FREE = 4.0  # that the hands must stay off [s]
RESIDUAL = (3.0, 4.0)  # where what remains is read [s]
UNSETTLED = 0.2  # of the excitation: span of the yaw rate in that second from which there is no residual
BAND = 0.1  # of the excitation around what remains, in which the yaw rate has settled
FITTED = 3.0  # from the first extreme on that the oscillation is fitted [s]
LINEAR = (0.03, 0.35)  # lateral acceleration within which the car is linear and stands out of the noise [g]


class FreeControl:
    """Events of one recording and the excitation (n,) of the yaw rate by each [rad/s]."""

    def __init__(self, recording: Recording, asked: object, kind: type[Releases | Pulses]) -> None:
        self.events = kind(recording, FREE)
        self.decays = cache(self._decays)

    def peak_acceleration(self) -> float:
        """Largest lateral acceleration [g]."""
        return self.events.peak_acceleration()

    def excitation(self) -> np.ndarray:
        """Yaw rate (n,) that was held before a release, or its peak from a pulse [rad/s]."""
        if isinstance(self.events, Releases):
            return self.events.held(YAW)
        if np.any(self.events.mean(YAW, -0.3, 0.1) <= 0):  # before the car can have swung back
            raise RefusedError(f"{YAW} does not follow {TORQUE}: check the signs, a left turn is positive in both")
        return np.array([-decay.lowest(*self._turned(k, -0.3, 0.7))[1] for k in range(len(self.events))])

    def _turned(self, event: int, begin: float, end: float) -> tuple[np.ndarray, np.ndarray]:
        t, y = self.events.part(YAW, event, begin, end)
        return t, -y

    def residual(self, name: str) -> np.ndarray:
        """Mean (n,) of a channel in the second in which what remains is read; refused where the car still weaves."""
        for k, size in enumerate(self._checked()):
            if np.ptp(self.events.part(YAW, k, *RESIDUAL)[1]) > UNSETTLED * size:
                raise RefusedError(
                    f"{YAW} still spans over {UNSETTLED:.0%} of the excitation {RESIDUAL[0]:g} s after the "
                    "hands let go: the car weaves, or the channel is too noisy"
                )
        return self.events.mean(name, *RESIDUAL)

    def _checked(self) -> np.ndarray:
        size = self.excitation()
        if np.any(size <= 0):
            raise RefusedError(f"{YAW} runs against the hands: check the signs, a left turn is positive in both")
        return size

    def opposite(self) -> tuple[np.ndarray, np.ndarray]:
        """Time [s] and yaw rate [rad/s] (n,), each, of the first extreme to the other side."""
        self._checked()
        found = [decay.lowest(*self.events.part(YAW, k, 0.0, 1.5)) for k in range(len(self.events))]
        return np.array([t for t, _ in found]), np.array([y for _, y in found])

    def _decays(self) -> list[decay.Decay]:
        """The oscillation after each event, from its first extreme on the other side."""
        begin, found = self.opposite()[0], []
        for k, t in enumerate(begin):
            found.append(decay.fit(*self.events.part(YAW, k, t, min(t + FITTED, FREE)), YAW))
        return found

    def settling(self) -> np.ndarray:
        """Time (n,) after which the yaw rate stays within the band around what remains [s]."""
        size, rest = self._checked(), self.residual(YAW)
        parts = (self.events.part(YAW, k, 0.0, FREE) for k in range(len(size)))
        return np.array([decay.last_outside(t, y - r, BAND * s) for (t, y), r, s in zip(parts, rest, size)])


procedure("release", partial(FreeControl, kind=Releases), speed_m_s=100 / 3.6)
procedure("pulse", partial(FreeControl, kind=Pulses), speed_m_s=100 / 3.6)

_release = partial(metric, validity=LINEAR, source="after ISO 17288-1")
_pulse = partial(metric, validity=LINEAR, source="after ISO 17288-2")
_both = partial(metric, validity=LINEAR, source="after ISO 17288-1 and 17288-2")


@_both("1", "release", "pulse")
def free_damping_ratio(free: FreeControl) -> np.ndarray:
    """Damping ratio of a decaying cosine, fitted to 3 s of yaw rate from its first extreme to the other side on."""
    return np.array([found.damping_ratio for found in free.decays()])


@_both("Hz", "release", "pulse")
def free_natural_frequency(free: FreeControl) -> np.ndarray:
    """Undamped natural frequency of the decaying cosine from which the damping ratio comes."""
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
    """Time after the hands let go from which the yaw rate stays within 10 % of its excitation around what remains.

    The excitation is the yaw rate held before a release, or the peak that a pulse brought.
    """
    return free.settling()


@_release("%", "release", usual=(-20.0, 20.0))
def yaw_rate_after_1s(free: FreeControl) -> np.ndarray:
    """Mean yaw rate from 0.9 to 1.1 s after the release over that held before it."""
    return free.events.mean(YAW, 0.9, 1.1) / free.excitation()


@_release("%", "release")
def release_overshoot(free: FreeControl) -> np.ndarray:
    """How far the yaw rate goes beyond what remains, to the other side, over the way from held to what remains."""
    rest = free.residual(YAW)
    return (rest - free.opposite()[1]) / (free.excitation() - rest)


@_release("s", "release")
def yaw_rate_time_to_half(free: FreeControl) -> np.ndarray:
    """Time from the release until the yaw rate has fallen to half of what was held."""
    held = free.excitation()
    parts = (free.events.part(YAW, k, -0.2, FREE) for k in range(len(held)))
    return np.array([decay.first_below(t, y, 0.5 * h, YAW) for (t, y), h in zip(parts, held)])


@_pulse("deg/s", "pulse")
def pulse_yaw_rate_peak(free: FreeControl) -> np.ndarray:
    """Largest yaw rate to the side of the pulse, less what was there before it."""
    return free.excitation()


@_pulse("%", "pulse")
def pulse_overshoot(free: FreeControl) -> np.ndarray:
    """Largest yaw rate to the other side over that to the side of the pulse."""
    return -free.opposite()[1] / free.excitation()


@_pulse("deg", "pulse", usual=(-2.0, 2.0))
def heading_after_pulse(free: FreeControl) -> np.ndarray:
    """Change of heading from before the pulse to 4 s after it: integral of the yaw rate."""
    free._checked()
    parts = (free.events.part(YAW, k, -2.0, FREE) for k in range(len(free.events)))
    return np.array([np.trapezoid(y, t) for t, y in parts])
