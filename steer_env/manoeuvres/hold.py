"""Held torque."""

from steer_env.manoeuvres.common.definition import Manoeuvre, register
from steer_env.manoeuvres.common.shapes import ramp_and_hold

RISE = 0.5  # rise time of the torque [s]


@register("hold")
def hold(torque: float = 2.0) -> Manoeuvre:
    """Held torque: the hands pull with a torque and hold it; any motion that remains is caused by the friction law."""
    return Manoeuvre(
        name="hold",
        hands=f"Hand torque rises to {torque:g} N m in {RISE:g} s and is held for 5 s",
        source="after the held-steering comparison of LuGre and Masing, JSME D&D 2021, paper 557",
        speed=50.0 / 3.6,
        duration=RISE + 5.0,
        hand=lambda t, amplitude: ramp_and_hold(t, amplitude, RISE),
        robot=False,
        amplitude=torque,
    )
