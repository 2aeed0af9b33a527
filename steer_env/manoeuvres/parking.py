"""Parking, lock to lock."""

from steer_env.manoeuvres.common.definition import Manoeuvre, register
from steer_env.manoeuvres.common.shapes import triangle_from_rest


@register("parking")
def parking(frequency: float = 1.0 / 30.0, cycles: int = 2) -> Manoeuvre:
    """Parking: the handwheel turns from lock to lock at 80 deg/s (locks at 600 deg) while the car stands."""
    return Manoeuvre(
        name="parking",
        hands=f"Handwheel from lock to lock in {0.5 / frequency:g} s, {cycles} cycles, service brake released",
        source="parking test of steering-feel practice, 60 to 90 deg/s",
        speed=0.0,
        duration=cycles / frequency,
        hand=lambda t, amplitude: triangle_from_rest(t, amplitude, frequency),
        frequency=frequency,
        lock=True,
        chassis="two_track",
    )
