"""Magic Formula: steady-state forces and moments of a tyre at combined slip, as kernels on flat coefficients.

Every force is a sine or cosine of one curve with stiffness B, shape C, peak D and curvature E:

    F = D sin(C atan(B x - E (B x - atan(B x)))) + S_V,    x = slip + S_H

    F_x = G_xa F_x0(kappa)      F_y = G_yk F_y0(alpha) + S_Vyk      M_z = -t (F_y - S_Vyk) + M_zr + s dF_x

The weights G and the lever s couple the slips; t is the pneumatic trail, M_zr the residual torque.

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

from friction.kernel import kernel
from vehicle.lanes import atan4, waves

A_MU = 10.0  # how slowly vertical shifts fade on a slippery road (books: lambda'_mu); 5.2: 1 [-]
_PER_RAMP = 200.0  # one over |alpha| where the asymmetry of E_y is full under FITTYP 60 [1/rad]; assumed


@kernel
def _curve(x, E):
    """Argument of the outer arc tangent, for x = B (slip + S_H)."""
    return x - E * (x - math.atan(x)) if E != 0.0 else x


@kernel
def _shrink(y):
    """``cos(atan(y))``."""
    return 1.0 / math.sqrt(1.0 + y * y)


@kernel
def _cornering(c, F_z, g):
    """K_y, negative [N/rad]."""
    g2 = g * g
    most = c.FNOMIN * (c.PKY2 + c.PKY5 * g2)
    over, under = (1.0, 1.0 + c.PKY3 * g2) if c.FITTYP == 60.0 else (1.0 - c.PKY3 * abs(g), 1.0)
    if c.PKY4 == 2.0:  # sin(2 atan(u)) = 2 u/(1 + u^2)
        over, under = over * 2.0 * F_z * most, under * (most * most + F_z * F_z)
    else:
        over *= math.sin(c.PKY4 * math.atan(F_z / most))
    return c.PKY1 * c.FNOMIN * over / under


@kernel
def cornering_stiffness(c, F_z):
    """Size of the slope of F_y over alpha at camber 0 where alpha + S_H = 0 [N/rad]."""
    return abs(_cornering(c, F_z, 0.0))


@kernel
def _slip_stiffness(c, F_z, df):
    """K_x [N per unit slip]."""
    return F_z * (c.PKX1 + c.PKX2 * df) * math.exp(c.PKX3 * df)


@kernel
def longitudinal_stiffness(c, F_z):
    """Slope of F_x over kappa where kappa + S_H = 0 [N per unit slip]."""
    return _slip_stiffness(c, F_z, F_z / c.FNOMIN - 1.0)


@kernel
def _upright(c, alpha, F_z, mu, fade):
    """F_y0 without camber and turn slip: what the pneumatic trail of FITTYP 61 multiplies [N]."""
    df = F_z / c.FNOMIN - 1.0
    x = alpha + c.PHY1 + c.PHY2 * df
    D = (c.PDY1 + c.PDY2 * df) * mu * F_z
    E = min((c.PEY1 + c.PEY2 * df) * (1.0 - c.PEY3 * math.copysign(1.0, x)), 1.0)
    S_V = F_z * (c.PVY1 + c.PVY2 * df) * fade
    x *= _cornering(c, F_z, 0.0) / (D * c.PCY1)
    return D * math.sin(c.PCY1 * math.atan(_curve(x, E))) + S_V


@kernel
def _steady(c, kappa, alpha, tan_a, camber, F_z, v_x, mu, turn_slip):
    """:func:`forces`, for a slip angle known by itself and by its tangent."""
    if F_z < 1e-6:
        return 0.0, 0.0, 0.0, 0.0, 0.0
    book = c.FITTYP == 60.0  # else MF-Tyre, which takes angles where the book takes their sine or tangent
    way = 1.0 if v_x >= 0.0 else -1.0
    kappa, alpha, tan_a, g = way * kappa, way * alpha, way * tan_a, way * (math.sin(camber) if book else camber)
    a = tan_a if book else alpha
    g2, g_abs = g * g, abs(g)
    cos_a = _shrink(tan_a)
    per_load = 1.0 / c.FNOMIN
    R_0 = c.UNLOADED_RADIUS
    u = F_z * per_load
    df = u - 1.0
    fade_x = fade_y = per_mu = 1.0
    if mu != 1.0:
        per_mu = 1.0 / mu
        y = A_MU - 1.0 if c.FITTYP != 52.0 else 0.0
        fade_x = (1.0 + y * c.LMUX) * mu / (1.0 + y * c.LMUX * mu)
        fade_y = (1.0 + y * c.LMUY) * mu / (1.0 + y * c.LMUY * mu)

    # Spin over R_0, of the turn and of camber, positive where both turn the contact to the left as seen from above
    spins = turn_slip != 0.0 and c.TURN_SLIP != 0.0
    spin = 0.0
    camber_share = zeta_1 = zeta_2 = zeta_3 = zeta_5 = zeta_6 = 1.0
    if spins:
        camber_share = 1.0 - c.PECP1 * (1.0 + c.PECP2 * df)
        spin = R_0 * turn_slip + camber_share * (1.0 + kappa) * cos_a * (g if book else math.sin(g))
        zeta_1 = _shrink(c.PDXP1 * (1.0 + c.PDXP2 * df) * _shrink(c.PDXP3 * kappa) * spin)
        y = abs(spin)
        y = c.PDYP1 * (1.0 + c.PDYP2 * df) * _shrink(c.PDYP3 * tan_a) * (y + c.PDYP4 * math.sqrt(y))
        zeta_2 = _shrink(y)
        zeta_3 = _shrink(c.PKYP1 * spin * spin)
        zeta_5 = _shrink(c.QDTP1 * spin)
        zeta_6 = _shrink(c.QBRP1 * spin)

    # Arguments B x, peaks and curvatures; the waves of all of them come together below
    F_x = dF_x = K_x = S_Vk = S_Vx = x_x = E_x = D_x = x_w = 0.0
    shift = c.PHX1 + c.PHX2 * df
    S_Vx = F_z * (c.PVX1 + c.PVX2 * df) * fade_x * zeta_1
    drives = kappa != 0.0 or shift != 0.0 or S_Vx != 0.0
    E_w = min(c.REX1 + c.REX2 * df, 1.0)
    if drives:
        D_x = (c.PDX1 + c.PDX2 * df) * (1.0 - c.PDX3 * g2) * mu * F_z * zeta_1
        K_x = _slip_stiffness(c, F_z, df)
        B_x = K_x / (c.PCX1 * D_x)
        x_x = B_x * (kappa + shift)
        E_0 = c.PEX1 + c.PEX2 * df + c.PEX3 * df * df
        E_x = min(E_0 * (1.0 - c.PEX4 * math.copysign(1.0, x_x)), 1.0)
        B_w = (c.RBX1 + c.RBX3 * g2) * _shrink(c.RBX2 * kappa)
        x_w = B_w * (a + c.RHX1)

    K_y = _cornering(c, F_z, g) * zeta_3
    per_K = 1.0 / K_y
    S_Vg = F_z * (c.PVY3 + c.PVY4 * df) * g * fade_y * zeta_2
    S_V = F_z * (c.PVY1 + c.PVY2 * df) * fade_y * zeta_2 + S_Vg
    S_H = c.PHY1 + c.PHY2 * df
    K_yg = F_z * (c.PKY6 + c.PKY7 * df)
    if c.FITTYP == 52.0:
        S_H += c.PHY3 * g
    elif spins and c.PHYP1 != 0.0:
        y = c.PHYP1 * (c.PHYP2 + c.PHYP3 * df)
        x = K_yg / (camber_share * y * _cornering(c, F_z, 0.0) * zeta_3) * spin
        S_H += y / c.PHYP1 * math.sin(c.PHYP1 * math.atan(_curve(x, min(c.PHYP4, 1.0)))) - S_Vg * per_K
    else:
        S_H += (K_yg * g - S_Vg) * per_K
    D_y = (c.PDY1 + c.PDY2 * df) * (1.0 - c.PDY3 * g2) * mu * F_z * zeta_2
    B_y = K_y / (c.PCY1 * D_y)
    x_y = B_y * (alpha + S_H)
    hand = min(max(alpha * _PER_RAMP, -1.0), 1.0) if book else math.copysign(1.0, alpha + S_H)
    E_y = min((c.PEY1 + c.PEY2 * df) * (1.0 + c.PEY5 * g2 - (c.PEY3 + c.PEY4 * g) * hand), 1.0)

    # Slip angles of trail and residual torque, to which kappa adds
    a_t = a_e = a + c.QHZ1 + c.QHZ2 * df + (c.QHZ3 + c.QHZ4 * df) * g
    a_r = a + S_H + S_V * per_K
    a_r2 = a_r * a_r
    if kappa != 0.0:
        y = K_x * per_K * kappa
        if book:
            a_t = a_e = math.copysign(math.sqrt(a_t * a_t + y * y), a_t)
            a_r2 += y * y
        else:
            a_t = math.copysign(math.atan(math.hypot(math.tan(a_t), y)), a_t)
            a_r2 = math.atan(math.hypot(math.tan(a_r), y)) ** 2
    B = (c.QBZ1 + c.QBZ2 * df + c.QBZ3 * df * df) * (1.0 + c.QBZ4 * g + c.QBZ5 * g_abs + c.QBZ6 * g2) * per_mu
    x_t = B * a_t

    # Pure slip: the four curves, bent by E, then their waves
    bend_x, bend_y, bend_t, lean = atan4(x_x, x_y, x_t, B * c.QCZ1 * a_e)
    E_t = c.QEZ1 + c.QEZ2 * df + c.QEZ3 * df * df
    E_t = min(E_t * (1.0 + (c.QEZ4 + c.QEZ5 * g) * (2.0 / math.pi) * lean), 1.0)
    x_x -= E_x * (x_x - bend_x)
    x_y -= E_y * (x_y - bend_y)
    x_t -= E_t * (x_t - bend_t)
    x_x, x_y, x_t, x_w = atan4(x_x, x_y, x_t, _curve(x_w, E_w))
    x_x, x_y, x_t, G_x = waves(c.PCX1 * x_x, c.PCY1 * x_y, c.QCZ1 * x_t, c.RCX1 * x_w)
    if drives:
        F_x = D_x * x_x + S_Vx
        if c.RHX1 != 0.0:
            G_x /= math.cos(c.RCX1 * math.atan(_curve(B_w * c.RHX1, E_w)))
        if not book:
            dF_x = F_x
        elif kappa != 0.0:
            dF_x = D_x * x_x
            if shift != 0.0:
                E_x = min(E_0 * (1.0 - c.PEX4 * math.copysign(1.0, shift)), 1.0)
                dF_x -= D_x * math.sin(c.PCX1 * math.atan(_curve(B_x * shift, E_x)))
        F_x, dF_x = G_x * F_x, G_x * dF_x
    F_y = D_y * x_y + S_V
    F_t = _upright(c, alpha, F_z, mu, fade_y) if c.FITTYP == 61.0 and (g != 0.0 or spins) else F_y

    # What kappa does to F_y; at kappa = 0 each factor is exactly one and each term exactly zero
    G_y = 1.0
    if kappa != 0.0:
        S_H = c.RHY1 + c.RHY2 * df
        E = min(c.REY1 + c.REY2 * df, 1.0)
        B_k = (c.RBY1 + c.RBY4 * g2) * _shrink(c.RBY2 * (a - c.RBY3))
        x, y, z, _ = atan4(_curve(B_k * (kappa + S_H), E), _curve(B_k * S_H, E), c.RVY6 * kappa, 0.0)
        z, _, x, y = waves(c.RVY5 * z, 0.0, c.RCY1 * x, c.RCY1 * y)
        G_y = x / y
        F_y *= G_y
        F_t *= G_y
        S_Vk = c.RVY1 + c.RVY2 * df + c.RVY3 * g
        if S_Vk != 0.0:
            S_Vk *= D_y * _shrink(c.RVY4 * a) * z

    # Aligning
    t = u * R_0 * (c.QDZ1 + c.QDZ2 * df) * (1.0 + c.QDZ3 * g_abs + c.QDZ3G * g + c.QDZ4 * g2) * cos_a * zeta_5 * x_t
    B = (c.QBZ9 * per_mu + c.QBZ10 * c.PCY1 * B_y) * zeta_6
    fall = 1.0 / math.sqrt(1.0 + B * B * a_r2)  # cos(atan(B alpha_r))
    D = (c.QDZ6 + c.QDZ7 * df) * zeta_2
    y = (c.QDZ8 + c.QDZ9 * df + (c.QDZ10 + c.QDZ11 * df) * g_abs) * g
    M_spin = 0.0
    if spins and c.QCRP1 != 0.0:
        M_turn = c.QCRP1 * abs(D_y) / zeta_2 * R_0 * math.sqrt(u)
        C = c.QDRP1
        M_spin = M_turn / math.sin(0.5 * math.pi * C)
        x = F_z * R_0 * (c.QDZ8 + c.QDZ9 * df) / (c.LMUY * camber_share * C * M_spin) * spin
        M_spin *= math.sin(C * math.atan(_curve(x, min(c.QDRP2, 1.0))))
        if M_spin != 0.0:
            M_90 = M_turn * (2.0 / math.pi) * math.atan(c.QCRP2 * abs(spin)) * G_y
            C = (2.0 / math.pi) * math.acos(min(M_90 / abs(M_spin), 1.0))
            fall = math.cos(C * math.atan(B * math.sqrt(a_r2)))
        y = 0.0  # camber acts by its spin
    M_zr = (F_z * R_0 * (D + y) * mu * cos_a + M_spin) * fall
    if book:
        M_zr *= cos_a
    M_z = M_zr - t * F_t
    F_y += S_Vk
    y = F_y * per_load
    M_z += R_0 * (c.SSZ1 + c.SSZ2 * y + (c.SSZ3 + c.SSZ4 * df) * g) * dF_x

    # Overturning and rolling resistance
    M_x = c.QSX1 - c.QSX2 * g + c.QSX3 * y
    M_y = c.QSY1 + c.QSY2 * F_x * per_load
    if c.QSY3 != 0.0 or c.QSY4 != 0.0:
        v = abs(v_x) / c.LONGVL
        M_y += c.QSY3 * v + c.QSY4 * (v * v) * (v * v)
    load = F_z
    if c.FITTYP == 61.0:
        if c.QSX4 != 0.0:
            x = c.QSX6 * u
            x = math.sin(c.QSX7 * g + c.QSX8 * math.atan(c.QSX9 * y)) * math.cos(c.QSX5 * math.atan(x * x))
            M_x += c.QSX4 * x
        if c.QSX10 != 0.0:
            M_x += c.QSX10 * math.atan(c.QSX11 * u) * g
        M_x += (c.QSX13 + c.QSX14 * g_abs) * F_y / F_z - c.QSX12 * g * g_abs
        M_y += (c.QSY5 + c.QSY6 * u) * g2
        if c.QSY7 != 1.0:
            load = c.FNOMIN * u**c.QSY7
    return way * F_x, way * F_y, way * R_0 * F_z * M_x, -way * R_0 * load * M_y, M_z


@kernel
def forces(c, kappa, alpha, camber, F_z, v_x, mu=1.0, turn_slip=0.0):
    """F_x, F_y [N], M_x, M_y, M_z [N m]: one evaluation of :meth:`tyre.Tyre.forces`, which describes the arguments.

    Unchecked, for any ``v_x`` and ``F_z >= 0``; at standstill the caller must blend the result out.
    """
    return _steady(c, kappa, alpha, math.tan(alpha), camber, F_z, v_x, mu, turn_slip)


@kernel
def forces_slip(c, kappa, tan_alpha, camber, F_z, v_x, mu=1.0, turn_slip=0.0):
    """:func:`forces` for the tangent of the slip angle, v_y/|v_x|: what a relaxed slip angle has for a state."""
    return _steady(c, kappa, math.atan(tan_alpha), tan_alpha, camber, F_z, v_x, mu, turn_slip)
