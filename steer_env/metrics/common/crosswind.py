"""Crosswind: the effect of gusts or random wind on a car that runs straight, with a held or a free handwheel.

The times of the gusts must be given: ``gust_start_s``, and for several equal gusts ``gust_interval_s`` and
``gust_count``. A recording without them is one of random wind. Each gust is read relative to the mean of the second
before it, and values are positive to the side to which the wind pushed the car. The definitions are after ISO 12021,
from secondary sources.
"""

from collections.abc import Mapping
from functools import partial
from typing import Any

import numpy as np
from scipy.integrate import cumulative_trapezoid

from steer_env.metrics.common import decay
from steer_env.metrics.common.definitions import Bounded, RefusedError, metric, register_evaluation
from steer_env.metrics.common.filtered_channels import ANGLE, AY, SPEED, YAW, FilteredChannels
from steer_env.metrics.common.kept import kept
from steer_env.metrics.common.noise import in_band
from steer_env.recording.recording import DEGREE, Recording

CUTOFF = 10.0  # low-pass; a gust builds up within 0.15 s [Hz]
BEFORE_GUST_TIME = 1.0  # time before a gust that counts as straight running [s]
DEVIATION_TIME = 2.0  # time from the start of a gust at which deviation and course angle are read [s]
WINDOW = 3.0  # time from the start of a gust in which peaks are searched; assumed [s]
SEGMENT = 10.0  # length of a segment of random wind, which is one repeat; assumed [s]
LOGGER = 1.5  # largest delay of the channels from the logger's anti-aliasing filter; assumed [samples]
PEAK_DEVIATIONS = 5.0  # a peak must exceed this many standard deviations of the channel before the gust; assumed [1]
TURNED = 3.0 * DEGREE  # largest deviation of a handwheel that is held; assumed [rad]


class Crosswind:
    """The gusts of a recording, each relative to the straight running before it, or segments of random wind."""

    def __init__(self, recording: Recording, conditions: Mapping[str, Any], fixed: bool) -> None:
        self.smooth, self.time = FilteredChannels(recording, CUTOFF), recording.time
        self.speed = float(np.mean(self.smooth[SPEED])) if SPEED in self.smooth else float(conditions["speed_m_s"])
        self._gusts = conditions["gust_start_s"] is not None
        self.start = self._gust_starts(conditions) if self._gusts else self._segment_starts()
        if fixed and ANGLE in self.smooth and np.std(self.smooth[ANGLE]) > TURNED:
            raise RefusedError(
                f"{ANGLE} is not held: keep it within {TURNED / DEGREE:g} deg, or evaluate the test as crosswind-free"
            )

    def _gust_starts(self, conditions: Mapping[str, Any]) -> np.ndarray:
        """Start of each gust [s]; refused where the recording does not contain them."""
        start = conditions["gust_start_s"] + conditions["gust_interval_s"] * np.arange(int(conditions["gust_count"]))
        if start.size == 0 or start[0] - BEFORE_GUST_TIME < self.time[0] - 0.05 or self.time[-1] < start[-1] + WINDOW:
            raise RefusedError(
                f"the gusts need {BEFORE_GUST_TIME:g} s before and {WINDOW:g} s after each start; time runs from "
                f"{self.time[0]:g} to {self.time[-1]:g} s: check gust_start_s, gust_interval_s and gust_count"
            )
        return start

    def _segment_starts(self) -> np.ndarray:
        """Start of each segment of random wind [s]; refused where there are fewer than two."""
        count = int((self.time[-1] - self.time[0]) / SEGMENT + 0.05)
        if count < 2:
            raise RefusedError(
                f"no gust_start_s, and less than {2 * SEGMENT:g} s of random wind: say when the gusts began"
            )
        return self.time[0] + SEGMENT * np.arange(count)

    @kept
    def _sections(self, name: str) -> list[tuple[np.ndarray, np.ndarray]]:
        """Time from the start of each gust [s], and the channel relative to its mean before the gust."""
        if not self._gusts:
            raise RefusedError("no gust_start_s: say when the gust began, in the meta or as a condition")
        found = []
        for start in self.start:
            t = self.time - start
            now, before = (t >= 0) & (t <= WINDOW), (t >= -BEFORE_GUST_TIME) & (t < -0.1)  # the low-pass blurs 0.1 s
            y = self.smooth[name] - self.smooth[name][before].mean()
            if np.abs(y[now]).max() < PEAK_DEVIATIONS * y[before].std():
                raise RefusedError(f"{name} does not stand out of its noise before the gust: drive in more wind")
            found.append((t[now], y[now]))
        return found

    @property
    def side(self) -> np.ndarray:
        """1 (n,) where a gust pushed the car to the left, -1 where it pushed the car to the right."""
        return np.sign([np.trapezoid(y[t < 1.0], t[t < 1.0]) for t, y in self._sections(AY)])

    def peak(self, name: str) -> np.ndarray:
        """Largest excursion (n,), positive with the gust; for all gusts on the same side of zero.

        Each gust is read at the time at which the mean of the gusts is largest. The largest value of a single gust
        would contain the largest value of its noise.
        """
        sections = [(t, side * y) for side, (t, y) in zip(self.side, self._sections(name))]
        time = min((t for t, _ in sections), key=len)
        mean = np.mean([np.interp(time, t, y) for t, y in sections], axis=0)
        sign = -1.0 if mean.max() >= -mean.min() else 1.0
        at = decay.lowest(time, sign * mean)[0]
        return np.array([sign * decay.lowest(t, sign * y, at=at)[1] for t, y in sections])

    def drift(self) -> list[Bounded]:
        """Lateral speed [m/s] and deviation from the earlier line [m], each (n,), two seconds after a gust began.

        The bounds come from the delay of a logger: the start of the gust is known only within that delay.
        """
        instants = DEVIATION_TIME + LOGGER / self.smooth.recording.rate * np.array([0.0, -1.0, 1.0])
        ends = []
        for side, (t, y) in zip(self.side, self._sections(AY)):
            speed = cumulative_trapezoid(side * y, t, initial=0.0)
            ends.append([np.interp(instants, t, x) for x in (speed, cumulative_trapezoid(speed, t, initial=0.0))])
        found = np.moveaxis(np.array(ends), 0, -1)  # (quantity, instant, gust)
        late = np.abs(np.diff(found.mean(axis=-1)[:, :2]))[:, 0], np.abs(np.diff(found.mean(axis=-1)[:, ::2]))[:, 0]
        return [Bounded(values[0], change, change) for values, change in zip(found, np.maximum(*late))]

    def rms(self, name: str) -> np.ndarray:
        """Root mean square (n,) about the mean, without the noise: of each gust's window, or of each segment."""
        if self._gusts:
            square = np.array([np.trapezoid(y**2, t) / WINDOW for t, y in self._sections(name)])  # at rest at both ends
        else:
            sections = ((self.time >= start) & (self.time < start + SEGMENT) for start in self.start)
            square = np.array([self.smooth[name][section].var() for section in sections])
        return np.sqrt(np.maximum(square - in_band(self.smooth, name, CUTOFF) ** 2, 0.0))


