"""Linear-quadratic preview control: its gains, and a driver that prescribes the handwheel angle by it.

Such a driver is called every ``UPDATE_INTERVAL`` with the time and the car's channels, and returns the handwheel angle
and speed at the end of the interval that begins.
"""

import math
from collections.abc import Callable

import control
import numpy as np
from numpy.typing import NDArray

from steer_env.drivers.common.definition import ARM_DAMPING, ARM_FREQUENCY, DELAY, MUSCLE_LAG
from steer_env.episode.timing import UPDATE_INTERVAL
from steer_env.friction.numerics.check import number
from steer_env.vehicle import plant
from steer_env.vehicle.analysis import linear
from steer_env.vehicle.cars import Car

Array = NDArray[np.float64]
Driver = Callable[[float, Array], tuple[float, float]]  # time [s], channels (C,) -> angle [rad], speed [rad/s]

PREVIEW_TIME = 1.5  # [s]
# Lateral offset that costs as much as one radian of handwheel angle, without arms, assumed [m/rad].
EFFORT = 0.03


def sampled_model(model: linear.LinearSingleTrack, samples: int) -> tuple[Array, Array, Array]:
    """The linear car behind muscles, arms and a delay, sampled at 10 ms: z+ = A z + B u.

    The command reaches the muscles after ``samples`` updates; the muscles follow it with a first-order lag, and the
    handwheel angle follows the muscles as a second-order lag.

    Returns
    -------
    A : (Z, Z) array
        z = (v_y, r, y, psi, angle, angle', muscles, commands in the delay line).
    B : (Z, 1) array
    arms : (3, 4) array
        Handwheel angle, its speed and the muscles one update later, from these and the command that takes effect.
    """
    body, v = model.state_space("handwheel"), model.speed
    omega = 2.0 * math.pi * ARM_FREQUENCY
    A, B = np.zeros((7, 7)), np.zeros((7, 1))
    A[:2, :2], A[:2, 4:5] = body.A, body.B
    A[2, [0, 3]], A[3, 1] = (1.0, v), 1.0
    A[4, 5], A[5, 4:] = 1.0, (-(omega**2), -2.0 * ARM_DAMPING * omega, omega**2)
    A[6, 6], B[6] = -1.0 / MUSCLE_LAG, 1.0 / MUSCLE_LAG
    sampled = control.c2d(control.ss(A, B, np.eye(7), np.zeros((7, 1))), UPDATE_INTERVAL)
    n = 7 + samples
    whole, enters = np.zeros((n, n)), np.zeros((n, 1))
    whole[:7, :7], whole[:7, 7:8] = sampled.A, sampled.B
    whole[7:-1, 8:], enters[-1] = np.eye(samples - 1), 1.0
    return whole, enters, np.column_stack([sampled.A[4:, 4:], sampled.B[4:]])


def gains(
    model: linear.LinearSingleTrack,
    preview_time: float = PREVIEW_TIME,
    delay: float = DELAY,
    effort: float = EFFORT,
) -> tuple[Array, Array, Array]:
    """Gains of the linear-quadratic preview driver, and how the arms follow its command.

    With the model z+ = A z + B u of :func:`sampled_model`,

        u = -K z + sum g_i y_path(k + i),    least sum of (y - y_path)^2 + (effort u)^2

    with K from the Riccati equation and g_i = (R + B'P B)^-1 B' (A - B K)'^(i-1) q, where q is the cost's row of y.
    This equals the result of the shift register in Sharp's preview control without its hundred states.

    Returns
    -------
    K : (Z,) array
        On z.
    g : (N,) array
        On the path's lateral offset 1 to N samples ahead.
    arms : (3, 4) array
        Handwheel angle, its speed and the muscles one update later, from these and the command that takes effect.

    Raises
    ------
    ValueError
        The preview is not longer than the delay and the arms' lag, or a value is out of range.

    Source: Sharp, Valtetsis, Optimal preview car steering control, Vehicle System Dynamics 35 (supplement), 2001.
    Deviations: the model contains the delay and the arms; the cost contains the lateral offset alone, not the heading.
    """
    samples = round(number("delay [s]", delay, minimum=UPDATE_INTERVAL, maximum=0.5) / UPDATE_INTERVAL)
    ahead = round(number("preview_time [s]", preview_time, minimum=delay + 0.3, maximum=5.0) / UPDATE_INTERVAL)
    R = number("effort [m/rad]", effort, minimum=0.0, above=True) ** 2
    whole, enters, arms = sampled_model(model, samples)
    offset = np.zeros(len(whole))
    offset[2] = 1.0
    K, P, _ = control.dlqr(whole, enters, np.outer(offset, offset), R)
    closed = whole - enters @ K
    g, column = np.zeros(ahead), enters[:, 0] / (enters.T @ P @ enters + R)[0, 0]
    for i in range(ahead):
        g[i] = column @ offset
        column = closed @ column
    return K[0], g, arms


class _Preview:
    """A preview driver; its memory is handwheel angle and speed, muscles, and the commands in the delay line."""

    def __init__(self, p: plant.Plant, path: Array, K: Array, g: Array, arms: Array) -> None:
        at = {name: i for i, (name, _) in enumerate(plant.channels(p))}
        self._pose = [at[name] for name in ("x", "y", "yaw_angle")]
        self._motion = [at[name] for name in ("lateral_speed", "yaw_rate")]
        self._speed = at.get("longitudinal_speed")
        self._held, self._path, self._g, self._arms = plant.initial_speed(p), path, g, arms
        # In the car's frame its own y and psi are zero.
        self._on_motion, self._on_memory = K[:2], K[4:]
        self._memory = np.zeros(K.size - 4)
        self._times = UPDATE_INTERVAL * np.arange(1, g.size + 1)

    def __call__(self, time: float, row: Array) -> tuple[float, float]:
        x, y, yaw = row[self._pose]
        speed = self._held if self._speed is None else row[self._speed]
        ahead, left = self._path[:, 0] - x, self._path[:, 1] - y
        c, s = math.cos(yaw), math.sin(yaw)
        seen = np.interp(speed * self._times, c * ahead + s * left, c * left - s * ahead)
        command = self._g @ seen - self._on_motion @ row[self._motion] - self._on_memory @ self._memory
        hand = self._arms @ self._memory[:4]
        self._memory = np.concatenate((hand, self._memory[4:], [command]))
        return float(hand[0]), float(hand[1])


def preview(
    car: Car,
    p: plant.Plant,
    path: Array,
    preview_time: float = PREVIEW_TIME,
    delay: float = DELAY,
    effort: float = EFFORT,
) -> Driver:
    """A driver who follows a path by preview control.

    Parameters
    ----------
    car : Car
    p : Plant
        A plant of that car; the gains are for the speed at which it starts.
    path : (N, 2) array
        x, y of the centre of gravity [m]. Ahead of the car and behind it, the path must not turn back.
    preview_time, delay : float
        Time that the driver looks ahead, and delay of the hands [s].
    effort : float
        Lateral offset that costs as much as one radian of handwheel angle [m/rad].

    Raises
    ------
    ValueError
        As :func:`gains`.
    """
    model = linear.from_car(car, plant.initial_speed(p))
    return _Preview(p, path, *gains(model, preview_time, delay, effort))
