"""The environment classes of the tasks, single and vector, with documentation generated from the task.

A class is made when it is first asked for, so that an id imports only its own task. The classes of the tuning
environments are made in :mod:`steer_env.tuning.environments`.
"""

import textwrap
from collections.abc import Sequence
from functools import cache

from steer_env import tasks
from steer_env.env import SteerEnv
from steer_env.episode.randomise import RANGES
from steer_env.registration import history
from steer_env.rendering.modes import frame_rate
from steer_env.tasks import Task
from steer_env.vector import SteerVectorEnv


def table(head: tuple[str, ...], rows: Sequence[tuple[str, ...]]) -> str:
    """A table in Markdown."""
    first, *rest = (f"| {' | '.join(line)} |" for line in (head, *rows))
    return "\n".join([first, "|" + "---|" * len(head), *rest])


_COUNTED = ("the time", "the way gained along the path, over the held speed")


def _follows_path(task: Task) -> bool:
    return any(quantity.name == "lateral_offset" for quantity in task.observed)


def _documentation(task: Task) -> str:
    """A docstring in Gymnasium's form."""
    action = task.action
    observations = [
        (
            str(i),
            q.name.replace("_", " ") + (f": {q.meaning}" if q.meaning else ""),
            f"{q.bound:.6g}",
            f"{q.usual:.6g}",
            q.unit,
        )
        for i, q in enumerate(task.observed)
    ]
    terms = [(f"`{t.name}`", f"{t.weight:.6g}", t.meaning) for t in task.rewards]
    costs = [(f"`{c.name}`", f"{c.limit:.6g}", c.unit, c.meaning) for c in task.costs]
    metrics = [(f"`{m.name}`", m.unit, ("rms", "peak", "sum")[m.kind], m.meaning) for m in task.metrics]
    options = [(f"`{key}`", meaning) for key, (_, _, meaning) in reset_options(task).items()]
    way = "is held for `control_dt`"
    if action.ramped:
        way = "is reached at the end of `control_dt`, on a straight line from the last one"
    sections = [
        task.summary,
        "## Action",
        f"`Box(-1, 1, (1,))`: {action.meaning}, which {way}. An action of 1 is {action.scale:g} {action.unit}.",
        "## Observation",
        f"`Box({len(observations)},)`. Observations are clipped to the bounds and divided by the usual sizes; with "
        "`normalise=False` they are in SI units.",
        table(("index", "observation", "bound", "usual", "unit"), observations),
        "## Reward",
        'The reward is the sum of the terms, which are in `info["reward_terms"]`; each is the integral of its weight '
        f"times a quality from 0 to 1. The integral is over {_COUNTED[_follows_path(task)]}. A failure costs 1, and "
        "nothing counts after it, so that no way to fail is worth more than to go on.",
        table(("term", "weight [1/s]", "quality"), terms),
        "## Cost\n\nFor constrained learning: each cost is a quantity over its budget for an episode, so that the "
        'budget of each is 1 (`cost_limit`). The terms are in `info["cost_terms"]`, their sum is `info["cost"]`.',
        table(("cost", "budget per episode", "unit", "quantity"), costs),
        '## Metrics\n\nThose of the episode so far are in `info["metrics"]`, zero at its start.',
        table(("metric", "unit", "over the episode", "of"), metrics),
        "## Start",
        textwrap.fill(task.begins, 118),
        "## End",
        textwrap.fill(
            f"{task.ends} The episode fails as well if the car rolls over or spins out, or a state is no longer "
            "finite.",
            118,
        ),
        "## Arguments",
        textwrap.fill(_arguments(task), 118),
        "`reset(options={...})` fixes what would be drawn:",
        table(("option", "meaning"), options),
        f"## Version history\n\n{history(task.name)}",
    ]
    return "\n\n".join(sections) + "\n"


def reset_options(task: Task) -> dict[str, tuple[float, float, str]]:
    """What ``reset`` takes, with its range on the default chassis and its meaning."""
    known = {**task.options, **RANGES, "speed": (*task.speed_limits(task.chassis[0]), RANGES["speed"][2])}
    if task.draw_scenario:
        del known["speed"]
    return known


def _arguments(task: Task) -> str:
    """The arguments of a task in words."""
    low, high = task.speed_limits(task.chassis[0])
    speed = (
        "There is no speed, which is drawn with the scenario."
        if task.draw_scenario
        else f"The default speed is {default_speed(task)}, and {low:g} to {high:g} m/s are allowed."
    )
    return (
        f"Those of `steer_env.SteerEnv`. {speed} The default chassis is {task.chassis[0]!r}. The default `control_dt` "
        f"is {task.control_dt:g} s."
    )


def default_speed(task: Task) -> str:
    """The held speed of a task that draws no scenario, in words."""
    if task.speeds is None:
        return f"{3.6 * task.speed:g} km/h"
    low, high = (3.6 * speed for speed in task.speeds)
    return f"drawn evenly from {low:.3g} to {high:.3g} km/h"


@cache
def _classes(name: str) -> tuple[type[SteerEnv], type[SteerVectorEnv]]:
    """Single and vector environment of a task."""
    task = tasks.task(name)
    fields = {"task": task, "__doc__": _documentation(task), "__module__": __name__}
    rate = {"render_fps": frame_rate(None, task.control_dt)}
    single = type(name, (SteerEnv,), {**fields, "metadata": {**SteerEnv.metadata, **rate}})
    return single, type(f"{name}Vector", (SteerVectorEnv,), {**fields, "metadata": {**SteerVectorEnv.metadata, **rate}})


def __getattr__(name: str) -> type:
    for task in tasks.available():
        if name in (task, f"{task}Vector"):
            return _classes(task)[name != task]
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
