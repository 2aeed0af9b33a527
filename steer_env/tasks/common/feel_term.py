"""The term of tasks that shape the hand torque: its deviation from a reference feel."""

from steer_env.friction.numerics.kernel import kernel
from steer_env.tasks.common.definition import RMS, EpisodeMetric, Term
from steer_env.tasks.common.reference_feel import reference_torque
from steer_env.tasks.common.terms import quality
from steer_env.vehicle.plant import CHANNEL

FEEL_SCALE = 0.3  # difference that hands just notice around 2 to 3 N m; where the quality is 71 %, assumed [N m]
FEEL_METRIC = EpisodeMetric("rms_feel_error", "N m", RMS, "hand torque minus the torque of the reference feel")

_TORQUE, _SPEED = CHANNEL["handwheel_torque"], CHANNEL["handwheel_speed"]
_ACCELERATION = CHANNEL["lateral_acceleration"]


def feel_term(weight: float) -> Term:
    """The term for a task that gives it this weight [1/s]."""
    return Term("feel", weight, f"quality of the hand torque against the reference feel; 71 % at {FEEL_SCALE:g} N m")


@kernel
def feel_error(channels):
    """Hand torque minus the torque of the reference feel [N m]."""
    return channels[_TORQUE] - reference_torque(channels[_ACCELERATION], channels[_SPEED])


@kernel
def feel_quality(error):
    """Quality of a difference from the wanted hand torque [N m]."""
    return quality(error / FEEL_SCALE)
