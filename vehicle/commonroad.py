"""CommonRoad's multi-body parameters as a chassis and a tyre of this package.

The functions only read attributes and do not need the package ``commonroad-vehicle-models``. Its function
``setup_vehicle_parameters(vehicle_id)`` returns suitable parameters for the vehicles 1 to 3.

Axes: CommonRoad uses SAE axes, y to the right and z down. The conversion to ISO 8855 changes the sign of forces, slip
angles and shifts along y, but not of roll and inclination, which are about the same x. CommonRoad's slip is -kappa.

Source: Althoff and Würsching, CommonRoad: Vehicle Models, 2020, tables 6 and 7; the code of version 3.0.2.
"""

from collections.abc import Iterable, Mapping
from typing import Any

from steer_env.friction.numerics.check import number
from steer_env.vehicle.tyre.coefficients import MagicFormula
from steer_env.vehicle.tyre.tyre import Tyre

# Chassis values that CommonRoad's parameters lack; assumed.
ASSUMED = {
    "drag_area": 0.70,  # [m2]
    "compliance_time": 0.005,  # [s]
    "speed_hold_time": 0.1,  # [s]
    "front_bump_clearance": 0.06,  # [m]
    "rear_bump_clearance": 0.07,  # [m]
    "bump_stiffness": 2e5,  # [N/m]
    "rear_bump_steer": 0.0,  # [rad/m]
    "rear_lateral_compliance": 0.0,  # [rad/N]
    "front_lift_area": 0.0,  # [m2]
    "rear_lift_area": 0.0,  # [m2]
}

# Chassis values that CommonRoad has under another name, and the factor between the two.
_RENAMED = {
    "mass": ("m", 1.0),
    "sprung_mass": ("m_s", 1.0),
    "front_unsprung_mass": ("m_uf", 1.0),
    "roll_inertia": ("I_Phi_s", 1.0),
    "pitch_inertia": ("I_y_s", 1.0),
    "yaw_inertia": ("I_z", 1.0),
    "wheel_inertia": ("I_y_w", 1.0),
    "sprung_height": ("h_s", 1.0),
    "front_track": ("T_f", 1.0),
    "rear_track": ("T_r", 1.0),
    "front_spring": ("K_sf", 1.0),
    "rear_spring": ("K_sr", 1.0),
    "front_damper": ("K_sdf", 1.0),
    "rear_damper": ("K_sdr", 1.0),
    "front_anti_roll": ("K_tsf", -1.0),  # negative in CommonRoad where it resists roll
    "rear_anti_roll": ("K_tsr", -1.0),
    "rear_roll_centre": ("h_rar", 1.0),
    "rear_camber_gain": ("D_r", -1.0),  # CommonRoad: inclination of the left wheel over rebound
    "length": ("l", 1.0),
    "width": ("w", 1.0),
}

# Nominal load of the tyre, assumed; it only determines the range of loads that Tyre accepts.
_NOMINAL_LOAD = 4850.0  # [N]
_LINEAR = 1e5  # PKY2 that makes the stiffness linear in load to 1e-9


def _number_at(parameters: Any, path: str) -> float:
    """The number at a dotted path of attributes."""
    value = parameters
    for part in path.split("."):
        value = getattr(value, part, None)
    if value is None:
        raise ValueError(f"parameters.{path} is missing; CommonRoad's multi-body model, so vehicle 1, 2 or 3, has it")
    return number(f"parameters.{path}", value)


def chassis(parameters: Any, changes: Mapping[str, float] | None = None) -> dict[str, float]:
    """The chassis section of a car file.

    Parameters
    ----------
    parameters : object
        CommonRoad's ``VehicleParameters`` of vehicle 1, 2 or 3, or anything with the same attributes.
    changes : mapping of chassis keys to numbers, optional
        Values that replace them [SI].

    Returns
    -------
    dict of str to float
        As :mod:`steer_env.vehicle.cars` takes it: CommonRoad's values, then ``ASSUMED``, then the changes [SI].

    Raises
    ------
    ValueError
        An attribute that is missing, None or not a finite number, or a change of an unknown key, named.

    ``front_axle`` and ``rear_axle`` refer to the centre of gravity of the whole car, ``a`` and ``b`` to the sprung one.
    Left out: ``h_raf`` and ``D_f``, which the strut replaces; ``K_ras``, ``K_rad``, ``K_lt``, ``E_f``, ``E_r``.
    """
    known = {key: factor * _number_at(parameters, name) + 0.0 for key, (name, factor) in _RENAMED.items()} | ASSUMED
    a, b, m, m_uf, m_ur = (_number_at(parameters, name) for name in ("a", "b", "m", "m_uf", "m_ur"))
    ahead = (m_uf * a - m_ur * b) / m  # position of the centre of gravity of the whole car ahead of the sprung one
    known |= {"front_axle": a - ahead, "rear_axle": b + ahead}
    for key in changes or {}:
        if key not in known:
            raise ValueError(f"changes has no chassis key {key!r}; it takes: {', '.join(known)}")
    return known | dict(changes or {})


