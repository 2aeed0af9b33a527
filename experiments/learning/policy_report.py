"""Report of policies and baselines on held-out episodes: means with intervals, differences, learning curves, frames."""

import base64
import csv
import io
import math
import re
from collections.abc import Callable, Collection, Mapping
from importlib.util import find_spec
from pathlib import Path
from typing import Any, NamedTuple

import gymnasium as gym
import matplotlib.image
import numpy as np
from numpy.typing import NDArray

from steer_env import friction, tasks
from steer_env.episode.randomise import RANGES
from steer_env.experiments.learning import held_out
from steer_env.experiments.learning.constants import CONSTRAINT, HELD_OUT
from steer_env.experiments.learning.controllers import Maker, baselines
from steer_env.experiments.learning.held_out import Episodes, Estimate
from steer_env.experiments.pages import plots, provenance
from steer_env.experiments.pages.files import replaced_directory
from steer_env.experiments.pages.pages import Page, write_page
from steer_env.experiments.pages.pictures import dots
from steer_env.experiments.pages.style import colours
from steer_env.experiments.pages.words import label, plain
from steer_env.experiments.sweep import Runner, run
from steer_env.friction.law import law_of
from steer_env.friction.numerics import toml
from steer_env.friction.numerics.check import read_number
from steer_env.friction.sites import Sites, as_text

CONTENTS = frozenset({"index.html", "evaluation.json"})
MOST_CONTROLLERS = 10  # controllers on the first screen
FRAMES = 4  # pictures of the first held-out episode

# Metrics of which more (1) or less (-1) is better; the others only describe.
SENSES = {
    "reward": 1.0,
    "cost": -1.0,
    "cones_hit": -1.0,
    "rms_feel_error": -1.0,
    "rms_lateral_offset": -1.0,
    "rms_angle_error": -1.0,
    "rms_released_angle": -1.0,
    "rms_ripple": -1.0,
    "peak_lateral_offset": -1.0,
}
# What the tasks are about; the first that a task has is its aim.
AIMS = ("rms_feel_error", "cones_hit", "rms_lateral_offset", "rms_angle_error")
ROUNDING = 1e-9  # relative difference below which two values count as equal

Array = NDArray[np.float64]


class Evaluation(NamedTuple):
    """Controllers on the same held-out episodes; the first one is the one that is evaluated."""

    env_id: str
    about: dict[str, Any]  # how the environment was made
    episodes: int
    found: dict[str, Episodes]
    values: dict[str, dict[str, Estimate]]  # controller -> metric
    gaps: dict[str, dict[str, Estimate]]  # baseline -> metric: the first controller's less the baseline's
    units: dict[str, str]


def evaluate(
    env_id: str,
    controllers: Mapping[str, Maker],
    episodes: int,
    notify: Callable[[float, str], None] = lambda *_: None,
    options: Mapping[str, float] | None = None,
    sweep: Runner = run,
    **arguments: Any,
) -> Evaluation:
    """Drive every controller in the same episodes; ``options`` are those of their resets."""
    jobs = [held_out.Job(name, env_id, make, episodes, options or {}, arguments) for name, make in controllers.items()]
    found = dict(zip(controllers, sweep(held_out.evaluate, jobs, notify=notify, words=held_out.job_label)))
    return assemble(env_id, found, episodes, {**arguments, "options": options} if options else arguments)


def assemble(env_id: str, found: dict[str, Episodes], episodes: int, arguments: dict[str, Any]) -> Evaluation:
    """An evaluation from the episodes of its controllers, the first of which is the one that is evaluated."""
    first = next(iter(found))
    task = tasks.task(env_id.removeprefix("steer_env/").rpartition("-")[0])
    units = {"reward": "", "cost": "", "failed_share": "1", "clean_share": "1"}
    units |= {metric.name: metric.unit for metric in task.metrics}
    return Evaluation(
        env_id,
        arguments,
        episodes,
        found,
        {name: held_out.summary(episodes_of) for name, episodes_of in found.items()},
        {name: held_out.differences(found[first], episodes_of) for name, episodes_of in found.items() if name != first},
        units,
    )


