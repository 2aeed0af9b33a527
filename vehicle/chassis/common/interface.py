"""What a chassis is to the plant, and the registry of them.

A chassis is a ``NamedTuple`` of parameters and a few kernels; as with friction laws, the class of the parameters
selects the kernels at compile time. The plant calls ``derivative`` at every node, ``advance`` at every step between
nodes and ``report`` where channels are wanted. Its inputs, one row for each sample of 1 ms, are declared here.
"""

from collections.abc import Callable
from typing import Any, NamedTuple

from steer_env.friction.numerics.kernel import dispatch, kernel
from steer_env.friction.numerics.registry import Registry

# One row of inputs holds for a sample of 1 ms.
INPUTS = (
    ("hand", "N m or rad"),  # hand torque, or handwheel angle at the end of the sample
    ("hand_speed", "rad/s"),  # handwheel speed at the end of the sample, if the angle is prescribed
    ("assist_request", "N m"),  # added to the controller's command
    ("wind_force", "N"),
    ("wind_moment", "N m"),
    ("rack_disturbance", "N"),  # from the road, positive where it resists a left turn
    ("target_speed", "m/s"),  # change of the held speed; this and the rest: two_track only
    ("throttle", "1"),  # 0 to 1, on top of the speed hold's
    ("brake", "1"),  # service brake, 0 to 1, on top of the speed hold's
    ("hand_brake", "1"),  # 0 to 1
    ("coast", "1"),  # 1 where the speed hold is off
)
(
    HAND,
    HAND_SPEED,
    ASSIST_REQUEST,
    WIND_FORCE,
    WIND_MOMENT,
    RACK_DISTURBANCE,
    TARGET_SPEED,
    THROTTLE,
    BRAKE,
    HAND_BRAKE,
    COAST,
) = range(len(INPUTS))

Names = tuple[tuple[str, str], ...]

WHEELS = ("front_left", "front_right", "rear_left", "rear_right")


def per_wheel(name: str, unit: str) -> Names:
    """Names and unit of a quantity that each wheel has."""
    return tuple((f"{name}_{wheel}", unit) for wheel in WHEELS)


# Outputs that every chassis computes first, in this order.
COMMON_OUTPUTS: Names = (
    ("lateral_acceleration", "m/s2"),
    ("road_wheel_angle_left", "rad"),
    ("road_wheel_angle_right", "rad"),
    *per_wheel("wheel_load", "N"),
    ("front_lateral_force", "N"),
    ("rear_lateral_force", "N"),
)
# Channels that every chassis reports first, in this order.
COMMON_CHANNELS: Names = (
    ("lateral_speed", "m/s"),
    ("yaw_rate", "rad/s"),
    ("roll_angle", "rad"),
    ("yaw_angle", "rad"),
    ("x", "m"),
    ("y", "m"),
    ("drive_force", "N"),
    *COMMON_OUTPUTS,
)
# Channels that an earlier release called differently: old name -> new name. Readers of recordings map them.
RENAMED_CHANNELS = {f"wheel_spin_{wheel}": f"wheel_angular_velocity_{wheel}" for wheel in WHEELS}


class Chassis(NamedTuple):
    """A registered chassis: see :func:`register` for the meaning of the fields."""

    name: str
    parameters: type
    states: Names
    outputs: Names
    channels: Names
    start: Callable
    derivative: Callable
    advance: Callable
    report: Callable
    speed: Callable
    state_size: Callable
    output_size: Callable


CHASSIS: Registry[Chassis] = Registry("chassis", "steer_env.vehicle.chassis")


def register(name: str, parameters: type, **fields: Any) -> None:
    """Make a chassis known; one call at the end of its file.

    Parameters
    ----------
    name : str
    parameters : NamedTuple class
    states, outputs : names with units
        Of the states, and of what ``derivative`` reports besides.
    channels : names with units
        What ``report`` fills; every chassis begins with those of the single track.
    start : parameters -> list
        States of running straight at the held speed, to be settled by the plant.
    derivative : ``(p, strut, tyre, x, rack, rack_rate, u, dx, out) -> rack force``
        Time derivative of the states and the outputs, at a row ``u`` of inputs, which may pass their bounds by half.
    advance : ``(p, x, rate, rate_before, out, out_before, s, h, u) -> None``
        One step ``h`` whose middle lies ``s`` node intervals after the last node, under a row ``u`` of inputs.
    report : ``(p, x, out, out_before, s, u, row) -> None``
        Fill the channels, ``s`` node intervals after the last node, at a row ``u`` of inputs.
    speed : ``(p, x) -> float``
        Forward speed that the assist sees [m/s].
    state_size, output_size : ``(p) -> int``
        Constants of the class, so that the plant's layout is known at compile time.
    """
    chassis = Chassis(name, parameters, **fields)
    CHASSIS.register(name, chassis, parameters)


def available() -> tuple[str, ...]:
    """Names of the registered chassis."""
    return CHASSIS.available()


def chassis_of(p: Any) -> Chassis:
    """The chassis that the class of these parameters belongs to."""
    chassis = CHASSIS.of(type(p))
    if chassis is None:
        raise ValueError(f"{p!r} is not a set of chassis parameters")
    return chassis


# The dispatch points. Plain Python runs the bodies; compiled code takes the chassis' function itself.


def derivative(p, strut, tyre, x, rack, rack_rate, u, dx, out):
    """Derivative of the states ``x`` into ``dx``, outputs into ``out``; returns the rack force [N]."""
    return chassis_of(p).derivative(p, strut, tyre, x, rack, rack_rate, u, dx, out)


def advance(p, x, rate, rate_before, out, out_before, s, h, u):
    """One step of the states between nodes."""
    chassis_of(p).advance(p, x, rate, rate_before, out, out_before, s, h, u)


def report(p, x, out, out_before, s, u, row):
    """Channels of the chassis."""
    chassis_of(p).report(p, x, out, out_before, s, u, row)


def speed(p, x):
    """Forward speed [m/s]."""
    return chassis_of(p).speed(p, x)


def state_size(p):
    """Number of states."""
    return chassis_of(p).state_size(p)


def output_size(p):
    """Number of outputs."""
    return chassis_of(p).output_size(p)


for _point in (derivative, advance, report, speed, state_size, output_size):
    dispatch(_point, lambda parameters, name: getattr(CHASSIS.of(parameters), name, None))


@kernel
def extrapolated_step(x, rate, before, s, h):
    """Advance by the rate that the last two nodes extrapolate to the middle of the step (Adams-Bashforth)."""
    for i in range(x.size):
        x[i] += h * (rate[i] + s * (rate[i] - before[i]))
