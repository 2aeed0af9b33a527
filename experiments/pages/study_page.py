"""The page of a study: a verdict, then claims with evidence, verdict and limits; beside it the numbers as JSON."""

import argparse
import shlex
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

from steer_env.experiments.pages import provenance
from steer_env.experiments.pages.files import replaced_directory, usable, write_json, write_text
from steer_env.experiments.pages.pages import environment, image
from steer_env.experiments.pages.traces import embedded


class Table(NamedTuple):
    """A table of text."""

    caption: str
    head: Sequence[str]
    rows: Sequence[Sequence[str]]
    note: str = ""
    folded: bool = False  # whether only the caption is shown at first


class Picture(NamedTuple):
    """A picture with what it shows."""

    svg: str
    caption: str


class Section(NamedTuple):
    """One claim of the literature, or of a colleague, and what became of it."""

    title: str
    claim: str
    evidence: str
    verdict: str
    limits: str
    pictures: Sequence[Picture] = ()
    tables: Sequence[Table] = ()
    headline: str = ""  # the verdict in a sentence to quote; empty: the verdict itself
    measured: bool = False  # whether it has computing times, which differ from one run to the next


class Page(NamedTuple):
    """A whole page."""

    name: str  # of the JSON file, without suffix
    title: str
    lead: str
    verdict: Sequence[str]  # sentences to quote
    sections: Sequence[Section]
    timing: Sequence[str] = ()  # sentences of the verdict that rest on computing times


def contents(name: str) -> frozenset[str]:
    """Files of a page."""
    return frozenset({"index.html", f"{name}.json"})


def parser(study: str, description: str | None) -> argparse.ArgumentParser:
    """A parser with the option ``--out``, the directory of the page."""
    found = argparse.ArgumentParser(prog=f"steer-env study {study}", description=description)
    text = f"directory, replaced as a whole (default {study})"
    found.add_argument("--out", metavar="DIR", type=Path, default=Path(study), help=text)
    return found


def check(out: Path, name: str) -> None:
    """ValueError for a directory that cannot take the page, to be called before the work."""
    usable(out, contents(name))


def write(out: Path, page: Page, data: Mapping[str, Any], trace: Mapping[str, Any]) -> Path:
    """Write ``index.html`` and the JSON file, both with the trace; returns the path of the page.

    Raises
    ------
    ValueError
        If ``out`` holds other files or cannot be written.
    """
    with replaced_directory(out, contents(page.name)) as part:
        place(part, page, data, trace)
    return out / "index.html"


def place(folder: Path, page: Page, data: Mapping[str, Any], trace: Mapping[str, Any]) -> None:
    """Write both files into a folder that is there, each as a whole."""
    template = environment("steer_env.experiments.studies").get_template("study.html.j2")
    command = shlex.join(["steer-env", *trace["command"]]) if "command" in trace else ""
    text = template.render(page=page, image=image, trace=trace, command=command)
    verdict = {"verdict": list(page.verdict)}  # without what rests on times, so that a rerun gives the same
    write_text(folder / "index.html", embedded(text, trace))
    write_json(folder / f"{page.name}.json", {**verdict, **data, "trace": trace})


def trace_of(study: str, argv: Sequence[str] | None, out: Path, **made: Any) -> dict[str, Any]:
    """The trace of a study's result, as :func:`steer_env.experiments.pages.provenance.trace`.

    ``argv`` are the study's own words, None for those of this process, which is no command to be run again. The
    command of the trace has no ``--out``, as the page does not depend on its place.
    """
    placed = argparse.ArgumentParser(add_help=False, allow_abbrev=False)
    placed.add_argument("--out")
    command = None if argv is None else ["study", study, *placed.parse_known_args(argv)[1]]
    return provenance.trace(command=command, result=out.name, **made)
