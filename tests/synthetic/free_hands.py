"""Release, pulse and returnability of a car that is a second-order system when the hands are off."""

import numpy as np
from scipy import integrate, optimize

from steer_env.recording.recording import DEGREE
from tests.synthetic.recordings import Array, Example, overshoot, recording, second_order, smooth_step

ZETA, OMEGA = 0.3, 2 * np.pi * 0.9  # damping ratio and natural frequency of the yaw rate of a free car [1, rad/s]
EVENT, HELD, EVENTS = 11.0, 4.0, 4  # duration of an event, time before the release [s]; number of events


def _held_and_released(rate: float) -> tuple[Array, Array, Array, Array]:
    """Time, side, held fraction (0 to 1) and time since the release, for events left and right in turn."""
    time = (np.arange(round(EVENTS * EVENT * rate)) + 0.5) / rate  # the release is midway between two samples
    event, s = np.divmod(time, EVENT)
    return time, 1 - 2 * (event % 2), smooth_step(s / 1.5), s - HELD


def release(rate: float) -> Example:
    """A yaw rate of a second-order system that comes to rest at a small value to the other side."""
    held, rest, angle, angle_rest = 2.0 * DEGREE, -0.2 * DEGREE, 8.0 * DEGREE, -0.8 * DEGREE
    time, side, rise, s = _held_and_released(rate)
    free = s >= 0
    back = np.exp(-np.clip(s, 0, None) / 0.08)
    falling = second_order(s, ZETA, OMEGA)
    clean = recording(
        "release",
        time,
        handwheel_angle=side * np.where(free, angle_rest + (angle - angle_rest) * back, angle * rise),
        handwheel_torque=side * np.where(free, 0.0, 1.8 * rise),
        yaw_rate=side * np.where(free, rest + (held - rest) * falling, held * rise),
        lateral_acceleration=side * np.where(free, falling, rise),
        vehicle_speed=np.full(time.size, 100 / 3.6),
    )

    def yaw(t: Array) -> Array:
        return rest + (held - rest) * second_order(t, ZETA, OMEGA)

    t = np.linspace(0, 4, 400_001)
    return clean, {
        "free_damping_ratio": ZETA,
        "free_natural_frequency": OMEGA / (2 * np.pi),
        "residual_yaw_rate": yaw(t)[t >= 3].mean() / DEGREE,
        "residual_handwheel_angle": angle_rest / DEGREE,
        "free_yaw_rate_settling_time": t[np.abs(yaw(t) - rest) > 0.1 * held][-1],
        "yaw_rate_after_1s": 100 * yaw(t)[(t >= 0.9) & (t <= 1.1)].mean() / held,
        "release_overshoot": 100 * overshoot(ZETA),
        "yaw_rate_time_to_half": optimize.brentq(lambda x: yaw(x) - held / 2, 0, 0.6),
    }


def pulse(rate: float) -> Example:
    """A yaw rate that is the impulse response of a second-order system from the middle of the pulse on.

    The torque is a half sine of 0.4 s, which falls through half of its peak at 1/3 of 0.4 s after its middle.
    """
    width, size, interval = 0.4, 5.0 * DEGREE, 7.0
    time = np.arange(round((EVENTS * interval + 1) * rate)) / rate
    event, s = np.divmod(time - 1.0, interval)
    side = np.where(event >= 0, 1 - 2 * (event % 2), 0.0)
    damped = OMEGA * np.sqrt(1 - ZETA**2)

    def response(t: Array) -> Array:
        x = np.clip(t - width / 2, 0, None)
        return size * np.exp(-ZETA * OMEGA * x) * np.sin(damped * x)

    yaw, rest = response(s), 0.5 * DEGREE
    clean = recording(
        "pulse",
        time,
        handwheel_angle=side * (yaw + rest * np.clip(s, 0, 1) ** 2 * (interval - 1.0 - s).clip(0, 1)),
        handwheel_torque=side * np.where(s < width, 2.5 * np.sin(np.pi * s / width), 0.0),
        yaw_rate=side * yaw,
        lateral_acceleration=side * 27.8 * yaw,
        vehicle_speed=np.full(time.size, 100 / 3.6),
    )
    fallen = width * 5 / 6  # the instant from which times count
    t = np.linspace(0, 4, 400_001)
    y = response(t + fallen)
    first = np.arccos(ZETA) / damped  # time of the peak after the middle
    peak = response(first + width / 2)
    left = y[t >= 3].mean()
    return clean, {
        "free_damping_ratio": ZETA,
        "free_natural_frequency": OMEGA / (2 * np.pi),
        "residual_yaw_rate": left / DEGREE,
        "residual_handwheel_angle": (rest + left) / DEGREE,
        "free_yaw_rate_settling_time": t[np.abs(y - left) > 0.1 * peak][-1],
        "pulse_yaw_rate_peak": peak / DEGREE,
        "pulse_overshoot": 100 * overshoot(ZETA),
        "heading_after_pulse": integrate.quad(response, 0, 4 + fallen, limit=200)[0] / DEGREE,
    }


def returnability(rate: float) -> Example:
    """A handwheel that swings back beyond straight ahead and comes to rest 5 deg short of it."""
    time, side, rise, s = _held_and_released(rate)
    free, held, rest, zeta = s >= 0, 90 * DEGREE, 5 * DEGREE, 0.5

    def angle(t: Array) -> Array:
        return rest + (held - rest) * second_order(t, zeta, 2 * np.pi * 0.4)

    clean = recording(
        "returnability",
        time,
        handwheel_angle=side * np.where(free, angle(s), held * rise),
        handwheel_torque=side * np.where(free, 0.0, 2.6 * rise),
        vehicle_speed=np.full(time.size, 35 / 3.6),
    )
    t = np.linspace(0.9, 1.1, 1001)
    begin, end = (optimize.brentq(lambda x, level: angle(x) - level * DEGREE, 0, 0.8, (level,)) for level in (80, 30))
    return clean, {
        "handwheel_angle_after_1s": angle(t).mean() / DEGREE,
        "handwheel_angle_after_3s": angle(t + 2.0).mean() / DEGREE,
        "handwheel_return_rate": 50 / (end - begin),
        "handwheel_return_overshoot": ((held - rest) * overshoot(zeta) - rest) / DEGREE,
    }
