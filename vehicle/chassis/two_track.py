"""Two-track chassis: a body with six degrees of freedom, four wheels that move up and down in it, four wheel spins.

The body runs in body axes (x forward, y left, z up) with its origin O at the car's centre of gravity in the design
position; unsprung masses m_i at r_i move along the body's z with travel s_i. With velocities v, w of O and

    T = m v^2/2 + w I w/2 + sum m_i s_i' (v_z + w_x y_i - w_y x_i) + sum m_i s_i'^2/2 + sum I_w spin_i^2/2
    G = dT/dv,  H = dT/dw,  h_i = dT/ds_i'
    G' = F - w x G         H' = N - w x H         h_i' = Q_i + m_i (v_x w_y - v_y w_x)

the equations are Lagrange's in quasi-velocities, of first order in the travel: -v x G of a frozen inertia and the
moving masses' own v cancel, and the energy books close exactly. Generalised forces are virtual work of the tyre forces
on the velocities that define slip and compression: spring, damper, anti-roll bar and bump stop act along the travel;
lateral forces work on the contact's path (roll centre), longitudinal forces on the wheel centre's, brake torques on the
carrier's pitch (anti-dive). The front path is the strut's own solution, the rear one linear. A spin is the wheel's
absolute turning speed about its axle.

Rotations: yaw, then pitch, then roll. "Road frame" is the body's frame without pitch and roll; tyre forces act there.
Each tyre relaxes along both slips; its torsion about z is a friction law's, driven by the patch's turning and carried
off with the rolling, so that parking, creeping and driving are one model.

Source: derived here; parameters in the car's data file.
"""

import math
from typing import Any, NamedTuple

import numpy as np

from steer_env.friction import law
from steer_env.friction.numerics.bounds import within
from steer_env.friction.numerics.kernel import kernel
from steer_env.vehicle import chassis, road, tyre
from steer_env.vehicle.chassis import single_track
from steer_env.vehicle.chassis.common import drivetrain
from steer_env.vehicle.chassis.common.interface import (
    BRAKE,
    COAST,
    HAND_BRAKE,
    TARGET_SPEED,
    THROTTLE,
    WIND_FORCE,
    WIND_MOMENT,
)
from steer_env.vehicle.simd import (
    any_of,
    copysign,
    cos,
    fabs,
    load,
    maximum,
    minimum,
    pack,
    sin,
    sqrt,
    store,
    swap_sides,
    unpack,
    where,
)
from steer_env.vehicle.suspension import kinematics_table

WHEELS = ("front_left", "front_right", "rear_left", "rear_right")


def _each(name: str, unit: str) -> tuple[tuple[str, str], ...]:
    return tuple((f"{name}_{wheel}", unit) for wheel in WHEELS)


STATES = (
    ("body_speed_x", "m/s"),
    ("body_speed_y", "m/s"),
    ("body_speed_z", "m/s"),
    ("body_rate_x", "rad/s"),
    ("body_rate_y", "rad/s"),
    ("body_rate_z", "rad/s"),
    ("roll_angle", "rad"),
    ("pitch_angle", "rad"),
    ("yaw_angle", "rad"),
    ("x", "m"),
    ("y", "m"),
    ("height", "m"),
    *_each("travel", "m"),
    *_each("travel_rate", "m/s"),
    *_each("wheel_spin", "rad/s"),
    *_each("kappa", "1"),
    *_each("tan_alpha", "1"),
    *_each("torsion", "rad"),
    ("compliance_travel", "m"),
    ("speed_hold_integral", "m/s2"),
    ("distance", "m"),
    ("gear", "1"),
    ("shift_time_left", "s"),
)
U, V, W, P, Q, R, ROLL, PITCH, YAW, X, Y, Z, TRAVEL = range(13)
TRAVEL_RATE, SPIN, KAPPA, ALPHA, TORSION, COMPLIANCE = range(16, 37, 4)
INTEGRAL, DISTANCE, GEAR, SHIFT = range(COMPLIANCE + 1, COMPLIANCE + 5)

