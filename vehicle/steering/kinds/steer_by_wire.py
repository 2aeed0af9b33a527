"""Steer-by-wire: no torsion bar; a motor that turns a ball screw moves the rack, another one makes the hand torque.

    I2 = r_p^2 (m_r + m_w + n^2 J_m),   C2 = r_p^2 d,   K_tb = C_tb = 0                                    (W7)

with the letters of the rack EPS, (C10) to (C12): the actuator at the rack is the same one, seen at a pinion that is not
there and whose radius remains the scale of all that is said of the column. Boost, damping and functions of the assist
are those of a column, and off. The controllers are :mod:`steer_env.vehicle.steering.by_wire`.

The default tables are assumed; of the packaged car, the map is (E7) over the angle that the lateral acceleration needs.
"""

from typing import Any

from steer_env.vehicle.steering import by_wire
from steer_env.vehicle.steering.kinds.common import KINDS, Kind, Section, at_pinion
from steer_env.vehicle.steering.rack_observer import Rack

TABLES = {
    "speeds": [0.0, 100.0],
    "ratio": [1.0, 1.0],
    "angles": [0.0, 0.1, 0.3, 1.0, 10.0],
    "feel": [[0.0, 0.5, 1.0, 2.0, 4.0], [0.0, 1.5, 3.0, 5.0, 8.0]],
    "damping": [0.5, 0.6],
    "friction_law": "dahl,F_c=0.3,sigma_0=6.0",
    "feel_law": "torque_map",
    "force_share": [0.5],
    "forces": [0.0, 500.0, 2000.0, 8000.0],
    "force_feel": [0.0, 2.0, 4.0, 6.0],
    "observer_law": "viscous,sigma_2=0.0",
}


def at_column(p: Section, pinion_radius: float) -> dict[str, dict[str, Any]]:
    """The keys of the sections ``column`` and ``assist`` that follow, SI, for a pinion radius [m]."""
    I2, C2, limit, ratio = at_pinion(p, pinion_radius)
    rows = len(p["speeds"])
    return {
        "column": {"I2": I2, "C2": C2, "K_tb": 0.0, "C_tb": 0.0},  # (W7)
        "assist": {
            "speeds": list(p["speeds"]),
            "torques": [0.0, 1.0],
            "boost": [[0.0, 0.0]] * rows,
            "boost_scale": [1.0],
            "damping": [0.0] * rows,
            **{name: [0.0] for name in ("return_gain", "handwheel_damping", "inertia_compensation", "friction_share")},
            "lead_lag_gain": 0.0,
            "limit": limit,
            "motor_ratio": ratio,
        },
    }


def wire(p: Section, steering: Section) -> by_wire.Wire:
    """The controllers, with the section ``steering`` of the car file."""
    radius = steering["pinion_radius"]
    I2, C2, limit, _ = at_pinion(p, radius)
    return by_wire.make(p, Rack(steering["rack_limit"] / radius, limit, I2, C2, radius))


KINDS.register("steer_by_wire", Kind(at_column, tables=TABLES, wire=wire))
