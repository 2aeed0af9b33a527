"""Property files: reading, writing, errors; and the forces of each version against its published equations.

``mf_tyre`` and ``book`` below are a second transcription, in plain numpy with every scaling factor, pressure term and
turn-slip factor where the publication has it; the kernels have them folded into coefficients.
"""

import dataclasses
import json
import math
import os
import re
import subprocess
import sys
from importlib.resources import files

import numpy as np
import pytest
from numpy import abs, arccos, arctan, cos, exp, pi, sign, sin, sqrt, tan

from steer_env.friction.numerics.kernel import kernel
from steer_env.friction.numerics.simd import broadcast, first, load, store
from steer_env.vehicle import cars, tyre
from steer_env.vehicle.tyre import tir
from steer_env.vehicle.tyre.magic_formula import forces_of_four

EVERY = ("pacejka_2006_205_60r15", *tyre.EXAMPLES)
DATA = files("steer_env.vehicle").joinpath("data", "tyres")
V52, V61, V62 = (DATA.joinpath(f"{name}.tir") for name in tyre.EXAMPLES)
V = 20.0

# Their warnings are the subject of test_tyre_files.py.
pytestmark = pytest.mark.filterwarnings("ignore::steer_env.vehicle.tyre.TyreFile")


class Numbers(dict):
    """Coefficients and factors of a file; those that it lacks are neutral."""

    def __missing__(self, key):
        return 1.0 if key.startswith("L") or key == "QSY7" else 2.0 if key == "PKY4" else 0.0

    __getattr__ = dict.__getitem__


def numbers(file):
    flat = {key: value for entries in file.sections.values() for key, value in entries.items()}
    return Numbers({key: value for key, value in flat.items() if isinstance(value, float)})


def curve(B, C, D, E, x, wave=sin):
    return D * wave(C * arctan(B * x - E * (B * x - arctan(B * x))))


def weight(B, C, E, slip, S_H):
    return curve(B, C, 1.0, E, slip + S_H, cos) / curve(B, C, 1.0, E, S_H, cos)


