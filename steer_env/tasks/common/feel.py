"""Terms of tasks that shape the hand torque: its deviation from a reference feel."""

from steer_env.friction.numerics.kernel import kernel
from steer_env.reference_feel import reference_torque
from steer_env.tasks.common.definition import RMS, EpisodeMetric, Term
from steer_env.tasks.common.terms import action_terms, evaluate_action
from steer_env.vehicle.plant import CHANNEL

FEEL_REWARDS = (
    Term("feel", -1.0, "(N m)2 s", "squared difference between the hand torque and the reference feel"),
    *action_terms(0.01),
)
FEEL_METRIC = EpisodeMetric("rms_feel_error", "N m", RMS, "hand torque minus the torque of the reference feel")

_TORQUE, _SPEED = CHANNEL["handwheel_torque"], CHANNEL["handwheel_speed"]
_ACCELERATION = CHANNEL["lateral_acceleration"]


@kernel
def feel_error(channels):
    """Hand torque minus the torque of the reference feel [N m]."""
    return channels[_TORQUE] - reference_torque(channels[_ACCELERATION], channels[_SPEED])


@kernel
def evaluate_feel(channels, step, first, rewards):
    """Add the quantities of ``FEEL_REWARDS``, which stand from ``first`` on; return the error [N m].

    The weights are applied at the end of the control step, in :mod:`steer_env.batch_kernels`.
    """
    error = feel_error(channels)
    rewards[first] += step.dt * error * error
    evaluate_action(step, first + 1, rewards)
    return error
