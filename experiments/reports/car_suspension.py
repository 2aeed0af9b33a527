"""Kinematics and compliance of a car's wheels as curves, and the slopes of these curves straight ahead.

Toe-in, camber with the top leaning outward, and a steer angle that makes the car understeer are positive.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from steer_env.vehicle.cars import Car
from steer_env.vehicle.suspension.macpherson import load_coefficients

Array = NDArray[np.float64]

POINTS = 61  # of a curve
SLOPE_STEP = 1e-4  # half step of the slopes [m]


class Curves(NamedTuple):
    """What the suspension does as a wheel travels and as the rack moves; angles in radians."""

    travel: Array  # (n,) of a wheel, bump positive [m]
    toe: dict[str, Array]  # axle -> (n,)
    camber: dict[str, Array]  # axle -> (n,)
    roll_centre: dict[str, Array]  # axle -> (n,) height of the roll centre when both wheels travel [m]
    rack: Array  # (n,) rack travel to the left [m]
    handwheel: Array  # (n,) the same as an angle of the handwheel, without compliance [rad]
    left: Array  # (n,) steer angle of the left wheel
    right: Array  # (n,) steer angle of the right wheel
    ideal_right: Array  # (n,) steer angle of the right wheel by Ackermann for that of the left wheel
    ratio: Array  # (n,) handwheel angle over the mean road-wheel angle, local [1]


class Slopes(NamedTuple):
    """Slopes straight ahead by axle, front then rear."""

    toe: tuple[float, float]  # over travel [rad/m]
    camber: tuple[float, float]  # over travel [rad/m]
    roll_steer: tuple[float, float]  # steer angle over the roll angle of the body [1]
    lateral_steer: tuple[float, float]  # steer angle over the lateral force of each of both wheels [rad/N]
    aligning_steer: tuple[float, float]  # steer angle over the aligning torque of each of both wheels [rad/(N m)]


def slopes(car: Car) -> Slopes:
    """The slopes of a car straight ahead.

    All compliance of the front wheels is that of the steering; the rear wheels yield to lateral forces only.
    """
    c, low, high = car.chassis, car.strut.solve(0.0, -SLOPE_STEP), car.strut.solve(0.0, SLOPE_STEP)
    toe, camber = (float(getattr(high, name) - getattr(low, name)) / (2.0 * SLOPE_STEP) for name in ("toe", "camber"))
    pose = car.strut.straight
    work = load_coefficients(pose)
    # A unit load on both front wheels moves the rack by twice its work over the stiffness (P5).
    steered = 2.0 * car.steer_per_rack() / car.rack_stiffness()
    # In a left turn the body rolls to the right: the left wheel rebounds, and toe-in turns it out of the turn.
    roll_steer = -0.5 * c["front_track"] * toe
    return Slopes(
        toe=(toe, -c["rear_bump_steer"]),
        camber=(camber, -c["rear_camber_gain"]),
        roll_steer=(roll_steer, -0.5 * c["rear_track"] * c["rear_bump_steer"]),
        lateral_steer=(-steered * float(np.asarray(work.F_y)), c["rear_lateral_compliance"]),
        aligning_steer=(steered * float(np.asarray(work.M_z)), 0.0),
    )


def ideal_right(car: Car, left: Array) -> Array:
    """Steer angle of the right wheel with which it and the left wheel turn without slip (Ackermann) [rad]."""
    c = car.chassis
    apart = c["front_track"] - 2.0 * float(car.strut.straight.scrub)  # of the king-pin axes on the ground
    wheelbase = c["front_axle"] + c["rear_axle"]
    return np.arctan2(wheelbase * np.sin(left), wheelbase * np.cos(left) + apart * np.sin(left))


def curves(car: Car) -> Curves:
    """The curves of a car, up to its bump stops and to its steering locks."""
    c = car.chassis
    travel = np.linspace(-1.0, 1.0, POINTS) * min(c["front_bump_clearance"], c["rear_bump_clearance"], 0.08)
    pose = car.strut.solve(0.0, travel)
    rack = np.linspace(-1.0, 1.0, POINTS) * car.steering["rack_limit"]
    left, right = car.strut.solve_pair(rack, 0.0, 0.0)
    steered = 0.5 * (left.per_rack.rotation[..., 2] + right.per_rack.rotation[..., 2])
    return Curves(
        travel=travel,
        toe={"front": pose.toe, "rear": -c["rear_bump_steer"] * travel},
        camber={"front": pose.camber, "rear": -c["rear_camber_gain"] * travel},
        roll_centre={"front": pose.roll_centre_height, "rear": np.full(POINTS, c["rear_roll_centre"])},
        rack=rack,
        handwheel=rack / car.steering["pinion_radius"],
        left=left.steer_angle,
        right=right.steer_angle,
        ideal_right=ideal_right(car, left.steer_angle),
        ratio=1.0 / (car.steering["pinion_radius"] * steered),
    )
