"""Poses of the four wheels on two tracks: outputs that only an FMU has, which it computes when they are read.

The frame is that of the channels ``x`` and ``y``, with z normal to the plane of the road and 0 there. The angles are
those by which the tyres make their forces: the heading is yaw angle and steer angle together, the inclination that of
the carrier and the roll angle together. Turned by the inclination about x, then by the heading about z, the y axis is
the axle. The angle by which a wheel has rolled is no state of the plant, only its rate, ``wheel_angular_velocity_*``.
"""

import numpy as np

from steer_env.friction.numerics.kernel import kernel
from steer_env.friction.numerics.packing import at_addresses
from steer_env.friction.numerics.simd import load, store
from steer_env.vehicle.chassis.common.interface import per_wheel
from steer_env.vehicle.chassis.two_track import CHANNELS, YAW, TwoTrack, X, Y, Z
from steer_env.vehicle.chassis.two_track.rotation import rotation, to_road
from steer_env.vehicle.chassis.two_track.suspension import carriers, per_axle, sides
from steer_env.vehicle.layout import layout_in_kernels
from steer_env.vehicle.steering.column import COLUMN_ANGLE
from steer_env.vehicle.subsystems.subsystem import Subsystem, channel_signals

_MEANINGS = {
    "wheel_x": "position of its centre along the direction of the car at the start, positive ahead",
    "wheel_y": "position of its centre across that direction, positive to the left",
    "wheel_z": "height of its centre above the plane of the road, positive upwards",
    "wheel_heading": "yaw angle of the car and steer angle together, positive to the left",
    "wheel_inclination": "inclination to the road, positive where the top leans to the right",
}
_POSES = tuple(pose for name in _MEANINGS for pose in per_wheel(name, "m" if name[6:] in "xyz" else "rad"))
POSE_NAMES = frozenset(name for name, _ in _POSES)
_POSE_COUNT = len(_POSES)
_LATERAL_FORCE = len(CHANNELS) - [name for name, _ in CHANNELS].index("lateral_force_front_left")  # before the poses


@kernel
def entry(numbers, tables, state, given, inputs, outputs):
    """Write the poses, the last of the outputs, from the state and the channels before them.

    The arguments are the first of those of :func:`steer_env.vehicle.subsystems.machine_code.entry`. Always true.
    """
    p = at_addresses(numbers, tables).plant
    _fill(p, at_addresses(state, state), at_addresses(outputs, outputs)[0])
    return True


@kernel
def _fill(p, state, row):
    at = layout_in_kernels(p)
    x, d = state[at.chassis : at.rate], p.chassis.body[0]
    frame = rotation(x)
    wheels = carriers(d, p.strut, p.pinion_radius * state[COLUMN_ANGLE], 0.0, 0.0, x)
    y_i = sides() * per_axle(0.5 * d.t_f, 0.5 * d.t_r)
    r_x, r_y, r_z = to_road(frame, per_axle(d.a, -d.b), y_i, d.R_l - d.h + wheels.travel)
    k = row.size - _POSE_COUNT
    store(row, k, x[X] + frame.c_y * r_x - frame.s_y * r_y)
    store(row, k + 4, x[Y] + frame.s_y * r_x + frame.c_y * r_y)
    store(row, k + 8, x[Z] + r_z)
    compliance = per_axle(0.0, d.compliance_steer_r) * load(row, k - _LATERAL_FORCE)  # (B11)
    store(row, k + 12, x[YAW] + wheels.steer_angle + compliance)
    store(row, k + 16, wheels.camber)


def with_poses(subsystem: Subsystem) -> Subsystem:
    """A subsystem whose last outputs are the poses of the wheels, where it has a chassis on two tracks.

    They are zero in ``shown`` and after a step; :func:`entry` computes them.
    """
    if "chassis" not in subsystem.sections or not isinstance(subsystem.parameters.chassis, TwoTrack):
        return subsystem
    return subsystem._replace(
        outputs=(*subsystem.outputs, *channel_signals(_POSES, _MEANINGS)),
        shown=np.append(subsystem.shown, np.zeros(_POSE_COUNT)),
    )


def has_poses(subsystem: Subsystem) -> bool:
    """Whether a subsystem has the poses among its outputs."""
    return subsystem.outputs[-1].name in POSE_NAMES
