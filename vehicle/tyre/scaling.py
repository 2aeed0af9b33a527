"""Scaling factors, inflation pressure and carcass of a property file.

All of them are constant in a simulation. They are multiplied into the coefficients once, when a tyre is made, and cost
the kernels nothing.

Source of the position of each factor: the publications that ``magic_formula`` names, by version.
"""

import math
from typing import Any, NamedTuple

from steer_env.friction.numerics.check import positive
from steer_env.vehicle.tyre import tir
from steer_env.vehicle.tyre.coefficients import MagicFormula
from steer_env.vehicle.tyre.magic_formula import A_MU, cornering_stiffness, longitudinal_stiffness


class PressureTerms(NamedTuple):
    """Dependence of the coefficients on the inflation pressure p, by .tir keys: ``dp = p/NOMPRES - 1``."""

    inflation: float = 0.0  # p for which the coefficients hold; 0 if unknown [Pa]
    PPX1: float = 0.0  # slip stiffness of F_x, by dp [-]
    PPX2: float = 0.0  # slip stiffness of F_x, by dp^2 [-]
    PPX3: float = 0.0  # peak of F_x, by dp [-]
    PPX4: float = 0.0  # peak of F_x, by dp^2 [-]
    PPY1: float = 0.0  # cornering stiffness, by dp [-]
    PPY2: float = 0.0  # load of the largest cornering stiffness, by dp [-]
    PPY3: float = 0.0  # peak of F_y, by dp [-]
    PPY4: float = 0.0  # peak of F_y, by dp^2 [-]
    PPY5: float = 0.0  # camber stiffness, by dp [-]
    PPZ1: float = 0.0  # trail, loss by dp [-]
    PPZ2: float = 0.0  # residual torque of camber, by dp [-]
    PPMX1: float = 0.0  # M_x of camber, by dp [-]
    QSY8: float = 0.0  # rolling resistance, exponent of p/NOMPRES [-]
    PFZ1: float = 0.0  # vertical stiffness, by dp [-]
    PCFX3: float = 0.0  # longitudinal stiffness of the carcass, by dp [-]
    PCFY3: float = 0.0  # lateral stiffness of the carcass, by dp [-]

    def factors(self, dp: float) -> dict[str, float]:
        """Factors of the coefficients at ``dp``, by key; those of the carcass under ``C_x``, ``C_y``, ``C_z``."""
        F_x = 1.0 + self.PPX3 * dp + self.PPX4 * dp * dp
        F_y = 1.0 + self.PPY3 * dp + self.PPY4 * dp * dp
        pairs = (
            ("PKX1 PKX2", 1.0 + self.PPX1 * dp + self.PPX2 * dp * dp),
            ("PDX1 PDX2", F_x),
            ("PKY1", 1.0 + self.PPY1 * dp),
            ("PKY2 PKY5", 1.0 + self.PPY2 * dp),
            ("PDY1 PDY2", F_y),
            ("PKY6 PKY7", 1.0 + self.PPY5 * dp),
            ("QDZ1 QDZ2", 1.0 - self.PPZ1 * dp),
            ("QDZ8 QDZ9", 1.0 + self.PPZ2 * dp),
            ("QSX2", 1.0 + self.PPMX1 * dp),
            ("QSY1 QSY2 QSY3 QSY4 QSY5 QSY6", (1.0 + dp) ** self.QSY8),
            ("C_x", 1.0 + self.PCFX3 * dp),
            ("C_y", 1.0 + self.PCFY3 * dp),
            ("C_z", 1.0 + self.PFZ1 * dp),
        )
        return {key: factor for keys, factor in pairs for key in keys.split()}


