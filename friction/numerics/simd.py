"""Numbers as wide as they come: kernels that take one car or four cars side by side, and the four wheels of each.

A kernel states each equation once. Its arguments decide how wide it computes: a plain number, or a vector with a lane
for each of several cars. Compiled, a vector is an LLVM vector of doubles, which LLVM translates to the vector
instructions of the processor. No compiler turns a loop over cars or wheels into such instructions by itself.

What a reader must know:

* **Lanes do not mix.** The result of a car depends on that car alone, to the last bit: it is the same as of a plain
  number, whatever the other lanes hold. A plain number that meets a vector counts for all lanes.
* **A condition is a mask** with a truth value for each lane; of plain numbers it is a bool. :func:`where` selects
  results by it. A kernel takes a branch if :func:`any_of` the lanes needs it; the branch must leave the results of the
  other lanes as they are. ``&`` and ``|`` join conditions, :func:`invert` reverses one. Of a plain number
  ``any_of(c)`` is ``c``, so that a branch of one car is a branch.
* **An iteration** goes on while :func:`any_of` the lanes needs it, and keeps the values of those that are done.
* **abs and the functions of math** act on each lane as on a number, to the bit: those that are not one instruction are
  a call for each lane. The functions of this module that bear the same names are
  vector code, for the tyre, and not equal to those of ``math`` in the last bit.
* **Wheels.** :func:`pack` puts four wheels side by side: four numbers make a vector of four lanes, four vectors of cars
  one of four times the lanes, wheel by wheel. A vector of cars that meets one of wheels counts for each wheel.
  :func:`load` and :func:`store` do so with consecutive elements of an array.
* **Tables** are read at :func:`as_index`, an index that differs by lane. Rows of arrays (``Rows``, of
  :func:`steer_env.friction.numerics.packing.of_rows`) give each lane the element of its own row. :func:`load` at such
  an index takes four consecutive elements for each car, car by car; :func:`spread` repeats numbers of cars to match
  and :func:`unpack_cars` gives the four, each with a lane for each car.

No operation mixes lanes, except :func:`swap_sides`. The elementary functions apply the sign of their argument last, so
that their symmetry is exact to the last bit. Without the compiler (``NUMBA_DISABLE_JIT=1``) numpy evaluates numbers and
arrays of four wheels; the elementary functions then differ in the last bit.

Source: S. Moshier and Sun Microsystems, fdlibm ``s_atan.c``, for the intervals and the polynomial of the arc tangent.
The sine is the Taylor polynomial of degree 21 after a reduction by multiples of pi in three parts (Cody and Waite), the
exponential that of degree 13 after a reduction by multiples of log 2.
"""

import math
import operator
from collections.abc import Callable
from typing import Any

import numpy as np

from steer_env.friction.numerics.kernel import COMPILED, kernel


def pack(a: Any, b: Any, c: Any, d: Any) -> Any:
    """The vector of four wheels, from a number or a vector of cars for each."""
    return np.array([a, b, c, d])


def unpack(x: Any) -> Any:
    """The four wheels of a vector: numbers, or vectors of cars."""
    return tuple(x)


def broadcast(x: Any) -> Any:
    """The vector of four wheels that are equal; :func:`first` is the inverse."""
    return x


def first(x: Any) -> Any:
    """The first wheel of a vector."""
    return x


def spread(x: Any) -> Any:
    """Each number four times in a row, as :func:`load` at places that differ by car has four of each car."""
    return x


def unpack_cars(x: Any) -> Any:
    """What :func:`load` at places that differ by car has of each, as four numbers or vectors of cars."""
    return tuple(x)


def swap_sides(x: Any) -> Any:
    """The vector with left and right exchanged: each wheel receives the value of the other one of its axle."""
    return x[[1, 0, 3, 2]]


def load(array: Any, i: Any) -> Any:
    """Four consecutive elements of a contiguous array, from the flat index ``i``; or four for each car."""
    return array.reshape(-1)[i : i + 4].copy()


def store(array: Any, i: Any, x: Any) -> None:
    """Write a vector to four consecutive elements of a contiguous array, from ``i``; or to four for each car."""
    array.reshape(-1)[i : i + 4] = x


