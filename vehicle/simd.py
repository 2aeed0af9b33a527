"""Four numbers at once, one for each wheel: arithmetic and elementary functions on vectors of four lanes.

The four wheels run through the same equations, and no compiler turns a loop over them into vectors by itself. So the
kernels write them once, for numbers as wide as they come: compiled these are LLVM vectors of four lanes, of which LLVM
makes what the processor has, fused multiply-add included. A plain number beside a vector counts for all four lanes. A
lane never sees the others, so a wheel's result depends on that wheel alone; signs are put on at the end, so symmetry
is exact to the last bit.

Conditions of each lane go to ``where``; a branch is taken where ``any_of`` the lanes needs it, and must leave the
results of the others as they are. Without the compiler (``NUMBA_DISABLE_JIT=1``) numpy serves, for numbers and for
arrays of four; elementary functions then differ in the last bit.

Source: intervals and polynomial of the arc tangent: S. Moshier and Sun Microsystems, fdlibm ``s_atan.c``; the sine:
Taylor to the 21st power after reduction by multiples of pi in three parts (Cody and Waite); the exponential: Taylor to
the 13th power after reduction by multiples of log 2.
"""

import math
import operator
from collections.abc import Callable
from functools import partial
from typing import Any

import numpy as np

from steer_env.friction.numerics.kernel import COMPILED, short_arithmetic


def four(a: Any, b: Any, c: Any, d: Any) -> Any:
    """A vector of four numbers."""
    return np.array([a, b, c, d])


def alike(x: Any) -> Any:
    """A number in all four lanes; :func:`one` takes it out again."""
    return x


def one(x: Any) -> Any:
    """The number of the first lane, where all are alike."""
    return x


def lanes(x: Any) -> Any:
    """The four numbers of a vector."""
    return tuple(x)


def beside(x: Any) -> Any:
    """The lanes changed in pairs: what the other wheel of the axle has."""
    return x[[1, 0, 3, 2]]


def take(array: Any, i: int) -> Any:
    """Four elements of a contiguous array from the ``i``-th of all, whatever its shape."""
    return array.reshape(-1)[i : i + 4].copy()


def put(array: Any, i: int, x: Any) -> None:
    """Store into four elements of a contiguous array from ``i``."""
    array[i : i + 4] = x


def where(condition: Any, then: Any, otherwise: Any) -> Any:
    """One of two numbers in each lane."""
    return np.where(condition, then, otherwise)


def any_of(condition: Any) -> Any:
    """Whether the condition holds in any lane."""
    return np.any(condition)


def minimum(x: Any, limit: Any) -> Any:
    """``min`` in each lane; an ``x`` that is not a number stays."""
    return np.where(limit < x, limit, x)


def maximum(x: Any, limit: Any) -> Any:
    """``max`` in each lane; an ``x`` that is not a number stays."""
    return np.where(limit > x, limit, x)


def fabs(x: Any) -> Any:
    """Absolute values."""
    return np.fabs(x)


def copysign(size: Any, sign: Any) -> Any:
    """Sizes of the first with the signs of the second."""
    return np.copysign(size, sign)


def sqrt(x: Any) -> Any:
    """Square roots."""
    return np.sqrt(x)


def power(x: Any, y: Any) -> Any:
    """``x**y``; no faster than four numbers in turn."""
    return np.power(x, y)


def exp(x: Any) -> Any:
    """Exponentials, to 4e-16 of them for arguments up to 700."""
    return np.exp(x)


def atan(x: Any) -> Any:
    """Arc tangents, to one unit in the last place."""
    return np.arctan(x)


def sin(x: Any) -> Any:
    """Sines, to 4e-16 absolute for arguments up to 100."""
    return np.sin(x)


def cos(x: Any) -> Any:
    """Cosines, to 4e-16 absolute for arguments up to 100."""
    return np.cos(x)


