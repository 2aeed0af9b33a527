"""Table of the kinematics of a strut: cubic B-splines over rack and travel, and kernels that read them (S8).

The exact solution of :mod:`steer_env.vehicle.suspension.macpherson` takes a millisecond, the table fifty nanoseconds.
Beyond the range of the table the values at its edge hold. A linear extrapolation would pass the end of the linkage,
where no pose exists, and the end stops of a car are inside the range.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from steer_env.friction.numerics import packing
from steer_env.friction.numerics.bounds import within
from steer_env.friction.numerics.frozen import frozen
from steer_env.friction.numerics.kernel import kernel, plain, plainly
from steer_env.friction.numerics.simd import as_index, floor, load, minimum, spread, unpack_cars, where
from steer_env.vehicle.suspension.macpherson import MacPherson, load_coefficients


@packing.mark_as_tables
class KinematicsTable(NamedTuple):
    """Spline coefficients of a left wheel on a uniform grid; its channels are the fields of ``Knuckle``, ``Travel``."""

    table: NDArray[np.float64]  # (rack cells + 3, travel cells + 3, 14)
    rack_min: float  # [m]
    rack_cells_per_metre: float  # [1/m]
    travel_min: float  # [m]
    travel_cells_per_metre: float  # [1/m]


class Knuckle(NamedTuple):
    """Angles of one wheel, and the work of each unit load per metre of rack."""

    steer_angle: float  # left positive [rad]
    inclination: float  # ISO 8855 [rad]
    F_x_contact: float  # of a brake force [1]
    F_x_centre: float  # of a drive force or rolling resistance [1]
    F_y: float  # [1]
    F_z: float  # [1]
    M_x: float  # [rad/m]
    M_z: float  # [rad/m]


class Travel(NamedTuple):
    """Motion of a wheel as it moves up in the body: derivatives by travel at fixed rack."""

    centre_x: float  # of the wheel centre, forward [1]
    contact_y: float  # of the contact, to the left [1]
    roll: float  # of the carrier, about x [rad/m]
    pitch: float  # about y [rad/m]
    compression: float  # reduction of the strut length from the design position [m]
    compression_rate: float  # its derivative [1]


def tabulate_strut(
    strut: MacPherson,
    rack: float = 0.075,
    travel: float = 0.080,
    rack_cells: int = 150,
    travel_cells: int = 20,
) -> KinematicsTable:
    """Tabulate a strut over +-rack by +-travel [m].

    At the lock of the inner wheel the table of the default car has errors of 3e-7 rad in the angles and of 5e-6 of its
    largest value in the work; near straight ahead both are a hundred times smaller.

    Raises
    ------
    ValueError
        The strut does not reach the range (the message says how far it does), or a size is not positive.
    """
    for name, cells in (("rack_cells", rack_cells), ("travel_cells", travel_cells)):
        if not cells >= 2:
            raise ValueError(f"{name} is {cells!r}; allowed: 2 or more")
    for name, size in (("rack", rack), ("travel", travel)):
        if not size > 0.0:
            raise ValueError(f"{name} is {size!r}; allowed: positive [m]")
    sites_r, basis_r = _basis(rack_cells)
    sites_t, basis_t = _basis(travel_cells)
    step_r, step_t = 2 * rack / rack_cells, 2 * travel / travel_cells
    pose = strut.solve(-rack + step_r * sites_r[:, None], -travel + step_t * sites_t)
    work = load_coefficients(pose)
    forces = (work.F_x_contact, work.F_x_centre, work.F_y, work.F_z)
    up = pose.per_travel
    motion = (up.wheel_centre[..., 0], up.contact[..., 1], up.rotation[..., 0], up.rotation[..., 1])
    compression = strut.straight.strut_length - pose.strut_length
    knuckle = (pose.steer_angle, pose.inclination, *forces, work.M_x, work.M_z)
    values = np.stack([*knuckle, *motion, compression, -up.strut_length], -1)
    along_r = np.linalg.solve(basis_r, values.reshape(len(sites_r), -1)).reshape(values.shape)
    table = np.linalg.solve(basis_t, along_r)
    return frozen(KinematicsTable(np.ascontiguousarray(table), -rack, 1 / step_r, -travel, 1 / step_t))


def linear(
    steer: float, inclination: float = 0.0, path: float = 0.0, rack: float = 0.075, travel: float = 0.080
) -> KinematicsTable:
    """A table of linear kinematics instead of a solved strut: both wheels steer equally, about their contact centres.

    Parameters
    ----------
    steer : float
        Steer angle by rack [rad/m]; of the loads on the wheel only M_z works on the rack.
    inclination : float
        By travel, of the left wheel [rad/m].
    path : float
        Displacement of the left contact to the left per travel, twice the roll-centre height over the track [1].
    rack, travel : float
        Range on either side of zero [m].

    Raises
    ------
    ValueError
        A range that is not positive.

    The compression of the strut is the travel itself, and there is no anti-dive.
    """
    for name, size in (("rack", rack), ("travel", travel)):
        if not size > 0.0:
            raise ValueError(f"{name} is {size!r}; allowed: positive [m]")
    sites = np.array([-3.0, -1.0, 1.0, 3.0])  # of the four splines on one cell; the spline of a line is the line
    q, s = np.meshgrid(rack * sites, travel * sites, indexing="ij")
    zero = 0.0 * q
    knuckle = (steer * q, inclination * s, zero, zero, zero, zero, zero, zero + steer)
    motion = (zero, zero + path, zero + inclination, zero, s, zero + 1.0)
    return KinematicsTable(np.stack([*knuckle, *motion], -1), -rack, 0.5 / rack, -travel, 0.5 / travel)


def _basis(cells: int) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Sites (cells + 3,) in cells and the values there of the cubic B-splines (cells + 3, cells + 3).

    The sites are all grid points and the middles of the first and the last cell: as many sites as splines, and accuracy
    to the edge.
    """
    sites = np.sort(np.append(np.arange(cells + 1.0), [0.5, cells - 0.5]))
    basis = np.zeros((cells + 3, cells + 3))
    for row, site in zip(basis, sites):
        cell, part = plainly(_cell)(site, cells)
        row[cell : cell + 4] = plain(_weights)(part)
    return sites, basis


