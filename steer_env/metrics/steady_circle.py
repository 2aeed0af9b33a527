"""Steady circles: how handwheel angle, torque, sideslip and roll rise with lateral acceleration.

On a constant radius the speed rises slowly, at constant speed the handwheel angle. Every way into the circle, to either
side, is a repeat. Gradients are slopes of straight lines over the lateral acceleration from 1 to 4 m/s2 (below, the car
enters the circle), and from 5.5 to 6.5 m/s2 for those at 6 m/s2.
"""

from collections.abc import Callable, Mapping
from functools import partial
from typing import Any

import numpy as np
from scipy.stats import norm

from steer_env.metrics.common import ramps
from steer_env.metrics.common.definitions import SPEED_SPREAD, Bounded, RefusedError, metric, procedure
from steer_env.metrics.common.noise import white
from steer_env.metrics.common.reading import ANGLE, AY, ROLL, SPEED, TORQUE, YAW, Reading
from steer_env.recording.recording import Recording

CUTOFF = 1.0  # low-pass; the tests are quasi-static [Hz]
LINEAR, HIGH = (1.0, 4.0), (5.5, 6.5)  # lateral acceleration of the fits; assumed [m/s2]
QUICKEST = 0.5  # rise of the lateral acceleration up to which the car is nearly steady; assumed [m/s3]
RADIUS_SPREAD = 0.05  # of the radius around the one asked for; assumed
SOURCE = "after ISO 4138"
TESTS = ("steady-circle", "steady-circle-speed")
Channel = str | Callable[[Reading], np.ndarray]


class Circles:
    """The ways into circles; readings have one value each, (n,)."""

    def __init__(self, recording: Recording, asked: Mapping[str, Any], constant: str) -> None:
        self._smooth, self._asked, self.constant = Reading(recording, CUTOFF), asked, constant
        self.ramps = ramps.find(self._smooth.time, self._smooth[AY])
        self._bands = self._all(LINEAR)
        if np.mean([self._slope(ANGLE, ramp, band) for ramp, band in self._bands]) <= 0 and constant == "speed":
            raise RefusedError(f"{AY} does not follow {ANGLE}: check the signs, a left turn is positive in both")
        for ramp, band in self._bands:
            self._check(ramp, band)

    def _all(self, level: tuple[float, float]) -> list[tuple[ramps.Ramp, slice]]:
        """The ramps with the samples in which each has a lateral acceleration."""
        found = []
        for ramp in self.ramps:
            part = ramps.within(ramp.side * self._smooth[AY][ramp.start : ramp.end], *level)
            if part is not None:
                found.append((ramp, slice(ramp.start + part.start, ramp.start + part.stop)))
        if not found or len(found) < len(self.ramps):
            most = np.abs(self._smooth[AY]).max()
            raise RefusedError(
                f"lateral_acceleration gets to {most:.2f} m/s2, not from {level[0]:g} to {level[1]:g} m/s2 every time: "
                "drive on until it does"
            )
        return found

    def _check(self, ramp: ramps.Ramp, band: slice) -> None:
        time = self._smooth.time[band]
        rise = (LINEAR[1] - LINEAR[0]) / np.ptp(time)
        if rise > QUICKEST:
            raise RefusedError(f"lateral_acceleration rises by {rise:.2f} m/s3: let it rise by {QUICKEST:g} or less")
        if self.constant == "radius":
            curvature = ramp.side * self._smooth[YAW][band] / self._smooth[SPEED][band]
            radius = self._asked["radius_m"]
            least, most = (float(np.quantile(curvature * radius, q)) for q in (0.05, 0.95))
            if not 1 - RADIUS_SPREAD < least <= most < 1 + RADIUS_SPREAD:
                raise RefusedError(
                    f"speed over yaw rate is {radius / most:.4g} to {radius / least:.4g} m, not {radius:g} m "
                    f"+- {RADIUS_SPREAD:.0%}: hold the circle, or say radius_m"
                )
        elif SPEED in self._smooth:
            ratio = self._smooth[SPEED][band] / self._asked["speed_m_s"]
            if np.abs(ratio - 1).max() > SPEED_SPREAD:
                raise RefusedError(f"{SPEED} strays by over {SPEED_SPREAD:.0%} in the turn: hold it constant")

    def _slope(self, channel: Channel, ramp: ramps.Ramp, band: slice) -> float:
        values = channel(self._smooth) if callable(channel) else self._smooth[channel]
        ay = self._smooth[AY][band]
        return float(np.polyfit(ay - ay.mean(), values[band], 1)[0])

    def gradient(self, channel: Channel, level: tuple[float, float] = LINEAR) -> np.ndarray:
        """Slopes (n,) of a channel over the lateral acceleration [SI]."""
        return np.array([self._slope(channel, ramp, band) for ramp, band in self._all(level)])

    def understeer(self, level: tuple[float, float] = LINEAR) -> np.ndarray:
        """Understeer gradients (n,), at the road wheels [rad s2/m]."""
        path = 0.0
        if self.constant == "speed":
            speed = self._smooth[SPEED].mean() if SPEED in self._smooth else self._asked["speed_m_s"]
            path = self._geometry("wheelbase_m") / speed**2
        return self.gradient(ANGLE, level) / self._geometry("steering_ratio") - path

    def _geometry(self, name: str) -> float:
        value = self._asked[name]
        if not value:
            raise RefusedError(f"neither meta nor condition says {name}: give it")
        return float(value)

    def signed_root(self, sign: float) -> np.ndarray:
        """sqrt(wheelbase / |K|) (n,) where the understeer gradient K has the sign asked for [m/s]."""
        K = self.understeer()
        if sign * K.mean() <= 0:
            other = "understeers: it has a characteristic speed" if sign < 0 else "oversteers: it has a critical speed"
            raise RefusedError(f"the car {other} instead")
        if np.any(sign * K <= 0):
            raise RefusedError("the car is neutral within the scatter of the repeats: repeat more often")
        return np.sqrt(self._geometry("wheelbase_m") / np.abs(K))

    def highest(self) -> Bounded:
        """Highest lateral acceleration (n,) of each circle in a mean over a second [m/s2].

        Of seconds that are alike the highest is one that noise favours: by so much the truth may lie below.
        """
        time, ay = self._smooth.time, self._smooth.recording[AY]
        second = max(round(1.0 / (time[1] - time[0])), 1)
        noise = white(self._smooth, AY, CUTOFF) / np.sqrt(second)
        ends = [ramp.start for ramp in self.ramps[1:]] + [time.size]
        means = [ramps.running_mean(r.side * ay[r.start : end], second) for r, end in zip(self.ramps, ends)]
        alike = np.mean([np.count_nonzero(mean > mean.max() - 4.0 * noise) for mean in means]) / second
        return Bounded(np.array([mean.max() for mean in means]), noise * norm.isf(0.5 / max(2.0 * alike, 1.0)), 0.0)