if COMPILED:
    from llvmlite import ir
    from numba.core import cgutils, types
    from numba.core.typeconv import Conversion
    from numba.core.typing.templates import AbstractTemplate, infer_global, signature
    from numba.extending import lower_builtin, lower_cast, models, register_model

    _DOUBLE, _INT, _LONG, _BIT = ir.DoubleType(), ir.IntType(32), ir.IntType(64), ir.IntType(1)
    _FOUR, _LONGS, _BITS = (ir.VectorType(kind, 4) for kind in (_DOUBLE, _LONG, _BIT))

    class Four(types.Type):
        """numba's type of four numbers; where it meets a plain number, that is widened."""

        def can_convert_from(self, typing_context, other):
            return Conversion.safe if isinstance(other, types.Number) else None

        def unify(self, typing_context, other):
            return self if isinstance(other, types.Number) else None

    class Mask(types.Type):
        """numba's type of four conditions."""

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

    def _unpack(build, vector):
        return [build.extract_element(vector, ir.Constant(_INT, i)) for i in range(4)]

    def _shuffle(places, build, vector):
        return build.shuffle_vector(vector, vector, ir.Constant(ir.VectorType(_INT, 4), places))

    def _splat(build, number):
        return _shuffle((0, 0, 0, 0), build, _pack(build, number))

    @lower_cast(types.Number, FOUR)
    def _widen(context, build, old, new, value):
        return _splat(build, context.cast(build, value, old, types.float64))

    def _define(point: Any, result: Any, kinds: tuple[Any, ...], generate: Callable) -> None:
        """What compiled code takes for ``point`` on arguments of these kinds; numbers turn into them."""

        def generic(template, arguments, _):
            known = len(arguments) == len(kinds) and (kinds[0] in arguments or types.float64 in kinds)
            return signature(result, *kinds) if known else None

        infer_global(point)(type("Template", (AbstractTemplate,), {"generic": generic}))
        lower_builtin(point, *kinds)(lambda context, build, _, arguments: generate(build, *arguments))

    def _address(context, build, kind, array, i):
        """Of four elements from ``i``, which stand as arrays do: aligned to one number only."""
        data = context.make_array(kind)(context, build, array).data
        return build.bitcast(build.gep(data, [i]), _FOUR.as_pointer())

    def _array(arguments):
        """Types of an array and a place in it, or None."""
        fits = isinstance(arguments[0], types.Array) and arguments[0].layout == "C"
        return (arguments[0], types.intp) if fits and arguments[0].dtype == types.float64 else None

    @infer_global(take)
    class _Take(AbstractTemplate):
        def generic(self, arguments, _):
            kinds = _array(arguments)
            return signature(FOUR, *kinds) if kinds else None

    @lower_builtin(take, types.Array, types.intp)
    def _load(context, build, kind, arguments):
        return build.load(_address(context, build, kind.args[0], *arguments), align=8)

    @infer_global(put)
    class _Put(AbstractTemplate):
        def generic(self, arguments, _):
            kinds = _array(arguments)
            return signature(types.none, *kinds, FOUR) if kinds else None

    @lower_builtin(put, types.Array, types.intp, FOUR)
    def _store(context, build, kind, arguments):
        build.store(arguments[2], _address(context, build, kind.args[0], *arguments[:2]), align=8)
        return context.get_dummy_value()

    def _call(name, build, *arguments):
        kind = ir.FunctionType(_FOUR, [_FOUR] * len(arguments))
        return build.call(cgutils.get_or_insert_function(build.module, kind, f"llvm.{name}.v4f64"), arguments)

    def _polynomial(build, x, coefficients):
        value = _constant(coefficients[-1])
        for coefficient in reversed(coefficients[:-1]):
            value = _call("fmuladd", build, x, value, _constant(coefficient))
        return value

    # atan x = at(middle of the interval) + atan((x - middle)/(1 + x middle)), from the outermost interval inwards
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

    _PI = (3.140625, 9.67502593994140625e-4, 1.5099579909783764e-7)  # its sum; multiples of the first two are exact
    _SINE = tuple((-1.0) ** n / math.factorial(2 * n + 1) for n in range(1, 11))

    def _wave(half, build, x):
        """Sine for ``half`` 0, cosine for 1/2: next to the k-th zero of the wave it goes up or down."""
        z = _call("fabs", build, x)
        k = _call("rint", build, build.fsub(build.fmul(z, _constant(1.0 / math.pi)), _constant(half)))
        turns = build.fadd(k, _constant(half))  # of pi, to the nearest zero
        r = z
        for part in _PI:
            r = _call("fmuladd", build, turns, _constant(-part), r)
        u = build.fmul(r, r)
        s = _call("fmuladd", build, build.fmul(r, u), _polynomial(build, u, _SINE), r)
        pairs = build.fmul(k, _constant(0.5))
        odd = _compare("!=", build, pairs, _call("rint", build, pairs))
        s = build.select(odd, build.fneg(s), s)
        return build.fneg(s) if half else build.fmul(s, _call("copysign", build, _constant(1.0), x))

    _LOG_2 = (0.693147180369123816490, 1.90821492927058770002e-10)  # its sum; multiples of the first are exact
    _EXP = tuple(1.0 / math.factorial(n) for n in range(14))
    _ROUND = 1.5 * 2.0**52  # added to a number it leaves the nearest integer in the last bits

    def _exp(build, x):
        shifted = _call("fmuladd", build, x, _constant(1.0 / math.log(2.0)), _constant(_ROUND))
        k = build.fsub(shifted, _constant(_ROUND))
        for part in _LOG_2:
            x = _call("fmuladd", build, k, _constant(-part), x)
        power = build.add(build.bitcast(shifted, _LONGS), _constant(1023, _LONGS))  # 2^k by its bits
        power = build.bitcast(build.shl(power, _constant(52, _LONGS)), _FOUR)
        return build.fmul(_polynomial(build, x, _EXP), power)

    def _compare(sign, build, x, y):
        return build.fcmp_ordered(sign, x, y)

    def _any(build, bits):
        return build.icmp_unsigned("!=", build.bitcast(bits, ir.IntType(4)), ir.Constant(ir.IntType(4), 0))

    for _point, _name in (("add", "fadd"), ("sub", "fsub"), ("mul", "fmul"), ("truediv", "fdiv")):
        for _prefix in ("", "i"):
            _define(getattr(operator, _prefix + _point), FOUR, (FOUR, FOUR), getattr(ir.IRBuilder, _name))
    short_arithmetic(FOUR)
    _define(operator.neg, FOUR, (FOUR,), ir.IRBuilder.fneg)
    for _point, _name in (("lt", "<"), ("le", "<="), ("gt", ">"), ("ge", ">="), ("eq", "==")):
        _define(getattr(operator, _point), MASK, (FOUR, FOUR), partial(_compare, _name))
    _define(operator.ne, MASK, (FOUR, FOUR), lambda build, x, y: build.fcmp_unordered("!=", x, y))
    _define(operator.and_, MASK, (MASK, MASK), ir.IRBuilder.and_)
    _define(any_of, types.boolean, (MASK,), _any)
    _define(where, FOUR, (MASK, FOUR, FOUR), ir.IRBuilder.select)
    _define(minimum, FOUR, (FOUR, FOUR), lambda build, x, y: build.select(_compare("<", build, y, x), y, x))
    _define(maximum, FOUR, (FOUR, FOUR), lambda build, x, y: build.select(_compare(">", build, y, x), y, x))
    _define(fabs, FOUR, (FOUR,), partial(_call, "fabs"))
    _define(sqrt, FOUR, (FOUR,), partial(_call, "sqrt"))
    _define(copysign, FOUR, (FOUR, FOUR), partial(_call, "copysign"))
    _define(power, FOUR, (FOUR, FOUR), partial(_call, "pow"))
    _define(exp, FOUR, (FOUR,), _exp)
    _define(atan, FOUR, (FOUR,), _atan)
    _define(sin, FOUR, (FOUR,), partial(_wave, 0.0))
    _define(cos, FOUR, (FOUR,), partial(_wave, 0.5))
    _define(four, FOUR, (types.float64,) * 4, _pack)
    _define(alike, FOUR, (types.float64,), _splat)
    _define(beside, FOUR, (FOUR,), partial(_shuffle, (1, 0, 3, 2)))
    _define(one, types.float64, (FOUR,), lambda build, x: _unpack(build, x)[0])
    _define(
        lanes, types.UniTuple(types.float64, 4), (FOUR,), lambda build, x: cgutils.pack_array(build, _unpack(build, x))
    )
