"""Bounds as a kernel, because numba compiles ``min`` and ``max`` anew for each pair of types."""

from steer_env.friction.numerics.kernel import kernel
from steer_env.friction.numerics.simd import where


@kernel
def within(x, low, high):
    """``x`` limited to ``[low, high]``; NaN is returned as it is."""
    return where(x < low, low, where(x > high, high, x))
