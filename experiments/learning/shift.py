"""Shift: a policy under conditions that its training did not draw, beside the baselines in the same episodes.

The picture of a policy and the baselines under conditions that the training did not draw.
"""

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import gymnasium
import numpy as np
from matplotlib.figure import Figure

from steer_env import friction, tasks
from steer_env.drivers.common.definition import DELAY, MUSCLE_LAG
from steer_env.experiments.learning import held_out, policy, policy_report
from steer_env.experiments.learning.constants import HELD_OUT
from steer_env.experiments.learning.controllers import ZeroAction, baselines
from steer_env.experiments.learning.held_out import Estimate, Job
from steer_env.experiments.pages import provenance
from steer_env.experiments.pages.files import replaced_directory
from steer_env.experiments.pages.options import Friction
from steer_env.experiments.pages.pages import Page, image, write_page
from steer_env.experiments.pages.pictures import dots
from steer_env.experiments.pages.style import DASHES, PALETTE, as_svg, legend, new_figure
from steer_env.experiments.sweep import Runner, run
from steer_env.friction.law import law_of
from steer_env.vehicle import cars

COLUMNS = 3
TITLES = {"level": "friction level", "noise": "sensor noise"}  # of conditions whose name alone is not clear


class Point(NamedTuple):
    """A mean and its 95 % interval under one condition [unit of the value]."""

    label: str
    x: float | None
    value: float
    low: float
    high: float


