"""Magic Formula tyre: steady-state forces and moments at combined slip.

Every force is a sine or cosine of one curve with stiffness B, shape C, peak D and curvature E:

    F = D sin(C atan(B x - E (B x - atan(B x)))) + S_V,    x = slip + S_H

    F_x = G_xa F_x0(kappa)      F_y = G_yk F_y0(alpha) + S_Vyk      M_z = -t (F_y - S_Vyk) + M_zr + s dF_x

The weights G and the lever s couple the slips; t is the pneumatic trail, M_zr the residual torque.

Axes: ISO 8855, x forward, y left, z up; alpha > 0 gives F_y < 0 and M_z > 0. A tyre that rolls backwards is the same
tyre seen from behind: kappa, alpha, camber, F_x, F_y, M_x and M_y change sign, M_z does not.

Source: Pacejka, Tyre and Vehicle Dynamics, 2nd ed. 2006, section 4.3.2, without turn slip; M_y as in MF-Tyre 5.2.
Deviations, the first three of which reproduce an independent library to ten digits at kappa = camber = 0:

* F_y0 takes alpha itself; weights, trail and residual torque take tan(alpha). M_zr carries cos(alpha) twice.
* The asymmetry of E_y follows the sign of alpha, not of alpha + S_H; a short ramp keeps F_y continuous straight ahead.
* s acts on dF_x, the part of F_x that kappa adds: M_z at pure slip was fitted with the drag at kappa = 0 in it.
* A load under 1e-6 N gives zeros; the book's small epsilons in denominators are then not needed.
"""

import json
import math
from dataclasses import dataclass, field, replace
from importlib.resources import files
from typing import NamedTuple

import numpy as np

from friction.check import number, positive
from friction.kernel import kernel


