"""What a task is, the registry of tasks, and the two dispatch points that the lanes' kernel calls.

A task is one file: its declaration (action, observations, terms, texts) with a function that draws a case, and two
kernels, ``look`` (where the car stands in the case) and ``judge`` (what it earned). The class of the task's rules
selects the kernels at compile time, as with friction laws. Docstrings, spaces and documentation are drawn from the
declaration. Kernels know nothing of the law or the chassis: they read channels, so they compile once.
"""

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from steer_env.friction.numerics.check import number
from steer_env.friction.numerics.kernel import dispatch
from steer_env.friction.numerics.registry import Registry, camel_case
from steer_env.vehicle.cars import Car
from steer_env.vehicle.chassis.common.interface import ASSIST_REQUEST, HAND
from steer_env.vehicle.steering.eps import SAMPLE_TIME

Array = NDArray[np.float64]

PER_NODE = 10  # samples of 1 ms
NODE = (
    PER_NODE * SAMPLE_TIME
)  # a case's inputs are given at this spacing, persons act at it, and every step is judged at it [s]


class Quantity(NamedTuple):
    """Something observed."""

    name: str
    unit: str
    bound: float  # the space spans +- this
    meaning: str = ""


class Term(NamedTuple):
    """A term of the reward or of the cost: weight times a quantity that ``judge`` gives, integrated over the step."""

    name: str
    weight: float  # [1/unit of the quantity]
    unit: str  # of the quantity
    meaning: str


class Figure(NamedTuple):
    """A figure of the whole episode, in ``info["metrics"]`` at its end."""

    name: str
    unit: str
    kind: int  # RMS, PEAK, SUM
    meaning: str


RMS, PEAK, SUM = range(3)


class Action(NamedTuple):
    """What the action drives."""

    meaning: str
    unit: str
    scale: float  # its value at action 1
    input: int  # place among the plant's inputs


HAND_TORQUE = Action("hand torque, left positive", "N m", 10.0, HAND)
ASSIST_TORQUE = Action(
    "assist torque at the column, left positive, on top of the boost curve's", "N m", 5.0, ASSIST_REQUEST
)


class Now(NamedTuple):
    """The moment at which kernels look and judge."""

    time: float  # since the start [s]
    dt: float  # since the last judgement [s]
    speed: float  # forward [m/s]
    action: float  # clipped to [-1, 1]
    rate: float  # of the action [1/s]


class Setting(NamedTuple):
    """In what a case is drawn."""

    car: Car
    speed: float  # held [m/s]


class Case(NamedTuple):
    """One episode's case."""

    nodes: Array  # (N + 1, M) scripted inputs every ``NODE`` from the start, columns as the task's ``scripted``
    path: Array | None = None  # (P, 4) as :func:`steer_env.courses.path.from_curvature`
    values: Array | None = None  # (V,) what the kernels need to know of the case, as the task lays it out
    pose: tuple[float, float, float] = (0.0, 0.0, 0.0)  # start: x, y [m], yaw angle [rad]
    released: float | None = None  # time from which nobody holds the handwheel [s]


class Scenery(NamedTuple):
    """What a picture shows of a case besides its path."""

    cones: Array | None = None  # (N, 3) x, y [m], 1 where touched
    wanted_angle: float | None = None  # of the handwheel [rad]


SPEED = Quantity("speed", "m/s", 100.0, "forward speed")  # observed in every task
# Plant channels that tasks observe, with their bounds.
CHANNELS = {
    quantity.name: quantity
    for quantity in (
        Quantity("handwheel_angle", "rad", 12.0),
        Quantity("handwheel_speed", "rad/s", 40.0),
        Quantity("torsion_bar_torque", "N m", 25.0),
        Quantity("lateral_acceleration", "m/s2", 20.0),
        Quantity("yaw_rate", "rad/s", 3.0),
        Quantity("lateral_speed", "m/s", 30.0),
        Quantity("column_speed", "rad/s", 40.0),
        Quantity("motor_torque", "N m", 80.0),
        Quantity("rack_force", "N", 15e3),
    )
}
STEERING = ("handwheel_angle", "handwheel_speed", "torsion_bar_torque", "lateral_acceleration", "yaw_rate")
DRIVING = (*STEERING, "lateral_speed")
ASSISTING = (*STEERING, "column_speed", "motor_torque")


