"""The tables and pictures of docs/paper.md, measured here or taken from the pages that longer commands have written.

A table stands between the lines ``<!-- made: NAME -->`` and ``<!-- end -->``.
"""

import importlib
import re
from collections.abc import Callable
from pathlib import Path
from types import ModuleType
from typing import Any

from steer_env import friction
from steer_env.environments import table
from steer_env.experiments.pages import friction_pictures
from steer_env.experiments.pages.files import write_text
from steer_env.experiments.studies import friction as study
from steer_env.experiments.studies import integrators, readme_picture
from steer_env.experiments.studies.common import friction_cases
from steer_env.experiments.studies.common.battery import MATTERS
from steer_env.experiments.studies.common.friction_results import QUICK
from steer_env.experiments.sweep import Where, run
from steer_env.vehicle import cars
from tests.verification import column
from tests.verification.common.rows import Row

DOCS = Path(__file__).resolve().parents[2] / "docs"
PAGE = DOCS / "paper.md"
MADE = re.compile(r"^<!-- made: (\w+) -->\n(.*?)\n<!-- end -->$", re.DOTALL | re.MULTILINE)
# Groups of ``verify``, in the order of the page; the others take longer, or are not on the accuracy of the model.
GROUPS = ("friction", "column", "assist", "strut", "rack", "tyre", "linear", "commonroad", "feel")
FURTHER = ("verify synthetic", "canudas1995", "verify power", "study coupling")  # commands in docs/validation.md


def measured(notify: Callable[[float, str], None]) -> dict[str, str]:
    """The tables that are measured; the pictures are drawn beside the page.

    Raises
    ------
    ValueError
        A requirement is missed.
    """
    cases = friction_cases.cases({name: friction.make(name) for name in friction.available()}, {})
    cases = [case for case in cases if case.factor != friction_cases.UNASSISTED]
    jobs = [*GROUPS, *((cars.load(), case, QUICK.tests) for case in cases)]
    found = run(perform, jobs, where=Where.parse(), notify=notify, words=_words)
    rows, driven = dict(zip(GROUPS, found)), found[len(GROUPS) :]
    if missed := [name for name, of in rows.items() if any(row.verdict == "FAIL" for row in of)]:
        raise ValueError(f"requirements are missed: python -m tests.maintain verify {' '.join(missed)}")
    picture = friction_pictures.strips(study.shares(friction_cases.effects(cases, driven)), MATTERS)
    write_text(DOCS / "friction_factors.svg", picture)
    readme_picture.main(["--out", str(DOCS / "feel.svg")])
    return {"checks": checks(rows), "schemes": schemes()}


def perform(job: Any) -> Any:
    """The rows of a group of requirements, or the drives of a case of the friction study."""
    return list(_group(job).rows()) if isinstance(job, str) else friction_cases.drives(job)


def _words(job: Any) -> str:
    return job if isinstance(job, str) else job[1].label


def _group(name: str) -> ModuleType:
    return importlib.import_module(f"tests.verification.{name}")


def checks(rows: dict[str, list[Row]]) -> str:
    """A row for each group of requirements: how many are met, and the one that is nearest to its limit."""
    lines = []
    for group, of in rows.items():
        title = _group(group).rows.__doc__.partition("\n")[0]
        verdicts = [row.verdict for row in of]
        share, nearest = max((closeness(row), row) for row in of if row.verdict == "pass")
        shown = f"{nearest.what}: {nearest.measured} ({nearest.required})" if share > 0.0 else "–"
        lines.append((title, str(verdicts.count("pass")), str(verdicts.count("deviates")), shown))
    return table(("what, against what", "met", "deviate, as named", "nearest to its limit"), lines)


