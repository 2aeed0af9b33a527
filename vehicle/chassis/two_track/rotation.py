"""Orientation of the body and its velocities in the road frame.

The rotations are yaw, then pitch, then roll. The road frame is the body frame without pitch and roll: its x axis has
the yaw angle of the body, and its z axis is normal to the road.
"""

from typing import NamedTuple

from steer_env.friction.numerics.kernel import kernel, part
from steer_env.friction.numerics.simd import cos, pack, sin, unpack
from steer_env.vehicle.chassis.two_track.layout import PITCH, ROLL, YAW, P, Q, R, U, V, W


class Rotation(NamedTuple):
    """Matrix from the body frame to the road frame, and cosine and sine of the roll, pitch and yaw angle [1]."""

    a11: float
    a12: float
    a13: float
    a22: float  # a21 is 0
    a23: float
    a31: float
    a32: float
    a33: float
    c_r: float
    s_r: float
    c_p: float
    s_p: float
    c_y: float
    s_y: float


class Motion(NamedTuple):
    """Velocity of O [m/s] and angular velocity of the body [rad/s], in the road frame."""

    V_x: float
    V_y: float
    V_z: float
    W_x: float
    W_y: float
    W_z: float


@part
def rotation(x):
    """Rotation of the body at the states ``x``."""
    angles = pack(x[ROLL], x[PITCH], x[YAW], 0.0)
    c_r, c_p, c_y, _ = unpack(cos(angles))
    s_r, s_p, s_y, _ = unpack(sin(angles))
    return Rotation(
        a11=c_p, a12=s_p * s_r, a13=s_p * c_r,
        a22=c_r, a23=-s_r,
        a31=-s_p, a32=c_p * s_r, a33=c_p * c_r,
        c_r=c_r, s_r=s_r, c_p=c_p, s_p=s_p, c_y=c_y, s_y=s_y,
    )  # fmt: skip


@kernel
def to_road(frame, x, y, z):
    """Components in the road frame of a vector in the body frame."""
    return (
        frame.a11 * x + frame.a12 * y + frame.a13 * z,
        frame.a22 * y + frame.a23 * z,
        frame.a31 * x + frame.a32 * y + frame.a33 * z,
    )


@kernel
def to_body(frame, x, y, z):
    """Components in the body frame of a vector in the road frame."""
    return (
        frame.a11 * x + frame.a31 * z,
        frame.a12 * x + frame.a22 * y + frame.a32 * z,
        frame.a13 * x + frame.a23 * y + frame.a33 * z,
    )


@part
def motion(frame, x):
    """Motion of the body at the states ``x``."""
    V_x, V_y, V_z = to_road(frame, x[U], x[V], x[W])
    W_x, W_y, W_z = to_road(frame, x[P], x[Q], x[R])
    return Motion(V_x, V_y, V_z, W_x, W_y, W_z)
