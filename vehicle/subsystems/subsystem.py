"""What a subsystem is: a kernel, its parameters, and the names and start values of what goes in and comes out."""

import math
from collections.abc import Iterable, Mapping
from typing import Any, NamedTuple

from numpy.typing import NDArray

from steer_env.friction.numerics.interpolation import hermite
from steer_env.friction.numerics.kernel import kernel
from steer_env.vehicle.chassis.common.interface import WHEELS
from steer_env.vehicle.steering.eps import SAMPLE_TIME


class Signal(NamedTuple):
    """An input or output of a subsystem."""

    name: str
    unit: str
    description: str  # what it is, and where it is positive
    start: float = 0.0  # of an input, in its unit
    low: float = -math.inf  # least value, in its unit
    high: float = math.inf  # largest value, in its unit


class Subsystem(NamedTuple):
    """A part of the plant that advances by itself."""

    name: str
    title: str  # one sentence
    parameters: Any  # NamedTuple, frozen
    sections: tuple[str, ...]  # fields of the parameters that a user may change
    states: tuple[str, ...]  # names
    given: tuple[Signal, ...]  # the first of the given numbers; the rest stays zero
    given_size: int
    outputs: tuple[Signal, ...]
    inputs: int  # numbers that the kernel needs for the inputs of one sample
    start: NDArray  # (S,) settled state
    shown: NDArray  # (C,) outputs there
    zero_states: tuple[int, ...]  # states that are set to zero after settling
    zero_outputs: tuple[int, ...]


# What channels never leave.
_BOUNDS = {"throttle": (0.0, 1.0), "brake_pedal": (0.0, 1.0), "gear": (1.0, math.inf)}


def channel_signals(channels: Iterable[tuple[str, str]], meanings: Mapping[str, str]) -> tuple[Signal, ...]:
    """Outputs for channels, names and units, with what they mean; those of each wheel by their names without it."""
    found = []
    for name, unit in channels:
        wheel = next((w for w in WHEELS if name.endswith(f"_{w}") and name not in meanings), "")
        meaning = meanings.get(name.removesuffix(f"_{wheel}"), name.replace("_", " "))
        text = f"{wheel.replace('_', ' ')} wheel: {meaning}" if wheel else meaning
        low, high = _BOUNDS.get(name, (-math.inf, math.inf))
        found.append(Signal(name, unit, text, low=low, high=high))
    return tuple(found)


@kernel
def interpolate_hands(start, start_speed, end, end_speed, sample, samples):
    """Value and speed at the end of a sample of a communication step, of what is prescribed for its end.

    Up to there the value follows the cubic that meets value and speed at both ends.

    Parameters
    ----------
    start, start_speed : float
        At the beginning of the communication step.
    end, end_speed : float
        At its end.
    sample, samples : int
        Which sample, from 1, and how many there are.
    """
    if sample == samples:
        return end, end_speed
    length = samples * SAMPLE_TIME
    value, slope = hermite(sample / samples, start, end, start_speed * length, end_speed * length)
    return value, slope / length


@kernel
def is_finite(state):
    """Whether every state is finite."""
    finite = True
    for value in state:
        if not abs(value) < math.inf:
            finite = False
    return finite
