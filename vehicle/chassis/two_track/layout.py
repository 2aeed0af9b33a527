"""Names, units and positions of the states and outputs of the two-track chassis, and the channels that it reports."""

from steer_env.vehicle.chassis.common.interface import COMMON_CHANNELS, COMMON_OUTPUTS, per_wheel

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
    *per_wheel("travel", "m"),
    *per_wheel("travel_rate", "m/s"),
    *per_wheel("wheel_angular_velocity", "rad/s"),
    *per_wheel("kappa", "1"),
    *per_wheel("tan_alpha", "1"),
    *per_wheel("bore_angle", "rad"),  # memory of the bore friction
    ("compliance_travel_left", "m"),
    ("compliance_travel_right", "m"),
    ("speed_hold_integral", "m/s2"),
    ("distance", "m"),
    ("gear", "1"),
    ("shift_time_left", "s"),
)
# Positions of the states; of a quantity that each wheel or each front wheel has, that of the front left wheel.
U, V, W, P, Q, R, ROLL, PITCH, YAW, X, Y, Z, TRAVEL = range(13)
TRAVEL_RATE, OMEGA, KAPPA, TAN_ALPHA, BORE_ANGLE, COMPLIANCE = range(16, 37, 4)
INTEGRAL, DISTANCE, GEAR, SHIFT_TIME = range(COMPLIANCE + 2, COMPLIANCE + 6)

OUTPUTS = (
    *COMMON_OUTPUTS,
    ("longitudinal_speed", "m/s"),
    ("lateral_speed", "m/s"),
    ("yaw_rate", "rad/s"),
    ("longitudinal_acceleration", "m/s2"),
    ("throttle", "1"),
    ("brake_pedal", "1"),
    ("front_drive_torque", "N m"),
    ("rear_drive_torque", "N m"),
    *per_wheel("longitudinal_force", "N"),
    *per_wheel("lateral_force", "N"),
    *per_wheel("aligning_torque", "N m"),
    *per_wheel("road_torque", "N m"),  # of the road on the wheel, about its axle
    # Contribution of each wheel to the sums over the wheels, in the road frame, and the force along its travel.
    *per_wheel("force_x", "N"),
    *per_wheel("force_y", "N"),
    *per_wheel("moment_x", "N m"),
    *per_wheel("moment_y", "N m"),
    *per_wheel("moment_z", "N m"),
    *per_wheel("travel_force", "N"),
    ("speed_hold_throttle", "1"),  # the part of the throttle that the speed hold commands
    ("speed_hold_pedal", "1"),
)
# Positions of the outputs.
LATERAL_ACCELERATION, STEER_LEFT, STEER_RIGHT, LOAD = range(4)
FRONT_FORCE, REAR_FORCE = LOAD + 4, LOAD + 5
LONGITUDINAL_SPEED, LATERAL_SPEED, YAW_RATE, LONGITUDINAL_ACCELERATION, THROTTLE, PEDAL, DRIVE = range(
    len(COMMON_OUTPUTS), len(COMMON_OUTPUTS) + 7
)
F_X, F_Y, M_Z, ROAD_TORQUE, FORCE_X, FORCE_Y, MOMENT_X, MOMENT_Y, MOMENT_Z, TRAVEL_FORCE = range(
    DRIVE + 2, DRIVE + 42, 4
)
HOLD_THROTTLE, HOLD_PEDAL = TRAVEL_FORCE + 4, TRAVEL_FORCE + 5

STATE_SIZE, OUTPUT_SIZE = len(STATES), len(OUTPUTS)
COMMON_SIZE = len(COMMON_CHANNELS)

# States and outputs that the chassis reports after the common channels.
REPORTED_STATES = (PITCH, Z, *range(TRAVEL, TRAVEL + 4), *range(OMEGA, TAN_ALPHA + 4), GEAR)
REPORTED_OUTPUTS = (LONGITUDINAL_SPEED, *range(LONGITUDINAL_ACCELERATION, ROAD_TORQUE))
CHANNELS = (*COMMON_CHANNELS, *(STATES[i] for i in REPORTED_STATES), *(OUTPUTS[i] for i in REPORTED_OUTPUTS))
# What these channels are and where they are positive; those of each wheel by their names without it.
MEANINGS = {
    "pitch_angle": "pitch angle of the body, positive where its front goes down",
    "height": "height of the centre of gravity of the car above the plane of the road, positive upwards",
    "travel": "travel of the wheel in the body from the design position, positive in bump (wheel up)",
    "wheel_angular_velocity": "angular velocity of the wheel about its axle, positive where it rolls ahead",
    "kappa": "longitudinal slip of the tyre, positive where it drives",
    "tan_alpha": "tangent of the slip angle, positive where the contact drifts to the left of its heading",
    "gear": "gear that is engaged, from 1",
    "longitudinal_speed": "longitudinal speed of the car at its centre of gravity, positive ahead",
    "longitudinal_acceleration": "acceleration by the forces along the car, without that of gravity, positive ahead",
    "throttle": "throttle of speed hold and request together, 0 is closed and 1 open",
    "brake_pedal": "service brake of speed hold and request together, 0 is released and 1 full",
    "front_drive_torque": "torque of the drive on both front wheels together, positive where it drives ahead",
    "rear_drive_torque": "torque of the drive on both rear wheels together, positive where it drives ahead",
    "longitudinal_force": "force of the road on the tyre along the heading of the wheel, positive ahead",
    "lateral_force": "force of the road on the tyre across the heading of the wheel, positive to the left",
    "aligning_torque": "moment of the road on the tyre about the vertical axis, positive where it turns left",
}
# Position of the throttle among the channels; the brake pedal follows it.
THROTTLE_CHANNEL = COMMON_SIZE + len(REPORTED_STATES) + REPORTED_OUTPUTS.index(THROTTLE)
