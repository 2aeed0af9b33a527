"""A kernel inside another one prints and raises as it does alone, indexes as numpy does, and allocates nothing."""

import numba
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numba.core.errors import NumbaError

from steer_env.friction.numerics.kernel import COMPILED, kernel, plain


@kernel
def checked(x):
    if x > 2.0:
        raise ValueError("too large")
    print("took", x)
    return 2.0 * x


@kernel
def calling(x):
    return checked(x) + 1.0


@pytest.mark.parametrize("outermost", [checked, calling])
def test_a_kernel_prints_and_raises_wherever_it_is_called(outermost, capfd):
    assert outermost(1.0) == 2.0 + (outermost is calling)
    assert capfd.readouterr().out.split() == ["took", "1.0"]
    with pytest.raises(ValueError, match="too large"):
        outermost(3.0)


@pytest.mark.skipif(not COMPILED, reason="nothing is compiled")
@pytest.mark.parametrize("allocating", [lambda n: np.zeros(n)[0], lambda n: len([n])], ids=["array", "list"])
def test_a_kernel_that_allocates_does_not_compile(allocating):
    with pytest.raises(NumbaError, match=r"NRT required but not enabled|Function.*zeros"):
        kernel(allocating)(3)


@kernel
def indexed(x, y, i, j, end, found):
    """Elements, rows and parts, all of which are written and read."""
    found[0], found[1], found[2] = x[i], x[-2], y[i, j]
    row, part, rows = y[j], x[i:end], y[i:end]
    found[3], found[4] = row.size, row[-1]
    found[5], found[6], found[7] = part.size, rows.shape[0], rows.shape[1]
    for k in range(part.size):
        part[k] += 1.0
        found[8] += (k + 1) * part[k]
    if rows.shape[0] > 0:
        rows[-1, i] = 7.0
        rows[0][j] -= 3.0
    x[2:][0] = -1.0
    x[:-1][-1] *= 2.0


@given(i=st.integers(-4, 3), j=st.integers(-4, 3), end=st.integers(-9, 9))
def test_indices_count_from_both_ends_and_slices_end_where_the_array_does(i, j, end):
    results = []
    for function in (indexed, plain(indexed)):
        x, y, found = np.arange(4.0), np.arange(16.0).reshape(4, 4), np.zeros(9)
        function(x, y, i, j, end, found)
        results.append(np.concatenate([x, y.ravel(), found]))
    np.testing.assert_array_equal(*results)


@pytest.mark.skipif(not COMPILED, reason="nothing is compiled")
def test_a_kernel_stays_exact_where_a_caller_is_not():
    """numba gives a function the options of the caller that compiles it first, for all later ones."""

    @kernel
    def exact(x):
        return (x + 1e16) - 1e16

    @numba.njit(fastmath=True)
    def loose(x):
        return exact(x)

    assert loose(1.0) == 0.0
