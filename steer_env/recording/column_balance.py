"""The friction of a car's steering column from what a car measures, by the balance of torques below the torsion bar.

    T_F = T_tb + C_tb (th1' - th2') + T_motor - r_p F_rack - I2 th2'' - C2 th2'            from (C2)

Nothing of this can be left out: without the torque of the motor and the force of the rack, what remains is mostly
theirs. Angles are differentiated after a low-pass, the torques stay as they are.
"""

from collections.abc import Collection

import numpy as np

from steer_env.recording.friction_checks import Array
from steer_env.recording.friction_record import CUTOFF, FrictionRecord, checked, uniform
from steer_env.recording.recording import Recording, low_passed
from steer_env.vehicle.cars import Car

MAY_BE_ZERO = {"motor_torque": "the assist is off", "rack_force": "the tie rods are off the rack"}


def separated(
    recording: Recording,
    car: Car,
    *,
    zero: Collection[str] = (),
    sign: int | None = None,
    without_drift: bool = False,
    cutoff_hz: float = CUTOFF,
) -> FrictionRecord:
    """The friction of a column over its angle, with the force of the rack as load.

    Parameters
    ----------
    recording : Recording
        With column_angle, or handwheel_angle; torsion_bar_torque, or handwheel_torque with handwheel_angle;
        motor_torque, at the column; and rack_force. Left is positive.
    car : Car
        Inertias, damping, torsion bar and pinion.
    zero : collection of str
        Those of ``MAY_BE_ZERO`` that are known to be zero in this record.
    sign, without_drift, cutoff_hz
        As for :func:`steer_env.recording.friction_record.from_recording`.

    Raises
    ------
    ValueError
        For missing channels, with why each is needed; and as ``from_recording``.
    """
    for name in zero:
        if name not in MAY_BE_ZERO:
            raise ValueError(f"--zero takes {' and '.join(MAY_BE_ZERO)}, got {name!r}")
    missing = _missing(recording, zero)
    if missing:
        raise ValueError(f"the friction of a column cannot be separated: {'; '.join(missing)}")
    recording, notes = uniform(recording.without(*(name for name in recording.channels if name not in _USED)))
    c, dt = car.column, 1.0 / recording.rate

    def smooth(name: str, values: Array) -> Array:
        return low_passed(name, values, cutoff_hz, recording.rate)

    if "torsion_bar_torque" in recording.channels:
        bar = recording["torsion_bar_torque"]
    else:
        speed = np.gradient(smooth("handwheel_angle", recording["handwheel_angle"]), dt)
        bar = recording["handwheel_torque"] - c.I1 * np.gradient(speed, dt) - c.C1 * speed  # (C1)
        notes += (
            "the torsion bar's torque is that of the hands less the inertia of the handwheel: friction above the bar "
            "cannot be told from friction below it, and is in the friction",
        )
    if "column_angle" in recording.channels:
        angle = recording["column_angle"]
    else:
        angle = recording["handwheel_angle"] - bar / c.K_tb
        notes += ("the angle of the column is that of the handwheel less the twist of the torsion bar",)
    twist_speed = np.gradient(smooth("torsion_bar_torque", bar), dt) / c.K_tb
    speed = np.gradient(smooth("column_angle", angle), dt)
    none = np.zeros_like(bar)
    motor, rack = (none if name in zero else recording[name] for name in MAY_BE_ZERO)
    friction = (
        bar
        + c.C_tb * twist_speed
        + motor
        - car.steering["pinion_radius"] * rack
        - c.I2 * np.gradient(speed, dt)
        - c.C2 * speed
    )  # (C2)
    told = f"friction of the column by the balance of torques with the parameters of {car.name}"
    known = [f"{name} is taken as zero" for name in zero]
    units = {"displacement": "rad", "torque": "N m"}
    notes = (", ".join([told, *known]), *notes)
    load = None if "rack_force" in zero else np.abs(rack)
    record = FrictionRecord(angle, friction, dt, units, load, float(recording.time[0]), notes)
    return checked(record, sign, without_drift)


_USED = (*MAY_BE_ZERO, "torsion_bar_torque", "handwheel_torque", "column_angle", "handwheel_angle")


def _missing(recording: Recording, zero: Collection[str]) -> list[str]:
    """What a recording lacks for the balance, with the reason and the way out."""
    has = recording.channels
    lacks = []
    if "torsion_bar_torque" not in has and not {"handwheel_torque", "handwheel_angle"} <= set(has):
        lacks.append("torsion_bar_torque is missing, and handwheel_torque with handwheel_angle in its place")
    if not {"column_angle", "handwheel_angle"} & set(has):
        lacks.append("column_angle is missing, and handwheel_angle in its place")
    for name, when in MAY_BE_ZERO.items():
        if name not in has and name not in zero:
            what = "at the column [N m]" if name == "motor_torque" else "[N]"
            lacks.append(
                f"{name} {what} is missing, without which its torque would be taken for friction: measure it, or, "
                f"where {when}, give --zero {name}"
            )
    counted = [name for name in _USED if name in has and recording.units[name] == "counts"]
    lacks += [f"{name} is in counts: calibrate it" for name in counted]
    return lacks
