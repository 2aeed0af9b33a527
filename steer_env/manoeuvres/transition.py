"""Transition from straight ahead into a turn."""

import numpy as np

from steer_env.manoeuvres.common.definition import Array, Manoeuvre, register
from steer_env.manoeuvres.common.shapes import straight_ramp

START, HOLD, BACK, REST = 2.0, 1.5, 5.0, 3.0  # straight ahead, hold, return, straight ahead between the ramps [s]


@register("transition")
def transition(rise: float = 10.0, repeats: int = 2, lateral_acceleration: float = 2.0) -> Manoeuvre:
    """Transition: the handwheel leaves straight ahead so slowly that the car follows at once; left and right alternate.

    Parameters
    ----------
    rise : float
        Duration of a ramp [s]. In 10 s at 100 km/h the usual rate is about 1.5 deg/s; the standard's limit is 5 deg/s.
    repeats : int
        Number of ramps to each side.
    lateral_acceleration : float
        Lateral acceleration at the end of a ramp, 1.5 to 2 [m/s2].
    """
    each = rise + HOLD + BACK + REST

    def hand(t: Array, amplitude: float) -> tuple[Array, Array]:
        angle, speed = np.zeros_like(t), np.zeros_like(t)
        for i in range(2 * repeats):
            size, s = (-1.0) ** i * amplitude, t - START - i * each
            out, home = straight_ramp(s, size, rise), straight_ramp(s - rise - HOLD, size, BACK - 0.5)
            angle, speed = angle + out[0] - home[0], speed + out[1] - home[1]
        return angle, speed

    return Manoeuvre(
        name="transition",
        hands=f"Handwheel angle rises at a constant rate in {rise:g} s, {repeats} times to the left and to the right",
        source="after ISO 13674-2",
        speed=100.0 / 3.6,
        duration=START + 2 * repeats * each,
        hand=hand,
        lateral_acceleration=lateral_acceleration,
        reach=lambda acceleration: float(acceleration[-1]),
        trial=START + rise + HOLD,
    )
