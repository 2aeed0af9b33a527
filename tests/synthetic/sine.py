"""Sine steering of a car whose responses have a gain and a delay."""

import numpy as np

from steer_env.recording.recording import DEGREE, Recording
from steer_env.vehicle.constants import GRAVITY as G
from tests.synthetic.recordings import Answers, Array, Example, recording

ANGLE, FREQUENCY = 0.65, 0.5  # [rad], [Hz]
YAW, AY, TORQUE = (0.2, 0.05), (4.0, 0.15), (3.1, 0.02)  # peak [SI], delay [s]
FIRST = 1.1  # ratio of the first half wave to the others [1]
SPEED = 80 / 3.6


def sines(rate: float, bursts: int = 3, cycles: int = 3, size: float = 1.0, frequency: float = FREQUENCY) -> Recording:
    """Bursts of a sine with pauses; the responses are delayed, and their first half wave is higher."""
    each = cycles / frequency + 3.0
    time = np.arange(round((1.0 + bursts * each) * rate) + 1) / rate

    def wave(delay: float, first: float = 1.0) -> Array:
        s = np.mod(time - 1.0 - delay, each)
        on = (time > 1.0 + delay) & (s < cycles / frequency)
        return np.where(on, np.where(s < 0.5 / frequency, first, 1.0) * np.sin(2 * np.pi * frequency * s), 0.0)

    return recording(
        "sine",
        time,
        handwheel_angle=size * ANGLE * wave(0.0),
        yaw_rate=size * YAW[0] * wave(YAW[1], FIRST),
        lateral_acceleration=size * AY[0] * wave(AY[1], FIRST),
        handwheel_torque=size * TORQUE[0] * wave(TORQUE[1]),
        vehicle_speed=np.full(time.size, SPEED),
    )


def sine_answers() -> Answers:
    """Closed forms in the reporting units."""
    omega = 2 * np.pi * FREQUENCY
    return {
        "yaw_rate_sine_gain": YAW[0] / ANGLE,
        "yaw_rate_sine_lag": 1e3 * YAW[1],
        "yaw_rate_first_peak_ratio": FIRST,
        "lateral_acceleration_sine_gain": AY[0] / ANGLE * 100 * DEGREE / G,
        "lateral_acceleration_sine_lag": 1e3 * AY[1],
        "lateral_acceleration_first_peak_ratio": FIRST,
        "lateral_acceleration_sine_hysteresis": 2 * ANGLE / DEGREE * np.sin(omega * AY[1]),
        "yaw_rate_sine_hysteresis": 2 * ANGLE / DEGREE * np.sin(omega * YAW[1]),
        "torque_sine_gain": TORQUE[0] / ANGLE * DEGREE,
    }


def sine(rate: float) -> Example:
    """A recording of three bursts of three cycles."""
    return sines(rate), sine_answers()
