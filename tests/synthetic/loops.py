"""Loops in closed form: ellipses of a linear car, and parallelograms of a car with dry friction (a rough car)."""

from dataclasses import replace

import numpy as np

from steer_env import metrics
from steer_env.recording.recording import DEGREE, Recording
from steer_env.vehicle.constants import GRAVITY as G
from tests.synthetic.recordings import Answers, Array, Example
from tests.synthetic.recordings import recording as recorded

# A linear car: every channel is a sine, so that every loop is an ellipse.
ANGLE_PEAK, TORQUE_PEAK, AY_PEAK, YAW_PEAK = 17 * DEGREE, 3.2, 2.0, 0.075  # rad, N m, m/s2, rad/s
LEAD, AY_LAG, YAW_LAG = 0.25, 0.150, 0.080  # lead of the torque [rad], lags of the responses at 0.2 Hz [s]
# A car without lag: torque, lateral acceleration and yaw rate per handwheel angle [N m/rad, m/s2/rad, 1/s].
STIFFNESS, AY_GAIN, YAW_GAIN = 8.0, 7.0, 0.25
SPEED = 100 / 3.6


def _recording(time: Array, angle: Array, torque: Array, ay: Array, yaw: Array) -> Recording:
    """A recording of the channels that the loops need, all (T,) in SI."""
    return recorded(
        "weave",
        time,
        {"speed_m_s": SPEED},
        handwheel_angle=angle,
        handwheel_torque=torque,
        lateral_acceleration=ay,
        yaw_rate=yaw,
        vehicle_speed=np.full(time.size, SPEED),
    )


def linear_car(frequency: float = 0.2, cycles: int = 10, size: float = 1.0, rate: float = 100.0) -> Recording:
    """A weave with elliptical loops; ``size`` scales its amplitude."""
    omega = 2 * np.pi * frequency
    time = np.arange(round(cycles / frequency * rate) + 1) / rate
    return _recording(
        time,
        size * ANGLE_PEAK * np.sin(omega * time),
        size * TORQUE_PEAK * np.sin(omega * time + LEAD),
        size * AY_PEAK * np.sin(omega * (time - AY_LAG)),
        size * YAW_PEAK * np.sin(omega * (time - YAW_LAG)),
    )


def linear_car_answers(frequency: float = 0.2, size: float = 1.0) -> Answers:
    """Closed forms for the ellipses, in the reporting units.

    For y = B sin(p + b) over x = A sin(p) the width is 2 B sin(b) at x = 0 and 2 A sin(b) at y = 0; the mean of the
    branches is (B/A) cos(b) x.
    """
    ay_lag, yaw_lag = 2 * np.pi * frequency * AY_LAG, 2 * np.pi * frequency * YAW_LAG
    angle, torque, ay = size * ANGLE_PEAK / DEGREE, size * TORQUE_PEAK, size * AY_PEAK / G  # deg, N m, g
    gradient = torque / ay * np.cos(LEAD + ay_lag)
    sensitivity = 100 * ay / angle / np.cos(ay_lag)
    return {
        "torque_at_0g": torque * np.sin(LEAD + ay_lag),
        "torque_at_0p1g": 0.1 * gradient,
        "torque_gradient_at_0g": gradient,
        "torque_gradient_at_0p1g": gradient,
        "torque_gradient_ratio": 1.0,
        "lateral_acceleration_at_0nm": ay * np.sin(LEAD + ay_lag),
        "angle_hysteresis": 2 * angle * np.sin(ay_lag),
        "angle_deadband": 2 * angle * np.sin(LEAD),
        "torque_deadband": 2 * torque * np.sin(LEAD),
        "steering_stiffness": torque / angle * np.cos(LEAD),
        "steering_sensitivity_at_0p1g": sensitivity,
        "minimum_steering_sensitivity": sensitivity,
        "yaw_rate_gain": YAW_PEAK / ANGLE_PEAK * np.cos(yaw_lag),
        "yaw_lag": 1e3 * YAW_LAG,
        "lateral_acceleration_lag": 1e3 * AY_LAG,
        "work_sensitivity": sensitivity / (0.1 * gradient),
        "peak_handwheel_torque": torque,
        "peak_handwheel_angle": angle,
        "loop_area": np.pi * torque * angle * DEGREE * np.sin(LEAD),
    }


