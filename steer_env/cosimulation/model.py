"""The part that is served, and its arrays: what a step of a session works on."""

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from steer_env.fmu import car, chassis, steering
from steer_env.fmu.part import Part
from steer_env.friction.numerics.kernel import dispatch, kernel

Array = NDArray[np.float64]


class Car(NamedTuple):
    """The whole car; its class selects the kernel."""

    plant: Any


class Steering(NamedTuple):
    """The steering alone; its class selects the kernel."""

    plant: Any


class Chassis(NamedTuple):
    """The chassis alone; its class selects the kernel."""

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
_CLASSES: dict[str, Any] = {kind.__name__.lower(): kind for kind in _KERNELS}


def advance(part, state, given, inputs, outputs, samples):
    """Advance a part by so many samples of 1 ms; whether its state is finite."""
    return _KERNELS[type(part)](part, state, given, inputs, outputs, samples)


dispatch(advance, lambda kind, _: _KERNELS.get(kind))


class Model(NamedTuple):
    """A part with its state, and the state that it returns to."""

    part: Any  # Car, Steering or Chassis
    state: Array  # (S,)
    given: Array  # (G,) inputs that hold, in the units of the part
    outputs: Array  # (1, C) in the units of the part
    inputs: Array  # (1, I) what the kernel receives in a sample
    before: Array  # (S,) state before the step, to return to where it does not stay finite
    start: Array  # (S,) state at the begin of a session
    begin: Array  # (G,) inputs at the begin of a session
    shown: Array  # (1, C) outputs at the begin of a session


def model_of(part: Part) -> Model:
    """A part of :func:`steer_env.fmu.parts.make_part` at the begin of a session."""
    begin = np.zeros(part.given_size)
    begin[: len(part.given)] = [signal.start for signal in part.given]
    shown = part.shown.reshape(1, -1).copy()
    return Model(
        part=_CLASSES[part.name](part.parameters),
        state=part.start.copy(),
        given=begin.copy(),
        outputs=shown.copy(),
        inputs=np.zeros((1, part.inputs)),
        before=part.start.copy(),
        start=part.start.copy(),
        begin=begin,
        shown=shown,
    )


@kernel
def _copy(source, target):
    for i in range(source.size):
        target[i] = source[i]


@kernel
def restart(model):
    """Return to the begin of a session."""
    _copy(model.start, model.state)
    _copy(model.begin, model.given)
    _copy(model.shown[0], model.outputs[0])


@kernel
def step(model, samples):
    """Advance the part; whether its state is finite. Where it is not, it stays as it was."""
    _copy(model.state, model.before)
    if advance(model.part, model.state, model.given, model.inputs, model.outputs, samples):
        return True
    _copy(model.before, model.state)
    return False
