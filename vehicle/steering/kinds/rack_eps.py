"""Rack EPS: a motor turns the nut of a ball screw on the rack by a belt.

    n = 2 pi i/l                                                      (C10)  motor angle over rack travel
    I2 = J_p + r_p^2 (m_r + m_w + n^2 J_m),   C2 = r_p^2 d            (C11)  below the torsion bar
    limit = r_p n T_max,   ratio = r_p n,   boost = r_p boost at the rack        (C12)  at the column axis

with the belt ratio i, the lead l, the pinion radius r_p, inertia J_p of what turns with the pinion, mass m_r of the
rack, mass m_w of the wheels about their king-pins seen at the rack, inertia J_m of the motor, damping d at the rack and
the motor's peak torque T_max. Forces and torques are those before the losses of the gear, which are friction: at the
site ``gear`` of :mod:`steer_env.friction.sites`, whose efficiency makes it grow with the motor's torque, so that no
loss counts twice.

The defaults are assumed within published ranges of rack EPS: screw leads of 5 to 10 mm, belt ratios of 2 to 3.5,
largest rack forces of 8 to 14 kN. The motor's inertia is the 1e-4 kg m2 of the column EPS here and a nut with its
pulley of 3e-4 kg m2 over the square of the belt ratio; wheels, rack and damping are those of its column on the pinion
of the compact (0.007 kg m2, 3 kg, 0.6 N m s/rad), the pinion has its shaft's 0.003 kg m2.
"""

from typing import Any

from numpy.typing import NDArray

from steer_env.vehicle.steering.kinds.common import KINDS, Kind, Section, at_pinion


def at_column(p: Section, pinion_radius: float) -> dict[str, dict[str, Any]]:
    """The keys of the sections ``column`` and ``assist`` that follow, SI, for a pinion radius [m]."""
    I2, C2, limit, ratio = at_pinion(p, pinion_radius, p["pinion_inertia"])
    return {"column": {"I2": I2, "C2": C2}, "assist": {"limit": limit, "motor_ratio": ratio}}


def boost(table: NDArray, pinion_radius: float) -> NDArray:
    """Boost (V, T) at the column [N m] of that at the rack [N], for a pinion radius [m]."""
    return pinion_radius * table  # (C12)


KINDS.register("rack_eps", Kind(at_column, boost))
