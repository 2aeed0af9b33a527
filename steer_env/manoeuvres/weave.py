"""On-centre weave."""

from steer_env.manoeuvres.common.definition import Manoeuvre, half_span, register
from steer_env.manoeuvres.common.shapes import sine


@register("weave")
def weave(frequency: float = 0.2, cycles: int = 12) -> Manoeuvre:
    """On-centre weave; the metrics leave out the first and the last cycle."""
    return Manoeuvre(
        name="weave",
        hands=f"Sine of handwheel angle at {frequency:g} Hz, {cycles} cycles",
        source="after ISO 13674-1",
        speed=100.0 / 3.6,
        duration=cycles / frequency,
        hand=lambda t, amplitude: sine(t, amplitude, frequency),
        lateral_acceleration=2.0,
        reach=half_span,
        trial=2.0 / frequency,
        frequency=frequency,
    )
