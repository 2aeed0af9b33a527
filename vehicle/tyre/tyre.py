"""A tyre for users: checked inputs, symmetry, inflation pressure, packaged sets and property files.

The equations are kernels on flat coefficients in ``magic_formula``. A property file also
has scaling factors and pressure terms. Both are multiplied into the coefficients when a tyre is made, so that they cost
nothing in a simulation.
"""

import json
import math
import os
from collections.abc import Mapping
from dataclasses import dataclass, field, fields, replace
from functools import cache
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from steer_env.friction.numerics.check import construct, number, positive, warn_once
from steer_env.friction.numerics.kernel import kernel
from steer_env.vehicle.tyre import scaling, tir
from steer_env.vehicle.tyre.coefficients import ASYMMETRY, MagicFormula, record
from steer_env.vehicle.tyre.magic_formula import (
    cornering_stiffness,
    forces,
    longitudinal_stiffness,
)
from steer_env.vehicle.tyre.scaling import PressureTerms


@kernel
def _forces_of_arrays(c, kappa, alpha, camber, F_z, v_x, mu, turn_slip, out):
    for i in range(out.shape[1]):
        out[:, i] = forces(c[0], kappa[i], alpha[i], camber[i], F_z[i], v_x[i], mu[i], turn_slip[i])


class TyreFile(UserWarning):
    """What a property file has that this model does not use, or that another program reads otherwise."""


class Limits(NamedTuple):
    """Largest magnitudes of the inputs of :meth:`Tyre.forces`; assumed, except where a property file names ranges.

    :meth:`Tyre.forces` also takes smaller loads than the lowest, because a wheel may lift; :meth:`Tyre.beyond` tells of
    them.
    """

    kappa: float = 1.5  # longitudinal slip [-]
    alpha: float = 1.5  # slip angle [rad]
    camber: float = 0.2618  # 15 degrees; beyond, the fitted growth of friction by camber is not plausible [rad]
    load: float = 3.0  # F_z over FNOMIN; beyond, the quadratics in df change direction [-]
    v_x_low: float = 1.0  # slip has no meaning at standstill [m/s]
    v_x_high: float = 100.0  # [m/s]
    turn_slip: float = 10.0  # a turn on a radius of 0.1 m [1/m]
    load_low: float = 0.0  # lowest F_z over FNOMIN of the measurements [-]


BEYOND_TYRE = "beyond_tyre"  # key of the meta of a recording with a list of mappings, the fields of :class:`Beyond`


class Beyond(NamedTuple):
    """Values of a car's tyres outside the range of the tyre, in SI units."""

    tyre: str
    quantity: str  # a key of ``_QUANTITIES``
    lowest: float  # of all values [N, 1 or rad]
    largest: float  # of all values [N, 1 or rad]
    low: float  # of the range [N, 1 or rad]
    high: float  # of the range [N, 1 or rad]
    share: float  # of the values outside it [1]

    @property
    def words(self) -> str:
        """The same as a clause."""
        name, unit, declared = _QUANTITIES[self.quantity]
        return (
            f"{name} from {self.lowest:.4g} to {self.largest:.4g}{unit}, {100.0 * self.share:.3g} % of them beyond the "
            f"range of {self.tyre}, {self.low:.4g} to {self.high:.4g}{unit} ({declared}): its forces there are "
            "extrapolated"
        )


_QUANTITIES = {
    "F_z": ("wheel loads", " N", "FZMIN and FZMAX, at most 3 FNOMIN"),
    "kappa": ("longitudinal slips", "", "KPUMIN and KPUMAX, at most 1.5"),
    "alpha": ("slip angles", " rad", "ALPMIN and ALPMAX, at most 1.5 rad"),
}


