"""Four numbers at once, one for each wheel: arithmetic and elementary functions on vectors of four lanes.

The four wheels obey the same equations, and no compiler turns a loop over them into vector instructions by itself. The
kernels therefore state each equation once, for a vector. Compiled, a vector is an LLVM vector of four doubles, which
LLVM translates to the vector instructions of the processor, fused multiply-add included. A plain number that meets a
vector counts for all four lanes. No operation mixes lanes (except :func:`swap_sides`), so the result of a wheel
depends on that wheel alone. The elementary functions apply the sign of their argument last, so that their symmetry is
exact to the last bit.

A condition that differs between the lanes selects results by :func:`where`. A kernel takes a branch if :func:`any_of`
the lanes needs it; such a branch must leave the results of the other lanes unchanged. Without the compiler
(``NUMBA_DISABLE_JIT=1``) numpy evaluates numbers and arrays of four; the elementary functions then differ in the last
bit.

Source: S. Moshier and Sun Microsystems, fdlibm ``s_atan.c``, for the intervals and the polynomial of the arc tangent.
The sine is the Taylor polynomial of degree 21 after a reduction by multiples of pi in three parts (Cody and Waite), the
exponential that of degree 13 after a reduction by multiples of log 2.
"""

import math
import operator
from collections.abc import Callable
from functools import partial
from typing import Any

import numpy as np

from steer_env.friction.numerics.kernel import COMPILED


def pack(a: Any, b: Any, c: Any, d: Any) -> Any:
    """The vector of four numbers."""
    return np.array([a, b, c, d])


def unpack(x: Any) -> Any:
    """The four numbers of a vector."""
    return tuple(x)


def broadcast(x: Any) -> Any:
    """The vector that holds one number in all four lanes; :func:`first` is the inverse."""
    return x


def first(x: Any) -> Any:
    """The number in the first lane of a vector."""
    return x


def swap_sides(x: Any) -> Any:
    """The vector with left and right exchanged: each lane receives the value of the other wheel of its axle."""
    return x[[1, 0, 3, 2]]


def load(array: Any, i: int) -> Any:
    """Four consecutive elements of a contiguous array, from the flat index ``i``."""
    return array.reshape(-1)[i : i + 4].copy()


def store(array: Any, i: int, x: Any) -> None:
    """Write a vector to four consecutive elements of a contiguous array, from ``i``."""
    array[i : i + 4] = x


def where(condition: Any, then: Any, otherwise: Any) -> Any:
    """One of two values in each lane."""
    return np.where(condition, then, otherwise)


def any_of(condition: Any) -> Any:
    """Whether the condition holds in any lane."""
    return np.any(condition)


def minimum(x: Any, limit: Any) -> Any:
    """``min`` in each lane; NaN in ``x`` stays NaN."""
    return np.where(limit < x, limit, x)


def maximum(x: Any, limit: Any) -> Any:
    """``max`` in each lane; NaN in ``x`` stays NaN."""
    return np.where(limit > x, limit, x)


def fabs(x: Any) -> Any:
    """Absolute value."""
    return np.fabs(x)


def copysign(magnitude: Any, sign: Any) -> Any:
    """Absolute value of the first argument with the sign of the second."""
    return np.copysign(magnitude, sign)


def sqrt(x: Any) -> Any:
    """Square root."""
    return np.sqrt(x)


def power(x: Any, y: Any) -> Any:
    """``x**y``; takes as long as four scalar powers."""
    return np.power(x, y)


def exp(x: Any) -> Any:
    """Exponential, with a relative error of 4e-16; of results below 2.3e-308 to one unit in the last place."""
    return np.exp(x)


def atan(x: Any) -> Any:
    """Arc tangent, to one unit in the last place."""
    return np.arctan(x)


def sin(x: Any) -> Any:
    """Sine, with an absolute error of 4e-16 for arguments up to 1e8 in magnitude, and NaN beyond."""
    return np.sin(x)