def closeness(row: Row) -> float:
    """The largest share that a row's numbers have of their limits; 0 without a limit above or below."""
    values, limits = ([float(x) for x in re.findall(r"-?\d+(?:\.\d+)?(?:e[+-]?\d+)?", text)] for text in row[1:3])
    pairs = [(value, limit) for value, limit in zip(values, limits) if limit]
    if row.required.startswith("<="):
        return max((value / limit for value, limit in pairs), default=0.0)
    return max((limit / value for value, limit in pairs), default=0.0) if row.required.startswith(">=") else 0.0


def schemes() -> str:
    """The worst error of each scheme at 1 ms in the twelve cases of the column, by law."""
    rows = []
    for law in column.MOST:
        found = zip(integrators.TWELVE, integrators.twelve_cases(law), integrators.twelve_references(law))
        errors = [
            [integrators.relative_error(case, scheme, column.STEP, exact, F_c) for scheme in integrators.SCHEMES]
            for (F_c, *_), case, exact in found
        ]
        rows.append((law, *(f"{100.0 * max(of):.2g} %" for of in zip(*errors))))
    return table(("law", *integrators.SCHEMES), rows)


def section(page: str, title: str) -> list[str]:
    """The paragraphs of a section of a page of ``docs``."""
    text = (DOCS / page).read_text(encoding="utf-8")
    found = re.search(rf"^## {title}\n\n(.*?)(?=\n## |\Z)", text, re.DOTALL | re.MULTILINE)
    if found is None:
        raise ValueError(f"docs/{page} has no section {title!r}")
    return found[1].strip().split("\n\n")


def cells(block: str) -> list[list[str]]:
    """Cells of a table in Markdown, its head first."""
    lines = [[cell.strip() for cell in line.strip("| ").split(" |")] for line in block.splitlines()]
    return [lines[0], *lines[2:]]


def answer() -> str:
    """The answer of the friction study, without its sentence on the study's own page."""
    return re.sub(r" The page [^.]*\.", "", "\n\n".join(section("friction_study.md", "The answer")))


def verdict() -> str:
    """The sentences of that answer, after its table, that rank the law among what else changes the car."""
    blocks = section("friction_study.md", "The answer")
    after = next(text for text, before in zip(blocks[1:], blocks) if before.startswith("|"))
    return " ".join(re.split(r"(?<=\.) (?=[A-Z])", after)[:3])


def further() -> str:
    """Rows of the validation page whose commands do not run here."""
    blocks = (DOCS / "validation.md").read_text(encoding="utf-8").split("\n\n")
    head, *rows = cells(next(block for block in blocks if block.startswith("|")))
    return table(tuple(head), [tuple(row) for row in rows if any(name in row[-1] for name in FURTHER)])


def scores() -> str:
    """A row for each suite of the benchmark: its three best baselines, the shipped policies and random actions."""
    rows = []
    text = (DOCS / "scores.md").read_text(encoding="utf-8")
    for suite in re.findall(r"^## Scores in the suite (\w+)$", text, re.MULTILINE):
        blocks = section("scores.md", f"Scores in the suite {suite}")
        (_, _, *drives), *entries = cells(next(block for block in blocks if block.startswith("|")))
        of = {name: score.replace(" ", "\u00a0") for name, score, *_ in entries}
        shipped, random = (of.pop(name, "–") for name in ("shipped", "random"))
        best = [f"{name} {score}" for name, score in list(of.items())[:3]]
        rows.append((suite, str(len(drives)), *best, shipped, random))
    return table(("suite", "drives", "best baseline", "second", "third", "shipped policies", "random actions"), rows)


TAKEN: dict[str, Callable[[], str]] = {"answer": answer, "verdict": verdict, "further": further, "scores": scores}


def write(more: dict[str, str]) -> None:
    """Write the tables that are taken from other pages, and more, into the page; those that are not made stay."""
    made = {name: taken() for name, taken in TAKEN.items()} | more

    def filled(found: re.Match[str]) -> str:
        name = found[1]
        return f"<!-- made: {name} -->\n\n{made[name]}\n\n<!-- end -->" if name in made else found[0]

    write_text(PAGE, MADE.sub(filled, PAGE.read_text(encoding="utf-8")))
