"""Parking: the effort of turning the handwheel from lock to lock while the car stands.

A repeat is a half sweep, from the last sample at one end of the handwheel's travel to the first sample at the other
end; 5 % of the way from the centre to the lock is left out at each end. The first turn into a lock does not count.
Values are positive where they resist the turning handwheel (rack force) or act in its direction (torques, power), so
that noise does not add to a mean. A peak is the mean over the twentieth of the way from centre to lock in which the
mean of all half sweeps is highest, so that neither a single sample nor the noise of one sweep determines it.
"""

from collections.abc import Mapping
from functools import partial
from typing import Any

import numpy as np
from scipy import signal
from scipy.integrate import cumulative_trapezoid

from steer_env.metrics.common.definitions import RefusedError, metric, register_evaluation
from steer_env.metrics.common.filtered_channels import ANGLE, SPEED, TORQUE, FilteredChannels
from steer_env.recording.recording import Recording

CUTOFF = 10.0  # low-pass [Hz]
AT_LOCK = 0.998  # samples above this fraction of the largest angle show where the lock is; assumed [1]
END = 0.95  # fraction of the way from centre to lock that counts [1]
CENTRE = 0.05  # half width of the range around the centre, as a fraction of the way from centre to lock [1]
PARTS = 38  # sections of a half sweep, each a twentieth of the way from centre to lock
RIPPLE = 1.0  # frequency above which effort counts as ripple; assumed [Hz]
STANDING = 0.3  # highest speed of a car that stands; assumed [m/s]
FEWEST = 2  # half sweeps
SOURCE = "parking test of steering-feel practice"


class Sweeps:
    """The half sweeps from lock to lock; refused where there are fewer than two, or where the car moves."""

    def __init__(self, recording: Recording, conditions: Mapping[str, Any]) -> None:
        self._smooth, self.time = FilteredChannels(recording, CUTOFF), recording.time
        if SPEED in self._smooth and np.abs(self._smooth[SPEED]).max() > STANDING:
            raise RefusedError(f"{SPEED} exceeds {STANDING:g} m/s: let the car stand")
        angle = self._smooth[ANGLE]
        left, right = (  # medians, because the largest angle alone would contain noise
            sign * np.median(side[side >= AT_LOCK * side.max()]) for sign, side in ((1, angle), (-1, -angle))
        )
        lock = 0.5 * (left - right)
        travel = (angle - 0.5 * (left + right)) / max(lock, 1e-9)
        ends = np.flatnonzero(np.abs(travel) >= END)
        crossed = np.flatnonzero(travel[ends[:-1]] * travel[ends[1:]] < 0) if lock > 0 else np.zeros(0, int)
        self._sweeps = [slice(int(a), int(b) + 1) for a, b in zip(ends[crossed], ends[crossed + 1])]
        if len(self._sweeps) < FEWEST:
            raise RefusedError(f"{len(self._sweeps)} half sweeps from lock to lock: steer {FEWEST} or more")
        self.side = [np.sign(travel[sweep.stop - 1] - travel[sweep.start]) for sweep in self._sweeps]
        self.travel = [side * travel[sweep] for side, sweep in zip(self.side, self._sweeps)]  # from -1 to 1 [1]

    def along(self, name: str) -> list[np.ndarray]:
        """A channel in each half sweep, positive in the direction of the turning handwheel."""
        return [side * self._smooth[name][sweep] for side, sweep in zip(self.side, self._sweeps)]

    def effort(self, name: str) -> list[np.ndarray]:
        """A channel as in :meth:`along` that must act in the handwheel's direction; refused where it opposes it."""
        found = self.along(name)
        if any(values.mean() < 0 for values in found):
            raise RefusedError(f"{name} runs against the turning {ANGLE}: check the signs, left is positive in both")
        return found

    def _between(self, efforts: list[np.ndarray], edges: np.ndarray) -> np.ndarray:
        """Means over time (n, E - 1) between consecutive places (E,) of the travel, with linear interpolation."""
        found = []
        for travel, values, sweep in zip(self.travel, efforts, self._sweeps):
            time = self.time[sweep]
            at = np.interp(edges, np.maximum.accumulate(travel), time)
            found.append(np.diff(np.interp(at, time, cumulative_trapezoid(values, time, initial=0.0))) / np.diff(at))
        return np.array(found)

    def mean(self, name: str, low: float = -END, high: float = END) -> np.ndarray:
        """Mean (n,) between two places of the travel, -1 where a half sweep begins and 1 where it ends."""
        return self._between(self.effort(name), np.array([low, high]))[:, 0]

    def peak(self, efforts: list[np.ndarray]) -> np.ndarray:
        """Mean (n,) over the section of the travel in which the mean of all half sweeps is highest."""
        if min(map(len, efforts)) < PARTS:
            raise RefusedError("the sweeps are too fast for their sampling rate: record faster, or steer more slowly")
        found = self._between(efforts, np.linspace(-END, END, PARTS + 1))
        return found[:, np.argmax(found.mean(axis=0))]

    def ripple(self, name: str) -> np.ndarray:
        """Root mean square (n,) from 1 to 10 Hz, without the noise."""
        rate, found = self._smooth.recording.rate, []
        self.effort(name)
        for side, sweep in zip(self.side, self._sweeps):
            edge = (sweep.stop - sweep.start) // 10
            values = side * self._smooth.recording[name][sweep.start + edge : sweep.stop - edge]
            if values.size <= rate / RIPPLE:
                raise RefusedError(f"a half sweep takes less than {1 / RIPPLE:g} s: steer more slowly")
            f, density = signal.periodogram(values, rate, window="hann", detrend="linear")
            inside = (f >= RIPPLE) & (f <= CUTOFF)
            noise = np.median(density[f > CUTOFF]) / np.log(2.0)  # the density of noise has an exponential distribution
            found.append((density[inside] - noise).sum() * f[1])
        return np.sqrt(np.maximum(found, 0.0))

    def rate(self) -> np.ndarray:
        """Mean speed (n,) of the handwheel [rad/s]."""
        ends = [(sweep.start, sweep.stop - 1) for sweep in self._sweeps]
        return np.array([abs(np.diff(self._smooth[ANGLE][[a, b]])[0]) / (self.time[b] - self.time[a]) for a, b in ends])


