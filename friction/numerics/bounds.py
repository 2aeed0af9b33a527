"""Bounds as a kernel: numba would compile a function for each pair of types that its ``min`` and ``max`` meet."""

from steer_env.friction.numerics.kernel import kernel


@kernel
def within(x, low, high):
    """``x``, or the bound that it passes; what is not a number stays."""
    if x < low:
        return low
    return high if x > high else x
