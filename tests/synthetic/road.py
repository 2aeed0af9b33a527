"""Free driving of a car whose torque is a spring, a damper and dry friction, and whose lateral acceleration lags."""

import numpy as np
from scipy import signal

from steer_env import manoeuvres
from steer_env.recording.recording import DEGREE
from steer_env.vehicle.constants import GRAVITY as G
from tests.synthetic.recordings import Answers, Array, Example, recording

FINE = 1000.0  # rate at which friction and lag are computed [Hz]
SPEED, DURATION = 80.0 / 3.6, 240.0  # [m/s], [s]
STIFFNESS, DAMPING, FRICTION = 0.2 / DEGREE, 1.5, 0.3  # [N m/rad], [N m s/rad], level [N m]
DISTANCE = 0.4 * DEGREE  # of pre-sliding [rad]
GAIN, LAG = 12.0, 0.1  # lateral acceleration over handwheel angle [m/s2/rad], time constant [s]


def answers() -> Answers:
    """Those of a loop that is swept slowly, by hand."""
    stiffness = STIFFNESS * DEGREE
    return {
        "road_torque_deadband": 2.0 * FRICTION,
        "road_angle_deadband": 2.0 * FRICTION / stiffness,
        "road_steering_stiffness": stiffness,
        "road_steering_stiffness_60_to_90_kph": stiffness,
        "road_torque_at_0g": FRICTION,
        "road_torque_gradient_at_0g": STIFFNESS / GAIN * G,
        "road_torque_gradient_60_to_90_kph": STIFFNESS / GAIN * G,
        "road_lateral_acceleration_at_0nm": FRICTION * GAIN / STIFFNESS / G,
        "road_steering_stiffness_30_to_60_kph": "at 30 to 60 km/h",
        "road_torque_gradient_90_to_130_kph": "at 90 to 130 km/h",
    }


def friction(angle: Array) -> Array:
    """Dahl's torque (T,) over its level along an angle (T,), exact between the samples [1]."""
    ratio, d = np.diff(angle) / DISTANCE, 0.0
    found = np.zeros(angle.size)
    for i, (side, kept) in enumerate(zip(np.sign(ratio).tolist(), np.exp(-np.abs(ratio)).tolist())):
        d = side + (d - side) * kept
        found[i + 1] = d
    return found


def road(rate: float, seed: int = 0, noise: float = 0.0) -> Example:
    """Four minutes; every seed gives another steering.

    Parameters
    ----------
    rate : float
        [Hz].
    seed : int
    noise : float
        Standard deviation of what the road adds to the torque below about 1 Hz [N m].
    """
    time = np.arange(0.0, DURATION, 1.0 / FINE)
    angle, speed = manoeuvres.make("road", seed=seed, duration=DURATION).hand(time, 1.0)
    rest = signal.lfilter(*signal.butter(1, 1.0, fs=FINE), np.random.default_rng([seed, 1]).standard_normal(time.size))
    torque = STIFFNESS * angle + DAMPING * speed + FRICTION * friction(angle) + noise * rest / np.std(rest)
    decay = np.exp(-1.0 / (LAG * FINE))
    acceleration = signal.lfilter([1.0 - decay], [1.0, -decay], GAIN * angle)
    every = slice(None, None, round(FINE / rate))
    made = {
        "handwheel_angle": angle,
        "handwheel_torque": torque,
        "vehicle_speed": np.full(time.size, SPEED),
        "lateral_acceleration": acceleration,
        "yaw_rate": acceleration / SPEED,
    }
    return recording("road", time[every], **{name: values[every] for name, values in made.items()}), answers()