@dataclass(frozen=True)
class Tyre:
    """Coefficients, their source, and the further parameters of a transient model.

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
    pressure: PressureTerms = field(default_factory=PressureTerms)

    def __post_init__(self) -> None:
        c = self.coefficients
        for key, value in c._asdict().items():
            number(key, value)
        if c.FITTYP not in (52.0, 60.0, 61.0):
            raise ValueError(f"FITTYP must be 52, 60 or 61, got {c.FITTYP!r}")
        for key in ("FNOMIN", "UNLOADED_RADIUS", "LONGVL", "PCX1", "PDX1", "PKX1", "PCY1", "PKY2"):
            positive(key, getattr(c, key))
        for key in ("relaxation_length", "longitudinal_relaxation_length", "vertical_stiffness"):
            positive(key, getattr(self, key))
        # Limits of a plausible tyre, which a file in wrong units exceeds.
        number("UNLOADED_RADIUS", c.UNLOADED_RADIUS, minimum=0.05, maximum=2.0)
        for key, value in (("PDX1", c.PDX1), ("|PDY1|", abs(c.PDY1))):
            number(key, value, minimum=0.05, maximum=5.0)
        if c.PKY1 * math.sin(c.PKY4 * math.atan(1.0 / c.PKY2)) >= 0.0:
            raise ValueError(f"PKY1 must be negative (ISO 8855: alpha > 0 gives F_y < 0), got {c.PKY1!r}")

    def _scale_asymmetry(self, factor: float) -> "Tyre":
        c = self.coefficients
        scaled = {key: factor * getattr(c, key) + 0.0 for key in ASYMMETRY}  # + 0.0: no negative zeros
        return replace(self, coefficients=c._replace(**scaled))

    def symmetric(self) -> "Tyre":
        """This tyre without :data:`ASYMMETRY`: F_y, M_x, M_z exactly odd and F_x, M_y exactly even in (alpha, camber).

        PHX and PVX remain, and with them a drag at kappa = 0: they shift kappa and do not distinguish left from right.
        """
        return self._scale_asymmetry(0.0)

    def mirrored(self) -> "Tyre":
        """The same tyre on the other side: its F_y(alpha, camber) is exactly -F_y(-alpha, -camber) of this one."""
        return self._scale_asymmetry(-1.0)

    def at_pressure(self, p: float) -> "Tyre":
        """This tyre at inflation pressure ``p`` [Pa]: coefficients, relaxation lengths and vertical stiffness.

        Raises
        ------
        ValueError
            ``p`` is not positive, the tyre names no pressure, or ``p`` changes the sign of a coefficient.
        """
        p = positive("inflation pressure [Pa]", p)
        c, now = self.coefficients, self.pressure.inflation
        if not (c.NOMPRES > 0.0 and now > 0.0):
            raise ValueError(f"{self.name} has no nominal inflation pressure, so none can be chosen")
        if not any(self.pressure[1:]) and p != now:
            raise ValueError(f"{self.name} has no pressure terms: it holds at {now:g} Pa only, got {p:g}")
        old, new = (self.pressure.factors(each / c.NOMPRES - 1.0) for each in (now, p))
        for key, factor in (old | new).items():
            if not (new[key] > 0.0 and old[key] > 0.0):
                raise ValueError(
                    f"inflation pressure {p:g} Pa is outside the fit of {self.name}: factor {factor:g} of {key}"
                )
        ratio = {key: new[key] / old[key] for key in new}
        return replace(
            self,
            coefficients=c._replace(**{k: getattr(c, k) * f for k, f in ratio.items() if not k.startswith("C_")}),
            relaxation_length=self.relaxation_length * _stiffness_ratio(c, ratio) / ratio["C_y"],
            longitudinal_relaxation_length=self.longitudinal_relaxation_length * ratio["PKX1"] / ratio["C_x"],
            vertical_stiffness=self.vertical_stiffness * ratio["C_z"],
            pressure=self.pressure._replace(inflation=p),
        )

    def beyond(self, quantity: str, values: ArrayLike) -> Beyond | None:
        """What of ``F_z`` [N], ``kappa`` [-] or ``alpha`` [rad] is outside :attr:`limits`; None if nothing is.

        No force of a car is refused for it, because a step has to give one: the formula is extrapolated.
        """
        top, found = self.limits, np.asarray(values, dtype=float)
        F_0 = self.coefficients.FNOMIN
        low, high = {
            "F_z": (top.load_low * F_0, top.load * F_0),
            "kappa": (-top.kappa, top.kappa),
            "alpha": (-top.alpha, top.alpha),
        }[quantity]
        rounding = 1e-9 * high  # of a range that was divided by the nominal load
        outside = (found < low - rounding) | (found > high + rounding)
        if not outside.any():
            return None
        share = float(outside.mean())
        return Beyond(self.name, quantity, float(found.min()), float(found.max()), low, high, share)

    def forces(
        self,
        kappa: ArrayLike,
        alpha: ArrayLike,
        camber: ArrayLike,
        F_z: ArrayLike,
        v_x: ArrayLike,
        mu: ArrayLike = 1.0,
        turn_slip: ArrayLike = 0.0,
    ) -> tuple[np.ndarray, ...]:
        """Steady-state forces and moments of the road on the tyre, ISO 8855.

        Parameters
        ----------
        kappa, alpha : float or array
            Slip ``(omega R_e - v_x)/|v_x|``, -1 for a locked wheel [-], and slip angle ``atan(v_y/|v_x|)`` [rad].
        camber : float or array
            Inclination about x, positive where the top leans to the right [rad].
        F_z, v_x : float or array
            Load [N], and speed along x [m/s], of which the sign matters, and the magnitude in the rolling resistance.
        mu : float or array
            Friction of the road over that of the measurements [-]; it scales the peaks of F_x, F_y and M_zr.
        turn_slip : float or array
            Yaw rate of the wheel over ``|v_x|``, positive turning left [1/m]; without effect if its coefficients are 0.

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
        arrays = [np.asarray(value, dtype=float) for value in (kappa, alpha, camber, F_z, v_x, mu, turn_slip)]
        for name, value, low, high, unit in (
            ("kappa", arrays[0], -top.kappa, top.kappa, ""),
            ("alpha", arrays[1], -top.alpha, top.alpha, " rad"),
            ("camber", arrays[2], -top.camber, top.camber, " rad"),
            ("F_z", arrays[3], 0.0, top.load * self.coefficients.FNOMIN, " N"),
            ("|v_x|", np.abs(arrays[4]), top.v_x_low, top.v_x_high, " m/s"),
            ("mu", arrays[5], 0.01, 2.0, ""),
            ("turn_slip", arrays[6], -top.turn_slip, top.turn_slip, " 1/m"),
        ):
            wrong = value[~((value >= low) & (value <= high))]  # NaN is wrong too
            if wrong.size:
                raise ValueError(f"{name} must be within {low:g} to {high:g}{unit}, got {float(wrong[0])!r}")
        shape = np.broadcast_shapes(*(array.shape for array in arrays))
        out = np.empty((5, math.prod(shape)))
        _forces_of_arrays(record(self.coefficients), *(np.broadcast_to(array, shape).ravel() for array in arrays), out)
        return tuple(out.reshape(5, *shape))