OUTPUTS = (
    *single_track.OUTPUTS,
    ("longitudinal_speed", "m/s"),
    ("lateral_speed", "m/s"),
    ("yaw_rate", "rad/s"),
    ("longitudinal_acceleration", "m/s2"),
    ("throttle", "1"),
    ("brake_pedal", "1"),
    ("front_drive_torque", "N m"),
    ("rear_drive_torque", "N m"),
    *_each("longitudinal_force", "N"),
    *_each("lateral_force", "N"),
    *_each("aligning_torque", "N m"),
    *_each("spin_torque", "N m"),  # of the road on the wheel, about its axle
    # What sums over the wheels are made of, in the road frame and along the travel.
    *_each("force_x", "N"),
    *_each("force_y", "N"),
    *_each("moment_x", "N m"),
    *_each("moment_y", "N m"),
    *_each("moment_z", "N m"),
    *_each("travel_force", "N"),
    ("hold_throttle", "1"),  # the speed hold's part of the throttle
    ("hold_pedal", "1"),
)
_LOAD = 3
_SPEED = len(single_track.OUTPUTS)
_THROTTLE, _PEDAL, _DRIVE = _SPEED + 4, _SPEED + 5, _SPEED + 6
_FX = _SPEED + 8
_FY, _MZ, _SPIN_TORQUE, _X, _Y, _MX, _MY, _MZ_SUM, _Q = range(_FX + 4, _FX + 40, 4)
_HOLD = _Q + 4
_SIZE, _OUTPUTS, _LEAD = len(STATES), len(OUTPUTS), len(single_track.PUBLISHED)

# Published: what the single track publishes, then these states and outputs.
_EXTRA_STATES = (PITCH, Z, *range(TRAVEL, TRAVEL + 4), *range(SPIN, ALPHA + 4), GEAR)
_EXTRA_OUTPUTS = (_SPEED, *range(_SPEED + 3, _SPIN_TORQUE))
_PLACE = _LEAD + _SPEED + len(_EXTRA_STATES) + _EXTRA_OUTPUTS.index(_THROTTLE)  # of the pedals among the channels
CHANNELS = (
    *single_track.CHANNELS,
    *(STATES[i] for i in _EXTRA_STATES),
    *(OUTPUTS[i] for i in _EXTRA_OUTPUTS),
)

SPIN_BLEND = 1.0  # rolling speed at which pneumatic trail and rolling resistance are whole, assumed [m/s]
DAMPED_BELOW = 3.0  # rolling speed at which the tyres' structural damping has faded, assumed [m/s]
LARGEST_SLIP = 2.0  # a sliding patch carries no more of its past than this, assumed [1]
FASTEST_FADING = 400.0  # of torsion, for the sake of the 2 ms nodes [1/s]
FORGETTING = 100.0  # rate at which a tyre that comes to rest forgets slip that its force cannot hold, assumed [1/s]
STOP_SOFTNESS = 0.01  # travel over which a bump stop takes up its stiffness, assumed [m]


class Body(NamedTuple):
    """Numbers of the chassis, as a record for the kernels; built and checked by :mod:`steer_env.vehicle.cars`."""

    speed: float  # held speed [m/s]
    mu: float  # factor on the road's friction [1]
    m: float  # mass [kg]
    m_f: float  # unsprung mass of each front wheel [kg]
    m_r: float  # of each rear wheel [kg]
    a: float  # O to front axle [m]
    b: float  # O to rear axle [m]
    I_x: float  # roll inertia less what moves with the travel, sum of m_i y_i^2 [kg m2]
    I_y: float  # pitch inertia less sum of m_i x_i^2 [kg m2]
    I_z: float  # yaw inertia [kg m2]
    I_xz: float  # product of inertia, positive where mass ahead is high [kg m2]
    I_w: float  # of a wheel about its axle [kg m2]
    h: float  # height of O in the design position [m]
    t_f: float  # front track [m]
    t_r: float  # rear track [m]
    R_l: float  # loaded radius in the design position [m]
    R_e: float  # effective rolling radius [m]
    K_t: float  # vertical tyre stiffness [N/m]
    F_zf: float  # load of each front wheel in the design position [N]
    F_zr: float  # of each rear wheel [N]
    S_f: float  # force along each front strut in the design position [N]
    K_f: float  # front spring, along the strut [N/m]
    C_f: float  # front damper, along the strut [N s/m]
    S_r: float  # the same at the rear, along the travel [N]
    K_r: float  # [N/m]
    C_r: float  # [N s/m]
    B_f: float  # anti-roll bar, force on each front wheel over the difference of the travels [N/m]
    B_r: float  # rear [N/m]
    clear_f: float  # travel free of bump stops, either way [m]
    clear_r: float  # rear [m]
    K_stop: float  # stiffness of the bump stops [N/m]
    steer_r: float  # rear steer angle by travel, left wheel [rad/m]
    camber_r: float  # rear inclination by travel, left wheel [rad/m]
    give_r: float  # rear steer angle by lateral force on the wheel [rad/N]
    path_r: float  # rear contact's way to the left by travel, left wheel [1]
    K_rack: float  # compliance between rack and both road wheels, seen at the rack [N/m]
    T_rack: float  # its time constant [s]
    sigma_x: float  # longitudinal relaxation length [m]
    sigma_y: float  # lateral relaxation length [m]
    d_x: float  # structural damping of the tyre at standstill, slip over slip speed [s/m]
    d_y: float  # lateral [s/m]
    torsion_load: float  # load to which the torsion law's parameters belong [N]
    sigma_z: float  # way that wipes out torsion [m]
    g_x: float  # gravity along the road's x at yaw angle 0, from grade [m/s2]
    g_y: float  # along its y, from bank [m/s2]
    g_z: float  # across it, negative [m/s2]
    drag: float  # air drag over speed squared [kg/m]
    lift_f: float  # front lift over speed squared [kg/m]
    lift_r: float  # rear lift over speed squared [kg/m]


