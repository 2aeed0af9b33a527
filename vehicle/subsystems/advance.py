"""One kernel that advances every part: the class around the parameters selects the part's own."""

from typing import Any, NamedTuple

from steer_env.friction.numerics.kernel import dispatch, kernel
from steer_env.vehicle.subsystems import car, chassis, steering


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
def _car(part, state, given, inputs, outputs, samples):
    return car.advance(part.plant, state, given, inputs, outputs, samples)


@kernel
def _steering(part, state, given, inputs, outputs, samples):
    return steering.advance(part.plant, state, given, inputs, outputs, samples)


@kernel
def _chassis(part, state, given, inputs, outputs, samples):
    return chassis.advance(part.plant, state, given, inputs, outputs, samples)


_KERNELS: dict[type, Any] = {Car: _car, Steering: _steering, Chassis: _chassis}
CLASSES: dict[str, Any] = {kind.__name__.lower(): kind for kind in _KERNELS}  # by the name of the part


def register(kind: type, function: Any) -> None:
    """Make a further class known, with its kernel as :func:`advance`."""
    _KERNELS[kind] = function


def advance(part, state, given, inputs, outputs, samples):
    """Advance a part by so many samples of 1 ms; whether its state is finite."""
    return _KERNELS[type(part)](part, state, given, inputs, outputs, samples)


# Within its caller, so that a step of a unit does not hand all parameters over by value.
dispatch(advance, lambda kind, _: _KERNELS.get(kind), forceinline=True)
