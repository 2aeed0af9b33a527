"""Metrics of lane changes: whether the car passes the cones, at what speed, and how far hands and car must move."""

from functools import partial
from typing import Any

import numpy as np
from scipy.integrate import trapezoid

from steer_env.metrics.common.definitions import Array, Bounded, metric, register_evaluation
from steer_env.metrics.common.filtered_channels import ANGLE, AY, TORQUE, YAW
from steer_env.metrics.common.lane_change import NEEDED, RATE, Passes

TESTS = ("double-lane-change", "obstacle-avoidance")
_PLACE: dict[str, Any] = dict.fromkeys(NEEDED) | {"entry_yaw_rad": 0.0, "mirrored": False, "vehicle_centre_m": 0.0}
PLOTS = (("x", "y"), ("time", ANGLE), ("time", TORQUE), ("time", AY))


def register_lane_change(name: str, **conditions: Any) -> None:
    """Register a lane change whose course has the test's name, with conditions besides the place of the course."""
    read = partial(Passes, name=name)
    register_evaluation(name, read, constant_speed=False, plots=PLOTS, **conditions, **_PLACE)


SOURCE = "after ISO 3888-1 and ISO 3888-2"
PRACTICE = "lane-change tests of steering-feel practice"


@metric("1", *TESTS, source=SOURCE)
def course_completed(passes: Passes) -> Array:
    """1 for a pass that reaches the last cones with the middle of the car between the lanes' edges, 0 for any other."""
    return passes.completed()


@metric("1", *TESTS, source=SOURCE)
def cones_hit(passes: Passes) -> Bounded:
    """Number of cones whose base the outline of the car, a rectangle, sweeps over.

    The interval includes the cones that are doubtful because of the noise of the position.
    """
    fewest, hit, most = (
        np.array([np.count_nonzero(margins < limit) for margins in passes.margins])
        for limit in (-passes.margin_bias, 0.0, passes.margin_bias)
    )
    return Bounded(hit, float(np.mean(hit - fewest)), float(np.mean(most - hit)))


@metric("m", *TESTS, source=SOURCE)
def smallest_cone_margin(passes: Passes) -> Bounded:
    """Least distance between the outline of the car and a cone; where a cone gets into the outline, minus its depth.

    Noise makes a least value too low; the interval reaches up by that amount.
    """
    return Bounded(np.array([margins.min() for margins in passes.margins]), 0.0, passes.margin_bias)


@metric("km/h", *TESTS, source=SOURCE)
def lane_change_entry_speed(passes: Passes) -> Array:
    """Speed at which the front of the car passes the first cones, as a mean over 0.2 s."""
    return passes.speed(0)


@metric("km/h", *TESTS, source=SOURCE)
def lane_change_exit_speed(passes: Passes) -> Array:
    """Speed at which the rear of the car passes the last cones, as a mean over 0.2 s."""
    return passes.speed(1)


@metric("m/s2", *TESTS, source=PRACTICE)
def lane_change_lateral_acceleration(passes: Passes) -> Array:
    """Largest lateral acceleration, to either side."""
    return passes.peak(AY)


@metric("deg/s", *TESTS, source=PRACTICE)
def lane_change_yaw_rate(passes: Passes) -> Array:
    """Largest yaw rate, to either side."""
    return passes.peak(YAW)


@metric("deg", *TESTS, source=PRACTICE)
def lane_change_handwheel_angle(passes: Passes) -> Array:
    """Largest handwheel angle, to either side."""
    return passes.peak(ANGLE)


@metric("deg/s", *TESTS, source=PRACTICE)
def lane_change_handwheel_speed(passes: Passes) -> Array:
    """Largest handwheel speed, in either direction."""
    return passes.peak(RATE)


@metric("N m", *TESTS, source=PRACTICE)
def lane_change_handwheel_torque(passes: Passes) -> Array:
    """Largest hand torque, to either side."""
    return passes.peak(TORQUE)


@metric("N m", *TESTS, source=PRACTICE)
def lane_change_torque_rms(passes: Passes) -> Array:
    """Root mean square of the hand torque; white noise, estimated from the part above 10 Hz, is subtracted."""
    return passes.rms(TORQUE)


@metric("J", *TESTS, source=PRACTICE)
def lane_change_steering_effort(passes: Passes) -> Array:
    """Integral of |hand torque x handwheel speed| over time: the work of the hands on the handwheel and against it."""
    pairs = zip(passes.steered(TORQUE), passes.steered(RATE))
    return np.array([trapezoid(np.abs(T * rate), t) for (t, T), (_, rate) in pairs])


@metric("ms", *TESTS, source=PRACTICE)
def lane_change_yaw_lag(passes: Passes) -> Array:
    """Delay of the yaw rate behind the handwheel angle at which the two correlate best, between -0.2 and 0.6 s."""
    return passes.lag(YAW)
