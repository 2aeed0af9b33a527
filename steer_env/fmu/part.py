"""What a part is: a kernel, its parameters, and the names and start values of what goes in and comes out."""

from collections.abc import Callable
from typing import Any, NamedTuple

from numpy.typing import NDArray


class Signal(NamedTuple):
    """An input or output of a unit."""

    name: str
    unit: str
    description: str


class Part(NamedTuple):
    """A part of the plant that becomes a unit."""

    name: str
    title: str  # one sentence
    advance: Callable  # kernel (p, state, given, inputs, outputs, samples) -> whether the state is finite
    parameters: Any  # NamedTuple, frozen
    sections: tuple[str, ...]  # fields of the parameters that become parameters of the unit
    states: tuple[str, ...]  # names
    given: tuple[Signal, ...]  # the first of the given numbers; the rest stays zero
    given_size: int
    outputs: tuple[Signal, ...]
    inputs: int  # numbers that the kernel needs for the inputs of one sample
    begin: NDArray  # (S,) state from which it settles
    start: NDArray  # (S,) settled state
    shown: NDArray  # (C,) outputs there
    zero_states: tuple[int, ...]  # states that are set to zero after settling
    zero_outputs: tuple[int, ...]
    settling: int  # samples
