"""What a task is, the registry of tasks, and the two dispatch points that the engine's kernels call.

A task is one file: its declaration (action, observations, terms, texts) with a function that draws an episode's setup,
and two kernels, which :func:`register` takes as ``observe`` (where the car is relative to the path or target) and
``evaluate_step`` (reward terms, costs and metrics). The class of the task's parameters selects the kernels at compile
time, as with friction laws. Docstrings, spaces and documentation are generated from the declaration. The kernels read
channels and depend neither on the friction law nor on the chassis, so they compile once.
"""

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from steer_env.friction.numerics.check import number
from steer_env.friction.numerics.kernel import dispatch
from steer_env.friction.numerics.registry import Registry, camel_case
from steer_env.vehicle.cars import SPEEDS, Car
from steer_env.vehicle.chassis.common.interface import ASSIST_REQUEST, HAND

Array = NDArray[np.float64]


class Quantity(NamedTuple):
    """An observation."""

    name: str
    unit: str
    bound: float  # the observation space spans +- this
    meaning: str = ""
    usual: float = 1.0  # a typical size, by which ``normalise`` divides


class Term(NamedTuple):
    """A term of the reward: weight times a quality from 0 to 1, integrated over the step (docs/make_a_task.md).

    ``evaluate_step`` writes the integral as ``rewards.NAME``; :mod:`steer_env.engine.kernels` weights it as
    ``terms[k]`` and adds it to the reward. The weights of a task are positive and add up to 1 at most, but for the last
    term's, which is :data:`FAILURE`.
    """

    name: str
    weight: float  # [1/s]
    meaning: str


class Cost(NamedTuple):
    """A cost: a quantity of ``evaluate_step``, integrated over the step, over its budget for an episode."""

    name: str
    limit: float  # budget per episode [unit of the quantity]
    unit: str  # of the quantity
    meaning: str


FAILURE = Term("failure", -1.0, "1 in the step in which the episode fails, after which nothing counts")
COST_LIMIT = 1.0  # budget of every cost, which is a quantity over its own
# What ``evaluate_step`` returns: the episode goes on, has reached its goal, or has failed by leaving lane or course.
FINISHED, GOES_ON, DEPARTED = -1, 0, 1
ROLLED_OVER, SPUN_OUT, NON_FINITE = 2, 3, 4  # failures that every task has, beside ``DEPARTED``
FAILURES = (
    "",
    "the car left its lane or its course",
    "the car rolled over",
    "the car spun out",
    "a state is not finite",
)


class EpisodeMetric(NamedTuple):
    """A metric of the episode, in ``info["metrics"]`` as it is so far."""

    name: str
    unit: str
    kind: int  # RMS, PEAK, SUM
    meaning: str


RMS, PEAK, SUM = range(3)


def by_name(values: Array, declared: Sequence[Term | Cost | EpisodeMetric | Quantity], first: int = 0) -> Any:
    """Rows of floats as records, in which every declared term, cost, metric or quantity has its float by its name.

    The records are the same memory: a kernel that writes ``rewards.feel`` writes the float of the term "feel", at a
    place that is known when the kernel is compiled. Plain Python writes it in the same words.

    Parameters
    ----------
    values : (..., K) array
    declared : sequence of Term, Cost, EpisodeMetric or Quantity
    first : int
        Column of the first of them.

    Returns
    -------
    (...) array of records
    """
    size = values.itemsize * values.shape[-1]
    fields: dict[str, tuple[Any, int]] = {
        each.name: (values.dtype, values.itemsize * (first + k)) for k, each in enumerate(declared)
    }
    # An empty field at the end of the row, because numba takes a record whose fields begin as those of another one for
    # that one, and warns: rows of different length then differ in a field.
    fields["end_of_row"] = ((values.dtype, (0,)), size)
    formats, offsets = zip(*fields.values())
    kind = np.dtype({"names": list(fields), "formats": formats, "offsets": offsets, "itemsize": size}, align=True)
    return values.view(kind)[..., 0].view(np.recarray)


class Action(NamedTuple):
    """What the action drives."""

    meaning: str
    unit: str
    scale: float  # its value at action 1
    input: int  # place among the plant's inputs
    control_dt: float  # time between decisions by default [s]
    ramped: bool  # whether it goes on a straight line from the last decision to the new one, else it is held


# A driver decides every 50 ms: exploration that is held so long moves a car, and arms cannot follow faster changes.
# Its torque has no steps, which hands cannot give.
HAND_TORQUE = Action("hand torque, left positive", "N m", 10.0, HAND, 0.05, True)
ASSIST_TORQUE = Action(
    "assist torque at the column, left positive, added to the boost curve's torque",
    "N m",
    5.0,
    ASSIST_REQUEST,
    0.01,
    False,
)


