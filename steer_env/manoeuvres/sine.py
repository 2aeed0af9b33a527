"""Sine steering."""

import numpy as np

from steer_env.manoeuvres.common.definition import Array, Manoeuvre, half_span, register
from steer_env.manoeuvres.common.shapes import ease_clock

START, EASE, REST = 1.0, 0.2, 3.0  # straight ahead, smooth start and end of the sine, straight ahead after it [s]


@register("sine")
def sine(frequency: float = 0.5, cycles: int = 3, repeats: int = 1) -> Manoeuvre:
    """Sine steering: bursts of a sine with the full amplitude from the first half wave on."""
    each = cycles / frequency + EASE + REST
    omega = 2.0 * np.pi * frequency

    def hand(t: Array, amplitude: float) -> tuple[Array, Array]:
        angle, speed = np.zeros_like(t), np.zeros_like(t)
        for i in range(repeats):
            clock, rate = ease_clock(t - START - i * each, cycles / frequency, EASE)
            angle += amplitude * np.sin(omega * clock)
            speed += amplitude * omega * np.cos(omega * clock) * rate
        return angle, speed

    return Manoeuvre(
        name="sine",
        hands=f"Sine of handwheel angle at {frequency:g} Hz, {cycles} cycles",
        source="after ISO 7401",
        speed=80.0 / 3.6,
        duration=START + repeats * each,
        hand=hand,
        lateral_acceleration=4.0,
        reach=half_span,
        trial=START + cycles / frequency,
        frequency=frequency,
    )