def _stiffness_ratio(c: MagicFormula, ratio: dict[str, float]) -> float:
    """Ratio by which pressure changes the cornering stiffness at the nominal load."""
    changed = c._replace(PKY1=c.PKY1 * ratio["PKY1"], PKY2=c.PKY2 * ratio["PKY2"])
    return cornering_stiffness(changed, c.FNOMIN) / cornering_stiffness(c, c.FNOMIN)


def from_file(file: tir.PropertyFile, name: str = "tyre") -> Tyre:
    """The tyre that a property file describes, at its inflation pressure (INFLPRES, else NOMPRES; IP and IP_NOM).

    The coefficients include the scaling factors. Relaxation lengths are those at the nominal load: by PTX and PTY under
    5.2, otherwise cornering and slip stiffness over the stiffness of the carcass. Ranges become :class:`Limits` where
    they are narrower than those of the equations. Values that are absent or 0 keep the defaults of :class:`Tyre`.

    Raises
    ------
    ValueError
        Coefficients that :class:`Tyre` refuses; pressure terms and INFLPRES without a NOMPRES; a key that the
        equations of the file do not use, with what it would change.

    Warns
    -----
    TyreFile
        What the file has without effect, and what another program reads otherwise, each text once in a process.
    """
    for section, key in (("VERTICAL", "FNOMIN"), ("DIMENSION", "UNLOADED_RADIUS")):
        positive(key, file.get(section, key))
    try:
        tyre = _from_file(file, name)
        unused = [*file.notes, *_without_effect(file, tyre)]
    except OverflowError:  # of a power, or the exponential function; products become infinite, which Tyre refuses
        raise ValueError("a coefficient with its scaling factors is too large for a number of the computer") from None
    if unused:
        more = f" and {len(unused) - _NAMED} more" if len(unused) > _NAMED else ""
        warn_once(f"{name}: without effect here: {', '.join(unused[:_NAMED])}{more}", TyreFile, stacklevel=2)
    for text in _differences(file, tyre):
        warn_once(f"{name}: {text}", TyreFile, stacklevel=2)
    return tyre