def car_data(
    parameters: Any,
    name: str,
    *,
    description: str,
    source: str,
    sections: Mapping[str, Mapping[str, Any]],
    assumed: Iterable[str] = (),
    changes: Mapping[str, float] | None = None,
    tyre: str = "pacejka_2006_205_60r15",
    strut: str = "s1",
) -> dict[str, Any]:
    """The contents of a car file from CommonRoad's parameters.

    Parameters
    ----------
    parameters, changes
        As in :func:`chassis`.
    name, description, source : str
        As in the file.
    sections : mapping of str to mapping
        ``steering``, which CommonRoad lacks, and values other than the defaults in ``column``, ``assist``,
        ``drivetrain``, ``brakes`` and ``speed_hold`` [SI]. The front share of the drive is CommonRoad's.
    assumed : iterable of str
        Further keys without a source, besides those of ``ASSUMED``.
    tyre, strut : str
        Names of packaged sets.

    Raises
    ------
    ValueError
        As in :func:`chassis`; ``steer_env.vehicle.cars.from_data`` checks the rest.
    """
    empty: dict[str, Any] = {"steering": {}, "column": {}, "assist": {}, "drivetrain": {}, "brakes": {}}
    return {
        "name": name,
        "description": description,
        "source": source,
        "assumed": [*ASSUMED, *assumed],
        "tyre": tyre,
        "strut": strut,
        "chassis": chassis(parameters, changes),
        **empty,
        "speed_hold": {},
        **{key: dict(section) for key, section in sections.items()},
        "drivetrain": {"front_share": _number_at(parameters, "T_se"), **sections.get("drivetrain", {})},
    }


def tyre(parameters: Any, relaxation_length: float = 0.55) -> Tyre:
    """CommonRoad's tyre as a Magic Formula of this package, as it acts in CommonRoad's model.

    F_y0 = D sin(C atan(curve(B (alpha - p_hy3 gamma)))) - p_vy3 F_z gamma in ISO 8855, with K_y = p_ky1 F_z.

    Parameters
    ----------
    parameters : object
        As in :func:`chassis`; its ``tire``, ``K_zt`` and ``R_w`` are read.
    relaxation_length : float
        Along both slips, assumed [m]; CommonRoad's tyre has none, so that a comparison needs a short one.

    Returns
    -------
    Tyre
        Its forces equal CommonRoad's to 1e-8 where ``p_hx1 = p_vx1 = p_hy1 = p_vy1 = 0``; moments are zero there too.

    Raises
    ------
    ValueError
        An attribute that is missing, None or not finite; ``p_ky1`` not negative.

    Deviations: the four constants are left out. In CommonRoad's code ``p_vx1`` is inside the sine, and ``p_hy1`` and
    ``p_vy1`` are multiplied by sign(gamma), a jump where the wheel is upright; ``p_hx1`` goes with ``p_vx1``. Camber
    thrust keeps the direction that it has in CommonRoad's model, *against* the inclination of the wheel: the
    coefficients of the set belong to axes with y to the left and are used with y to the right.
    """

    def of(name: str) -> float:
        return _number_at(parameters, f"tire.{name}")

    coefficients = MagicFormula(
        FNOMIN=_NOMINAL_LOAD,
        UNLOADED_RADIUS=_number_at(parameters, "R_w"),
        LONGVL=16.7,  # assumed; used only in M_y, which is zero
        FITTYP=52.0,
        PCX1=of("p_cx1"),
        PDX1=of("p_dx1"),
        PDX3=of("p_dx3"),
        PEX1=of("p_ex1"),
        PKX1=of("p_kx1"),
        RBX1=of("r_bx1"),
        RBX2=of("r_bx2"),
        RCX1=of("r_cx1"),
        REX1=of("r_ex1"),
        RHX1=-of("r_hx1"),
        PCY1=of("p_cy1"),
        PDY1=of("p_dy1"),
        PDY3=of("p_dy3"),
        PEY1=of("p_ey1"),
        PKY1=0.5 * of("p_ky1") * _LINEAR,
        PKY2=_LINEAR,
        PHY3=-of("p_hy3"),
        PVY3=-of("p_vy3"),
        RBY1=of("r_by1"),
        RBY2=of("r_by2"),
        RBY3=-of("r_by3"),
        RCY1=of("r_cy1"),
        REY1=of("r_ey1"),
        RHY1=-of("r_hy1"),
        # Two changes of sign, those of F_y and of kappa, cancel in S_Vyk.
        RVY1=of("r_vy1"),
        RVY3=of("r_vy3"),
        RVY4=of("r_vy4"),
        RVY5=of("r_vy5"),
        RVY6=of("r_vy6"),
    )
    return Tyre(
        "commonroad",
        "ADAMS handbook, as printed in CommonRoad: Vehicle Models, 2020, table 7",
        coefficients,
        relaxation_length=relaxation_length,
        longitudinal_relaxation_length=relaxation_length,
        vertical_stiffness=_number_at(parameters, "K_zt"),
    )
