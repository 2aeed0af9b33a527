"""Kinematics of the MacPherson strut."""

from collections.abc import Iterator

import numpy as np

from steer_env.experiments.verification.requirements.common.rows import Row, as_printed
from steer_env.vehicle.suspension.macpherson import MacPherson


def rows() -> Iterator[Row]:
    """Strut S1 against its table, to the last digit. Its points, rounded to 0.1 mm, give 0.1968 deg at -60 mm."""
    s = MacPherson.load("s1")
    design, travel = s.solve(0.0, 0.0), np.array([-60, -40, -20, 20, 40, 60]) * 1e-3
    moved, per_rack = s.solve(0.0, travel), float(design.per_rack.rotation[2])
    left, right = s.solve_pair(-np.arange(10, 71, 10) * 1e-3, 0.0, 0.0)
    inner, outer = -right.steer_angle[[0, 6]], -left.steer_angle[[0, 6]]
    # steer angle of the inner wheel with a common turning centre; wheelbase 2.393 m, track 1.390 m
    ideal = np.arctan(1.0 / (1.0 / np.tan(outer) - 1.390 / 2.393))
    toe, camber = np.degrees(moved.toe), np.degrees(moved.camber)
    yield as_printed("king-pin inclination [deg]", np.degrees(design.kingpin_inclination), "13.00")
    yield as_printed("caster [deg]", np.degrees(design.caster), "4.50")
    yield as_printed("trail [mm]", 1e3 * design.trail, "18.0")
    yield as_printed("scrub [mm]", 1e3 * design.scrub, "3.0")
    yield as_printed("roll centre [mm]", 1e3 * design.roll_centre_height, "69")
    yield as_printed("toe-in at -60, -40, -20 mm [deg]", toe[:3], "0.198 0.122 0.058", "0.197 0.122 0.058")
    yield as_printed("toe-in at 20, 40, 60 mm [deg]", toe[3:], "-0.058 -0.122 -0.198")
    yield as_printed("camber at -60, -40, -20 mm [deg]", camber[:3], "1.25 0.76 0.34")
    yield as_printed("camber at 20, 40, 60 mm [deg]", camber[3:], "-0.25 -0.40 -0.44")
    yield as_printed("steer at centre [deg/mm]", np.degrees(per_rack) * 1e-3, "0.4986")
    yield as_printed("arm at centre [mm]", 1e3 / per_rack, "114.9")
    yield as_printed("ratio at 50 mm a turn", 2.0 * np.pi / (0.050 * per_rack), "14.44")
    outer_steer, inner_steer = np.degrees(left.steer_angle), np.degrees(right.steer_angle)
    yield as_printed("left at 10, 20, 30, 40 mm [deg]", outer_steer[:4], "-4.96 -9.90 -14.86 -19.86")
    yield as_printed("left at 50, 60, 70 mm [deg]", outer_steer[4:], "-24.93 -30.11 -35.43")
    yield as_printed("right at 10, 20, 30, 40 mm [deg]", inner_steer[:4], "-5.02 -10.16 -15.46 -21.04")
    yield as_printed("right at 50, 60, 70 mm [deg]", inner_steer[4:], "-27.02 -33.69 -41.61")
    yield as_printed("Ackermann share at 10, 70 mm [%]", 100.0 * (inner - outer) / (ideal - outer), "23 41")
