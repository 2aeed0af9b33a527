"""Lateral force: pure slip, and its weight and shift at combined slip."""

from typing import NamedTuple

from steer_env.friction.numerics.kernel import kernel
from steer_env.vehicle.simd import atan, broadcast, copysign, cos, maximum, minimum, sin, where
from steer_env.vehicle.tyre.magic_formula.curve import cos_atan, curve
from steer_env.vehicle.tyre.magic_formula.stiffness import cornering

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
