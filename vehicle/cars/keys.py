"""Sections and keys of a car file, their limits, and the check of a section."""

import math
from collections.abc import Callable, Iterable, Mapping
from typing import Any

from steer_env.friction import level
from steer_env.friction.numerics.check import number
from steer_env.vehicle.chassis.two_track import brakes, drivetrain, speed_hold
from steer_env.vehicle.steering import column, eps

CHASSIS = (
    "mass",
    "sprung_mass",
    "front_unsprung_mass",
    "front_axle",
    "rear_axle",
    "roll_inertia",
    "yaw_inertia",
    "sprung_height",
    "front_track",
    "rear_track",
    "front_spring",
    "rear_spring",
    "front_damper",
    "rear_damper",
    "front_anti_roll",
    "rear_anti_roll",
    "rear_roll_centre",
    "drag_area",
    "compliance_time",
    "speed_hold_time",
    "pitch_inertia",
    "wheel_inertia",
    "front_bump_clearance",
    "rear_bump_clearance",
    "bump_stiffness",
    "rear_bump_steer",
    "rear_camber_gain",
    "rear_lateral_compliance",
    "front_lift_area",
    "rear_lift_area",
)
# Overall size: the lane-change courses need it, no equation of motion does.
SIZE = ("length", "width")
# Factors on the tyre's cornering stiffness, which leave peak friction and the trail at small slip; 1 where not given.
CHASSIS_DEFAULTS = {"front_cornering_stiffness_factor": 1.0, "rear_cornering_stiffness_factor": 1.0}
STEERING = ("pinion_radius", "compliance", "friction_load", "rack_limit")
# The other conditions of the level of friction, by the names of steer_env.friction.level.Level with a prefix.
STEERING_DEFAULTS = {"friction_asymmetry": 0.0, "friction_temperature_rate": 0.0, "friction_temperature_rise": 0.0}
_MAY_BE_ZERO = {
    "front_anti_roll",
    "rear_anti_roll",
    "front_damper",
    "rear_damper",
    "rear_roll_centre",
    "drag_area",
    "friction_load",
}
# Sections whose keys are the keyword arguments of a constructor, which also checks them.
CONSTRUCTORS: dict[str, Callable[..., Any]] = {
    "column": column.make,
    "assist": eps.make,
    "drivetrain": drivetrain.make,
    "brakes": brakes.make,
    "speed_hold": speed_hold.make,
}
TEXTS = ("name", "description", "source")
TABLES = ("chassis", "steering", *CONSTRUCTORS)
SECTIONS = (*TEXTS, "assumed", "tyre", "strut", *TABLES)

# Limits of the tables of the plant and of its step, beyond which its results would be wrong.
_LIMITS = {
    "rack_limit": (0.0, 0.075),  # [m]; the end of the kinematics table
    "mass": (100.0, 10e3),  # [kg]; this and the following: a car at all, in SI units
    "front_track": (0.5, 3.0),  # [m]
    "rear_track": (0.5, 3.0),  # [m]
    "front_axle": (0.1, 5.0),  # [m]
    "rear_axle": (0.1, 5.0),  # [m]
    "length": (1.0, 15.0),  # [m]
    "width": (0.5, 3.0),  # [m]
    "sprung_height": (0.1, 2.0),  # [m]
    "compliance_time": (0.004, math.inf),  # [s]; two chassis steps
    "speed_hold_time": (0.004, math.inf),  # [s]
    "front_damper": (0.0, 12e3),  # [N s/m]; beyond it a wheel of the two-track chassis is too fast for its step of 2 ms
    "rear_damper": (0.0, 12e3),  # [N s/m]
    "front_spring": (1e3, 1e6),  # [N/m]; this and the following: beyond what a car can have, or the step can follow
    "rear_spring": (1e3, 1e6),  # [N/m]
    "front_anti_roll": (0.0, 1e6),  # [N m/rad]
    "rear_anti_roll": (0.0, 1e6),  # [N m/rad]
    "bump_stiffness": (1e3, 1e7),  # [N/m]
    "wheel_inertia": (0.05, 50.0),  # [kg m2]
    "rear_roll_centre": (0.0, 1.0),  # [m]
    "rear_bump_steer": (-5.0, 5.0),  # [rad/m]
    "rear_camber_gain": (-5.0, 5.0),  # [rad/m]
    "rear_lateral_compliance": (-1e-4, 1e-4),  # [rad/N]
    "drag_area": (0.0, 20.0),  # [m2]
    "front_lift_area": (-5.0, 5.0),  # [m2]
    "rear_lift_area": (-5.0, 5.0),  # [m2]
    "pinion_radius": (0.001, 0.05),  # [m]
    "compliance": (100.0, 1e9),  # [N m/rad]
    "front_cornering_stiffness_factor": (0.3, 3.0),  # [1]
    "rear_cornering_stiffness_factor": (0.3, 3.0),  # [1]
    **{f"friction_{key}": limits for key, limits in level.LIMITS.items()},
}


def limits(key: str) -> tuple[float, float, bool]:
    """Least and greatest value of a key of ``chassis`` or ``steering`` [SI], and whether the least is excluded."""
    low, high = _LIMITS.get(key, (0.0, math.inf))
    return low, high, low == 0.0 and key not in _MAY_BE_ZERO


def require_known(where: str, given: Any, allowed: Iterable[str]) -> None:
    """Raise ValueError for a section that is no mapping or has a key that is not allowed."""
    if not isinstance(given, dict):
        raise ValueError(f"{where} must hold keys and values, got {given!r}")
    for key in given:
        if key not in allowed:
            raise ValueError(f"{where} has no key {key!r}; it takes: {', '.join(allowed)}")


def require(where: str, given: Any, allowed: tuple[str, ...], optional: tuple[str, ...] = ()) -> None:
    """Raise ValueError for an unknown key or a missing one."""
    require_known(where, given, (*allowed, *optional))
    for key in allowed:
        if key not in given:
            raise ValueError(f"{where} lacks the key {key!r}")


def numbers(
    where: str,
    given: dict,
    allowed: tuple[str, ...],
    optional: tuple[str, ...] = (),
    defaults: Mapping[str, float] | None = None,
) -> dict[str, float]:
    """The numbers of a section with its defaults, checked; ValueError names the section and the key."""
    defaults = defaults or {}
    require(where, given, allowed, (*optional, *defaults))
    checked = dict(defaults)
    for key, value in given.items():
        low, high, above = limits(key)
        checked[key] = number(f"{where}.{key}", value, minimum=low, maximum=high, above=above)
    return checked
