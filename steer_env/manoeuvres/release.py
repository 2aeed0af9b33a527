"""Steering release from a steady turn."""

import numpy as np
from numpy.typing import NDArray

from steer_env.manoeuvres.common.definition import Manoeuvre, register
from steer_env.manoeuvres.common.shapes import ramp_and_hold

Array = NDArray[np.float64]

# Sections of one event; in the pause the robot grips again and runs straight [s].
RISE_TIME, HOLD_TIME, FREE_TIME, PAUSE_TIME = 1.5, 2.5, 5.0, 2.0
EVENT = RISE_TIME + HOLD_TIME + FREE_TIME + PAUSE_TIME  # [s]


def turn_and_release(t: Array, amplitude: float) -> tuple[Array, Array]:
    """Angle and speed of a handwheel that is turned, held and let go, left and right in turn; zero while it is free."""
    event, s = np.divmod(t, EVENT)
    angle, speed = ramp_and_hold(s, amplitude, RISE_TIME)
    held = np.where(s <= RISE_TIME + HOLD_TIME, 1.0 - 2.0 * (event % 2.0), 0.0)
    return held * angle, held * speed


def let_go(events: int) -> tuple[float, ...]:
    """Times at which the hands let go, grip again, let go, ... [s]."""
    return tuple(k * EVENT + RISE_TIME + HOLD_TIME + free for k in range(events) for free in (0.0, FREE_TIME))


@register("release")
def release(lateral_acceleration: float = 1.0, events: int = 4) -> Manoeuvre:
    """Steering release: the hands let go of the handwheel in a steady turn; left and right alternate."""
    return Manoeuvre(
        name="release",
        hands=f"Handwheel turned in {RISE_TIME:g} s, held, let go for {FREE_TIME:g} s, left and right, {events} times",
        source="after ISO 17288-1",
        speed=100.0 / 3.6,
        duration=events * EVENT,
        hand=turn_and_release,
        released=let_go(events),
        lateral_acceleration=lateral_acceleration,
        trial=RISE_TIME + HOLD_TIME,
    )
