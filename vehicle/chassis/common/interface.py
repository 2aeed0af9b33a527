"""The interface between a chassis and the plant, and the registry of the chassis.

A chassis is a ``NamedTuple`` of parameters and a few kernels. As for friction laws, the class of the parameters
selects the kernels at compile time. The plant calls ``derivative`` once in every chassis step of 2 ms, ``advance`` at
every step of 1 ms, and ``report`` for the channels. This module also declares the inputs of a plant, one row for each
sample of 1 ms, and the outputs and channels that all chassis share.
"""

from collections.abc import Callable, Mapping
from typing import Any, NamedTuple, Protocol

from steer_env.friction.numerics.check import one_of
from steer_env.friction.numerics.kernel import dispatch, kernel, separate_kernel
from steer_env.friction.numerics.registry import Registry
from steer_env.vehicle.suspension.macpherson import MacPherson
from steer_env.vehicle.tyre.tyre import Tyre

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

EXTERNAL = (".fmu", ".toml")  # ends of the files of external vehicles: a unit, or a mapping that names one

SPEED_MIN, SPEED_MAX = 3.0, 70.0  # held speeds that every chassis accepts [m/s]
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
# What these channels are and where they are positive; those of each wheel by their names without it.
COMMON_MEANINGS = {
    "lateral_speed": "lateral speed of the car at its centre of gravity, positive to the left",
    "yaw_rate": "yaw rate of the car, positive to the left",
    "roll_angle": "roll angle of the body, positive where it leans to the right, as in a left turn",
    "yaw_angle": "yaw angle of the car since the start, positive to the left",
    "x": "position of the car along its direction at the start, positive ahead",
    "y": "position of the car across its direction at the start, positive to the left",
    "drive_force": "force of the drive on all wheels together, positive ahead",
    "lateral_acceleration": "lateral acceleration of the centre of gravity of the whole car, positive to the left",
    "road_wheel_angle_left": "steer angle of the left front wheel, positive to the left",
    "road_wheel_angle_right": "steer angle of the right front wheel, positive to the left",
    "wheel_load": "vertical force of the road on the tyre, positive upwards",
    "front_lateral_force": "lateral force of both front wheels on the car, positive to the left",
    "rear_lateral_force": "lateral force of both rear wheels on the car, positive to the left",
}


class CarData(Protocol):
    """What a chassis takes from a checked car, :class:`steer_env.vehicle.cars.Car`."""

    @property
    def chassis(self) -> dict[str, float]:
        """Numbers of the section ``chassis`` of the car file [SI]."""

    @property
    def tyre(self) -> Tyre:
        """The tyre of all wheels."""

    @property
    def strut(self) -> MacPherson:
        """The left front strut."""

    @property
    def drivetrain(self) -> Any:
        """Parameters of engine and gearbox."""

    @property
    def brakes(self) -> Any:
        """Parameters of the brakes."""

    @property
    def speed_hold(self) -> Any:
        """Parameters of the speed hold."""

    def rack_stiffness(self) -> float:
        """Steering compliance of both wheels, seen at the rack straight ahead [N/m]."""


class Chassis(NamedTuple):
    """A registered chassis: see :func:`register` for the meaning of the fields."""

    name: str
    parameters: type
    states: Names
    outputs: Names
    channels: Names
    speeds: tuple[float, float]  # [m/s]
    from_car: Callable
    begin: Callable
    derivative: Callable
    advance: Callable
    report: Callable
    speed: Callable
    state_size: Callable
    output_size: Callable
    meanings: Mapping[str, str] = {}
    wide: bool = False


CHASSIS: Registry[Chassis] = Registry("chassis", "steer_env.vehicle.chassis")