_NAMED = 12  # keys that a warning names


def _from_file(file: tir.PropertyFile, name: str) -> Tyre:
    c, pressure = scaling.coefficients(file)
    tyre = Tyre(
        name,
        f"property file, FITTYP {file.version}, measured on side {file.sections['MODEL'].get('TYRESIDE', 'unknown')}",
        c,
        _limits(file, c),
        pressure=pressure,
        **scaling.carcass(file, c),
    )
    inflation = scaling.pressures(file)[1]
    return tyre.at_pressure(inflation) if inflation > 0.0 and any(pressure[1:]) else tyre


def _limits(file: tir.PropertyFile, c: MagicFormula) -> Limits:
    """The ranges of a file, by magnitude, but within the defaults, which bound tan(alpha), camber and load."""
    most = Limits()

    def given(*keys: str) -> list[float]:
        return sorted(abs(value) for key in keys if (value := file.get(tir.home(key), key)) != 0.0)

    loads, largest = given("FZMIN", "FZMAX"), given("FZMAX")
    return most._replace(
        kappa=min([*given("KPUMIN", "KPUMAX"), most.kappa]),
        alpha=min([*given("ALPMIN", "ALPMAX"), most.alpha]),
        camber=min([*given("CAMMIN", "CAMMAX"), most.camber]),
        load=min(loads[-1] / c.FNOMIN, most.load) if largest else most.load,
        load_low=loads[0] / c.FNOMIN if given("FZMIN") else most.load_low,
    )


# What a property file has that its equations do not use


def _without_effect(file: tir.PropertyFile, tyre: Tyre) -> list[str]:
    """Keys that are foreign to the equations of a file and change no force; ValueError for one that does."""
    if str(file.sections["MODEL"].get("FE_METHOD", "")).upper() == "YES":
        reached = f"the forces by the weights reach {_over_ellipse(tyre):.2f} of such an ellipse"
        message = "expected 'NO', because the weights G combine the slips, not a friction ellipse; got 'YES'"
        raise ValueError(f"{file.places.get(('MODEL', 'FE_METHOD'), '')}FE_METHOD: {message}; {reached}")
    found = []
    for each in file.foreign:
        effect = _effect(file, each)
        if effect:
            message = f"expected {each.neutral:g}, because the equations of version {file.version} do not use it"
            where = file.places.get((each.section, each.key), "")
            raise ValueError(f"{where}{each.key}: {message}; got {each.value:g}, which would change {effect}")
        found.append(f"{each.key} = {each.value:g}")
    if not tyre.pressure.inflation > 0.0:
        keys = [key for section in file.sections for key in _PRESSURE_KEYS if file.get(section, key) != 0.0]
        found += [f"{key}, as the file has no nominal pressure" for key in keys]
    return found


_PRESSURE_KEYS = (*PressureTerms._fields[1:], "QPX1", "QPZ1", "QPZ2", "QPFZ1")
# Keys whose effect needs no other equations: what they multiply.
_MULTIPLIES = dict.fromkeys(("LKG", "LKYG"), ("PHY3", "PVY3", "PVY4", "PKY6", "PKY7")) | {"LIP": ("NOMPRES", "IP_NOM")}
_NOT_OF_FORCES = ("LGYR", "PTX4", "PTY3")  # gyroscopic couple; damping of ADAMS at low speed


