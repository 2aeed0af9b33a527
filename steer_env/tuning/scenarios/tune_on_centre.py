"""Tune the assist for on-centre feel."""

from steer_env.tuning.scenarios.common.definition import Scenario, register
from steer_env.tuning.scenarios.common.on_centre import (
    ON_CENTRE_BOUNDS,
    ON_CENTRE_WEAVE,
    WEIGHTS_OF_CHASSIS_METRICS,
)

SCENARIO = register(
    Scenario(
        name="TuneOnCentre",
        summary=(
            "Tune the assist for on-centre feel. The action chooses boost, damping, lead and three functions; a robot "
            "weaves at 0.2 Hz to 2 m/s2, and the metrics are compared with wanted bands."
        ),
        parameters=(
            "boost_level",
            "boost_progression",
            "damping_level",
            "lead_zero",
            "lead_pole",
            "return_gain",
            "handwheel_damping",
            "friction_share",
        ),
        drives=(ON_CENTRE_WEAVE,),
        bounds=ON_CENTRE_BOUNDS,
        least_road_friction=0.4,
        weights=WEIGHTS_OF_CHASSIS_METRICS,
    )
)