@kernel
def _cell(u, cells):
    """Cell that holds u (counted in cells) and the position in it, 0..1; the edge beyond the range, NaN for NaN."""
    u = within(u, 0.0, cells)
    cell = minimum(floor(where(u > 0.0, u, 0.0)), cells - 1.0)
    return as_index(cell), u - cell


@kernel
def _weights(t):
    """The four uniform cubic B-splines on a cell (S8)."""
    s = 1.0 - t
    near, far = t * t * (3.0 * t - 6.0) + 4.0, s * s * (3.0 * s - 6.0) + 4.0
    return s * s * s / 6.0, near / 6.0, far / 6.0, t * t * t / 6.0  # b of (S8)


@kernel
def _row(table, i, t):
    """Four channels interpolated along the travel, from the flat index ``i`` of the table."""
    n = table.shape[2]
    return (
        t[0] * load(table, i)
        + t[1] * load(table, i + n)
        + t[2] * load(table, i + 2 * n)
        + t[3] * load(table, i + 3 * n)
    )


@kernel
def _patch(table, i, j, k, r, t):
    """Four consecutive channels, from the ``k``-th, interpolated along rack and travel."""
    n = table.shape[1] * table.shape[2]
    i = i * n + j * table.shape[2] + k
    # (S8)
    return (
        r[0] * _row(table, i, t)
        + r[1] * _row(table, i + n, t)
        + r[2] * _row(table, i + 2 * n, t)
        + r[3] * _row(table, i + 3 * n, t)
    )


@kernel
def _splines_and_weights(m, rack, travel):
    """First spline and the weights of four, along rack and travel."""
    i, u = _cell((rack - m.rack_min) * m.rack_cells_per_metre, m.table.shape[0] - 3)
    j, v = _cell((travel - m.travel_min) * m.travel_cells_per_metre, m.table.shape[1] - 3)
    return i, j, _weights(spread(u)), _weights(spread(v))


@kernel
def left_knuckle(m, rack, travel):
    """The left wheel: ``Knuckle`` at rack [m] and its travel [m]."""
    i, j, r, t = _splines_and_weights(m, rack, travel)
    k = i - i  # not a literal, for which numba would compile the patch once for each value
    steer, inclination, F_x_contact, F_x_centre = unpack_cars(_patch(m.table, i, j, k, r, t))
    F_y, F_z, M_x, M_z = unpack_cars(_patch(m.table, i, j, k + 4, r, t))
    return Knuckle(steer, inclination, F_x_contact, F_x_centre, F_y, F_z, M_x, M_z)


@kernel
def left_travel(m, rack, travel):
    """The left wheel: ``Travel`` at rack [m] and its travel [m]."""
    i, j, r, t = _splines_and_weights(m, rack, travel)
    k = i - i
    centre_x, contact_y, roll, pitch = unpack_cars(_patch(m.table, i, j, k + 8, r, t))
    _, _, compression, compression_rate = unpack_cars(_patch(m.table, i, j, k + 10, r, t))
    return Travel(centre_x, contact_y, roll, pitch, compression, compression_rate)


@kernel
def right_knuckle(m, rack, travel):
    """The right wheel: the mirror image of the left one at the opposite rack position, exact to the last bit."""
    k = left_knuckle(m, -rack, travel)
    return Knuckle(-k.steer_angle, -k.inclination, -k.F_x_contact, -k.F_x_centre, k.F_y, -k.F_z, k.M_x, k.M_z)


@kernel
def overturning(k, loaded_radius, F):
    """Moment about the heading axis by which a force ``F``, down at the wheel centre, differs from one at the contact.

    With this moment in ``M_x`` and ``F`` taken off ``F_z``, :func:`rack_force` needs no lever of the wheel centre.
    """
    g = k.inclination
    return loaded_radius * (g - g * g * g * (1.0 / 6.0)) * F  # (S7); the sine to 1e-6


@kernel
def rack_force(k, F_x_contact, F_x_centre, F_y, F_z, M_x, M_z):
    """Rack force of one wheel [N], positive where it resists a left turn (S7); loads as in ``suspension.WheelLoad``."""
    # (S7)
    return -(
        k.F_x_contact * F_x_contact + k.F_x_centre * F_x_centre + k.F_y * F_y + k.F_z * F_z + k.M_x * M_x + k.M_z * M_z
    )
