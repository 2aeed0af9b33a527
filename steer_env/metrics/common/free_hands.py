"""Events of a recording with free hands: where the hands let go of the handwheel, and where they gave a pulse.

Both are found in the hand torque, which is low-passed without a phase shift: the filtered fall passes half its height
at the same time as the unfiltered one.
"""

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from steer_env.metrics.common.definitions import RefusedError
from steer_env.metrics.common.events import integral, true_runs
from steer_env.metrics.common.filtered_channels import ANGLE, AY, TORQUE, FilteredChannels
from steer_env.metrics.common.kept import anew, kept
from steer_env.recording.recording import Recording
from steer_env.vehicle.constants import GRAVITY as G

Array = NDArray[np.float64]

CUTOFF = 5.0  # low-pass [Hz]
# Fractions of the held torque: the hands hold the handwheel above the first and are off below the second; assumed [1].
GRIP, FREE = 0.5, 0.25
FALL = 0.3  # longest time of the torque from the one to the other, the low-pass included [s]; assumed
BEFORE = (-0.65, -0.15)  # section in which the held values are read, from the release [s]; the low-pass blurs 0.15 s
STEADY = 0.1  # largest change over the last second of the hold, as a fraction of the held value; assumed [1]
LONGEST = 1.5  # longest pulse [s]; assumed


class Events:
    """Events of one kind in a recording; every channel is counted positive towards the event's own side.

    ``start`` (n,) are the instants from which times count [s]; ``side`` (n,) is 1 for left and -1 for right.
    """

    def __init__(self, recording: Recording, free: float) -> None:
        self.smooth, self.free = FilteredChannels(recording, CUTOFF), free
        self.time = recording.time
        self.start, self.side = np.zeros(0), np.zeros(0)

    def section(self, name: str, event: int, begin: float, end: float) -> tuple[Array, Array]:
        """Time from the start of an event [s] and the channel, from ``begin`` to ``end`` after the start."""
        # Samples a second beyond either end, out of a long recording.
        near = slice(*np.searchsorted(self.time, self.start[event] + np.array([begin - 1.0, end + 1.0])))
        t = self.time[near] - self.start[event]
        inside = (t >= begin) & (t <= end)
        if inside.sum() < 5:
            raise RefusedError(f"{inside.sum()} samples from {begin:g} to {end:g} s after an event: record longer")
        return t[inside], self.side[event] * (self.smooth[name][near][inside] - self.zero(name, event))

    def mean(self, name: str, begin: float, end: float) -> Array:
        """Mean (n,) of a channel from ``begin`` to ``end`` after each event."""
        zero = np.array([self.zero(name, event) for event in range(len(self))])
        total = self._integral(name)
        return self.side * ((total(self.start + end) - total(self.start + begin)) / (end - begin) - zero)

    @kept
    def _integral(self, name: str) -> Callable[[Array], Array]:
        return integral(self.time, self.smooth[name])

    def zero(self, name: str, event: int) -> float:
        """The value from which a channel counts at an event."""
        return 0.0

    def __len__(self) -> int:
        return self.start.size


