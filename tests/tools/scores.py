"""docs/scores.md, the table of the benchmark in Markdown, and the reward thresholds that come from it."""

import json
import math
from collections.abc import Mapping, Sequence
from pathlib import Path

from steer_env.environments import table
from steer_env.experiments.learning.benchmark import BASELINE
from steer_env.experiments.learning.controllers import SIMPLE
from steer_env.experiments.pages.files import write_json
from steer_env.experiments.reports.benchmark_page import MARK, Standing
from steer_env.registration import DRIVEN


def thresholds(standings: Sequence[Standing]) -> dict[str, float]:
    """The reward from which an id counts as solved: the mean of its best baseline, rounded down to three digits."""
    best: dict[str, float] = {}
    for standing in standings:
        for result, parts in zip(standing.results, standing.parts):
            if result.controller["kind"] == BASELINE and result.controller["name"] not in SIMPLE:
                for drive in standing.results[0].suite.drives.values():
                    if drive.env_id in DRIVEN and drive.friction is None and (found := parts[drive.name].summary):
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


def markdown(found: Sequence[Standing]) -> str:
    """The page of all tables."""
    solved = thresholds(found)
    lines = [
        "# Scores",
        "`steer-env benchmark` writes these tables, and [benchmark.md](benchmark.md) tells how a score is made: every "
        "controller in the same held-out episodes of each id or friction law; mean and 95 % interval. "
        f"`{MARK}` marks a mean cost above the limit of 1.",
    ]
    for standing in found:
        seeds = standing.results[0].round.seeds
        summary, terms = standing.summary(), standing.terms()
        lines += [f"## {summary.caption}", f"{len(seeds)} seeds from {seeds[0]} to {seeds[-1]}."]
        lines += [table(summary.head, summary.rows), f"### {terms.caption}", table(terms.head, terms.rows)]
        for name, drive in standing.results[0].suite.drives.items():
            if drive.friction is None or drive.env_id not in DRIVEN:
                shown = standing.of_drive(drive)
                threshold = f" `reward_threshold`: {solved[name]:g}." if name in solved else ""
                told = f"{shown.caption.removeprefix(f'{name}: ')}. {shown.about}{threshold}"
                lines += [f"### `{name}`", told, table(shown.head, shown.rows)]
    return "\n\n".join(lines) + "\n"
