"""What tasks of a standing car share."""

from steer_env.tasks.common.definition import EpisodeContext

CREEPING = (0.0, 3.0)  # speeds, assumed [m/s]
USUAL = {"handwheel_angle": 5.0, "handwheel_speed": 2.0, "column_speed": 2.0, "motor_torque": 20.0}  # sizes in parking
TWO_TRACK = ("two_track",)  # the only chassis on which a car can stand


def angle_at_lock(context: EpisodeContext) -> float:
    """Handwheel angle at the rack's end stop [rad]."""
    return context.car.handwheel_lock(0.0)
