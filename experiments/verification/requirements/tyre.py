"""Tyre model."""

from collections.abc import Iterator

import numpy as np

from steer_env.experiments.verification.requirements.common.rows import Row, at_most
from steer_env.vehicle import tyre

# Source: an independent Magic Formula library with the same coefficients, 220 kPa.
# alpha [rad] -> F_y [N], M_z [N m], F_x [N]
TYRE = {
    0.0: (42.00044636, -11.32558474, -172.0094611),
    0.0105: (-438.816506, 3.635828161, -168.1286296),
    0.042: (-1787.245403, 40.24745993, -143.1309805),
    -0.042: (1899.24457, -63.09854265, -155.888103),
}


def rows() -> Iterator[Row]:
    """Tyre against an independent library: 4 kN, 16.67 m/s, no camber."""
    for alpha, expected in TYRE.items():
        F_x, F_y, _, _, M_z = tyre.load().forces(0.0, alpha, 0.0, 4000.0, 16.67)
        errors = np.abs(np.array([F_y, M_z, F_x]) / expected - 1.0)
        yield at_most(f"F_y, M_z, F_x at {alpha:g} rad", errors, 1e-6, "of each")
