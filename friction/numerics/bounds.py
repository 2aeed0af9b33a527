"""Bounds as a kernel, because numba compiles ``min`` and ``max`` anew for each pair of types."""

from steer_env.friction.numerics.kernel import kernel


@kernel
def within(x, low, high):
    """``x`` limited to ``[low, high]``; NaN is returned as it is."""
    if x < low:
        return low
    return high if x > high else x
