"""The arrays of a batch of environments, and what all its rows have in common."""

import math
from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from steer_env.episode.timing import SAMPLES_PER_UPDATE
from steer_env.friction.numerics.packing import common_columns, numbers, slices
from steer_env.tasks.common.definition import COST_LIMIT, Task, by_name
from steer_env.vehicle import plant
from steer_env.vehicle.chassis.common.interface import INPUTS
from steer_env.vehicle.plant import Plant
from steer_env.vehicle.steering.eps import SAMPLE_TIME

Array = NDArray[np.float64]

# Progress of one episode. Times are counted in samples of 1 ms since its start, where not said otherwise.
EPISODE = np.dtype(
    [
        ("sample", np.int64),  # now
        ("evaluated", np.int64),  # samples that rewards and metrics cover: those before the task's own end
        ("end", np.int64),  # when the episode is truncated
        ("release", np.int64),  # when the hands let go; negative: never
        ("path_points", np.int64),  # rows of ``paths`` that are in use
        ("data_size", np.int64),  # elements of ``task_data`` that are in use
        ("latest", np.int64),  # place of the newest observation in the ring buffer
        ("delay", np.int64),  # of the observation [control steps]
        ("action_gain", np.float64),  # factor on the action's effect
        ("action_kept", np.float64),  # of the difference between ``asked`` and the action after a sample; 0: no lag
        ("driven", np.int64),  # 1 where a driver model holds the handwheel
        ("speed", np.float64),  # forward [m/s]
        ("held_speed", np.float64),  # that is held, or that the episode begins with [m/s]
        ("action", np.float64),  # of the present step, clipped to [-1, 1]
        ("last_action", np.float64),  # of the step before
        ("action_rate", np.float64),  # [1/s]
        ("asked", np.float64),  # of the plant by the action, with its gain and lag [unit of the action]
        ("reward", np.float64),  # of the last step
        ("cost", np.float64),  # of the last step
        ("failure", np.int64),  # in the last step: place among steer_env.tasks.common.definition.FAILURES
        ("terminated", np.bool_),
        ("truncated", np.bool_),
    ],
    align=True,
)


class BatchArrays(NamedTuple):
    """What differs between the rows of a batch: row i of each array belongs to sub-environment i.

    Kernels take the whole record and a range of rows. Sizes: S states, K numbers of a plant, I plant inputs, C
    channels, U updates of 10 ms, O observations.
    """

    episodes: Any  # (n,) records of EPISODE
    actions: NDArray[np.float32]  # (n,) as they are given
    plants: Array  # (n, K) numbers of each plant, as steer_env.friction.numerics.packing.numbers gives them
    states: Array  # (n, S)
    previous_states: Array  # (n, S) before the last round of samples
    finite: NDArray[np.bool_]  # (n,) whether every state is finite
    inputs: Array  # (n, samples of a round, I)
    channels: Array  # (n, C)
    scripted_inputs: Array  # (n, U, inputs that the task scripts) at each update; of a shared script, at two of them
    factors: Array  # (2, U, inputs that the task scripts) of the script that rows share, if there is one
    scales: Array  # (n,) of the shared script; NaN where a row has one of its own
    paths: Array  # (n, P, 4) as steer_env.courses.path.from_curvature gives them
    task_data: Array  # (n, V) numbers of the episode, as the task lays them out
    task_memory: Array  # (n, M) what the task's kernels remember
    task_observations: Array  # (n, Q) what the task observes besides channels and speed
    terms: Array  # (n, rewards and costs) integrals over the present step; with their weights once it is finished
    metrics: Array  # (n, 3, F) present value, what has accumulated over the episode, and the metrics so far
    noise: Array  # (n, O) of the next observation
    past_observations: Array  # (n, D, O) ring buffer over control steps, noisy and clipped to the bounds [SI]
    observations: NDArray[np.float32]  # (n, O) delayed, over their scales


class BatchLayout(NamedTuple):
    """What all rows of a batch share: places in the arrays, weights and time steps."""

    control_dt: float  # [s]
    samples_per_step: int  # samples of 1 ms in a control step
    rounds: int  # of a control step
    samples_per_round: int
    time_limit: int  # samples after which every episode is truncated
    action_input: int  # place among the plant's inputs
    action_scale: float  # value of that input at action 1 [its unit]
    ramped: bool  # whether the action goes on a straight line from the last one, else it is held
    common: NDArray[np.int64]  # (R, 2) numbers of the plants that must be equal in rows side by side
    robot: int  # place of the plant's parameter ``robot`` among its numbers
    speed_channel: int  # place of the forward speed among the channels; -1 where the speed is held
    n_rewards: int  # the first terms are of the reward, the others of the cost
    scripted: NDArray[np.int64]  # (inputs that the task scripts,) places among the plant's inputs
    observed_channels: NDArray[np.int64]  # places among the channels
    metric_kinds: NDArray[np.int64]  # (F,) RMS, PEAK or SUM
    weights: Array  # (rewards and costs,)
    bounds: Array  # (O,) of the observations [SI]
    scales: Array  # (O,) SI value of an observation of 1