def rough_car(
    friction: float = 0.6,
    slip: float = 0.4 * DEGREE,
    frequency: float = 0.02,
    cycles: int = 5,
    triangle: bool = True,
    rate: float = 100.0,
) -> Recording:
    """A torque k angle plus a spring that slips at ``friction`` [N m] after ``slip`` [rad]; no channel has a lag."""
    time = np.arange(round(cycles / frequency * rate) + 1) / rate
    phase = frequency * time
    wave = np.abs((4 * phase + 3) % 4 - 2) - 1 if triangle else np.sin(2 * np.pi * phase)
    angle = ANGLE_PEAK * wave
    torque, spring = np.empty_like(angle), 0.0
    for k in range(angle.size):
        spring += friction / slip * (angle[k] - angle[max(k - 1, 0)])
        spring = min(max(spring, -friction), friction)
        torque[k] = STIFFNESS * angle[k] + spring
    return _recording(time, angle, torque, AY_GAIN * angle, YAW_GAIN * angle)


def rough_car_answers(friction: float = 0.6, slip: float = 0.4 * DEGREE) -> Answers:
    """Closed forms for the parallelograms: the branches are k angle +- friction except near the turning points."""
    gradient, sensitivity = STIFFNESS / AY_GAIN * G, 100 * AY_GAIN * DEGREE / G
    return {
        "torque_at_0g": friction,
        "torque_at_0p1g": 0.1 * gradient,
        "torque_gradient_at_0g": gradient,
        "torque_gradient_at_0p1g": gradient,
        "torque_gradient_ratio": 1.0,
        "lateral_acceleration_at_0nm": friction / STIFFNESS * AY_GAIN / G,
        "angle_hysteresis": 0.0,
        "angle_deadband": 2 * friction / STIFFNESS / DEGREE,
        "torque_deadband": 2 * friction,
        "steering_stiffness": STIFFNESS * DEGREE,
        "steering_sensitivity_at_0p1g": sensitivity,
        "minimum_steering_sensitivity": sensitivity,
        "yaw_rate_gain": YAW_GAIN,
        "yaw_lag": 0.0,
        "lateral_acceleration_lag": 0.0,
        "work_sensitivity": sensitivity / (0.1 * gradient),
        "peak_handwheel_torque": STIFFNESS * ANGLE_PEAK + friction,
        "peak_handwheel_angle": ANGLE_PEAK / DEGREE,
        "loop_area": 4 * friction * (ANGLE_PEAK - slip),
    }


def _as(test: str, clean: Recording, answers: Answers) -> Example:
    """The recording with the test's name in its meta, and the answers for those metrics that the test reports."""
    named = replace(clean, meta={**clean.meta, "manoeuvre": test})
    return named, {name: answers[name] for name in metrics.available(test) if name in answers}


def weave_of_a_linear_car(rate: float) -> Example:
    """Ellipses at 0.2 Hz, ten settled cycles."""
    return _as("weave", linear_car(cycles=12, rate=rate), linear_car_answers())


def weave_of_a_rough_car(rate: float) -> Example:
    """Parallelograms at 0.2 Hz, ten settled cycles."""
    return _as("weave", rough_car(frequency=0.2, cycles=12, triangle=False, rate=rate), rough_car_answers())


def slow_ramp_of_a_linear_car(rate: float) -> Example:
    """Ellipses at 0.02 Hz, three settled cycles."""
    return _as("slow-ramp", linear_car(0.02, cycles=5, rate=rate), linear_car_answers(0.02))


def slow_ramp_of_a_rough_car(rate: float) -> Example:
    """Parallelograms at 0.02 Hz by a triangle wave, three settled cycles."""
    return _as("slow-ramp", rough_car(rate=rate), rough_car_answers())


def rig(rate: float) -> Example:
    """Parallelograms at 0.2 Hz of a car that stands on a rig."""
    clean, answers = _as("rig", rough_car(frequency=0.2, cycles=12, triangle=False, rate=rate), rough_car_answers())
    return clean.without("lateral_acceleration", "yaw_rate", "vehicle_speed"), answers