@kernel
def interleave(array, size, starts, block):
    """Copy ``size`` numbers, at least four, from each of four places in a contiguous array to a block of vectors."""
    for k in range(0, size, 4):
        at = minimum(k, size - 4)  # the last four may be copied twice
        a, b, c, d = unpack_cars(load(array, starts + at))
        store(block, at, pack(a, b, c, d))


@kernel
def deinterleave(block, size, starts, array):
    """The reverse of :func:`interleave`."""
    for k in range(0, size, 4):
        at = minimum(k, size - 4)
        a, b, c, d = unpack_cars(load(block, at))
        store(array, starts + at, pack(a, b, c, d))


def as_index(x: Any) -> Any:
    """A whole number as an index, which may differ by lane."""
    return int(x)


def where(condition: Any, then: Any, otherwise: Any) -> Any:
    """One of two values in each lane; both are computed."""
    if isinstance(condition, bool | np.bool_):
        return then if condition else otherwise
    return np.where(condition, then, otherwise)


def any_of(condition: Any) -> Any:
    """Whether the condition holds in any lane."""
    return condition if isinstance(condition, bool | np.bool_) else np.any(condition)


def all_of(condition: Any) -> Any:
    """Whether the condition holds in all lanes."""
    return condition if isinstance(condition, bool | np.bool_) else np.all(condition)


def invert(condition: Any) -> Any:
    """Where the condition does not hold."""
    return np.logical_not(condition)


def minimum(x: Any, limit: Any) -> Any:
    """``min`` in each lane; NaN in ``x`` stays NaN."""
    return where(limit < x, limit, x)


def maximum(x: Any, limit: Any) -> Any:
    """``max`` in each lane; NaN in ``x`` stays NaN."""
    return where(limit > x, limit, x)


def floor(x: Any) -> Any:
    """The largest whole number that is not above."""
    return np.floor(x)


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
    """``x**y`` of vectors; takes as long as that many scalar powers."""
    return np.power(x, y)


def exp(x: Any) -> Any:
    """Exponential of a vector, with a relative error of 4e-16; results below 2.3e-308 to one unit in the last place."""
    return np.exp(x)


def atan(x: Any) -> Any:
    """Arc tangent of a vector, to one unit in the last place."""
    return np.arctan(x)


def sin(x: Any) -> Any:
    """Sine of a vector, with an absolute error of 4e-16 for arguments up to 1e8 in magnitude, and NaN beyond."""
    return np.sin(x)


def cos(x: Any) -> Any:
    """Cosine of a vector, with an absolute error of 4e-16 for arguments up to 1e8 in magnitude, and NaN beyond."""
    return np.cos(x)


