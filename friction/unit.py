"""A law as a unit: its functions behind addresses, by which every loop, column and plant calls every law.

What is compiled for a :class:`steer_env.friction.numerics.units.Part` is the same machine code for all laws, and a law
is compiled once, here, by itself. The functions are those of :mod:`steer_env.friction.law` and
:mod:`steer_env.friction.level`, to the bit; where several of them follow each other they are one call.
"""

from types import SimpleNamespace
from typing import Any

from steer_env.friction import law as laws
from steer_env.friction import level
from steer_env.friction.law import LAWS, law_of
from steer_env.friction.level import Scales
from steer_env.friction.numerics import units
from steer_env.friction.numerics.kernel import dispatch, kernel
from steer_env.friction.numerics.units import (
    RETURNS_NOTHING,
    RETURNS_NUMBER,
    RETURNS_TWO_NUMBERS,
    Code,
    Function,
    Part,
    array,
    caller,
    number,
    values,
)


@kernel
def _torque(numbers, sizes, torque_scale, memory, w):
    return number(laws.torque(values(numbers, sizes), torque_scale, array(memory, sizes), w), w)


@kernel
def _advance(numbers, sizes, torque_scale, memory, w, h):
    laws.advance(values(numbers, sizes), torque_scale, array(memory, sizes), w, h)


@kernel
def _rest_torque(numbers, sizes, torque_scale, memory, h):
    return number(laws.rest_torque(values(numbers, sizes), torque_scale, array(memory, sizes), h), torque_scale)


@kernel
def _scale_at_rest(numbers, sizes, positive, negative, memory, h):
    scale, rest = level.scale_at_rest(values(numbers, sizes), Scales(positive, negative), array(memory, sizes), h)
    return scale, number(rest, scale)


@kernel
def _step(numbers, sizes, positive, negative, memory, S, R, h, w_guess):
    both = Scales(positive, negative)
    w, T = level.step(values(numbers, sizes), both, array(memory, sizes), S, R, h, w_guess)
    return number(w, R), T


@kernel
def _solve(numbers, sizes, torque_scale, memory, S, R, h, w_guess):
    return number(laws.solve(values(numbers, sizes), torque_scale, array(memory, sizes), S, R, h, w_guess), R)


@kernel
def _mean_torque(numbers, sizes, torque_scale, memory, w, h):
    T, slope = laws.mean_torque(values(numbers, sizes), torque_scale, array(memory, sizes), w, h)
    return number(T, w), number(slope, w)


@kernel
def _rate(numbers, sizes, torque_scale, memory, w, out):
    laws.rate(values(numbers, sizes), torque_scale, array(memory, sizes), w, array(out, sizes))


FUNCTIONS = (  # in the order of their addresses
    Function(_torque, "npn", RETURNS_NUMBER),
    Function(_advance, "npnn", RETURNS_NOTHING),
    Function(_rest_torque, "npn", RETURNS_NUMBER),
    Function(_scale_at_rest, "nnpn", RETURNS_TWO_NUMBERS),
    Function(_step, "nnpnnnn", RETURNS_TWO_NUMBERS),
    Function(_solve, "npnnnn", RETURNS_NUMBER),
    Function(_mean_torque, "npnn", RETURNS_TWO_NUMBERS),
    Function(_rate, "npnp", RETURNS_NOTHING),
)
TORQUE, ADVANCE, REST_TORQUE, SCALE_AT_REST, STEP, SOLVE, MEAN_TORQUE, RATE = range(len(FUNCTIONS))
_one, _two, _none = caller(RETURNS_NUMBER), caller(RETURNS_TWO_NUMBERS), caller(RETURNS_NOTHING)


@kernel
def _torque_of(p, torque_scale, memory, w):
    return _one(p, TORQUE, (torque_scale, memory, w))


@kernel
def _advance_of(p, torque_scale, memory, w, h):
    _none(p, ADVANCE, (torque_scale, memory, w, h))


@kernel
def _rest_torque_of(p, torque_scale, memory, h):
    return _one(p, REST_TORQUE, (torque_scale, memory, h))


@kernel
def _scale_at_rest_of(p, scales, memory, h):
    return _two(p, SCALE_AT_REST, (scales.positive, scales.negative, memory, h))


@kernel
def _step_of(p, scales, memory, S, R, h, w_guess):
    return _two(p, STEP, (scales.positive, scales.negative, memory, S, R, h, w_guess))


@kernel
def _solve_of(p, torque_scale, memory, S, R, h, w_guess):
    return _one(p, SOLVE, (torque_scale, memory, S, R, h, w_guess))


@kernel
def _mean_torque_of(p, torque_scale, memory, w, h):
    return _two(p, MEAN_TORQUE, (torque_scale, memory, w, h))


@kernel
def _rate_of(p, torque_scale, memory, w, out):
    _none(p, RATE, (torque_scale, memory, w, out))


# Dispatch points, as those of steer_env.friction.law, for a law of any form.


def scale_at_rest(p, scales, memory, h):
    """:func:`steer_env.friction.level.scale_at_rest`."""
    return level.scale_at_rest(p, scales, memory, h)


def step(p, scales, memory, S, R, h, w_guess):
    """:func:`steer_env.friction.level.step`."""
    return level.step(p, scales, memory, S, R, h, w_guess)


_BY_ADDRESS = {"scale_at_rest": _scale_at_rest_of, "step": _step_of}
for _point in (scale_at_rest, step):
    dispatch(_point, lambda kind, name: (_BY_ADDRESS if kind is Part else vars(level))[name])


def functions(p: Any, wide: bool = False) -> tuple[Function | None, ...]:
    """The functions of a law; None for one that it does not have, or that no kernel of four cars side by side calls."""
    left_out = [*([] if law_of(p).mean_torque else [MEAN_TORQUE]), *([RATE] if wide else [])]
    return tuple(None if k in left_out else function for k, function in enumerate(FUNCTIONS))


def code(p: Any, wide: bool = False) -> Code:
    """The code of a law in this process; ``wide`` is for kernels of four cars side by side.

    Raises
    ------
    ValueError
        One of its functions does not return what it should.
    """
    law = law_of(p)
    try:
        return units.code(p, functions(p, wide), law.memory_size(p), wide)
    except TypeError as error:
        raise ValueError(f"friction law {law.name!r}: {error}") from None


_LAW_BY_ADDRESS: Any = SimpleNamespace(  # all that kernels ask of a law
    advance=_advance_of,
    torque=_torque_of,
    rate=_rate_of,
    mean_torque=_mean_torque_of,
    solve=_solve_of,
    rest_torque=_rest_torque_of,
)
LAWS.know(Part, _LAW_BY_ADDRESS)
