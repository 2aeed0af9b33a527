"""What every task scores: quality of an error, ripple, effort and smoothness; costs and metrics that every task has.

docs/make_a_task.md derives the rewards; the scales below are its numbers.
"""

import math

from steer_env.episode.timing import UPDATE_INTERVAL
from steer_env.friction.numerics.bounds import within
from steer_env.friction.numerics.kernel import kernel
from steer_env.tasks.common.definition import FAILURE, PEAK, RMS, SUM, Cost, EpisodeMetric, Term
from steer_env.vehicle.plant import CHANNEL

HAND_TORQUE_LIMIT = 8.0  # above it steering is heavy work at speed, assumed [N m]
SIDESLIP_LIMIT = math.radians(5.0)  # lateral over forward speed; passenger-car drivers stay below, assumed
JERK_LIMIT = 15.0  # lateral, some three times what a brisk lane change needs on centre, assumed [m/s3]
RIPPLE_FREQUENCY = 10.0  # above it hands feel vibration, not steering; arms cannot follow [Hz]
# Sizes at which a quality has fallen to 71 %, assumed.
RIPPLE_SCALE = 0.1  # hand torque above ``RIPPLE_FREQUENCY`` [N m]
ACTION_SCALE = 0.5  # action [1]
RATE_SCALE = 4.0  # root mean square rate of the action [1/s]
RATE_TIME = 0.1  # time constant of the low-pass of the squared rate, assumed [s]

# The budgets are assumed: above what the driver models need in the lane and the double lane change.
COMMON_COSTS = (
    Cost("hand_torque", 1.0, "s", f"time with a hand torque above {HAND_TORQUE_LIMIT:g} N m"),
    Cost("stability", 0.5, "s", "time with a sideslip angle above 5 deg"),
    Cost("comfort", 0.5, "s", f"time with a lateral jerk above {JERK_LIMIT:g} m/s3"),
)
COMMON_METRICS = (
    EpisodeMetric("peak_lateral_acceleration", "m/s2", PEAK, "lateral acceleration of the centre of gravity"),
    EpisodeMetric("peak_sideslip", "rad", PEAK, "sideslip: lateral over forward speed"),
    EpisodeMetric("rms_hand_torque", "N m", RMS, "hand torque"),
    EpisodeMetric("rms_handwheel_speed", "rad/s", RMS, "handwheel speed"),
    EpisodeMetric("steering_work", "J", SUM, "size of the hands' work in both directions"),
    EpisodeMetric("rms_ripple", "N m", RMS, f"hand torque above {RIPPLE_FREQUENCY:g} Hz"),
)
# The last terms of every reward; together with a task's own they add up to 1.
COMMON_REWARDS = (
    Term("effort", 0.05, f"quality of the action; 71 % at {ACTION_SCALE:g}"),
    Term("smoothness", 0.1, f"quality of the action's rms rate over some {RATE_TIME:g} s; 71 % at {RATE_SCALE:g}/s"),
    Term("ripple", 0.15, f"quality of the hand torque above {RIPPLE_FREQUENCY:g} Hz; 71 % at {RIPPLE_SCALE:g} N m"),
    FAILURE,
)
# Floats at the start of a task's memory: whether there was an update, the lateral acceleration at the last one, two
# states of the ripple's high-pass, and the mean square of the action's rate.
COMMON_MEMORY = 5
_BEGUN, _LAST_ACCELERATION, _FIRST_STATE, _SECOND_STATE, _SQUARED_RATE = range(COMMON_MEMORY)

_TORQUE, _SPEED = CHANNEL["handwheel_torque"], CHANNEL["handwheel_speed"]
_ACCELERATION, _LATERAL_SPEED = CHANNEL["lateral_acceleration"], CHANNEL["lateral_speed"]
_COLUMN_SPEED = CHANNEL["column_speed"]