class StepContext(NamedTuple):
    """The moment at which the kernels observe and evaluate."""

    time: float  # since the start [s]
    dt: float  # since the last evaluation [s]
    speed: float  # forward [m/s]
    held_speed: float  # that the episode holds, or begins with [m/s]
    action: float  # clipped to [-1, 1]
    action_rate: float  # [1/s]
    asked: float  # of the plant by the action, with its gain and lag [unit of the action]


class EpisodeContext(NamedTuple):
    """What is known of an episode before its setup is drawn."""

    car: Car
    speed: float  # held speed [m/s]
    scenario: int = 0  # drawn by ``draw_scenario``


class Script(NamedTuple):
    """Scripted inputs that episodes share but for a factor: no episode has an array of its own."""

    factors: Array  # (2, U, M)
    scale: float  # by which the first ones are multiplied; the second ones multiply the result

    def inputs(self) -> Array:
        """The inputs (U, M)."""
        return self.scale * self.factors[0] * self.factors[1]


class EpisodeSetup(NamedTuple):
    """What is particular to one episode."""

    # At every update of 10 ms from the start, columns as the task's ``scripted_inputs``.
    scripted_inputs: Array | Script  # (U, M)
    path: Array | None = None  # (P, 4) as :func:`steer_env.courses.path.from_curvature`
    data: Array | None = None  # (V,) numbers that the kernels need of the episode, as the task lays them out
    pose: tuple[float, float, float] = (0.0, 0.0, 0.0)  # start: x, y [m], yaw angle [rad]
    release_time: float | None = None  # time from which on nobody holds the handwheel [s]
    robot: bool | None = None  # whether the handwheel angle is prescribed; by default as the task says

    def inputs(self) -> Array:
        """The scripted inputs (U, M)."""
        return self.scripted_inputs.inputs() if isinstance(self.scripted_inputs, Script) else self.scripted_inputs


class Scenery(NamedTuple):
    """What a picture shows of an episode besides its path."""

    cones: Array | None = None  # (N, 3) x, y [m], 1 where touched
    wanted_angle: float | None = None  # of the handwheel [rad]


# Observed in every task, after the channels.
SPEED = Quantity("speed", "m/s", 100.0, "forward speed", 30.0)
LAST_ACTION = Quantity("last_action", "1", 1.0, "the action of the last step, never delayed; 0 at the start")
# Plant channels that tasks observe, with their bounds. Usual sizes lie amid the rms values of the tasks of a moving car
# with zero action and with a classical controller; that of the last action is its range.
OBSERVABLE_CHANNELS = {
    quantity.name: quantity
    for quantity in (
        Quantity("handwheel_angle", "rad", 12.0, usual=0.2),
        Quantity("handwheel_speed", "rad/s", 40.0, usual=0.5),
        Quantity("torsion_bar_torque", "N m", 25.0, usual=2.0),
        Quantity("lateral_acceleration", "m/s2", 20.0, usual=1.2),
        Quantity("yaw_rate", "rad/s", 3.0, usual=0.05),
        Quantity("lateral_speed", "m/s", 30.0, usual=0.07),
        Quantity("column_speed", "rad/s", 40.0, usual=0.5),
        Quantity("motor_torque", "N m", 80.0, usual=2.0),
        Quantity("rack_force", "N", 15e3, usual=1e3),
    )
}
STEERING_CHANNELS = ("handwheel_angle", "handwheel_speed", "torsion_bar_torque", "lateral_acceleration", "yaw_rate")
DRIVER_CHANNELS = (*STEERING_CHANNELS, "lateral_speed")
ASSIST_CHANNELS = (*STEERING_CHANNELS, "column_speed", "motor_torque")


# Generator, context and reset options -> what is drawn for an episode.
DrawSetup = Callable[[np.random.Generator, EpisodeContext, Mapping[str, float]], EpisodeSetup]
# Generator and reset options -> which of the task's scenarios an episode is, and its held speed [m/s].
DrawScenario = Callable[[np.random.Generator, Mapping[str, float]], tuple[int, float]]