class TwoTrack(NamedTuple):
    """Parameters as the kernels take them."""

    body: np.recarray  # one Body
    torsion: Any  # friction law of a tyre's torsion, torque over the turning of the contact patch
    drive: drivetrain.Drivetrain
    brakes: drivetrain.Brakes
    hold: drivetrain.SpeedHold
    road: road.Road


@kernel
def _unit(x):
    """Within 0 and 1."""
    return within(x, 0.0, 1.0)


@kernel
def _pressed(out, before, s, u):
    """Throttle and brake pedal under a row of inputs, ``s`` node intervals after the last node."""
    throttle = _unit(out[_HOLD] + s * (out[_HOLD] - before[_HOLD]))
    pedal = _unit(out[_HOLD + 1] + s * (out[_HOLD + 1] - before[_HOLD + 1]))
    return _unit(throttle + u[THROTTLE]), _unit(pedal + u[BRAKE])


# Helpers of the four wheels, which run side by side as :mod:`steer_env.vehicle.simd` has them.


@kernel
def _axles(front, rear):
    """What both wheels of each axle have."""
    return pack(front, front, rear, rear)


@kernel
def _front(left, right):
    """What only the front wheels have."""
    return pack(left, right, 0.0, 0.0)


@kernel
def _stop(stiffness, clearance, s):
    """Force of bump and rebound stop on the wheel at travel ``s``, downwards in bump."""
    beyond = maximum(fabs(s) - clearance, 0.0)
    return copysign(stiffness * beyond * beyond / (beyond + STOP_SOFTNESS), s)


@kernel
def _fade(v, whole):
    """From 0 at standstill to 1 at ``whole`` and beyond, odd and smooth."""
    s = minimum(maximum(v * (1.0 / whole), -1.0), 1.0)
    return s * (1.5 - 0.5 * s * s)


@kernel
def _limited(rate, slip):
    """Rate of a slip that may not grow beyond its limit."""
    return where((fabs(slip) > LARGEST_SLIP) & (rate * slip > 0.0), 0.0, rate)


@kernel
def _let_go(slip, force, stiffness, rolling):
    """Rate at which a tyre that comes to rest sliding forgets slip beyond what its force bends the carcass to."""
    beyond = fabs(slip) - maximum(2.0 * fabs(force) / (stiffness + 1.0), rolling / SPIN_BLEND)
    rate = copysign(FORGETTING * maximum(beyond, 0.0), -slip)
    return where(rolling < LARGEST_SLIP * SPIN_BLEND, rate, 0.0)


@kernel
def _turned(angle):
    """Cosine and sine of an angle within a right angle; a root is cheaper than a second series."""
    s = sin(angle)
    return sqrt(1.0 - s * s), s


@kernel
def _pair(x):
    """Sum over the wheels that is the same to the bit for the mirrored car."""
    fl, fr, rl, rr = unpack(x)
    return (fl + fr) + (rl + rr)


@kernel
def _torsion(p, level, memory, turning, rate):
    """Torque of one tyre's torsion on the road; its memory's rate by the turning alone goes to ``rate``."""
    law.rate(p, level, memory, turning, rate)
    return law.torque(p, level, memory, turning)


