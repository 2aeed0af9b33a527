"""Longitudinal force: pure slip, and its weight at combined slip."""

from typing import NamedTuple

from steer_env.friction.numerics.kernel import kernel
from steer_env.vehicle.simd import any_of, atan, broadcast, copysign, cos, minimum, sin
from steer_env.vehicle.tyre.magic_formula.curve import cos_atan, curve
from steer_env.vehicle.tyre.magic_formula.stiffness import slip_stiffness


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