def _effect(file: tir.PropertyFile, foreign: tir.Foreign) -> str:
    """What a key would change, by the equations that have it; empty if nothing.

    The first of the nominal load, half of it and 1.5 times it at which it changes something is told.
    """
    section, key, value, neutral = foreign
    mu = 1.0
    if key in _NOT_OF_FORCES:
        return ""
    if key in _MULTIPLIES:
        factors = dict.fromkeys(_MULTIPLIES[key], value)
        other = {n: {k: _times(v, factors.get(k)) for k, v in e.items()} for n, e in file.sections.items()}
        pair = [file, replace(file, sections=other)]
    elif key == "LMUV":
        pair, mu = [file, file], 1.0 / (1.0 + value)  # where the sliding speed is LONGVL, (4.E7)
    else:
        version = next(v for v in (52, 61, 60) if key in tir.coefficients(section, v, pac2002=True))
        model = {**file.sections["MODEL"], "PROPERTY_FILE_FORMAT": "PAC2002"}
        pair = [
            replace(file, version=version, sections={**file.sections, "MODEL": model, section: {**entries, key: each}})
            for entries in (file.sections[section],)
            for each in (neutral, value)
        ]
    F_0 = file.get("VERTICAL", "FNOMIN")
    slips = np.meshgrid((-0.1, 0.0, 0.1), (-0.1, -0.02, 0.0, 0.02, 0.1), (-0.05, 0.0, 0.05), (0.0, 0.1))
    kappa, alpha, camber, turn = slips
    try:
        tyres = [replace(_from_file(each, "tyre"), limits=Limits()) for each in pair]
        v_x = min(max(tyres[0].coefficients.LONGVL, 1.0), 100.0)
        for load in (F_0, 0.5 * F_0, 1.5 * F_0):
            before = np.array(tyres[0].forces(kappa, alpha, camber, load, v_x, 1.0, turn))
            changes = np.abs(tyres[1].forces(kappa, alpha, camber, load, v_x, mu, turn) - before)
            largest = changes.reshape(len(_FORCES), -1).max(axis=1)
            if not np.isfinite(largest).all():
                return f"forces to what is no number at {load:g} N"
            told = [f"{name} by up to {most:.3g} {unit}" for (name, unit), most in zip(_FORCES, largest) if most > 0.0]
            if told:
                return f"{', '.join(told)} at {load:g} N"
    except (ValueError, ArithmeticError) as problem:
        return f"the tyre to one that is refused: {problem}"
    return ""


_FORCES = (("F_x", "N"), ("F_y", "N"), ("M_x", "N m"), ("M_y", "N m"), ("M_z", "N m"))


def _times(value: Any, factor: float | None) -> Any:
    return value if factor is None or not isinstance(value, float) else factor * value


def _over_ellipse(tyre: Tyre) -> float:
    """The largest share of an ellipse through the peaks of F_x and F_y that the combined forces reach at FNOMIN [1]."""
    slips = np.linspace(-0.3, 0.3, 61)
    free = replace(tyre, limits=Limits())
    kappa, alpha = np.meshgrid(slips, slips)
    F_x, F_y = free.forces(kappa, alpha, 0.0, tyre.coefficients.FNOMIN, 20.0)[:2]
    middle = slips.size // 2
    return float(np.hypot(F_x / np.abs(F_x[middle]).max(), F_y / np.abs(F_y[:, middle]).max()).max())


def _differences(file: tir.PropertyFile, tyre: Tyre) -> list[str]:
    """What a file has whose meaning is not the same in every program, or that lies beyond its own range."""
    c, told = tyre.coefficients, []
    if c.LMUY != 1.0:
        stiffness = cornering_stiffness(c, c.FNOMIN)
        told.append(
            f"LMUY = {c.LMUY:g} scales the peak of F_y and leaves the cornering stiffness, {stiffness:.4g} N/rad at "
            f"{c.FNOMIN:g} N, as in the book; Project Chrono multiplies that by LMUY too, which makes it "
            f"{c.LMUY * stiffness:.4g} N/rad"
        )
    couple = math.prod(
        file.get(section, key, neutral)
        for section, key, neutral in (
            ("ALIGNING_COEFFICIENTS", "QTZ1", 0.0),
            ("ALIGNING_COEFFICIENTS", "MBELT", 0.0),
            (tir.SCALING, "LGYR", 1.0),
        )
    )
    if couple:
        told.append(
            f"the gyroscopic couple by QTZ1 and MBELT, {couple:.3g} N m for each m/s of speed and m/s of lateral "
            "deflection rate, is not computed"
        )
    low, high = (file.get("INFLATION_PRESSURE_RANGE", key) for key in ("PRESMIN", "PRESMAX"))
    p = scaling.pressures(file)[1]
    if p > 0.0 and not low <= p <= (high or p):
        told.append(f"the inflation pressure {p:g} Pa is beyond PRESMIN and PRESMAX, {low:g} to {high:g} Pa")
    return told