@kernel
def derivative(p, strut, c, x, rack, rack_rate, u, dx, out):
    """Time derivative of the chassis and the rack force that it makes.

    Parameters
    ----------
    p : TwoTrack
    strut : strut_map.StrutMap
    c : tyre.MagicFormula
        The tyres; without left-right asymmetry, so that straight running is straight to the last bit.
    x : (S,) array
        States, as in ``STATES``.
    rack, rack_rate : float
        Rack coordinate, positive where it steers left [m], and its rate [m/s].
    u : (I,) array
        Inputs, as in ``steer_env.vehicle.chassis.common.interface.INPUTS``.
    dx : (S,) array
        Receives the derivative.
    out : (O,) array
        Receives the values of ``OUTPUTS``.

    Returns
    -------
    float
        Rack force, positive where it resists a left turn [N].
    """
    d = p.body[0]
    v_x, v_y, v_z, w_x, w_y, w_z = x[U], x[V], x[W], x[P], x[Q], x[R]
    angles = pack(x[ROLL], x[PITCH], x[YAW], 0.0)
    c_r, c_p, c_y, _ = unpack(cos(angles))
    s_r, s_p, s_y, _ = unpack(sin(angles))
    # Body to road frame.
    a11, a12, a13 = c_p, s_p * s_r, s_p * c_r
    a22, a23 = c_r, -s_r
    a31, a32, a33 = -s_p, c_p * s_r, c_p * c_r
    # Velocity of O and angular velocity in the road frame.
    V_x, V_y, V_z = a11 * v_x + a12 * v_y + a13 * v_z, a22 * v_y + a23 * v_z, a31 * v_x + a32 * v_y + a33 * v_z
    W_x, W_y, W_z = a11 * w_x + a12 * w_y + a13 * w_z, a22 * w_y + a23 * w_z, a31 * w_x + a32 * w_y + a33 * w_z
    tie_rods = rack - x[COMPLIANCE]

    # Driver, engine and brakes.
    omega_f, omega_r = 0.5 * (x[SPIN] + x[SPIN + 1]), 0.5 * (x[SPIN + 2] + x[SPIN + 3])
    gear, engaged = x[GEAR], x[SHIFT] <= 0.0
    throttle = pedal = 0.0
    dx[INTEGRAL] = 0.0
    if u[COAST] <= 0.0:
        demand, dx[INTEGRAL] = drivetrain.longitudinal_demand(p.hold, v_x, d.speed + u[TARGET_SPEED], x[INTEGRAL])
        mass = d.m + 4.0 * d.I_w / (d.R_e * d.R_e)
        throttle, pedal = drivetrain.split(p.drive, p.brakes, gear, engaged, demand, mass, d.R_e, omega_f, omega_r)
    out[_HOLD], out[_HOLD + 1] = throttle, pedal
    throttle, pedal = _unit(throttle + u[THROTTLE]), _unit(pedal + u[BRAKE])
    drive_f, drive_r = drivetrain.axle_torques(p.drive, gear, engaged, throttle, omega_f, omega_r)
    brake_f, brake_r = drivetrain.brake_torques(p.brakes, pedal, _unit(u[HAND_BRAKE]))

    # Kinematics of the wheels in the body. A right strut is the left one in a mirror.
    side, front = pack(1.0, -1.0, 1.0, -1.0), pack(1.0, 1.0, 0.0, 0.0) > 0.0
    s, s_rate = load(x, TRAVEL), load(x, TRAVEL_RATE)
    travel_l, travel_r = x[TRAVEL], x[TRAVEL + 1]
    left, right = kinematics_table.left(strut, tie_rods, travel_l), kinematics_table.left(strut, -tie_rods, travel_r)
    knuckle = kinematics_table.Knuckle(
        _front(left.steer_angle, right.steer_angle),
        _front(left.inclination, right.inclination),
        _front(left.F_x_contact, right.F_x_contact),
        _front(left.F_x_centre, right.F_x_centre),
        _front(left.F_y, right.F_y),
        _front(left.F_z, right.F_z),
        _front(left.M_x, right.M_x),
        _front(left.M_z, right.M_z),
    )
    up_l, up_r = (
        kinematics_table.left_travel(strut, tie_rods, travel_l),
        kinematics_table.left_travel(strut, -tie_rods, travel_r),
    )
    centre_x, carrier_pitch = _front(up_l.centre_x, up_r.centre_x), _front(up_l.pitch, up_r.pitch)
    contact_y = side * pack(up_l.contact_y, up_r.contact_y, d.path_r, d.path_r)
    lean = side * pack(up_l.roll, up_r.roll, d.camber_r, d.camber_r)
    compression = where(front, _front(up_l.compression, up_r.compression), s)
    compression_rate = pack(up_l.compression_rate, up_r.compression_rate, 1.0, 1.0)
    steer = side * where(front, knuckle.steer_angle, d.steer_r * s)
    camber = side * where(front, knuckle.inclination, d.camber_r * s) + x[ROLL]  # to the road, at small pitch and roll
    turning = W_z + knuckle.M_z * rack_rate
    spring = (
        _axles(d.S_f, d.S_r) + _axles(d.K_f, d.K_r) * compression + _axles(d.C_f, d.C_r) * compression_rate * s_rate
    )
    spring = compression_rate * spring + _axles(d.B_f, d.B_r) * (s - swap_sides(s))
    spring += _stop(d.K_stop, _axles(d.clear_f, d.clear_r), s)

    # Wheel centre from O in the road frame, height over the road, load.
    arm, y_i, z_i = _axles(d.a, -d.b), side * _axles(0.5 * d.t_f, 0.5 * d.t_r), d.R_l - d.h + s
    r_x = a11 * arm + a12 * y_i + a13 * z_i
    r_y = a22 * y_i + a23 * z_i
    r_z = a31 * arm + a32 * y_i + a33 * z_i
    ground, slope, mu = road.under_wheels(p.road, x[DISTANCE] + d.a, x[DISTANCE] - d.b)
    mu *= d.mu
    # A leaning wheel meets the road in its own plane, off the line below its centre. Of second order in camber: the
    # loaded radius is below (1 + camber^2/2), so that F_z at ``aside`` is its tyre spring's virtual work.
    below = x[Z] + r_z - ground
    aside, longer = below * camber, 1.0 + 0.5 * camber * camber
    F_z = maximum(_axles(d.F_zf, d.F_zr) + d.K_t * (d.R_l - below * longer), 0.0) * longer

    # Velocities of the wheel centre along x and of the contact along y: they define slip, and forces work on them.
    centre = V_x + W_y * r_z - W_z * (r_y + aside) + (a13 + centre_x) * s_rate
    contact = V_y + W_z * r_x - W_x * (r_z - below) + (a23 + contact_y) * s_rate
    ahead = centre - below * (W_y + carrier_pitch * s_rate)  # of the contact, along x
    c_s, s_s = _turned(steer)
    spin, rolling = load(x, SPIN), centre * c_s + contact * s_s
    slip_x, slip_y = rolling - d.R_e * spin, contact * c_s - ahead * s_s

    # Forces of the relaxed slips; the tyre's structure damps them at standstill, where rolling does not.
    kappa, tan_a = load(x, KAPPA), load(x, ALPHA)
    fast = fabs(rolling)
    slow = 1.0 - minimum(fast * (1.0 / DAMPED_BELOW), 1.0)
    slow *= slow
    F_x, F_y, M_x, M_y, M_z = tyre.forces_of_four(
        c, kappa - d.d_x * slow * slip_x, tan_a + d.d_y * slow * slip_y, camber, F_z, fast, mu
    )
    whole = _fade(rolling, SPIN_BLEND)
    M_y *= whole

    # Torsion about z. Fast rolling, or fast turning under a small load, leaves nothing of it: keep the rule stable.
    relative = F_z * (1.0 / d.torsion_load)
    level = maximum(mu * relative * sqrt(relative), 1e-9)
    level_fl, level_fr, level_rl, level_rr = unpack(level)
    turning_fl, turning_fr, turning_rl, turning_rr = unpack(turning)
    k = TORSION
    torsion = pack(
        _torsion(p.torsion, level_fl, x[k : k + 1], turning_fl, dx[k : k + 1]),
        _torsion(p.torsion, level_fr, x[k + 1 : k + 2], turning_fr, dx[k + 1 : k + 2]),
        _torsion(p.torsion, level_rl, x[k + 2 : k + 3], turning_rl, dx[k + 2 : k + 3]),
        _torsion(p.torsion, level_rr, x[k + 3 : k + 4], turning_rr, dx[k + 3 : k + 4]),
    )
    M_z = M_z * whole - torsion
    carried = fast * (1.0 / d.sigma_z)
    fastest = carried + fabs(turning) * (p.torsion.sigma_0 / p.torsion.F_c) / level
    store(dx, k, (load(dx, k) - carried * load(x, k)) * minimum(FASTEST_FADING / (fastest + 1e-9), 1.0))

    if d.give_r != 0.0:
        # Compliance steer needs the force first; only the damping at standstill went without it.
        steer += _axles(0.0, d.give_r) * F_y
        c_s, s_s = _turned(steer)
        rolling = centre * c_s + contact * s_s
        slip_x, slip_y = rolling - d.R_e * spin, contact * c_s - ahead * s_s
        fast = fabs(rolling)
    kappa_rate = _limited((-slip_x - fast * kappa) * (1.0 / d.sigma_x), kappa)
    alpha_rate = _limited((slip_y - fast * tan_a) * (1.0 / d.sigma_y), tan_a)
    if any_of(fast < LARGEST_SLIP * SPIN_BLEND):
        K_x, K_y = tyre.stiffnesses(c, F_z)
        kappa_rate += _let_go(kappa, F_x, K_x, fast)
        alpha_rate += _let_go(tan_a, F_y, K_y, fast)
    store(dx, KAPPA, kappa_rate)
    store(dx, ALPHA, alpha_rate)

    # A brake that slides gives its capacity; one that holds, what the wheel needs to stand still.
    capacity, drive = _axles(brake_f, brake_r), _axles(0.5 * drive_f, 0.5 * drive_r)
    road_torque = M_y - d.R_e * F_x
    held = minimum(maximum(road_torque + drive, -capacity), capacity)
    brake = where(spin == 0.0, held, copysign(capacity, spin))
    braked = -brake * (1.0 / d.R_e)  # the part of F_x that the brake holds
    rack_left, rack_right, _, _ = unpack(
        kinematics_table.rack_force(
            knuckle, side * braked, side * (F_x - braked - F_z * slope), F_y, side * F_z, M_x, M_z
        )
    )
    rack_force = rack_left + rack_right

    X_i, Y_i = F_x * c_s - F_y * s_s - F_z * slope, F_x * s_s + F_y * c_s  # the road pushes square to itself
    moment_x = (r_y + aside) * F_z - (r_z - below) * Y_i + M_x * c_s
    # F_x acts at the wheel centre, its moment about the axle being the wheel's own; the rest on the ground.
    grounded = below * (F_y * s_s + F_z * slope)
    moment_y = r_z * X_i + grounded - r_x * F_z + M_x * s_s + brake - drive
    moment_z = r_x * Y_i - (r_y + aside) * X_i + M_z
    travel_force = (
        a33 * F_z
        + lean * (aside * F_z + M_x)
        + (a13 + centre_x) * X_i
        + (a23 + contact_y) * Y_i
        + carrier_pitch * (brake + grounded)
        - spring
        + _axles(d.m_f, d.m_r) * (d.g_z + w_y * v_x - w_x * v_y)
    )
    out[1], out[2], _, _ = unpack(steer)
    store(out, _LOAD, F_z)
    store(out, _FX, F_x)
    store(out, _FY, F_y)
    store(out, _MZ, M_z)
    store(out, _SPIN_TORQUE, road_torque)
    store(out, _X, X_i)
    store(out, _Y, Y_i)
    store(out, _MX, moment_x)
    store(out, _MY, moment_y)
    store(out, _MZ_SUM, moment_z)
    store(out, _Q, travel_force)
    store(dx, SPIN, road_torque + drive - brake)

    # The shafts give the wheels, and the body the other way, less than the engine gives where it speeds up.
    engine = 0.0
    J_f, J_r = _reflected(p, x, omega_f, omega_r)
    for i, J in ((SPIN, J_f), (SPIN + 2, J_r)):
        mean, half = 0.5 * (dx[i] + dx[i + 1]) / (d.I_w + 0.5 * J), 0.5 * (dx[i] - dx[i + 1]) / d.I_w
        engine += J * mean
        dx[i], dx[i + 1] = mean + half, mean - half

    # What acts on the whole car, in the road frame, then in the body's.
    speed_2 = V_x * V_x
    wind = u[WIND_FORCE]
    side_force = _pair(Y_i) + wind
    along = _pair(X_i) - math.copysign(d.drag * speed_2, V_x)
    F_x = along + d.m * (d.g_x * c_y + d.g_y * s_y)
    F_y = side_force + d.m * (d.g_y * c_y - d.g_x * s_y)
    F_z = _pair(F_z) + (d.lift_f + d.lift_r) * speed_2 + d.m * d.g_z
    N_x = _pair(moment_x)
    N_y = _pair(moment_y) + engine + (d.b * d.lift_r - d.a * d.lift_f) * speed_2
    N_z = _pair(moment_z) + u[WIND_MOMENT]
    f_x, f_y, f_z = a11 * F_x + a31 * F_z, a12 * F_x + a22 * F_y + a32 * F_z, a13 * F_x + a23 * F_y + a33 * F_z
    n_x, n_y, n_z = a11 * N_x + a31 * N_z, a12 * N_x + a22 * N_y + a32 * N_z, a13 * N_x + a23 * N_y + a33 * N_z

    # Momenta. Axle by axle: sum and difference of the travel rates.
    half_f, half_r = 0.5 * d.t_f, 0.5 * d.t_r
    up_f, up_r = x[TRAVEL_RATE] + x[TRAVEL_RATE + 1], x[TRAVEL_RATE + 2] + x[TRAVEL_RATE + 3]
    tilt_f, tilt_r = x[TRAVEL_RATE] - x[TRAVEL_RATE + 1], x[TRAVEL_RATE + 2] - x[TRAVEL_RATE + 3]
    rising = d.m_f * up_f + d.m_r * up_r
    G_x, G_y, G_z = d.m * v_x, d.m * v_y, d.m * v_z + rising
    I_xx = d.I_x + 2.0 * (d.m_f * half_f * half_f + d.m_r * half_r * half_r)
    I_yy = d.I_y + 2.0 * (d.m_f * d.a * d.a + d.m_r * d.b * d.b)
    H_x = I_xx * w_x - d.I_xz * w_z + (d.m_f * half_f * tilt_f + d.m_r * half_r * tilt_r)
    H_y = I_yy * w_y - (d.m_f * d.a * up_f - d.m_r * d.b * up_r) + d.I_w * _pair(spin)
    H_z = d.I_z * w_z - d.I_xz * w_x
    f_x -= w_y * G_z - w_z * G_y
    f_y -= w_z * G_x - w_x * G_z
    f_z -= w_x * G_y - w_y * G_x
    n_x -= w_y * H_z - w_z * H_y
    n_y -= w_z * H_x - w_x * H_z
    n_z -= w_x * H_y - w_y * H_x

    # Accelerations, the travels eliminated: s_i'' = Q_i/m_i - v_z' - y_i w_x' + x_i w_y'.
    Q_f, Q_r = out[_Q] + out[_Q + 1], out[_Q + 2] + out[_Q + 3]
    heave, pitch = f_z - (Q_f + Q_r), n_y + (d.a * Q_f - d.b * Q_r)
    roll = n_x - (half_f * (out[_Q] - out[_Q + 1]) + half_r * (out[_Q + 2] - out[_Q + 3]))
    m_s, offset = d.m - 2.0 * (d.m_f + d.m_r), 2.0 * (d.m_f * d.a - d.m_r * d.b)
    per_pitch = 1.0 / (m_s * d.I_y - offset * offset)
    per_roll = 1.0 / (d.I_x * d.I_z - d.I_xz * d.I_xz)
    lift, nod = (d.I_y * heave - offset * pitch) * per_pitch, (m_s * pitch - offset * heave) * per_pitch
    lean = (d.I_z * roll + d.I_xz * n_z) * per_roll
    dx[U], dx[V], dx[W] = f_x / d.m, f_y / d.m, lift
    dx[P], dx[Q], dx[R] = lean, nod, (d.I_x * n_z + d.I_xz * roll) * per_roll
    turn = w_y * s_r + w_z * c_r
    dx[ROLL], dx[PITCH], dx[YAW] = w_x + turn * s_p / c_p, w_y * c_r - w_z * s_r, turn / c_p
    dx[X], dx[Y], dx[Z] = V_x * c_y - V_y * s_y, V_x * s_y + V_y * c_y, V_z
    for i in range(4):
        dx[TRAVEL + i] = x[TRAVEL_RATE + i]
    front, rear = lift - d.a * nod, lift + d.b * nod
    dx[TRAVEL_RATE] = out[_Q] / d.m_f - front - half_f * lean
    dx[TRAVEL_RATE + 1] = out[_Q + 1] / d.m_f - front + half_f * lean
    dx[TRAVEL_RATE + 2] = out[_Q + 2] / d.m_r - rear - half_r * lean
    dx[TRAVEL_RATE + 3] = out[_Q + 3] / d.m_r - rear + half_r * lean
    dx[COMPLIANCE] = (rack_force / d.K_rack - x[COMPLIANCE]) / d.T_rack
    dx[DISTANCE] = V_x
    dx[GEAR] = dx[SHIFT] = 0.0  # events, not motion: see _advance

    out[0] = side_force / d.m
    out[7], out[8] = out[_Y] + out[_Y + 1], out[_Y + 2] + out[_Y + 3]
    out[_SPEED], out[_SPEED + 1], out[_SPEED + 2], out[_SPEED + 3] = V_x, V_y, W_z, along / d.m
    out[_THROTTLE], out[_PEDAL], out[_DRIVE], out[_DRIVE + 1] = throttle, pedal, drive_f, drive_r
    return rack_force


