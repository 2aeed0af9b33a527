"""What tasks share in which a driver brings the handwheel to target angles by hand torque."""

from collections.abc import Callable, Mapping
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from steer_env.episode.timing import UPDATE_INTERVAL
from steer_env.friction.numerics.bounds import within
from steer_env.friction.numerics.kernel import kernel
from steer_env.manoeuvres.common.shapes import ramp_and_hold
from steer_env.tasks.common.definition import (
    GOES_ON,
    RMS,
    DrawSetup,
    EpisodeContext,
    EpisodeMetric,
    EpisodeSetup,
    Quantity,
    Scenery,
    Term,
)
from steer_env.tasks.common.scripted import update_times
from steer_env.tasks.common.terms import COMMON_METRICS, COMMON_REWARDS, evaluate_common, quality
from steer_env.vehicle.plant import CHANNEL

Array = NDArray[np.float64]

TARGET_TIMES = (0.0, 0.2, 0.5, 1.0)  # at which the target is observed, from now [s]
_NOW = 0  # place of the first of them among the observations
METRICS = (*COMMON_METRICS, EpisodeMetric("rms_angle_error", "rad", RMS, "handwheel angle minus the target angle"))

_ANGLE = CHANNEL["handwheel_angle"]


class Moves(NamedTuple):
    """How the targets of a task are drawn."""

    duration: float  # of the episode [s]
    number: int
    fastest: float  # largest handwheel speed of the target [rad/s]


class AngleTarget(NamedTuple):
    """Parameters of the tasks. The episode's data are the target angles at every update."""

    scale: float  # error at which the quality is 71 % [rad]


def targets(rng: np.random.Generator, moves: Moves, largest: float) -> Array:
    """Target angles (U,) [rad] at every update: smooth moves between angles drawn up to ``largest`` to both sides."""
    t = update_times(moves.duration)
    target, each, last = np.zeros(t.size), moves.duration / moves.number, 0.0
    for k in range(moves.number):
        most = each * moves.fastest / 1.5  # the largest speed of the smooth rise is 1.5 times its mean
        to = min(max(float(rng.uniform(-largest, largest)), last - most), last + most)
        rise = float(rng.uniform(0.5, 1.0)) * 0.8 * each
        target += ramp_and_hold(t - k * each, to - last, max(rise, abs(to - last) / most * each))[0]
        last = to
    return target


def setup_drawer(moves: Moves, largest: Callable[[EpisodeContext], float]) -> DrawSetup:
    """The ``draw_setup`` of a task whose targets reach an angle [rad] that the episode's context gives."""

    def draw_setup(rng: np.random.Generator, context: EpisodeContext, options: Mapping[str, float]) -> EpisodeSetup:
        target = targets(rng, moves, largest(context))
        return EpisodeSetup(np.zeros((target.size, 0)), data=target)

    return draw_setup


def observations(usual: float) -> tuple[Quantity, ...]:
    """What is observed of the target, whose errors have a typical size [rad]."""
    meaning = "target angle {:g} s from now minus the present handwheel angle"
    return tuple(Quantity(f"target_{t:.1f}s", "rad", 25.0, meaning.format(t), usual) for t in TARGET_TIMES)


def rewards(scale: float) -> tuple[Term, ...]:
    """The terms for an error whose quality is 71 % at a scale [rad]."""
    meaning = f"quality of the handwheel angle against the target; 71 % at {scale:g} rad"
    return (Term("angle", 0.7, meaning), *COMMON_REWARDS)


@kernel
def observe(parameters, channels, path, data, step, memory, observations):
    """The ``observe`` of these tasks: the target now and soon, less the present angle."""
    for k in range(observations.size):
        update = within(int((step.time + TARGET_TIMES[k]) / UPDATE_INTERVAL + 0.5), 0, data.size - 1)
        observations[k] = data[update] - channels[_ANGLE]


@kernel
def evaluate(parameters, channels, observations, data, step, memory, rewards, costs, metrics):
    """The ``evaluate_step`` of these tasks: the error of the angle."""
    evaluate_common(channels, step, step.dt, memory, rewards, costs, metrics)
    error = observations[_NOW]
    metrics.rms_angle_error = error
    rewards.angle += step.dt * quality(error / parameters.scale)
    return GOES_ON


def scenery(channels: Array, observations: Array, data: Array, memory: Array) -> Scenery:
    """The wanted angle, for the picture."""
    return Scenery(wanted_angle=float(channels[_ANGLE] + observations[_NOW]))
