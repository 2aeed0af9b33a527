"""What a driver model is: a preview model that commands an angle every 10 ms, muscles that follow it, and arms.

The preview model sees the path ahead in the car's frame (lateral offset, heading error and the points of
``steer_env.courses.preview``), lateral speed and yaw rate, and commands a handwheel angle. The command takes effect
after ``DELAY``; the muscles follow it with a first-order lag, and the intended angle follows the muscles as a
second-order lag:

    z = (angle, angle', muscles, commands in the delay line)     intended angle and speed: the first two of z

The arms hold the handwheel by their impedance to the intended angle, with the torque that this motion is known to need,
and a reflex on the error of ``REFLEX_DELAY`` ago:

    T1 = K_arm (angle - th1) + C_arm (angle' - th1') - I_arm th1'' + T_need + K_reflex (angle - th1)(t - delay)

:mod:`steer_env.drivers.common.known_torque` tells T_need = K alpha + C angle' + I angle'', of the front axle's slip
angle alpha, or of the angle itself where there is little slip; I_arm angle'' is added to it. Arms that give the torque
of a steady turn instead overshoot in quick motions, on some cars until they weave. T1 is limited to ``TORQUE_LIMIT``.

A driver is one file: a function that makes it, and for a new preview model its parameters (their class selects the
kernel), a function that gives the gains for a car at a speed, and the kernel that computes the command. Sources:
structure and ranges of the arms after Pick, Cole, Dynamic properties of a driver's arms holding a steering wheel, Proc.
IMechE D 221 (2007); values assumed within these ranges.
"""

from collections.abc import Callable, Mapping
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from steer_env.episode.timing import UPDATE_INTERVAL
from steer_env.friction.numerics.bounds import within
from steer_env.friction.numerics.check import construct, not_negative, number, positive
from steer_env.friction.numerics.kernel import dispatch, kernel
from steer_env.friction.numerics.registry import Registry
from steer_env.vehicle.cars import Car

Array = NDArray[np.float64]

DELAY = 0.12  # from seeing to the muscles' command [s]
MUSCLE_LAG = 0.05  # time constant of the muscles behind their command, assumed [s]
ARM_FREQUENCY = 4.0  # natural frequency of the intended angle behind the muscles, assumed [Hz]
ARM_DAMPING = 0.7  # assumed [1]
REFLEX_DELAY = 0.05  # [s]
# Of both hands [N m], assumed. It limits what they give at every update, with the impedance to the handwheel's present
# angle and speed. The plant's own impedance, to the motion until the next update 10 ms later, has no limit.
TORQUE_LIMIT = 25.0

DELAYED_COMMANDS = round(DELAY / UPDATE_INTERVAL)
DELAYED_ERRORS = round(REFLEX_DELAY / UPDATE_INTERVAL)
NEUROMUSCULAR_STATES = 3 + DELAYED_COMMANDS  # size of z
MEMORY = NEUROMUSCULAR_STATES + DELAYED_ERRORS  # floats of a driver, without the next ones
OWN_MEMORY = 2  # floats: that of the preview model, and the updates since the start
# A driver takes over an episode within this time, in which his command grows: his delay line is empty at the start, and
# to an offset that is already there the preview models would answer as to a step; assumed [s].
TAKING_OVER = 0.5


class Arm(NamedTuple):
    """Arms on the handwheel; :func:`arm` checks the values."""

    inertia: float  # [kg m2]
    damping: float  # [N m s/rad]
    stiffness: float  # [N m/rad]
    reflex: float  # [N m/rad]


def arm(
    co_contraction: float = 0.5,
    *,
    inertia: float = 0.09,
    relaxed: tuple[float, float] = (0.45, 6.5),
    tensed: tuple[float, float] = (1.75, 37.0),
    reflex: float = 5.0,
) -> Arm:
    """Arms between relaxed (0) and tensed (1) by co-contraction of their muscles.

    Parameters
    ----------
    co_contraction : float
        0 to 1.
    inertia : float
        Of the arms, about the column [kg m2].
    relaxed, tensed : (float, float)
        Damping [N m s/rad] and stiffness [N m/rad] at both ends.
    reflex : float
        Stiffness of the stretch reflex [N m/rad].

    Raises
    ------
    ValueError
        A value is out of range.
    """
    share = number("co_contraction", co_contraction, minimum=0.0, maximum=1.0)
    ends = [(positive("damping", d), positive("stiffness", k)) for d, k in (relaxed, tensed)]
    damping, stiffness = (low + share * (high - low) for low, high in zip(*ends))
    return Arm(not_negative("inertia", inertia), damping, stiffness, not_negative("reflex", reflex))


