"""The bristle that LuGre, Dahl and the exponential spring share, integrated exactly at constant speed w over a time h.

    dz/dt = v - |v| z/z_g                                                    (F3), (F4)
    z+ = z E + h w p1,    mean z = z p1 + h w p2,    X = |w| h/z_g           (F8)
    E = exp(-X),    p1 = (1 - E)/X,    p2 = (1 - p1)/X                       (F8)

z_g is the steady deflection [rad], z+ the deflection at the end. The numbers are those of docs/model.md.
"""

import math

from steer_env.friction.numerics.bounds import within
from steer_env.friction.numerics.kernel import kernel
from steer_env.friction.numerics.simd import all_of, any_of, where


@kernel
def decay(X):
    """E, p1 and p2 of (F8), and the derivatives of p1 and p2 by X.

    Below X = 0.1 the quotients cancel, so the Taylor series are used; eight terms leave an error below 1e-15.
    """
    far = X > 0.1
    if all_of(far):
        return _by_quotients(X)
    near = _by_series(X)
    if not any_of(far):
        return near
    E, p1, p2, d1, d2 = _by_quotients(X)
    return (
        where(far, E, near[0]),
        where(far, p1, near[1]),
        where(far, p2, near[2]),
        where(far, d1, near[3]),
        where(far, d2, near[4]),
    )


@kernel
def _by_quotients(X):
    E = math.exp(-X)  # (F8)
    p1 = (1.0 - E) / X  # (F8)
    p2 = (1.0 - p1) / X  # (F8)
    d1 = (E - p1) / X
    d2 = -(d1 + p2) / X
    return E, p1, p2, d1, d2


@kernel
def _by_series(X):
    # p1 = sum (-X)^k/(k+1)!, p2 = sum (-X)^k/(k+2)!, in Horner form; the compiler folds quotients of constants
    Y = -X
    tail = 1 / 720 + Y * (1 / 5040 + Y * (1 / 40320 + Y * (1 / 362880 + Y * (1 / 3628800))))
    p2 = 1 / 2 + Y * (1 / 6 + Y * (1 / 24 + Y * (1 / 120 + Y * tail)))
    p1 = 1.0 - X * p2
    tail = 1 / 180 + Y * (1 / 1008 + Y * (1 / 6720 + Y * (1 / 51840 + Y * (1 / 453600))))
    d2 = -(1 / 6 + Y * (1 / 12 + Y * (1 / 40 + Y * tail)))
    d1 = -p2 - X * d2
    return 1.0 - X * p1, p1, p2, d1, d2


@kernel
def limit_deflection(z, limit):
    """Deflection cut back to the limit that break-away sets.

    Where the torque scale has fallen, the bristle has slipped already; without the cut, a bristle beyond its steady
    deflection would give back more energy than it stored.
    """
    return within(z, -limit, limit)


@kernel
def slide(z, z_g, limit, w, h):
    """Deflection after ``h`` at constant speed ``w`` (F8), held within ``limit``."""
    E, p1, _, _, _ = decay(abs(w) * h / z_g)
    return limit_deflection(limit_deflection(z, limit) * E + h * w * p1, limit)  # (F8)


@kernel
def spring(sigma_0, F, z, w, h):
    """Mean torque over a step of an exponential spring that saturates at ``F`` (F8), and its derivative by ``w``."""
    slope = sigma_0 * h / F
    _, p1, p2, d1, d2 = decay(slope * abs(w))
    z = limit_deflection(z, F / sigma_0)
    mean = sigma_0 * (z * p1 + h * w * p2)  # (F8)
    return mean, sigma_0 * (h * p2 + (z * d1 + h * w * d2) * math.copysign(slope, w))
