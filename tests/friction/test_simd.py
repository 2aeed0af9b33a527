import math

import numpy as np
import pytest

from steer_env.friction.numerics import scratch
from steer_env.friction.numerics.bounds import within
from steer_env.friction.numerics.interpolation import bracket
from steer_env.friction.numerics.kernel import COMPILED, kernel
from steer_env.friction.numerics.simd import (
    all_of,
    any_of,
    as_index,
    atan,
    broadcast,
    copysign,
    cos,
    deinterleave,
    exp,
    fabs,
    first,
    floor,
    interleave,
    invert,
    load,
    maximum,
    minimum,
    pack,
    power,
    sin,
    spread,
    sqrt,
    store,
    swap_sides,
    unpack,
    unpack_cars,
    where,
)


@kernel
def elementary(x, out):
    """Each function at a number, at its negative, at three times it and at one, in the four lanes."""
    for i in range(x.size):
        v = pack(x[i], -x[i], 3.0 * x[i], 1.0)
        store(out, 16 * i, atan(v))
        store(out, 16 * i + 4, sin(v))
        store(out, 16 * i + 8, cos(v))
        store(out, 16 * i + 12, exp(v))


def of(x):
    out = np.empty(16 * x.size)
    elementary(x, out)
    return out.reshape(x.size, 4, 4).transpose(1, 2, 0)


def test_elementary_functions():
    x = np.concatenate([np.linspace(-30, 30, 30001), np.linspace(-1, 1, 30001), 10.0 ** np.linspace(-300, 1.5, 999)])
    v = np.array([x, -x, 3.0 * x, np.ones_like(x)])
    arcs, sines, cosines, powers = of(x)
    np.testing.assert_allclose(arcs, np.arctan(v), rtol=4.5e-16, atol=0)
    np.testing.assert_allclose(sines, np.sin(v), rtol=0, atol=4e-16)
    np.testing.assert_allclose(cosines, np.cos(v), rtol=0, atol=4e-16)
    np.testing.assert_allclose(powers, np.exp(v), rtol=4.5e-16, atol=0)
    assert (arcs[0] == -arcs[1]).all()
    assert (sines[0] == -sines[1]).all()
    assert (cosines[0] == cosines[1]).all()
    np.testing.assert_array_equal(of(np.array([0.0]))[:, 0, 0], [0.0, 0.0, 1.0, 1.0])
    assert of(np.array([1e300]))[0, 0, 0] == math.pi / 2
    assert np.isnan(of(np.array([math.nan]))[:, :3]).all()


@pytest.mark.skipif(not COMPILED, reason="plain Python takes those of NumPy")
def test_elementary_functions_over_the_whole_range_of_doubles():
    x = np.array([*np.linspace(-750, 750, 99999), *10.0 ** np.linspace(-320, 308, 999), math.inf])
    with np.errstate(over="ignore"):
        expected = np.exp([x, -x])
    np.testing.assert_allclose(of(x)[3, :2], expected, rtol=4.5e-16, atol=5e-324)
    far = np.linspace(0, 1e8, 99999)
    _, sines, cosines, _ = of(far)
    np.testing.assert_allclose([sines[0], cosines[0]], [np.sin(far), np.cos(far)], rtol=0, atol=4e-16)
    assert np.isnan(of(np.array([1.1e8, 1e300, math.inf]))[1:3, :2]).all()


@kernel
def everything(a, b, out):
    x, y = load(a, 1), load(b, 0)
    z = (x + y) * 2.0 - x / y
    z += -swap_sides(x)
    z *= y
    z -= 1.0
    z /= 0.5
    store(out, 0, z)
    store(out, 4, minimum(x, y))
    store(out, 8, maximum(x, 0.5))
    store(out, 12, where((x > 0.0) & (x <= y), copysign(sqrt(fabs(x)), y), broadcast(7.0)))
    store(out, 16, power(fabs(x), 1.5))
    if any_of(x != x):
        out[20] = 1.0
    if any_of(y >= 1e9):
        out[21] = 1.0
    out[22] = first(broadcast(3.0))
    _, out[23], _, _ = unpack(x)


def test_arithmetic_compiled_and_plain():
    """Compiled and plain results are equal to the bit in each lane, whatever the other lanes hold."""
    rng = np.random.default_rng(1)
    a, b = rng.normal(size=5), rng.normal(size=8)
    for bad in (False, True):
        if bad:
            a[3] = math.nan
        compiled, plain = np.zeros((2, 24))
        everything(a, b, compiled)
        getattr(everything, "py_func", everything)(a, b, plain)
        np.testing.assert_allclose(compiled[16:20], plain[16:20], rtol=1e-15)  # pow
        compiled[16:20] = plain[16:20] = 0.0
        np.testing.assert_array_equal(compiled, plain)
        assert (compiled[20] == 1.0) == bad


@kernel
def of_a_car(grid, table, x, out):
    out[0], out[1] = math.exp(x[0]), math.expm1(x[1])
    out[2], out[3] = math.sin(x[2]), math.cos(x[3])
    _, out[4] = bracket(grid, x[4])
    out[5] = within(x[5], -0.5, 0.5)
    odd = (x[6] > 0.0) & invert(x[6] > 1.0) | (x[7] < -1.0)
    out[6] = where(odd, abs(x[6]), floor(x[6]))
    if any_of(odd):
        out[6] = where(odd, math.copysign(math.sqrt(out[6]), x[7]), out[6])
    if all_of(x[0] == x[0]):
        out[7] = 1.0
    out[8], out[9], out[10], out[11] = unpack_cars(spread(x[1]) * load(table, as_index(abs(x[7]))))
    wheels = pack(x[0], x[1], x[2], x[3]) * x[4] + load(x, 4)
    out[12], out[13], out[14], out[15] = unpack(swap_sides(atan(wheels)) + broadcast(x[5]))
    out[16] = first(wheels)


@kernel
def of_four_cars(grid, table, x, out):
    cars, found = scratch.fours(1, x.shape[1]), scratch.fours(1, out.shape[1])
    rows = as_index(pack(2.0, 0.0, 3.0, 1.0))
    interleave(x, x.shape[1], rows * x.shape[1], cars)
    of_a_car(grid, table, cars[0], found[0])
    deinterleave(found, out.shape[1], rows * out.shape[1], out)


@pytest.mark.skipif(not COMPILED, reason="cars run side by side in compiled code alone")
def test_a_car_has_its_bits_beside_others():
    rng = np.random.default_rng(2)
    grid, table = np.array([0.0, 0.3, 1.0, 2.0]), rng.normal(size=64)
    for scale in (0.3, 1.0, 8.0):
        x = scale * rng.normal(size=(4, 8))
        x[:, 3], x[2, 4] = 1.5, math.nan  # equal in all lanes; not a number
        alone, together = np.ones((2, 4, 17))
        for i in range(4):
            of_a_car(grid, table, x[i], alone[i])
        of_four_cars(grid, table, x, together)
        np.testing.assert_array_equal(together, alone)
