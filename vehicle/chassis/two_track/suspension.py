"""The four wheel carriers in the body: kinematics of struts and rear axle, and the forces along the wheel travel.

The front carriers follow the solved strut (:mod:`steer_env.vehicle.suspension.kinematics_table`), the rear ones linear
functions of the travel. A right strut is the mirror image of the left one.
"""

from typing import NamedTuple

from steer_env.friction.numerics.kernel import kernel, part
from steer_env.friction.numerics.simd import copysign, fabs, load, maximum, pack, swap_sides, where
from steer_env.vehicle.chassis.two_track.layout import COMPLIANCE, ROLL, TRAVEL, TRAVEL_RATE
from steer_env.vehicle.suspension import kinematics_table

STOP_SOFTNESS = 0.01  # travel over which a bump stop reaches its stiffness, assumed [m]


class Carriers(NamedTuple):
    """The four wheel carriers; each field but the first is a vector of four wheels."""

    knuckle: kinematics_table.Knuckle  # of the front wheels; zero for the rear wheels
    travel: float  # [m]
    travel_rate: float  # [m/s]
    steer_angle: float  # [rad]
    camber: float  # inclination to the road, at small pitch and roll angles [rad]
    yaw_rate: float  # of the carrier about z, in the road frame [rad/s]
    centre_x: float  # forward displacement of the wheel centre per travel [1]
    contact_y: float  # displacement of the contact point to the left per travel [1]
    camber_gain: float  # inclination per travel [rad/m]
    pitch_gain: float  # pitch angle of the carrier per travel [rad/m]
    strut_force: float  # of spring and damper, against the travel [N]
    spring_force: float  # of these, anti-roll bar and bump stop, against the travel [N]


@kernel
def per_axle(front, rear):
    """The vector of a value for both front and a value for both rear wheels."""
    return pack(front, front, rear, rear)


@kernel
def front_only(left, right):
    """The vector of the values of the front wheels, and zero for the rear wheels."""
    return pack(left, right, 0.0, 0.0)


@kernel
def sides():
    """1 for the left and -1 for the right wheels."""
    return pack(1.0, -1.0, 1.0, -1.0)


@kernel
def _stop_force(stiffness, clearance, s):
    """Force of the bump and the rebound stop at travel ``s``, downwards in bump (B12)."""
    beyond = maximum(fabs(s) - clearance, 0.0)
    return copysign(stiffness * beyond * beyond / (beyond + STOP_SOFTNESS), s)  # (B12)


@part
def carriers(d, strut, rack, rack_rate, W_z, x):
    """Kinematics of the wheel carriers, and the forces of the suspension on them.

    Parameters
    ----------
    d : Body
    strut : kinematics_table.KinematicsTable
    rack, rack_rate : float
        Rack coordinate [m] and its rate [m/s]; the tie rod of each wheel lags behind by its own compliance travel.
    W_z : float
        Angular velocity of the body about z, in the road frame [rad/s].
    x : (S,) array
        States.
    """
    side, front = sides(), pack(1.0, 1.0, 0.0, 0.0) > 0.0
    s, s_rate = load(x, TRAVEL), load(x, TRAVEL_RATE)
    travel_l, travel_r = x[TRAVEL], x[TRAVEL + 1]
    # A right wheel is a left one at the opposite rack position.
    rack_l, rack_r = rack - x[COMPLIANCE], x[COMPLIANCE + 1] - rack
    left, right = (
        kinematics_table.left_knuckle(strut, rack_l, travel_l),
        kinematics_table.left_knuckle(strut, rack_r, travel_r),
    )
    knuckle = kinematics_table.Knuckle(
        steer_angle=front_only(left.steer_angle, right.steer_angle),
        inclination=front_only(left.inclination, right.inclination),
        F_x_contact=front_only(left.F_x_contact, right.F_x_contact),
        F_x_centre=front_only(left.F_x_centre, right.F_x_centre),
        F_y=front_only(left.F_y, right.F_y),
        F_z=front_only(left.F_z, right.F_z),
        M_x=front_only(left.M_x, right.M_x),
        M_z=front_only(left.M_z, right.M_z),
    )
    up_l = kinematics_table.left_travel(strut, rack_l, travel_l)
    up_r = kinematics_table.left_travel(strut, rack_r, travel_r)
    compression = where(front, front_only(up_l.compression, up_r.compression), s)
    compression_rate = pack(up_l.compression_rate, up_r.compression_rate, 1.0, 1.0)

    spring = (
        per_axle(d.S_f, d.S_r)
        + per_axle(d.K_f, d.K_r) * compression
        + per_axle(d.C_f, d.C_r) * compression_rate * s_rate
    )
    strut_force = compression_rate * spring
    force = strut_force + per_axle(d.B_f, d.B_r) * (s - swap_sides(s))  # (B10), (B11), (B12)
    force += _stop_force(d.K_stop, per_axle(d.clearance_f, d.clearance_r), s)
    return Carriers(
        knuckle=knuckle,
        travel=s,
        travel_rate=s_rate,
        steer_angle=side * where(front, knuckle.steer_angle, d.steer_r * s),
        camber=side * where(front, knuckle.inclination, d.camber_r * s) + x[ROLL],
        yaw_rate=W_z + knuckle.M_z * rack_rate,
        centre_x=front_only(up_l.centre_x, up_r.centre_x),
        contact_y=side * pack(up_l.contact_y, up_r.contact_y, d.contact_y_r, d.contact_y_r),
        camber_gain=side * pack(up_l.roll, up_r.roll, d.camber_r, d.camber_r),
        pitch_gain=front_only(up_l.pitch, up_r.pitch),
        strut_force=strut_force,
        spring_force=force,
    )
