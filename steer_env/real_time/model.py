"""A part of the plant that runs step by step, and its arrays."""

import math
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from steer_env.fmu import car, chassis, steering
from steer_env.fmu.part import Part, is_finite
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


# What becomes of an input that no longer arrives: efforts and commands fade, positions hold, their speeds are zero.
FADES, HOLDS, STOPS = range(3)
_STALE = {
    **{"hand_angle": HOLDS, "rack_travel": HOLDS, "vehicle_speed": HOLDS},
    **{"hand_speed": STOPS, "rack_speed": STOPS},
}
# Largest size of an input that is taken, in its unit, far beyond what a car meets; all assumed. What is larger is the
# mistake of a unit or a sensor, and would leave a state behind that takes seconds to return.
LARGEST = {
    "hand_torque": 200.0,
    "hand_angle": 30.0,  # nearly five turns to either side
    "hand_speed": 200.0,
    "assist_request": 200.0,
    "wind_force": 1e5,
    "wind_moment": 1e5,
    "rack_disturbance": 1e5,
    "rack_force": 1e5,
    "vehicle_speed": 150.0,
    "rack_travel": 1.0,
    "rack_speed": 10.0,
}


class Model(NamedTuple):
    """A part with its state, and the state that it returns to."""

    part: Any  # Car, Steering or Chassis
    state: Array  # (S,)
    given: Array  # (G,) inputs that act, in the units of the part
    wanted: Array  # (G,) inputs as they arrived last, in real time
    stale: NDArray[np.int64]  # (G,) what becomes of each that no longer arrives: FADES, HOLDS or STOPS
    largest: Array  # (G,) size of each beyond which it is not taken
    outputs: Array  # (1, C) in the units of the part
    last: Array  # (C,) outputs before the step, to return to as well
    inputs: Array  # (1, I) what the kernel receives in a sample
    before: Array  # (S,) state before the step, to return to where it does not stay finite
    start: Array  # (S,) state at the begin of a session
    begin: Array  # (G,) inputs at the begin of a session
    shown: Array  # (1, C) outputs at the begin of a session
    torque: int  # place of the torsion bar's torque among the outputs, -1 where there is none
    speed: int  # place of the handwheel's speed
    begun: NDArray[np.int64]  # (1,) how often it returned to the begin


def model_of(part: Part) -> Model:
    """A part of :func:`steer_env.fmu.parts.make_part` at the begin of a session."""
    begin = np.zeros(part.given_size)
    begin[: len(part.given)] = [signal.start for signal in part.given]
    stale = np.full(part.given_size, FADES)
    stale[: len(part.given)] = [_STALE.get(signal.name, FADES) for signal in part.given]
    largest = np.full(part.given_size, math.inf)
    largest[: len(part.given)] = [LARGEST.get(signal.name, math.inf) for signal in part.given]
    names = [signal.name for signal in part.outputs]
    shown = part.shown.reshape(1, -1).copy()
    return Model(
        part=_CLASSES[part.name](part.parameters),
        state=part.start.copy(),
        given=begin.copy(),
        wanted=begin.copy(),
        stale=stale,
        largest=largest,
        outputs=shown.copy(),
        last=shown[0].copy(),
        inputs=np.zeros((1, part.inputs)),
        before=part.start.copy(),
        start=part.start.copy(),
        begin=begin,
        shown=shown,
        torque=names.index("torsion_bar_torque") if "torsion_bar_torque" in names else -1,
        speed=names.index("handwheel_speed") if "handwheel_speed" in names else -1,
        begun=np.zeros(1, np.int64),
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
    _copy(model.begin, model.wanted)
    _copy(model.shown[0], model.outputs[0])
    model.begun[0] += 1


@kernel
def step(model, samples):
    """Advance the part; whether state and outputs are finite. Where they are not, both stay as they were."""
    _copy(model.state, model.before)
    _copy(model.outputs[0], model.last)
    finite = advance(model.part, model.state, model.given, model.inputs, model.outputs, samples)
    if finite and is_finite(model.outputs[0]):
        return True
    _copy(model.before, model.state)
    _copy(model.last, model.outputs[0])
    return False


@kernel
def implausible(model, inputs):
    """Number of the first input that is not finite or larger than LARGEST; -1 where there is none."""
    for i in range(inputs.size):
        if not (abs(inputs[i]) <= model.largest[i] and abs(inputs[i]) < math.inf):
            return i
    return -1


@kernel
def take_inputs(model, gain, arrives):
    """Let the inputs act as they arrived last; where they no longer arrive, what fades has this gain."""
    for i in range(model.wanted.size):
        value = model.wanted[i]
        if model.stale[i] == FADES:
            value = value * gain
        elif model.stale[i] == STOPS and not arrives:
            value = 0.0
        model.given[i] = value