class MagicFormula(NamedTuple):
    """Coefficients under their .tir keys. A key that a file lacks is 0, which drops its term (PKY4: 2, as in MF 5.2).

    ``df = F_z/FNOMIN - 1`` and ``g = sin(camber)`` are the load and camber that the terms multiply.
    """

    FNOMIN: float  # nominal load [N]
    UNLOADED_RADIUS: float  # free radius R_0 [m]
    LONGVL: float  # speed of the measurements [m/s]
    WIDTH: float = 0.0  # section width [m]
    NOMPRES: float = 0.0  # inflation pressure [Pa]
    PCX1: float = 0.0  # F_x: shape C [-]
    PDX1: float = 0.0  # F_x: peak friction [-]
    PDX2: float = 0.0  # F_x: peak friction, by df [-]
    PDX3: float = 0.0  # F_x: peak friction, relative loss by g^2 [-]
    PEX1: float = 0.0  # F_x: curvature E [-]
    PEX2: float = 0.0  # F_x: curvature, by df [-]
    PEX3: float = 0.0  # F_x: curvature, by df^2 [-]
    PEX4: float = 0.0  # F_x: curvature, relative, driving less than braking [-]
    PKX1: float = 0.0  # F_x: slip stiffness over F_z [-]
    PKX2: float = 0.0  # F_x: slip stiffness over F_z, by df [-]
    PKX3: float = 0.0  # F_x: slip stiffness, exponent of df [-]
    PHX1: float = 0.0  # F_x: shift of kappa [-]
    PHX2: float = 0.0  # F_x: shift of kappa, by df [-]
    PVX1: float = 0.0  # F_x: shift of force over F_z [-]
    PVX2: float = 0.0  # F_x: shift of force over F_z, by df [-]
    RBX1: float = 0.0  # G_xa: stiffness B [1/rad]
    RBX2: float = 0.0  # G_xa: fall of B with kappa [-]
    RBX3: float = 0.0  # G_xa: stiffness B, by g^2 [1/rad]
    RCX1: float = 0.0  # G_xa: shape C [-]
    REX1: float = 0.0  # G_xa: curvature E [-]
    REX2: float = 0.0  # G_xa: curvature, by df [-]
    RHX1: float = 0.0  # G_xa: shift of alpha [rad]
    PCY1: float = 0.0  # F_y: shape C [-]
    PDY1: float = 0.0  # F_y: peak friction, with the sign that the file gives it [-]
    PDY2: float = 0.0  # F_y: peak friction, by df [-]
    PDY3: float = 0.0  # F_y: peak friction, relative loss by g^2 [-]
    PEY1: float = 0.0  # F_y: curvature E [-]
    PEY2: float = 0.0  # F_y: curvature, by df [-]
    PEY3: float = 0.0  # F_y: curvature, relative, alpha > 0 less than alpha < 0 [-]
    PEY4: float = 0.0  # F_y: curvature, relative, the same by g [-]
    PEY5: float = 0.0  # F_y: curvature, relative, by g^2 [-]
    PKY1: float = 0.0  # F_y: largest cornering stiffness over FNOMIN [1/rad]
    PKY2: float = 0.0  # F_y: load of the largest cornering stiffness over FNOMIN [-]
    PKY3: float = 0.0  # F_y: cornering stiffness, relative loss by g^2 [-]
    PKY4: float = 2.0  # F_y: cornering stiffness, shape over load [-]
    PKY5: float = 0.0  # F_y: load of the largest cornering stiffness, by g^2 [-]
    PKY6: float = 0.0  # F_y: camber stiffness over F_z [1/rad]
    PKY7: float = 0.0  # F_y: camber stiffness over F_z, by df [1/rad]
    PHY1: float = 0.0  # F_y: shift of alpha [rad]
    PHY2: float = 0.0  # F_y: shift of alpha, by df [rad]
    PVY1: float = 0.0  # F_y: shift of force over F_z [-]
    PVY2: float = 0.0  # F_y: shift of force over F_z, by df [-]
    PVY3: float = 0.0  # F_y: shift of force over F_z, by g [-]
    PVY4: float = 0.0  # F_y: shift of force over F_z, by g df [-]
    RBY1: float = 0.0  # G_yk: stiffness B [-]
    RBY2: float = 0.0  # G_yk: fall of B with alpha [1/rad]
    RBY3: float = 0.0  # G_yk: alpha at the top of that fall [rad]
    RBY4: float = 0.0  # G_yk: stiffness B, by g^2 [-]
    RCY1: float = 0.0  # G_yk: shape C [-]
    REY1: float = 0.0  # G_yk: curvature E [-]
    REY2: float = 0.0  # G_yk: curvature, by df [-]
    RHY1: float = 0.0  # G_yk: shift of kappa [-]
    RHY2: float = 0.0  # G_yk: shift of kappa, by df [-]
    RVY1: float = 0.0  # S_Vyk: peak over the peak of F_y [-]
    RVY2: float = 0.0  # S_Vyk: peak, by df [-]
    RVY3: float = 0.0  # S_Vyk: peak, by g [-]
    RVY4: float = 0.0  # S_Vyk: fall with alpha [1/rad]
    RVY5: float = 0.0  # S_Vyk: shape over kappa [-]
    RVY6: float = 0.0  # S_Vyk: stiffness over kappa [-]
    QBZ1: float = 0.0  # t: stiffness B [1/rad]
    QBZ2: float = 0.0  # t: stiffness, by df [1/rad]
    QBZ3: float = 0.0  # t: stiffness, by df^2 [1/rad]
    QBZ5: float = 0.0  # t: stiffness, relative, by |g| [-]
    QBZ6: float = 0.0  # t: stiffness, relative, by g^2 [-]
    QCZ1: float = 0.0  # t: shape C [-]
    QDZ1: float = 0.0  # t: peak over R_0 F_z/FNOMIN [-]
    QDZ2: float = 0.0  # t: peak, by df [-]
    QDZ3: float = 0.0  # t: peak, relative, by |g| [-]
    QDZ4: float = 0.0  # t: peak, relative, by g^2 [-]
    QEZ1: float = 0.0  # t: curvature E [-]
    QEZ2: float = 0.0  # t: curvature, by df [-]
    QEZ3: float = 0.0  # t: curvature, by df^2 [-]
    QEZ4: float = 0.0  # t: curvature, relative, alpha > 0 more than alpha < 0 [-]
    QEZ5: float = 0.0  # t: curvature, relative, the same by g [-]
    QHZ1: float = 0.0  # t: shift of alpha [rad]
    QHZ2: float = 0.0  # t: shift of alpha, by df [rad]
    QHZ3: float = 0.0  # t: shift of alpha, by g [rad]
    QHZ4: float = 0.0  # t: shift of alpha, by g df [rad]
    QBZ9: float = 0.0  # M_zr: fall with alpha [1/rad]
    QBZ10: float = 0.0  # M_zr: fall with alpha, by B C of F_y [-]
    QDZ6: float = 0.0  # M_zr: peak over R_0 F_z [-]
    QDZ7: float = 0.0  # M_zr: peak, by df [-]
    QDZ8: float = 0.0  # M_zr: peak, by g [-]
    QDZ9: float = 0.0  # M_zr: peak, by g df [-]
    QDZ10: float = 0.0  # M_zr: peak, by g |g| [-]
    QDZ11: float = 0.0  # M_zr: peak, by g |g| df [-]
    SSZ1: float = 0.0  # s: lever over R_0 [-]
    SSZ2: float = 0.0  # s: lever, by F_y/FNOMIN [-]
    SSZ3: float = 0.0  # s: lever, by g [-]
    SSZ4: float = 0.0  # s: lever, by g df [-]
    QSX1: float = 0.0  # M_x over R_0 F_z: constant [-]
    QSX2: float = 0.0  # M_x over R_0 F_z: loss by g [-]
    QSX3: float = 0.0  # M_x over R_0 F_z: by F_y/FNOMIN [-]
    QSY1: float = 0.0  # M_y over R_0 F_z: rolling resistance [-]
    QSY2: float = 0.0  # M_y over R_0 F_z: by F_x/FNOMIN [-]
    QSY3: float = 0.0  # M_y over R_0 F_z: by |v_x|/LONGVL [-]
    QSY4: float = 0.0  # M_y over R_0 F_z: by (v_x/LONGVL)^4 [-]


