"""Terms of tasks that shape the hand torque: how far it is from a reference feel."""

from steer_env.friction.numerics.kernel import kernel
from steer_env.reference_feel import reference_torque
from steer_env.tasks.common.definition import RMS, Figure, Term
from steer_env.vehicle.plant import CHANNEL

RATE_SCALE = 10.0  # of the action [1/s]

FEEL_REWARDS = (
    Term("feel", -1.0, "(N m)2 s", "squared difference of the hand torque from the reference feel"),
    Term("effort", -0.01, "s", "squared action"),
    Term("smoothness", -0.01 / RATE_SCALE**2, "1/s", "squared rate of the action"),
)
FEEL_FIGURE = Figure("rms_feel_error", "N m", RMS, "hand torque less that of the reference feel")

_TORQUE, _SPEED = CHANNEL["handwheel_torque"], CHANNEL["handwheel_speed"]
_ACCELERATION = CHANNEL["lateral_acceleration"]


@kernel
def feel_error(row):
    """Hand torque less that of the reference feel [N m]."""
    return row[_TORQUE] - reference_torque(row[_ACCELERATION], row[_SPEED])


@kernel
def judge_feel(row, now, first, rewards):
    """Adds the terms of ``FEEL_REWARDS``, which stand from ``first`` on; returns the error [N m]."""
    error = feel_error(row)
    rewards[first] += now.dt * error * error
    rewards[first + 1] += now.dt * now.action * now.action
    rewards[first + 2] += now.dt * now.rate * now.rate
    return error
