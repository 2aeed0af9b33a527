"""Published and independent values that ``python -m tests.maintain verify`` compares the models with."""

import numpy as np
from numpy.typing import NDArray

from steer_env.vehicle.suspension.macpherson import MacPherson

# Forces of the default tyre at 4 kN, 16.67 m/s, 220 kPa, without camber or longitudinal slip, to ten digits.
# Source: an independent Magic Formula library with the same coefficients.
# alpha [rad] -> F_y [N], M_z [N m], F_x [N]
TYRE_FORCES = {
    0.0: (42.00044636, -11.32558474, -172.0094611),
    0.0105: (-438.816506, 3.635828161, -168.1286296),
    0.042: (-1787.245403, 40.24745993, -143.1309805),
    -0.042: (1899.24457, -63.09854265, -155.888103),
}

# The printed table of strut S1, to its last digit; :func:`strut_s1` computes the values.
STRUT_S1 = {
    "king-pin inclination [deg]": "13.00",
    "caster [deg]": "4.50",
    "trail [mm]": "18.0",
    "scrub [mm]": "3.0",
    "roll centre [mm]": "69",
    "toe-in at -60, -40, -20 mm [deg]": "0.198 0.122 0.058",
    "toe-in at 20, 40, 60 mm [deg]": "-0.058 -0.122 -0.198",
    "camber at -60, -40, -20 mm [deg]": "1.25 0.76 0.34",
    "camber at 20, 40, 60 mm [deg]": "-0.25 -0.40 -0.44",
    "steer at centre [deg/mm]": "0.4986",
    "arm at centre [mm]": "114.9",
    "ratio at 50 mm a turn": "14.44",
    "left at 10, 20, 30, 40 mm [deg]": "-4.96 -9.90 -14.86 -19.86",
    "left at 50, 60, 70 mm [deg]": "-24.93 -30.11 -35.43",
    "right at 10, 20, 30, 40 mm [deg]": "-5.02 -10.16 -15.46 -21.04",
    "right at 50, 60, 70 mm [deg]": "-27.02 -33.69 -41.61",
    "Ackermann share at 10, 70 mm [%]": "23 41",
}
# What our strut gives instead: its hard points, rounded to 0.1 mm, give 0.1968 deg at -60 mm.
STRUT_S1_DEVIATIONS = {"toe-in at -60, -40, -20 mm [deg]": "0.197 0.122 0.058"}


def strut_s1() -> dict[str, NDArray[np.float64]]:
    """The values of ``STRUT_S1`` from the solved linkage."""
    s = MacPherson.load("s1")
    design, travel = s.solve(0.0, 0.0), np.array([-60, -40, -20, 20, 40, 60]) * 1e-3
    moved, per_rack = s.solve(0.0, travel), float(design.per_rack.rotation[2])
    left, right = s.solve_pair(-np.arange(10, 71, 10) * 1e-3, 0.0, 0.0)
    inner, outer = -right.steer_angle[[0, 6]], -left.steer_angle[[0, 6]]
    # steer angle of the inner wheel with a common turning centre; wheelbase 2.393 m, track 1.390 m
    ideal = np.arctan(1.0 / (1.0 / np.tan(outer) - 1.390 / 2.393))
    toe, camber = np.degrees(moved.toe), np.degrees(moved.camber)
    outer_steer, inner_steer = np.degrees(left.steer_angle), np.degrees(right.steer_angle)
    values = (
        np.degrees(design.kingpin_inclination),
        np.degrees(design.caster),
        1e3 * design.trail,
        1e3 * design.scrub,
        1e3 * design.roll_centre_height,
        toe[:3],
        toe[3:],
        camber[:3],
        camber[3:],
        np.degrees(per_rack) * 1e-3,
        1e3 / per_rack,
        2.0 * np.pi / (0.050 * per_rack),
        outer_steer[:4],
        outer_steer[4:],
        inner_steer[:4],
        inner_steer[4:],
        100.0 * (inner - outer) / (ideal - outer),
    )
    return dict(zip(STRUT_S1, map(np.ravel, values), strict=True))
