"""The steering column with two degrees of freedom, stepped by the implicit midpoint rule.

    I1 th1'' + C1 th1' + C_tb (th1' - th2') + K_tb (th1 - th2) = T1                (C1)
    I2 th2'' + C2 th2' + C_tb (th2' - th1') + K_tb (th2 - th1) = T_C - T_F(th2')   (C2)
    T1 = T_hand - I_arm th1'' - C_arm th1' - K_arm th1                             (C3), arms that hold the handwheel

th1 is the handwheel angle, th2 the column angle below the torsion bar, T1 the hand torque, T_C the torque of assist
and rack on the column, and T_F the friction torque, which resists positive th2'. Left is positive everywhere. Over a
step of length h with the mean speeds w1 and w2, equation (C1) is linear and eliminates w1. One scalar equation remains,

    S w2 + mean T_F(w2) = R                                                        (F7)

which the friction law solves; with friction above the bar too there are two (F43). The mean speed w2 is the speed to
observe: the midpoint rule is not L-stable, and the speeds at the ends of the steps contain the oscillations that it
does not damp.

Source: two-degree-of-freedom column of the steering-simulator literature, with the damping of the torsion bar added.
"""

from typing import NamedTuple

from steer_env.friction import sites
from steer_env.friction.numerics import scratch
from steer_env.friction.numerics.kernel import binds, kernel
from steer_env.friction.numerics.simd import where
from steer_env.vehicle.keys import checked

STATES = (
    ("handwheel_angle", "rad"),
    ("handwheel_speed", "rad/s"),
    ("column_angle", "rad"),
    ("column_speed", "rad/s"),
)
# Positions of these states, with which the state array of a plant begins.
HANDWHEEL_ANGLE, HANDWHEEL_SPEED, COLUMN_ANGLE, COLUMN_SPEED = range(4)
SCALES = 2 * sites.MOST_SITES  # of the friction, in both directions


class Column(NamedTuple):
    """Parameters as the kernels take them; :func:`make` checks."""

    I1: float  # handwheel inertia [kg m2]
    I2: float  # inertia below the torsion bar: motor, column, rack, wheels [kg m2]
    K_tb: float  # torsion-bar stiffness [N m/rad]
    C_tb: float  # torsion-bar damping [N m s/rad]
    C1: float  # viscous damping of the handwheel [N m s/rad]
    C2: float  # viscous damping below the torsion bar [N m s/rad]
    I_arm: float = 0.0  # inertia of arms that hold the handwheel [kg m2]
    C_arm: float = 0.0  # damping of arms that hold the handwheel [N m s/rad]
    K_arm: float = 0.0  # stiffness of arms that hold the handwheel to the body of the driver [N m/rad]


def make(
    *,
    I1: float = 0.037,
    I2: float = 0.052,
    K_tb: float = 130.0,
    C_tb: float = 0.07,
    C1: float = 0.0,
    C2: float = 0.6,
) -> Column:
    """Checked column parameters; the defaults are assumed for a compact car with column EPS.

    They lie among published sets (K_tb 115 to 172 N m/rad, usually 2.0 to 2.5 N m/deg; I1 0.04 kg m2). I2 is the sum of
    the motor 0.042 (20.5 squared times its rotor), the column 0.003 and the wheels 0.007; the rack of 3 kg adds 2e-4 on
    a pinion of 7.96 mm.

    Raises
    ------
    ValueError
        An inertia or stiffness that is not positive, or a damping below zero.
    """
    by_wire = K_tb == C_tb == 0.0  # without torsion bar, which a car file has with a wire only
    return Column(
        checked("column", "I1", I1),
        checked("column", "I2", I2),
        0.0 if by_wire else checked("column", "K_tb", K_tb),
        checked("column", "C_tb", C_tb),
        checked("column", "C1", C1),
        checked("column", "C2", C2),
    )


