"""Rack force."""

from collections.abc import Iterator
from typing import Any

import numpy as np
from numpy.typing import NDArray

from steer_env.vehicle.suspension.macpherson import MIRROR, MacPherson, Pose, WheelLoad, load_coefficients, rack_force
from tests.verification.common.rows import Row, at_most

Array = NDArray[np.float64]


def rows() -> Iterator[Row]:
    """Rack force by virtual work against the six equations of statics of the knuckle, 300 random cases on each side."""
    s, n, rng = MacPherson.load("s1"), 300, np.random.default_rng(0)
    rack, travel = rng.uniform(-0.075, 0.075, n), rng.uniform(-0.08, 0.08, n)
    load = WheelLoad(*(rng.uniform(-size, size, n) for size in (3e3, 3e3, 4e3, 6e3, 200.0, 500.0, 150.0, 500.0)))
    for side, pose, mirror in zip(("left", "right"), s.solve_pair(rack, travel, travel), (1.0, MIRROR)):
        pivots = [mirror * np.array(s.points[f"lower_arm_{end}_pivot"]) for end in ("front", "rear")]
        # relative to the sum of the magnitudes of the contributions, which may cancel
        size = np.sum([np.abs(c * np.asarray(f)) for c, f in zip(load_coefficients(pose), load)], axis=0)
        errors = np.abs(rack_force(pose, load) - static_rack_force(pivots, pose, load)) / size
        yield at_most(f"{side} wheel", errors, 1e-9, "of its contributions")


def static_rack_force(pivots: list[Array], pose: Pose, load: Any) -> Array:
    """Rack force (N,) from the equilibrium of the knuckle about the origin: two links, top mount, tie rod [N]."""

    def wrench(force: Array, at: Array) -> Array:
        return np.concatenate(np.broadcast_arrays(force, np.cross(at, force)), axis=-1)

    def unit(v: Array) -> Array:
        return v / np.linalg.norm(v, axis=-1, keepdims=True)

    c, s, zero = np.cos(pose.steer_angle), np.sin(pose.steer_angle), np.zeros_like(pose.steer_angle)

    def turned(x: Any, y: Any, z: Any) -> Array:
        return np.stack(np.broadcast_arrays(c * x - s * y, s * x + c * y, z), axis=-1)

    given = wrench(turned(load.F_x_contact, load.F_y, load.F_z), pose.contact)
    given += wrench(turned(load.F_x_centre, zero, load.F_z_centre), pose.wheel_centre)
    given[:, 3:] += turned(load.M_x, load.M_y, load.M_z)
    rod = unit(pose.tie_rod_outer - pose.tie_rod_inner)
    unknown = [wrench(unit(pose.lower_ball_joint - pivot), pose.lower_ball_joint) for pivot in pivots]
    unknown += [wrench(axis, pose.strut_top) for axis in np.eye(3)]  # spring along, bearing across the strut
    unknown.append(wrench(rod, pose.tie_rod_outer))
    carried = np.linalg.solve(np.stack(unknown, axis=-1), -given[..., None])[:, 5, 0]
    return -carried * rod[:, 1]  # behind the axle, the rack moves to the right to steer left