def conditions(made: Mapping[str, Any]) -> dict[str, str]:
    """Arguments of an environment in words with units: name of the condition -> its value."""
    words = {}
    for key, value in made.items():
        if key == "friction":
            words["friction"] = _law(value)
        elif key == "vehicle" and isinstance(value, Mapping):
            words["vehicle"] = f"{value['name']}, {provenance.digest(value)[:8]}"  # two cars may have one name
        elif key == "randomise":
            for name, pair in value.items():
                if name == "friction":
                    words |= {f"friction's {own}": _range(ends) for own, ends in pair.items()}
                else:
                    unit = re.search(r"\[([^\]]+)\]$", RANGES[name][2])
                    words[_title(name)] = _range(pair, unit[1] if unit and unit[1] != "1" else "")
        else:
            words[_title(key)] = plain(value)
    return words


def _title(option: str) -> str:
    """An option of an environment in words."""
    return "friction scale" if option == "friction_level" else option.replace("_", " ")


def _range(pair: Any, unit: str = "") -> str:
    low, high = pair
    return f"{low:g} to {high:g} {unit}".rstrip()


def _law(law: Any) -> str:
    """Name of a law with the parameters that are not its defaults; sites as text."""
    if isinstance(law, str):
        return law
    if isinstance(law, Sites):
        return as_text(law)
    name = law_of(law).name
    usual = friction.make(name)._asdict()
    own = {key: value for key, value in law._asdict().items() if str(value) != str(usual[key])}
    return ", ".join([name, *(f"{key} {plain(x) if np.ndim(x) == 0 else 'of its own'}" for key, x in own.items())])


def shade(metric: str, gap: Estimate, *compared: Estimate) -> str:
    """How a difference between ``compared`` is shown: "better", "worse", "differs", or "" if it may be zero."""
    if not (gap.low > 0.0 or gap.high < 0.0) or abs(gap.value) <= ROUNDING * max(
        1.0, *(abs(e.value) for e in compared)
    ):
        return ""
    return {1.0: "better", -1.0: "worse"}.get(math.copysign(1.0, gap.value) * SENSES.get(metric, 0.0), "differs")


def entry(e: Estimate, unit: str) -> dict[str, Any]:
    """A metric as JSON."""
    return {"value": e.value, "ci": [x if math.isfinite(x) else None for x in (e.low, e.high)], "unit": unit}


def as_json(found: Evaluation) -> dict[str, Any]:
    """The evaluation as JSON."""

    def entries(values: Mapping[str, Estimate]) -> dict[str, Any]:
        return {name: entry(e, found.units[name]) for name, e in values.items()}

    return {
        "env": found.env_id,
        "arguments": {key: str(value) for key, value in found.about.items() if key != "vehicle"}
        | {key: value for key, value in conditions(found.about).items() if key == "vehicle"},
        "episodes": found.episodes,
        "first_seed": HELD_OUT,
        "metrics": {label: entries(values) for label, values in found.values.items()},
        "differences": {label: entries(values) for label, values in found.gaps.items()},
        "provenance": provenance.versions(),
    }


def frames(env_id: str, make: Maker, **arguments: Any) -> list[str]:
    """Frames of the first held-out episode, evenly over its time, as data URLs; none without the extra ``render``."""
    if find_spec("pygame") is None:
        return []
    try:
        env = gym.make(env_id, render_mode="rgb_array", **arguments)
    except ValueError:
        return []
    shown: list[Any] = []
    over = False
    controller = make(env)
    observation, _ = env.reset(seed=HELD_OUT)
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


