"""Magic Formula: steady-state forces and moments of a tyre at combined slip, as kernels on flat coefficients.

Every force is a sine or cosine of one curve with stiffness B, shape C, peak D and curvature E:

    F = D sin(C atan(B x - E (B x - atan(B x)))) + S_V,    x = slip + S_H

    F_x = G_xa F_x0(kappa)      F_y = G_yk F_y0(alpha) + S_Vyk      M_z = -t (F_y - S_Vyk) + M_zr + s dF_x

The weights G and the lever s couple the slips; t is the pneumatic trail, M_zr the residual torque.

The kernels take four wheels at once (:mod:`steer_env.vehicle.simd`); one wheel alone fills all four lanes. What a branch adds
for one wheel is exactly nothing for a wheel that does not need it.

Axes: ISO 8855, x forward, y left, z up; alpha > 0 gives F_y < 0 and M_z > 0. A tyre that rolls backwards is the same
tyre seen from behind: a half turn about z reverses kappa, alpha, camber, F_x, F_y, M_x and M_y and leaves M_z and the
turn slip alone, for these are about z.

Three sets of equations share the kernel, told apart by ``FITTYP``:

* 60: Pacejka, Tyre and Vehicle Dynamics, 2nd ed. 2006, section 4.3.2; M_y as in MF-Tyre 5.2.
* 52: MF-Tyre 5.2 (PAC2002 in ADAMS): camber itself, not its sine; the slip angle itself in weights and trail.
* 61: MF-Tyre 6.1 and 6.2: Besselink, Schmeitz, Pacejka, Vehicle System Dynamics 48 (2010) S1, appendix, also angles;
  the turn slip of 6.2: Pacejka, 3rd ed. 2012, section 4.3.3; M_x and M_y as in the same paper and MF-Tyre.

Deviations for 60, the first three of which reproduce an independent library to ten digits at kappa = camber = 0:

* F_y0 takes alpha itself; weights, trail and residual torque take tan(alpha). M_zr carries cos(alpha) twice.
* The asymmetry of E_y follows the sign of alpha, not of alpha + S_H; a short ramp keeps F_y continuous straight ahead.
* s acts on dF_x, the part of F_x that kappa adds: M_z at pure slip was fitted with the drag at kappa = 0 in it.

Deviations for all: a load under 1e-6 N gives zeros; the books' small epsilons in denominators are then not needed.
The spin that camber adds to turn slip takes R_0 for the effective rolling radius. Turn slip 0 means the equations
without turn slip, in which camber acts by its own terms, not as spin.
"""

import math

from steer_env.friction.numerics.kernel import kernel
from steer_env.vehicle.simd import (
    any_of,
    atan,
    broadcast,
    copysign,
    cos,
    exp,
    fabs,
    first,
    maximum,
    minimum,
    power,
    sin,
    sqrt,
    where,
)

A_MU = 10.0  # how slowly vertical shifts fade on a slippery road (books: lambda'_mu); 5.2: 1 [-]
_PER_RAMP = 200.0  # one over |alpha| where the asymmetry of E_y is full under FITTYP 60 [1/rad]; assumed


@kernel
def _curve(x, E):
    """Argument of the outer arc tangent, for x = B (slip + S_H)."""
    return x - E * (x - atan(x)) if any_of(E != 0.0) else x


@kernel
def _shrink(y):
    """``cos(atan(y))``."""
    return 1.0 / sqrt(1.0 + y * y)


@kernel
def _cornering(c, F_z, g):
    """K_y, negative [N/rad]."""
    g2 = g * g
    most = c.FNOMIN * (c.PKY2 + c.PKY5 * g2)
    over = c.PKY1 * c.FNOMIN
    if c.FITTYP == 60.0:
        under = 1.0 + c.PKY3 * g2
    else:
        over, under = over * (1.0 - c.PKY3 * fabs(g)), 1.0 + 0.0 * g2
    if c.PKY4 == 2.0:  # sin(2 atan(u)) = 2 u/(1 + u^2)
        return over * 2.0 * F_z * most / (under * (most * most + F_z * F_z))
    return over * sin(c.PKY4 * atan(F_z / most)) / under


