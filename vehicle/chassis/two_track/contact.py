"""The contact of the four wheels with the road: position, load, velocities and slip speeds.

All components are in the road frame. The velocity of the wheel centre along x and that of the contact point along y
define the slip, and the tyre forces do work on these velocities.
"""

from typing import NamedTuple

from steer_env.friction.numerics.kernel import kernel, part
from steer_env.friction.numerics.simd import maximum, sin, sqrt
from steer_env.vehicle import road
from steer_env.vehicle.chassis.two_track.layout import DISTANCE, Z
from steer_env.vehicle.chassis.two_track.suspension import per_axle, sides


class Contact(NamedTuple):
    """Contact of the wheels with the road; each field is a vector of four wheels."""

    x: float  # of the wheel centre, from O [m]
    y: float  # [m]
    z: float  # [m]
    height: float  # of the wheel centre over the road [m]
    camber_offset: float  # of the contact point to the left, as a cambered wheel meets the road in its own plane [m]
    F_z: float  # load [N]
    slope: float  # of the road along x [1]
    mu: float  # factor on the friction of the tyre [1]
    centre_v_x: float  # velocity of the wheel centre along x [m/s]
    contact_v_x: float  # of the contact point along x [m/s]
    contact_v_y: float  # of the contact point along y [m/s]


class Slip(NamedTuple):
    """Direction of the wheels and their slip speeds; each field is a vector of four wheels."""

    c: float  # cosine of the steer angle [1]
    s: float  # sine of the steer angle [1]
    rolling: float  # velocity along the heading of the wheel [m/s]
    x: float  # slip speed along the heading [m/s]
    y: float  # across it [m/s]


@part
def contact(p, frame, body, carriers, x):
    """Position, load and velocities of the contact points.

    Parameters
    ----------
    p : TwoTrack
    frame : Rotation
    body : Motion
    carriers : Carriers
    x : (S,) array
        States.
    """
    d = p.body[0]
    s_rate, camber = carriers.travel_rate, carriers.camber
    arm = per_axle(d.a, -d.b)
    y_i, z_i = sides() * per_axle(0.5 * d.t_f, 0.5 * d.t_r), d.R_l - d.h + carriers.travel
    r_x = frame.a11 * arm + frame.a12 * y_i + frame.a13 * z_i
    r_y = frame.a22 * y_i + frame.a23 * z_i
    r_z = frame.a31 * arm + frame.a32 * y_i + frame.a33 * z_i
    ground, slope, mu = road.under_wheels(p.road, x[DISTANCE] + d.a, x[DISTANCE] - d.b)
    # The camber offset is of second order: the loaded radius is height (1 + camber^2/2), so that the virtual work of
    # the tyre spring is F_z at the camber offset.
    height = x[Z] + r_z - ground
    offset, longer = height * camber, 1.0 + 0.5 * camber * camber
    F_z = maximum(per_axle(d.F_zf, d.F_zr) + d.K_t * (d.R_l - height * longer), 0.0) * longer  # (B6)
    # (B7)
    centre_v_x = body.V_x + body.W_y * r_z - body.W_z * (r_y + offset) + (frame.a13 + carriers.centre_x) * s_rate
    contact_v_y = body.V_y + body.W_z * r_x - body.W_x * (r_z - height) + (frame.a23 + carriers.contact_y) * s_rate
    return Contact(
        x=r_x,
        y=r_y,
        z=r_z,
        height=height,
        camber_offset=offset,
        F_z=F_z,
        slope=slope,
        mu=mu * d.mu,
        centre_v_x=centre_v_x,
        contact_v_x=centre_v_x - height * (body.W_y + carriers.pitch_gain * s_rate),
        contact_v_y=contact_v_y,
    )


@kernel
def slip_speeds(d, contact, steer_angle, omega):
    """Slip speeds of the wheels at their steer angles [rad] and angular velocities ``omega`` [rad/s]."""
    s = sin(steer_angle)
    c = sqrt(1.0 - s * s)  # the steer angle is within a right angle, and a root is cheaper than a cosine
    rolling = contact.centre_v_x * c + contact.contact_v_y * s
    return Slip(c, s, rolling, rolling - d.R_e * omega, contact.contact_v_y * c - contact.contact_v_x * s)