def mf_tyre(version, q, kappa, alpha, gamma, Fz, Vx, mu=1.0, phit=0.0, p=None):
    """MF-Tyre 5.2, 6.1, 6.2 in ISO axes for forward rolling: PAC2002; Besselink et al. 2010; Pacejka 2012, 4.3.3.

    PAC2002 adds terms of M_x, M_y and pressure to 5.2; a file of 5.2 lacks their keys.
    """
    old = version == 52
    R0, Fz0 = q.UNLOADED_RADIUS, q.FNOMIN
    Fz0p = Fz0 * q.LFZO
    dfz = (Fz - Fz0p) / Fz0p
    nominal = q.NOMPRES or q.IP_NOM
    dpi = ((p or q.INFLPRES or q.IP or nominal) - nominal) / nominal if nominal else 0.0
    LMUX, LMUY = q.LMUX * mu, q.LMUY * mu
    LMUXp, LMUYp = (l if old else 10 * l / (1 + 9 * l) for l in (LMUX, LMUY))  # (4.E8)
    gx, gy, gz = (gamma * factor for factor in ((q.LGAX, q.LGAY, q.LGAZ) if old else (1, 1, 1)))
    z0 = z1 = z2 = z3 = z5 = z6 = z7 = z8 = 1.0
    eps = q.PECP1 * (1 + q.PECP2 * dfz)  # (4.90)
    spins = phit != 0.0 and version == 62
    phi = phit + (1 - eps) * (1 + kappa) * cos(alpha) * sin(gamma) / R0  # (4.76), ISO; Omega/V = (1 + kappa) cos/R0
    if spins:
        z0 = 0.0
        z1 = cos(arctan(q.PDXP1 * (1 + q.PDXP2 * dfz) * cos(arctan(q.PDXP3 * kappa)) * R0 * phi))
        Byp = q.PDYP1 * (1 + q.PDYP2 * dfz) * cos(arctan(q.PDYP3 * tan(alpha)))
        z2 = cos(arctan(Byp * (R0 * abs(phi) + q.PDYP4 * sqrt(R0 * abs(phi)))))
        z3 = cos(arctan(q.PKYP1 * R0**2 * phi**2))
        z5, z6 = cos(arctan(q.QDTP1 * R0 * phi)), cos(arctan(q.QBRP1 * R0 * phi))

    # F_x at pure slip
    mux = (q.PDX1 + q.PDX2 * dfz) * (1 + q.PPX3 * dpi + q.PPX4 * dpi**2) * (1 - q.PDX3 * gx**2) * LMUX
    Kx = Fz * (q.PKX1 + q.PKX2 * dfz) * exp(q.PKX3 * dfz) * (1 + q.PPX1 * dpi + q.PPX2 * dpi**2) * q.LKX
    kx = kappa + (q.PHX1 + q.PHX2 * dfz) * q.LHX
    SVx = Fz * (q.PVX1 + q.PVX2 * dfz) * q.LVX * LMUXp * z1
    Cx, Dx = q.PCX1 * q.LCX, mux * Fz * z1
    Ex = (q.PEX1 + q.PEX2 * dfz + q.PEX3 * dfz**2) * (1 - q.PEX4 * sign(kx)) * q.LEX
    Fx0 = curve(Kx / (Cx * Dx), Cx, Dx, min(Ex, 1), kx) + SVx

    # F_y at pure slip
    def lateral(g, z0, z2, z3, spins):
        muy = (q.PDY1 + q.PDY2 * dfz) * (1 + q.PPY3 * dpi + q.PPY4 * dpi**2) * (1 - q.PDY3 * g**2) * LMUY

        def stiffness(g):
            load = Fz / Fz0p / ((q.PKY2 + q.PKY5 * g**2) * (1 + q.PPY2 * dpi))
            return q.PKY1 * Fz0p * (1 + q.PPY1 * dpi) * (1 - q.PKY3 * abs(g)) * sin(q.PKY4 * arctan(load)) * z3 * q.LKY

        K = stiffness(g)
        LKYC = 1.0 if old else q.LKYC
        SVg = Fz * (q.PVY3 + q.PVY4 * dfz) * g * LKYC * LMUYp * z2
        SV = Fz * (q.PVY1 + q.PVY2 * dfz) * q.LVY * LMUYp * z2 + SVg
        SH = (q.PHY1 + q.PHY2 * dfz) * q.LHY
        Kg0 = Fz * (q.PKY6 + q.PKY7 * dfz) * (1 + q.PPY5 * dpi) * LKYC
        if old:
            SH += q.PHY3 * g
        elif spins:
            CH, DH = q.PHYP1, q.PHYP2 + q.PHYP3 * dfz
            BH = Kg0 / (1 - eps) / (CH * DH * stiffness(0.0))
            SH += curve(BH, CH, DH, min(q.PHYP4, 1), R0 * phi) - SVg / K
        else:
            SH += (Kg0 * g - SVg) / K * z0
        C, D, ay = q.PCY1 * q.LCY, muy * Fz * z2, alpha + SH
        E = (q.PEY1 + q.PEY2 * dfz) * (1 + q.PEY5 * g**2 - (q.PEY3 + q.PEY4 * g) * sign(ay)) * q.LEY
        return curve(K / (C * D), C, D, min(E, 1), ay) + SV, muy, K, K / D, SH + SV / K

    Fy0, muy, Ky, ByCy, SHf = lateral(gy, z0, z2, z3, spins)
    Fy0_upright = lateral(0.0, 1.0, 1.0, 1.0, False)[0]

    # Combined slip
    Bxa = (q.RBX1 + q.RBX3 * gamma**2) * cos(arctan(q.RBX2 * kappa)) * q.LXAL
    Fx = Fx0 * weight(Bxa, q.RCX1, min(q.REX1 + q.REX2 * dfz, 1), alpha, q.RHX1)
    Byk = (q.RBY1 + q.RBY4 * gamma**2) * cos(arctan(q.RBY2 * (alpha - q.RBY3))) * q.LYKA
    Gyk = weight(Byk, q.RCY1, min(q.REY1 + q.REY2 * dfz, 1), kappa, q.RHY1 + q.RHY2 * dfz)
    DVyk = muy * Fz * (q.RVY1 + q.RVY2 * dfz + q.RVY3 * gamma) * cos(arctan(q.RVY4 * alpha)) * z2
    SVyk = DVyk * sin(q.RVY5 * arctan(q.RVY6 * kappa)) * q.LVYKA
    Fy = Gyk * Fy0 + SVyk

    # Aligning torque
    at = alpha + q.QHZ1 + q.QHZ2 * dfz + (q.QHZ3 + q.QHZ4 * dfz) * gz
    ar = alpha + SHf
    Bt = (q.QBZ1 + q.QBZ2 * dfz + q.QBZ3 * dfz**2) * (1 + q.QBZ4 * gz + q.QBZ5 * abs(gz)) * q.LKY / LMUY
    Dt = (
        Fz
        * (q.QDZ1 + q.QDZ2 * dfz)
        * (1 - (q.PPZ1 + q.QPZ1) * dpi)
        * (1 + q.QDZ3 * gz + q.QDZ4 * gz**2)
        * R0
        / Fz0
        * q.LTR
        * z5
    )
    Et = q.QEZ1 + q.QEZ2 * dfz + q.QEZ3 * dfz**2
    Et *= 1 + (q.QEZ4 + q.QEZ5 * gz) * 2 / pi * arctan(Bt * q.QCZ1 * at)
    Br = (q.QBZ9 * q.LKY / LMUY + q.QBZ10 * ByCy) * z6
    if spins:
        Minf = q.QCRP1 * abs(muy) * R0 * Fz * sqrt(Fz / Fz0p) * q.LMP
        CD = q.QDRP1
        DD = Minf / sin(0.5 * pi * CD)
        Kzg = Fz * R0 * (q.QDZ8 + q.QDZ9 * dfz) * (1 + q.PPZ2 * dpi) * q.LKZC
        Drp = curve(Kzg / (CD * DD * (1 - eps)), CD, DD, min(q.QDRP2, 1), R0 * phi)
        z8 = 1 + Drp
        z7 = 2 / pi * arccos(min(Minf * 2 / pi * arctan(q.QCRP2 * R0 * abs(phi)) * Gyk / abs(Drp), 1))
    by_camber = (q.QDZ8 + q.QDZ9 * dfz) * (1 + (q.PPZ2 + q.QPZ2) * dpi) + (q.QDZ10 + q.QDZ11 * dfz) * abs(gz)
    Dr = (q.QDZ6 + q.QDZ7 * dfz) * q.LRES * z2 + by_camber * gz * (1.0 if old else q.LKZC) * z0
    Dr = Fz * R0 * Dr * LMUY * cos(alpha) + z8 - 1
    ate, are = (arctan(sqrt(tan(a) ** 2 + (Kx / Ky * kappa) ** 2)) * sign(a) for a in (at, ar))
    t = curve(Bt, q.QCZ1, Dt, min(Et, 1), ate, cos) * cos(alpha)
    s = R0 * (q.SSZ1 + q.SSZ2 * Fy / Fz0 + (q.SSZ3 + q.SSZ4 * dfz) * gamma) * q.LS
    Mz = -t * Gyk * (Fy0 if old else Fy0_upright) + Dr * cos(z7 * arctan(Br * are)) + s * Fx

    # Overturning couple and rolling resistance
    Mx = q.QSX1 * q.LVMX - q.QSX2 * gamma * (1 + (q.PPMX1 + q.QPX1) * dpi) + q.QSX3 * Fy / Fz0
    Mx += (
        q.QSX4
        * cos(q.QSX5 * arctan((q.QSX6 * Fz / Fz0) ** 2))
        * sin(q.QSX7 * gamma + q.QSX8 * arctan(q.QSX9 * Fy / Fz0))
    )
    Mx += q.QSX10 * arctan(q.QSX11 * Fz / Fz0) * gamma - q.QSX12 * gamma * abs(gamma)
    Mx += Fy / Fz * (q.QSX13 + q.QSX14 * abs(gamma))
    My = q.QSY1 + q.QSY2 * Fx / Fz0 + q.QSY3 * abs(Vx / q.LONGVL) + q.QSY4 * (Vx / q.LONGVL) ** 4
    My += (q.QSY5 + q.QSY6 * Fz / Fz0) * gamma**2
    # PAC2002 multiplies the load by what MF-Tyre 6.1 multiplies the nominal load by.
    My *= -R0 * q.LMY * (Fz * (Fz / Fz0) ** q.get("QSY7", 0.0) if old else Fz0 * (Fz / Fz0) ** q.QSY7)
    My *= (1 + dpi) ** q.QSY8
    return np.array([Fx, Fy, R0 * Fz * q.LMX * Mx, My, Mz])


