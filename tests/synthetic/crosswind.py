"""Crosswind: a car that each gust pushes aside for one period of 1 - cos, with a held or a free handwheel."""

import numpy as np

from steer_env.recording.recording import DEGREE
from tests.synthetic.recordings import Answers, Example, recording

SPEED, COUNT, INTERVAL, START, WIDTH = 100 / 3.6, 8, 8.0, 2.0, 1.0  # speed [m/s], number of gusts, times [s]
META = {"gust_start_s": START, "gust_interval_s": INTERVAL, "gust_count": COUNT, "speed_m_s": SPEED}
PUSH, TURN, TORQUE, ANGLE = 2.0, 4.0 * DEGREE, -0.6, -3.0 * DEGREE  # peaks [SI]


def gusts(rate: float, test: str = "crosswind") -> Example:
    """Gusts to the left and to the right in turn; every sensor has an offset."""
    time = np.arange(round((START + COUNT * INTERVAL) * rate)) / rate
    event, s = np.divmod(time - START, INTERVAL)
    shape = np.where((event >= 0) & (s < WIDTH), 0.5 * (1 - np.cos(2 * np.pi * s / WIDTH)), 0.0) * (1 - 2 * (event % 2))
    fixed = test == "crosswind"
    clean = recording(
        test,
        time,
        META,
        handwheel_angle=0.3 * DEGREE + (0.0 if fixed else ANGLE) * shape,
        handwheel_torque=0.1 + (TORQUE if fixed else 0.0) * shape,
        yaw_rate=0.2 * DEGREE + TURN * shape,
        lateral_acceleration=0.05 + PUSH * shape,
        vehicle_speed=np.full(time.size, SPEED),
    )
    gained = (
        PUSH * WIDTH / 2
    )  # lateral speed after the gust; it moves the car as if gained at once in the gust's middle
    answers: Answers = {
        "crosswind_lateral_deviation": gained * (2.0 - WIDTH / 2),
        "crosswind_course_deviation": gained / SPEED / DEGREE,
        "crosswind_yaw_rate_peak": TURN / DEGREE,
        "crosswind_lateral_acceleration_peak": PUSH,
        "crosswind_yaw_rate_rms": TURN * np.sqrt(3 / 8 * WIDTH / 3.0) / DEGREE,
    }
    if fixed:
        return clean, {**answers, "crosswind_handwheel_torque_peak": -TORQUE}
    return clean, {**answers, "crosswind_handwheel_angle_peak": -ANGLE / DEGREE}


def free(rate: float) -> Example:
    """Gusts with the hands off."""
    return gusts(rate, "crosswind-free")
