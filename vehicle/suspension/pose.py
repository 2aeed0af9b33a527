"""Pose of a front wheel, its derivatives, and the rack force of the loads on it."""

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

Array = NDArray[Any]

MIRROR = np.array([1.0, -1.0, 1.0])  # of a point or force across the mid-plane; of a rotation: -MIRROR


class Motion(NamedTuple):
    """Derivative of a pose with respect to a coordinate u, in car axes."""

    wheel_centre: Array  # (..., 3) [m/u]
    contact: Array  # (..., 3), of the contact point taken as fixed to the knuckle [m/u]
    rotation: Array  # (..., 3) angular velocity of the knuckle [rad/u]
    strut_length: Array  # (...) [m/u]


class Pose(NamedTuple):
    """One front wheel at a rack position and a travel: shapes (...), vectors (..., 3)."""

    toe: Array  # toe-in positive [rad]
    steer_angle: Array  # of the wheel's heading about z, left positive [rad]
    camber: Array  # top leaning inward negative [rad]
    inclination: Array  # ISO 8855, about the heading axis, top leaning right positive [rad]
    caster: Array  # king-pin axis leaning back positive [rad]
    kingpin_inclination: Array  # king-pin axis leaning inward positive [rad]
    trail: Array  # king-pin axis ahead of the contact, along the heading on the ground [m]
    scrub: Array  # contact outboard of the king-pin axis, across the heading on the ground [m]
    wheel_centre: Array  # [m]
    contact: Array  # wheel centre less the loaded radius, down along the wheel plane [m]
    rotation: Array  # (..., 3, 3) of the knuckle from its design pose
    strut_length: Array  # from the axis' lower point to the top mount [m]
    lower_ball_joint: Array  # [m]
    strut_top: Array  # [m]
    tie_rod_outer: Array  # [m]
    tie_rod_inner: Array  # [m]
    per_rack: Motion  # u = rack [m], at fixed travel
    per_travel: Motion  # u = travel [m], at fixed rack

    @property
    def roll_centre_height(self) -> Array:
        """Height above the contact where the normal to the contact's path meets the mid-plane [m]."""
        path = self.per_travel.contact
        return self.contact[..., 1] * path[..., 1] / path[..., 2]

    def at_fixed_strut(self) -> Motion:
        """Derivative with respect to the rack at fixed strut length, a turn about the king-pin axis (S6)."""
        slope = self.per_rack.strut_length / self.per_travel.strut_length
        # (S6)
        centre, contact, turn = (u - slope[..., None] * v for u, v in zip(self.per_rack[:3], self.per_travel[:3]))
        return Motion(centre, contact, turn, np.zeros_like(slope))


class WheelLoad(NamedTuple):
    """Loads of road and drive shaft on one knuckle, in the heading axes of the wheel.

    x is along the heading in the road plane, y left, z up; floats or arrays (...). A longitudinal force acts at the
    contact if a brake on the knuckle holds the wheel against it, and at the wheel centre if the drive shaft holds it or
    nothing does (rolling resistance). ``M_y`` reaches the knuckle through the brake only; for a rolling wheel it is
    zero here. The weight of the unsprung mass and the forces of anti-roll bar and bump stop, which act along the
    travel, are a negative ``F_z_centre``.
    """

    F_x_contact: ArrayLike = 0.0  # [N]
    F_x_centre: ArrayLike = 0.0  # [N]
    F_y: ArrayLike = 0.0  # at the contact [N]
    F_z: ArrayLike = 0.0  # at the contact [N]
    M_x: ArrayLike = 0.0  # [N m]
    M_y: ArrayLike = 0.0  # [N m]
    M_z: ArrayLike = 0.0  # [N m]
    F_z_centre: ArrayLike = 0.0  # at the wheel centre: what else pushes the wheel up or, negative, down [N]


def load_coefficients(pose: Pose) -> WheelLoad:
    """Work (...) of each unit load per metre of rack, at fixed strut length: forces [1], moments [rad/m]."""
    motion = pose.at_fixed_strut()
    # Turned back by the steer angle, x + iy of car axes becomes ahead + i left of the heading.
    back = np.exp(-1j * pose.steer_angle)
    centre, contact, turn = (back * (v[..., 0] + 1j * v[..., 1]) for v in motion[:3])
    forces = (contact.real, centre.real, contact.imag, motion.contact[..., 2])
    return WheelLoad(*forces, turn.real, turn.imag, motion.rotation[..., 2], motion.wheel_centre[..., 2])


def rack_force(pose: Pose, load: WheelLoad) -> Array:
    """Rack force of one front wheel, by virtual work on its knuckle (S7).

    F_rack = -sum(F . dp/drack + M . dphi/drack) at fixed strut length. At fixed *travel* the strut changes its length
    as the wheel steers, and its spring, which carries the wheel load along the inclined axis, does work too. Omitting
    that work loses the self-centring effect of the wheel load (strut S1, 3.7 kN for each wheel, 30 mm of rack: -43.5 N
    instead of +269.9 N). The balance in the travel direction eliminates the spring and gives the sum above:
    d/drack = d/drack|travel - d/dtravel (dl/drack)/(dl/dtravel). The sum is over all loads that this balance contains:
    the weight of the unsprung mass and the force of the anti-roll bar rest on the wheel, not on the strut.

    Parameters
    ----------
    pose, load : Pose, WheelLoad
        Of the left or the right wheel, floats or arrays (...).

    Returns
    -------
    F_rack : (...) array
        Positive where it resists a left turn [N]. The rack carries the sum of both wheels.

    Source: virtual work, derived here; equal to the static equilibrium of the knuckle.
    """
    work = [c * np.asarray(f) for c, f in zip(load_coefficients(pose), load)]
    return -np.sum(np.broadcast_arrays(*work), axis=0)  # (S7)


def mirrored(pose: Pose) -> Pose:
    """The mirror image of a pose on the mid-plane: the right wheel at the opposite rack position."""

    def motion(m: Motion, sign: float) -> Motion:
        centre, contact, turn = sign * MIRROR * m.wheel_centre, sign * MIRROR * m.contact, -sign * MIRROR * m.rotation
        return Motion(centre, contact, turn, sign * m.strut_length)

    points = ("wheel_centre", "contact", "lower_ball_joint", "strut_top", "tie_rod_outer", "tie_rod_inner")
    return pose._replace(
        steer_angle=-pose.steer_angle,
        inclination=-pose.inclination,
        rotation=MIRROR[:, None] * pose.rotation * MIRROR,
        per_rack=motion(pose.per_rack, -1.0),
        per_travel=motion(pose.per_travel, 1.0),
        **{name: MIRROR * getattr(pose, name) for name in points},
    )