if COMPILED:
    from llvmlite import ir
    from numba import types
    from numba.core import cgutils
    from numba.core.typeconv import Conversion
    from numba.core.typing.templates import AttributeTemplate, infer_getattr
    from numba.extending import lower_builtin, lower_cast, lower_getattr, models, register_model, type_callable

    _DOUBLE, _INT, _LONG, _BIT = ir.DoubleType(), ir.IntType(32), ir.IntType(64), ir.IntType(1)

    class _Lanes(types.Type):
        """A numba type of a vector."""

        scalar: Any = types.Number  # what converts to it, the same in all lanes

        def __init__(self, lanes):
            self.lanes = lanes
            super().__init__(f"{type(self).__name__}{lanes}")

        def _holds(self, other):
            """Whether a value of another type counts for all lanes, or for each block of them."""
            return isinstance(other, self.scalar) or (type(other) is type(self) and self.lanes % other.lanes == 0)

        def can_convert_from(self, typing_context, other):
            # The last resort: a kernel that is compiled for vectors and for numbers too takes numbers as they are.
            return Conversion.unsafe if self._holds(other) else None

        def unify(self, typing_context, other):
            return self if self._holds(other) else None

    class Wide(_Lanes):
        """Doubles."""

    class Mask(_Lanes):
        """Conditions."""

        scalar = types.Boolean

    class Places(_Lanes):
        """Indices."""

        scalar = types.Integer

    _NUMBER = {Wide: types.float64, Mask: types.boolean, Places: types.int64}
    _ELEMENT = {Wide: _DOUBLE, Mask: _BIT, Places: _LONG}
    FOUR = Wide(4)

    @register_model(Wide)
    @register_model(Mask)
    @register_model(Places)
    class _LanesModel(models.PrimitiveModel):
        def __init__(self, manager, kind):
            super().__init__(manager, kind, ir.VectorType(_ELEMENT[type(kind)], kind.lanes))

    def _constant(value: float, like: Any) -> Any:
        return ir.Constant(like.type, [ir.Constant(like.type.element, value)] * like.type.count)

    def gathered(build, numbers):
        """The vector of numbers."""
        vector = ir.Constant(ir.VectorType(numbers[0].type, len(numbers)), ir.Undefined)
        for i, number in enumerate(numbers):
            vector = build.insert_element(vector, number, ir.Constant(_INT, i))
        return vector

    def _extract(build, vector):
        return [build.extract_element(vector, ir.Constant(_INT, i)) for i in range(vector.type.count)]

    def _shuffle(places, build, vector):
        """The vector of the lanes at these places of another one."""
        mask = ir.Constant(ir.VectorType(_INT, len(places)), list(places))
        return build.shuffle_vector(vector, ir.Constant(vector.type, ir.Undefined), mask)

    def _splat(build, number, lanes):
        return _shuffle([0] * lanes, build, gathered(build, [number, ir.Constant(number.type, ir.Undefined)]))

    def _widened(context, build, old, new, value):
        if isinstance(old, _Lanes):
            return _shuffle([i % old.lanes for i in range(new.lanes)], build, value)
        return _splat(build, context.cast(build, value, old, _NUMBER[type(new)]), new.lanes)

    for _old, _new in ((types.Number, Wide), (types.Boolean, Mask), (types.Integer, Places)):
        lower_cast(_old, _new)(_widened)
        lower_cast(_new, _new)(_widened)

    @lower_cast(Places, Wide)
    def _as_doubles(context, build, old, new, value):
        return build.sitofp(value, context.get_value_type(new))

    def _typed(function: Any, count: int, rule: Callable) -> None:
        """Let ``rule``, from the types of ``count`` arguments to a signature or None, type a function."""
        typer: Any = (
            lambda context: lambda a: rule(a),
            lambda context: lambda a, b: rule(a, b),
            lambda context: lambda a, b, c: rule(a, b, c),
            lambda context: lambda a, b, c, d: rule(a, b, c, d),
        )[count - 1]

        def named(context):
            return typer(context)

        named.__name__ = getattr(function, "__name__", "")
        type_callable(function)(named)

    def _lanes(kinds: Any) -> int:
        """Lanes of the widest of these types; 0 where all are plain, or one is no number at all."""
        widths = [kind.lanes if isinstance(kind, _Lanes) else 0 for kind in kinds]
        return max(widths) if all(isinstance(kind, _Lanes | types.Number | types.Boolean) for kind in kinds) else 0

    def _define(function: Any, result: Any, kinds: tuple[Any, ...], generate: Callable) -> None:
        """Let compiled code translate ``function`` by ``generate`` where an argument is a vector; the rest widens."""

        def rule(*given):
            lanes = _lanes(given)
            if not lanes or not all(kind(lanes)._holds(each) for kind, each in zip(kinds, given)):
                return None
            if kinds[-1] is Wide and not any(isinstance(each, Wide | types.Float) for each in given):
                return None  # whole numbers
            return (result if isinstance(result, types.Type) else result(lanes))(*[kind(lanes) for kind in kinds])

        _typed(function, len(kinds), rule)
        lower_builtin(function, *kinds)(lambda context, build, _, arguments: generate(build, *arguments))

    def _define_plain(function: Any, result: Any, kinds: tuple[Any, ...], generate: Callable) -> None:
        """The same function of plain numbers; ``result`` None stands for the type that the last two arguments share."""

        def rule(*given):
            if not all(isinstance(each, kind) for each, kind in zip(given, kinds)):
                return None
            if result is not None:
                return result(*[_PLAIN_TYPE[kind] for kind in kinds])
            shared = types.float64 if any(isinstance(each, types.Float) for each in given) else types.int64
            return shared(*[types.boolean if kind is types.Boolean else shared for kind in kinds])

        _typed(function, len(kinds), rule)
        lower_builtin(function, *kinds)(lambda context, build, _, arguments: generate(build, *arguments))

    _PLAIN_TYPE = {types.Number: types.float64, types.Boolean: types.boolean}

    # Arithmetic and selection.

    def _compare(sign, build, x, y):
        return build.fcmp_ordered(sign, x, y)

    def _smaller(build, x, limit):
        return build.select(_less(build, limit, x), limit, x)

    def _larger(build, x, limit):
        return build.select(_less(build, x, limit), limit, x)

    def _less(build, x, y):
        element = getattr(x.type, "element", x.type)
        return build.icmp_signed("<", x, y) if isinstance(element, ir.IntType) else build.fcmp_ordered("<", x, y)

    def _bits(build, mask):
        return build.bitcast(mask, ir.IntType(mask.type.count))

    def _any(build, mask):
        bits = _bits(build, mask)
        return build.icmp_unsigned("!=", bits, ir.Constant(bits.type, 0))

    def _all(build, mask):
        bits = _bits(build, mask)
        return build.icmp_unsigned("==", bits, ir.Constant(bits.type, -1))

    def _itself(build, x):
        return x

    def _call(name, build, *arguments):
        kind = arguments[0].type
        suffix = f"v{kind.count}f64" if isinstance(kind, ir.VectorType) else "f64"
        called = build.module.declare_intrinsic(
            f"llvm.{name}.{suffix}", (), ir.FunctionType(kind, [kind] * len(arguments))
        )
        return build.call(called, arguments)

    def _calling(name):
        return lambda build, *arguments: _call(name, build, *arguments)

    _function: Any  # of the loops that follow

    for _point, _name in (("add", "fadd"), ("sub", "fsub"), ("mul", "fmul"), ("truediv", "fdiv")):
        for _prefix in ("", "i"):
            _define(getattr(operator, _prefix + _point), Wide, (Wide, Wide), getattr(ir.IRBuilder, _name))
    _define(operator.add, Places, (Places, Places), ir.IRBuilder.add)
    _define(operator.sub, Places, (Places, Places), ir.IRBuilder.sub)
    _define(operator.mul, Places, (Places, Places), ir.IRBuilder.mul)
    _define(operator.neg, Wide, (Wide,), ir.IRBuilder.fneg)
    for _point, _name in (("lt", "<"), ("le", "<="), ("gt", ">"), ("ge", ">="), ("eq", "==")):
        _define(
            getattr(operator, _point), Mask, (Wide, Wide), lambda build, x, y, _name=_name: _compare(_name, build, x, y)
        )
    _define(operator.ne, Mask, (Wide, Wide), lambda build, x, y: build.fcmp_unordered("!=", x, y))
    _define(operator.and_, Mask, (Mask, Mask), ir.IRBuilder.and_)
    _define(operator.or_, Mask, (Mask, Mask), ir.IRBuilder.or_)
    _define(where, Wide, (Mask, Wide, Wide), ir.IRBuilder.select)
    _define(where, Mask, (Mask, Mask, Mask), ir.IRBuilder.select)
    _define(where, Places, (Mask, Places, Places), ir.IRBuilder.select)
    _define_plain(where, None, (types.Boolean, types.Number, types.Number), ir.IRBuilder.select)
    _define_plain(where, types.boolean, (types.Boolean, types.Boolean, types.Boolean), ir.IRBuilder.select)
    _define(any_of, types.boolean, (Mask,), _any)
    _define(all_of, types.boolean, (Mask,), _all)
    _define(invert, Mask, (Mask,), ir.IRBuilder.not_)
    _define_plain(any_of, types.boolean, (types.Boolean,), _itself)
    _define_plain(all_of, types.boolean, (types.Boolean,), _itself)
    _define_plain(invert, types.boolean, (types.Boolean,), ir.IRBuilder.not_)
    for _function, _generate in ((minimum, _smaller), (maximum, _larger)):
        _define(_function, Wide, (Wide, Wide), _generate)
        _define(_function, Places, (Places, Places), _generate)
        _define_plain(_function, None, (types.Number, types.Number), _generate)
    for _function, _name, _count in (
        (fabs, "fabs", 1),
        (sqrt, "sqrt", 1),
        (floor, "floor", 1),
        (copysign, "copysign", 2),
    ):
        _define(_function, Wide, (Wide,) * _count, _calling(_name))
        _define_plain(_function, types.float64, (types.Number,) * _count, _calling(_name))
    for _function, _name, _count in ((abs, "fabs", 1), (math.sqrt, "sqrt", 1), (math.copysign, "copysign", 2)):
        _define(_function, Wide, (Wide,) * _count, _calling(_name))
    _define(power, Wide, (Wide, Wide), _calling("pow"))

    # Wheels and cars.

    def _quarter(x):
        """The type of one wheel; of a vector of four cars that of a car."""
        return _NUMBER[type(x)] if x.lanes == 4 else type(x)(x.lanes // 4)

    @type_callable(pack)
    def _type_pack(context):
        def typer(a, b, c, d):
            kind = Wide(_lanes((a, b, c, d)) or 1)
            one = types.float64 if kind.lanes == 1 else kind
            return Wide(4 * kind.lanes)(one, one, one, one)

        return typer

    @lower_builtin(pack, types.float64, types.float64, types.float64, types.float64)
    def _pack(context, build, _, numbers):
        return gathered(build, numbers)

    @lower_builtin(pack, Wide, Wide, Wide, Wide)
    def _pack_wide(context, build, _, vectors):
        n = vectors[0].type.count
        a, b = (
            build.shuffle_vector(x, y, ir.Constant(ir.VectorType(_INT, 2 * n), list(range(2 * n))))
            for x, y in (vectors[:2], vectors[2:])
        )
        return build.shuffle_vector(a, b, ir.Constant(ir.VectorType(_INT, 4 * n), list(range(4 * n))))

    def _members(context, build, kind, vector, places):
        """A tuple of four, from the places of the lanes of each."""
        found = [
            build.extract_element(vector, ir.Constant(_INT, at[0])) if len(at) == 1 else _shuffle(at, build, vector)
            for at in places
        ]
        return context.make_tuple(build, kind, found)

    for _function in (unpack, unpack_cars):
        _typed(_function, 1, lambda x: types.UniTuple(_quarter(x), 4)(x) if isinstance(x, _Lanes) else None)

    @lower_builtin(unpack, _Lanes)
    def _unpack(context, build, signature, arguments):
        n = signature.args[0].lanes // 4
        places = [range(k * n, k * n + n) for k in range(4)]
        return _members(context, build, signature.return_type, arguments[0], places)

    @lower_builtin(unpack_cars, Wide)
    def _unpack_cars(context, build, signature, arguments):
        places = [range(k, signature.args[0].lanes, 4) for k in range(4)]
        return _members(context, build, signature.return_type, arguments[0], places)

    for _function in (broadcast, spread):
        _typed(_function, 1, lambda x: Wide(4 * x.lanes)(x) if isinstance(x, Wide) else None)
        _typed(_function, 1, lambda x: FOUR(types.float64) if isinstance(x, types.Number) else None)

    @lower_builtin(broadcast, types.float64)
    @lower_builtin(spread, types.float64)
    def _broadcast(context, build, _, arguments):
        return _splat(build, arguments[0], 4)

    @lower_builtin(broadcast, Wide)
    def _broadcast_wide(context, build, signature, arguments):
        n = signature.args[0].lanes
        return _shuffle([i % n for i in range(4 * n)], build, arguments[0])

    @lower_builtin(spread, Wide)
    def _spread(context, build, signature, arguments):
        return _shuffle([i // 4 for i in range(4 * signature.args[0].lanes)], build, arguments[0])

    _typed(first, 1, lambda x: _quarter(x)(x) if isinstance(x, Wide) else None)

    @lower_builtin(first, Wide)
    def _first(context, build, signature, arguments):
        n = signature.args[0].lanes // 4
        return _extract(build, arguments[0])[0] if n == 1 else _shuffle(range(n), build, arguments[0])

    def _swap(build, x):
        n = x.type.count // 4
        return _shuffle([n * k + i for k in (1, 0, 3, 2) for i in range(n)], build, x)

    _define(swap_sides, Wide, (Wide,), _swap)

    # Arrays.

    def _address(context, build, kind, array, i, result):
        """Pointer to four elements from ``i``. An array guarantees the alignment of one number only."""
        data = context.make_array(kind)(context, build, array).data
        return build.bitcast(build.gep(data, [i]), context.get_value_type(result).as_pointer())

    def _four_of(array):
        """The type of four consecutive elements of an array; None where it has no such."""
        if not (isinstance(array, types.Array) and array.layout == "C"):
            return None
        if isinstance(array.dtype, Wide):
            return Wide(4 * array.dtype.lanes)
        return FOUR if array.dtype == types.float64 else None

    @type_callable(load)
    def _type_load(context):
        def typer(array, i):
            four = _four_of(array)
            if isinstance(i, Places):
                return Wide(4 * i.lanes)(array, i) if four == FOUR else None
            return four(array, types.intp) if four else None

        return typer

    @lower_builtin(load, types.Array, types.intp)
    def _load(context, build, kind, arguments):
        array, i = arguments
        return build.load(_address(context, build, kind.args[0], array, i, kind.return_type), align=8)

    @lower_builtin(load, types.Array, Places)
    def _load_places(context, build, kind, arguments):
        array, places = arguments
        parts = [
            build.load(_address(context, build, kind.args[0], array, i, FOUR), align=8) for i in _extract(build, places)
        ]
        while len(parts) > 1:
            n = parts[0].type.count
            mask = ir.Constant(ir.VectorType(_INT, 2 * n), list(range(2 * n)))
            parts = [build.shuffle_vector(a, b, mask) for a, b in zip(parts[::2], parts[1::2])]
        return parts[0]

    @type_callable(store)
    def _type_store(context):
        def typer(array, i, x):
            four = _four_of(array)
            if isinstance(i, Places):
                return types.none(array, i, Wide(4 * i.lanes)) if four == FOUR else None
            return types.none(array, types.intp, four) if four else None

        return typer

    @lower_builtin(store, types.Array, Places, Wide)
    def _store_places(context, build, kind, arguments):
        array, places, x = arguments
        for lane, i in enumerate(_extract(build, places)):
            part = _shuffle(range(4 * lane, 4 * lane + 4), build, x)
            build.store(part, _address(context, build, kind.args[0], array, i, FOUR), align=8)
        return context.get_dummy_value()

    @lower_builtin(store, types.Array, types.intp, Wide)
    def _store(context, build, kind, arguments):
        array, i, x = arguments
        build.store(x, _address(context, build, kind.args[0], array, i, kind.args[2]), align=8)
        return context.get_dummy_value()

    _typed(as_index, 1, lambda x: Places(x.lanes)(x) if isinstance(x, Wide) else None)
    _typed(as_index, 1, lambda x: types.intp(types.float64) if isinstance(x, types.Number) else None)

    @lower_builtin(as_index, types.float64)
    @lower_builtin(as_index, Wide)
    def _place(context, build, signature, arguments):
        return build.fptosi(arguments[0], context.get_value_type(signature.return_type))

    # Rows of numbers.

    class Rows(types.Type):
        """Arrays of equal shape, one for each of four cars."""

        def __init__(self, array):
            self.array = array
            super().__init__(f"Rows({array})")

    @register_model(Rows)
    class _RowsModel(models.StructModel):
        def __init__(self, manager, kind):
            super().__init__(manager, kind, [("first", kind.array), ("offsets", Places(4))])

    def rows_from(context: Any, build: Any, kind: Any, first_array: Any, offsets: Any) -> Any:
        """Rows from the array of the first car and the distance of that of each car from it [bytes]."""
        rows = cgutils.create_struct_proxy(kind)(context, build)
        rows.first, rows.offsets = first_array, offsets
        return rows._getvalue()

    @infer_getattr
    class _RowsAttributes(AttributeTemplate):
        key = Rows

        def resolve_size(self, rows):
            return types.intp

    @lower_getattr(Rows, "size")
    def _rows_size(context, build, kind, value):
        rows = cgutils.create_struct_proxy(kind)(context, build, value)
        return context.make_array(kind.array)(context, build, rows.first).nitems

    @type_callable(operator.getitem)
    def _type_element(context):
        def typer(rows, at):
            indices: Any = at if isinstance(at, types.BaseTuple) else (at,)
            array = rows.array if isinstance(rows, Rows) else rows
            differ = isinstance(rows, Rows) or any(isinstance(k, Places) for k in indices)
            if not (differ and isinstance(array, types.Array) and array.dtype == types.float64):
                return None
            if len(indices) != array.ndim or not all(isinstance(k, Places | types.Integer) for k in indices):
                return None
            own = [k if isinstance(k, Places) else types.intp for k in indices]
            return FOUR(rows, types.BaseTuple.from_types(own) if isinstance(at, types.BaseTuple) else own[0])

        return typer

    def _element(context, build, signature, arguments):
        kind, at = signature.args
        if isinstance(kind, Rows):
            rows = cgutils.create_struct_proxy(kind)(context, build, arguments[0])
            array, offsets = context.make_array(kind.array)(context, build, rows.first), _extract(build, rows.offsets)
        else:  # one array for all cars
            array, offsets = context.make_array(kind)(context, build, arguments[0]), [ir.Constant(_LONG, 0)] * 4
        several = isinstance(at, types.BaseTuple)
        given = cgutils.unpack_tuple(build, arguments[1]) if several else [arguments[1]]
        strides = cgutils.unpack_tuple(build, array.strides)
        start = build.bitcast(array.data, ir.IntType(8).as_pointer())
        found = []
        for lane, offset in enumerate(offsets):
            for index, kind_of, stride in zip(given, at if several else [at], strides):
                k = build.extract_element(index, ir.Constant(_INT, lane)) if isinstance(kind_of, Places) else index
                offset = build.add(offset, build.mul(k, stride))
            found.append(build.load(build.bitcast(build.gep(start, [offset]), _DOUBLE.as_pointer())))
        return gathered(build, found)

    lower_builtin(operator.getitem, Rows, types.Any)(_element)
    lower_builtin(operator.getitem, types.Array, Places)(_element)

    # The functions of math, lane by lane.

    def _define_each(function: Any, intrinsic: bool) -> None:
        """Let compiled code call a function of ``math`` for each lane; where LLVM does not know it, once if all agree.

        LLVM itself joins equal calls of an intrinsic, and the sine and cosine of one number.
        """
        _typed(function, 1, lambda x: x(x) if isinstance(x, Wide) else None)

        @lower_builtin(function, Wide)
        def each(context, build, _, arguments):
            (x,) = arguments
            called = context.get_function(function, types.float64(types.float64))
            numbers = _extract(build, x)
            if intrinsic:
                return gathered(build, [called(build, [number]) for number in numbers])
            value = called(build, [numbers[0]])
            result = context.cast(build, value, types.float64, Wide(len(numbers)))
            differ = _any(build, build.fcmp_unordered("!=", x, _splat(build, numbers[0], len(numbers))))
            before = build.basic_block
            with build.if_then(differ):
                found = gathered(build, [value, *(called(build, [number]) for number in numbers[1:])])
                inside = build.basic_block
            joined = build.phi(result.type)
            joined.add_incoming(result, before)
            joined.add_incoming(found, inside)
            return joined

    for _function in (math.exp, math.sin, math.cos):
        _define_each(_function, True)
    for _function in (math.expm1, math.log1p, math.tanh):
        _define_each(_function, False)

    # Elementary functions of vectors.

    def _polynomial(build, x, coefficients):
        value = _constant(coefficients[-1], x)
        for coefficient in reversed(coefficients[:-1]):
            value = _call("fmuladd", build, x, value, _constant(coefficient, x))
        return value

    # atan x = atan(middle of the interval) + atan((x - middle)/(1 + x middle)), from the outermost interval inwards
    _ATAN_ODD_COEFFICIENTS = (
        *(3.33333333333329318027e-01, 1.42857142725034663711e-01, 9.09088713343650656196e-02),
        *(6.66107313738753120669e-02, 4.97687799461593236017e-02, 1.62858201153657823623e-02),
    )
    _ATAN_EVEN_COEFFICIENTS = (
        *(-1.99999999998764832476e-01, -1.11111104054623557880e-01, -7.69187620504482999495e-02),
        *(-5.83357013379057348645e-02, -3.65315727442169155270e-02),
    )

    def _atan(build, x):
        z, one = _call("fabs", build, x), _constant(1.0, x)
        above, below, base = _constant(-1.0, x), z, _constant(0.5 * math.pi, x)
        for top, middle, at in (
            (2.4375, 1.5, 9.82793723247329054082e-01),
            (1.1875, 1.0, 0.25 * math.pi),
            (0.6875, 0.5, 4.63647609000806093515e-01),
            (0.4375, 0.0, 0.0),
        ):
            inside = _compare("<", build, z, _constant(top, x))
            centre = _constant(middle, x)
            above = build.select(inside, build.fsub(z, centre), above)
            below = build.select(inside, _call("fmuladd", build, centre, z, one), below)
            base = build.select(inside, _constant(at, x), base)
        t = build.fdiv(above, below)
        u = build.fmul(t, t)
        w = build.fmul(u, u)
        tail = _call(
            "fmuladd",
            build,
            u,
            _polynomial(build, w, _ATAN_ODD_COEFFICIENTS),
            build.fmul(w, _polynomial(build, w, _ATAN_EVEN_COEFFICIENTS)),
        )
        size = build.fadd(base, _call("fmuladd", build, build.fneg(t), tail, t))
        return _call("copysign", build, size, x)

    _PI = (3.140625, 9.67502593994140625e-4, 1.5099579909783764e-7)  # pi; multiples of the first two are exact
    _SINE = tuple((-1.0) ** n / math.factorial(2 * n + 1) for n in range(1, 11))

    def _wave(half, build, x):
        """Sine for ``half`` 0, cosine for 1/2, by the sine of the distance to the nearest zero, the ``k``-th."""
        z = _call("fabs", build, x)
        k = _call("rint", build, build.fsub(build.fmul(z, _constant(1.0 / math.pi, x)), _constant(half, x)))
        turns = build.fadd(k, _constant(half, x))  # multiple of pi at the nearest zero
        r = z
        for part in _PI:
            r = _call("fmuladd", build, turns, _constant(-part, x), r)
        u = build.fmul(r, r)
        s = _call("fmuladd", build, build.fmul(r, u), _polynomial(build, u, _SINE), r)
        pairs = build.fmul(k, _constant(0.5, x))
        odd = _compare("!=", build, pairs, _call("rint", build, pairs))
        s = build.select(odd, build.fneg(s), s)
        s = build.fneg(s) if half else build.fmul(s, _call("copysign", build, _constant(1.0, x), x))
        return build.select(_compare("<=", build, z, _constant(1e8, x)), s, _constant(math.nan, x))

    _LOG_2 = (0.693147180369123816490, 1.90821492927058770002e-10)  # log 2; multiples of the first are exact
    _EXP = tuple(1.0 / math.factorial(n) for n in range(14))
    _LARGEST, _SMALLEST = 710.0, -746.0  # beyond, the exponential is infinite or zero
    _ROUND = 1.5 * 2.0**52  # a number plus this has the nearest integer in its last bits

    def _exp(build, x):
        x = _larger(build, _smaller(build, x, _constant(_LARGEST, x)), _constant(_SMALLEST, x))
        shifted = _call("fmuladd", build, x, _constant(1.0 / math.log(2.0), x), _constant(_ROUND, x))
        k = build.fsub(shifted, _constant(_ROUND, x))
        for part in _LOG_2:
            x = _call("fmuladd", build, k, _constant(-part, x), x)
        value, longs = _polynomial(build, x, _EXP), ir.VectorType(_LONG, x.type.count)
        half = _call("floor", build, build.fmul(k, _constant(0.5, x)))
        for part in (half, build.fsub(k, half)):  # 2^k by its bits, half by half, as a double may not hold it
            power = build.bitcast(build.fadd(part, _constant(_ROUND + 1023.0, x)), longs)
            value = build.fmul(value, build.bitcast(build.shl(power, _constant(52, power)), x.type))
        return value

    _define(exp, Wide, (Wide,), _exp)
    _define(atan, Wide, (Wide,), _atan)
    _define(sin, Wide, (Wide,), lambda build, x: _wave(0.0, build, x))
    _define(cos, Wide, (Wide,), lambda build, x: _wave(0.5, build, x))