def book(q, kappa, alpha, gamma, Fz, Vx, mu=1.0):
    """Pacejka 2006, (4.E1) to (4.E78), ISO, rolling forward, with the deviations that ``magic_formula`` names."""
    R0, F0 = q.UNLOADED_RADIUS, q.FNOMIN * q.LFZO
    a, g, d = tan(alpha), sin(gamma), Fz / F0 - 1
    LMUX, LMUY = q.LMUX * mu, q.LMUY * mu

    def pure_x(k):
        C, D = q.PCX1 * q.LCX, (q.PDX1 + q.PDX2 * d) * (1 - q.PDX3 * g**2) * LMUX * Fz
        E = (q.PEX1 + q.PEX2 * d + q.PEX3 * d**2) * (1 - q.PEX4 * sign(k)) * q.LEX
        return curve(Kx / (C * D), C, D, min(E, 1), k)

    Kx = Fz * (q.PKX1 + q.PKX2 * d) * exp(q.PKX3 * d) * q.LKX
    SHx = (q.PHX1 + q.PHX2 * d) * q.LHX
    SVx = Fz * (q.PVX1 + q.PVX2 * d) * q.LVX * 10 * LMUX / (1 + 9 * LMUX)
    Bxa = (q.RBX1 + q.RBX3 * g**2) * cos(arctan(q.RBX2 * kappa)) * q.LXAL
    Gxa = weight(Bxa, q.RCX1, min(q.REX1 + q.REX2 * d, 1), a, q.RHX1)
    Fx, dFx = Gxa * (pure_x(kappa + SHx) + SVx), Gxa * (pure_x(kappa + SHx) - pure_x(SHx))

    Ky = q.PKY1 * F0 * sin(q.PKY4 * arctan(Fz / ((q.PKY2 + q.PKY5 * g**2) * F0))) / (1 + q.PKY3 * g**2) * q.LKY
    fade = 10 * LMUY / (1 + 9 * LMUY)
    SVg = Fz * (q.PVY3 + q.PVY4 * d) * g * q.LKYC * fade
    SVy = Fz * (q.PVY1 + q.PVY2 * d) * q.LVY * fade + SVg
    SHy = (q.PHY1 + q.PHY2 * d) * q.LHY + (Fz * (q.PKY6 + q.PKY7 * d) * g * q.LKYC - SVg) / Ky
    C, D = q.PCY1 * q.LCY, (q.PDY1 + q.PDY2 * d) * (1 - q.PDY3 * g**2) * LMUY * Fz
    side = np.clip(alpha / 5e-3, -1, 1)
    E = (q.PEY1 + q.PEY2 * d) * (1 + q.PEY5 * g**2 - (q.PEY3 + q.PEY4 * g) * side) * q.LEY
    Byk = (q.RBY1 + q.RBY4 * g**2) * cos(arctan(q.RBY2 * (a - q.RBY3))) * q.LYKA
    Fy = curve(Ky / (C * D), C, D, min(E, 1), alpha + SHy) + SVy
    Fy *= weight(Byk, q.RCY1, min(q.REY1 + q.REY2 * d, 1), kappa, q.RHY1 + q.RHY2 * d)
    SVyk = D * (q.RVY1 + q.RVY2 * d + q.RVY3 * g) * cos(arctan(q.RVY4 * a))
    SVyk *= sin(q.RVY5 * arctan(q.RVY6 * kappa)) * q.LVYKA

    ratio = (Kx / Ky * kappa) ** 2
    at = a + q.QHZ1 + q.QHZ2 * d + (q.QHZ3 + q.QHZ4 * d) * g
    at = sqrt(at**2 + ratio) * sign(at)
    ar = sqrt((a + SHy + SVy / Ky) ** 2 + ratio)
    Bt = (q.QBZ1 + q.QBZ2 * d + q.QBZ3 * d**2) * (1 + q.QBZ5 * abs(g) + q.QBZ6 * g**2) * q.LKY / LMUY
    Dt = Fz * R0 / F0 * (q.QDZ1 + q.QDZ2 * d) * q.LTR * (1 + q.QDZ3 * abs(g) + q.QDZ4 * g**2)
    Et = q.QEZ1 + q.QEZ2 * d + q.QEZ3 * d**2
    Et *= 1 + (q.QEZ4 + q.QEZ5 * g) * 2 / pi * arctan(Bt * q.QCZ1 * at)
    t = curve(Bt, q.QCZ1, Dt, min(Et, 1), at, cos) * cos(alpha)
    Dr = (q.QDZ8 + q.QDZ9 * d + (q.QDZ10 + q.QDZ11 * d) * abs(g)) * g * q.LKZC
    Dr = Fz * R0 * ((q.QDZ6 + q.QDZ7 * d) * q.LRES + Dr) * LMUY * cos(alpha)
    Mzr = Dr * cos(arctan((q.QBZ9 * q.LKY / LMUY + q.QBZ10 * Ky / D) * ar)) * cos(alpha)
    Fyk = Fy + SVyk
    s = R0 * (q.SSZ1 + q.SSZ2 * Fyk / F0 + (q.SSZ3 + q.SSZ4 * d) * g) * q.LS
    Mx = R0 * Fz * (q.QSX1 * q.LVMX - q.QSX2 * g + q.QSX3 * Fyk / F0) * q.LMX
    My = q.QSY1 + q.QSY2 * Fx / F0 + q.QSY3 * abs(Vx / q.LONGVL) + q.QSY4 * (Vx / q.LONGVL) ** 4
    return np.array([Fx, Fyk, Mx, -R0 * Fz * My * q.LMY, -t * Fy + Mzr + s * dFx])


