"""Slip stiffness and cornering stiffness."""

from steer_env.friction.numerics.kernel import kernel
from steer_env.friction.numerics.simd import atan, broadcast, exp, fabs, first, sin


@kernel
def cornering(c, F_z, g):
    """K_y, negative [N/rad], at camber ``g`` (T4)."""
    g2 = g * g
    most = c.FNOMIN * (c.PKY2 + c.PKY5 * g2)
    over = c.PKY1 * c.FNOMIN
    if c.FITTYP == 60.0:
        under = 1.0 + c.PKY3 * g2
    else:
        over, under = over * (1.0 - c.PKY3 * fabs(g)), 1.0 + 0.0 * g2
    if c.PKY4 == 2.0:  # sin(2 atan(u)) = 2 u/(1 + u^2)
        return over * 2.0 * F_z * most / (under * (most * most + F_z * F_z))  # (T4), (4.E25)
    return over * sin(c.PKY4 * atan(F_z / most)) / under  # (T4), (4.E25)


@kernel
def slip_stiffness(c, F_z, df):
    """K_x [N per unit slip] (T2)."""
    return F_z * (c.PKX1 + c.PKX2 * df) * exp(c.PKX3 * df)  # (T2), (4.E15)


@kernel
def stiffnesses(c, F_z):
    """:func:`longitudinal_stiffness` and :func:`cornering_stiffness` of four tyres."""
    return slip_stiffness(c, F_z, F_z / c.FNOMIN - 1.0), fabs(cornering(c, F_z, broadcast(0.0)))


@kernel
def longitudinal_stiffness(c, F_z):
    """Slope of F_x over kappa where kappa + S_H = 0 [N per unit slip]."""
    return first(stiffnesses(c, broadcast(F_z))[0])


@kernel
def cornering_stiffness(c, F_z):
    """Magnitude of the slope of F_y over alpha at camber 0 where alpha + S_H = 0 [N/rad]."""
    return first(stiffnesses(c, broadcast(F_z))[1])
