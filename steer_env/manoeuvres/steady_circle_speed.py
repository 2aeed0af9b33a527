"""Steady circle at constant speed."""

import numpy as np

from steer_env.manoeuvres.common.definition import Array, Manoeuvre, register
from steer_env.manoeuvres.common.shapes import straight_ramp

FIND = 4.0  # lateral acceleration with which the rate of the handwheel is found [m/s2]
START, BACK, REST = 2.0, 8.0, 4.0  # straight ahead, return, straight ahead between the sides [s]


@register("steady-circle-speed")
def steady_circle_speed(
    speed_kph: float = 80.0, rise: float = 25.0, beyond: float = 1.95, repeats: int = 1
) -> Manoeuvre:
    """Steady circle, constant speed: the handwheel turns slowly from straight ahead far to the left, then to the right.

    Parameters
    ----------
    speed_kph : float
        80 or 100, in the spirit of the standard [km/h].
    rise : float
        Time from straight ahead to 4 m/s2 [s].
    beyond : float
        Handwheel angle at the end over the angle at 4 m/s2, assumed: about 6.5 m/s2 on a dry road [1].
    repeats : int
        Number of ramps to each side.
    """
    ramp = beyond * rise
    each = ramp + 1.0 + BACK + REST  # the largest angle is held for a second

    def hand(t: Array, amplitude: float) -> tuple[Array, Array]:
        angle, speed = np.zeros_like(t), np.zeros_like(t)
        for i in range(2 * repeats):
            size, s = (-1.0) ** i * beyond * amplitude, t - START - i * each
            out, home = straight_ramp(s, size, ramp), straight_ramp(s - ramp - 1.0, size, BACK - 1.0)
            angle, speed = angle + out[0] - home[0], speed + out[1] - home[1]
        return angle, speed

    return Manoeuvre(
        name="steady-circle-speed",
        hands=f"Handwheel angle rises at a constant rate, to 4 m/s2 in {rise:g} s and on to {beyond:g} times that, "
        "left and right",
        source="after ISO 4138, constant speed",
        speed=speed_kph / 3.6,
        duration=START + 2 * repeats * each,
        hand=hand,
        lateral_acceleration=FIND,
        reach=lambda acceleration: float(acceleration[-1]),
        trial=START + rise,
    )
