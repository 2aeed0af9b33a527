"""The sets of a drive: cars with their laws, assists and chassis, made for the hands of a device."""

from typing import Any

from steer_env.friction.law import law_of
from steer_env.live.drive.hands import ARM
from steer_env.live.drive.shown import SetInfo
from steer_env.live.real_time import CarSet
from steer_env.vehicle import subsystems
from steer_env.vehicle.cars import Car
from steer_env.vehicle.steering.assist.functions import NoFunctions


def car_set(
    label: str,
    car: Car,
    friction: Any = "lugre",
    *,
    speed: float = 100.0 / 3.6,
    hands: str = "angle",
    chassis: str = "two_track",
    road_friction: float = 1.0,
    law: str = "",
) -> tuple[CarSet, SetInfo]:
    """A set.

    Parameters
    ----------
    label : str
        What the user calls it.
    car : Car
    friction : str or parameters
        As of ``Car.plant``, as are ``speed`` [m/s], ``chassis`` and ``road_friction`` [1].
    hands : {"angle", "torque"}
        Of the device: where it gives a torque, arms hold the handwheel.
    law : str
        The friction law in words, by default its name.

    Raises
    ------
    ValueError
        As of ``Car.plant``.
    """
    p = car.plant(friction, speed, hands == "angle", road_friction, chassis)
    if hands == "torque":
        p = p._replace(column=p.column._replace(I_arm=ARM.inertia, C_arm=ARM.damping, K_arm=ARM.stiffness))
    assist = "boost curve" if isinstance(p.assist.functions, NoFunctions) else "boost curve, functions"
    info = SetInfo(label, car.name, law or law_of(p.friction).name, assist, chassis)
    return CarSet(label, subsystems.make("car", p, speed)), info