def scaled(file, seed):
    """The file with every scaling factor of its version away from 1."""
    rng = np.random.default_rng(seed)
    factors = {key: rng.uniform(0.8, 1.2) for key in tir.coefficients(tir.SCALING, file.version)}
    return dataclasses.replace(file, sections={**file.sections, tir.SCALING: factors})


def points(seed, n=200):
    rng = np.random.default_rng(seed)
    for i in range(n):
        kappa = rng.uniform(-0.9, 0.9) if i % 3 else 0.0
        alpha = rng.uniform(-1.0, 1.0) if i % 2 else rng.uniform(-0.05, 0.05)
        yield kappa, alpha, rng.uniform(-0.15, 0.15) if i % 5 else 0.0, rng.uniform(300, 8000), rng.uniform(2, 50)


def agree(got, expected, F_z):
    np.testing.assert_allclose(got, expected, rtol=1e-11, atol=1e-12 * F_z)  # rounding of folded factors


@pytest.mark.parametrize("path", [V52, V61, V62], ids=tyre.EXAMPLES)
@pytest.mark.parametrize("factors", ["one", "scaled"])
@pytest.mark.parametrize("mu", [1.0, 0.6])
def test_forces_are_those_of_the_published_equations(path, factors, mu):
    file = tir.read(path)
    if factors == "scaled":
        file = scaled(file, 1)
    subject = tyre.from_file(file)
    q = numbers(file)
    for point in points(2):
        agree(subject.forces(*point, mu), mf_tyre(file.version, q, *point, mu), point[3])


@pytest.mark.parametrize("factors", ["one", "scaled"])
@pytest.mark.parametrize("mu", [1.0, 0.6])
def test_forces_of_the_packaged_tyre_are_those_of_the_book(factors, mu):
    file = tyre.to_file(tyre.load())
    every = {name: dict(entries) for name, entries in file.sections.items()}
    every["ALIGNING_COEFFICIENTS"] |= {"QBZ6": 0.3, "QBZ10": 0.1, "QDZ10": 0.2, "QDZ11": -0.1}
    every["LATERAL_COEFFICIENTS"] |= {"PEY5": -1.0, "PKY5": 0.3, "RBY4": 0.5, "REY1": 0.1}
    every["LONGITUDINAL_COEFFICIENTS"] |= {"PEX4": 0.1, "RBX3": 1.0, "PDX3": 0.5, "PVX1": 0.002}
    every["OVERTURNING_COEFFICIENTS"] |= {"QSX1": 0.01, "QSX2": 0.5, "QSX3": 0.1}
    for each in (file, dataclasses.replace(file, sections=every)):
        each = scaled(each, 10) if factors == "scaled" else each
        subject = tyre.from_file(each)
        for point in points(11):
            agree(subject.forces(*point, mu), book(numbers(each), *point, mu), point[3])


# What PAC2002 has beyond 5.2, each term so large that it matters.
PAC2002 = {
    "TIRE_CONDITIONS": {"IP": 190e3, "IP_NOM": 230e3},
    "VERTICAL": {"QPFZ1": 0.6},
    "LONGITUDINAL_COEFFICIENTS": {"PPX1": -0.4, "PPX2": 0.3, "PPX3": -0.1, "PPX4": 0.2},
    "LATERAL_COEFFICIENTS": {"PPY1": 0.5, "PPY2": 0.9, "PPY3": -0.15, "PPY4": 0.1},
    "OVERTURNING_COEFFICIENTS": {
        **{"QSX4": 0.12, "QSX5": 0.9, "QSX6": 1.7, "QSX7": 0.4, "QSX8": -0.5, "QSX9": 0.7, "QSX10": 0.3, "QSX11": 0.8},
        "QPX1": 0.7,
    },
    "ROLLING_COEFFICIENTS": {"QSY5": 0.09, "QSY6": -0.04, "QSY7": -0.15, "QSY8": -0.4},
    "ALIGNING_COEFFICIENTS": {"QPZ1": 0.3, "QPZ2": -0.6},
}


