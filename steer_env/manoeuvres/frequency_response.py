"""Frequency response by a swept sine."""

import numpy as np

from steer_env.manoeuvres.common.definition import Array, Manoeuvre, register
from steer_env.manoeuvres.common.shapes import eased

START, EASE, REST = 1.0, 0.5, 3.0  # straight before, smooth start and end of a sweep, straight after [s]


@register("frequency-response")
def frequency_response(
    lowest: float = 0.1,
    highest: float = 3.0,
    duration: float = 40.0,
    sweeps: int = 4,
    lateral_acceleration: float = 2.0,
) -> Manoeuvre:
    """Swept sine: the handwheel's frequency rises steadily at a constant amplitude, sweep after sweep.

    Parameters
    ----------
    lowest, highest : float
        Frequency at the start and at the end of a sweep [Hz]; the metrics read from 0.2 Hz to the highest.
    duration : float
        Of a sweep; made longer by up to a cycle, so that it ends straight ahead [s].
    sweeps : int
    lateral_acceleration : float
        Reached in the slow part of the sweep, assumed: the tyres stay nearly linear [m/s2].
    """
    mean = 0.5 * (lowest + highest)
    duration = np.ceil(2.0 * mean * duration) / (2.0 * mean)  # whole half waves
    climb = (highest - lowest) / duration
    each = duration + EASE + REST

    def hand(t: Array, amplitude: float) -> tuple[Array, Array]:
        angle, speed = np.zeros_like(t), np.zeros_like(t)
        for i in range(sweeps):
            clock, rate = eased(t - START - i * each, duration, EASE)
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