@kernel
def step(c, friction, scales, q, memory, robot, hand, hand_speed, T_C, h):
    """One step with a hand torque, or with a handwheel angle that a robot prescribes.

    Parameters
    ----------
    c : Column
    friction : steer_env.friction.sites.Bound
    scales : (2 n,) array
        Factors on the saturated friction of each site, of positive and of negative motion [1].
    q : (4,) array
        Handwheel angle and speed, column angle and speed [rad, rad/s]; advanced in place.
    memory : (M,) array
        Memory of the law; advanced in place.
    robot : bool
        Whether the angle is prescribed.
    hand : float
        Step-mean hand torque [N m], of arms the torque beyond their impedance; or handwheel angle at the end of the
        step [rad].
    hand_speed : float
        Handwheel speed at the end of the step [rad/s], if the angle is prescribed.
    T_C : float
        Step-mean column torque [N m].
    h : float
        Step [s].

    Returns
    -------
    w1, w2 : float
        Step-mean speeds of handwheel and column [rad/s].
    T_F : float
        Step-mean friction torque, positive where it resists a left turn [N m].
    T1 : float
        Step-mean hand torque [N m]: the given one less that of the arms, or the one that the robot needs.
    """
    K = c.C_tb + 0.5 * h * c.K_tb  # (C4)
    torsion_bar_torque = c.K_tb * (q[HANDWHEEL_ANGLE] - q[COLUMN_ANGLE])  # (C4)
    # (C1) with (C3) over a step: a11 w1 - K w2 = r1 + hand torque (C4)
    inertia = 2.0 * (c.I1 + c.I_arm) / h
    a11 = inertia + c.C1 + c.C_arm + 0.5 * h * c.K_arm + K
    r1 = inertia * q[HANDWHEEL_SPEED] - c.K_arm * q[HANDWHEEL_ANGLE] - torsion_bar_torque
    # (C2) over a step: S w2 + mean T_F = R + K w1 (C6)
    S = 2.0 * c.I2 / h + c.C2 + K
    R = 2.0 * c.I2 / h * q[COLUMN_SPEED] + torsion_bar_torque + T_C
    both = sites.Equations(a11, r1 + hand, K, S, R, h)
    w1 = (hand - q[HANDWHEEL_ANGLE]) / h if robot else q[HANDWHEEL_SPEED]
    w1, w2, T_above, T_F = sites.joint(friction, scales, memory, both, w1, q[COLUMN_SPEED], robot)  # (C6)
    if robot:
        # (C7)
        T1 = c.I1 * (hand_speed - q[HANDWHEEL_SPEED]) / h + c.C1 * w1 + torsion_bar_torque + K * (w1 - w2) + T_above
        q[HANDWHEEL_ANGLE] = hand
        q[HANDWHEEL_SPEED] = hand_speed
    else:
        change = 2.0 * (w1 - q[HANDWHEEL_SPEED])
        # (C3) over a step
        T1 = hand - c.I_arm * change / h - c.C_arm * w1 - c.K_arm * (q[HANDWHEEL_ANGLE] + 0.5 * h * w1)
        q[HANDWHEEL_ANGLE] += h * w1
        q[HANDWHEEL_SPEED] = where(w1 != 0.0, 2.0 * w1 - q[HANDWHEEL_SPEED], 0.0)
    # A sticking contact is at rest at the end of the step and dissipates the remaining momentum (C8).
    q[COLUMN_ANGLE] += h * w2
    q[COLUMN_SPEED] = where(w2 != 0.0, 2.0 * w2 - q[COLUMN_SPEED], 0.0)
    return w1, w2, T_F, T1


@binds(1, sites.bound)
@kernel
def step_torque(c, friction, torque_scale, q, memory, T1, T_C, h):
    """:func:`step` under a hand torque: steering by torque, or free (``T1 = 0``). Returns ``w1, w2, T_F``."""
    scales = scratch.like(q, SCALES)
    sites.uniform(friction, torque_scale, scales)
    return step(c, friction, scales, q, memory, False, T1, 0.0, T_C, h)[:3]


@binds(1, sites.bound)
@kernel
def step_angle(c, friction, torque_scale, q, memory, angle, speed, T_C, h):
    """:func:`step` with a prescribed handwheel angle and speed at its end. Returns ``w1, w2, T_F, T1``."""
    scales = scratch.like(q, SCALES)
    sites.uniform(friction, torque_scale, scales)
    return step(c, friction, scales, q, memory, True, angle, speed, T_C, h)


@kernel
def energy(c, q):
    """Kinetic energy and energy of the torsion bar, without arms: E of (C9) [J]."""
    twist = q[HANDWHEEL_ANGLE] - q[COLUMN_ANGLE]
    # (C9)
    return 0.5 * (c.I1 * q[HANDWHEEL_SPEED] ** 2 + c.I2 * q[COLUMN_SPEED] ** 2 + c.K_tb * twist * twist)
