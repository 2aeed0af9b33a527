"""The registered environments: :class:`steer_env.env.SteerEnv` with a task each, and what a user has to know of it."""

import gymnasium as gym

from steer_env.env import SteerEnv
from steer_env.tasks import LaneKeeping, Weave


class DriverLaneKeeping(SteerEnv):
    """Keep a car in its lane by hand torque, on a winding road with crosswind and a rough surface.

    ## Action
    `Box(-1, 1, (1,))`: the hand torque, left positive.

    | index | action | at 1 | unit |
    |---|---|---|---|
    | 0 | hand torque | 10 | N m |

    ## Observation
    `Box(13,)` in SI, clipped to the bounds.

    | index | observation | bound | unit |
    |---|---|---|---|
    | 0 | handwheel angle | 12 | rad |
    | 1 | handwheel speed | 40 | rad/s |
    | 2 | torsion-bar torque | 25 | N m |
    | 3 | lateral acceleration | 20 | m/s2 |
    | 4 | yaw rate | 3 | rad/s |
    | 5 | lateral speed | 30 | m/s |
    | 6 | lateral offset from the middle of the lane, left positive | 5 | m |
    | 7 | heading error against the road, left positive | pi | rad |
    | 8-12 | curvature of the road 0, 0.3, 0.6, 1.0 and 1.5 s ahead, left positive | 0.05 | 1/m |

    ## Reward
    Per step of `control_dt`: `control_dt (1 - (offset/0.5 m)^2 - (heading/0.1 rad)^2 - 0.1 action^2 -
    0.1 (action rate / 10 per s)^2)`, and -10 on leaving the lane. The terms are in `info["reward_terms"]`.

    ## Start
    Straight ahead in the middle of the lane at the held speed. The road (curvatures up to 2.5 m/s2 at that speed), the
    crosswind (300 N, 1 s) and the rack disturbance (60 N, 20 ms) are drawn from the environment's generator.

    ## End
    Terminates when the car leaves its lane (1.75 m) or points across it, or if a state turns non-finite, with a
    reward of -100; truncates after 30 s.

    ## Arguments
    As :class:`steer_env.env.SteerEnv`. `reset` takes no options.

    ## Version history
    v0: first version.
    """

    make_task = LaneKeeping


class AssistWeave(SteerEnv):
    """Shape the feel of an on-centre weave with assist torque: a robot steers, the action adds to the boost curve.

    ## Action
    `Box(-1, 1, (1,))`: a request added to the controller's command before its limit, delay and motor lag.

    | index | action | at 1 | unit |
    |---|---|---|---|
    | 0 | assist torque at the column, left positive | 5 | N m |

    ## Observation
    `Box(7,)` in SI, clipped to the bounds.

    | index | observation | bound | unit |
    |---|---|---|---|
    | 0 | handwheel angle | 12 | rad |
    | 1 | handwheel speed | 40 | rad/s |
    | 2 | torsion-bar torque | 25 | N m |
    | 3 | lateral acceleration | 20 | m/s2 |
    | 4 | yaw rate | 3 | rad/s |
    | 5 | column speed | 40 | rad/s |
    | 6 | motor torque at the column | 80 | N m |

    ## Reward
    Per step of `control_dt`: `-control_dt ((T - T_ref)^2 + 0.01 action^2 + 0.01 (action rate / 10 per s)^2)`, where T
    is the hand torque [N m] and T_ref that of :class:`steer_env.targets.ReferenceFeel` at the same lateral acceleration
    and handwheel speed. The terms are in `info["reward_terms"]`.

    ## Start
    Straight ahead at the held speed; the 0.2 Hz weave grows over its first cycle. Its amplitude is drawn from 80 to
    120 % of 15 deg, which is 2 m/s2 for the default car at 100 km/h, whatever `speed` is; or fixed with
    `reset(options={"amplitude": radians})`.

    ## End
    Terminates only if a state turns non-finite, with a reward of -100; truncates after 20 s.

    ## Arguments
    As :class:`steer_env.env.SteerEnv`.

    ## Version history
    v0: first version.
    """

    make_task = Weave


REGISTERED = {
    "steer_env/DriverLaneKeeping-v0": "steer_env.ids:DriverLaneKeeping",
    "steer_env/AssistWeave-v0": "steer_env.ids:AssistWeave",
}


def register() -> None:
    """Register the ids with Gymnasium."""
    for name, entry_point in REGISTERED.items():
        gym.register(name, entry_point=entry_point)
