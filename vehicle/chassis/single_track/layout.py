"""States and parameters of the single-track chassis."""

from typing import NamedTuple

STATES = (
    ("lateral_speed", "m/s"),
    ("yaw_rate", "rad/s"),
    ("roll_angle", "rad"),
    ("roll_rate", "rad/s"),
    ("slip_front_left", "1"),
    ("slip_front_right", "1"),
    ("slip_rear_left", "1"),
    ("slip_rear_right", "1"),
    ("compliance_travel", "m"),
    ("front_geometric_transfer", "N"),
    ("rear_geometric_transfer", "N"),
    ("drive_force", "N"),
    ("yaw_angle", "rad"),
    ("x", "m"),
    ("y", "m"),
)
(
    LATERAL_SPEED,
    YAW_RATE,
    ROLL,
    ROLL_RATE,
    SLIP_FL,
    SLIP_FR,
    SLIP_RL,
    SLIP_RR,
    COMPLIANCE,
    TRANSFER_F,
    TRANSFER_R,
    DRIVE_FORCE,
    YAW,
    X,
    Y,
) = range(len(STATES))

# States that are the first of COMMON_CHANNELS, in their order; the common outputs follow.
REPORTED_STATES = (LATERAL_SPEED, YAW_RATE, ROLL, YAW, X, Y, DRIVE_FORCE)


class SingleTrack(NamedTuple):
    """Parameters as the kernels take them; :mod:`.from_car` builds them."""

    v_x: float  # held speed [m/s]
    mu: float  # friction of the road over that of the tyre measurements [1]
    m: float  # mass [kg]
    m_s: float  # sprung mass [kg]
    m_uf: float  # unsprung mass of the front axle [kg]
    m_ur: float  # unsprung mass of the rear axle [kg]
    a: float  # centre of gravity to front axle [m]
    b: float  # centre of gravity to rear axle [m]
    I_xr: float  # roll inertia about the roll axis, I_x + m_s h^2 [kg m2]
    I_z: float  # yaw inertia [kg m2]
    h: float  # sprung centre of gravity above the roll axis [m]
    t_f: float  # front track [m]
    t_r: float  # rear track [m]
    K_f: float  # roll stiffness of the front axle [N m/rad]
    K_r: float  # roll stiffness of the rear axle [N m/rad]
    B_f: float  # front anti-roll bar: force on each wheel over the roll angle [N/rad]
    C_f: float  # roll damping of the front axle [N m s/rad]
    C_r: float  # roll damping of the rear axle [N m s/rad]
    h_f: float  # front roll-centre height [m]
    h_r: float  # rear roll-centre height [m]
    R_w: float  # loaded wheel radius, height of the unsprung masses [m]
    drag: float  # air drag over speed squared [kg/m]
    sigma_y: float  # lateral relaxation length [m]
    stiffness_f: float  # factor on the cornering stiffness of the front tyres [1]
    stiffness_r: float  # factor on the cornering stiffness of the rear tyres [1]
    roll_steer_r: float  # rear steer angle over the roll angle, positive where rolling right steers left [1]
    roll_camber_r: float  # rear inclination over the roll angle, positive where it leans with the body [1]
    compliance_steer_r: float  # rear steer angle per lateral force on the wheel [rad/N]
    K_rack: float  # compliance between rack and both road wheels, seen at the rack [N/m]
    T_rack: float  # time constant of the steering compliance [s]
    T_load: float  # time constant of the geometric load transfer [s]
    T_drive: float  # time constant of the speed hold [s]