# Hands that hold the handwheel as firmly as hands can; for the robot driver.
ROBOT_ARM = Arm(0.0, 4.4, 200.0, 0.0)
NO_ARM = Arm(0.0, 0.0, 0.0, 0.0)


class Driver(NamedTuple):
    """A driver model with its arms; :func:`make` checks the values."""

    name: str
    preview_model: Any  # its parameters; their class selects it
    arm: Arm
    informed: bool = False  # whether it is told the load and the road's friction, else it knows the car unladen and dry


class PreviewModel(NamedTuple):
    """A registered preview model; :func:`register_preview_model` tells the meaning of the fields."""

    gains: Callable[[Any, Car, float], Array]  # of the model for a car at a speed [m/s]
    command: Callable  # kernel from what is observed to the commanded handwheel angle [rad]
    on_road: Callable[[Any, float], Any]  # the parameters on a road of known friction [1]


PREVIEW_MODELS: dict[type, PreviewModel] = {}  # by the class of their parameters
DRIVERS: Registry[Callable[..., Driver]] = Registry("driver", "steer_env.drivers")


def register_preview_model(
    parameters: type,
    gains: Callable[[Any, Car, float], Array],
    command: Callable,
    on_road: Callable[[Any, float], Any] = lambda parameters, road_friction: parameters,
) -> None:
    """Make a preview model known.

    Parameters
    ----------
    parameters : NamedTuple class
    gains : ``(parameters, car, speed) -> (G,) array``
    command : ``(parameters, gains, path, lateral_speed, yaw_rate, z, memory) -> float``
        Handwheel angle [rad] that enters the delay line now. ``path`` (2 + P,) holds lateral offset, heading error and
        the lateral positions of the points ahead; ``memory`` is one float of the model's own.
    on_road : ``(parameters, road_friction) -> parameters``, optional
        What an informed driver changes on a road whose friction, relative to that of the tyre's measurements, he knows.
    """
    PREVIEW_MODELS[parameters] = PreviewModel(gains, command, on_road)


def register(name: str, maker: Callable[..., Driver]) -> None:
    """Make a driver known: a function that returns it, its options with their standard values as keywords.

    The fields of its preview model's parameters are among the options, so that :func:`as_mapping` tells all of it.
    """
    DRIVERS.register(name, maker)


def available() -> tuple[str, ...]:
    """Names of the drivers."""
    return DRIVERS.available()


def make(name: str, *, informed: bool = False, **options: Any) -> Driver:
    """A driver by name; ValueError for an unknown name, TypeError for an unknown option.

    An ``informed`` driver is told the load and the road's friction of every episode, as what they are in it.
    """
    return DRIVERS[name](**options)._replace(informed=_truth("informed", informed))


def _truth(name: str, value: Any) -> bool:
    if not isinstance(value, bool | np.bool_):
        raise ValueError(f"{name} must be True or False, got {value!r}")
    return bool(value)


def resolve(driver: Any) -> Driver:
    """A driver from every form in which it may be given.

    Parameters
    ----------
    driver : str, mapping or Driver
        A name; a mapping of a name and options, ``{"driver": "preview", "effort": 0.03}``, where "arm" may map the
        fields of :class:`Arm` to other arms and "informed" tells whether it is told the load and the road's friction;
        or a driver from :func:`make`, which is returned unchanged.

    Raises
    ------
    ValueError
        For another form, an unknown name or option, or a value out of range.
    """
    if isinstance(driver, Driver):
        return driver
    given = {"driver": driver} if isinstance(driver, str) else dict(driver) if isinstance(driver, Mapping) else {}
    if "driver" not in given:
        raise ValueError(
            f"driver must be one of {', '.join(available())}, a mapping as {{'driver': 'preview', 'effort': 0.03}}, or"
            f" from drivers.make, got {driver!r}"
        )
    name, hands, informed = given.pop("driver"), given.pop("arm", None), given.pop("informed", False)
    made = construct(f"driver {name!r}", DRIVERS[name], given)._replace(informed=_truth("informed", informed))
    if hands is None:
        return made
    if not isinstance(hands, Mapping):
        raise ValueError(f"arm must map {', '.join(Arm._fields)} to numbers, got {hands!r}")
    values = construct("arm", Arm, hands)._asdict()
    return made._replace(arm=Arm(*(not_negative(f"arm.{key}", value) for key, value in values.items())))


