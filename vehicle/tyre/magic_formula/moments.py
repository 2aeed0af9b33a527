"""Overturning moment and rolling resistance moment, over R_0 and the load."""

from steer_env.friction.numerics.kernel import kernel
from steer_env.vehicle.simd import atan, cos, fabs, power, sin


@kernel
def overturning(c, p, F_y):
    """M_x over R_0 F_z [1] (T10)."""
    y = F_y * (1.0 / c.FNOMIN)
    M_x = c.QSX1 - c.QSX2 * p.g + c.QSX3 * y  # (T10), (4.E69)
    if c.FITTYP == 61.0:
        if c.QSX4 != 0.0:
            x = c.QSX6 * p.u
            M_x += c.QSX4 * sin(c.QSX7 * p.g + c.QSX8 * atan(c.QSX9 * y)) * cos(c.QSX5 * atan(x * x))
        if c.QSX10 != 0.0:
            M_x += c.QSX10 * atan(c.QSX11 * p.u) * p.g
        M_x += (c.QSX13 + c.QSX14 * fabs(p.g)) * F_y / p.F_z - c.QSX12 * p.g * fabs(p.g)
    return M_x


@kernel
def rolling_resistance(c, p, F_x, v_x):
    """The load, and -M_y over R_0 and that load (T11)."""
    M_y = c.QSY1 + c.QSY2 * F_x * (1.0 / c.FNOMIN)  # (T11)
    if c.QSY3 != 0.0 or c.QSY4 != 0.0:
        v = fabs(v_x) / c.LONGVL
        M_y += c.QSY3 * v + c.QSY4 * (v * v) * (v * v)  # (T11)
    load = p.F_z
    if c.FITTYP == 61.0:
        M_y += (c.QSY5 + c.QSY6 * p.u) * p.g2
        if c.QSY7 != 1.0:
            load = c.FNOMIN * power(p.u, c.QSY7)
    return load, M_y