def to_file(tyre: Tyre) -> tir.PropertyFile:
    """A property file of the present coefficients, with every scaling factor 1, in SI units.

    The coefficients already include the pressure terms: the nominal pressure of the file is the present one.

    Raises
    ------
    ValueError
        A tyre whose file scaled the friction: no file can express how its vertical shifts fade.
    """
    c = tyre.coefficients
    version = 62 if c.TURN_SLIP and c.FITTYP == 61.0 else int(c.FITTYP)
    if (c.LMUX, c.LMUY) != (1.0, 1.0):
        raise ValueError(f"{tyre.name} has LMUX or LMUY in its coefficients: copy its property file instead")
    values = c._asdict()
    if version != 60:
        values["QDZ3"] = c.QDZ3G
    R_0, top, p = c.UNLOADED_RADIUS, tyre.limits, tyre.pressure.inflation
    if version == 52:  # PTY2 = 1 puts the peak of the sine at the nominal load
        values |= {"PTX1": tyre.longitudinal_relaxation_length / R_0, "PTY1": tyre.relaxation_length / R_0, "PTY2": 1.0}
        values["QSY7"] = c.QSY7 - 1.0
    sections: dict[str, dict[str, Any]] = {
        "MDI_HEADER": {"FILE_TYPE": "tir", "FILE_VERSION": 3.0, "FILE_FORMAT": "ASCII"},
        "UNITS": {"LENGTH": "meter", "FORCE": "newton", "ANGLE": "radians", "MASS": "kg", "TIME": "second"},
        "MODEL": {"FITTYP": float(version), "TYRESIDE": "LEFT", "LONGVL": c.LONGVL},
        "DIMENSION": {"UNLOADED_RADIUS": R_0, "WIDTH": c.WIDTH},
        "OPERATING_CONDITIONS": {"INFLPRES": p, "NOMPRES": p} if p > 0.0 else {},
        "VERTICAL": {"FNOMIN": c.FNOMIN, "VERTICAL_STIFFNESS": tyre.vertical_stiffness},
        "STRUCTURAL": {
            "LONGITUDINAL_STIFFNESS": longitudinal_stiffness(c, c.FNOMIN) / tyre.longitudinal_relaxation_length,
            "LATERAL_STIFFNESS": cornering_stiffness(c, c.FNOMIN) / tyre.relaxation_length,
        },
        "VERTICAL_FORCE_RANGE": {"FZMIN": top.load_low * c.FNOMIN, "FZMAX": top.load * c.FNOMIN},
        "LONG_SLIP_RANGE": {"KPUMIN": -top.kappa, "KPUMAX": top.kappa},
        "SLIP_ANGLE_RANGE": {"ALPMIN": -top.alpha, "ALPMAX": top.alpha},
        "INCLINATION_ANGLE_RANGE": {"CAMMIN": -top.camber, "CAMMAX": top.camber},
        tir.SCALING: dict.fromkeys(tir.coefficients(tir.SCALING, version), 1.0),
    }
    for section in tir.COEFFICIENTS:
        keys = tir.coefficients(section, version, pac2002=True)
        sections[section] = {key: values.get(key, 0.0) for key in keys}
    if version == 52:
        sections["MODEL"]["PROPERTY_FILE_FORMAT"] = "PAC2002"
        del sections["STRUCTURAL"]
    return tir.PropertyFile(version, {name: entries for name, entries in sections.items() if entries})


