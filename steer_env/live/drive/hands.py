"""What becomes of a device's readings: the inputs of the car, the speed that is held, and the torque of the motor.

A wheel prescribes the handwheel angle. Every other device only tells the angle that a person wants: there the plant
holds the handwheel by arms (C3), a spring and a damper that its implicit step solves stably, whose rest moves to the
wanted angle. Their resting point enters as the torque K_arm angle + C_arm speed.
"""

import math
from collections.abc import Sequence
from typing import Any

from steer_env.drivers.common.definition import Arm
from steer_env.friction.numerics.bounds import within
from steer_env.friction.sites import friction_name
from steer_env.live.drive.shown import ConfigurationInfo
from steer_env.live.real_time import CarConfiguration
from steer_env.vehicle import subsystems
from steer_env.vehicle.cars import Car
from steer_env.vehicle.steering.assist.functions import NoFunctions

# Between the relaxed and the tensed arms of steer_env.drivers, without their inertia, to follow at once; assumed.
ARM = Arm(inertia=0.0, damping=1.5, stiffness=24.0, reflex=0.0)
LARGEST_WANTED = 8.0  # angle that the arms turn to at most; assumed [rad]
WANTED_LAG = 0.04  # time constant behind the wanted angle, whose steps hands cannot follow; assumed [s]
SPEED_STEP = 5.0 / 3.6  # of a command [m/s]
FASTEST = 70.0  # [m/s]
_TOUCHED = 0.02  # pedal travel that counts as touched; assumed [1]


class Arms:
    """The torque of arms whose resting point follows a wanted angle."""

    def __init__(self) -> None:
        self._angle, self._stamp = 0.0, 0

    def torque(self, wanted: float, stamp: int) -> float:
        """Hand torque beyond the impedance of the arms [N m], for an angle [rad] wanted at a time [ns]."""
        elapsed = within(1e-9 * (stamp - self._stamp), 0.0, 0.1) if self._stamp else 0.0
        self._stamp = stamp
        aim = within(wanted, -LARGEST_WANTED, LARGEST_WANTED)
        speed = (aim - self._angle) / WANTED_LAG
        self._angle += -math.expm1(-elapsed / WANTED_LAG) * (aim - self._angle)
        return ARM.stiffness * self._angle + ARM.damping * within(speed, -10.0, 10.0)


class Pedals:
    """The speed that is held until a pedal is touched, and again from the next command of speed on.

    Parameters
    ----------
    held : float
        Speed for which the plant was made [m/s].
    """

    def __init__(self, held: float) -> None:
        self._made, self.held, self.coasts = held, held, False

    def change(self, steps: int, speed: float) -> None:
        """Hold another speed, so many steps above or below that held; or, behind pedals, near the present one [m/s]."""
        near = SPEED_STEP * round(speed / SPEED_STEP) if self.coasts else self.held
        self.held, self.coasts = within(near + steps * SPEED_STEP, 0.0, FASTEST), False

    def inputs(self, throttle: float, brake: float) -> dict[str, float]:
        """Inputs of the car for pedals at a travel [1]."""
        if max(throttle, brake) > _TOUCHED:
            self.coasts = True
        return {
            "target_speed": self.held - self._made,
            "throttle_request": within(throttle, 0.0, 1.0),
            "brake_request": within(brake, 0.0, 1.0),
            "coast": float(self.coasts),
        }


def in_order(names: Sequence[str], values: dict[str, float]) -> list[float]:
    """Inputs in the order of their names; those that are not given are zero, those that the car lacks are left out."""
    return [values.get(name, 0.0) for name in names]


def car_configuration(
    label: str,
    car: Car,
    friction: Any = None,
    *,
    speed: float = 100.0 / 3.6,
    hands: str = "angle",
    chassis: str = "two_track",
    road_friction: float = 1.0,
    law: str = "",
) -> tuple[CarConfiguration, ConfigurationInfo]:
    """A configuration.

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
    info = ConfigurationInfo(label, car.name, law or friction_name(p.friction), assist, chassis)
    return CarConfiguration(label, subsystems.make("car", p, speed)), info
