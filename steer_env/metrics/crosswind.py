"""Crosswind: what gusts or random wind do to a car that runs straight, with the handwheel held or the hands off.

When the gusts came must be said: ``gust_start_s``, with ``gust_interval_s`` and ``gust_count`` for several alike; a
recording without is one of random wind. Each gust is read less the mean of the second before it, and values are
positive to the side to which the car was pushed. Definitions after ISO 12021, from secondary sources.
"""

from collections.abc import Mapping
from functools import cache, partial
from typing import Any

import numpy as np
from scipy.integrate import cumulative_trapezoid

from steer_env.metrics.common import decay
from steer_env.metrics.common.definitions import Bounded, RefusedError, metric, procedure
from steer_env.metrics.common.noise import in_band
from steer_env.metrics.common.reading import ANGLE, AY, SPEED, TORQUE, YAW, Reading
from steer_env.recording.recording import DEGREE, Recording

CUTOFF = 10.0  # low-pass, as a gust takes hold within 0.15 s [Hz]
BEFORE = 1.0  # the gust that is taken for straight running [s]
AFTER = 2.0  # the start of the gust at which deviation and course are read [s]
WINDOW = 3.0  # after the start of the gust in which peaks are looked for [s]; assumed
SEGMENT = 10.0  # of random wind, one repeat [s]; assumed
LOGGER = 1.5  # samples by which a logger's filter against aliases delays its channels at most; assumed
CLEAR = 5.0  # standard deviations before the gust that a peak must exceed; assumed
TURNED = 3.0 * DEGREE  # that a handwheel which is held may turn; assumed


class Crosswind:
    """Gusts, each less the straight running before it; or segments of random wind."""

    def __init__(self, recording: Recording, asked: Mapping[str, Any], fixed: bool) -> None:
        self.smooth, self.time = Reading(recording, CUTOFF), recording.time
        self.speed = float(np.mean(self.smooth[SPEED])) if SPEED in self.smooth else float(asked["speed_m_s"])
        self._gusts = asked["gust_start_s"] is not None
        if self._gusts:
            self.start = asked["gust_start_s"] + asked["gust_interval_s"] * np.arange(int(asked["gust_count"]))
            if (
                self.start.size == 0
                or self.start[0] - BEFORE < self.time[0] - 0.05
                or self.time[-1] < self.start[-1] + WINDOW
            ):
                raise RefusedError(
                    f"the gusts need {BEFORE:g} s before and {WINDOW:g} s after each start; time runs from "
                    f"{self.time[0]:g} to {self.time[-1]:g} s: check gust_start_s, gust_interval_s and gust_count"
                )
        else:
            count = int((self.time[-1] - self.time[0]) / SEGMENT + 0.05)
            self.start = self.time[0] + SEGMENT * np.arange(count)
            if count < 2:
                raise RefusedError(f"no gust_start_s, and under {2 * SEGMENT:g} s of random wind: say when it came")
        if fixed and ANGLE in self.smooth and np.std(self.smooth[ANGLE]) > TURNED:
            raise RefusedError(f"{ANGLE} is not held: keep it to {TURNED / DEGREE:g} deg, or read it as crosswind-free")
        self._parts = cache(self._cut)

    def _cut(self, name: str) -> list[tuple[np.ndarray, np.ndarray]]:
        """Time from the start of each gust [s] and the channel less its mean before."""
        if not self._gusts:
            raise RefusedError("no gust_start_s: say when the gust came, in the meta or as a condition")
        found = []
        for start in self.start:
            t = self.time - start
            now, before = (t >= 0) & (t <= WINDOW), (t >= -BEFORE) & (t < -0.1)  # the low-pass blurs 0.1 s
            y = self.smooth[name] - self.smooth[name][before].mean()
            if np.abs(y[now]).max() < CLEAR * y[before].std():
                raise RefusedError(f"{name} does not stand out of its noise before the gust: drive in more wind")
            found.append((t[now], y[now]))
        return found

    @property
    def side(self) -> np.ndarray:
        """1 (n,) where a gust pushed to the left, -1 to the right."""
        return np.sign([np.trapezoid(y[t < 1.0], t[t < 1.0]) for t, y in self._parts(AY)])

    def peak(self, name: str) -> np.ndarray:
        """Largest excursion (n,), positive with the gust; of all gusts that to the same side.

        Each is read where the mean of the gusts is largest: a largest of its own would be one of the noise.
        """
        parts = [(t, side * y) for side, (t, y) in zip(self.side, self._parts(name))]
        time = min((t for t, _ in parts), key=len)
        mean = np.mean([np.interp(time, t, y) for t, y in parts], axis=0)
        sign = -1.0 if mean.max() >= -mean.min() else 1.0
        at = decay.lowest(time, sign * mean)[0]
        return np.array([sign * decay.lowest(t, sign * y, at=at)[1] for t, y in parts])

    def drift(self) -> list[Bounded]:
        """Lateral speed [m/s] and deviation [m] from the line before, each (n,), two seconds after the gust began.

        When it began is known to what a logger delays its channels by.
        """
        instants = AFTER + LOGGER / self.smooth.recording.rate * np.array([0.0, -1.0, 1.0])
        ends = []
        for side, (t, y) in zip(self.side, self._parts(AY)):
            speed = cumulative_trapezoid(side * y, t, initial=0.0)
            ends.append([np.interp(instants, t, x) for x in (speed, cumulative_trapezoid(speed, t, initial=0.0))])
        found = np.moveaxis(np.array(ends), 0, -1)  # what, instant, gust
        late = np.abs(np.diff(found.mean(axis=-1)[:, :2]))[:, 0], np.abs(np.diff(found.mean(axis=-1)[:, ::2]))[:, 0]
        return [Bounded(values[0], slack, slack) for values, slack in zip(found, np.maximum(*late))]

    def rms(self, name: str) -> np.ndarray:
        """Root mean square (n,) about the mean, without what noise makes: of each gust's window, or of each segment."""
        if self._gusts:
            square = np.array([np.trapezoid(y**2, t) / WINDOW for t, y in self._parts(name)])  # at rest at both ends
        else:
            parts = ((self.time >= start) & (self.time < start + SEGMENT) for start in self.start)
            square = np.array([self.smooth[name][part].var() for part in parts])
        return np.sqrt(np.maximum(square - in_band(self.smooth, name, CUTOFF) ** 2, 0.0))