@kernel
def _reflected(p, x, omega_f, omega_r):
    """Engine inertia on the mean spin of front and rear axle [kg m2]."""
    J = drivetrain.reflected_inertia(p.drive, x[GEAR], x[SHIFT] <= 0.0, omega_f, omega_r)
    return p.drive.front_share * J, (1.0 - p.drive.front_share) * J


@kernel
def _advance(p, x, rate, before, out, out_before, s, h, u):
    """Every state by the nodes' polynomial, but the spins, which brakes may hold, and the gear."""
    d = p.body[0]
    spins = x[SPIN], x[SPIN + 1], x[SPIN + 2], x[SPIN + 3]
    chassis.extrapolated_step(x, rate, before, s, h)
    omega_f, omega_r = 0.5 * (spins[0] + spins[1]), 0.5 * (spins[2] + spins[3])
    J_f, J_r = _reflected(p, x, omega_f, omega_r)
    _, pedal = _pressed(out, out_before, s, u)
    hold_f, hold_r = drivetrain.brake_torques(p.brakes, pedal, u[HAND_BRAKE])
    for i, drive, J, hold in ((0, _DRIVE, J_f, hold_f), (2, _DRIVE + 1, J_r, hold_r)):
        half = 0.5 * (out[drive] + s * (out[drive] - out_before[drive]))
        k = _SPIN_TORQUE + i
        left = out[k] + s * (out[k] - out_before[k]) + half
        right = out[k + 1] + s * (out[k + 1] - out_before[k + 1]) + half
        x[SPIN + i], x[SPIN + i + 1], _, _ = drivetrain.axle_spin_step(
            d.I_w, J, spins[i], spins[i + 1], left, right, hold, hold, h
        )
    x[GEAR], x[SHIFT] = drivetrain.shift(p.drive, x[GEAR], x[SHIFT], out[_THROTTLE], omega_f, omega_r, h)


