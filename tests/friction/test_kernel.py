"""A kernel inside another one prints and raises as it does alone, and no kernel allocates."""

import numpy as np
import pytest
from numba.core.errors import NumbaError

from steer_env.friction.numerics.kernel import COMPILED, kernel


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
