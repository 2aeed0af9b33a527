"""Slow ramp: the weave without the vehicle's lag."""

from dataclasses import replace

from steer_env.manoeuvres.common.definition import Manoeuvre, register
from steer_env.manoeuvres.weave import weave


@register("slow-ramp")
def slow_ramp(frequency: float = 0.02, cycles: int = 5) -> Manoeuvre:
    """Weave so slow that vehicle lag and damping stay out of the loop: what is left of its width is friction."""
    return replace(
        weave(frequency, cycles),
        name="slow-ramp",
        source="after the slow-ramp test of steering-feel practice",
        speed=50.0 / 3.6,
    )
