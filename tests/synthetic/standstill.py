"""Parking, catch-up and hold: efforts of a standing car in closed form."""

import numpy as np

from steer_env.recording.recording import DEGREE
from tests.synthetic.recordings import Example, recording, smooth_step

LOCK, SWEEP, COUNT = 500 * DEGREE, 12.0, 6  # angle at the lock [rad], time from lock to lock [s], number of half sweeps
SLOW_TORQUE, DAMPING, KNEE = 3.0, 1.5, 4.0  # [N m], [N m s/rad], speed above which the assist falls behind [rad/s]
KEPT_UP = 450 * DEGREE  # speed at which the motor meets its limit [rad/s]


def parking(rate: float) -> Example:
    """An effort F0 + F1 u^2 in the direction of turning, with u from -1 to 1 between the locks, and a torque ripple.

    The handwheel turns at a constant speed and pauses for half a second at the locks. The answers are means over u up
    to 0.95.
    """
    period = SWEEP + 0.5
    time = (np.arange(round((COUNT + 1) * period * rate)) + 0.5) / rate
    sweep, s = np.divmod(time, period)
    side = 1 - 2 * (sweep % 2)
    u = np.clip(2 * s / SWEEP - 1, -1, 1) * np.where(sweep > 0, 1.0, 0.5) + np.where(sweep > 0, 0.0, 0.5)
    turning = np.where(s < SWEEP, side, side * np.exp(-(s - SWEEP) / 0.1))
    ripple, frequency = 0.2, 10 / 3  # one period in a twentieth of the way to the lock [Hz]
    speed = 2 * LOCK / SWEEP
    clean = recording(
        "parking",
        time,
        handwheel_angle=side * LOCK * u,
        handwheel_torque=turning * (3.0 + 1.0 * u**2 + ripple * np.sin(2 * np.pi * frequency * s)),
        rack_force=turning * (2500.0 + 1200.0 * u**2),
        motor_torque=turning * (20.0 + 8.0 * u**2),
        column_speed=np.where(s < SWEEP, side * speed, 0.0),
        vehicle_speed=np.zeros(time.size),
    )
    mean, centre, last = 0.95**2 / 3, 0.05**2 / 3, (0.95**3 - 0.9**3) / 3 / 0.05  # of u^2
    return clean, {
        "parking_handwheel_rate": speed / DEGREE,
        "rack_force_at_centre": 2500.0 + 1200.0 * centre,
        "rack_force_peak": 2500.0 + 1200.0 * last,
        "rack_force_mean_towards_lock": 2500.0 + 1200.0 * mean,
        "handwheel_torque_at_centre": 3.0 + centre,
        "handwheel_torque_mean": 3.0 + mean,
        "handwheel_torque_peak": 3.0 + last,
        "handwheel_torque_ripple": ripple / np.sqrt(2),
        "motor_torque_peak": 20.0 + 8.0 * last,
        "motor_torque_mean": 20.0 + 8.0 * mean,
        "motor_power_peak": speed * (20.0 + 8.0 * last),
    }


def catch_up(rate: float, fastest: float = 700.0) -> Example:
    """Sweeps of constant speed; the torque is constant up to a speed and rises linearly above it.

    The torque changes its sign with the handwheel speed within some hundredths of a second, as a real torque does.
    """
    amplitude = 270 * DEGREE
    speeds = DEGREE * np.repeat([40.0, *np.arange(100.0, fastest + 1, 100.0)], 4)
    knots = np.append(0.0, np.cumsum(2 * amplitude / speeds))
    time = np.arange(0.5 / rate, knots[-1], 1 / rate)
    k = np.clip(np.searchsorted(knots, time) - 1, 0, speeds.size - 1)
    s = (time - knots[k]) / (knots[k + 1] - knots[k])
    side = 1 - 2 * (k % 2)
    effort = SLOW_TORQUE + DAMPING * np.clip(speeds[k] - KNEE, 0, None)
    clean = recording(
        "catch-up",
        time,
        {"motor": {"limit": 20.0}},
        handwheel_angle=side * amplitude * (2 * s - 1),
        handwheel_torque=side * effort * np.tanh(np.minimum(s, 1 - s) / 0.03),
        motor_torque=side * np.minimum(speeds[k] / KEPT_UP, 1.0) * 20.0,
        column_speed=side * speeds[k],
    )
    return clean, {
        "share_at_motor_limit": 3 / 7,  # at 500, 600 and 700 deg/s
        "motor_limit_rate": 500.0,
        # between the sweeps at 300 and at 400 deg/s, both above the knee
        "catch_up_rate": (KNEE + 2.5 / DAMPING) / DEGREE,
        "torque_excess_at_500_deg_s": DAMPING * (500 * DEGREE - KNEE),
        "quasi_static_torque": SLOW_TORQUE,
    }


def hold(rate: float, ripple: float = 0.3) -> Example:
    """A torque that is held for six seconds after a pause and let go, with a ripple of the torsion bar [N m]."""
    time = (np.arange(round(10 * rate)) + 0.5) / rate
    torque = 2.0 * smooth_step((time - 2.0) / 0.5) * (time < 8.5)
    twist = torque + 0.5 * ripple * np.sin(2 * np.pi * 8.0 * time) * (time > 2.5)
    return recording("hold", time, handwheel_torque=torque, torsion_bar_torque=twist), {"torsion_bar_ripple": ripple}


def held(rate: float) -> Example:
    """A held torque at 200 Hz or faster, which ripples up to 40 Hz need, with a ripple that exceeds the noise."""
    return hold(max(rate, 200.0), ripple=0.8)
