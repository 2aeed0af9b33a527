"""Steady circles: how handwheel angle, torque, sideslip angle and roll angle rise with lateral acceleration.

At a constant radius the speed rises slowly; at a constant speed the handwheel angle rises slowly. Every such ramp, to
either side, is a repeat. Gradients are slopes of straight lines over the lateral acceleration from 1 to 4 m/s2 (below
1 m/s2 the car enters the circle), and from 5.5 to 6.5 m/s2 for the gradients at 6 m/s2.
"""

from collections.abc import Callable, Mapping
from functools import partial
from operator import methodcaller
from typing import Any

import numpy as np
from scipy.stats import norm

from steer_env.metrics.common import ramps
from steer_env.metrics.common.definitions import SPEED_SPREAD, Bounded, RefusedError, declare, metric
from steer_env.metrics.common.filtered_channels import ANGLE, AY, ROLL, SPEED, TORQUE, YAW, FilteredChannels
from steer_env.metrics.common.kept import kept
from steer_env.metrics.common.noise import white
from steer_env.recording.recording import Recording

CUTOFF = 1.0  # low-pass; the tests are quasi-static [Hz]
LINEAR, HIGH = (1.0, 4.0), (5.5, 6.5)  # ranges of lateral acceleration of the fits; assumed [m/s2]
QUICKEST = 0.5  # fastest rise of the lateral acceleration at which the car is nearly steady; assumed [m/s3]
RADIUS_SPREAD = 0.05  # largest deviation from the prescribed radius, as a fraction of it; assumed [1]
SOURCE = "after ISO 4138"
TESTS = ("steady-circle", "steady-circle-speed")
Channel = str | Callable[[FilteredChannels], np.ndarray]


class Circles:
    """The ramps into circles; the methods return one value for each ramp, (n,).

    ``constant`` is "radius" or "speed".
    """

    def __init__(self, recording: Recording, conditions: Mapping[str, Any], constant: str) -> None:
        self._smooth, self._conditions, self.constant = FilteredChannels(recording, CUTOFF), conditions, constant
        self.ramps = ramps.find(self._smooth.time, self._smooth[AY])
        if self.gradient(ANGLE).mean() <= 0 and constant == "speed":
            raise RefusedError(f"{AY} does not follow {ANGLE}: check the signs, a left turn is positive in both")
        for ramp, band in self._all(LINEAR):
            self._check(ramp, band)

    @kept
    def _all(self, level: tuple[float, float]) -> list[tuple[ramps.Ramp, slice]]:
        """Every ramp with the samples in which its lateral acceleration is in a range [m/s2].

        Refused where a ramp does not cover the range.
        """
        found = []
        for ramp in self.ramps:
            part = ramps.rising_section(ramp.side * self._smooth[AY][ramp.start : ramp.end], *level)
            if part is not None:
                found.append((ramp, slice(ramp.start + part.start, ramp.start + part.stop)))
        if not found or len(found) < len(self.ramps):
            most = np.abs(self._smooth[AY]).max()
            raise RefusedError(
                f"lateral_acceleration reaches {most:.2f} m/s2, but not every ramp covers {level[0]:g} to {level[1]:g} "
                "m/s2: continue each ramp until it does"
            )
        return found

    def _check(self, ramp: ramps.Ramp, band: slice) -> None:
        """Refuse a ramp that is too fast, or that does not keep the radius or the speed."""
        time = self._smooth.time[band]
        rise = (LINEAR[1] - LINEAR[0]) / np.ptp(time)
        if rise > QUICKEST:
            raise RefusedError(f"lateral_acceleration rises by {rise:.2f} m/s3: let it rise by {QUICKEST:g} or less")
        if self.constant == "radius":
            curvature = ramp.side * self._smooth[YAW][band] / self._smooth[SPEED][band]
            radius = self._conditions["radius_m"]
            least, most = (float(np.quantile(curvature * radius, q)) for q in (0.05, 0.95))
            if not 1 - RADIUS_SPREAD < least <= most < 1 + RADIUS_SPREAD:
                raise RefusedError(
                    f"speed over yaw rate is {radius / most:.4g} to {radius / least:.4g} m, not {radius:g} m "
                    f"+- {RADIUS_SPREAD:.0%}: hold the circle, or give radius_m=..."
                )
        elif SPEED in self._smooth:
            ratio = self._smooth[SPEED][band] / self._conditions["speed_m_s"]
            if np.abs(ratio - 1).max() > SPEED_SPREAD:
                raise RefusedError(f"{SPEED} deviates by over {SPEED_SPREAD:.0%} in the turn: hold it constant")

    def _slope(self, channel: Channel, ramp: ramps.Ramp, band: slice) -> float:
        values = channel(self._smooth) if callable(channel) else self._smooth[channel]
        ay = self._smooth[AY][band]
        return float(np.polyfit(ay - ay.mean(), values[band], 1)[0])

    @kept
    def gradient(self, channel: Channel, level: tuple[float, float] = LINEAR) -> np.ndarray:
        """Slopes (n,) of a channel over the lateral acceleration [SI]."""
        return np.array([self._slope(channel, ramp, band) for ramp, band in self._all(level)])

    def understeer(self, level: tuple[float, float] = LINEAR) -> np.ndarray:
        """Understeer gradients (n,), at the road wheels [rad s2/m]."""
        path = 0.0
        if self.constant == "speed":
            speed = self._smooth[SPEED].mean() if SPEED in self._smooth else self._conditions["speed_m_s"]
            path = self._geometry("wheelbase_m") / speed**2
        return self.gradient(ANGLE, level) / self._geometry("steering_ratio") - path

    def _geometry(self, name: str) -> float:
        value = self._conditions[name]
        if not value:
            raise RefusedError(f"{name} is not known: give it in the meta or as a condition")
        return float(value)

    def signed_root(self, sign: float) -> np.ndarray:
        """sqrt(wheelbase / |K|) (n,) [m/s]; refused where the understeer gradient K has not the given sign."""
        K = self.understeer()
        if sign * K.mean() <= 0:
            other = "understeers: it has a characteristic speed" if sign < 0 else "oversteers: it has a critical speed"
            raise RefusedError(f"the car {other} instead")
        if np.any(sign * K <= 0):
            raise RefusedError("the car is neutral within the scatter of the repeats: repeat more often")
        return np.sqrt(self._geometry("wheelbase_m") / np.abs(K))

    def highest(self) -> Bounded:
        """Highest lateral acceleration (n,) of each circle as a mean over one second [m/s2].

        Among similar seconds noise decides which one is the highest. The lower bound includes that bias.
        """
        time, ay = self._smooth.time, self._smooth.recording[AY]
        second = max(round(1.0 / (time[1] - time[0])), 1)
        noise = white(self._smooth, AY, CUTOFF) / np.sqrt(second)
        ends = [ramp.start for ramp in self.ramps[1:]] + [time.size]
        means = [ramps.running_mean(r.side * ay[r.start : end], second) for r, end in zip(self.ramps, ends)]
        similar = np.mean([np.count_nonzero(mean > mean.max() - 4.0 * noise) for mean in means]) / second
        return Bounded(np.array([mean.max() for mean in means]), noise * norm.isf(0.5 / max(2.0 * similar, 1.0)), 0.0)