@kernel
def _slip_stiffness(c, F_z, df):
    """K_x [N per unit slip]."""
    return F_z * (c.PKX1 + c.PKX2 * df) * exp(c.PKX3 * df)


@kernel
def stiffnesses(c, F_z):
    """:func:`longitudinal_stiffness` and :func:`cornering_stiffness` of four tyres."""
    return _slip_stiffness(c, F_z, F_z / c.FNOMIN - 1.0), fabs(_cornering(c, F_z, broadcast(0.0)))


@kernel
def longitudinal_stiffness(c, F_z):
    """Slope of F_x over kappa where kappa + S_H = 0 [N per unit slip]."""
    return first(stiffnesses(c, broadcast(F_z))[0])


@kernel
def cornering_stiffness(c, F_z):
    """Size of the slope of F_y over alpha at camber 0 where alpha + S_H = 0 [N/rad]."""
    return first(stiffnesses(c, broadcast(F_z))[1])


@kernel
def _upright(c, alpha, F_z, mu, fade):
    """F_y0 without camber and turn slip: what the pneumatic trail of FITTYP 61 multiplies [N]."""
    df = F_z / c.FNOMIN - 1.0
    x = alpha + c.PHY1 + c.PHY2 * df
    D = (c.PDY1 + c.PDY2 * df) * mu * F_z
    E = minimum((c.PEY1 + c.PEY2 * df) * (1.0 - c.PEY3 * copysign(1.0, x)), 1.0)
    S_V = F_z * (c.PVY1 + c.PVY2 * df) * fade
    x *= _cornering(c, F_z, broadcast(0.0)) / (D * c.PCY1)
    return D * sin(c.PCY1 * atan(_curve(x, E))) + S_V


