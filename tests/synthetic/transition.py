"""Transition of a car with given dead bands."""

import numpy as np

from steer_env.recording.recording import DEGREE, Recording
from steer_env.vehicle.constants import GRAVITY as G
from tests.synthetic.recordings import Answers, Example, recording

PEAK, RISE = 16 * DEGREE, 10.0  # [rad], [s]
DEAD = {"yaw_rate": 0.4 * DEGREE, "lateral_acceleration": 0.6 * DEGREE}  # handwheel angle [rad]
GAIN = {"yaw_rate": 0.28, "lateral_acceleration": 8.0}  # slope over the handwheel angle outside the dead band [SI]
# Torque at which the response begins [N m], and its slope over the lateral acceleration from there [N m s2/m].
TORQUE, GRADIENT = 0.7, 1.2
SPEED = 100 / 3.6


def transitions(rate: float, repeats: int = 4, rise: float = RISE, peak: float = PEAK) -> Recording:
    """Slow ramps of the handwheel to the left and to the right in turn, with dead bands in angle and torque."""
    one = np.cumsum([0.0, 3.0, rise, 2.0, 6.0])
    n = 2 * repeats
    time = np.arange(round((n * one[-1] + 3.0) * rate) + 1) / rate
    angle = np.zeros(time.size)
    for i in range(n):
        angle += (-1) ** i * np.interp(time - i * one[-1], one, [0.0, 0.0, peak, peak, 0.0])
    channels = {
        name: GAIN[name] * np.sign(angle) * np.maximum(np.abs(angle) - dead, 0.0) for name, dead in DEAD.items()
    }
    rubbing = TORQUE * np.clip(angle / (0.3 * DEGREE), -1, 1)
    return recording(
        "transition",
        time,
        handwheel_angle=angle,
        handwheel_torque=rubbing + GRADIENT * channels["lateral_acceleration"],
        vehicle_speed=np.full(time.size, SPEED),
        **channels,
    )


def transition_answers() -> Answers:
    """Closed forms in the reporting units; the yaw rate leaves its dead band before the lateral acceleration does."""
    gap = DEAD["lateral_acceleration"] - DEAD["yaw_rate"]
    sensitivity = GAIN["lateral_acceleration"] * 100 * DEGREE / G
    return {
        "yaw_rate_transition_angle_deadband": DEAD["yaw_rate"] / DEGREE,
        "lateral_acceleration_transition_angle_deadband": DEAD["lateral_acceleration"] / DEGREE,
        "yaw_rate_transition_torque_deadband": TORQUE - GRADIENT * GAIN["lateral_acceleration"] * gap,
        "lateral_acceleration_transition_torque_deadband": TORQUE,
        "transition_torque_gradient_near_centre": GRADIENT * G,
        "transition_torque_gradient_at_1m_s2": GRADIENT * G,
        "transition_torque_at_1m_s2": TORQUE + GRADIENT,
        "transition_sensitivity_near_centre": sensitivity,
        "transition_sensitivity_at_1m_s2": sensitivity,
        "transition_yaw_rate_gain": GAIN["yaw_rate"],
    }


def transition(rate: float) -> Example:
    """A recording of eight ramps, four to each side."""
    return transitions(rate), transition_answers()