class Releases(Events):
    """The places where hands that held the handwheel let go of it for ``free`` seconds or longer.

    Raises RefusedError if there is no such place, or if the turn before a release was not steady.
    """

    def __init__(self, recording: Recording, free: float) -> None:
        super().__init__(recording, free)
        size = np.abs(self.smooth[TORQUE])
        level = np.quantile(size, 0.95)
        found = [self._fall(size, a) for a, b in true_runs(size < FREE * level) if self._let_go(size, a, b, level)]
        if not found or level == 0:
            raise RefusedError(
                f"{TORQUE} nowhere drops from a held value to zero for {free:g} s: hold a steady turn, let go at once, "
                "and leave the handwheel alone"
            )
        self.start = np.array(found)
        self.side = np.ones(len(found))
        self.side = np.sign(self.mean(ANGLE, *BEFORE))
        self.held(TORQUE)
        self.held(ANGLE)

    def _let_go(self, size: Array, a: int, b: int, level: float) -> bool:
        """Whether a run of small torques is a release: long enough, and with a held torque right before it."""
        if a == 0 or self.time[b - 1] - self.time[a] < self.free - FALL or self.time[a] < self.time[0] + 1.3:
            return False
        before = (self.time >= self.time[a] - FALL) & (self.time < self.time[a])
        return bool(size[before].max() > GRIP * level)

    def _fall(self, size: Array, a: int) -> float:
        """Time at which the size falls through half of its mean in the half second before the fall [s]."""
        before = (self.time > self.time[a] - 0.8) & (self.time < self.time[a] - FALL)
        half = 0.5 * float(size[before].mean())
        k = int(np.flatnonzero(size[: a + 1] >= half)[-1])
        return float(np.interp(-half, -size[k : k + 2], self.time[k : k + 2]))

    def earlier_and_later(self) -> tuple["Releases", "Releases"]:
        """The same releases half a sample earlier and later: hands let go at once, somewhere between two samples."""
        return self._moved(-0.5 / self.smooth.recording.rate), self._moved(0.5 / self.smooth.recording.rate)

    def _moved(self, by: float) -> "Releases":
        other = anew(self, "_integral")  # which the instant does not change
        other.start = self.start + by
        return other

    @kept
    def held(self, name: str) -> Array:
        """Mean (n,) of a channel before the release; refused if it opposed the handwheel angle or was not steady."""
        now, earlier = self.mean(name, *BEFORE), self.mean(name, BEFORE[0] - 0.5, BEFORE[1] - 0.5)
        if np.any(now <= 0):
            raise RefusedError(f"{name} does not follow {ANGLE}: check the signs, a left turn is positive in both")
        if np.any(np.abs(now - earlier) > STEADY * now):
            raise RefusedError(f"{name} changes by over {STEADY:.0%} in the second before the release: hold it steady")
        return now

    def peak_acceleration(self) -> float:
        """Largest lateral acceleration that was held [g]."""
        return float(np.max(self.held(AY))) / G


class Pulses(Events):
    """The places where the hands gave a short pulse of torque and then let go for ``free`` seconds or longer.

    Times count from where the torque has fallen to half its peak. The mean of the half second before the pulse is
    subtracted from every channel.
    """

    def __init__(self, recording: Recording, free: float) -> None:
        super().__init__(recording, free)
        torque, time = self.smooth[TORQUE], self.time
        size = np.abs(torque)
        level = size.max()
        start, side, begin = [], [], []
        for a, b in true_runs(size > GRIP * level):
            width = time[b - 1] - time[a]
            after = (time > time[b - 1] + 0.5 * max(width, FALL)) & (time < time[b - 1] + free)
            before = (time > time[a] - max(width, FALL) - 0.5) & (time < time[a] - max(width, FALL))
            enough = before.any() and time[-1] >= time[b - 1] + free - 0.05
            if not enough or b == time.size or width > LONGEST or size[before | after].max() > FREE * level:
                continue
            half = 0.5 * size[a:b].max()
            k = int(a + np.flatnonzero(size[a : b + 1] >= half)[-1])
            start.append(np.interp(-half, -size[k : k + 2], time[k : k + 2]))
            side.append(np.sign(torque[a:b].mean()))
            begin.append(time[a] - max(width, FALL))
        if not start or level == 0:
            raise RefusedError(
                f"no pulse of {TORQUE} shorter than {LONGEST:g} s between half a second of straight running and "
                f"{free:g} s of free hands: run straight, give one, and let go"
            )
        self.start, self.side, self._begin = np.array(start), np.array(side), np.array(begin)

    @kept
    def zero(self, name: str, event: int) -> float:
        """Mean of a channel in the half second before the pulse."""
        straight = (self.time > self._begin[event] - 0.5) & (self.time < self._begin[event])
        return float(self.smooth[name][straight].mean())

    def peak_acceleration(self) -> float:
        """Largest lateral acceleration of the pulses [g]."""
        sections = (self.section(AY, k, -1.0, 2.0)[1] for k in range(len(self)))
        return max(float(np.quantile(np.abs(y), 0.99)) for y in sections) / G
