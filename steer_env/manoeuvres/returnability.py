"""Return of the handwheel at low speed."""

import numpy as np

from steer_env.manoeuvres.common.definition import Manoeuvre, register
from steer_env.manoeuvres.release import EVENT, let_go, turn_and_release


@register("returnability")
def returnability(angle: float = 0.5 * np.pi, events: int = 4) -> Manoeuvre:
    """Returnability: at low speed the hands hold the handwheel a quarter turn to the side and let go."""
    return Manoeuvre(
        name="returnability",
        hands=f"Handwheel held at {np.degrees(angle):.0f} deg and let go, left and right in turn, {events} times",
        source="workshop check of the handwheel's return",
        speed=35.0 / 3.6,
        duration=events * EVENT,
        hand=turn_and_release,
        released=let_go(events),
        amplitude=angle,
    )
