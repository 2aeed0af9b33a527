"""Forces and moments of a tyre: pure slip and its weights at combined slip, trail, moments, and their sequence.

Longitudinal force, lateral force, aligning torque, overturning and rolling resistance moment stand in this order; the
last functions call them for four tyres and for one.
"""

import math
from typing import NamedTuple

from steer_env.friction.numerics.kernel import kernel
from steer_env.friction.numerics.simd import (
    any_of,
    atan,
    broadcast,
    copysign,
    cos,
    fabs,
    first,
    maximum,
    minimum,
    power,
    sin,
    sqrt,
    where,
)
from steer_env.vehicle.tyre.magic_formula.curve import cos_atan, curve
from steer_env.vehicle.tyre.magic_formula.point import direction, operating_point, turn_slip_factors
from steer_env.vehicle.tyre.magic_formula.stiffness import cornering, slip_stiffness


class Longitudinal(NamedTuple):
    """Longitudinal force of four tyres."""

    F_x: float  # [N]
    dF_x: float  # the part that the lever s takes to the aligning torque [N]
    K_x: float  # slip stiffness; 0 where no force was evaluated [N per unit slip]


@kernel
def _weight(c, p):
    """Weight G_xa of F_x by the slip angle (T5)."""
    B = (c.RBX1 + c.RBX3 * p.g2) * cos_atan(c.RBX2 * p.kappa)  # (4.E54)
    E = minimum(c.REX1 + c.REX2 * p.df, 1.0)  # (4.E56)
    G = cos(c.RCX1 * atan(curve(B * (p.a + c.RHX1), E)))  # (T5), (4.E51), (4.E53)
    if c.RHX1 != 0.0:
        G /= cos(c.RCX1 * atan(curve(B * c.RHX1, E)))  # (4.E52)
    return G


@kernel
def longitudinal_force(c, p, zeta_1, slips):
    """F_x at combined slip (T2); ``slips`` tells whether any kappa is not 0."""
    F_x = dF_x = K_x = broadcast(0.0)
    shift = c.PHX1 + c.PHX2 * p.df  # (4.E17)
    S_V = p.F_z * (c.PVX1 + c.PVX2 * p.df) * p.fade_x * zeta_1  # (4.E18)
    if slips or any_of(shift != 0.0) or any_of(S_V != 0.0):
        D = (c.PDX1 + c.PDX2 * p.df) * (1.0 - c.PDX3 * p.g2) * p.mu * p.F_z * zeta_1  # (T2), (4.E12), (4.E13)
        K_x = slip_stiffness(c, p.F_z, p.df)  # (T2)
        B = K_x / (c.PCX1 * D)  # (4.E16)
        x = B * (p.kappa + shift)  # (4.E10)
        E_0 = c.PEX1 + c.PEX2 * p.df + c.PEX3 * p.df * p.df
        E = minimum(E_0 * (1.0 - c.PEX4 * copysign(1.0, x)), 1.0)  # (4.E14)
        dF_x = D * sin(c.PCX1 * atan(curve(x, E)))  # (T2), (4.E9)
        G = _weight(c, p)
        F_x = G * (dF_x + S_V)  # (T5), (4.E50)
        if c.FITTYP != 60.0:
            dF_x = F_x
        else:
            if any_of(shift != 0.0):
                E = minimum(E_0 * (1.0 - c.PEX4 * copysign(1.0, shift)), 1.0)
                dF_x -= D * sin(c.PCX1 * atan(curve(B * shift, E)))
            dF_x *= G
    return Longitudinal(F_x, dF_x, K_x)


_PER_RAMP = 200.0  # inverse of the |alpha| from which the asymmetry of E_y is full, FITTYP 60; assumed [1/rad]


class Lateral(NamedTuple):
    """Lateral force of four tyres at pure slip, and what the aligning torque takes from it."""

    F_y: float  # [N]
    F_t: float  # the force that the pneumatic trail multiplies [N]
    per_K: float  # inverse of the cornering stiffness [rad/N]
    D: float  # peak [N]
    B: float  # stiffness [1/rad]
    S_H: float  # shift of the slip angle [rad]
    S_V: float  # shift of the force [N]