@dataclass(frozen=True)
class Task:
    """A task; :func:`register` makes it an id."""

    name: str  # of the id, ``<Role><Scenario>``
    summary: str  # what is to be done, for the docstring's first lines
    parameters: Any  # NamedTuple of what the kernels need; its class selects them
    action: Action
    channels: tuple[str, ...]  # observed first
    task_observations: tuple[Quantity, ...]  # observed after the channels, speed and last action, from ``observe``
    rewards: tuple[Term, ...]  # the last is ``FAILURE``
    costs: tuple[Cost, ...]
    metrics: tuple[EpisodeMetric, ...]
    draw_setup: DrawSetup
    begins: str  # how an episode starts, in words
    ends: str  # what ends an episode, in words
    speed: float  # held, by default [m/s]
    speed_range: tuple[float, float] = (3.0, math.inf)  # sensible speeds, assumed, where the chassis allows them [m/s]
    speeds: tuple[float, float] | None = None  # drawn from where neither the environment nor a reset gives one [m/s]
    scripted_inputs: tuple[int, ...] = ()  # plant inputs that the setup prescribes
    robot: bool = False  # whether the handwheel angle is prescribed
    driver_in_loop: bool = False  # whether a driver model holds the handwheel and follows the path
    chassis: tuple[str, ...] = ("single_track", "two_track")  # that it can run on, the default first
    options: Mapping[str, tuple[float, float, str]] = field(default_factory=dict)  # of reset: low, high, meaning [unit]
    memory_size: int = 0  # floats that the kernels remember
    usual: Mapping[str, float] = field(default_factory=dict)  # sizes of channels that are others here [their units]
    lane_half_width: float | None = None  # of the path's lane, for the picture [m]
    # For a task with several scenarios, each with speeds of its own; the scenario comes first in the setup's data.
    draw_scenario: DrawScenario | None = None
    unseen: int = 0  # how many of the last task observations are only for the driver model
    scenery: Callable[[Array, Array, Array, Array], Scenery] | None = None  # (channels, observations, data, memory)

    def __reduce__(self) -> tuple[Callable[[str], "Task"], tuple[str]]:
        return task, (self.name,)  # a copy is the task itself: ``draw_setup`` may be a function within a function

    @property
    def observed(self) -> tuple[Quantity, ...]:
        """All observations in their order."""
        channels = (OBSERVABLE_CHANNELS[name] for name in self.channels)
        sized = (quantity._replace(usual=self.usual.get(quantity.name, quantity.usual)) for quantity in channels)
        seen = self.task_observations[: len(self.task_observations) - self.unseen]
        return (*sized, SPEED, LAST_ACTION, *seen)

    @property
    def control_dt(self) -> float:
        """Time between decisions by default [s]."""
        return self.action.control_dt

    def speed_limits(self, chassis: str) -> tuple[float, float]:
        """Lowest and highest held speed on a chassis [m/s]."""
        (low, high), (least, most) = SPEEDS[chassis], self.speed_range
        return max(low, least), min(high, most)

    def draw_option(
        self, rng: np.random.Generator, options: Mapping[str, float], name: str, low: float, high: float
    ) -> float:
        """An option of the episode: drawn uniformly from its usual range, or as ``reset`` fixed it."""
        drawn = float(rng.uniform(low, high))  # drawn in both cases, so that later draws stay the same
        return drawn if name not in options else self.checked_option(name, options[name])

    def draw_whole_option(self, rng: np.random.Generator, options: Mapping[str, float], name: str) -> int:
        """A whole number of the episode: drawn evenly from all that the option allows, or as ``reset`` fixed it."""
        low, high, _ = self.options[name]
        drawn = int(rng.integers(int(low), int(high) + 1))
        value = options.get(name, drawn)
        if value != round(value):
            raise ValueError(f"reset option {name!r} must be a whole number from {low:g} to {high:g}, got {value}")
        return round(value)

    def checked_option(self, name: str, value: Any) -> float:
        """The value of a reset option; ValueError outside its range."""
        low, high, _ = self.options[name]
        return number(f"reset option {name!r}", value, minimum=low, maximum=high)


TASKS: Registry[Task] = Registry("task", "steer_env.tasks", camel_case)
_kernels: dict[type, dict[str, Callable]] = {}


def register(task: Task, observe: Callable, evaluate_step: Callable) -> Task:
    """Make a task known.

    Parameters
    ----------
    task : Task
    observe : ``(parameters, channels, path, data, step, memory, observations) -> None``
        Writes the task's observations in SI, from the plant's channels and the :class:`EpisodeSetup`.
    evaluate_step : ``(parameters, channels, observations, data, step, memory, rewards, costs, metrics) -> int``
        Adds the quality or quantity of every reward but the last and of every cost over the last ``step.dt`` to what
        the records hold, gives every metric its present value (a SUM its increment), and returns ``FINISHED``,
        ``GOES_ON`` or ``DEPARTED``. The records name what the task declares: ``rewards.feel``, ``metrics.rms_ripple``
        (:func:`by_name`).
    """
    TASKS.register(task.name, task)
    _kernels[type(task.parameters)] = {"observe": observe, "evaluate_step": evaluate_step}
    return task


def available() -> tuple[str, ...]:
    """Names of the tasks."""
    return TASKS.available()


def task(name: str) -> Task:
    """A task by name."""
    return TASKS[name]


def observe(parameters, channels, path, data, step, memory, observations):
    """Where the car is relative to the path or target."""
    _kernels[type(parameters)]["observe"](parameters, channels, path, data, step, memory, observations)


def evaluate_step(parameters, channels, observations, data, step, memory, rewards, costs, metrics):
    """Reward terms, costs and metrics of the last ``step.dt``; whether the episode goes on."""
    return _kernels[type(parameters)]["evaluate_step"](
        parameters, channels, observations, data, step, memory, rewards, costs, metrics
    )


for _point in (observe, evaluate_step):
    dispatch(_point, lambda parameters, name: _kernels.get(parameters, {}).get(name))
