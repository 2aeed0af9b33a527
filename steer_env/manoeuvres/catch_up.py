"""Catch-up: sweeps of the handwheel that are so fast that the assist may fall behind."""

import numpy as np
from numpy.typing import NDArray

from steer_env.manoeuvres.common.definition import Manoeuvre, register
from steer_env.manoeuvres.common.shapes import ramp_and_hold
from steer_env.recording.recording import DEGREE

Array = NDArray[np.float64]

BLUNT = 0.95  # rounding of the corners: the hands reverse with about 160 rad/s2 at 700 deg/s [1]
SLOW_SWEEP_RATE = 45.0 * DEGREE  # rate of the slow sweeps with which the others are compared, assumed [rad/s]
RATES = tuple(rate * DEGREE for rate in (100.0, 200.0, 300.0, 400.0, 500.0, 600.0, 700.0))
AMPLITUDE = 270.0 * DEGREE  # assumed [rad]


def _sweeps(rates: tuple[float, ...], amplitude: float, cycles: int) -> tuple[Array, Array]:
    """Knots (K,) of time [s] and phase [rad]; the rate changes where the handwheel reverses."""
    each = np.concatenate([[SLOW_SWEEP_RATE], np.repeat([SLOW_SWEEP_RATE, *rates], 2 * cycles), [SLOW_SWEEP_RATE]])
    phase = np.pi * np.append(0.5, np.ones(each.size - 2))
    omega = each[:-1] * np.arcsin(BLUNT) / (amplitude * BLUNT)
    return np.append(0.0, np.cumsum(phase / omega)), np.append(0.0, np.cumsum(phase))


@register("catch-up")
def catch_up(
    rates: tuple[float, ...] = RATES, amplitude: float = AMPLITUDE, speed: float = 0.0, cycles: int = 1
) -> Manoeuvre:
    """Catch-up: sweeps to and fro at increasing speeds, with the car standing or rolling slowly."""
    time, phase = _sweeps(rates, amplitude, cycles)

    def hand(t: Array, amplitude: float) -> tuple[Array, Array]:
        now = np.interp(t, time, phase)
        omega = (np.diff(phase) / np.diff(time))[np.clip(np.searchsorted(time, t) - 1, 0, time.size - 2)]
        s, scale = BLUNT * np.sin(now), amplitude / np.arcsin(BLUNT)
        first = ramp_and_hold(t, amplitude, time[1])  # a smooth start
        then = scale * np.arcsin(s), scale * BLUNT * omega * np.cos(now) / np.sqrt(1.0 - s * s)
        return np.where(t < time[1], first[0], then[0]), np.where(t < time[1], first[1], then[1])

    fastest = max(rates) / DEGREE
    return Manoeuvre(
        name="catch-up",
        hands=f"Sweeps of +-{amplitude / DEGREE:.0f} deg at {SLOW_SWEEP_RATE / DEGREE:.0f} "
        f"and up to {fastest:.0f} deg/s",
        source="catch-up test of steering-feel practice",
        speed=speed,
        duration=float(time[-1]),
        hand=hand,
        amplitude=amplitude,
        chassis="two_track",
    )