_circle_metric = partial(metric, source=SOURCE)


def _steering_wheel_gradient(quantity: str, unit: str, channel: str) -> None:
    """Declare the gradient of what the hands hold, over the linear range and at 6 m/s2."""
    name = f"steering_wheel_{quantity}_gradient"
    text = f"Slope of the handwheel {quantity} over the lateral acceleration"
    declare(name, unit, f"{text}.", methodcaller("gradient", channel), *TESTS, source=SOURCE)
    high = f"{text} from 5.5 to 6.5 m/s2."
    declare(f"{name}_at_6m_s2", unit, high, methodcaller("gradient", channel, HIGH), *TESTS, source=SOURCE)


@_circle_metric("deg/g", *TESTS)
def understeer_gradient(circles: Circles) -> np.ndarray:
    """Slope of the handwheel angle divided by the steering ratio, minus the slope of wheelbase over radius."""
    return circles.understeer()


@_circle_metric("deg/g", *TESTS)
def understeer_gradient_at_6m_s2(circles: Circles) -> np.ndarray:
    """Understeer gradient from 5.5 to 6.5 m/s2."""
    return circles.understeer(HIGH)


_steering_wheel_gradient("angle", "deg/g", ANGLE)


@_circle_metric("deg/g", *TESTS)
def sideslip_gradient(circles: Circles) -> np.ndarray:
    """Slope of the sideslip angle over the lateral acceleration; negative where the nose points into the circle."""
    return circles.gradient(FilteredChannels.sideslip)


@_circle_metric("deg/g", *TESTS)
def roll_gradient(circles: Circles) -> np.ndarray:
    """Slope of the roll angle over the lateral acceleration; positive where the body leans out of the circle."""
    return circles.gradient(ROLL)


_steering_wheel_gradient("torque", "N m/g", TORQUE)


@_circle_metric("km/h", *TESTS)
def characteristic_speed(circles: Circles) -> np.ndarray:
    """Speed at which an understeering car needs twice the angle of a neutral car: root of wheelbase over gradient."""
    return circles.signed_root(1.0)


@_circle_metric("km/h", *TESTS)
def critical_speed(circles: Circles) -> np.ndarray:
    """Speed above which an oversteering car is unstable: root of wheelbase over the size of the gradient."""
    return circles.signed_root(-1.0)


@_circle_metric("g", *TESTS)
def highest_lateral_acceleration(circles: Circles) -> Bounded:
    """Highest lateral acceleration of each circle as a mean over one second; the car may be capable of more.

    The interval reaches down by the amount that noise adds to the highest of several similar seconds.
    """
    return circles.highest()
