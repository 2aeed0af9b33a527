"""On-centre weave."""

import math

from steer_env.friction.numerics.check import positive
from steer_env.manoeuvres.common.definition import Manoeuvre, half_span, register
from steer_env.manoeuvres.common.shapes import sine


@register("weave")
def weave(frequency: float = 0.2, cycles: int = 12, amplitude: float | None = None) -> Manoeuvre:
    """On-centre weave; the metrics leave out the first and the last cycle.

    Parameters
    ----------
    frequency : float
        [Hz]
    cycles : int
    amplitude : float, optional
        Of the handwheel angle [rad]; by default the one with which the car reaches 2 m/s2.

    Raises
    ------
    ValueError
        An amplitude that is not above 0.
    """
    size = "" if amplitude is None else f", {math.degrees(positive('amplitude', amplitude)):.3g} deg"
    return Manoeuvre(
        name="weave",
        hands=f"Sine of handwheel angle{size} at {frequency:g} Hz, {cycles} cycles",
        source="after ISO 13674-1",
        speed=100.0 / 3.6,
        duration=cycles / frequency,
        hand=lambda t, amplitude: sine(t, amplitude, frequency),
        amplitude=amplitude,
        lateral_acceleration=2.0 if amplitude is None else None,
        reach=half_span,
        trial=2.0 / frequency,
        frequency=frequency,
    )