@pytest.mark.parametrize("factors", ["one", "scaled"])
def test_terms_of_pac2002(factors):
    file = tir.read(V52)
    file = dataclasses.replace(
        file, sections={**file.sections, **{name: {**file.sections.get(name, {}), **e} for name, e in PAC2002.items()}}
    )
    file = scaled(file, 14) if factors == "scaled" else file
    subject = tyre.from_file(file)
    for point in points(15):
        agree(subject.forces(*point), mf_tyre(52, numbers(file), *point), point[3])
    stiffness = file.get("VERTICAL", "VERTICAL_STIFFNESS") * numbers(file).LCZ
    assert subject.vertical_stiffness == pytest.approx(stiffness * (1 + 0.6 * (190 / 230 - 1)))


@pytest.mark.parametrize("p", [150e3, 220e3, 290e3])
@pytest.mark.parametrize("path", [V61, V62], ids=tyre.EXAMPLES[1:])
def test_inflation_pressure(path, p):
    file = tir.read(path)
    subject = tyre.from_file(file).at_pressure(p)
    for point in points(3, 60):
        agree(subject.forces(*point), mf_tyre(file.version, numbers(file), *point, p=p), point[3])
    dp = p / 220e3 - 1
    assert subject.vertical_stiffness == pytest.approx(200e3 * (1 + 0.7 * dp))
    C_x, C_y = 280e3 * (1 + 0.15 * dp), 100e3 * (1 + 0.2 * dp)
    c = subject.coefficients
    assert subject.relaxation_length == pytest.approx(tyre.cornering_stiffness(c, 4000.0) / C_y)
    assert subject.longitudinal_relaxation_length == pytest.approx(tyre.longitudinal_stiffness(c, 4000.0) / C_x)
    back = subject.at_pressure(220e3)
    np.testing.assert_allclose(back.coefficients, tyre.from_file(file).coefficients, rtol=1e-14)
    assert subject.symmetric() == tyre.from_file(file).symmetric().at_pressure(p)


def test_file_is_at_its_own_pressure():
    file = tir.read(V61)
    low = {**file.sections["OPERATING_CONDITIONS"], "INFLPRES": 180e3}
    soft = dataclasses.replace(file, sections={**file.sections, "OPERATING_CONDITIONS": low})
    assert tyre.from_file(soft) == tyre.from_file(file).at_pressure(180e3)


@pytest.mark.parametrize(
    ("name", "p", "message"),
    [
        ("example_mf61", 0.0, "inflation pressure"),
        ("example_mf61", math.nan, "inflation pressure"),
        ("example_mf61", 2e6, "outside the fit of example_mf61"),
        ("example_mf52", 2e5, "no nominal inflation pressure"),
        ("pacejka_2006_205_60r15", 2e5, "no pressure terms: it holds at 220000 Pa only, got 200000"),
    ],
)
def test_pressure_without_meaning(name, p, message):
    with pytest.raises(ValueError, match=message):
        tyre.load(name).at_pressure(p)


@pytest.mark.parametrize("factors", ["one", "scaled"])
def test_turn_slip(factors):
    file = tir.read(V62)
    if factors == "scaled":
        file = scaled(file, 4)
    subject, q = tyre.from_file(file), numbers(file)
    for phit in (-2.0, -0.05, 1e-3, 0.3, 5.0):
        for point in points(5, 60):
            agree(subject.forces(*point, 0.8, phit), mf_tyre(62, q, *point, 0.8, phit), point[3])


def test_turn_slip_without_its_coefficients_and_its_sign():
    for name in ("example_mf52", "example_mf61", "pacejka_2006_205_60r15"):
        subject = tyre.load(name)
        assert subject.forces(0.05, 0.05, 0.05, 4000, V, 1, 3.0) == subject.forces(0.05, 0.05, 0.05, 4000, V)
    # A contact that turns left is twisted back, to the right, and pushed right, as by camber to the right.
    F_y, M_z = (tyre.load("example_mf62", symmetric=True).forces(0, 0, 0, 4000, V, 1, 0.1)[i] for i in (1, 4))
    assert F_y < 0
    assert M_z < 0


@pytest.mark.parametrize("name", EVERY)
def test_symmetry_is_exact(name):
    subject = dataclasses.replace(tyre.load(name), name="x")
    symmetric, mirrored = subject.symmetric(), subject.mirrored()
    for kappa, alpha, gamma, F_z, v_x in points(6):
        for phit in (0.0, 0.4):
            a = (kappa, alpha, gamma, F_z, v_x, 0.9, phit)
            b = (kappa, -alpha, -gamma, F_z, v_x, 0.9, -phit)
            for left, right in ((symmetric, symmetric), (subject, mirrored)):
                F_x, F_y, M_x, M_y, M_z = left.forces(*a)
                assert right.forces(*b) == (F_x, -F_y, -M_x, M_y, -M_z)
    assert mirrored.mirrored() == subject