@dataclass(frozen=True)
class Task:
    """A task; :func:`register` makes it an id."""

    name: str  # of the id, ``<Role><Scenario>``
    summary: str  # what is to be done, for the docstring's first lines
    rules: Any  # NamedTuple of what the kernels need; its class selects them
    action: Action
    channels: tuple[str, ...]
    situation: tuple[Quantity, ...]  # observed besides, from ``look``
    rewards: tuple[Term, ...]
    costs: tuple[Term, ...]
    figures: tuple[Figure, ...]
    start: Callable[[np.random.Generator, Setting, Mapping[str, float]], Case]
    begins: str  # how an episode starts, in words
    ends: str  # what ends it
    speed: float  # held, by default [m/s]
    speeds: tuple[float, float] = (3.0, math.inf)  # that make sense, assumed, where the chassis allows them [m/s]
    scripted: tuple[int, ...] = ()  # plant inputs that the case prescribes
    robot: bool = False  # handwheel angle prescribed
    person: bool = False  # a driver model holds the handwheel and follows the path
    chassis: tuple[str, ...] = ("single_track", "two_track")  # that it can run on, the default first
    options: Mapping[str, tuple[float, float, str]] = field(default_factory=dict)  # of reset: low, high, meaning [unit]
    memory: int = 0  # floats that the kernels remember
    lane_half_width: float | None = None  # of the path's lane, for the picture [m]
    scenery: Callable[[Array, Array, Array, Array], Scenery] | None = None  # of (row, situation, values, memory)

    @property
    def observed(self) -> tuple[Quantity, ...]:
        """Every observation in its place."""
        return (*(CHANNELS[name] for name in self.channels), SPEED, *self.situation)

    def chosen(
        self, rng: np.random.Generator, options: Mapping[str, float], name: str, low: float, high: float
    ) -> float:
        """An option of the case: drawn evenly from its usual range, or as ``reset`` fixed it."""
        drawn = float(rng.uniform(low, high))  # drawn either way: the same stream of numbers
        return drawn if name not in options else self.checked(name, options[name])

    def checked(self, name: str, value: Any) -> float:
        """The value of a reset option; ValueError outside its range."""
        low, high, _ = self.options[name]
        return number(f"reset option {name!r}", value, minimum=low, maximum=high)


TASKS: Registry[Task] = Registry("task", "steer_env.tasks", camel_case)
_kernels: dict[type, dict[str, Callable]] = {}


def register(task: Task, look: Callable, judge: Callable) -> Task:
    """Make a task known.

    Parameters
    ----------
    task : Task
    look : ``(rules, row, path, values, now, memory, situation) -> None``
        The situation in SI, from the plant's channels ``row`` and the :class:`Case`.
    judge : ``(rules, row, situation, values, now, memory, rewards, costs, figures) -> bool``
        Adds the quantity of every reward and cost over the last ``now.dt`` to what the arrays hold, gives every figure
        its present value (a SUM what it grew by), and tells whether the episode ends.
    """
    TASKS.register(task.name, task)
    _kernels[type(task.rules)] = {"look": look, "judge": judge}
    return task


def available() -> tuple[str, ...]:
    """Names of the tasks."""
    return TASKS.available()


def task(name: str) -> Task:
    """A task by name."""
    return TASKS[name]


def look(rules, row, path, values, now, memory, situation):
    """Where the car stands in the case."""
    _kernels[type(rules)]["look"](rules, row, path, values, now, memory, situation)


def judge(rules, row, situation, values, now, memory, rewards, costs, figures):
    """What the last ``now.dt`` earned."""
    return _kernels[type(rules)]["judge"](rules, row, situation, values, now, memory, rewards, costs, figures)


for _point in (look, judge):
    dispatch(_point, lambda rules, name: _kernels.get(rules, {}).get(name))