@kernel
def _force_without_camber(c, p):
    """F_y0 without camber and turn slip, which the pneumatic trail of FITTYP 61 multiplies [N]."""
    df = p.F_z / c.FNOMIN - 1.0
    x = p.alpha + c.PHY1 + c.PHY2 * df
    D = (c.PDY1 + c.PDY2 * df) * p.mu * p.F_z
    E = minimum((c.PEY1 + c.PEY2 * df) * (1.0 - c.PEY3 * copysign(1.0, x)), 1.0)
    S_V = p.F_z * (c.PVY1 + c.PVY2 * df) * p.fade_y
    x *= p.stiffness * cornering(c, p.F_z, broadcast(0.0)) / (D * c.PCY1)
    return D * sin(c.PCY1 * atan(curve(x, E))) + S_V


@kernel
def lateral_force(c, p, turn, turn_slip, spins):
    """F_y at pure slip (T3)."""
    K = p.stiffness * cornering(c, p.F_z, p.g) * turn.zeta_3  # (T14)
    per_K = 1.0 / K
    S_Vg = p.F_z * (c.PVY3 + c.PVY4 * p.df) * p.g * p.fade_y * turn.zeta_2  # (4.E28)
    S_V = p.F_z * (c.PVY1 + c.PVY2 * p.df) * p.fade_y * turn.zeta_2 + S_Vg  # (4.E29)
    S_H = c.PHY1 + c.PHY2 * p.df
    K_g = p.F_z * (c.PKY6 + c.PKY7 * p.df)  # (4.E30)
    if c.FITTYP == 52.0:
        S_H += c.PHY3 * p.g
    elif turn_slip is not None and spins and c.PHYP1 != 0.0:
        y = c.PHYP1 * (c.PHYP2 + c.PHYP3 * p.df)
        K_0 = p.stiffness * cornering(c, p.F_z, broadcast(0.0)) * turn.zeta_3
        x = K_g / (turn.camber_share * y * K_0) * turn.spin
        x = curve(x, minimum(broadcast(c.PHYP4), 1.0))
        S_H += y / c.PHYP1 * sin(c.PHYP1 * atan(x)) - S_Vg * per_K
    else:
        S_H += (K_g * p.g - S_Vg) * per_K  # (4.E27)
    D = (c.PDY1 + c.PDY2 * p.df) * (1.0 - c.PDY3 * p.g2) * p.mu * p.F_z * turn.zeta_2  # (T3), (4.E22), (4.E23)
    B = K / (c.PCY1 * D)  # (4.E26)
    if c.FITTYP == 60.0:
        side = minimum(maximum(p.alpha * _PER_RAMP, -1.0), 1.0)
    else:
        side = copysign(1.0, p.alpha + S_H)
    # (4.E24)
    E = minimum((c.PEY1 + c.PEY2 * p.df) * (1.0 + c.PEY5 * p.g2 - (c.PEY3 + c.PEY4 * p.g) * side), 1.0)
    F_y = D * sin(c.PCY1 * atan(curve(B * (p.alpha + S_H), E))) + S_V  # (T3), (4.E19), (4.E20)
    F_t = F_y
    if c.FITTYP == 61.0:
        F_t = _force_without_camber(c, p)
        if not spins:
            F_t = where(p.g != 0.0, F_t, F_y)
    return Lateral(F_y, F_t, per_K, D, B, S_H, S_V)


@kernel
def combined_slip(c, p, D_y, kappa, slips):
    """Weight G_yk and shift S_Vyk of F_y by kappa (T5); at kappa = 0 they are exactly 1 and 0."""
    G, S_V = broadcast(1.0), broadcast(0.0)
    if kappa is not None and slips:
        S_H = c.RHY1 + c.RHY2 * p.df  # (4.E65)
        E = minimum(c.REY1 + c.REY2 * p.df, 1.0)  # (4.E64)
        B = (c.RBY1 + c.RBY4 * p.g2) * cos_atan(c.RBY2 * (p.a - c.RBY3))  # (4.E62)
        # (T5), (4.E59), (4.E60), (4.E61)
        G = cos(c.RCY1 * atan(curve(B * (p.kappa + S_H), E))) / cos(c.RCY1 * atan(curve(B * S_H, E)))
        S_V = c.RVY1 + c.RVY2 * p.df + c.RVY3 * p.g
        S_V *= D_y * cos_atan(c.RVY4 * p.a) * sin(c.RVY5 * atan(c.RVY6 * p.kappa))  # (T5), (4.E66), (4.E67)
    return G, S_V


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