@kernel
def _steady(c, kappa, alpha, tan_a, camber, F_z, v_x, mu, turn_slip):
    """:func:`forces` of four tyres, for slip angles known by themselves and by their tangents; one turn slip.

    None for ``kappa`` or the turn slip leaves out at compile time what zeros skip at run time: numba does so where a
    branch asks for None first.
    """
    lifted = F_z < 1e-6
    F_z = maximum(F_z, 1e-6)
    book = c.FITTYP == 60.0  # else MF-Tyre, which takes angles where the book takes their sine or tangent
    way = where(v_x >= 0.0, broadcast(1.0), -1.0)
    alpha, tan_a, g = way * alpha, way * tan_a, way * (sin(camber) if book else camber)
    slip = broadcast(0.0) if kappa is None else way * kappa
    slips = kappa is not None and any_of(slip != 0.0)
    a = tan_a if book else alpha
    g2, g_abs = g * g, fabs(g)
    cos_a = _shrink(tan_a)
    per_load = 1.0 / c.FNOMIN
    R_0 = c.UNLOADED_RADIUS
    u = F_z * per_load
    df = u - 1.0
    fade_x = fade_y = per_mu = broadcast(1.0)
    if any_of(mu != 1.0):
        per_mu = 1.0 / mu
        y = A_MU - 1.0 if c.FITTYP != 52.0 else 0.0
        fade_x = (1.0 + y * c.LMUX) * mu / (1.0 + y * c.LMUX * mu)
        fade_y = (1.0 + y * c.LMUY) * mu / (1.0 + y * c.LMUY * mu)

    # Spin over R_0, of the turn and of camber, positive where both turn the contact to the left as seen from above
    spins = turn_slip is not None and turn_slip != 0.0 and c.TURN_SLIP != 0.0
    spin = broadcast(0.0)
    camber_share = zeta_1 = zeta_2 = zeta_3 = zeta_5 = zeta_6 = broadcast(1.0)
    if turn_slip is not None and spins:
        camber_share = 1.0 - c.PECP1 * (1.0 + c.PECP2 * df)
        spin = R_0 * turn_slip + camber_share * (1.0 + slip) * cos_a * (g if book else sin(g))
        zeta_1 = _shrink(c.PDXP1 * (1.0 + c.PDXP2 * df) * _shrink(c.PDXP3 * slip) * spin)
        y = fabs(spin)
        y = c.PDYP1 * (1.0 + c.PDYP2 * df) * _shrink(c.PDYP3 * tan_a) * (y + c.PDYP4 * sqrt(y))
        zeta_2 = _shrink(y)
        zeta_3 = _shrink(c.PKYP1 * spin * spin)
        zeta_5 = _shrink(c.QDTP1 * spin)
        zeta_6 = _shrink(c.QBRP1 * spin)

    # F_x at pure slip, and its weight
    F_x = dF_x = K_x = broadcast(0.0)
    shift = c.PHX1 + c.PHX2 * df
    S_Vx = F_z * (c.PVX1 + c.PVX2 * df) * fade_x * zeta_1
    if slips or any_of(shift != 0.0) or any_of(S_Vx != 0.0):
        D_x = (c.PDX1 + c.PDX2 * df) * (1.0 - c.PDX3 * g2) * mu * F_z * zeta_1
        K_x = _slip_stiffness(c, F_z, df)
        B_x = K_x / (c.PCX1 * D_x)
        x = B_x * (slip + shift)
        E_0 = c.PEX1 + c.PEX2 * df + c.PEX3 * df * df
        E = minimum(E_0 * (1.0 - c.PEX4 * copysign(1.0, x)), 1.0)
        dF_x = D_x * sin(c.PCX1 * atan(_curve(x, E)))
        B_w = (c.RBX1 + c.RBX3 * g2) * _shrink(c.RBX2 * slip)
        E_w = minimum(c.REX1 + c.REX2 * df, 1.0)
        G_x = cos(c.RCX1 * atan(_curve(B_w * (a + c.RHX1), E_w)))
        if c.RHX1 != 0.0:
            G_x /= cos(c.RCX1 * atan(_curve(B_w * c.RHX1, E_w)))
        F_x = G_x * (dF_x + S_Vx)
        if not book:
            dF_x = F_x
        else:
            if any_of(shift != 0.0):
                E = minimum(E_0 * (1.0 - c.PEX4 * copysign(1.0, shift)), 1.0)
                dF_x -= D_x * sin(c.PCX1 * atan(_curve(B_x * shift, E)))
            dF_x *= G_x

    # F_y at pure slip
    K_y = _cornering(c, F_z, g) * zeta_3
    per_K = 1.0 / K_y
    S_Vg = F_z * (c.PVY3 + c.PVY4 * df) * g * fade_y * zeta_2
    S_V = F_z * (c.PVY1 + c.PVY2 * df) * fade_y * zeta_2 + S_Vg
    S_H = c.PHY1 + c.PHY2 * df
    K_yg = F_z * (c.PKY6 + c.PKY7 * df)
    if c.FITTYP == 52.0:
        S_H += c.PHY3 * g
    elif turn_slip is not None and spins and c.PHYP1 != 0.0:
        y = c.PHYP1 * (c.PHYP2 + c.PHYP3 * df)
        x = K_yg / (camber_share * y * _cornering(c, F_z, broadcast(0.0)) * zeta_3) * spin
        x = _curve(x, minimum(broadcast(c.PHYP4), 1.0))
        S_H += y / c.PHYP1 * sin(c.PHYP1 * atan(x)) - S_Vg * per_K
    else:
        S_H += (K_yg * g - S_Vg) * per_K
    D_y = (c.PDY1 + c.PDY2 * df) * (1.0 - c.PDY3 * g2) * mu * F_z * zeta_2
    B_y = K_y / (c.PCY1 * D_y)
    if book:
        hand = minimum(maximum(alpha * _PER_RAMP, -1.0), 1.0)
    else:
        hand = copysign(1.0, alpha + S_H)
    E = minimum((c.PEY1 + c.PEY2 * df) * (1.0 + c.PEY5 * g2 - (c.PEY3 + c.PEY4 * g) * hand), 1.0)
    F_y = D_y * sin(c.PCY1 * atan(_curve(B_y * (alpha + S_H), E))) + S_V
    F_t = F_y
    if c.FITTYP == 61.0:
        F_t = _upright(c, alpha, F_z, mu, fade_y)
        if not spins:
            F_t = where(g != 0.0, F_t, F_y)

    # Slip angles of trail and residual torque, to which kappa adds
    a_t = a_e = a + c.QHZ1 + c.QHZ2 * df + (c.QHZ3 + c.QHZ4 * df) * g
    a_r = a + S_H + S_V * per_K
    a_r2 = a_r * a_r
    if kappa is not None and slips:
        y = K_x * per_K * slip
        if book:
            a_t = a_e = copysign(sqrt(a_t * a_t + y * y), a_t)
            a_r2 += y * y
        else:
            slipping, y2 = slip != 0.0, y * y
            x = sin(a_t) / cos(a_t)
            a_t = where(slipping, copysign(atan(sqrt(x * x + y2)), a_t), a_t)
            x = sin(a_r) / cos(a_r)
            x = atan(sqrt(x * x + y2))
            a_r2 = where(slipping, x * x, a_r2)

    # Pneumatic trail
    B = (c.QBZ1 + c.QBZ2 * df + c.QBZ3 * df * df) * (1.0 + c.QBZ4 * g + c.QBZ5 * g_abs + c.QBZ6 * g2) * per_mu
    E = c.QEZ1 + c.QEZ2 * df + c.QEZ3 * df * df
    E = minimum(E * (1.0 + (c.QEZ4 + c.QEZ5 * g) * (2.0 / math.pi) * atan(B * c.QCZ1 * a_e)), 1.0)
    t = u * R_0 * (c.QDZ1 + c.QDZ2 * df) * (1.0 + c.QDZ3 * g_abs + c.QDZ3G * g + c.QDZ4 * g2) * cos_a * zeta_5
    t *= cos(c.QCZ1 * atan(_curve(B * a_t, E)))

    # What kappa does to F_y; at kappa = 0 each factor is exactly one and each term exactly zero
    G_y, S_Vk = broadcast(1.0), broadcast(0.0)
    if kappa is not None and slips:
        S_H = c.RHY1 + c.RHY2 * df
        E = minimum(c.REY1 + c.REY2 * df, 1.0)
        B_k = (c.RBY1 + c.RBY4 * g2) * _shrink(c.RBY2 * (a - c.RBY3))
        G_y = cos(c.RCY1 * atan(_curve(B_k * (slip + S_H), E))) / cos(c.RCY1 * atan(_curve(B_k * S_H, E)))
        F_y, F_t = G_y * F_y, G_y * F_t
        S_Vk = c.RVY1 + c.RVY2 * df + c.RVY3 * g
        S_Vk *= D_y * _shrink(c.RVY4 * a) * sin(c.RVY5 * atan(c.RVY6 * slip))

    # Aligning
    B = (c.QBZ9 * per_mu + c.QBZ10 * c.PCY1 * B_y) * zeta_6
    fall = 1.0 / sqrt(1.0 + B * B * a_r2)  # cos(atan(B alpha_r))
    D = (c.QDZ6 + c.QDZ7 * df) * zeta_2
    y = (c.QDZ8 + c.QDZ9 * df + (c.QDZ10 + c.QDZ11 * df) * g_abs) * g
    M_spin = broadcast(0.0)
    if turn_slip is not None and spins and c.QCRP1 != 0.0:
        M_turn = c.QCRP1 * fabs(D_y) / zeta_2 * R_0 * sqrt(u)
        C = c.QDRP1
        M_spin = M_turn / math.sin(0.5 * math.pi * C)
        x = F_z * R_0 * (c.QDZ8 + c.QDZ9 * df) / (c.LMUY * camber_share * C * M_spin) * spin
        M_spin *= sin(C * atan(_curve(x, minimum(broadcast(c.QDRP2), 1.0))))
        if any_of(M_spin != 0.0):
            x = minimum(M_turn * (2.0 / math.pi) * atan(c.QCRP2 * fabs(spin)) * G_y / fabs(M_spin), 1.0)
            # A share of the right angle: acos x by its half angle
            fall = cos((4.0 / math.pi) * atan(sqrt((1.0 - x) / (1.0 + x))) * atan(B * sqrt(a_r2)))
        y *= 0.0  # camber acts by its spin
    M_zr = (F_z * R_0 * (D + y) * mu * cos_a + M_spin) * fall
    if book:
        M_zr *= cos_a
    M_z = M_zr - t * F_t
    F_y = F_y + S_Vk  # not in place, as numpy's arrays may be shared
    y = F_y * per_load
    M_z += R_0 * (c.SSZ1 + c.SSZ2 * y + (c.SSZ3 + c.SSZ4 * df) * g) * dF_x

    # Overturning and rolling resistance
    M_x = c.QSX1 - c.QSX2 * g + c.QSX3 * y
    M_y = c.QSY1 + c.QSY2 * F_x * per_load
    if c.QSY3 != 0.0 or c.QSY4 != 0.0:
        v = fabs(v_x) / c.LONGVL
        M_y += c.QSY3 * v + c.QSY4 * (v * v) * (v * v)
    load = F_z
    if c.FITTYP == 61.0:
        if c.QSX4 != 0.0:
            x = c.QSX6 * u
            M_x += c.QSX4 * sin(c.QSX7 * g + c.QSX8 * atan(c.QSX9 * y)) * cos(c.QSX5 * atan(x * x))
        if c.QSX10 != 0.0:
            M_x += c.QSX10 * atan(c.QSX11 * u) * g
        M_x += (c.QSX13 + c.QSX14 * g_abs) * F_y / F_z - c.QSX12 * g * g_abs
        M_y += (c.QSY5 + c.QSY6 * u) * g2
        if c.QSY7 != 1.0:
            load = c.FNOMIN * power(u, c.QSY7)
    way = where(lifted, 0.0, way)
    return way * F_x, way * F_y, way * R_0 * F_z * M_x, -way * R_0 * load * M_y, way * way * M_z


@kernel
def forces(c, kappa, alpha, camber, F_z, v_x, mu=1.0, turn_slip=0.0):
    """F_x, F_y [N], M_x, M_y, M_z [N m]: one evaluation of :meth:`tyre.Tyre.forces`, which describes the arguments.

    Unchecked, for any ``v_x`` and ``F_z >= 0``; at standstill the caller must blend the result out.
    """
    tan_a = broadcast(math.tan(alpha))
    F_x, F_y, M_x, M_y, M_z = _steady(
        c,
        broadcast(kappa),
        broadcast(alpha),
        tan_a,
        broadcast(camber),
        broadcast(F_z),
        broadcast(v_x),
        broadcast(mu),
        turn_slip,
    )
    return first(F_x), first(F_y), first(M_x), first(M_y), first(M_z)


@kernel
def forces_of_four(c, kappa, tan_alpha, camber, F_z, v_x, mu):
    """:func:`forces` of four tyres without turn slip, for the tangents of the slip angles, v_y/|v_x|.

    These are what relaxed slip angles have for states. ``kappa`` None is 0 of all four, and compiles in half the time.
    """
    return _steady(c, kappa, atan(tan_alpha), tan_alpha, camber, F_z, v_x, mu, None)
