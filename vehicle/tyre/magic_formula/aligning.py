"""Aligning torque: pneumatic trail and residual torque."""

import math
from typing import NamedTuple

from steer_env.friction.numerics.kernel import kernel
from steer_env.vehicle.simd import any_of, atan, broadcast, copysign, cos, fabs, minimum, sin, sqrt, where
from steer_env.vehicle.tyre.magic_formula.curve import curve


class EquivalentSlip(NamedTuple):
    """Slip angles that the trail and the residual torque take, to which kappa adds."""

    a_t: float  # of the trail
    a_e: float  # of the curvature of the trail
    a_r2: float  # of the residual torque, squared


@kernel
def equivalent_slip(c, p, lateral, K_x, kappa, slips):
    """Slip angles of trail and residual torque."""
    a_t = a_e = p.a + c.QHZ1 + c.QHZ2 * p.df + (c.QHZ3 + c.QHZ4 * p.df) * p.g  # (4.E34), (4.E35)
    a_r = p.a + lateral.S_H + lateral.S_V * lateral.per_K  # (4.E37), (4.E38)
    a_r2 = a_r * a_r
    if kappa is not None and slips:
        y = K_x * lateral.per_K * p.kappa
        if c.FITTYP == 60.0:
            a_t = a_e = copysign(sqrt(a_t * a_t + y * y), a_t)  # (4.E77)
            a_r2 += y * y  # (4.E78)
        else:
            slipping, y2 = p.kappa != 0.0, y * y
            x = sin(a_t) / cos(a_t)
            a_t = where(slipping, copysign(atan(sqrt(x * x + y2)), a_t), a_t)  # (A55)
            x = sin(a_r) / cos(a_r)
            x = atan(sqrt(x * x + y2))  # (A54)
            a_r2 = where(slipping, x * x, a_r2)
    return EquivalentSlip(a_t, a_e, a_r2)


@kernel
def pneumatic_trail(c, p, a_t, a_e, zeta_5):
    """t [m] (T7)."""
    B = c.QBZ1 + c.QBZ2 * p.df + c.QBZ3 * p.df * p.df
    B *= p.stiffness * p.per_mu  # (T14)
    B = B * (1.0 + c.QBZ4 * p.g + c.QBZ5 * fabs(p.g) + c.QBZ6 * p.g2)  # (4.E40); (A58) under FITTYP 61
    E = c.QEZ1 + c.QEZ2 * p.df + c.QEZ3 * p.df * p.df
    E = minimum(E * (1.0 + (c.QEZ4 + c.QEZ5 * p.g) * (2.0 / math.pi) * atan(B * c.QCZ1 * a_e)), 1.0)  # (4.E44)
    t = p.u * c.UNLOADED_RADIUS * (c.QDZ1 + c.QDZ2 * p.df)  # D_t of (T7), (4.E42)
    t = t * (1.0 + c.QDZ3 * fabs(p.g) + c.QDZ3G * p.g + c.QDZ4 * p.g2) * p.cos_a * zeta_5  # (4.E43)
    t *= cos(c.QCZ1 * atan(curve(B * a_t, E)))  # (T7), (4.E33), (4.E73)
    return t


@kernel
def residual_torque(c, p, turn, lateral, G_y, a_r2, turn_slip, spins):
    """M_zr [N m] (T8)."""
    R_0 = c.UNLOADED_RADIUS
    B = (c.QBZ9 * p.stiffness * p.per_mu + c.QBZ10 * c.PCY1 * lateral.B) * turn.zeta_6  # B_r of (T8), (T14), (4.E45)
    decay = 1.0 / sqrt(1.0 + B * B * a_r2)  # cos(atan(B alpha_r)) of (4.E36)
    D = (c.QDZ6 + c.QDZ7 * p.df) * turn.zeta_2
    y = (c.QDZ8 + c.QDZ9 * p.df + (c.QDZ10 + c.QDZ11 * p.df) * fabs(p.g)) * p.g
    M_spin = broadcast(0.0)
    if turn_slip is not None and spins and c.QCRP1 != 0.0:
        M_turn = c.QCRP1 * fabs(lateral.D) / turn.zeta_2 * R_0 * sqrt(p.u)  # (4.95)
        C = c.QDRP1  # (4.96)
        M_spin = M_turn / math.sin(0.5 * math.pi * C)  # (4.94)
        # (4.99)
        x = p.F_z * R_0 * (c.QDZ8 + c.QDZ9 * p.df) / (c.LMUY * turn.camber_share * C * M_spin) * turn.spin
        M_spin *= sin(C * atan(curve(x, minimum(broadcast(c.QDRP2), 1.0))))
        if any_of(M_spin != 0.0):
            x = M_turn * (2.0 / math.pi) * atan(c.QCRP2 * fabs(turn.spin)) * G_y / fabs(M_spin)  # (4.103)
            x = minimum(x, 1.0)
            # C_r is the arc cosine of x over a right angle; the arc cosine follows from its half angle.
            decay = cos((4.0 / math.pi) * atan(sqrt((1.0 - x) / (1.0 + x))) * atan(B * sqrt(a_r2)))
        y *= 0.0  # camber acts by its spin
    M_zr = (p.F_z * R_0 * (D + y) * p.mu * p.cos_a + M_spin) * decay  # (T8), (4.E47), (4.E75)
    if c.FITTYP == 60.0:
        M_zr *= p.cos_a  # (4.E36)
    return M_zr


@kernel
def lever(c, p, F_y):
    """s, the lever of F_x about z [m] (T9)."""
    y = F_y * (1.0 / c.FNOMIN)
    return c.UNLOADED_RADIUS * (c.SSZ1 + c.SSZ2 * y + (c.SSZ3 + c.SSZ4 * p.df) * p.g)  # (T9), (4.E76)
