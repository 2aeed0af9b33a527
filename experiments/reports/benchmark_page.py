"""The table of the benchmark: the scores of every result file of a folder."""

import re
from collections.abc import Sequence
from pathlib import Path
from typing import Any, NamedTuple

import gymnasium as gym

from steer_env import tasks
from steer_env.environments import default_speed
from steer_env.experiments.learning import benchmark, policy_report, records, tuners
from steer_env.experiments.learning.benchmark import CONTROLLER_KINDS, Drive, Part, Scored, Suite
from steer_env.experiments.learning.held_out import Estimate
from steer_env.experiments.pages import provenance
from steer_env.experiments.pages.pages import Page, write_page
from steer_env.experiments.pages.pictures import dots
from steer_env.experiments.pages.words import label, unit, within
from steer_env.registration import DRIVEN, TUNED

MARK = "*"  # beside what was earned with a mean cost above the limit
NO_VALUE = "–"
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

    entries: list[Scored]

    @property
    def suite(self) -> Suite:
        """The suite."""
        return self.entries[0].suite

    @property
    def seeds(self) -> tuple[int, ...]:
        """The seeds."""
        return self.entries[0].seeds

    @property
    def names(self) -> list[str]:
        """Names of the entries."""
        return [label(entry.controller["name"]) for entry in self.entries]

    def picture(self) -> object:
        """Scores with their intervals."""
        scores = [entry.score for entry in self.entries]
        return dots(dict(zip(self.names, scores)), "score", (1.0, "references"), name=f"scores-{self.suite.name}")

    def summary(self) -> Table:
        """The score of every entry, and of its parts."""
        drives = self.suite.drives
        rows = [
            (name, spread(entry.score), *(_marked(entry.parts[drive]) for drive in drives))
            for name, entry in zip(self.names, self.entries)
        ]
        return Table(f"Scores in the suite {self.suite.name}", ("entry", "score", *map(short, drives.values())), rows)

    def terms(self) -> Table:
        """On which terms every entry acts, and with what budget it was tuned."""
        rows = [
            (name, *(entry.controller["terms"].get(key, NO_VALUE) for key in TERMS))
            for name, entry in zip(self.names, self.entries)
        ]
        return Table(f"Terms of the entries in {self.suite.name}", ("entry", *TERMS), rows, text=True)

    def of_drive(self, drive: Drive) -> Table:
        """Score, reward, cost, failures and the metric that the task is judged by, of every entry in a drive."""
        parts = [(name, entry.parts[drive.name]) for name, entry in zip(self.names, self.entries)]
        entered = [(name, part) for name, part in parts if part.summary]
        aims, units = [], {}
        if drive.env_id in DRIVEN:
            aims = [policy_report.aim({key for _, part in entered for key in part.summary})]
            units = {metric.name: unit(metric.unit) for metric in tasks.task(_task(drive)).metrics}
        rows = [
            (
                name,
                _marked(part),
                *(spread(part.summary[key]) for key in ("reward", "cost")),
                f"{part.failed} of {len(self.seeds)}",
                *(spread(part.summary[aim]) for aim in aims),
            )
            for name, part in sorted(entered, key=lambda row: -row[1].score.value)
        ]
        part = parts[0][1]
        caption = f"{drive.name}: Score 1 is {label(part.reference)}, {spread(part.span)} of reward above zero action"
        shown = [f"{label(aim)} [{units[aim]}]" if units.get(aim) else label(aim) for aim in aims]
        return Table(caption, ("entry", "score", "reward", "cost", "failed", *shown), rows, settings(drive))

    def tables(self) -> list[Table]:
        """All tables."""
        return [self.summary(), self.terms(), *map(self.of_drive, self.suite.drives.values())]


def standings(entries: Sequence[Scored]) -> list[Standing]:
    """Entries by suite and seeds, in the order of the suites."""
    groups: dict[tuple[str, tuple[int, ...]], list[Scored]] = {}
    for entry in sorted(entries, key=lambda each: benchmark.names().index(each.suite.name)):
        groups.setdefault((entry.suite.name, entry.seeds), []).append(entry)
    return [Standing(sorted(group, key=lambda each: -each.score.value)) for group in groups.values()]


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
        return NO_VALUE
    return spread(part.score) + (f" {MARK}" if part.beyond_limit else "")


def read(folder: Path) -> list[Scored]:
    """The entries of a folder, by the names of their files; ValueError for a file that is none."""
    paths = sorted(
        path
        for suite in benchmark.names()
        for kind in CONTROLLER_KINDS
        for path in folder.glob(f"{suite}-{kind}-*.json")
    )
    return [benchmark.score_entry(benchmark.read(path)) for path in paths]


def write(folder: Path) -> Path:
    """Write the page of all results in a folder; its path."""
    write_page(folder, Page("benchmark", {"standings": standings(read(folder)), "mark": MARK}), {}, provenance.trace())
    return folder / "index.html"