# Ply steer, conicity and every other term that tells left from right: reversing them all mirrors the tyre.
ASYMMETRY = (
    *("PHY1", "PHY2", "PVY1", "PVY2", "PEY3", "RHX1", "RBY3", "RVY1", "RVY2"),
    *("QHZ1", "QHZ2", "QEZ4", "QDZ6", "QDZ7", "SSZ1", "QSX1"),
)


def record(c: MagicFormula) -> np.recarray:
    """The coefficients as a record array (1,), whose element ``[0]`` serves the kernels in place of ``c``.

    A kernel takes the record by its address; the tuple would be unpacked, a hundred floats at every call from Python.
    """
    return np.rec.array([tuple(c)], dtype=[(key, np.float64) for key in c._fields])


_RAMP = 5e-3  # |alpha| where the asymmetry of E_y is full [rad]; assumed
_A_MU = 10.0  # how slowly vertical shifts fade on a slippery road (book: lambda'_mu) [-]


@kernel
def _curve(x, E):
    """Argument of the outer arc tangent, for x = B (slip + S_H)."""
    return x - E * (x - math.atan(x)) if E != 0.0 else x


@kernel
def _weight(B, C, E, slip, S_H):
    """G of combined slip: one where ``slip`` is zero."""
    G = math.cos(C * math.atan(_curve(B * (slip + S_H), E)))
    return G / math.cos(C * math.atan(_curve(B * S_H, E))) if S_H != 0.0 else G


@kernel
def _cornering(c, F_z, g2):
    """K_y, negative [N/rad]."""
    u = F_z / (c.FNOMIN * (c.PKY2 + c.PKY5 * g2))
    bend = 2.0 * u / (1.0 + u * u) if c.PKY4 == 2.0 else math.sin(c.PKY4 * math.atan(u))
    return c.PKY1 * c.FNOMIN * bend / (1.0 + c.PKY3 * g2)


@kernel
def cornering_stiffness(c, F_z):
    """Size of the slope of F_y over alpha at camber 0 where alpha + S_H = 0 [N/rad]."""
    return abs(_cornering(c, F_z, 0.0))


@kernel
def longitudinal_stiffness(c, F_z):
    """Slope of F_x over kappa where kappa + S_H = 0 [N per unit slip]."""
    df = F_z / c.FNOMIN - 1.0
    return F_z * (c.PKX1 + c.PKX2 * df) * math.exp(c.PKX3 * df)