def register(name: str, parameters: type, **fields: Any) -> None:
    """Add a chassis to the registry; the module of a chassis calls this once, at its end.

    Parameters
    ----------
    name : str
    parameters : NamedTuple class
    states, outputs : names with units
        Of the states, and of the other results of ``derivative``, which begin with ``COMMON_OUTPUTS``.
    channels : names with units
        What ``report`` fills; every chassis begins with ``COMMON_CHANNELS``.
    speeds : (float, float)
        Lowest and highest held speed that the chassis accepts [m/s].
    from_car : ``(car, speed, road_friction, road) -> parameters``
        Parameters of a checked car on a road (None: level and dry); ValueError for a road that the chassis cannot
        take.
    begin : ``(p, strut, tyre, x) -> bool``
        Write the states of straight running at the held speed, in balance; whether the car runs straight from there.
    derivative : ``(p, strut, tyre, x, rack, rack_rate, u, dx, out) -> rack force``
        Time derivative of the states, and the outputs, at a row ``u`` of inputs, which may exceed their bounds by half.
    advance : ``(p, x, rate, rate_before, out, out_before, s, h, u) -> None``
        One step ``h`` at a row ``u`` of inputs; its middle lies ``s`` chassis steps after the last evaluation.
    report : ``(p, x, out, out_before, s, u, row) -> None``
        Fill the channels at a row ``u`` of inputs, ``s`` chassis steps after the last evaluation.
    speed : ``(p, x) -> float``
        Forward speed that the assist sees [m/s].
    state_size, output_size : ``(p) -> int``
        Constants of the class, so that the plant's layout is known at compile time.
    meanings : mapping, optional
        What the channels beyond the common ones are and where they are positive, as in ``COMMON_MEANINGS``.
    wide : bool, optional
        Whether the kernels take vectors of cars too (:mod:`steer_env.friction.numerics.simd`).
    """
    chassis = Chassis(name, parameters, **fields)
    CHASSIS.register(name, chassis, parameters)


def available() -> tuple[str, ...]:
    """Names of the chassis; imports none of them."""
    return CHASSIS.available()


def is_external(name: str) -> bool:
    """Whether the name of a chassis is the file of an external vehicle, which manoeuvres couple to the steering."""
    return isinstance(name, str) and name.endswith(EXTERNAL)


def checked(name: str) -> str:
    """The name of a chassis of this project; ValueError for another one, with the names that there are."""
    if is_external(name):
        raise ValueError(
            f"chassis={name!r} is an external vehicle, which drives in manoeuvres only (steer-env run and report, or as"
            " the simulator of manoeuvres.drive); environments, manoeuvres and single plants take one of"
            f" {', '.join(available())}"
        )
    if name not in CHASSIS:
        one_of("chassis", name, available())
    return name


def chassis_of(p: Any) -> Chassis:
    """The chassis that the class of these parameters belongs to."""
    chassis = CHASSIS.of(type(p))
    if chassis is None:
        raise ValueError(f"{p!r} is not a set of chassis parameters")
    return chassis


# The dispatch points. Plain Python runs the bodies; compiled code calls the function of the chassis directly.


def begin(p, strut, tyre, x):
    """States of straight running into ``x``, and whether the car runs straight from there."""
    return chassis_of(p).begin(p, strut, tyre, x)


def derivative(p, strut, tyre, x, rack, rack_rate, u, dx, out):
    """Derivative of the states ``x`` into ``dx``, outputs into ``out``; returns the rack force [N]."""
    return chassis_of(p).derivative(p, strut, tyre, x, rack, rack_rate, u, dx, out)


def advance(p, x, rate, rate_before, out, out_before, s, h, u):
    """Advance the states by one step."""
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


for _point in (begin, derivative, advance, report, speed, state_size, output_size):
    dispatch(_point, lambda parameters, name: getattr(CHASSIS.of(parameters), name, None))


@separate_kernel
def separate_derivative(p, strut, tyre, x, rack, rack_rate, u, dx, out):
    """As :func:`derivative`, for what looks for a balance: its calls share one piece of machine code."""
    return derivative(p, strut, tyre, x, rack, rack_rate, u, dx, out)


@kernel
def extrapolated_step(x, rate, before, s, h):
    """Advance by the rate that the last two evaluations extrapolate to the middle of the step (N2)."""
    for i in range(x.size):
        x[i] += h * (rate[i] + s * (rate[i] - before[i]))  # (N2)
