"""Steering on a rig."""

import numpy as np

from steer_env.manoeuvres.common.definition import Manoeuvre, register
from steer_env.manoeuvres.common.shapes import sine


@register("rig")
def rig(frequency: float = 0.2, cycles: int = 5, amplitude: float = 0.35) -> Manoeuvre:
    """Steering on a rig: without rack load and assist, so that the hands feel only friction and inertia."""
    return Manoeuvre(
        name="rig",
        hands=f"Sine of handwheel angle, {np.degrees(amplitude):.0f} deg at {frequency:g} Hz, {cycles} cycles",
        source="steering-rig practice",
        speed=10.0,
        duration=cycles / frequency,
        hand=lambda t, amplitude: sine(t, amplitude, frequency),
        amplitude=amplitude,
        frequency=frequency,
        rig=True,
    )