@kernel
def _report(p, x, out, before, s, u, row):
    row[0] = out[_SPEED + 1] + s * (out[_SPEED + 1] - before[_SPEED + 1])
    row[1] = out[_SPEED + 2] + s * (out[_SPEED + 2] - before[_SPEED + 2])
    row[2] = x[ROLL]
    row[3] = x[YAW]
    row[4] = x[X]
    row[5] = x[Y]
    now, then = out[_DRIVE] + out[_DRIVE + 1], before[_DRIVE] + before[_DRIVE + 1]
    row[6] = (now + s * (now - then)) / p.body[0].R_e
    for i in range(_SPEED):
        row[_LEAD + i] = out[i] + s * (out[i] - before[i])
    k = _LEAD + _SPEED
    for i in _EXTRA_STATES:
        row[k] = x[i]
        k += 1
    for i in _EXTRA_OUTPUTS:
        row[k] = out[i] + s * (out[i] - before[i])
        k += 1
    row[_PLACE], row[_PLACE + 1] = _pressed(out, before, s, u)


@kernel
def _speed(p, x):
    return abs(x[U])


@kernel
def _state_size(p):
    return _SIZE


@kernel
def _output_size(p):
    return _OUTPUTS


def start(p: TwoTrack) -> list[float]:
    """States of running straight at the held speed in the design position; the plant settles them."""
    d = p.body[0]
    x = [0.0] * _SIZE
    x[U], x[Z], x[GEAR] = float(d.speed), float(d.h), 1.0
    spin = x[U] / float(d.R_e)
    x[SPIN : SPIN + 4] = [spin] * 4
    for _ in p.drive.ratios:
        x[GEAR], _ = drivetrain.shift(p.drive, x[GEAR], 0.0, 0.2, spin, spin, 1.0)
    return x


chassis.register(
    "two_track",
    TwoTrack,
    states=STATES,
    outputs=OUTPUTS,
    channels=CHANNELS,
    start=start,
    derivative=derivative,
    advance=_advance,
    report=_report,
    speed=_speed,
    state_size=_state_size,
    output_size=_output_size,
)
