"""Turn the wheels of a standing car by hand torque, along a target of the handwheel angle."""

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from steer_env.friction.numerics.bounds import within
from steer_env.friction.numerics.kernel import kernel
from steer_env.manoeuvres.common.shapes import ramp_and_hold
from steer_env.tasks.common.definition import (
    GOES_ON,
    HAND_TORQUE,
    RMS,
    STEERING_CHANNELS,
    EpisodeContext,
    EpisodeMetric,
    EpisodeSetup,
    Quantity,
    Scenery,
    Task,
    Term,
    register,
)
from steer_env.tasks.common.scripted import update_times
from steer_env.tasks.common.standstill import CREEPING, TWO_TRACK, USUAL, angle_at_lock
from steer_env.tasks.common.terms import (
    COMMON_COSTS,
    COMMON_MEMORY,
    COMMON_METRICS,
    COMMON_REWARDS,
    evaluate_common,
    quality,
)
from steer_env.timing import UPDATE_INTERVAL
from steer_env.vehicle.plant import CHANNEL

Array = NDArray[np.float64]

DURATION = 24.0  # [s]
MOVES = 6
FASTEST = 5.0  # largest handwheel speed of the target [rad/s]
ANGLE_SCALE = 0.2  # error of the handwheel angle at which the quality is 71 %, assumed [rad]
TARGET_TIMES = (0.0, 0.2, 0.5, 1.0)  # at which the target is observed, from now [s]

_ANGLE = CHANNEL["handwheel_angle"]


class ParkingTarget(NamedTuple):
    """Parameters of the task; there are none. The episode's data are the target angles at every update."""


def _draw_setup(rng: np.random.Generator, context: EpisodeContext, options: Mapping[str, float]) -> EpisodeSetup:
    """Smooth moves between angles drawn within nine tenths of lock to lock, none faster than ``FASTEST``."""
    t = update_times(DURATION)
    end = 0.9 * angle_at_lock(context)
    target, each, last = np.zeros(t.size), DURATION / MOVES, 0.0
    for k in range(MOVES):
        most = each * FASTEST / 1.5  # the largest speed of the smooth rise is 1.5 times its mean
        to = min(max(float(rng.uniform(-end, end)), last - most), last + most)
        rise = float(rng.uniform(0.5, 1.0)) * 0.8 * each
        target += ramp_and_hold(t - k * each, to - last, max(rise, abs(to - last) / most * each))[0]
        last = to
    return EpisodeSetup(np.zeros((t.size, 0)), data=target)


@kernel
def _observe(parameters, channels, path, data, step, memory, observations):
    for k in range(observations.size):
        update = within(int((step.time + TARGET_TIMES[k]) / UPDATE_INTERVAL + 0.5), 0, data.size - 1)
        observations[k] = data[update] - channels[_ANGLE]


@kernel
def _evaluate(parameters, channels, observations, data, step, memory, rewards, costs, metrics):
    evaluate_common(channels, step, step.dt, memory, rewards, costs, metrics)
    error = observations[0]
    metrics[metrics.size - 1] = error
    rewards[0] += step.dt * quality(error / ANGLE_SCALE)
    return GOES_ON


def _scenery(channels: Array, observations: Array, data: Array, memory: Array) -> Scenery:
    return Scenery(wanted_angle=float(channels[_ANGLE] + observations[0]))


TASK = register(
    Task(
        name="DriverParking",
        summary="Turn the wheels of a standing car by hand torque, along a target of the handwheel angle.",
        parameters=ParkingTarget(),
        action=HAND_TORQUE,
        channels=STEERING_CHANNELS,
        task_observations=tuple(
            Quantity(
                f"target_{t:.1f}s",
                "rad",
                25.0,
                f"target angle {t:g} s from now minus the present handwheel angle",
                1.0 + 2.0 * t,
            )
            for t in TARGET_TIMES
        ),
        rewards=(
            Term("angle", 0.7, f"quality of the handwheel angle against the target; 71 % at {ANGLE_SCALE:g} rad"),
            *COMMON_REWARDS,
        ),
        costs=COMMON_COSTS,
        metrics=(
            *COMMON_METRICS,
            EpisodeMetric("rms_angle_error", "rad", RMS, "handwheel angle minus the target angle"),
        ),
        draw_setup=_draw_setup,
        begins=(
            f"The car stands with its wheels straight. {MOVES} target angles are drawn within nine tenths of lock to "
            "lock."
        ),
        ends=f"The episode is truncated after {DURATION:g} s.",
        speed=0.0,
        speed_range=CREEPING,
        chassis=TWO_TRACK,
        memory_size=COMMON_MEMORY,
        usual=USUAL,
        scenery=_scenery,
    ),
    _observe,
    _evaluate,
)
