"""Tyre model."""

from collections.abc import Iterator

import numpy as np

from steer_env.vehicle import tyre
from tests.vehicle.oracles import TYRE_FORCES
from tests.verification.common.rows import Row, at_most


def rows() -> Iterator[Row]:
    """Tyre against an independent library: 4 kN, 16.67 m/s, no camber."""
    for alpha, expected in TYRE_FORCES.items():
        F_x, F_y, _, _, M_z = tyre.load().forces(0.0, alpha, 0.0, 4000.0, 16.67)
        errors = np.abs(np.array([F_y, M_z, F_x]) / expected - 1.0)
        yield at_most(f"F_y, M_z, F_x at {alpha:g} rad", errors, 1e-9, "of each")
