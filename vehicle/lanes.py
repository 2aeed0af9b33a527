"""Four arc tangents, or two sines and two cosines, in the time of one and a half: vectors for straight-line kernels.

The Magic Formula spends half its time in elementary functions that do not wait for each other. There is no loop that a
compiler could turn into vectors, so the vectors are written out, as LLVM instructions of four lanes; LLVM makes of them
what the processor has, fused multiply-add included. Each lane is the same operations whatever stands in the others, so
a result depends on its own argument alone; signs are put on at the end, so symmetry is exact to the last bit.

Without the compiler (``NUMBA_DISABLE_JIT=1``) the functions of ``math`` serve; they differ in the last bit.

Source: intervals and polynomial of the arc tangent: S. Moshier and Sun Microsystems, fdlibm ``s_atan.c``; the sine:
Taylor to the 21st power after reduction by multiples of pi in three parts (Cody and Waite).
"""

import math
from typing import Any

from friction.kernel import COMPILED


def atan4(a: float, b: float, c: float, d: float) -> tuple[float, float, float, float]:
    """Arc tangents of four numbers, to one unit in the last place."""
    return math.atan(a), math.atan(b), math.atan(c), math.atan(d)


def waves(a: float, b: float, c: float, d: float) -> tuple[float, float, float, float]:
    """``sin(a), sin(b), cos(c), cos(d)``, to 4e-16 absolute for arguments up to 100."""
    return math.sin(a), math.sin(b), math.cos(c), math.cos(d)


if COMPILED:
    from llvmlite import ir
    from numba.core import cgutils, types
    from numba.extending import intrinsic

    _DOUBLE, _INT = ir.DoubleType(), ir.IntType(32)
    _FOUR = ir.VectorType(_DOUBLE, 4)
    _TUPLE = types.UniTuple(types.float64, 4)
    _ARGUMENTS = (types.float64,) * 4

    def _constant(*values: float) -> Any:
        return ir.Constant(
            _FOUR, [ir.Constant(_DOUBLE, value) for value in (values if len(values) == 4 else values * 4)]
        )

    def _pack(build, arguments):
        vector = ir.Constant(_FOUR, ir.Undefined)
        for lane, argument in enumerate(arguments):
            vector = build.insert_element(vector, argument, ir.Constant(_INT, lane))
        return vector

    def _unpack(context, build, vector):
        lanes = [build.extract_element(vector, ir.Constant(_INT, lane)) for lane in range(4)]
        return context.make_tuple(build, _TUPLE, lanes)

    def _call(build, name, *arguments):
        kind = ir.FunctionType(_FOUR, [_FOUR] * len(arguments))
        return build.call(cgutils.get_or_insert_function(build.module, kind, f"llvm.{name}.v4f64"), arguments)

    def _polynomial(build, x, coefficients):
        value = _constant(coefficients[-1])
        for coefficient in reversed(coefficients[:-1]):
            value = _call(build, "fmuladd", x, value, _constant(coefficient))
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

    @intrinsic
    def _atan4(typing_context, a, b, c, d):
        def generate(context, build, signature, arguments):
            x = _pack(build, arguments)
            z, one = _call(build, "fabs", x), _constant(1.0)
            above, below, base = _constant(-1.0), z, _constant(0.5 * math.pi)
            for top, middle, at in (
                (2.4375, 1.5, 9.82793723247329054082e-01),
                (1.1875, 1.0, 0.25 * math.pi),
                (0.6875, 0.5, 4.63647609000806093515e-01),
                (0.4375, 0.0, 0.0),
            ):
                inside = build.fcmp_ordered("<", z, _constant(top))
                centre = _constant(middle)
                above = build.select(inside, build.fsub(z, centre), above)
                below = build.select(inside, _call(build, "fmuladd", centre, z, one), below)
                base = build.select(inside, _constant(at), base)
            t = build.fdiv(above, below)
            u = build.fmul(t, t)
            w = build.fmul(u, u)
            tail = _call(build, "fmuladd", u, _polynomial(build, w, _ODD), build.fmul(w, _polynomial(build, w, _EVEN)))
            size = build.fadd(base, _call(build, "fmuladd", build.fneg(t), tail, t))
            return _unpack(context, build, _call(build, "copysign", size, x))

        return _TUPLE(*_ARGUMENTS), generate

    _PI = (3.140625, 9.67502593994140625e-4, 1.5099579909783764e-7)  # its sum; multiples of the first two are exact
    _SINE = tuple((-1.0) ** n / math.factorial(2 * n + 1) for n in range(1, 11))

    @intrinsic
    def _waves(typing_context, a, b, c, d):
        def generate(context, build, signature, arguments):
            x = _pack(build, arguments)
            z, half = _call(build, "fabs", x), _constant(0.0, 0.0, 0.5, 0.5)
            k = _call(build, "rint", build.fsub(build.fmul(z, _constant(1.0 / math.pi)), half))
            turns = build.fadd(k, half)  # of pi, to the nearest zero of the wave
            r = z
            for part in _PI:
                r = _call(build, "fmuladd", turns, _constant(-part), r)
            u = build.fmul(r, r)
            s = _call(build, "fmuladd", build.fmul(r, u), _polynomial(build, u, _SINE), r)
            pairs = build.fmul(k, _constant(0.5))
            odd = build.fcmp_ordered("!=", pairs, _call(build, "rint", pairs))
            s = build.select(odd, build.fneg(s), s)  # next to the k-th zero, up or down
            sign = _call(build, "copysign", _constant(1.0), x)
            sines = ir.Constant(ir.VectorType(ir.IntType(1), 4), [1, 1, 0, 0])
            return _unpack(context, build, build.fmul(s, build.select(sines, sign, _constant(-1.0))))

        return _TUPLE(*_ARGUMENTS), generate

    atan4, waves = _atan4, _waves  # type: ignore[assignment]
