"""Step steer."""

from steer_env.manoeuvres.definition import Manoeuvre, register
from steer_env.manoeuvres.shapes import ramp_and_hold


@register("step-steer")
def step_steer(start: float = 0.5, rise: float = 0.2) -> Manoeuvre:
    """Step steer: the handwheel turns as fast as people do, and stays."""
    return Manoeuvre(
        name="step-steer",
        hands=f"Handwheel angle rises in {rise:g} s and stays",
        source="after ISO 7401",
        speed=80.0 / 3.6,
        duration=6.0,
        hand=lambda t, amplitude: ramp_and_hold(t - start, amplitude, rise),
        lateral_acceleration=4.0,
    )
