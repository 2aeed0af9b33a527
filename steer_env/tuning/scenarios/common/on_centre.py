"""The on-centre test and its metrics, which every scenario contains."""

from steer_env.tuning.scenarios.common.definition import drive

# Three settled cycles are the fewest that the metrics accept.
ON_CENTRE_WEAVE = drive("weave", at_context_speed=True, thinning=10, cycles=5)
# Tyres and chassis decide these metrics; an assist changes them little, through the twist of the torsion bar alone.
WEIGHTS_OF_CHASSIS_METRICS = dict.fromkeys(
    (
        "steering_sensitivity_at_0p1g",
        "minimum_steering_sensitivity",
        "yaw_rate_gain",
        "yaw_lag",
        "lateral_acceleration_lag",
        "angle_hysteresis",
    ),
    0.0,
)
ON_CENTRE_BOUNDS = {
    "torque_at_0g": 10.0,
    "torque_at_0p1g": 20.0,
    "torque_gradient_at_0g": 200.0,
    "torque_gradient_at_0p1g": 200.0,
    "torque_gradient_ratio": 5.0,
    "lateral_acceleration_at_0nm": 1.0,
    "angle_deadband": 100.0,
    "torque_deadband": 20.0,
    "steering_stiffness": 5.0,
    "peak_handwheel_torque": 25.0,
}
