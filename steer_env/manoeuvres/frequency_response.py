"""Frequency response by a swept sine."""

import numpy as np

from steer_env.manoeuvres.common.definition import Array, Manoeuvre, register
from steer_env.manoeuvres.common.shapes import ease_clock

START, EASE, REST = 1.0, 0.5, 3.0  # straight ahead, smooth start and end of a sweep, straight ahead after it [s]


@register("frequency-response")
def frequency_response(
    lowest: float = 0.1,
    highest: float = 3.0,
    duration: float = 40.0,
    sweeps: int = 4,
    lateral_acceleration: float = 2.0,
) -> Manoeuvre:
    """Swept sine: in each sweep the frequency of the handwheel rises linearly at a constant amplitude.

    Parameters
    ----------
    lowest, highest : float
        Frequency at the start and at the end of a sweep [Hz]; the metrics read from 0.2 Hz to the highest.
    duration : float
        Duration of a sweep [s]; it is increased to whole half waves, so that a sweep ends straight ahead.
    sweeps : int
        Number of sweeps.
    lateral_acceleration : float
        Lateral acceleration in the slow part of a sweep, assumed: the tyres remain nearly linear [m/s2].
    """
    mean = 0.5 * (lowest + highest)
    duration = np.ceil(2.0 * mean * duration) / (2.0 * mean)  # whole half waves
    climb = (highest - lowest) / duration
    each = duration + EASE + REST

    def hand(t: Array, amplitude: float) -> tuple[Array, Array]:
        angle, speed = np.zeros_like(t), np.zeros_like(t)
        for i in range(sweeps):
            clock, rate = ease_clock(t - START - i * each, duration, EASE)
            phase = 2.0 * np.pi * (lowest + 0.5 * climb * clock) * clock
            angle += amplitude * np.sin(phase)
            speed += amplitude * np.cos(phase) * 2.0 * np.pi * (lowest + climb * clock) * rate
        return angle, speed

    return Manoeuvre(
        name="frequency-response",
        hands=f"Swept sine of handwheel angle, {lowest:g} to {highest:g} Hz in {duration:.0f} s, {sweeps} sweeps",
        source="after ISO 7401 and ISO/TR 8726",
        speed=80.0 / 3.6,
        duration=START + sweeps * each,
        hand=hand,
        lateral_acceleration=lateral_acceleration,
        reach=lambda acceleration: 0.5 * float(np.ptp(acceleration)),
        trial=START + 8.0,  # the slow first cycle
        meta={"highest_hz": highest},
    )