class Scores(NamedTuple):
    """Terms and metrics of a batch as records, which kernels write by name, in the memory of the arrays."""

    rewards: Any  # (n,) records of the task's rewards, in ``BatchArrays.terms``
    costs: Any  # (n,) of its costs, in ``BatchArrays.terms``
    metrics: Any  # (n,) present values of its metrics, in ``BatchArrays.metrics``


def scores(task: Task, arrays: BatchArrays) -> Scores:
    """The records of a task in the arrays of a batch."""
    return Scores(
        by_name(arrays.terms, task.rewards),
        by_name(arrays.terms, task.costs, first=len(task.rewards)),
        by_name(arrays.metrics, task.metrics)[:, 0],
    )


def samples_per_round(samples_per_step: int) -> int:
    """Samples of 1 ms in a round: at most one update."""
    return min(samples_per_step, SAMPLES_PER_UPDATE)


def allocate(task: Task, template: Plant, n: int, samples: int, delay_steps: int) -> BatchArrays:
    """Arrays for ``n`` episodes of a task with plants of one kind.

    ``samples`` are those of a control step, ``delay_steps`` the largest delay of the observation [control steps]. The
    arrays of the episodes' setups start empty and grow with :func:`stored`.
    """
    states, channels = len(plant.state_names(template)), len(plant.channels(template))
    terms, observations = len(task.rewards) + len(task.costs), len(task.observed)
    return BatchArrays(
        episodes=np.zeros(n, EPISODE).view(np.recarray),  # a view whose fields plain Python finds as kernels do
        actions=np.zeros(n, np.float32),
        plants=np.tile(numbers(template), (n, 1)),
        states=np.zeros((n, states)),
        previous_states=np.zeros((n, states)),
        finite=np.ones(n, bool),
        inputs=np.zeros((n, samples_per_round(samples), len(INPUTS))),
        channels=np.zeros((n, channels)),
        scripted_inputs=np.zeros((n, 2, len(task.scripted_inputs))),
        factors=np.zeros((2, 0, len(task.scripted_inputs))),
        scales=np.full(n, math.nan),
        paths=np.zeros((n, 0, 4)),
        task_data=np.zeros((n, 0)),
        task_memory=np.zeros((n, task.memory_size)),
        task_observations=np.zeros((n, len(task.task_observations))),
        terms=np.zeros((n, terms)),
        metrics=np.zeros((n, 3, len(task.metrics))),
        noise=np.zeros((n, observations)),
        past_observations=np.zeros((n, 1 + delay_steps, observations)),
        observations=np.zeros((n, observations), np.float32),
    )


def layout(
    task: Task, template: Plant, samples_per_step: int, weights: Array, scales: Array, steps: int | None
) -> BatchLayout:
    """The layout for a task, with the weights of its rewards (R,); those of costs are over their limits.

    ``scales`` (O,) are those of the observations, ``steps`` the largest number of control steps of an episode, if any.
    """
    names = [name for name, _ in plant.channels(template)]
    return BatchLayout(
        control_dt=samples_per_step * SAMPLE_TIME,
        samples_per_step=samples_per_step,
        rounds=samples_per_step // samples_per_round(samples_per_step),
        samples_per_round=samples_per_round(samples_per_step),
        time_limit=np.iinfo(np.int64).max if steps is None else steps * samples_per_step,
        action_input=task.action.input,
        action_scale=task.action.scale,
        ramped=task.action.ramped,
        common=common_columns(template),
        robot=slices(template)["robot"].start,
        speed_channel=names.index("longitudinal_speed") if "longitudinal_speed" in names else -1,
        n_rewards=len(task.rewards),
        scripted=np.array(task.scripted_inputs, np.int64),
        observed_channels=np.array([plant.CHANNEL[name] for name in task.channels]),
        metric_kinds=np.array([metric.kind for metric in task.metrics]),
        weights=np.concatenate([weights, [COST_LIMIT / cost.limit for cost in task.costs]]),
        bounds=np.array([quantity.bound for quantity in task.observed], np.float32).astype(float),
        scales=scales,
    )


SETUP = ("scripted_inputs", "paths", "task_data")  # the arrays that grow with the length of the episodes


def stored(arrays: BatchArrays, rows: slice, setups: Mapping[str, Array]) -> BatchArrays:
    """Write values into rows of the named arrays, of ``SETUP``; returns the record.

    An array that is too short is replaced by a longer one, the others are changed in place. The values (M, length, ...)
    are for M rows, or for all of them if M is 1.
    """
    for name, values in setups.items():
        held, length = getattr(arrays, name), values.shape[1]
        if length > held.shape[1]:
            longer = np.zeros((len(held), *values.shape[1:]))
            longer[:, : held.shape[1]] = held
            arrays = arrays._replace(**{name: longer})
            held = longer
        held[rows, :length] = values
    return arrays