@kernel
def forces(c, kappa, alpha, camber, F_z, v_x, mu=1.0):
    """F_x, F_y [N], M_x, M_y, M_z [N m]: one evaluation of :meth:`Tyre.forces`, which describes the arguments.

    Unchecked, for any ``v_x`` and ``F_z >= 0``; at standstill the caller must blend the result out.
    """
    if F_z < 1e-6:
        return 0.0, 0.0, 0.0, 0.0, 0.0
    way = 1.0 if v_x >= 0.0 else -1.0
    kappa, alpha, g = way * kappa, way * alpha, way * math.sin(camber)
    g2, g_abs = g * g, abs(g)
    tan_a = math.tan(alpha)
    cos_a = 1.0 / math.sqrt(1.0 + tan_a * tan_a)
    per_load = 1.0 / c.FNOMIN
    df = F_z * per_load - 1.0
    fade = _A_MU * mu / (1.0 + (_A_MU - 1.0) * mu) if mu != 1.0 else 1.0

    # Longitudinal; without shifts nothing is left to compute at kappa = 0
    F_x = dF_x = K_x = S_Vk = 0.0
    S_H = c.PHX1 + c.PHX2 * df
    S_V = F_z * (c.PVX1 + c.PVX2 * df) * fade
    if kappa != 0.0 or S_H != 0.0 or S_V != 0.0:
        D = (c.PDX1 + c.PDX2 * df) * (1.0 - c.PDX3 * g2) * mu * F_z
        K_x = longitudinal_stiffness(c, F_z)
        B = K_x / (c.PCX1 * D)
        E_0 = c.PEX1 + c.PEX2 * df + c.PEX3 * df * df
        E = min(E_0 * (1.0 - c.PEX4 * math.copysign(1.0, kappa + S_H)), 1.0)
        F_x = D * math.sin(c.PCX1 * math.atan(_curve(B * (kappa + S_H), E))) + S_V
        B_a = c.RBX1 + c.RBX3 * g2
        if kappa != 0.0:
            dF_x = F_x - S_V
            if S_H != 0.0:
                E = min(E_0 * (1.0 - c.PEX4 * math.copysign(1.0, S_H)), 1.0)
                dF_x -= D * math.sin(c.PCX1 * math.atan(_curve(B * S_H, E)))
            y = c.RBX2 * kappa
            B_a /= math.sqrt(1.0 + y * y)  # cos(atan(y)) = 1/sqrt(1 + y^2), here and below
        G = _weight(B_a, c.RCX1, min(c.REX1 + c.REX2 * df, 1.0), tan_a, c.RHX1)
        F_x, dF_x = G * F_x, G * dF_x

    # Lateral at kappa = 0
    K_y = _cornering(c, F_z, g2)
    per_K = 1.0 / K_y
    S_Vg = F_z * (c.PVY3 + c.PVY4 * df) * g * fade
    S_V = F_z * (c.PVY1 + c.PVY2 * df) * fade + S_Vg
    S_H = c.PHY1 + c.PHY2 * df + (F_z * (c.PKY6 + c.PKY7 * df) * g - S_Vg) * per_K
    D = (c.PDY1 + c.PDY2 * df) * (1.0 - c.PDY3 * g2) * mu * F_z
    BC = K_y / D
    hand = min(max(alpha / _RAMP, -1.0), 1.0)
    E = min((c.PEY1 + c.PEY2 * df) * (1.0 + c.PEY5 * g2 - (c.PEY3 + c.PEY4 * g) * hand), 1.0)
    F_y = D * math.sin(c.PCY1 * math.atan(_curve(BC / c.PCY1 * (alpha + S_H), E))) + S_V

    # Slip angles of trail and residual torque
    a_t = tan_a + c.QHZ1 + c.QHZ2 * df + (c.QHZ3 + c.QHZ4 * df) * g
    a_r2 = (tan_a + S_H + S_V * per_K) ** 2

    # What kappa does to them; at kappa = 0 each factor is exactly one and each term exactly zero
    if kappa != 0.0:
        y = c.RBY2 * (tan_a - c.RBY3)
        B = (c.RBY1 + c.RBY4 * g2) / math.sqrt(1.0 + y * y)
        F_y *= _weight(B, c.RCY1, min(c.REY1 + c.REY2 * df, 1.0), kappa, c.RHY1 + c.RHY2 * df)
        y = c.RVY4 * tan_a
        D *= (c.RVY1 + c.RVY2 * df + c.RVY3 * g) / math.sqrt(1.0 + y * y)
        S_Vk = D * math.sin(c.RVY5 * math.atan(c.RVY6 * kappa))
        y = K_x * per_K * kappa
        a_t = math.copysign(math.sqrt(a_t * a_t + y * y), a_t)
        a_r2 += y * y

    # Aligning
    B = (c.QBZ1 + c.QBZ2 * df + c.QBZ3 * df * df) * (1.0 + c.QBZ5 * g_abs + c.QBZ6 * g2) / mu
    E = c.QEZ1 + c.QEZ2 * df + c.QEZ3 * df * df
    y = c.QEZ4 + c.QEZ5 * g
    if y != 0.0:
        E *= 1.0 + y * (2.0 / math.pi) * math.atan(B * c.QCZ1 * a_t)
    R_0 = c.UNLOADED_RADIUS
    t = F_z * per_load * R_0 * (c.QDZ1 + c.QDZ2 * df) * (1.0 + c.QDZ3 * g_abs + c.QDZ4 * g2) * cos_a
    t *= math.cos(c.QCZ1 * math.atan(_curve(B * a_t, min(E, 1.0))))
    B = c.QBZ9 / mu + c.QBZ10 * BC
    D = c.QDZ6 + c.QDZ7 * df + (c.QDZ8 + c.QDZ9 * df + (c.QDZ10 + c.QDZ11 * df) * g_abs) * g
    M_z = F_z * R_0 * D * mu * cos_a * cos_a / math.sqrt(1.0 + B * B * a_r2) - t * F_y
    F_y += S_Vk
    y = F_y * per_load
    M_z += R_0 * (c.SSZ1 + c.SSZ2 * y + (c.SSZ3 + c.SSZ4 * df) * g) * dF_x
    M_x = R_0 * F_z * (c.QSX1 - c.QSX2 * g + c.QSX3 * y)
    v = abs(v_x) / c.LONGVL
    M_y = -R_0 * F_z * (c.QSY1 + c.QSY2 * F_x * per_load + c.QSY3 * v + c.QSY4 * (v * v) * (v * v))
    return way * F_x, way * F_y, way * M_x, way * M_y, M_z


