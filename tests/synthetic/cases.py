"""The cases: for every test a recording whose answers are known."""

from collections.abc import Callable
from typing import NamedTuple

from tests.synthetic import (
    crosswind,
    free_hands,
    frequency_response,
    lane_change,
    loops,
    road,
    sine,
    standstill,
    steady_circle,
    step,
    transition,
)
from tests.synthetic.recordings import Example


class Case(NamedTuple):
    """A recording with known answers, and the reasons for which a metric of it may be refused."""

    make: Callable[..., Example]  # arguments: the sampling rate [Hz], and a seed if `reseeded`
    reseeded: bool = False  # whether every trial has a different steering
    refusals: tuple[str, ...] = ()  # right reasons for a refusal, because some faults hide an answer


CASES: dict[str, Case] = {
    "weave, linear car": Case(loops.weave_of_a_linear_car),
    "weave, rough car": Case(loops.weave_of_a_rough_car),
    "slow ramp, linear car": Case(loops.slow_ramp_of_a_linear_car),
    "slow ramp, rough car": Case(loops.slow_ramp_of_a_rough_car),
    "rig": Case(loops.rig),
    "step steer": Case(step.step_steer),
    "sine": Case(sine.sine),
    "swept sine": Case(frequency_response.swept_sine),
    "random steer": Case(frequency_response.random_steer, reseeded=True),
    "road": Case(road.road, reseeded=True),
    "circle, constant radius": Case(steady_circle.constant_radius),
    "circle, constant speed": Case(steady_circle.constant_speed),
    "circle, oversteering car": Case(steady_circle.oversteering),
    "transition": Case(transition.transition),
    "release": Case(free_hands.release),
    "pulse": Case(free_hands.pulse),
    "returnability": Case(free_hands.returnability),
    "parking": Case(standstill.parking),
    "catch-up": Case(standstill.catch_up),
    "hold": Case(standstill.held, refusals=("record at 160 Hz or faster", "of which noise alone would make")),
    "crosswind": Case(crosswind.gusts),
    "crosswind, free": Case(crosswind.free),
    "double lane change": Case(lane_change.double_lane_change),
    "double lane change, hit": Case(lane_change.hitting),
    "obstacle avoidance": Case(lane_change.obstacle_avoidance),
}
