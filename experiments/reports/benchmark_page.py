"""The table of the benchmark: every result file of a folder, scored anew from its raw episodes."""

import re
from collections.abc import Sequence
from pathlib import Path
from typing import Any, NamedTuple

import gymnasium as gym

from steer_env import tasks
from steer_env.environments import default_speed
from steer_env.experiments.learning import benchmark, policy_report, records, tuners
from steer_env.experiments.learning.benchmark import KINDS, Drive, Part, Result
from steer_env.experiments.learning.constants import SUITES
from steer_env.experiments.learning.held_out import Estimate
from steer_env.experiments.pages import provenance
from steer_env.experiments.pages.pages import Page, place
from steer_env.experiments.pages.pictures import dots
from steer_env.experiments.pages.words import label, unit, within
from steer_env.registration import DRIVEN, TUNED

MARK = "*"  # beside what was earned with a mean cost above the limit
NONE = "–"
TERMS = ("information", "decides", "delay", "tuning")


class Table(NamedTuple):
    """A table with what is said above it and below."""

    caption: str
    head: tuple[str, ...]
    rows: list[tuple[str, ...]]
    about: str = ""
    text: bool = False  # whether its columns are text, which may have digits in it


class Standing(NamedTuple):
    """All entries of a suite on the same seeds, the best one first."""

    results: list[Result]
    scores: list[Estimate]
    parts: list[dict[str, Part]]

    @property
    def suite(self) -> str:
        """Name of the suite."""
        return self.results[0].suite.name

    @property
    def names(self) -> list[str]:
        """Names of the entries."""
        return [label(result.controller["name"]) for result in self.results]

    def picture(self) -> object:
        """Scores with their intervals."""
        return dots(dict(zip(self.names, self.scores)), "score", (1.0, "references"), name=f"scores-{self.suite}")

    def summary(self) -> Table:
        """The score of every entry, and of its parts."""
        drives = self.results[0].suite.drives
        rows = [
            (name, spread(score), *(_marked(parts[drive]) for drive in drives))
            for name, score, parts in zip(self.names, self.scores, self.parts)
        ]
        return Table(f"Scores in the suite {self.suite}", ("entry", "score", *map(short, drives.values())), rows)

    def terms(self) -> Table:
        """On which terms every entry acts, and with what budget it was tuned."""
        rows = [
            (name, *(result.controller["terms"].get(key, NONE) for key in TERMS))
            for name, result in zip(self.names, self.results)
        ]
        return Table(f"Terms of the entries in {self.suite}", ("entry", *TERMS), rows, text=True)

    def of_drive(self, drive: Drive) -> Table:
        """Score, reward, cost, failures and the metric that the task is judged by, of every entry in a drive."""
        some = self.results[0].episodes[drive.name][benchmark.ZERO]
        aims, units = [], {}
        if drive.env_id in DRIVEN:
            aims = [policy_report.aim(some.metrics)]
            units = {metric.name: unit(metric.unit) for metric in tasks.task(_task(drive)).metrics}
        rows = [
            (
                name,
                _marked(part),
                *(spread(part.summary[key]) for key in ("reward", "cost")),
                f"{part.failed} of {some.reward.size}",
                *(spread(part.summary[aim]) for aim in aims),
            )
            for name, part in sorted(
                ((name, parts[drive.name]) for name, parts in zip(self.names, self.parts) if parts[drive.name].summary),
                key=lambda row: -row[1].score.value,
            )
        ]
        part = self.parts[0][drive.name]
        caption = f"{drive.name}: Score 1 is {label(part.reference)}, {spread(part.span)} of reward above zero action"
        shown = [f"{label(aim)} [{units[aim]}]" if units.get(aim) else label(aim) for aim in aims]
        return Table(caption, ("entry", "score", "reward", "cost", "failed", *shown), rows, settings(drive))

    def tables(self) -> list[Table]:
        """All tables."""
        return [self.summary(), self.terms(), *map(self.of_drive, self.results[0].suite.drives.values())]


def standings(results: Sequence[Result]) -> list[Standing]:
    """Results by suite and seeds, in the order of the suites."""
    groups: dict[tuple[str, str], list[Result]] = {}
    for result in sorted(results, key=lambda each: [*SUITES].index(each.suite.name)):
        groups.setdefault((result.suite.name, result.round.sha256), []).append(result)
    found = []
    for group in groups.values():
        ranked = sorted(group, key=lambda each: -benchmark.score(each).value)
        found.append(Standing(ranked, [*map(benchmark.score, ranked)], [*map(benchmark.parts, ranked)]))
    return found


def _task(drive: Drive) -> str:
    return drive.env_id.removeprefix("steer_env/").partition("-")[0]


def short(drive: Drive) -> str:
    """The task without its role, in words, and the law: "lane keeping" of ``steer_env/AssistLaneKeeping-v3``."""
    name = re.sub("^(Driver|Assist|Tune)", "", _task(drive))
    words = "".join(f" {letter.lower()}" if letter.isupper() else letter for letter in name).strip()
    return words if drive.friction is None else f"{words}, {label(drive.friction)}"


def settings(drive: Drive) -> str:
    """The settings of a drive in words."""
    if drive.env_id in TUNED:
        return f"The best of {tuners.SETS} sets in an episode, in a context that is drawn for each seed."
    if drive.env_id == records.RECORD:
        return (
            "The reward is how many decibels the error of the predicted torque lies below the torque, both RMS; level, "
            "displacement and time of the contact are drawn for each seed, by up to a factor of "
            f"{records.FACTOR:g}; noise {100 * records.NOISE:g} % of the level."
        )
    env: Any = gym.make(drive.env_id).unwrapped
    task, usual = env.task, env.batch.usual_conditions
    speed = f"{3.6 * usual.speed:g} km/h" if task.speeds is None else f"a speed {default_speed(task)}"
    env.close()
    return (
        f"Decisions every {1e3 * env.control_dt:g} ms, actions of up to {task.action.scale:.3g} "
        f"{task.action.unit}, {speed}, sensor noise {usual.sensor_noise:g}, delay of the observation "
        f"{1e3 * usual.delay:g} ms."
    )


def spread(e: Estimate) -> str:
    """A mean and half the width of its interval."""
    return within(e.value, 0.5 * (e.high - e.low))


def _marked(part: Part) -> str:
    if not part.summary:
        return NONE
    return spread(part.score) + (f" {MARK}" if part.beyond_limit else "")


def read(folder: Path) -> list[Result]:
    """The results of a folder, by the names of their files; ValueError for a file that is none."""
    paths = sorted(path for suite in SUITES for kind in KINDS for path in folder.glob(f"{suite}-{kind}-*.json"))
    return [benchmark.read(path)[1] for path in paths]


def write(folder: Path) -> Path:
    """Write the page of all results in a folder; its path."""
    place(folder, Page("benchmark", {"standings": standings(read(folder)), "mark": MARK}), {}, provenance.trace())
    return folder / "index.html"