@kernel
def _forces_of_arrays(c, kappa, alpha, camber, F_z, v_x, mu, out):
    for i in range(out.shape[1]):
        out[:, i] = forces(c, kappa[i], alpha[i], camber[i], F_z[i], v_x[i], mu[i])


class Limits(NamedTuple):
    """Inputs that :meth:`Tyre.forces` takes, by magnitude; assumed, the data set names none."""

    kappa: float = 1.5  # longitudinal slip [-]
    alpha: float = 1.5  # slip angle [rad]
    camber: float = 0.2618  # 15 degrees: beyond, the fitted growth of friction by camber is absurd [rad]
    load: float = 3.0  # F_z over FNOMIN: beyond, the quadratics in df turn over [-]
    v_x_low: float = 1.0  # slip has no meaning at standstill [m/s]
    v_x_high: float = 100.0  # [m/s]


@dataclass(frozen=True)
class Tyre:
    """Coefficients, their source, and what a transient model needs beside them.

    Raises
    ------
    ValueError
        A number that is not finite or has the wrong sign, or a set whose F_y does not oppose alpha in ISO 8855.
    """

    name: str
    source: str
    coefficients: MagicFormula
    limits: Limits = field(default_factory=Limits)
    relaxation_length: float = 0.55  # lateral, assumed [m]
    longitudinal_relaxation_length: float = 0.3  # assumed [m]
    vertical_stiffness: float = 200e3  # assumed [N/m]

    def __post_init__(self) -> None:
        c = self.coefficients
        for key, value in c._asdict().items():
            number(key, value)
        for key in ("FNOMIN", "UNLOADED_RADIUS", "LONGVL", "PCX1", "PDX1", "PKX1", "PCY1", "PKY2"):
            positive(key, getattr(c, key))
        for key in ("relaxation_length", "longitudinal_relaxation_length", "vertical_stiffness"):
            positive(key, getattr(self, key))
        positive("|PDY1|", abs(c.PDY1))
        if c.PKY1 * math.sin(c.PKY4 * math.atan(1.0 / c.PKY2)) >= 0.0:
            raise ValueError(f"PKY1 must be negative (ISO 8855: alpha > 0 gives F_y < 0), got {c.PKY1!r}")

    def _scale_asymmetry(self, factor: float) -> "Tyre":
        c = self.coefficients
        scaled = {key: factor * getattr(c, key) + 0.0 for key in ASYMMETRY}  # + 0.0: no negative zeros
        return replace(self, coefficients=c._replace(**scaled))

    def symmetric(self) -> "Tyre":
        """This tyre without :data:`ASYMMETRY`: F_y, M_x, M_z exactly odd and F_x, M_y exactly even in (alpha, camber).

        PHX and PVX stay, and with them a drag at kappa = 0: they shift kappa, and do not tell left from right.
        """
        return self._scale_asymmetry(0.0)

    def mirrored(self) -> "Tyre":
        """The same tyre on the other side: its F_y(alpha, camber) is exactly -F_y(-alpha, -camber) of this one."""
        return self._scale_asymmetry(-1.0)

    def forces(self, kappa, alpha, camber, F_z, v_x, mu=1.0) -> tuple[np.ndarray, ...]:
        """Steady-state forces and moments of the road on the tyre, ISO 8855.

        Parameters
        ----------
        kappa, alpha : float or array
            Slip ``(omega R_e - v_x)/|v_x|``, -1 for a locked wheel [-], and slip angle ``atan(v_y/|v_x|)`` [rad].
        camber : float or array
            Inclination about x, positive where the top leans to the right [rad].
        F_z, v_x : float or array
            Load [N] and speed along x: its sign, and its size in the rolling resistance [m/s].
        mu : float or array
            Friction of the road over that of the measurements; scales the peaks of F_x, F_y and M_zr [-].

        Returns
        -------
        F_x, F_y, M_x, M_y, M_z : array of the shape that the inputs broadcast to
            Forces [N] and moments about the contact centre [N m].

        Raises
        ------
        ValueError
            An input that is not finite or outside :attr:`limits`, or shapes that do not broadcast.
        """
        top = self.limits
        arrays = [np.asarray(value, dtype=float) for value in (kappa, alpha, camber, F_z, v_x, mu)]
        for name, value, low, high, unit in (
            ("kappa", arrays[0], -top.kappa, top.kappa, ""),
            ("alpha", arrays[1], -top.alpha, top.alpha, " rad"),
            ("camber", arrays[2], -top.camber, top.camber, " rad"),
            ("F_z", arrays[3], 0.0, top.load * self.coefficients.FNOMIN, " N"),
            ("|v_x|", np.abs(arrays[4]), top.v_x_low, top.v_x_high, " m/s"),
            ("mu", arrays[5], 0.01, 2.0, ""),
        ):
            wrong = value[~((value >= low) & (value <= high))]  # NaN is wrong too
            if wrong.size:
                raise ValueError(f"{name} must be within {low:g} to {high:g}{unit}, got {float(wrong[0])!r}")
        shape = np.broadcast_shapes(*(array.shape for array in arrays))
        out = np.empty((5, math.prod(shape)))
        _forces_of_arrays(self.coefficients, *(np.broadcast_to(array, shape).ravel() for array in arrays), out)
        return tuple(out.reshape(5, *shape))


_PACKAGED = {"pacejka_2006_205_60r15": "tyre_205_60R15_pacejka2006.json"}


def load(name: str = "pacejka_2006_205_60r15", symmetric: bool = False) -> Tyre:
    """A packaged tyre; ``symmetric`` as in :meth:`Tyre.symmetric`.

    Raises
    ------
    ValueError
        Unknown name.
    """
    if name not in _PACKAGED:
        raise ValueError(f"tyre must be one of {', '.join(_PACKAGED)}, got {name!r}")
    data = json.loads(files(__package__).joinpath("data", _PACKAGED[name]).read_text(encoding="utf-8"))
    coefficients = MagicFormula(**{key: float(value) for key, value in data["coefficients"].items()})
    tyre = Tyre(name, data["source"], coefficients)
    return tyre.symmetric() if symmetric else tyre