_OF_PAC2002 = {"PPMX1": "QPX1", "PPZ1": "QPZ1", "PPZ2": "QPZ2"}  # other names of the same terms
# Coefficients that a factor on the cornering stiffness multiplies, (T14): the slope of F_y and the decay of the trail.
CORNERING_STIFFNESS = ("PKY1", "QBZ1", "QBZ2", "QBZ3", "QBZ9")
# Coefficients that a scaling factor multiplies; ``^2`` marks its square, ``||`` its absolute value.
_SCALES = {
    "LCX": "PCX1",
    "LMUX": "PDX1 PDX2",
    "LEX": "PEX1 PEX2 PEX3",
    "LKX": "PKX1 PKX2",
    "LHX": "PHX1 PHX2",
    "LVX": "PVX1 PVX2",
    "LGAX": "PDX3^2",
    "LCY": "PCY1",
    "LMUY": "PDY1 PDY2 QDZ6 QDZ7 QDZ8 QDZ9 QDZ10 QDZ11",
    "LEY": "PEY1 PEY2",
    "LKY": " ".join(CORNERING_STIFFNESS),
    "LKYC": "PKY6 PKY7 PVY3 PVY4",
    "LKZC": "QDZ8 QDZ9 QDZ10 QDZ11",
    "LHY": "PHY1 PHY2",
    "LVY": "PVY1 PVY2",
    "LGAY": "PDY3^2 PEY4 PKY3|| PHY3 PVY3 PVY4",
    "LTR": "QDZ1 QDZ2",
    "LRES": "QDZ6 QDZ7",
    "LGAZ": "QBZ4 QBZ5|| QDZ3 QDZ3G QDZ4^2 QDZ8 QDZ9 QHZ3 QHZ4 QEZ5",
    "LXAL": "RBX1 RBX3",
    "LYKA": "RBY1 RBY4",
    "LVYKA": "RVY1 RVY2 RVY3",
    "LS": "SSZ1 SSZ2 SSZ3 SSZ4",
    "LMX": "QSX1 QSX2 QSX3 QSX4 QSX10 QSX12 QSX13 QSX14",
    "LVMX": "QSX1",
    "LMY": "QSY1 QSY2 QSY3 QSY4 QSY5 QSY6",
    "LMP": "QCRP1",
}


def _numbers(file: tir.PropertyFile) -> tuple[dict[str, float], dict[str, float]]:
    """Coefficients and scaling factors of the version of the file, by key; 0 and 1 where the file lacks them."""
    raw = {key: file.get(section, key) for section in tir.COEFFICIENTS for key in file.keys(section)}
    scale = {key: file.get(tir.SCALING, key, 1.0) for key in file.keys(tir.SCALING)}
    return raw, scale


def coefficients(file: tir.PropertyFile) -> tuple[MagicFormula, PressureTerms]:
    """Coefficients at the nominal pressure that include every scaling factor, and their pressure terms.

    Raises
    ------
    ValueError
        A factor of load or friction that is not positive; pressure terms and an INFLPRES without a NOMPRES.
    """
    version = file.version
    raw, scale = _numbers(file)
    nominal, inflation = pressures(file)
    c = MagicFormula(
        FNOMIN=file.get("VERTICAL", "FNOMIN"),
        UNLOADED_RADIUS=file.get("DIMENSION", "UNLOADED_RADIUS"),
        LONGVL=file.get("MODEL", "LONGVL"),
        WIDTH=file.get("DIMENSION", "WIDTH"),
        NOMPRES=nominal,
        FITTYP=float(min(version, 61)),
    )
    k = {key: value for key, value in raw.items() if key in c._fields}
    # What a file lacks is 0, but for two exponents.
    if not file.has("LATERAL_COEFFICIENTS", "PKY4"):
        k["PKY4"] = 2.0
    if version == 52:
        k["QSY7"] = 1.0 + raw.get("QSY7", 0.0)  # PAC2002: of a factor on F_z
    elif not file.has("ROLLING_COEFFICIENTS", "QSY7"):
        k["QSY7"] = 1.0
    k["TURN_SLIP"] = float(any(raw.get(key) for key in tir.coefficients("TURNSLIP_COEFFICIENTS", version)))
    if version != 60:  # MF-Tyre takes camber itself here, the book its absolute value
        k["QDZ3G"], k["QDZ3"] = k["QDZ3"], 0.0

    for axis, keys in (("X", ("PVX1", "PVX2")), ("Y", ("PVY1", "PVY2", "PVY3", "PVY4"))):
        mu = k[f"LMU{axis}"] = positive(f"LMU{axis}", scale[f"LMU{axis}"])
        for key in keys:  # vertical shifts fade by (4.E8) of the friction, under 5.2 by the friction itself
            k[key] *= mu if version == 52 else A_MU * mu / (1.0 + (A_MU - 1.0) * mu)
    for key in ("QBZ1", "QBZ2", "QBZ3", "QBZ9"):
        k[key] /= scale["LMUY"]
    for factor, targets in _SCALES.items():
        value = scale.get(factor, 1.0)
        powers = {"": value, "^2": value**2, "||": abs(value)}
        for target in targets.split():
            key = target.removesuffix("^2").removesuffix("||")
            if key in k:
                k[key] *= powers[target[len(key) :]]
    _scale_load(k, version, positive("LFZO", scale["LFZO"]))
    c = c._replace(FNOMIN=c.FNOMIN * scale["LFZO"], **k)

    terms = {key: raw[key] for key in PressureTerms._fields if key in raw}
    terms |= {key: raw[other] for key, other in _OF_PAC2002.items() if other in raw}
    terms["PFZ1"] = file.get("VERTICAL", "PFZ1") or file.get("VERTICAL", "QPFZ1")
    terms |= {key: file.get("STRUCTURAL", key) for key in ("PCFX3", "PCFY3")}
    if not c.NOMPRES > 0.0:
        if any(terms.values()) and inflation > 0.0:
            raise ValueError(f"NOMPRES must be given with pressure terms and INFLPRES, got {c.NOMPRES!r}")
        terms = {}  # nothing tells another pressure than that of the coefficients
    return c, PressureTerms(inflation=c.NOMPRES, **terms)


