"""Robot: the preview driver with hands that hold the handwheel as firmly as a steering robot does."""

from steer_env.drivers.common.definition import ROBOT_ARM, Driver, register
from steer_env.drivers.preview import EFFORT, Preview
from steer_env.friction.numerics.check import positive


def robot(effort: float = EFFORT) -> Driver:
    """The preview driver with hands that hold the handwheel as firmly as a steering robot does.

    The default car takes the obstacle avoidance up to 50 km/h without a cone; ``effort`` as in the preview driver [s2].
    """
    return Driver("robot", Preview(positive("effort [s2]", effort)), ROBOT_ARM)


register("robot", robot)