@as_svg
def shifts(panels: Mapping[str, Mapping[str, Sequence[Point]]], home: Mapping[str, float]) -> Figure:
    """The reward over each condition, a panel for each, with a dotted line at the policy's reward as trained.

    Parameters
    ----------
    panels : condition -> controller -> points
        The first controller is the policy. Points without a number stand side by side.
    home : controller -> reward as trained
    """
    rows = -(-len(panels) // COLUMNS)
    figure = new_figure(9.6, 0.6 + 2.6 * rows)
    grid = figure.subplots(rows, min(COLUMNS, len(panels)), squeeze=False).ravel()
    for axes, (over, controllers) in zip(grid, panels.items()):
        for k, (name, points) in enumerate(controllers.items()):
            named = any(point.x is None for point in points)
            x = [float(i) if named else point.x for i, point in enumerate(points)]
            value = np.array([point.value for point in points])
            ends = np.array(
                [[point.value - point.low for point in points], [point.high - point.value for point in points]]
            )
            axes.errorbar(
                x,
                value,
                None if np.isnan(ends).any() else ends,
                color=PALETTE[k % len(PALETTE)],
                linestyle="none" if named else DASHES[k % len(DASHES)],
                marker="o" if k == 0 else ".",
                label=name.replace("_", " "),
                zorder=3.0 - 0.1 * k,
            )
            if named:
                axes.set_xticks(x, [point.label.replace(", ", ",\n") for point in points], rotation=45, ha="right")
        axes.axhline(next(iter(home.values())), color="#888888", linestyle=":", linewidth=1.0)
        unit = next(iter(controllers.values()))[0].label.partition(" ")[2] if not named else ""
        axes.set_xlabel(f"[{unit}]" if unit else "")
        axes.set_title(over)
    for axes in grid[:: min(COLUMNS, len(panels))]:
        axes.set_ylabel("reward")
    for axes in grid[len(panels) :]:
        axes.set_axis_off()
    legend(figure, grid[0])
    return figure


CONTENTS = frozenset({"index.html", "shift.json", "shift.svg"})
HOME = "as trained"

# The record from which laws are identified: slow sweeps of a steering system in a rig, the widest first; assumed.
AMPLITUDES, PERIOD, SAMPLE, NOISE = (3.0, 3.0, 1.0, 0.5), 20.0, 0.01, 0.02  # [deg], [s], [s], [N m]
FITS = 2.0 * NOISE  # residual above which a law does not describe the record [N m]

# Values of each condition, well beyond what is usual; assumed.
LEVELS = (0.5, 1.0, 2.0, 3.0, 5.0)  # [1]
LOADS = (0.0, 150.0, 300.0, 450.0)  # [kg]
NOISES = (0.0, 1.0, 2.0, 5.0)  # factor on the sensors' noise [1]
SPEEDS = (0.6, 0.8, 1.0, 1.2, 1.4)  # factor on the task's own, within the range of the task [1]
DELAYS = {"Assist": (0.0, 0.01, 0.02, 0.04), "Driver": (0.0, 0.05, 0.1, 0.15)}  # whole decisions of the role [s]


class Labelled(NamedTuple):
    """A law with its parameters, as :class:`steer_env.experiments.pages.options.Friction`."""

    label: str
    parameters: Any


class Change(NamedTuple):
    """What is other than in the training."""

    label: str
    arguments: dict[str, Any]  # of ``gymnasium.make_vec``, that replace those of the training
    options: dict[str, float]  # of resets, which leave what else is drawn as it is
    x: float | None = None  # the value, where it is a number [in the unit of its label]


class Cell(NamedTuple):
    """The held-out episodes under one change."""

    values: dict[str, dict[str, Estimate]]  # controller -> metric
    lost: Estimate  # the policy's reward less its reward as trained, paired by seed
    gained: dict[str, Estimate]  # baseline -> the policy's reward less the baseline's, paired by seed
    x: float | None  # as :class:`Change` [in the unit of its label]


class Shift(NamedTuple):
    """The same held-out episodes under every change."""

    env_id: str
    trained: str  # law of the training
    episodes: int
    home: Cell
    cells: dict[str, dict[str, Cell]]  # condition -> label of the change
    units: dict[str, str]
    conditions: dict[str, str]  # of the training, in words
    refused: dict[str, str]  # label of a law that the id cannot run -> why


def identify_laws(home: Friction) -> list[Labelled]:
    """Laws identified from a noisy quasi-static record of ``home``: those that describe it, with their parameters."""
    phase = 2.0 * np.pi * np.arange(0.0, 1.0, SAMPLE / PERIOD)
    x = np.concatenate([np.radians(amplitude) * np.sin(phase) for amplitude in AMPLITUDES])
    torque = friction.response(home.parameters, x, SAMPLE) + np.random.default_rng(0).normal(0.0, NOISE, x.size)
    fits = [
        friction.fit(x, torque, name, dt=SAMPLE)
        for name in friction.available()
        if law_of(friction.make(name)).fitted  # a law that is not fitted has no parameters to identify
    ]
    return [Labelled(f"{found.law}, identified", found.parameters) for found in fits if found.residual < FITS]


def person(task: tasks.Task) -> dict[str, float]:
    """Options of a reset that give a policy what the driver models have: their delay, in whole decisions, and muscles.

    Parameters
    ----------
    task : Task

    Returns
    -------
    dict of str to float
        ``delay`` and ``action_lag`` [s].
    """
    return {"delay": task.control_dt * round(DELAY / task.control_dt), "action_lag": MUSCLE_LAG}


def changes(
    over: str, env_id: str, home: Friction, laws: Sequence[Friction] = (), own: cars.Car | None = None
) -> list[Change]:
    """The changes of one condition; none of the speed where the task draws it with its scenarios.

    Those of "human" put the policy of a driver on the terms of the driver models: it sees as late as they do, in whole
    decisions, and its torque lags as their muscles do. The models themselves bring both already.

    Parameters
    ----------
    over : str
        One of ``constants.SHIFTS``.
    env_id : str
    home : Friction
        Law of the training.
    laws : sequence of Friction
        Laws in place of all laws and the identified ones.
    own : Car, optional
        A car beside the packaged ones.
    """
    task = tasks.task(policy.check_driven(env_id))

    def fixed(name: str, values: Sequence[float], unit: str, scale: float = 1.0) -> list[Change]:
        """Values of a reset option, labelled in a unit, of which ``scale`` make one in SI."""
        return [Change(f"{scale * v:.4g}{unit}", {}, {name: v}, scale * v) for v in values]

    if over == "law":
        chosen: Sequence[Any] = laws or [*map(Friction, friction.available()), *identify_laws(home)]
        return [Change(law.label, {"friction": law.parameters}, {}) for law in chosen if law.label != home.label]
    if over == "car":
        found = [Change(name, {"vehicle": name}, {}) for name in cars.available()]
        if own is not None:
            label = f"{own.name}, changed" if own.name in cars.available() else own.name
            found.append(Change(label, {"vehicle": own.data()}, {}))
        return found
    if over == "speed":
        if task.draw_scenario is not None:
            return []  # its speeds belong to its scenarios
        low, high = task.speed_limits(task.chassis[0])
        return fixed("speed", sorted({min(max(s * task.speed, low), high) for s in SPEEDS}), " km/h", 3.6)
    if over == "human":
        if not task.name.startswith("Driver"):
            return []
        options = person(task)
        alone = [
            *fixed("delay", (options["delay"],), " ms of delay", 1e3),
            *fixed("action_lag", (options["action_lag"],), " ms of lag", 1e3),
        ]
        return [*alone, Change(" and ".join(change.label for change in alone), {}, options)]
    if over == "delay":
        return fixed("delay", next(DELAYS[role] for role in DELAYS if task.name.startswith(role)), " ms", 1e3)
    values = {
        "level": ("friction_level", LEVELS, ""),
        "load": ("load", LOADS, " kg"),
        "noise": ("sensor_noise", NOISES, ""),
    }
    return fixed(*values[over])


def collect(
    path: Path,
    chosen: Mapping[str, Sequence[Change]],
    episodes: int,
    notify: Callable[[float, str], None] = lambda *_: None,
    sweep: Runner = run,
) -> Shift:
    """Evaluate the policy and every baseline of its id as trained, and under each change of each condition.

    Laws that the id refuses, such as those that fall too steeply with the speed, are left out and told.

    Raises
    ------
    ValueError
        If no change is left.
    """
    about = policy.read_description(path)
    env_id, home = about["env"], policy.law(about["friction"], path)
    controllers: dict[str, Any] = {"policy": policy.load(path), "zero": ZeroAction, **baselines(env_id)}
    made = {**policy.conditions(about), "friction": home.parameters}

    why = {change.label: _refusal(env_id, {**made, **change.arguments}) for change in chosen.get("law", ())}
    refused = {label: reason for label, reason in why.items() if reason}
    kept = {over: [change for change in each if change.label not in refused] for over, each in chosen.items()}
    if not any(kept.values()):
        raise ValueError("; ".join(refused.values()))
    every = [(HOME, Change(HOME, {}, {})), *((over, change) for over, each in kept.items() for change in each)]
    jobs = [
        Job(f"{over} {change.label}, {name}", env_id, make, episodes, change.options, {**made, **change.arguments})
        for over, change in every
        for name, make in controllers.items()
    ]
    results = iter(sweep(held_out.evaluate, jobs, notify=notify, words=held_out.job_label))
    own: Any = None
    cells: dict[str, dict[str, Cell]] = {over: {} for over in (HOME, *kept) if over == HOME or kept[over]}
    for over, change in every:
        found = policy_report.assemble(env_id, {name: next(results) for name in controllers}, episodes, made)
        reward = found.found["policy"].reward
        own = reward if own is None else own  # as trained, which comes first
        gained = {name: gaps["reward"] for name, gaps in found.gaps.items()}
        cells[over][change.label] = Cell(found.values, held_out.mean(reward - own), gained, change.x)
    as_trained = cells.pop(HOME)[HOME]
    conditions = policy_report.conditions({**policy.conditions(about), "friction": home.label})
    return Shift(env_id, home.label, episodes, as_trained, cells, found.units, conditions, refused)


def _refusal(env_id: str, arguments: Mapping[str, Any]) -> str:
    """Why an id cannot be made with these arguments; empty where it can."""
    try:
        gymnasium.make(env_id, **arguments).close()
    except ValueError as error:
        return str(error)
    return ""


def as_json(found: Shift) -> dict[str, Any]:
    """The table as JSON."""

    def entries(cell: Cell) -> dict[str, Any]:
        return {
            "metrics": {
                name: {metric: policy_report.entry(e, found.units[metric]) for metric, e in values.items()}
                for name, values in cell.values.items()
            },
            "lost": policy_report.entry(cell.lost, ""),
            "gained": {name: policy_report.entry(e, "") for name, e in cell.gained.items()},
        }

    return {
        "env": found.env_id,
        "trained": found.trained,
        "episodes": found.episodes,
        "first_seed": HELD_OUT,
        HOME.replace(" ", "_"): entries(found.home),
        "refused": found.refused,
        "over": {over: {label: entries(cell) for label, cell in each.items()} for over, each in found.cells.items()},
        "provenance": provenance.versions(),
    }


def picture(found: Shift) -> str:
    """The reward of every controller over each condition, as SVG."""
    return shifts(
        {
            over: {
                name: [Point(label, cell.x, *cell.values[name]["reward"]) for label, cell in each.items()]
                for name in found.home.values
            }
            for over, each in found.cells.items()
        },
        {name: found.home.values[name]["reward"].value for name in found.home.values},
    )


def write(out: Path, found: Shift, trace: Mapping[str, Any] | None = None) -> None:
    """Write ``index.html``, ``shift.json`` and ``shift.svg`` into a directory, which appears or is replaced.

    ``trace`` is as in :func:`steer_env.experiments.learning.policy_report.write`.
    """
    trace = provenance.trace() if trace is None else trace
    drawn = picture(found)
    names = list(found.home.values)
    losses = {
        TITLES.get(over, over): min(each.items(), key=lambda pair: pair[1].lost.value)
        for over, each in found.cells.items()
    }
    over, (changed, cell) = min(losses.items(), key=lambda pair: pair[1][1].lost.value)
    values = {
        "f": found,
        "names": names,
        "losses": losses,
        "worst": (over, changed, cell),
        "ahead": [name for name, gap in cell.gained.items() if gap.value < 0.0],
        "shown": names[:1] + sorted(names[1:], key=lambda name: -cell.values[name]["reward"].value)[:2],
        "first": dots({f"{over} {label}": c.lost for over, (label, c) in losses.items()}, "change of the reward"),
        "rows": {HOME: {found.trained: found.home}, **found.cells},
        "aim": policy_report.aim(found.units),
        "picture": image(drawn),
        "shade": policy_report.shade,
        "first_seed": HELD_OUT,
    }
    page = Page("shift", values)
    with replaced_directory(out, CONTENTS) as part:
        (part / "shift.svg").write_text(drawn, encoding="utf-8")
        write_page(part, page, {"shift.json": as_json(found)}, trace)
