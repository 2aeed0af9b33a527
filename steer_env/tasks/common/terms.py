"""Costs and metrics that every task has, and the terms for the action."""

import math

from steer_env.friction.numerics.bounds import within
from steer_env.friction.numerics.kernel import kernel
from steer_env.tasks.common.definition import PEAK, RMS, SUM, EpisodeMetric, Term
from steer_env.timing import UPDATE_INTERVAL
from steer_env.vehicle.plant import CHANNEL

HAND_TORQUE_LIMIT = 8.0  # above it steering is heavy work at speed, assumed [N m]
SIDESLIP_LIMIT = math.radians(5.0)  # lateral over forward speed; passenger-car drivers stay below, assumed
JERK_LIMIT = 15.0  # lateral, some three times what a brisk lane change needs on centre, assumed [m/s3]
RATE_SCALE = 10.0  # of the action, in the terms for its smoothness [1/s]

COMMON_COSTS = (
    Term("hand_torque", 1.0, "s", f"time with a hand torque above {HAND_TORQUE_LIMIT:g} N m"),
    Term("stability", 1.0, "s", "time with a sideslip angle above 5 deg"),
    Term("comfort", 1.0, "s", f"time with a lateral jerk above {JERK_LIMIT:g} m/s3"),
)
COMMON_METRICS = (
    EpisodeMetric("peak_lateral_acceleration", "m/s2", PEAK, "lateral acceleration of the centre of gravity"),
    EpisodeMetric("peak_sideslip", "rad", PEAK, "sideslip: lateral over forward speed"),
    EpisodeMetric("rms_hand_torque", "N m", RMS, "hand torque"),
    EpisodeMetric("rms_handwheel_speed", "rad/s", RMS, "handwheel speed"),
    EpisodeMetric("steering_work", "J", SUM, "size of the hands' work in both directions"),
)
# Floats at the start of a task's memory: the lateral acceleration at the last update, and whether there was one.
COMMON_MEMORY = 2


def action_terms(weight: float) -> tuple[Term, Term]:
    """The reward terms for effort and smoothness of the action; ``weight`` is positive."""
    return (
        Term("effort", -weight, "s", "squared action"),
        Term("smoothness", -weight / RATE_SCALE**2, "1/s", "squared rate of the action"),
    )


_TORQUE, _SPEED = CHANNEL["handwheel_torque"], CHANNEL["handwheel_speed"]
_ACCELERATION, _LATERAL_SPEED = CHANNEL["lateral_acceleration"], CHANNEL["lateral_speed"]


@kernel
def evaluate_common(channels, step, memory, costs, metrics):
    """Add the common costs and give the common metrics their values; they stand first in both arrays."""
    torque, acceleration = channels[_TORQUE], channels[_ACCELERATION]
    # A car that stands has no sideslip angle.
    sideslip = abs(channels[_LATERAL_SPEED]) / within(step.speed, 1.0, math.inf)
    if abs(torque) > HAND_TORQUE_LIMIT:
        costs[0] += step.dt
    if sideslip > SIDESLIP_LIMIT:
        costs[1] += step.dt
    updates = step.time / UPDATE_INTERVAL
    if abs(updates - math.floor(updates + 0.5)) < 0.01:  # between updates the channel is extrapolated, with kinks
        if memory[1] > 0.0 and abs(acceleration - memory[0]) > JERK_LIMIT * UPDATE_INTERVAL:
            costs[2] += UPDATE_INTERVAL
        memory[0], memory[1] = acceleration, 1.0
    metrics[0] = acceleration
    metrics[1] = sideslip
    metrics[2] = torque
    metrics[3] = channels[_SPEED]
    metrics[4] = abs(torque * channels[_SPEED]) * step.dt


@kernel
def evaluate_action(step, first, rewards):
    """Add the quantities of :func:`action_terms`, which stand from ``first`` on."""
    rewards[first] += step.dt * step.action * step.action
    rewards[first + 1] += step.dt * step.action_rate * step.action_rate
