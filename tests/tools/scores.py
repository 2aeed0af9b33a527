"""The scores of baselines and shipped policies: their file, the page that the site makes of it, reward thresholds."""

import json
import math
from collections.abc import Mapping, Sequence
from pathlib import Path

from steer_env.environments import table
from steer_env.experiments.learning import benchmark, policy_report
from steer_env.experiments.learning.benchmark import BASELINE, Scored
from steer_env.experiments.learning.controllers import SIMPLE
from steer_env.experiments.pages.files import write_json, write_text
from steer_env.experiments.reports.benchmark_page import MARK, standings
from steer_env.registration import DRIVEN

FILE = Path(__file__).with_suffix(".json")


def write(path: Path, entries: Sequence[Scored]) -> None:
    """Write what the page shows of entries, each in a line, in the form of a result file without episodes."""
    lines = [json.dumps(benchmark.summarise(entry._replace(parts=_shown(entry)))) for entry in entries]
    write_text(path, "[\n" + ",\n".join(lines) + "\n]\n")


def _shown(entry: Scored) -> dict[str, benchmark.Part]:
    """The parts of an entry with reward, cost and the metric that the task is judged by, without its others."""
    found = {}
    for name, part in entry.parts.items():
        keys = ("reward", "cost", policy_report.aim(part.summary)) if part.summary else ()
        found[name] = part._replace(summary={key: part.summary[key] for key in keys})
    return found


def read(path: Path = FILE) -> list[Scored]:
    """The entries of a file of :func:`write`."""
    return [benchmark.score_entry(said) for said in json.loads(path.read_text(encoding="utf-8"))]


def thresholds(entries: Sequence[Scored]) -> dict[str, float]:
    """The reward from which an id counts as solved: the mean of its best baseline, rounded down to three digits."""
    best: dict[str, float] = {}
    for entry in entries:
        if entry.controller["kind"] == BASELINE and entry.controller["name"] not in SIMPLE:
            for drive in entry.suite.drives.values():
                if drive.env_id in DRIVEN and drive.friction is None and (found := entry.parts[drive.name].summary):
                    best[drive.env_id] = max(best.get(drive.env_id, -math.inf), found["reward"].value)
    return {env_id: rounded_down(value) for env_id, value in sorted(best.items())}


def rounded_down(value: float) -> float:
    """A number with three digits, not above it."""
    if value == 0.0:
        return value
    unit = 10.0 ** (math.floor(math.log10(abs(value))) - 2)
    return round(math.floor(value / unit) * unit, 12)


def write_thresholds(path: Path, found: Mapping[str, float]) -> None:
    """Set the thresholds of ids in a JSON file, and keep those of the others that are there."""
    old = json.loads(path.read_text(encoding="utf-8")) if path.is_file() else {}
    write_json(path, dict(sorted({**old, **found}.items())))


def markdown(entries: Sequence[Scored]) -> str:
    """The page of all tables."""
    solved = thresholds(entries)
    lines = [
        "# Scores",
        "`steer-env benchmark` gives these tables, and [Benchmark](docs/benchmark.md) tells how a score is made: every "
        "controller in the same held-out episodes of each id or friction law; mean and 95 % interval. "
        f"`{MARK}` marks a mean cost above the limit of 1.",
    ]
    for standing in standings(entries):
        seeds, summary, terms = standing.seeds, standing.summary(), standing.terms()
        lines += [f"## {summary.caption}", f"{len(seeds)} seeds from {seeds[0]} to {seeds[-1]}."]
        lines += [table(summary.head, summary.rows), f"### {terms.caption}", table(terms.head, terms.rows)]
        for name, drive in standing.suite.drives.items():
            if drive.friction is None or drive.env_id not in DRIVEN:
                shown = standing.of_drive(drive)
                threshold = f" `reward_threshold`: {solved[name]:g}." if name in solved else ""
                told = f"{shown.caption.removeprefix(f'{name}: ')}. {shown.about}{threshold}"
                lines += [f"### `{name}`", told, table(shown.head, shown.rows)]
    return "\n\n".join(lines) + "\n"
