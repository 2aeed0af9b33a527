"""The subsystems of a plant by the names that users type, and the kernels that begin and advance each of them."""

from typing import Any, NamedTuple

from steer_env.friction.numerics.check import one_of
from steer_env.friction.numerics.kernel import dispatch, kernel
from steer_env.vehicle import plant
from steer_env.vehicle.plant import Plant
from steer_env.vehicle.subsystems import car, chassis, steering
from steer_env.vehicle.subsystems.subsystem import Subsystem

SUBSYSTEMS = ("car", "steering", "chassis")
ROUNDING = 1e-6  # of a speed [m/s]


def make(name: str, p: Plant, speed: float) -> Subsystem:
    """A subsystem of a plant.

    Parameters
    ----------
    name : str
        One of ``SUBSYSTEMS``.
    p : Plant
    speed : float
        Start value of the vehicle's speed, which the steering takes; the others drive at the plant's [m/s].

    Raises
    ------
    ValueError
        For a name that is none of ``SUBSYSTEMS``, and for a car or chassis whose plant has another speed.
    """
    one_of("subsystem", name, SUBSYSTEMS)
    if name == "steering":
        return steering.subsystem(p, speed)
    own = plant.initial_speed(p)
    if abs(own - speed) > ROUNDING:
        raise ValueError(
            f"the plant of the {name} drives at {own:.6g} m/s, not at {speed:.6g} m/s: make it at that speed"
        )
    return (car if name == "car" else chassis).subsystem(p)


class Car(NamedTuple):
    """The whole car."""

    plant: Any


class Steering(NamedTuple):
    """The steering alone."""

    plant: Any


class Chassis(NamedTuple):
    """The chassis alone."""

    plant: Any


@kernel
def _car(subsystem, state, given, inputs, outputs, samples):
    return car.advance(subsystem.plant, state, given, inputs, outputs, samples)


@kernel
def _steering(subsystem, state, given, inputs, outputs, samples):
    return steering.advance(subsystem.plant, state, given, inputs, outputs, samples)


@kernel
def _chassis(subsystem, state, given, inputs, outputs, samples):
    return chassis.advance(subsystem.plant, state, given, inputs, outputs, samples)


@kernel
def _begin_plant(subsystem, state):
    return plant.begin(plant.rolling(subsystem.plant), state)


@kernel
def _begin_steering(subsystem, state):
    steering.begin(subsystem.plant, state)
    return 0


_BEGIN: dict[type, Any] = {Car: _begin_plant, Steering: _begin_steering, Chassis: _begin_plant}
_KERNELS: dict[type, Any] = {Car: _car, Steering: _steering, Chassis: _chassis}
CLASSES: dict[str, Any] = {kind.__name__.lower(): kind for kind in _KERNELS}  # by the name of the subsystem


def register(kind: type, function: Any) -> None:
    """Make a further class known, with its kernel as :func:`advance`."""
    _KERNELS[kind] = function


def bound(subsystem: Any) -> Any:
    """A subsystem by its class as compiled kernels take it in this process (:func:`steer_env.vehicle.plant.bound`)."""
    return subsystem._replace(plant=plant.bound(subsystem.plant)) if type(subsystem) in _BEGIN else subsystem


def begin(subsystem, state):
    """Write the state from which a subsystem settles in straight running, and in how many samples."""
    return _BEGIN[type(subsystem)](bound(subsystem), state)


def advance(subsystem, state, given, inputs, outputs, samples):
    """Advance a subsystem by so many samples of 1 ms; whether its state is finite."""
    return _KERNELS[type(subsystem)](bound(subsystem), state, given, inputs, outputs, samples)


dispatch(begin, lambda kind, _: _BEGIN.get(kind))
# Within its caller, so that a step of an FMU does not hand all parameters over by value.
dispatch(advance, lambda kind, _: _KERNELS.get(kind), forceinline=True)
