"""The bristle that LuGre and Dahl share: ``dz/dt = v - |v| z/z_g``, integrated exactly at constant speed."""

import math

from friction.kernel import kernel


@kernel
def decay(X):
    """``E = exp(-X)``, its means ``p1 = (1 - E)/X`` and ``p2 = (1 - p1)/X``, and the derivatives of both means.

    Below 0.1 the quotients cancel, so the Taylor series take over; eight terms leave less than 1e-15.
    """
    if X > 0.1:
        E = math.exp(-X)
        p1 = (1.0 - E) / X
        p2 = (1.0 - p1) / X
        d1 = (E - p1) / X
        d2 = -(d1 + p2) / X
        return E, p1, p2, d1, d2
    # p1 = sum (-X)^k/(k+1)!, p2 = sum (-X)^k/(k+2)!, in Horner form
    p2 = 0.5 * (1 - X / 3 * (1 - X / 4 * (1 - X / 5 * (1 - X / 6 * (1 - X / 7 * (1 - X / 8 * (1 - X / 9)))))))
    p1 = 1.0 - X * p2
    d2 = -1 / 6 + X / 12 - X**2 / 40 + X**3 / 180 - X**4 / 1008 + X**5 / 6720 - X**6 / 51840
    d1 = -p2 - X * d2
    return 1.0 - X * p1, p1, p2, d1, d2


@kernel
def displaced(z, z_g, w, h):
    """Deflection after ``h`` at constant speed ``w``, with steady deflection ``z_g``."""
    E, p1, _, _, _ = decay(abs(w) * h / z_g)
    return z * E + h * w * p1