procedure(
    "steady-circle",
    partial(Circles, constant="radius"),
    constant_speed=False,
    radius_m=100.0,
    wheelbase_m=None,
    steering_ratio=None,
)
procedure(
    "steady-circle-speed",
    partial(Circles, constant="speed"),
    speed_m_s=80 / 3.6,
    wheelbase_m=None,
    steering_ratio=None,
)


def _circle_metric(unit: str, **more: Any) -> Callable:
    return metric(unit, *TESTS, **{"source": SOURCE, **more})


@_circle_metric("deg/g")
def understeer_gradient(circles: Circles) -> np.ndarray:
    """Slope of the handwheel angle over the steering ratio, less that of wheelbase over radius."""
    return circles.understeer()


@_circle_metric("deg/g")
def understeer_gradient_at_6m_s2(circles: Circles) -> np.ndarray:
    """Understeer gradient from 5.5 to 6.5 m/s2."""
    return circles.understeer(HIGH)


@_circle_metric("deg/g")
def steering_wheel_angle_gradient(circles: Circles) -> np.ndarray:
    """Slope of the handwheel angle over the lateral acceleration."""
    return circles.gradient(ANGLE)


@_circle_metric("deg/g")
def steering_wheel_angle_gradient_at_6m_s2(circles: Circles) -> np.ndarray:
    """Slope of the handwheel angle over the lateral acceleration from 5.5 to 6.5 m/s2."""
    return circles.gradient(ANGLE, HIGH)


@_circle_metric("deg/g")
def sideslip_gradient(circles: Circles) -> np.ndarray:
    """Slope of the sideslip angle over the lateral acceleration; negative where the nose turns into the circle."""
    return circles.gradient(Reading.sideslip)


@_circle_metric("deg/g")
def roll_gradient(circles: Circles) -> np.ndarray:
    """Slope of the roll angle over the lateral acceleration; positive where the body leans out of the circle."""
    return circles.gradient(ROLL)


@_circle_metric("N m/g")
def steering_wheel_torque_gradient(circles: Circles) -> np.ndarray:
    """Slope of the handwheel torque over the lateral acceleration."""
    return circles.gradient(TORQUE)


@_circle_metric("N m/g")
def steering_wheel_torque_gradient_at_6m_s2(circles: Circles) -> np.ndarray:
    """Slope of the handwheel torque over the lateral acceleration from 5.5 to 6.5 m/s2."""
    return circles.gradient(TORQUE, HIGH)


@_circle_metric("km/h")
def characteristic_speed(circles: Circles) -> np.ndarray:
    """Speed at which an understeering car needs twice the angle of a neutral one: root of wheelbase over gradient."""
    return circles.signed_root(1.0)


@_circle_metric("km/h")
def critical_speed(circles: Circles) -> np.ndarray:
    """Speed from which on an oversteering car is unstable: root of wheelbase over the size of the gradient."""
    return circles.signed_root(-1.0)


@_circle_metric("g")
def highest_lateral_acceleration(circles: Circles) -> Bounded:
    """Highest lateral acceleration of each circle, in a mean over a second; the car may be capable of more.

    The interval reaches down by what noise adds to the highest of alike seconds.
    """
    return circles.highest()
