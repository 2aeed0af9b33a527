"""What is known of a car to be tuned: load, steering, road, friction, measured as on a rig, and the wanted feel."""

from typing import NamedTuple

import numpy as np

from steer_env.episode.randomise import Conditions, with_level
from steer_env.friction.level import by_sample
from steer_env.friction.response import response
from steer_env.manoeuvres.common.driving import steering_stiffness
from steer_env.metrics import Value
from steer_env.tasks import Quantity
from steer_env.tasks.common.definition import SPEED
from steer_env.vehicle.cars import Car

SLIDING_SPEED = 0.1  # column speed at which the sliding friction is measured [rad/s]
FIRST_TURN = 1e-3  # turn from rest over which the stiffness is measured [rad]
SLIDING_TURN = 0.2  # turn from rest after which the friction slides [rad]


class Context(NamedTuple):
    """The context of one episode; the fields are observed in this order."""

    mass: float  # of the car with its load [kg]
    steering_stiffness: float  # hand torque over handwheel angle in steady turns with the car's own assist [N m/rad]
    speed: float  # of the tests at the context's speed [m/s]
    road_friction: float  # relative to the tyre's measurements [1]
    friction_torque: float  # sliding friction at 0.1 rad/s, at the column with an unloaded rack [N m]
    friction_stiffness: float  # friction torque over angle, 1 mrad from rest [N m/rad]


class Reference(NamedTuple):
    """What is the same for every parameter set of a context."""

    context: Context
    own: dict[str, Value]  # metrics of the car's own assist, about which the wanted bands lie


OBSERVED = (
    Quantity("mass", "kg", 5000.0, "mass of the car with its load"),
    Quantity(
        "steering_stiffness",
        "N m/rad",
        200.0,
        "hand torque over angle in steady turns, with the car's own assist",
    ),
    SPEED,
    Quantity("road_friction", "1", 2.0, "friction of the road relative to that of the tyre's measurements"),
    Quantity("friction_torque", "N m", 10.0, "friction torque of the column, sliding at 0.1 rad/s, rack unloaded"),
    Quantity("friction_stiffness", "N m/rad", 5000.0, "friction torque over angle, 1 mrad from rest"),
)


def measure_context(car: Car, chassis: str, drawn: Conditions) -> Context:
    """The context of drawn conditions."""
    loaded = car.loaded(drawn.load)
    p = loaded.plant(drawn.friction, speed=drawn.speed, robot=True, road_friction=drawn.road_friction, chassis=chassis)
    p = with_level(p, drawn)
    turned = np.arange(0.0, SLIDING_TURN + FIRST_TURN, FIRST_TURN)
    scales = by_sample(p.level, np.zeros(turned.size), turned, drawn.friction_level)
    torque = response(drawn.friction, turned, FIRST_TURN / SLIDING_SPEED, scales)
    return Context(
        mass=loaded.chassis["mass"],
        steering_stiffness=steering_stiffness(p),
        speed=drawn.speed,
        road_friction=drawn.road_friction,
        friction_torque=float(torque[-1]),
        friction_stiffness=float(torque[1]) / FIRST_TURN,
    )
