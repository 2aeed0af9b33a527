"""Two functions of which all curves of the Magic Formula consist."""

from steer_env.friction.numerics.kernel import kernel
from steer_env.friction.numerics.simd import any_of, atan, sqrt


@kernel
def curve(x, E):
    """Argument of the outer arc tangent, ``x - E (x - atan(x))``, for x = B (slip + S_H) (T1)."""
    return x - E * (x - atan(x)) if any_of(E != 0.0) else x  # (T1)


@kernel
def cos_atan(y):
    """``cos(atan(y))``."""
    return 1.0 / sqrt(1.0 + y * y)