@pytest.mark.parametrize("name", EVERY)
def test_half_turn_about_z(name):
    """The tyre seen from behind: quantities along x or y reverse, M_z and the turn slip along z do not."""
    subject = tyre.load(name)
    turn = np.diag([-1.0, -1.0, 1.0])
    for kappa, alpha, gamma, F_z, v_x in points(7, 60):
        F_x, F_y, M_x, M_y, M_z = subject.forces(kappa, alpha, gamma, F_z, v_x, 1.0, 0.3)
        back = subject.forces(-kappa, -alpha, -gamma, F_z, -v_x, 1.0, 0.3)
        np.testing.assert_array_equal([back[0], back[1], F_z], turn @ [F_x, F_y, F_z])
        np.testing.assert_array_equal(back[2:], turn @ [M_x, M_y, M_z])


@kernel
def side_by_side(c, x, together, alone):
    """Forces at four points, the columns of ``x``, in the four lanes, and each point in all four lanes."""
    kappa, tan_a, camber, F_z, v_x, mu = load(x, 0), load(x, 4), load(x, 8), load(x, 12), load(x, 16), load(x, 20)
    F_x, F_y, M_x, M_y, M_z = forces_of_four(c[0], kappa, tan_a, camber, F_z, v_x, mu, load(x, 24))
    store(together, 0, F_x)
    store(together, 4, F_y)
    store(together, 8, M_x)
    store(together, 12, M_y)
    store(together, 16, M_z)
    for i in range(4):
        kappa, tan_a, camber, F_z, v_x, mu = x[0, i], x[1, i], x[2, i], x[3, i], x[4, i], x[5, i]
        F_x, F_y, M_x, M_y, M_z = forces_of_four(
            c[0],
            broadcast(kappa),
            broadcast(tan_a),
            broadcast(camber),
            broadcast(F_z),
            broadcast(v_x),
            broadcast(mu),
            broadcast(x[6, i]),
        )
        alone[0, i], alone[1, i], alone[2, i] = first(F_x), first(F_y), first(M_x)
        alone[3, i], alone[4, i] = first(M_y), first(M_z)


@kernel
def rolling(c, x, with_zeros, with_none):
    tan_a, camber, F_z, v_x, mu = load(x, 4), load(x, 8), load(x, 12), load(x, 16), load(x, 20)
    for i, force in enumerate(forces_of_four(c[0], broadcast(0.0), tan_a, camber, F_z, v_x, mu, broadcast(1.0))):
        store(with_zeros, 4 * i, force + broadcast(0.0))
    for i, force in enumerate(forces_of_four(c[0], None, tan_a, camber, F_z, v_x, mu, broadcast(1.0))):
        store(with_none, 4 * i, force + broadcast(0.0))


