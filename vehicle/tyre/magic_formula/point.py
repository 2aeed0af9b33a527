"""The operating point of four tyres: slips, camber and load in the form that the curves take, and the turn slip."""

from typing import NamedTuple

from steer_env.friction.numerics.kernel import kernel
from steer_env.friction.numerics.simd import any_of, broadcast, fabs, maximum, sin, sqrt, where
from steer_env.vehicle.tyre.magic_formula.curve import cos_atan

A_MU = 10.0  # how slowly the vertical shifts decrease on a slippery road (lambda'_mu of the books); 5.2: 1 [1]


class Point(NamedTuple):
    """Operating point, as of a tyre that rolls forward; each field is a vector of four tyres."""

    kappa: float  # [1]
    alpha: float  # [rad]
    tan_a: float  # tan(alpha) [1]
    a: float  # tan(alpha) under FITTYP 60, else alpha
    cos_a: float  # cos(alpha) [1]
    g: float  # sin(camber) under FITTYP 60, else camber
    g2: float  # g^2
    F_z: float  # load [N]
    u: float  # load over the nominal load [1]
    df: float  # u - 1 [1]
    mu: float  # friction of the road over that of the measurements [1]
    stiffness: float  # factor on the cornering stiffness, lambda_Kya of the books [1]
    per_mu: float  # 1/mu
    fade_x: float  # factor on the vertical shifts of F_x on a slippery road [1]
    fade_y: float  # of F_y


class TurnSlip(NamedTuple):
    """Turn slip over R_0 and the factors that it contributes; each field is a vector of four tyres."""

    spin: float  # of the turn and of camber, positive where both turn the contact to the left seen from above [1]
    camber_share: float  # weight of the spin by camber [1]
    zeta_1: float  # factor on the peak of F_x [1]
    zeta_2: float  # on the peak of F_y
    zeta_3: float  # on the cornering stiffness
    zeta_5: float  # on the pneumatic trail
    zeta_6: float  # on the stiffness B of the residual torque


@kernel
def operating_point(c, way, kappa, alpha, tan_a, camber, F_z, mu, stiffness):
    """The operating point from the arguments of :func:`forces`; ``way`` is -1 for a tyre that rolls backwards (T12)."""
    book = c.FITTYP == 60.0  # else MF-Tyre, which takes angles where the book takes their sine or tangent
    F_z = maximum(F_z, 1e-6)
    tan_a, alpha = way * tan_a, way * alpha  # (4.E3)
    g = way * (sin(camber) if book else camber)  # (4.E4)
    u = F_z * (1.0 / c.FNOMIN)
    fade_x = fade_y = per_mu = broadcast(1.0)
    if any_of(mu != 1.0):
        per_mu = 1.0 / mu
        y = A_MU - 1.0 if c.FITTYP != 52.0 else 0.0
        fade_x = (1.0 + y * c.LMUX) * mu / (1.0 + y * c.LMUX * mu)  # (T12), (4.E8)
        fade_y = (1.0 + y * c.LMUY) * mu / (1.0 + y * c.LMUY * mu)  # (T12), (4.E8)
    return Point(
        kappa=broadcast(0.0) if kappa is None else way * kappa,
        alpha=alpha,
        tan_a=tan_a,
        a=tan_a if book else alpha,
        cos_a=cos_atan(tan_a),  # (4.E6)
        g=g,
        g2=g * g,
        F_z=F_z,
        u=u,
        df=u - 1.0,  # (4.E2)
        mu=mu,
        stiffness=stiffness,
        per_mu=per_mu,
        fade_x=fade_x,
        fade_y=fade_y,
    )


@kernel
def turn_slip_factors(c, p, turn_slip, spins):
    """Spin and its factors at a turn slip [1/m] of all four tyres; without spin the factors are 1 (T13)."""
    spin = broadcast(0.0)
    camber_share = zeta_1 = zeta_2 = zeta_3 = zeta_5 = zeta_6 = broadcast(1.0)
    if turn_slip is not None and spins:
        camber_share = 1.0 - c.PECP1 * (1.0 + c.PECP2 * p.df)
        sine = p.g if c.FITTYP == 60.0 else sin(p.g)
        spin = c.UNLOADED_RADIUS * turn_slip + camber_share * (1.0 + p.kappa) * p.cos_a * sine  # (T13)
        zeta_1 = cos_atan(c.PDXP1 * (1.0 + c.PDXP2 * p.df) * cos_atan(c.PDXP3 * p.kappa) * spin)  # (T13)
        y = fabs(spin)
        # (4.77), (4.78)
        y = c.PDYP1 * (1.0 + c.PDYP2 * p.df) * cos_atan(c.PDYP3 * p.tan_a) * (y + c.PDYP4 * sqrt(y))
        zeta_2 = cos_atan(y)  # (T13)
        zeta_3 = cos_atan(c.PKYP1 * spin * spin)  # (T13)
        zeta_5 = cos_atan(c.QDTP1 * spin)  # (T13)
        zeta_6 = cos_atan(c.QBRP1 * spin)  # (T13), (4.102)
    return TurnSlip(spin, camber_share, zeta_1, zeta_2, zeta_3, zeta_5, zeta_6)


@kernel
def direction(v_x):
    """1 for a tyre that rolls forward or stands, -1 for one that rolls backwards."""
    return where(v_x >= 0.0, broadcast(1.0), -1.0)