def save(tyre: Tyre, path: str | os.PathLike) -> None:
    """Write a tyre as a property file ``*.tir``: :func:`tir.write` of :func:`to_file`, with their errors."""
    if not os.fspath(path).lower().endswith(".tir"):
        raise ValueError(f"path must end in .tir, got {os.fspath(path)!r}")
    tir.write(path, to_file(tyre))


_TYRE_PARTS: dict[str, Any] = {"coefficients": MagicFormula, "limits": Limits, "pressure": PressureTerms}


def data(tyre: Tyre) -> str | dict[str, Any]:
    """A tyre as :func:`load` takes it: the name of a packaged one, else a mapping with every number of it.

    ``load(data(tyre)) == tyre``; the mapping holds text and numbers only, as JSON and TOML do.
    """
    if tyre.name in _packaged_files() and load(tyre.name) == tyre:
        return tyre.name
    parts: dict[str, Any] = {each.name: getattr(tyre, each.name) for each in fields(tyre)}
    return {name: value._asdict() if name in _TYRE_PARTS else value for name, value in parts.items()}


def _from_data(given: Mapping[str, Any]) -> Tyre:
    """A tyre from a mapping as :func:`data` gives it; ValueError names a key that is unknown, missing or no number."""
    made = dict(given)
    for part, kind in _TYRE_PARTS.items():
        if part in given:
            if not isinstance(given[part], Mapping):
                raise ValueError(f"tyre.{part} must hold keys and values, got {given[part]!r}")
            values = {key: number(f"tyre.{part}.{key}", value) for key, value in given[part].items()}
            made[part] = construct(f"tyre.{part}", kind, values)
    for key in ("name", "source"):
        if not isinstance(made.get(key, ""), str):
            raise ValueError(f"tyre.{key} must be text, got {made[key]!r}")
    return construct("tyre", Tyre, made)


TYRE_FOLDER = Path(__file__).parents[1] / "data" / "tyres"
EXAMPLES = ("example_mf52", "example_mf61", "example_mf62")  # of the formats: plausible numbers that nobody measured


@cache
def _packaged_files() -> dict[str, Path]:
    return {file.stem: file for file in sorted(TYRE_FOLDER.iterdir()) if file.suffix in (".json", ".tir")}


def available() -> tuple[str, ...]:
    """Names of the packaged tyres, without ``EXAMPLES``."""
    return tuple(name for name in _packaged_files() if name not in EXAMPLES)


@cache
def _from_json(path: Path) -> Tyre:
    """A packaged tyre, read once: every car that is changed asks for its own."""
    data = json.loads(path.read_text(encoding="utf-8"))
    coefficients = MagicFormula(**{key: float(value) for key, value in data["coefficients"].items()})
    return Tyre(path.stem, data["source"], coefficients, pressure=PressureTerms(inflation=coefficients.NOMPRES))


def load(name: str | os.PathLike | Mapping[str, Any] = "pacejka_2006_205_60r15", symmetric: bool = False) -> Tyre:
    """A packaged tyre by its name, one from a property file by its path, which ends in ``.tir``, or from :func:`data`.

    ``symmetric`` as in :meth:`Tyre.symmetric`.

    Raises
    ------
    ValueError
        Unknown name; a file that :func:`tir.read` or :func:`from_file` refuses.
    OSError
        No such file.
    """
    if isinstance(name, Mapping):
        return _from_data(name).symmetric() if symmetric else _from_data(name)
    name = os.fspath(name)
    path = Path(name) if name.lower().endswith(".tir") else _packaged_files().get(name)
    if path is None:
        raise ValueError(
            f"tyre must be one of {', '.join(available())}, got {name!r}; "
            f"or an example of the formats, {', '.join(EXAMPLES)}, or a path that ends in .tir"
        )
    if path.suffix == ".json":
        tyre = _from_json(path)
    else:
        file = tir.read(path)
        try:
            tyre = from_file(file, path.stem)
        except ValueError as problem:
            told = str(problem).startswith(f"{path}:")
            raise ValueError(str(problem) if told else f"{name}: {problem}") from None
    return tyre.symmetric() if symmetric else tyre
