"""What a driver model is: eyes that give a command every 10 ms, muscles that carry it out late, and arms.

A model sees the path ahead in the car's frame, as the tasks' ``SIGHT`` has it, lateral speed and yaw rate, and commands
a handwheel angle. The command waits for ``delay``, muscles lag behind it, and what they intend is a second-order lag:

    z = (angle, angle', muscles, commands on their way)         intended angle and speed: the first two of z

The arms hold the handwheel by their impedance to the intended angle, with the torque that this angle is known to take,
and a reflex on the error that is ``REFLEX_DELAY`` old:

    T1 = K_arm (angle - th1) + C_arm (angle' - th1') - I_arm th1'' + K_steer angle + K_reflex (angle - th1)(t - delay)

A model is one file: parameters (their class selects the kernel), a function that gives the gains for a car at a speed,
and the kernel from what is seen to the command. Sources: structure and ranges of arms after Pick, Cole, Dynamic
properties of a driver's arms holding a steering wheel, Proc. IMechE D 221 (2007); values assumed within.
"""

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from steer_env.friction.numerics.check import not_negative, number, positive
from steer_env.friction.numerics.kernel import dispatch, kernel
from steer_env.friction.numerics.registry import Registry
from steer_env.tasks.common.definition import NODE
from steer_env.vehicle.cars import Car

Array = NDArray[np.float64]

SAMPLE = NODE  # [s]
DELAY = 0.12  # from seeing to the muscles' command [s]
MUSCLE_LAG = 0.05  # of the muscles behind their command, assumed [s]
ARM_FREQUENCY = 4.0  # natural frequency of what the muscles intend, assumed [Hz]
ARM_DAMPING = 0.7  # assumed [1]
REFLEX_DELAY = 0.05  # [s]
TORQUE_LIMIT = 25.0  # of both hands [N m]

QUEUE = round(DELAY / SAMPLE)  # commands on their way
REFLEX = round(REFLEX_DELAY / SAMPLE)  # errors on their way
INTENT = 3 + QUEUE  # size of z
MEMORY = INTENT + REFLEX


class Arm(NamedTuple):
    """Arms on the handwheel; :func:`arm` checks."""

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
        A value out of range.
    """
    share = number("co_contraction", co_contraction, minimum=0.0, maximum=1.0)
    ends = [(positive("damping", d), positive("stiffness", k)) for d, k in (relaxed, tensed)]
    damping, stiffness = (low + share * (high - low) for low, high in zip(*ends))
    return Arm(not_negative("inertia", inertia), damping, stiffness, not_negative("reflex", reflex))


# Hands that hold the handwheel as firmly as hands can; the robot of a driver environment.
ROBOT = Arm(0.0, 4.4, 200.0, 0.0)
FREE = Arm(0.0, 0.0, 0.0, 0.0)


class Driver(NamedTuple):
    """A driver model with its arms; :func:`make` checks."""

    name: str
    eyes: Any  # parameters of a model of seeing; their class selects it
    arm: Arm


class Eyes(NamedTuple):
    """A registered model of seeing; :func:`register` tells the meaning of the fields."""

    parameters: type
    gains: Callable[[Any, Car, float], Array]  # parameters, car, speed -> (G,)
    command: Callable


_eyes: dict[type, Eyes] = {}
DRIVERS: Registry[Callable[..., Driver]] = Registry("driver", "steer_env.drivers")


def register_eyes(parameters: type, gains: Callable[[Any, Car, float], Array], command: Callable) -> None:
    """Make a model of seeing known.

    Parameters
    ----------
    parameters : NamedTuple class
    gains : ``(parameters, car, speed) -> (G,) array``
    command : ``(parameters, gains, sight, lateral_speed, yaw_rate, z, memory) -> float``
        Handwheel angle [rad] to be on its way now; ``memory`` is one float of the model's own.
    """
    _eyes[parameters] = Eyes(parameters, gains, command)


def register(name: str, maker: Callable[..., Driver]) -> None:
    """Make a driver known: a function that gives it, its options with their standard values."""
    DRIVERS.register(name, maker)


def available() -> tuple[str, ...]:
    """Names of the drivers."""
    return DRIVERS.available()


def make(name: str, **options: Any) -> Driver:
    """A driver by name; ValueError for a name that there is not, TypeError for an unknown option."""
    return DRIVERS[name](**options)


def resolve(driver: Any) -> Driver:
    """A driver from its name, or as it is."""
    if isinstance(driver, str):
        return make(driver)
    if not isinstance(driver, Driver):
        raise ValueError(f"driver must be one of {', '.join(available())} or from drivers.make, got {driver!r}")
    return driver


def gains_of(driver: Driver, car: Car, speed: float) -> Array:
    """Gains (G,) of a driver's eyes for a car at a speed [m/s]."""
    return _eyes[type(driver.eyes)].gains(driver.eyes, car, speed)


def command(parameters, gains, sight, lateral_speed, yaw_rate, z, memory):
    """Handwheel angle [rad] to be on its way now."""
    return _eyes[type(parameters)].command(parameters, gains, sight, lateral_speed, yaw_rate, z, memory)


dispatch(command, lambda parameters, name: getattr(_eyes.get(parameters), name, None))


def execution() -> Array:
    """Handwheel angle, its speed and the muscles a sample later (3, 4), from these and the command that arrives."""
    from scipy import linalg  # here, for it takes longer to import than an environment to start

    omega = 2.0 * np.pi * ARM_FREQUENCY
    A = np.zeros((4, 4))
    A[0, 1], A[1, :3] = 1.0, (-(omega**2), -2.0 * ARM_DAMPING * omega, omega**2)
    A[2, 2], A[2, 3] = -1.0 / MUSCLE_LAG, 1.0 / MUSCLE_LAG
    return linalg.expm(A * SAMPLE)[:3].copy()


@kernel
def intend(parameters, gains, execution, sight, lateral_speed, yaw_rate, memory):
    """One sample of a driver: the intended handwheel angle [rad] and speed [rad/s] at its end.

    Parameters
    ----------
    parameters : of the eyes
    gains : (G,) array
    execution : (3, 4) array
        Angle, speed and muscles a sample later, from these and the command that arrives.
    sight : (17,) array
        As ``steer_env.tasks.common.terms.SIGHT``.
    lateral_speed, yaw_rate : float
        [m/s], [rad/s]
    memory : (MEMORY + 1,) array
        z, the reflex's errors, and the model's own float; changed in place.
    """
    z = memory[:INTENT]
    new = command(parameters, gains, sight, lateral_speed, yaw_rate, z, memory[MEMORY:])
    angle, speed, muscles = 0.0, 0.0, 0.0
    for k in range(4):
        angle += execution[0, k] * z[k]
        speed += execution[1, k] * z[k]
        muscles += execution[2, k] * z[k]
    z[0], z[1], z[2] = angle, speed, muscles
    for k in range(3, INTENT - 1):
        z[k] = z[k + 1]
    z[INTENT - 1] = new
    return angle, speed


@kernel
def late_error(memory, error, ahead):
    """The error of the angle [rad] that the reflex answers to ``ahead`` samples from now; takes in the present one."""
    late = memory[INTENT + ahead]
    for k in range(INTENT, MEMORY - 1):
        memory[k] = memory[k + 1]
    memory[MEMORY - 1] = error
    return late
