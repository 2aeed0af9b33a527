"""Steady circles of a car whose angles and torque are polynomials of the lateral acceleration."""

from collections.abc import Sequence

import numpy as np

from steer_env.recording.recording import DEGREE, Recording
from steer_env.vehicle.constants import GRAVITY as G
from tests.synthetic.recordings import Answers, Example, recording

RATIO, WHEELBASE, RADIUS, SPEED = 15.0, 2.5, 100.0, 80 / 3.6
K, OVERSTEER = 0.0045, -0.002  # understeer gradients [rad s2/m]
BEND = 0.002  # curvature of the handwheel angle above 5 m/s2 [rad s4/m2]
SLIP, ROLL, TORQUE, FRICTION = -0.006, 0.011, 0.6, 0.9  # gradients [SI], friction [N m]
HIGHEST, RISE, HELD = 7.0, 50.0, 3.0  # lateral acceleration [m/s2], times [s]
GEOMETRY = {"wheelbase_m": WHEELBASE, "steering_ratio": RATIO}


def circles(
    rate: float,
    constant: str,
    repeats: int = 2,
    understeer: float = K,
    sides: Sequence[int] = (1, -1),
    highest: float = HIGHEST,
    rise: float = RISE,
) -> Recording:
    """Ramps of the lateral acceleration from straight ahead that are held and return, to the given sides in turn."""
    start = 0.5 if constant == "radius" else 0.0
    one = np.cumsum([0.0, 4.0, 2.0, rise, HELD, 6.0])
    levels = [0.0, 0.0, start, highest, highest, 0.0]
    n = repeats * len(sides)
    time = np.arange(round((n * one[-1] + 4.0) * rate) + 1) / rate
    size = np.zeros(time.size)
    side = np.ones(time.size)
    for i in range(n):
        inside = (time >= i * one[-1]) & (time < (i + 1) * one[-1])
        size[inside] = np.interp(time[inside] - i * one[-1], one, levels)
        side[inside] = sides[i % len(sides)]
    speed = np.sqrt(np.maximum(size, start) * RADIUS) if constant == "radius" else np.full(time.size, SPEED)
    path = WHEELBASE * size / speed**2
    angle = RATIO * (path + understeer * size) + BEND * np.maximum(size - 5.0, 0.0) ** 2
    return recording(
        "steady-circle" if constant == "radius" else "steady-circle-speed",
        time,
        GEOMETRY,
        handwheel_angle=side * angle,
        lateral_acceleration=side * size,
        yaw_rate=side * size / speed,
        vehicle_speed=speed,
        handwheel_torque=side * (TORQUE * size + FRICTION * np.tanh(size / 0.2)),
        sideslip_angle=side * SLIP * size,
        roll_angle=side * ROLL * size,
    )


def circle_answers(path: float, understeer: float = K) -> Answers:
    """Closed forms in the reporting units; the mean slope of a parabola from 5.5 to 6.5 is its slope at 6."""
    per_g, bend = G / DEGREE, 2 * BEND * 1.0
    root = 3.6 * np.sqrt(WHEELBASE / abs(understeer))
    return {
        "understeer_gradient": understeer * per_g,
        "understeer_gradient_at_6m_s2": (understeer + bend / RATIO) * per_g,
        "steering_wheel_angle_gradient": RATIO * (understeer + path) * per_g,
        "steering_wheel_angle_gradient_at_6m_s2": (RATIO * (understeer + path) + bend) * per_g,
        "sideslip_gradient": SLIP * per_g,
        "roll_gradient": ROLL * per_g,
        "steering_wheel_torque_gradient": TORQUE * G,
        "steering_wheel_torque_gradient_at_6m_s2": TORQUE * G,
        "characteristic_speed": root if understeer > 0 else "the car oversteers: it has a critical speed instead",
        "critical_speed": root if understeer < 0 else "the car understeers: it has a characteristic speed instead",
        "highest_lateral_acceleration": HIGHEST / G,
    }


def constant_radius(rate: float) -> Example:
    """Four circles of 100 m, two to each side."""
    return circles(rate, "radius"), circle_answers(0.0)


def constant_speed(rate: float) -> Example:
    """Four circles at 80 km/h, two to each side."""
    return circles(rate, "speed"), circle_answers(WHEELBASE / SPEED**2)


def oversteering(rate: float) -> Example:
    """Four circles of 100 m by a car that oversteers."""
    return circles(rate, "radius", understeer=OVERSTEER), circle_answers(0.0, OVERSTEER)
