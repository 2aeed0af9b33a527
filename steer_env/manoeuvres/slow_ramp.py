"""Slow ramp: a weave without the lag of the vehicle."""

from dataclasses import replace

from steer_env.manoeuvres.common.definition import Manoeuvre, register
from steer_env.manoeuvres.weave import weave


@register("slow-ramp")
def slow_ramp(frequency: float = 0.02, cycles: int = 5) -> Manoeuvre:
    """A weave so slow that lag and damping of the vehicle do not widen the loops; their width is due to friction."""
    return replace(
        weave(frequency, cycles),
        name="slow-ramp",
        source="after the slow-ramp test of steering-feel practice",
        speed=50.0 / 3.6,
    )
