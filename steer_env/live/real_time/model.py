"""A subsystem of the plant that runs step by step, and its arrays."""

import math
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from steer_env.friction.numerics.kernel import kernel
from steer_env.live.real_time.configurations import Switch
from steer_env.vehicle.subsystems import CLASSES, Subsystem, advance, bound, is_finite
from steer_env.vehicle.subsystems.machine_code import Tunable

if TYPE_CHECKING:
    from steer_env.live.real_time.configurations import CarConfigurations

Array = NDArray[np.float64]


# What becomes of an input that no longer arrives: efforts and commands fade, positions hold, their speeds are zero.
FADES, HOLDS, STOPS = range(3)
_STALE = {
    **{"hand_angle": HOLDS, "rack_travel": HOLDS, "vehicle_speed": HOLDS},
    **{"hand_speed": STOPS, "rack_speed": STOPS},
}
# Handwheel speed beyond which a change of its angle is a fault of the sensor, and no motion [rad/s]; assumed. Hands
# reach some 25, a motor without hands some 40.
FASTEST = 60.0


class Model(NamedTuple):
    """A subsystem with its state, and the state that it returns to."""

    subsystem: Any  # Car, Steering, Chassis or Switch
    state: Array  # (S,)
    given: Array  # (G,) inputs that act, in the units of the subsystem
    wanted: Array  # (G,) inputs as they arrived last, in real time
    stale: NDArray[np.int64]  # (G,) what becomes of each that no longer arrives: FADES, HOLDS or STOPS
    low: Array  # (G,) least value of each, below which it is not taken
    high: Array  # (G,) largest value of each
    outputs: Array  # (1, C) in the units of the subsystem
    last: Array  # (C,) outputs before the step, to return to as well
    inputs: Array  # (1, I) what the kernel receives in a sample
    before: Array  # (S,) state before the step, to return to where it does not stay finite
    start: Array  # (S,) state at the begin of a session
    begin: Array  # (G,) inputs at the begin of a session
    shown: Array  # (1, C) outputs at the begin of a session
    torque: int  # place of the torsion bar's torque among the outputs, -1 where there is none
    speed: int  # place of the handwheel's speed
    angle: int  # place of the handwheel's angle among the inputs, -1 where it is none
    begun: NDArray[np.int64]  # (1,) how often it returned to the begin
    released: NDArray[np.int64]  # (1,) not 0 where a dead-man key is needed and not held
    now: Array  # (3,) configuration that acts, the next one or -1, and its share


def running_subsystem(source: "Subsystem | CarConfigurations") -> Subsystem:
    """The subsystem that a loop runs: that of the configurations, or the subsystem itself."""
    return source if isinstance(source, Subsystem) else source.subsystem


def make_model(source: "Subsystem | CarConfigurations") -> Model:
    """A subsystem of :func:`steer_env.vehicle.subsystems.make`, or configurations, at the begin of a session."""
    subsystem = running_subsystem(source)
    own = isinstance(subsystem.parameters, Switch | Tunable)
    begin = np.zeros(subsystem.given_size)
    begin[: len(subsystem.given)] = [signal.start for signal in subsystem.given]
    stale = np.full(subsystem.given_size, FADES)
    stale[: len(subsystem.given)] = [_STALE.get(signal.name, FADES) for signal in subsystem.given]
    low, high = (np.full(subsystem.given_size, bound) for bound in (-math.inf, math.inf))
    low[: len(subsystem.given)] = [signal.low for signal in subsystem.given]
    high[: len(subsystem.given)] = [signal.high for signal in subsystem.given]
    names, given = ([signal.name for signal in signals] for signals in (subsystem.outputs, subsystem.given))
    shown = subsystem.shown.reshape(1, -1).copy()
    return Model(
        subsystem=subsystem.parameters if own else bound(CLASSES[subsystem.name](subsystem.parameters)),
        state=subsystem.start.copy(),
        given=begin.copy(),
        wanted=begin.copy(),
        stale=stale,
        low=low,
        high=high,
        outputs=shown.copy(),
        last=shown[0].copy(),
        inputs=np.zeros((1, subsystem.inputs)),
        before=subsystem.start.copy(),
        start=subsystem.start.copy(),
        begin=begin,
        shown=shown,
        torque=names.index("torsion_bar_torque") if "torsion_bar_torque" in names else -1,
        speed=names.index("handwheel_speed") if "handwheel_speed" in names else -1,
        angle=given.index("hand_angle") if "hand_angle" in given else -1,
        begun=np.zeros(1, np.int64),
        released=np.zeros(1, np.int64),
        now=subsystem.parameters.now if isinstance(subsystem.parameters, Switch) else np.array([0.0, -1.0, 0.0]),
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
    """Advance the subsystem; whether state and outputs are finite. Where they are not, both stay as they were."""
    _copy(model.state, model.before)
    _copy(model.outputs[0], model.last)
    finite = advance(model.subsystem, model.state, model.given, model.inputs, model.outputs, samples)
    if finite and is_finite(model.outputs[0]):
        return True
    _copy(model.before, model.state)
    _copy(model.last, model.outputs[0])
    return False


@kernel
def implausible(model, inputs):
    """Number of the first input that is not finite or outside its bounds; -1 where there is none."""
    for i in range(inputs.size):
        if not (model.low[i] <= inputs[i] <= model.high[i] and abs(inputs[i]) < math.inf):
            return i
    return -1


@kernel
def jumps(model, elapsed):
    """Whether the handwheel angle that arrived is further from the one that acts than it turns in a time [s]."""
    return model.angle >= 0 and abs(model.wanted[model.angle] - model.given[model.angle]) > FASTEST * elapsed


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