register_evaluation("parking", Sweeps, constant_speed=False)

_parking = partial(metric, source=SOURCE)


@_parking("deg/s", "parking", usual=(60.0, 90.0))
def parking_handwheel_rate(sweeps: Sweeps) -> np.ndarray:
    """Mean speed of the handwheel."""
    return sweeps.rate()


@_parking("N", "parking")
def rack_force_at_centre(sweeps: Sweeps) -> np.ndarray:
    """Mean rack force within 5 % of the travel around the centre."""
    return sweeps.mean("rack_force", -CENTRE, CENTRE)


@_parking("N", "parking")
def rack_force_peak(sweeps: Sweeps) -> np.ndarray:
    """Highest mean rack force over a twentieth of the way from centre to lock, clear of the end stops."""
    return sweeps.peak(sweeps.effort("rack_force"))


@_parking("N", "parking")
def rack_force_mean_towards_lock(sweeps: Sweeps) -> np.ndarray:
    """Mean rack force on the way from the centre to the lock."""
    return sweeps.mean("rack_force", 0.0)


@_parking("N m", "parking")
def handwheel_torque_at_centre(sweeps: Sweeps) -> np.ndarray:
    """Mean hand torque within 5 % of the travel around the centre."""
    return sweeps.mean(TORQUE, -CENTRE, CENTRE)


@_parking("N m", "parking")
def handwheel_torque_mean(sweeps: Sweeps) -> np.ndarray:
    """Mean hand torque of a half sweep, which is the effort of parking."""
    return sweeps.mean(TORQUE)


@_parking("N m", "parking")
def handwheel_torque_peak(sweeps: Sweeps) -> np.ndarray:
    """Highest mean hand torque over a twentieth of the way from centre to lock, clear of the end stops."""
    return sweeps.peak(sweeps.effort(TORQUE))


@_parking("N m", "parking")
def handwheel_torque_ripple(sweeps: Sweeps) -> np.ndarray:
    """Root mean square of the hand torque between 1 and 10 Hz in the middle 80 % of a half sweep, with Hann's window.

    White noise, estimated from the part above 10 Hz, is subtracted.
    """
    return sweeps.ripple(TORQUE)


@_parking("N m", "parking")
def motor_torque_peak(sweeps: Sweeps) -> np.ndarray:
    """Highest mean torque of the assist motor, at the column, over a twentieth of the way from centre to lock."""
    return sweeps.peak(sweeps.effort("motor_torque"))


@_parking("N m", "parking")
def motor_torque_mean(sweeps: Sweeps) -> np.ndarray:
    """Mean torque of the assist motor, at the column."""
    return sweeps.mean("motor_torque")


@_parking("W", "parking")
def motor_power_peak(sweeps: Sweeps) -> np.ndarray:
    """Highest mean mechanical power of the assist motor over a twentieth of the way from centre to lock."""
    speed, torque = sweeps.along("column_speed"), sweeps.effort("motor_torque")
    return sweeps.peak([a * b for a, b in zip(speed, torque)])
