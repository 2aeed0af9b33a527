"""Step steer of a car whose responses are second-order systems."""

import numpy as np
from scipy.optimize import brentq

from steer_env.recording.recording import DEGREE, Recording
from steer_env.vehicle.constants import GRAVITY as G
from tests.synthetic.recordings import Answers, Array, Example, overshoot, recording, second_order

SIZE, RISE, HOLD, STRAIGHT = 0.6, 0.2, 5.0, 4.0  # angle [rad], times [s]
# Steady value [SI], damping ratio [1], natural frequency [rad/s].
YAW, AY, SLIP, TORQUE = (0.18, 0.45, 5.0), (4.0, 0.65, 5.0), (-0.02, 0.7, 4.0), (3.4, 0.8, 9.0)
SPEED = 80 / 3.6


def steps(rate: float, repeats: int = 3, size: float = 1.0, rise: float = RISE) -> Recording:
    """Steps to the left and to the right in turn, and back; a response starts when half of the angle is reached."""
    each = RISE + HOLD + 1.0 + STRAIGHT
    time = np.arange(round((1.0 + 2 * repeats * each) * rate) + 1) / rate
    names = {"yaw_rate": YAW, "lateral_acceleration": AY, "sideslip_angle": SLIP, "handwheel_torque": TORQUE}
    channels = {name: np.zeros(time.size) for name in ("handwheel_angle", *names)}
    for i in range(2 * repeats):
        side, start = size * (-1.0) ** i, 1.0 + i * each
        out, home = (np.clip((time - t) / d, 0, 1) for t, d in ((start, rise), (start + rise + HOLD, 1.0)))
        channels["handwheel_angle"] += side * SIZE * (out - home)
        for name, (steady, *system) in names.items():
            middles = start + rise / 2, start + rise + HOLD + 0.5
            on, off = (1.0 - second_order(time - t, *system) for t in middles)
            channels[name] += side * steady * (on - off)
    channels["vehicle_speed"] = np.full(time.size, SPEED)
    return recording("step-steer", time, **channels)


def step_answers() -> Answers:
    """Closed forms of the step responses, in the reporting units."""
    found = {
        "yaw_rate_step_gain": YAW[0] / SIZE,
        "lateral_acceleration_step_gain": AY[0] / SIZE * 100 * DEGREE / G,
        "steady_step_torque": TORQUE[0],
        "steady_step_sideslip": SLIP[0] / DEGREE,
    }
    for name, (_, zeta, omega) in (("yaw_rate", YAW), ("lateral_acceleration", AY)):
        peak = np.pi / (omega * np.sqrt(1.0 - zeta**2))
        found[f"{name}_peak_time"] = peak
        found[f"{name}_overshoot"] = overshoot(zeta)

        def at(level: float, low: float, high: float, zeta: float = zeta, omega: float = omega) -> float:
            return float(brentq(lambda t: float(_risen(t, zeta, omega)) - level, low, high))

        found[f"{name}_time_to_90"] = at(0.9, 0.0, peak)
        found[f"{name}_rise_time"] = at(0.9, 0.0, peak) - at(0.1, 0.0, peak)
        under = found[f"{name}_overshoot"] ** 2 > 0.05  # whether the second extreme also leaves the band
        found[f"{name}_settling_time"] = at(0.95, 2 * peak, 3 * peak) if under else at(1.05, peak, 2 * peak)
    found["tb_factor"] = found["yaw_rate_peak_time"] * abs(found["steady_step_sideslip"])
    return dict(found)


def _risen(t: float, zeta: float, omega: float) -> Array:
    return 1.0 - second_order(np.array(t), zeta, omega)


def step_steer(rate: float) -> Example:
    """A recording of six steps, three to each side."""
    return steps(rate), step_answers()
