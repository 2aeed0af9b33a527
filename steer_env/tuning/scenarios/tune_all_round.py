"""Tune the assist for a compromise between on-centre feel, return and effort."""

from steer_env.tuning.scenarios.common.definition import Scenario, drive, register
from steer_env.tuning.scenarios.common.on_centre import (
    ON_CENTRE_BOUNDS,
    ON_CENTRE_WEAVE,
    WEIGHTS_OF_CHASSIS_METRICS,
)

SCENARIO = register(
    Scenario(
        name="TuneAllRound",
        summary=(
            "Tune the assist for a compromise: on-centre feel, free return and its overshoot, return at low speed, "
            "torque in a turn and the effort of parking. Each has a test of its own, whose metrics are compared with "
            "wanted bands."
        ),
        parameters=(
            "boost_level",
            "boost_progression",
            "boost_low_speed",
            "damping_level",
            "damping_low_speed",
            "lead_zero",
            "lead_pole",
        ),
        drives=(
            ON_CENTRE_WEAVE,
            drive("release", at_context_speed=True, events=2),
            drive("returnability", events=2),
            drive("step-steer", right=False, straight=0.0),
            drive("parking"),
        ),
        bounds=ON_CENTRE_BOUNDS
        | {
            "free_damping_ratio": 1.0,
            "residual_handwheel_angle": 100.0,
            "yaw_rate_after_1s": 500.0,
            "release_overshoot": 500.0,
            "handwheel_angle_after_1s": 200.0,
            "handwheel_angle_after_3s": 200.0,
            "handwheel_return_rate": 1000.0,
            "steady_step_torque": 25.0,
            "handwheel_torque_mean": 25.0,
            "handwheel_torque_peak": 25.0,
            "motor_torque_peak": 100.0,
        },
        least_road_friction=0.7,
        weights=WEIGHTS_OF_CHASSIS_METRICS,
    )
)