def register_crosswind(name: str, fixed: bool) -> None:
    """Register a crosswind test whose handwheel is held (``fixed``) or free."""
    register_evaluation(
        name,
        partial(Crosswind, fixed=fixed),
        speed_m_s=100 / 3.6,
        gust_start_s=None,  # of the first gust
        gust_interval_s=8.0,
        gust_count=1,
    )


crosswind_metric = partial(metric, source="after ISO 12021")


@crosswind_metric("m", "crosswind", "crosswind-free")
def crosswind_lateral_deviation(wind: Crosswind) -> Bounded:
    """Lateral deviation from the earlier line 2 s after the gust began: the double integral of lateral acceleration.

    The interval includes the change from a logger's delay of one and a half samples.
    """
    return wind.drift()[1]


@crosswind_metric("deg", "crosswind", "crosswind-free")
def crosswind_course_deviation(wind: Crosswind) -> Bounded:
    """Change of the course angle 2 s after the gust began: the integral of lateral acceleration divided by speed."""
    gained, below, above = wind.drift()[0]
    return Bounded(gained / wind.speed, below / wind.speed, above / wind.speed)


@crosswind_metric("deg/s", "crosswind", "crosswind-free")
def crosswind_yaw_rate_peak(wind: Crosswind) -> np.ndarray:
    """Largest yaw rate in the 3 s from the start of the gust, read where the mean of the gusts is largest.

    It is positive where it turns the car with the wind.
    """
    return wind.peak(YAW)


@crosswind_metric("m/s2", "crosswind", "crosswind-free")
def crosswind_lateral_acceleration_peak(wind: Crosswind) -> np.ndarray:
    """Largest lateral acceleration in the 3 s from the start of a gust, read where the mean of the gusts is largest."""
    return wind.peak(AY)


@crosswind_metric("deg/s", "crosswind", "crosswind-free")
def crosswind_yaw_rate_rms(wind: Crosswind) -> np.ndarray:
    """Root mean square of the yaw rate in the 3 s from the start of a gust, or in each 10 s of random wind.

    White noise, estimated from the part above 10 Hz, is subtracted.
    """
    return wind.rms(YAW)