def assist_costs(budget: float) -> tuple[Cost, ...]:
    """The costs of an assist task, with a budget for the work of its torque [J].

    Each budget is between half and nine tenths of what LQG uses in the task, so that it costs feel; assumed.
    """
    text = "size of the work of the added torque at the column, in both directions: energy and heat of the motor"
    return (*COMMON_COSTS, Cost("added_work", budget, "J", text))


@kernel
def quality(error):
    """Quality of an error over its scale: 1 at zero, 71 % at the scale, and the scale over the error far from it."""
    return 1.0 / math.sqrt(1.0 + error * error)


@kernel
def _ripple(torque, dt, begun, memory):
    """The hand torque [N m] above ``RIPPLE_FREQUENCY``: a second-order Butterworth high-pass by Tustin's rule."""
    w = math.tan(math.pi * RIPPLE_FREQUENCY * dt)
    scale = 1.0 / (1.0 + math.sqrt(2.0) * w + w * w)
    if not begun:  # as if the torque had always been the same
        memory[_FIRST_STATE], memory[_SECOND_STATE] = -scale * torque, scale * torque
    out = scale * torque + memory[_FIRST_STATE]
    feedback = 2.0 * (w * w - 1.0) * scale, (1.0 - math.sqrt(2.0) * w + w * w) * scale
    memory[_FIRST_STATE] = -2.0 * scale * torque - feedback[0] * out + memory[_SECOND_STATE]
    memory[_SECOND_STATE] = scale * torque - feedback[1] * out
    return out


@kernel
def _rms_rate(step, memory):
    """Root mean square of the action's rate over some ``RATE_TIME`` [1/s]: a jump counts for as long as it is felt."""
    squared = step.action_rate * step.action_rate
    memory[_SQUARED_RATE] += (squared - memory[_SQUARED_RATE]) * step.dt / (RATE_TIME + step.dt)  # backward Euler
    return math.sqrt(memory[_SQUARED_RATE])


@kernel
def evaluate_added_work(channels, step, costs):
    """Add the cost of :func:`assist_costs` beside the common ones."""
    costs.added_work += abs(step.asked * channels[_COLUMN_SPEED]) * step.dt


@kernel
def evaluate_common(channels, step, share, memory, rewards, costs, metrics):
    """Add the common rewards and costs, and give the common metrics their values.

    ``share`` is the time, or the progress over the held speed, that the rewards count for this step [s]. Returns the
    quality of the smoothness, by which a task may multiply its own.
    """
    torque, acceleration = channels[_TORQUE], channels[_ACCELERATION]
    begun = memory[_BEGUN] > 0.0
    # A car that stands has no sideslip angle.
    sideslip = abs(channels[_LATERAL_SPEED]) / within(step.speed, 1.0, math.inf)
    if abs(torque) > HAND_TORQUE_LIMIT:
        costs.hand_torque += step.dt
    if sideslip > SIDESLIP_LIMIT:
        costs.stability += step.dt
    ripple = _ripple(torque, step.dt, begun, memory)
    updates = step.time / UPDATE_INTERVAL
    if abs(updates - math.floor(updates + 0.5)) < 0.01:  # between updates the channel is extrapolated, with kinks
        if begun and abs(acceleration - memory[_LAST_ACCELERATION]) > JERK_LIMIT * UPDATE_INTERVAL:
            costs.comfort += UPDATE_INTERVAL
        memory[_LAST_ACCELERATION] = acceleration
    elif not begun:
        memory[_LAST_ACCELERATION] = acceleration
    memory[_BEGUN] = 1.0
    rewards.effort += share * quality(step.action / ACTION_SCALE)
    smoothness = quality(_rms_rate(step, memory) / RATE_SCALE)
    rewards.smoothness += share * smoothness
    rewards.ripple += share * quality(ripple / RIPPLE_SCALE)
    metrics.peak_lateral_acceleration = acceleration
    metrics.peak_sideslip = sideslip
    metrics.rms_hand_torque = torque
    metrics.rms_handwheel_speed = channels[_SPEED]
    metrics.steering_work = abs(torque * channels[_SPEED]) * step.dt
    metrics.rms_ripple = ripple
    return smoothness
