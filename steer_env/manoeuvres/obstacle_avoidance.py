"""Obstacle avoidance."""

from steer_env.manoeuvres.common.definition import Manoeuvre, register
from steer_env.manoeuvres.double_lane_change import APPROACH, lane_change_manoeuvre


@register("obstacle-avoidance")
def obstacle_avoidance(edition: str = "2011", mirrored: bool = False) -> Manoeuvre:
    """Obstacle avoidance: a preview driver swerves around an obstacle and releases the throttle at the entry."""
    return lane_change_manoeuvre(
        "obstacle-avoidance",
        edition,
        mirrored,
        {},
        hands="A preview driver swerves to the next lane and back, throttle released on entry",
        source=f"after ISO 3888-2:{edition}",
        speed=50.0 / 3.6,
        chassis="two_track",
        coasts_from=APPROACH,
    )