@kernel
def overturning(c, p, F_y):
    """M_x over R_0 F_z [1] (T10)."""
    y = F_y * (1.0 / c.FNOMIN)
    M_x = c.QSX1 - c.QSX2 * p.g + c.QSX3 * y  # (T10), (4.E69)
    if c.QSX4 != 0.0:
        x = c.QSX6 * p.u
        M_x += c.QSX4 * sin(c.QSX7 * p.g + c.QSX8 * atan(c.QSX9 * y)) * cos(c.QSX5 * atan(x * x))
    if c.QSX10 != 0.0:
        M_x += c.QSX10 * atan(c.QSX11 * p.u) * p.g
    if c.FITTYP == 61.0:
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
    if c.FITTYP != 60.0:
        M_y += (c.QSY5 + c.QSY6 * p.u) * p.g2
        if c.QSY7 != 1.0:
            load = c.FNOMIN * power(p.u, c.QSY7)
    return load, M_y


@kernel
def _steady(c, kappa, alpha, tan_a, camber, F_z, v_x, mu, stiffness, turn_slip):
    """:func:`forces` of four tyres, for slip angles given by themselves and by their tangents; one turn slip.

    None for ``kappa`` or the turn slip removes at compile time what zeros skip at run time: numba removes a branch
    whose condition asks for None first.
    """
    way = direction(v_x)
    p = operating_point(c, way, kappa, alpha, tan_a, camber, F_z, mu, stiffness)
    slips = kappa is not None and any_of(p.kappa != 0.0)
    spins = turn_slip is not None and turn_slip != 0.0 and c.TURN_SLIP != 0.0
    turn = turn_slip_factors(c, p, turn_slip, spins)

    longitudinal = longitudinal_force(c, p, turn.zeta_1, slips)
    lateral = lateral_force(c, p, turn, turn_slip, spins)
    G_y, S_Vk = combined_slip(c, p, lateral.D, kappa, slips)
    F_x, F_y = longitudinal.F_x, G_y * lateral.F_y + S_Vk  # (T5), (4.E58)

    slip = equivalent_slip(c, p, lateral, longitudinal.K_x, kappa, slips)
    t = pneumatic_trail(c, p, slip.a_t, slip.a_e, turn.zeta_5)
    M_zr = residual_torque(c, p, turn, lateral, G_y, slip.a_r2, turn_slip, spins)
    M_z = M_zr - t * (G_y * lateral.F_t)  # (T6), (4.E72), (4.E74)
    M_z += lever(c, p, F_y) * longitudinal.dF_x  # (T6), (4.E71)

    M_x = overturning(c, p, F_y)
    load, M_y = rolling_resistance(c, p, F_x, v_x)
    way = where(F_z < 1e-6, 0.0, way)
    R_0 = c.UNLOADED_RADIUS
    return way * F_x, way * F_y, way * R_0 * p.F_z * M_x, -way * R_0 * load * M_y, way * way * M_z


@kernel
def forces(c, kappa, alpha, camber, F_z, v_x, mu=1.0, turn_slip=0.0):
    """F_x, F_y [N], M_x, M_y, M_z [N m]: one evaluation of :meth:`tyre.Tyre.forces`, which describes the arguments.

    Unchecked, for any ``v_x`` and ``F_z >= 0``. At standstill the formula is not valid, and the caller must fade the
    result out.
    """
    F_x, F_y, M_x, M_y, M_z = _steady(
        c,
        broadcast(kappa),
        broadcast(alpha),
        broadcast(math.tan(alpha)),
        broadcast(camber),
        broadcast(F_z),
        broadcast(v_x),
        broadcast(mu),
        broadcast(1.0),
        turn_slip,
    )
    return first(F_x), first(F_y), first(M_x), first(M_y), first(M_z)


@kernel
def forces_of_four(c, kappa, tan_alpha, camber, F_z, v_x, mu, stiffness):
    """:func:`forces` of four tyres without turn slip, for the tangents of the slip angles, v_y/|v_x|.

    ``tyre_forces`` of each chassis calls this at every evaluation; :func:`forces` serves users and the linear models.

    Relaxed slip angles have these tangents as states. ``stiffness`` multiplies the cornering stiffness [1]. ``kappa``
    None stands for 0 at all four tyres and compiles in half the time.
    """
    return _steady(c, kappa, atan(tan_alpha), tan_alpha, camber, F_z, v_x, mu, stiffness, None)