def pressures(file: tir.PropertyFile) -> tuple[float, float]:
    """Nominal and present inflation pressure [Pa], 0 where the file has none; PAC2002 has keys of its own."""
    nominal, inflation = (
        file.get("OPERATING_CONDITIONS", key) or file.get("TIRE_CONDITIONS", other)
        for key, other in (("NOMPRES", "IP_NOM"), ("INFLPRES", "IP"))
    )
    return nominal, inflation or nominal


def _scale_load(k: dict[str, float], version: int, LFZO: float) -> None:
    """Correct the terms that use the true nominal load, because ``FNOMIN`` becomes the scaled one.

    The book uses the scaled load everywhere; MF-Tyre uses the true one in trail, lever, M_x and M_y.
    """
    if version == 60:
        return
    for key in ("QDZ1", "QDZ2", "SSZ2", "QSX3", "QSX6", "QSX9", "QSX11", "QSY2", "QSY6"):
        if key in k:
            k[key] *= LFZO
    for key in ("QSY1", "QSY2", "QSY3", "QSY4", "QSY5", "QSY6"):
        if key in k:
            k[key] *= LFZO ** (k["QSY7"] - 1.0)


def carcass(file: tir.PropertyFile, c: MagicFormula) -> dict[str, Any]:
    """Relaxation lengths [m] and vertical stiffness [N/m] at the nominal load; only those that the file determines."""
    raw, scale = _numbers(file)
    found = {}
    C_z = file.get("VERTICAL", "VERTICAL_STIFFNESS") * scale["LCZ"]
    F_0 = c.FNOMIN / scale["LFZO"]
    if file.version == 52:
        u = F_0 / c.FNOMIN
        df = u - 1.0
        sigma_x = (raw["PTX1"] + raw["PTX2"] * df) * math.exp(-raw["PTX3"] * df) * c.UNLOADED_RADIUS
        sigma_y = 0.0
        if raw["PTY2"] != 0.0:
            sigma_y = raw["PTY1"] * math.sin(2.0 * math.atan(u / raw["PTY2"])) * c.UNLOADED_RADIUS * scale["LFZO"]
    else:
        C_x, C_y = (file.get("STRUCTURAL", f"{way}_STIFFNESS") for way in ("LONGITUDINAL", "LATERAL"))
        sigma_x = longitudinal_stiffness(c, F_0) / C_x if C_x > 0.0 else 0.0
        sigma_y = cornering_stiffness(c, F_0) / C_y if C_y > 0.0 else 0.0
    for key, value in (
        ("longitudinal_relaxation_length", sigma_x * scale["LSGKP"]),
        ("relaxation_length", sigma_y * scale["LSGAL"]),
        ("vertical_stiffness", C_z),
    ):
        if value != 0.0:
            found[key] = value
    return found
