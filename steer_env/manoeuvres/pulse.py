"""Steering pulse with free hands."""

import numpy as np
from numpy.typing import NDArray

from steer_env.manoeuvres.common.definition import Manoeuvre, register

Array = NDArray[np.float64]

START, EVENT = 1.0, 7.0  # start of the first pulse, and time from one pulse to the next, assumed [s]


def half_sines(t: Array, amplitude: float, width: float) -> tuple[Array, Array]:
    """Half sines of hand torque, alternately to the left and to the right, and zeros."""
    event, s = np.divmod(t - START, EVENT)
    pulse = (event >= 0.0) & (s < width)
    return np.where(pulse, amplitude * (1.0 - 2.0 * (event % 2.0)) * np.sin(np.pi * s / width), 0.0), np.zeros_like(t)


@register("pulse")
def pulse(torque: float = 2.5, width: float = 0.5, events: int = 4) -> Manoeuvre:
    """Steering pulse: straight ahead a half sine of hand torque, then free hands; left and right alternate."""
    return Manoeuvre(
        name="pulse",
        hands=f"Half sine of hand torque, {torque:g} N m in {width:g} s, then free; left and right, {events} times",
        source="after ISO 17288-2; torque and width assumed",
        speed=100.0 / 3.6,
        duration=START + events * EVENT,
        hand=lambda t, amplitude: half_sines(t, amplitude, width),
        robot=False,
        amplitude=torque,
    )
