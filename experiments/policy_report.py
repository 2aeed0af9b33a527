"""Policies beside the baselines on held-out seeds: table with intervals, differences, learning curve, frames."""

import base64
import csv
import io
import math
from collections.abc import Callable, Collection, Mapping
from functools import partial
from importlib import metadata
from pathlib import Path
from typing import Any, NamedTuple

import gymnasium as gym
import matplotlib.image
import numpy as np
from numpy.typing import NDArray

from experiments import plots, provenance, trials
from experiments.assessment import environment
from experiments.files import replaced_directory, write_json
from experiments.trials import Controller, Estimate, Trials
from steer_env import assists, drivers, tasks

CONTENTS = frozenset({"index.html", "evaluation.json"})
FRAMES = 4  # of the first held-out episode

Array = NDArray[np.float64]
Maker = Callable[[Any], Controller]


def baselines(env_id: str) -> dict[str, Maker]:
    """Classical controllers of an id by name: driver models where a path is seen, assists where the assist acts."""
    task = tasks.task(env_id.removeprefix("steer_env/").rpartition("-")[0])
    if task.name.startswith("Assist"):
        return {name: partial(assists.make, name) for name in assists.available()}
    if any(quantity.name == "lateral_offset" for quantity in task.situation):
        return {name: partial(drivers.Controller, driver=name) for name in drivers.available() if name != "free"}
    return {}


class Evaluation(NamedTuple):
    """Controllers on the same held-out episodes; the first one is what is evaluated."""

    env_id: str
    about: dict[str, Any]  # how the environment was made
    episodes: int
    found: dict[str, Trials]
    values: dict[str, dict[str, Estimate]]  # controller -> figure
    gaps: dict[str, dict[str, Estimate]]  # baseline -> figure: the first controller's less the baseline's
    units: dict[str, str]


def evaluate(
    env_id: str,
    controllers: Mapping[str, Maker],
    episodes: int,
    notify: Callable[[float, str], None] = lambda *_: None,
    **arguments: Any,
) -> Evaluation:
    """Every controller on the same episodes."""
    found = {}
    for k, (name, make) in enumerate(controllers.items()):
        notify(k / len(controllers), name)
        found[name] = trials.collect(env_id, make, episodes, **arguments)
    first = next(iter(found))
    task = tasks.task(env_id.removeprefix("steer_env/").rpartition("-")[0])
    units = {"reward": "", "cost": "", "clean_share": "1"} | {figure.name: figure.unit for figure in task.figures}
    return Evaluation(
        env_id,
        arguments,
        episodes,
        found,
        {name: trials.summary(trial) for name, trial in found.items()},
        {name: trials.differences(found[first], trial) for name, trial in found.items() if name != first},
        units,
    )


def entry(e: Estimate, unit: str) -> dict[str, Any]:
    """A figure for a machine."""
    return {"value": e.value, "ci": [x if math.isfinite(x) else None for x in (e.low, e.high)], "unit": unit}


def as_json(found: Evaluation) -> dict[str, Any]:
    """The evaluation for a machine."""

    def entries(values: Mapping[str, Estimate]) -> dict[str, Any]:
        return {name: entry(e, found.units[name]) for name, e in values.items()}

    return {
        "env": found.env_id,
        "arguments": {key: str(value) for key, value in found.about.items()},
        "episodes": found.episodes,
        "first_seed": trials.HELD_OUT,
        "metrics": {label: entries(values) for label, values in found.values.items()},
        "differences": {label: entries(values) for label, values in found.gaps.items()},
        "provenance": provenance.versions(),
    }


def frames(env_id: str, make: Maker, **arguments: Any) -> list[str]:
    """Pictures of the first held-out episode, evenly over its time, as data for a page; none without the extra."""
    try:
        env = gym.make(env_id, render_mode="rgb_array", **arguments)
    except ValueError:
        return []
    shown: list[Any] = []
    over = False
    controller = make(env)
    observation, _ = env.reset(seed=trials.HELD_OUT)
    while not over:
        observation, _, terminated, truncated, _ = env.step(controller.act(observation))
        over = terminated or truncated
        shown.append(None if len(shown) % 20 else env.render())
    drawn = [frame for frame in shown if frame is not None]
    env.close()
    chosen = np.linspace(0, len(drawn) - 1, FRAMES + 2)[1:-1].round().astype(int)
    return [_picture(np.asarray(drawn[k])) for k in chosen]


def _picture(frame: Any) -> str:
    file = io.BytesIO()
    matplotlib.image.imsave(file, frame, format="png")
    return "data:image/png;base64," + base64.b64encode(file.getvalue()).decode()


def read_curve(path: Path) -> dict[str, Array]:
    """Columns of a learning curve: seconds and steps of training, then figures of the validation's episodes."""
    with path.open(encoding="utf-8", newline="") as file:
        rows = list(csv.DictReader(file))
    return {key: np.array([float(row[key]) for row in rows]) for key in rows[0]}


def aim(figures: Collection[str]) -> str:
    """The figure of a task that its training is for."""
    return next((name for name in ("cones_hit", "rms_feel_error", "rms_lateral_offset") if name in figures), "cost")


def _learning(curves: Mapping[str, Path]) -> str:
    """Means over the validation's seeds over the steps of training, of each run, as a plot."""
    runs = {name: read_curve(path) for name, path in curves.items()}
    shown = [
        plots.Panel(
            "steps of training",
            figure.replace("_", " "),
            [
                plots.Line(name, run["steps"], run[figure], colour)
                for colour, (name, run) in zip(plots.colours(list(runs)), runs.items())
            ],
        )
        for figure in ("reward", aim(next(iter(runs.values()))))
    ]
    return plots.draw(shown)


def write(out: Path, found: Evaluation, controllers: Mapping[str, Maker], curves: Mapping[str, Path]) -> None:
    """Write ``index.html`` and ``evaluation.json`` into a directory, which appears or is replaced as a whole."""
    names = list(found.values)
    best = max(names[1:], key=lambda name: found.values[name]["reward"].value, default=names[0])
    pictures = {
        name: frames(found.env_id, controllers[name], **found.about) for name in dict.fromkeys([names[0], best])
    }
    page = (
        environment()
        .get_template("policies.html.j2")
        .render(
            f=found,
            names=names,
            figures=list(found.values[names[0]]),
            pictures=pictures,
            curve=_learning(curves) if curves else "",
            script=plots.script() if curves else "",
            version=metadata.version("steer-env"),
            first_seed=trials.HELD_OUT,
        )
    )
    with replaced_directory(out, CONTENTS) as part:
        (part / "index.html").write_text(page, encoding="utf-8")
        write_json(part / "evaluation.json", as_json(found))