def read_curve(path: Path, needed: Collection[str] = ("steps", "reward")) -> dict[str, Array]:
    """Columns of a learning curve: seconds and steps of training, then means of the validation episodes."""
    try:
        header, *rows = [*csv.reader(io.StringIO(toml.text(path), newline=""))] or [[]]
    except csv.Error as error:
        raise ValueError(f"{path}: {error}") from None
    if not set(needed) <= set(header):
        words = " and ".join(needed)
        raise ValueError(f"{path}: line 1: expected names of columns, {words} among them, got {header}")
    for line, row in enumerate(rows, 2):
        if len(row) != len(header) or not all(isinstance(read_number(cell), float) for cell in row):
            raise ValueError(f"{path}: line {line}: expected {len(header)} numbers, got {row}")
    return {key: np.array([float(row[place]) for row in rows]) for place, key in enumerate(header)}


def aim(metrics: Collection[str]) -> str:
    """The metric that the training of a task is for."""
    return next((name for name in AIMS if name in metrics), "cost")


def _learning(curves: Mapping[str, Path], units: Mapping[str, str]) -> str:
    """A plot of the validation means of each run over the steps of training, and of its rollouts with a budget."""
    runs = {name: read_curve(path) for name, path in curves.items()}
    beside = {name: path.with_name(CONSTRAINT) for name, path in curves.items()}
    bound = {
        name: read_curve(path, ("steps", "cost", "multiplier", "budget"))
        for name, path in beside.items()
        if path.is_file()
    }
    first = next(iter(runs.values()))
    wanted = [name for name in dict.fromkeys(("reward", aim(first), "cost")) if name in first]
    titled = [(label(name) + _with_brackets(units.get(name, "1")), name, runs) for name in wanted]
    if bound:
        titled += [("cost, rollouts", "cost", bound), ("multiplier of the cost", "multiplier", bound)]
    budgets = [
        plots.Line(f"budget of {name}", run["steps"], run["budget"], "grey", "dash") for name, run in bound.items()
    ]
    shown = [
        plots.Panel(
            "steps of training",
            title,
            [
                plots.Line(name.replace("_", " "), run["steps"], run[metric], colour)
                for colour, (name, run) in zip(colours(of), of.items())
            ]
            + (budgets if metric == "cost" else []),
        )
        for title, metric, of in titled
    ]
    return plots.markup(shown, "learning", False)


def _with_brackets(unit: str) -> str:
    return f" [{unit}]" if unit not in ("", "1") else ""


def write(
    out: Path,
    found: Evaluation,
    controllers: Mapping[str, Maker],
    curves: Mapping[str, Path],
    trace: Mapping[str, Any] | None = None,
) -> None:
    """Write ``index.html`` and ``evaluation.json`` into a directory, which appears or is replaced as a whole.

    Both hold the ``trace`` of :func:`steer_env.experiments.pages.provenance.trace`, by default that of a Python
    program.
    """
    trace = provenance.trace() if trace is None else trace
    names = list(found.values)
    best = max(names[1:], key=lambda name: found.values[name]["reward"].value, default=None)
    pictures = {name: frames(found.env_id, controllers[name], **found.about) for name in (names[0], best) if name}
    ranked = sorted(names, key=lambda name: -found.values[name]["reward"].value)[:MOST_CONTROLLERS]
    values = {
        "f": found,
        "names": names,
        "best": best,
        "ranked": ranked,
        "first": list(dict.fromkeys(["reward", aim(found.units), "cost"])),
        "rewards": dots({label(name): found.values[name]["reward"] for name in ranked}, "reward"),
        "metrics": list(found.values[names[0]]),
        "pictures": pictures,
        "conditions": conditions(found.about),
        "others": "the baselines" if set(names[1:]) <= baselines(found.env_id).keys() else "the others",
        "shade": shade,
        "curve": _learning(curves, found.units) if curves else "",
        "budgeted": any(path.with_name(CONSTRAINT).is_file() for path in curves.values()),
        "first_seed": HELD_OUT,
    }
    page = Page("policies", values)
    with replaced_directory(out, CONTENTS) as part:
        write_page(part, page, {"evaluation.json": as_json(found)}, trace)