def as_mapping(driver: Driver) -> dict[str, Any]:
    """The mapping that :func:`resolve` turns into this driver again, of what JSON holds without loss."""
    options = {key: np.asarray(value).tolist() for key, value in driver.preview_model._asdict().items()}
    return {"driver": driver.name, **options, "arm": driver.arm._asdict(), "informed": driver.informed}


def preview_gains(driver: Driver, car: Car, speed: float, road_friction: float = 1.0) -> Array:
    """Gains (G,) of a driver's preview model for a car at a speed [m/s], on a road whose friction he knows [1]."""
    model = PREVIEW_MODELS[type(driver.preview_model)]
    return model.gains(model.on_road(driver.preview_model, road_friction), car, speed)


def command(parameters, gains, path, lateral_speed, yaw_rate, z, memory):
    """Handwheel angle [rad] that enters the delay line now."""
    return PREVIEW_MODELS[type(parameters)].command(parameters, gains, path, lateral_speed, yaw_rate, z, memory)


dispatch(command, lambda parameters, name: getattr(PREVIEW_MODELS.get(parameters), name, None))


def muscle_matrices() -> Array:
    """Intended angle, its speed and the muscles one update later (3, 4), from these and the command that takes effect.

    Exact for a command that is constant over the update.
    """
    from scipy import linalg  # here, because importing it takes longer than starting an environment

    omega = 2.0 * np.pi * ARM_FREQUENCY
    A = np.zeros((4, 4))
    A[0, 1], A[1, :3] = 1.0, (-(omega**2), -2.0 * ARM_DAMPING * omega, omega**2)
    A[2, 2], A[2, 3] = -1.0 / MUSCLE_LAG, 1.0 / MUSCLE_LAG
    return linalg.expm(A * UPDATE_INTERVAL)[:3].copy()


@kernel
def neuromuscular_step(parameters, gains, muscles, path, lateral_speed, yaw_rate, memory):
    """One update of a driver: the intended handwheel angle, speed and acceleration at its end [rad], [rad/s], [rad/s2].

    Parameters
    ----------
    parameters : of the preview model
    gains : (G,) array
    muscles : (3, 4) array
        As :func:`muscle_matrices`.
    path : (17,) array
        As for ``command`` in :func:`register_preview_model`.
    lateral_speed, yaw_rate : float
        [m/s], [rad/s]
    memory : (MEMORY + OWN_MEMORY,) array
        z, the reflex's errors, the preview model's own float, and the updates so far; changed in place.
    """
    z = memory[:NEUROMUSCULAR_STATES]
    memory[MEMORY + 1] += 1.0
    share = within(memory[MEMORY + 1] * UPDATE_INTERVAL / TAKING_OVER, 0.0, 1.0)
    new = share * command(parameters, gains, path, lateral_speed, yaw_rate, z, memory[MEMORY : MEMORY + 1])
    angle, speed, activation = 0.0, 0.0, 0.0
    for k in range(4):
        angle += muscles[0, k] * z[k]
        speed += muscles[1, k] * z[k]
        activation += muscles[2, k] * z[k]
    z[0], z[1], z[2] = angle, speed, activation
    for k in range(3, NEUROMUSCULAR_STATES - 1):
        z[k] = z[k + 1]
    z[NEUROMUSCULAR_STATES - 1] = new
    omega = 2.0 * np.pi * ARM_FREQUENCY
    return angle, speed, omega * (omega * (activation - angle) - 2.0 * ARM_DAMPING * speed)


@kernel
def delayed_error(memory, error, ahead):
    """Store the present angle error [rad], and return the one that the reflex answers ``ahead`` updates from now."""
    delayed = memory[NEUROMUSCULAR_STATES + ahead]
    for k in range(NEUROMUSCULAR_STATES, MEMORY - 1):
        memory[k] = memory[k + 1]
    memory[MEMORY - 1] = error
    return delayed