def cos(x: Any) -> Any:
    """Cosine, with an absolute error of 4e-16 for arguments up to 1e8 in magnitude, and NaN beyond."""
    return np.cos(x)


if COMPILED:
    from llvmlite import ir
    from numba import types
    from numba.extending import lower_builtin, lower_cast, models, register_model, type_callable

    _DOUBLE, _INT, _LONG, _BIT = ir.DoubleType(), ir.IntType(32), ir.IntType(64), ir.IntType(1)
    _FOUR, _LONGS, _BITS = (ir.VectorType(kind, 4) for kind in (_DOUBLE, _LONG, _BIT))

    class Four(types.Type):
        """The numba type of a vector of four doubles; a plain number converts to it."""

        def can_convert_from(self, typing_context, other):
            return typing_context.can_convert(other, types.float64) if isinstance(other, types.Number) else None

        def unify(self, typing_context, other):
            return self if isinstance(other, types.Number) else None

    class Mask(types.Type):
        """The numba type of a vector of four conditions."""

    FOUR, MASK = Four("Four"), Mask("Mask")

    @register_model(Four)
    class _FourModel(models.PrimitiveModel):
        def __init__(self, manager, kind):
            super().__init__(manager, kind, _FOUR)

    @register_model(Mask)
    class _MaskModel(models.PrimitiveModel):
        def __init__(self, manager, kind):
            super().__init__(manager, kind, _BITS)

    def _constant(value: float, kind: Any = _FOUR) -> Any:
        return ir.Constant(kind, [ir.Constant(kind.element, value)] * 4)

    def _pack(build, *numbers):
        vector = ir.Constant(_FOUR, ir.Undefined)
        for i, number in enumerate(numbers):
            vector = build.insert_element(vector, number, ir.Constant(_INT, i))
        return vector

    def _extract(build, vector):
        return [build.extract_element(vector, ir.Constant(_INT, i)) for i in range(4)]

    def _unpack(build, vector):
        members = ir.Constant(ir.ArrayType(_DOUBLE, 4), ir.Undefined)
        for i, number in enumerate(_extract(build, vector)):
            members = build.insert_value(members, number, i)
        return members

    def _shuffle(places, build, vector):
        return build.shuffle_vector(vector, vector, ir.Constant(ir.VectorType(_INT, 4), places))

    def _splat(build, number):
        return _shuffle((0, 0, 0, 0), build, _pack(build, number))

    @lower_cast(types.Number, FOUR)
    def _widen(context, build, old, new, value):
        return _splat(build, context.cast(build, value, old, types.float64))

    def _define(function: Any, result: Any, kinds: tuple[Any, ...], generate: Callable) -> None:
        """Let compiled code translate ``function`` on arguments of these types by ``generate``; numbers convert."""
        count, scalar, name = len(kinds), types.float64 in kinds, getattr(function, "__name__", "")

        def typer(context):
            if count == 1:
                return lambda x: result(*kinds) if scalar or x == kinds[0] else None
            if count == 2:
                return lambda x, y: result(*kinds) if scalar or kinds[0] in (x, y) else None
            if count == 3:
                return lambda x, y, z: result(*kinds) if kinds[0] in (x, y, z) else None
            return lambda a, b, c, d: result(*kinds)

        typer.__name__ = name
        type_callable(function)(typer)
        lower_builtin(function, *kinds)(lambda context, build, _, arguments: generate(build, *arguments))

    def _address(context, build, kind, array, i):
        """Pointer to four elements from ``i``. An array guarantees the alignment of one number only."""
        data = context.make_array(kind)(context, build, array).data
        return build.bitcast(build.gep(data, [i]), _FOUR.as_pointer())

    def _contiguous(array):
        return isinstance(array, types.Array) and array.layout == "C" and array.dtype == types.float64

    @type_callable(load)
    def _type_load(context):
        return lambda array, i: FOUR(array, types.intp) if _contiguous(array) else None

    @lower_builtin(load, types.Array, types.intp)
    def _load(context, build, kind, arguments):
        return build.load(_address(context, build, kind.args[0], *arguments), align=8)

    @type_callable(store)
    def _type_store(context):
        return lambda array, i, x: types.none(array, types.intp, FOUR) if _contiguous(array) else None

    @lower_builtin(store, types.Array, types.intp, FOUR)
    def _store(context, build, kind, arguments):
        build.store(arguments[2], _address(context, build, kind.args[0], *arguments[:2]), align=8)
        return context.get_dummy_value()

    def _call(name, build, *arguments):
        kind = ir.FunctionType(_FOUR, [_FOUR] * len(arguments))
        return build.call(build.module.declare_intrinsic(f"llvm.{name}.v4f64", (), kind), arguments)

    def _polynomial(build, x, coefficients):
        value = _constant(coefficients[-1])
        for coefficient in reversed(coefficients[:-1]):
            value = _call("fmuladd", build, x, value, _constant(coefficient))
        return value

    # atan x = atan(middle of the interval) + atan((x - middle)/(1 + x middle)), from the outermost interval inwards
    _ODD = (
        *(3.33333333333329318027e-01, 1.42857142725034663711e-01, 9.09088713343650656196e-02),
        *(6.66107313738753120669e-02, 4.97687799461593236017e-02, 1.62858201153657823623e-02),
    )
    _EVEN = (
        *(-1.99999999998764832476e-01, -1.11111104054623557880e-01, -7.69187620504482999495e-02),
        *(-5.83357013379057348645e-02, -3.65315727442169155270e-02),
    )

    def _atan(build, x):
        z, one = _call("fabs", build, x), _constant(1.0)
        above, below, base = _constant(-1.0), z, _constant(0.5 * math.pi)
        for top, middle, at in (
            (2.4375, 1.5, 9.82793723247329054082e-01),
            (1.1875, 1.0, 0.25 * math.pi),
            (0.6875, 0.5, 4.63647609000806093515e-01),
            (0.4375, 0.0, 0.0),
        ):
            inside = _compare("<", build, z, _constant(top))
            centre = _constant(middle)
            above = build.select(inside, build.fsub(z, centre), above)
            below = build.select(inside, _call("fmuladd", build, centre, z, one), below)
            base = build.select(inside, _constant(at), base)
        t = build.fdiv(above, below)
        u = build.fmul(t, t)
        w = build.fmul(u, u)
        tail = _call("fmuladd", build, u, _polynomial(build, w, _ODD), build.fmul(w, _polynomial(build, w, _EVEN)))
        size = build.fadd(base, _call("fmuladd", build, build.fneg(t), tail, t))
        return _call("copysign", build, size, x)

    _PI = (3.140625, 9.67502593994140625e-4, 1.5099579909783764e-7)  # pi; multiples of the first two are exact
    _SINE = tuple((-1.0) ** n / math.factorial(2 * n + 1) for n in range(1, 11))

    def _wave(half, build, x):
        """Sine for ``half`` 0, cosine for 1/2, by the sine of the distance to the nearest zero, the ``k``-th."""
        z = _call("fabs", build, x)
        k = _call("rint", build, build.fsub(build.fmul(z, _constant(1.0 / math.pi)), _constant(half)))
        turns = build.fadd(k, _constant(half))  # multiple of pi at the nearest zero
        r = z
        for part in _PI:
            r = _call("fmuladd", build, turns, _constant(-part), r)
        u = build.fmul(r, r)
        s = _call("fmuladd", build, build.fmul(r, u), _polynomial(build, u, _SINE), r)
        pairs = build.fmul(k, _constant(0.5))
        odd = _compare("!=", build, pairs, _call("rint", build, pairs))
        s = build.select(odd, build.fneg(s), s)
        s = build.fneg(s) if half else build.fmul(s, _call("copysign", build, _constant(1.0), x))
        return build.select(_compare("<=", build, z, _constant(1e8)), s, _constant(math.nan))

    _LOG_2 = (0.693147180369123816490, 1.90821492927058770002e-10)  # log 2; multiples of the first are exact
    _EXP = tuple(1.0 / math.factorial(n) for n in range(14))
    _LARGEST, _SMALLEST = 710.0, -746.0  # beyond, the exponential is infinite or zero
    _ROUND = 1.5 * 2.0**52  # a number plus this has the nearest integer in its last bits

    def _exp(build, x):
        x = _larger(build, _smaller(build, x, _constant(_LARGEST)), _constant(_SMALLEST))
        shifted = _call("fmuladd", build, x, _constant(1.0 / math.log(2.0)), _constant(_ROUND))
        k = build.fsub(shifted, _constant(_ROUND))
        for part in _LOG_2:
            x = _call("fmuladd", build, k, _constant(-part), x)
        value = _polynomial(build, x, _EXP)
        half = _call("floor", build, build.fmul(k, _constant(0.5)))
        for part in (half, build.fsub(k, half)):  # 2^k by its bits, half by half, as a double may not hold it
            power = build.bitcast(build.fadd(part, _constant(_ROUND + 1023.0)), _LONGS)
            value = build.fmul(value, build.bitcast(build.shl(power, _constant(52, _LONGS)), _FOUR))
        return value

    def _compare(sign, build, x, y):
        return build.fcmp_ordered(sign, x, y)

    def _smaller(build, x, limit):
        return build.select(_compare("<", build, limit, x), limit, x)

    def _larger(build, x, limit):
        return build.select(_compare(">", build, limit, x), limit, x)

    def _any(build, bits):
        return build.icmp_unsigned("!=", build.bitcast(bits, ir.IntType(4)), ir.Constant(ir.IntType(4), 0))

    for _point, _name in (("add", "fadd"), ("sub", "fsub"), ("mul", "fmul"), ("truediv", "fdiv")):
        for _prefix in ("", "i"):
            _define(getattr(operator, _prefix + _point), FOUR, (FOUR, FOUR), getattr(ir.IRBuilder, _name))
    _define(operator.neg, FOUR, (FOUR,), ir.IRBuilder.fneg)
    for _point, _name in (("lt", "<"), ("le", "<="), ("gt", ">"), ("ge", ">="), ("eq", "==")):
        _define(getattr(operator, _point), MASK, (FOUR, FOUR), partial(_compare, _name))
    _define(operator.ne, MASK, (FOUR, FOUR), lambda build, x, y: build.fcmp_unordered("!=", x, y))
    _define(operator.and_, MASK, (MASK, MASK), ir.IRBuilder.and_)
    _define(any_of, types.boolean, (MASK,), _any)
    _define(where, FOUR, (MASK, FOUR, FOUR), ir.IRBuilder.select)
    _define(minimum, FOUR, (FOUR, FOUR), _smaller)
    _define(maximum, FOUR, (FOUR, FOUR), _larger)
    _define(fabs, FOUR, (FOUR,), partial(_call, "fabs"))
    _define(sqrt, FOUR, (FOUR,), partial(_call, "sqrt"))
    _define(copysign, FOUR, (FOUR, FOUR), partial(_call, "copysign"))
    _define(power, FOUR, (FOUR, FOUR), partial(_call, "pow"))
    _define(exp, FOUR, (FOUR,), _exp)
    _define(atan, FOUR, (FOUR,), _atan)
    _define(sin, FOUR, (FOUR,), partial(_wave, 0.0))
    _define(cos, FOUR, (FOUR,), partial(_wave, 0.5))
    _define(pack, FOUR, (types.float64,) * 4, _pack)
    _define(unpack, types.UniTuple(types.float64, 4), (FOUR,), _unpack)
    _define(broadcast, FOUR, (types.float64,), _splat)
    _define(first, types.float64, (FOUR,), lambda build, x: _extract(build, x)[0])
    _define(swap_sides, FOUR, (FOUR,), partial(_shuffle, (1, 0, 3, 2)))