for _name, _fixed in (("crosswind", True), ("crosswind-free", False)):
    procedure(
        _name,
        partial(Crosswind, fixed=_fixed),
        speed_m_s=100 / 3.6,
        gust_start_s=None,  # of the first gust
        gust_interval_s=8.0,
        gust_count=1,
    )

_both = partial(metric, source="after ISO 12021")


@_both("m", "crosswind", "crosswind-free")
def crosswind_lateral_deviation(wind: Crosswind) -> Bounded:
    """Way aside of the line driven before, 2 s after the gust began: lateral acceleration integrated twice.

    The interval has what one and a half samples, for the logger's delay, change.
    """
    return wind.drift()[1]


@_both("deg", "crosswind", "crosswind-free")
def crosswind_course_deviation(wind: Crosswind) -> Bounded:
    """Change of the course angle 2 s after the gust began: lateral acceleration integrated, over the speed."""
    gained, below, above = wind.drift()[0]
    return Bounded(gained / wind.speed, below / wind.speed, above / wind.speed)


@_both("deg/s", "crosswind", "crosswind-free")
def crosswind_yaw_rate_peak(wind: Crosswind) -> np.ndarray:
    """Largest yaw rate in the 3 s from the start of the gust, where the mean of the gusts has it.

    Positive where it turns the car with the wind.
    """
    return wind.peak(YAW)


@_both("m/s2", "crosswind", "crosswind-free")
def crosswind_lateral_acceleration_peak(wind: Crosswind) -> np.ndarray:
    """Largest lateral acceleration in the 3 s from the start of the gust, where the mean of the gusts has it."""
    return wind.peak(AY)


@_both("deg/s", "crosswind", "crosswind-free")
def crosswind_yaw_rate_rms(wind: Crosswind) -> np.ndarray:
    """Root mean square of the yaw rate in the 3 s from the start of a gust, or in each 10 s of random wind.

    White noise, judged from what is above 10 Hz, is taken off.
    """
    return wind.rms(YAW)


@_both("N m", "crosswind")
def crosswind_handwheel_torque_peak(wind: Crosswind) -> np.ndarray:
    """Size of the largest hand torque that keeps the handwheel straight, where the mean of the gusts has it."""
    return np.abs(wind.peak(TORQUE))


@_both("deg", "crosswind-free")
def crosswind_handwheel_angle_peak(wind: Crosswind) -> np.ndarray:
    """Size of the largest turn of the free handwheel, where the mean of the gusts has it."""
    return np.abs(wind.peak(ANGLE))