@pytest.mark.parametrize("name", EVERY)
def test_no_slip_is_a_slip_of_zero(name):
    rows = np.array([(*point, 0.9 if i % 3 else 1.0) for i, point in enumerate(points(8, 60))])
    for four in rows[: len(rows) // 4 * 4].reshape(-1, 4, 6):
        with_zeros, with_none = np.zeros((5, 4)), np.ones((5, 4))
        rolling(tyre.record(tyre.load(name).coefficients), np.ascontiguousarray(four.T), with_zeros, with_none)
        np.testing.assert_array_equal(with_none, with_zeros)


@pytest.mark.parametrize("name", EVERY)
def test_four_tyres_are_four_times_one(name):
    """Each tyre is equal to the bit, whatever the others do, and the slip angle gives the forces of its tangent."""
    subject = tyre.load(name)
    rows = np.array([(*point, 0.9 if i % 3 else 1.0, 1.0) for i, point in enumerate(points(8, 60))])
    rows[5::7, 3] = 0.0
    angles = rows[:, 1].copy()
    rows[:, 1] = np.tan(angles)
    for i in range(0, 60, 4):
        together, alone = np.empty((2, 5, 4))
        side_by_side(tyre.record(subject.coefficients), rows[i : i + 4].T.copy(), together.reshape(-1), alone)
        np.testing.assert_array_equal(together, alone)
        kappa, _, gamma, F_z, v_x, mu, _ = rows[i : i + 4].T
        by_angle = subject.forces(kappa, angles[i : i + 4], gamma, F_z, v_x, mu)
        np.testing.assert_allclose(together, by_angle, rtol=1e-12, atol=1e-8)


@pytest.mark.parametrize("name", EVERY)
def test_stiffness_factor_of_an_axle(name):
    """The factor is that of a property file, LKY: a tyre whose coefficients contain it has the same forces."""
    c = tyre.load(name).coefficients
    factors = np.array([0.8, 1.0, 1.3, 1.7])
    stiffer = [
        tyre.Tyre(name, "", c._replace(**{k: factor * getattr(c, k) for k in ("PKY1", "QBZ1", "QBZ2", "QBZ3", "QBZ9")}))
        for factor in factors
    ]
    rows = np.array([(*point, 0.9, 1.0) for point in points(8, 40)])
    for four in rows.reshape(-1, 4, 7):
        four[:, 6] = factors
        expected = [subject.forces(*row[:6]) for subject, row in zip(stiffer, four)]
        four[:, 1] = np.tan(four[:, 1])
        together, alone = np.empty((2, 5, 4))
        side_by_side(tyre.record(c), np.ascontiguousarray(four.T), together.reshape(-1), alone)
        np.testing.assert_array_equal(together, alone)
        np.testing.assert_allclose(together, np.array(expected).T, rtol=1e-11, atol=1e-8)


@pytest.mark.parametrize("name", EVERY)
def test_pure_slip_is_the_limit_of_combined_slip(name):
    subject = tyre.load(name)
    for _, alpha, gamma, F_z, v_x in points(9, 60):
        pure, near = (subject.forces(kappa, alpha, gamma, F_z, v_x) for kappa in (0.0, 1e-300))
        np.testing.assert_allclose(near, pure, rtol=1e-13, atol=1e-13 * F_z)  # tan and back in the equivalent slips


def test_plain_python_agrees_with_compiled():
    arguments = [[*point, 0.9, phit] for point, phit in zip(points(13, 30), [0.0, 0.2] * 15)]
    script = (
        "import json, sys; import numpy as np; from steer_env.vehicle import tyre;"
        "x = np.array(json.load(sys.stdin)).T;"
        f"print(json.dumps([np.array(tyre.load(name).forces(*x)).tolist() for name in {EVERY!r}]))"
    )
    run = subprocess.run(
        [sys.executable, "-c", script],
        input=json.dumps(arguments),
        env=os.environ | {"NUMBA_DISABLE_JIT": "1", "PYTHONPATH": str(files("steer_env.vehicle").joinpath("..", ".."))},
        capture_output=True,
        text=True,
        check=True,
    )
    compiled = [tyre.load(name).forces(*np.array(arguments).T) for name in EVERY]
    # The elementary functions come from different libraries.
    np.testing.assert_allclose(json.loads(run.stdout), compiled, rtol=1e-11, atol=1e-9)


# Reading and writing


@pytest.mark.parametrize("path", [V52, V61, V62], ids=tyre.EXAMPLES)
def test_round_trip(path, tmp_path):
    """Every field returns, including scaling factors and extensions, for every layout."""
    file = scaled(tir.read(path), 12)
    tir.write(tmp_path / "copy.tir", file)
    back = tir.read(tmp_path / "copy.tir")
    assert back == file
    assert list(back.sections) == list(file.sections)
    assert tyre.load(tmp_path / "copy.tir").coefficients == tyre.from_file(file).coefficients
    assert [path.name for path in tmp_path.iterdir()] == ["copy.tir"]


def test_extensions_are_kept_verbatim():
    assert tir.read(V52).extensions == {
        "SHAPE": ("{radial width}", " 1.0    0.0", " 1.0    0.5", " 1.0    0.9", " 0.9    1.0")
    }


@pytest.mark.parametrize("name", EVERY)
def test_a_tyre_saved_is_the_tyre_read(name, tmp_path):
    before = tyre.load(name)
    if name in tyre.EXAMPLES[1:]:
        before = before.at_pressure(180e3)
    tyre.save(before, tmp_path / "copy.tir")
    after = tyre.load(tmp_path / "copy.tir")
    assert after.coefficients._replace(NOMPRES=0.0) == before.coefficients._replace(NOMPRES=0.0)
    assert after.limits == before.limits
    for key in ("relaxation_length", "longitudinal_relaxation_length", "vertical_stiffness"):
        assert getattr(after, key) == pytest.approx(getattr(before, key), rel=1e-14)
    slippery = dataclasses.replace(before, coefficients=before.coefficients._replace(LMUY=0.8))
    with pytest.raises(ValueError, match="LMUX or LMUY"):
        tyre.save(slippery, tmp_path / "slippery.tir")
    assert not (tmp_path / "slippery.tir").exists()


def test_units_other_than_si(tmp_path):
    units = {"LENGTH": "MM", "FORCE": "kN", "ANGLE": "degree", "MASS": "kg", "TIME": "minute"}
    per_si = {
        **dict.fromkeys(("UNLOADED_RADIUS", "WIDTH"), 1e3),
        **dict.fromkeys(("FNOMIN", "FZMIN", "FZMAX"), 1e-3),
        **dict.fromkeys(("VERTICAL_STIFFNESS", "LONGITUDINAL_STIFFNESS", "LATERAL_STIFFNESS"), 1e-6),
        **dict.fromkeys(("INFLPRES", "NOMPRES", "PRESMIN", "PRESMAX"), 1e-9),  # kN/mm2
        **dict.fromkeys(("ALPMIN", "ALPMAX", "CAMMIN", "CAMMAX"), 180 / math.pi),
        "LONGVL": 60e3,
    }
    sections = {
        name: {key: value * per_si.get(key, 1.0) if isinstance(value, float) else value for key, value in each.items()}
        for name, each in tir.read(V61).sections.items()
    }
    tir.write(tmp_path / "units.TIR", tir.PropertyFile(61, sections | {"UNITS": units}))
    got, expected = tyre.load(tmp_path / "units.TIR"), tyre.load("example_mf61")
    np.testing.assert_allclose(got.coefficients, expected.coefficients, rtol=1e-14)
    np.testing.assert_allclose(got.limits, expected.limits, rtol=1e-14)
    assert got.pressure.inflation == pytest.approx(220e3)
    for key in ("relaxation_length", "longitudinal_relaxation_length", "vertical_stiffness"):
        assert getattr(got, key) == pytest.approx(getattr(expected, key), rel=1e-13)
    changed, _ = edited(tmp_path, V61, "= 'second'", "= 'second'\nPRESSURE = \"bar\" ! of this file")
    changed.write_text(changed.read_text().replace("= 220000.0", "= 0.22D+01"))  # Fortran's exponent
    np.testing.assert_allclose(tyre.load(changed).coefficients, expected.coefficients, rtol=1e-14)


def test_relaxation_lengths_of_5_2():
    subject, q = tyre.load("example_mf52"), numbers(tir.read(V52))
    assert subject.longitudinal_relaxation_length == pytest.approx(q.PTX1 * q.UNLOADED_RADIUS)
    assert subject.relaxation_length == pytest.approx(q.PTY1 * sin(2 * arctan(1 / q.PTY2)) * q.UNLOADED_RADIUS)


def edited(tmp_path, path, old, new):
    text = path.read_text()
    assert old in text
    changed = tmp_path / "edited.tir"
    changed.write_text(text.replace(old, new, 1))
    return changed, text[: text.index(old)].count("\n") + 1


@pytest.mark.parametrize(
    ("path", "old", "new", "message", "shift"),
    [
        (V52, "'meter'", "'parsec'", "LENGTH: expected one of meter, .*, got 'parsec'", 0),
        (V61, "= 61", "= 70", "FITTYP: expected one of 5, 6, .*, got 70", 0),
        (V61, "PCX1   ", "PCX9   ", r"PCX1: expected in \[LONGITUDINAL_COEFFICIENTS\]", -1),
        (V61, "PEX1   ", "PEXX   ", r"PEXX: expected a key of \[LONGITUDINAL_COEFFICIENTS\]", 0),
        (V61, "PDX2   ", "PDX1   ", "PDX1: expected once, is in line [0-9]+ already", 0),
        (V61, "[VERTICAL]", "[UPRIGHT]", r"\[VERTICAL\]: expected this section", None),
        (
            V61,
            "[ALIGNING_COEFFICIENTS]",
            "[ALIGNING]",
            r"QBZ1: expected in .ALIGNING_COEFFICIENTS., is in .ALIGNING.",
            1,
        ),
        (V61, "= -0.037 ", "= -0.0.37 ", "PDX2: expected a number, got '-0.0.37'", 0),
        (V61, "LFZO   ", "LMUV = 0.1\nLFZO   ", "LMUV: expected 0, .* version 61 do not use it; got 0.1", 0),
        (V52, "VXLOW ", "FE_METHOD = 'YES'\nVXLOW ", "FE_METHOD: expected 'NO'", 0),
        (V61, "[MODEL]", "[MODEL]\nnonsense", "NONSENSE: expected .SECTION., KEY = value, or a comment", 1),
    ],
)
def test_errors_name_file_line_and_key(path, old, new, message, shift, tmp_path):
    changed, line = edited(tmp_path, path, old, new)
    with pytest.raises(ValueError, match=message) as caught:
        tyre.load(changed)
    if shift is not None and "PCX9" not in new:
        assert str(caught.value).startswith(f"{changed}:{line + shift}: ")
    assert str(caught.value).startswith(f"{changed}:")


@pytest.mark.parametrize(
    ("key", "value", "message"),
    [
        ("NOMPRES", "0", "NOMPRES must be given with pressure terms"),
        ("LMUY", "-1", "LMUY"),
        ("UNLOADED_RADIUS", "313.8", "UNLOADED_RADIUS must be finite and at least 0.05 and at most 2"),
        ("PDX1", "1210.0", "PDX1 must be finite and at least 0.05 and at most 5"),
    ],
)
def test_files_without_sense_are_refused(key, value, message, tmp_path):
    path = tmp_path / "odd.tir"
    path.write_text(re.sub(rf"(?m)^({key}\s*=\s*)\S+", rf"\g<1>{value}", V61.read_text(encoding="utf-8")))
    with pytest.raises(ValueError, match=rf"odd.tir: {message}"):
        tyre.load(path)


def test_neutral_foreign_keys_and_other_names_of_versions_are_read(tmp_path):
    changed, _ = edited(tmp_path, V52, "'PAC2002'", "'MF_05'")
    changed, _ = edited(tmp_path, changed, "QBZ5   ", "PPZ1 = 0\nQBZ5   ")
    changed.write_bytes(b"! r\xe9sum\xe9\r\n" + changed.read_bytes())
    assert tyre.load(changed).coefficients == tyre.load("example_mf52").coefficients


def test_nothing_is_written_that_cannot_be_read(tmp_path):
    path = tmp_path / "kept.tir"
    path.write_text("before")
    file = tir.read(V61)
    for sections, message in (
        ({**file.sections, "MODEL": {"LONGVL": 16.67}}, "FITTYP: expected in"),
        ({**file.sections, "MODEL": {**file.sections["MODEL"], "TYRESIDE": "it's"}}, "format cannot hold"),
        ({**file.sections, "UNITS": {}}, "LENGTH: expected in"),
    ):
        with pytest.raises(ValueError, match=message) as caught:
            tir.write(path, dataclasses.replace(file, sections=sections))
        assert str(caught.value).startswith(str(path))
    assert path.read_text() == "before"
    assert list(tmp_path.iterdir()) == [path]


def test_missing_file_is_named(tmp_path):
    with pytest.raises(FileNotFoundError, match=r"none\.tir"):
        tyre.load(tmp_path / "none.tir")
    with pytest.raises(ValueError, match=r"^tyre file .*none\.tir: No such file"):
        cars.load("compact", {"tyre": str(tmp_path / "none.tir")})


def test_a_product_that_is_too_large_is_refused(tmp_path):
    path = tmp_path / "large.tir"
    text = re.sub(r"(?m)^((?:LCY|PKY3)\s*=).*", r"\1 1e308", V61.read_text())
    path.write_text(text)
    with pytest.raises(ValueError, match=r"large\.tir: a coefficient with its scaling factors is too large"):
        tyre.load(path)


def test_save_wants_its_ending(tmp_path):
    with pytest.raises(ValueError, match=r"^path must end in .tir, got"):
        tyre.save(tyre.load(), tmp_path / "tyre.txt")
