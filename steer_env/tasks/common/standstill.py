"""What tasks of a standing car share."""

from steer_env.tasks.common.definition import Setting, Term
from steer_env.tasks.common.feel import RATE_SCALE

CREEPING = (0.0, 3.0)  # speeds, assumed [m/s]
TWO_TRACK = ("two_track",)  # only there a car can stand

ACTION_TERMS = (
    Term("effort", -0.01, "s", "squared action"),
    Term("smoothness", -0.01 / RATE_SCALE**2, "1/s", "squared rate of the action"),
)


def lock(setting: Setting) -> float:
    """Handwheel angle at the rack's end stop [rad]."""
    return setting.car.steering["rack_limit"] / setting.car.steering["pinion_radius"]
